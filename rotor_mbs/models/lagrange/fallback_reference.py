"""A reference where heyoka is not installed: DOP853 at its tightest, with the larger uncertainty that it has."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from rotor_mbs.models.lagrange.integrators import scipy_integrator
from rotor_mbs.models.lagrange.ode_solvers import OdeSolver
from rotor_mbs.models.lagrange.rate_units import rate_units
from rotor_mbs.scenario.scene import Scene
from rotor_mbs.solution.record import Array, Integration, Trajectory

# The tightest SciPy takes is 100 eps; a hundred times looser beside it shows how much the tolerance still decides.
_TIGHTEST = (2.3e-14, 1e-16)
_LOOSER = (2.3e-12, 1e-14)

# Far above round-off, far below what bends the neighbouring trajectory away from the linear.
_PERTURBATION = 1e-9


class FallbackReference:
    """Two DOP853 runs, and one more for each initial value, perturbed, to see how errors grow."""

    def __init__(self, scene: Scene) -> None:
        self._scene = scene
        self._runs = [OdeSolver(scene, scipy_integrator("DOP853", *tolerances)) for tolerances in (_TIGHTEST, _LOOSER)]

    def integrate(self) -> Integration:
        best, _ = (run.integrate() for run in self._runs)
        return best

    def observe(self) -> Trajectory:
        result, check = (run.observe() for run in self._runs)
        rows = min(len(result.time), len(check.time))
        difference = np.full(len(result.time), np.inf)
        difference[:rows] = np.abs(result.angles[:rows] - check.angles[:rows]).max(axis=1)
        result.angle_uncertainty = np.maximum(difference, np.finfo(float).eps)
        result.error_growth = self._growth(result)
        return result

    def _growth(self, result: Trajectory) -> Array:
        """(n,) by the same measure as the variational equations: largest singular value of the difference quotients."""
        state = np.hstack([result.angles, result.rates])
        moving = rate_units(self._scene)
        all_rates = np.ones(result.rates.shape[1])
        all_rates[_moving(self._scene)] = moving
        by_row = np.concatenate([np.ones(len(all_rates)), all_rates])
        by_column = np.stack([np.ones(len(moving)), moving], axis=1).ravel()  # the neighbours' order
        columns = []
        for neighbour in _neighbours(self._scene):
            solver = OdeSolver(neighbour, scipy_integrator("DOP853", *_TIGHTEST))
            solver.integrate()
            near = solver.observe()
            column = np.full_like(state, np.inf)
            rows = min(len(near.time), len(state))
            column[:rows] = (np.hstack([near.angles, near.rates])[:rows] - state[:rows]) / _PERTURBATION
            columns.append(column)
        matrices = np.stack(columns, axis=-1) * by_column / by_row[:, None]
        growth = np.full(len(state), np.inf)
        finite = np.isfinite(matrices).all(axis=(1, 2))
        growth[finite] = np.linalg.norm(matrices[finite], ord=2, axis=(1, 2))
        return growth


def _neighbours(scene: Scene) -> list[Scene]:
    """The scene started a little off, in one angle or rate each; pitches without inertia have no neighbour."""
    found = []
    for i in _moving(scene):
        angles, rates = list(scene.initial_angles), list(scene.initial_rates)
        angles[i] += _PERTURBATION
        rates[i] += _PERTURBATION
        found.append(replace(scene, initial_angles=tuple(angles)))
        found.append(replace(scene, initial_rates=tuple(rates)))
    return found


def _moving(scene: Scene) -> list[int]:
    return [0] + [1 + i for i, blade in enumerate(scene.blades) if blade.has_pitch_inertia]
