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

_OBSERVING_S = 1.0  # s that are always left to take the samples, also after the time limit


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
    settings : those that differ from the method's defaults.
    repeats : how often to integrate at most; the samples are those of the last time.
    budget_s : s, of all integrations together. It does not limit the first one; a further one is
        begun only if it is expected to end within the budget.
    time_limit_s : s, of all integrations together, after which the running one is stopped.

    Returns
    -------
    Solution
        Not judged yet, without a status; its `integration` is the engine's report.

    Raises
    ------
    InputError
        For an unknown method or setting, or a value that is not allowed.
    MethodRefusal
        If the method cannot represent the scene.
    OutOfTimeError
        If the method cannot keep the samples that it had reached at the time limit.
    RotorError
        If the method returns objects of other types, or arrays of a wrong shape.
    Exception
        One of SYSTEM_ERRORS if the system lacks memory, files or processes, or a library cannot be
        loaded; otherwise what the method raises.
    """
    method = find_method(method) if isinstance(method, str) else method
    chosen = method.chosen(scene, settings)
    with system_errors_apart(OutOfTimeError):
        start = time.perf_counter()
        solver = _checked_solver(method, method.build(scene, chosen))
        setup_s = time.perf_counter() - start

        run_times: list[float] = []
        # A collection of garbage within an integration would be timed with it.
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
                    if integration.out_of_time:  # a further one would have no limit
                        break
        finally:
            if gc_was_on:
                gc.enable()

        start = time.perf_counter()
        remaining_s = max(begin + time_limit_s - time.monotonic(), _OBSERVING_S)
        # Samples of a diverging run overflow; the judgement finds what is not finite.
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
    """Return what a method's `build` returned. Raises RotorError if it is no solver."""
    missing = [name for name in ("integrate", "observe") if not hasattr(solver, name)]
    if missing:
        place = place_of(method.build, method.name)
        what = "None" if solver is None else f"an object without {' and '.join(missing)}"
        allowed = "an object with integrate and observe"
        raise RotorError(f"{place}: build returned {what}; allowed: {allowed}")
    return solver


def _check_report(method: Method, solver: Solver, integration: Integration) -> None:
    """Raise RotorError if what a solver reports of an integration is of a wrong type."""
    checked_result(integration, Integration, "integrate", solver.integrate, method.name)
    if fault := report_fault(integration):
        raise RotorError(f"{place_of(solver.integrate, method.name)}: {fault}")


def _has_time(run_times: list[float], repeats: int, budget_s: float) -> bool:
    """Return whether to integrate once more, expected to take as long as the last time."""
    return len(run_times) < repeats and sum(run_times) + run_times[-1] < budget_s
