"""reference: the closed form in quad precision, with an uncertainty from two tolerances and the growth of errors."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np

from rotor_mbs.models.lagrange import samples
from rotor_mbs.models.lagrange.fallback_reference import FallbackReference
from rotor_mbs.models.lagrange.heyoka_adapter import array_of, heyoka, is_available
from rotor_mbs.models.lagrange.rate_units import rate_units
from rotor_mbs.models.lagrange.system import Propagation, System, build_system, compiled, initial_state, set_parameters
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


def _quad_propagation(scene: Scene, system: System, tolerance: float) -> Propagation:
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
