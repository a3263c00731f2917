"""reference: the closed form in quad precision, with an uncertainty from two tolerances and the growth of errors."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np

from rotor_mbs.models.lagrange import samples
from rotor_mbs.models.lagrange.heyoka_adapter import array_of, heyoka, is_available
from rotor_mbs.models.lagrange.ode_solvers import OdeSolver, scipy_integrator
from rotor_mbs.models.lagrange.parameters import rate_units
from rotor_mbs.models.lagrange.system import (
    EquationSystem,
    Propagation,
    build_system,
    compiled,
    initial_state,
    set_parameters,
)
from rotor_mbs.scenario.scene import Scene
from rotor_mbs.solution.record import Array, Integration, Trajectory


class ReferenceSolver:
    """Two quad runs and the double precision variational equations over the scene's sample times.

    The tolerance of the run that is kept is a thousandth of the other's: their distance bounds the error of the other,
    and the one that is kept is a thousand times better, or at quad round-off.
    """

    def __init__(self, scene: Scene, tolerance: float, check_tolerance: float) -> None:
        self._scene = scene
        self._system = build_system(scene)
        self._runs = [_quad_propagation(scene, self._system, tol) for tol in (tolerance, check_tolerance)]

    def integrate(self) -> Integration:
        best, check = (run.run() for run in self._runs)
        self._rows = min(len(run.states) for run in self._runs)
        return best if not best.success else replace(check, time_reached=best.time_reached, steps=best.steps)

    def observe(self) -> Trajectory:
        best, check = (run.states[: self._rows] for run in self._runs)
        moving = self._system.moving
        time = np.linspace(0.0, self._scene.duration, self._scene.samples)
        result = samples.trajectory(self._scene, time[: self._rows], best.astype(float), moving)
        difference = np.abs((best - check)[:, : len(moving)]).astype(float)
        result.angle_uncertainty = difference.max(axis=1)
        result.error_growth = error_growth(self._scene)[: self._rows]
        return result


def build(scene: Scene, settings: Any) -> ReferenceSolver | FallbackReference:
    """In quad precision with heyoka; without it the fallback, whose uncertainty is larger by many orders."""
    if not is_available():
        return FallbackReference(scene)
    return ReferenceSolver(scene, settings.tolerance, settings.check_tolerance)


def _quad_propagation(scene: Scene, system: EquationSystem, tolerance: float) -> Propagation:
    engine = heyoka()
    pars = array_of(system.parameters.values, quad=True)
    initial = array_of(initial_state(scene, system), quad=True)
    integrator = compiled(
        ("quad", tolerance, system.structure),
        lambda: engine.taylor_adaptive(
            system.equations,
            state=initial,
            tol=engine.real128(tolerance),
            compact_mode=True,
            fp_type=engine.real128,
        ),
    )
    set_parameters(integrator, pars)
    return Propagation(integrator, system, initial, np.linspace(0.0, scene.duration, scene.samples))


def error_growth(scene: Scene) -> Array:
    """(samples,) How many times a small error of the initial state may have grown by each sample, at most.

    The largest singular value of the state transition matrix (angles in rad, rates in `rate_units`), from the
    variational equations of the closed form; infinite once it is past what double precision can hold.
    """
    engine = heyoka()
    system = build_system(scene)
    count = 2 * len(system.moving)
    equations = system.equations[:count]
    variational = engine.var_ode_sys(equations, args=engine.var_args.vars, order=1)
    pars = array_of(system.parameters.values, quad=False)
    initial = array_of(initial_state(scene, system)[:count], quad=False)
    integrator = compiled(
        ("growth", system.structure),
        lambda: engine.taylor_adaptive(variational, state=initial, compact_mode=True),
    )
    set_parameters(integrator, pars)
    whole = np.concatenate([initial, np.eye(count).ravel()])
    times = np.linspace(0.0, scene.duration, scene.samples)
    propagation = Propagation(integrator, system, whole, times)
    propagation.run()
    growth = np.full(scene.samples, np.inf)
    units = np.concatenate([np.ones(count // 2), rate_units(scene)])
    matrices = propagation.states[:, count:].reshape(-1, count, count) * units / units[:, None]
    growth[: len(matrices)] = np.linalg.norm(matrices, ord=2, axis=(1, 2))
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
