"""Run one method on one scene: build its solver, time it, and take the samples."""

from __future__ import annotations

import gc
import time
from collections.abc import Mapping

import numpy as np

from rotor_mbs.errors import RotorError, system_errors_apart
from rotor_mbs.methods.base import Method, Solver, checked_result, place_of
from rotor_mbs.methods.catalogue import find_method
from rotor_mbs.methods.time_limit import OutOfTimeError, caller_signals, time_limit
from rotor_mbs.scenario.scene import Scene
from rotor_mbs.solution.trajectory import (
    Integration,
    Solution,
    Trajectory,
    report_fault,
    shape_fault,
)

_OBSERVING_S = 1.0  # time in s that taking the samples may always take, even after the time limit


@caller_signals()
def solve(
    method: Method | str,
    scene: Scene,
    settings: Mapping[str, object],
    repeats: int = 1,
    budget_s: float = float("inf"),
    time_limit_s: float = float("inf"),
) -> Solution:
    """Build a method's solver for a scene, integrate, and take the samples.

    Parameters
    ----------
    method : the method, or its name.
    scene : the scene.
    settings : values by name of the setting. Settings that are not given have their defaults.
    repeats : largest number of integrations. The samples are those of the last one.
    budget_s : s, for all integrations together. The first integration is not limited by it. A
        further one is begun only if it is expected to end within the budget.
    time_limit_s : s, for all integrations together. The integration that reaches it is stopped.

    Returns
    -------
    Solution
        The run without a status, as it is not judged yet. Its `integration` is the engine's report.

    Raises
    ------
    InputError
        If the method or a setting is unknown, or a value is not allowed.
    MethodRefusal
        If the method cannot represent the scene.
    OutOfTimeError
        If the time limit is reached, and the method cannot return the samples up to then or takes
        too long to return them.
    RotorError
        If the method returns objects of wrong types, or arrays of a wrong shape.
    Exception
        Any error that the method raises. It is one of SYSTEM_ERRORS if the system lacks memory,
        files or processes, or a library cannot be loaded.
    """
    method = find_method(method) if isinstance(method, str) else method
    chosen = method.chosen(scene, settings)
    with system_errors_apart(OutOfTimeError):
        start = time.perf_counter()
        solver = _checked_solver(method, method.build(scene, chosen))
        setup_s = time.perf_counter() - start

        run_times: list[float] = []
        # Python's garbage collection is off, as its time would count as time of the integration.
        gc_was_on = gc.isenabled()
        begin = time.monotonic()
        try:
            gc.disable()
            with time_limit(time_limit_s):
                while not run_times or _has_time(run_times, repeats, budget_s):
                    start = time.perf_counter()
                    integration = solver.integrate()
                    run_times.append(time.perf_counter() - start)
                    _check_report(method, solver, integration)
                    # The time limit interrupts only once: it would not end a further integration.
                    if integration.out_of_time:
                        break
        finally:
            if gc_was_on:
                gc.enable()

        start = time.perf_counter()
        remaining_s = max(begin + time_limit_s - time.monotonic(), _OBSERVING_S)
        # Samples of a diverging run may overflow: no warning, as the judgement reports values that
        # are not finite.
        with time_limit(remaining_s), np.errstate(over="ignore", invalid="ignore"):
            trajectory = solver.observe()
        checked_result(trajectory, Trajectory, "observe", solver.observe, method.name)
        output_s = time.perf_counter() - start
    if fault := shape_fault(scene, trajectory):
        raise RotorError(f"{method.name}: {fault}")
    return Solution(
        scene,
        method.name,
        trajectory,
        integration,
        chosen.as_dict(),
        setup_s,
        run_times,
        output_s,
    )


def _checked_solver(method: Method, solver: Solver) -> Solver:
    """Return the solver that a method's `build` returned. Raises RotorError if it is not one."""
    missing = [name for name in ("integrate", "observe") if not hasattr(solver, name)]
    if missing:
        place = place_of(method.build, method.name)
        what = "None" if solver is None else f"an object without {' and '.join(missing)}"
        allowed = "an object with integrate and observe"
        raise RotorError(f"{place}: build returned {what}; allowed: {allowed}")
    return solver


def _check_report(method: Method, solver: Solver, integration: Integration) -> None:
    """Raise RotorError if the report of an integration, or a field of it, is of a wrong type."""
    checked_result(integration, Integration, "integrate", solver.integrate, method.name)
    if fault := report_fault(integration):
        raise RotorError(f"{place_of(solver.integrate, method.name)}: {fault}")


def _has_time(run_times: list[float], repeats: int, budget_s: float) -> bool:
    """Return whether to integrate again, as `repeats` and the budget allow it.

    The next integration is expected to take as long as the last one.
    """
    return len(run_times) < repeats and sum(run_times) + run_times[-1] < budget_s
