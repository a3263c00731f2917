"""reference: the closed form in quad precision, a bound on its error from two tolerances, and the growth of errors."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from rotor_mbs.models.lagrange import samples
from rotor_mbs.models.lagrange.heyoka_adapter import is_available
from rotor_mbs.models.lagrange.loads import quad_loads
from rotor_mbs.models.lagrange.ode_solvers import OdeSolver, scipy_integrator
from rotor_mbs.models.lagrange.parameters import rate_units
from rotor_mbs.models.lagrange.system import Propagation, build_system
from rotor_mbs.scenario.scene import Scene
from rotor_mbs.solution.record import Array, Integration, Trajectory

# The uncertainty is this many times what two runs show. They differ in their truncation errors and in the rounding of
# each step, but not in what they share: the rounded coefficients, and the rounding of a motion that both step through
# alike (a uniform rotation). Against 180 bits at tolerance 1e-42 the error of the shipped scenes is at most 5.0 times
# the sum of difference and rounding (paper/fig15-100kNm).
SAFETY = 10.0

_QUAD_EPSILON = 2.0**-112


class ReferenceSolver:
    """Two quad runs and the double precision variational equations over the scene's sample times.

    The tolerance of the run that is kept is a thousandth of the other's: their distance is the truncation error of the
    other, or, where both are at quad round-off, of the size of that.
    """

    def __init__(self, scene: Scene, tolerance: float, check_tolerance: float) -> None:
        self._scene = scene
        system = build_system(scene)
        self._runs = [
            Propagation(scene, system, quad=True, tol=tol, compact_mode=True) for tol in (tolerance, check_tolerance)
        ]

    def integrate(self) -> Integration:
        best, check = (run.run() for run in self._runs)
        return best if not best.success else replace(check, time_reached=best.time_reached, steps=best.steps)

    def observe(self) -> Trajectory:
        rows = min(len(run.states) for run in self._runs)
        best, check = (run.states[:rows] for run in self._runs)
        result = samples.trajectory(self._scene, self._runs[0].times, best.astype(float))
        if self._scene.wants("loads"):
            result.quantities |= quad_loads(self._scene, result.time, best)
        difference = np.abs((best - check)[:, : len(self._scene.moving_coordinates)]).astype(float).max(axis=1)
        result.angle_uncertainty = uncertainty(difference, result.angles, _QUAD_EPSILON)
        result.error_growth = error_growth(self._scene)[:rows]
        return result


def uncertainty(difference: Array, angles: Array, epsilon: float) -> Array:
    """(n,) rad: a bound on the error of the angles, from how far two runs of unlike tolerance are apart.

    `SAFETY` times the sum of the difference and of the rounding of the largest angle (at least 1 rad), because two runs
    may round alike; of it the largest so far, because two runs may meet at a sample by chance. It does not contain the
    rounding of the angles to double precision when they are stored, at most half a unit in the last place.

    difference  (n,) rad, largest over the angles
    angles      (n, 1 + blades) rad
    epsilon     of the runs' arithmetic
    """
    largest = np.maximum(np.abs(angles).max(axis=1), 1.0)
    bound: Array = SAFETY * np.maximum.accumulate(difference + epsilon * largest)
    return bound


def build(scene: Scene, settings: Any) -> ReferenceSolver | FallbackReference:
    """In quad precision with heyoka; without it the fallback, whose uncertainty is larger by many orders."""
    if not is_available():
        return FallbackReference(scene)
    return ReferenceSolver(scene, settings.tolerance, settings.check_tolerance)


def error_growth(scene: Scene) -> Array:
    """(samples,) How many times a small error of the initial state may have grown by each sample, at most.

    The largest singular value of the state transition matrix (angles in rad, rates in `rate_units`), from the
    variational equations of the closed form; infinite once it is past what double precision can hold.
    """
    count = 2 * len(scene.moving_coordinates)
    propagation = Propagation(scene, build_system(scene), variational=True, compact_mode=True)
    propagation.run()
    return _largest_growth(scene, propagation.states[:, count:].reshape(-1, count, count))


def _largest_growth(scene: Scene, matrices: Array) -> Array:
    """(samples,) from the state transition matrices of the first samples, as far as they are finite."""
    units = np.concatenate([np.ones(matrices.shape[1] // 2), rate_units(scene)])
    growth = np.full(scene.samples, np.inf)
    finite = np.flatnonzero(np.isfinite(matrices).all(axis=(1, 2)))
    growth[finite] = np.linalg.norm(matrices[finite] * units / units[:, None], ord=2, axis=(1, 2))
    return growth


# Where heyoka is not installed: DOP853 at its tightest, with the larger uncertainty that it has.

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
        result.angle_uncertainty = uncertainty(difference, result.angles, float(np.finfo(float).eps))
        result.error_growth = self._growth(result)
        return result

    def _growth(self, result: Trajectory) -> Array:
        """(n,) by the same measure as the variational equations, of difference quotients."""
        moving = self._scene.moving_coordinates
        state = _state(result, moving)
        columns = []
        for neighbour in _neighbours(self._scene, moving):
            solver = OdeSolver(neighbour, scipy_integrator("DOP853", *_TIGHTEST))
            solver.integrate()
            near = _state(solver.observe(), moving)
            column = np.full_like(state, np.inf)
            rows = min(len(near), len(state))
            column[:rows] = (near[:rows] - state[:rows]) / _PERTURBATION
            columns.append(column)
        return _largest_growth(self._scene, np.stack(columns, axis=-1))[: len(state)]


def _state(run: Trajectory, moving: Sequence[int]) -> Array:
    return np.hstack([run.angles[:, moving], run.rates[:, moving]])


def _neighbours(scene: Scene, moving: Sequence[int]) -> list[Scene]:
    """The scene started a little off in one angle, then in one rate each."""

    def beside(values: Sequence[float], i: int) -> tuple[float, ...]:
        return (*values[:i], values[i] + _PERTURBATION, *values[i + 1 :])

    angles = [replace(scene, initial_angles=beside(scene.initial_angles, i)) for i in moving]
    return angles + [replace(scene, initial_rates=beside(scene.initial_rates, i)) for i in moving]
