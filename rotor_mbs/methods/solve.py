"""The one loop that builds a method's solver, times it and takes its samples."""

from __future__ import annotations

import gc
import time
from collections.abc import Mapping

import numpy as np

from rotor_mbs.errors import RotorError, system_errors_apart
from rotor_mbs.methods.base import Method
from rotor_mbs.methods.catalogue import find_method
from rotor_mbs.methods.time_limit import OutOfTimeError, caller_signals, time_limit
from rotor_mbs.scenario.scene import Scene
from rotor_mbs.solution.trajectory import Solution, shape_fault

_OBSERVING_S = 1.0  # in any case, of what was reached by the time limit


@caller_signals()
def solve(
    method: Method | str,
    scene: Scene,
    settings: Mapping[str, object],
    repeats: int = 1,
    budget_s: float = float("inf"),
    time_limit_s: float = float("inf"),
) -> Solution:
    """Build once, integrate up to `repeats` times within `budget_s`, the garbage collector off, and observe once;
    `settings` that differ from the defaults; `time_limit_s` is for the integrations together. The Solution is not yet
    judged, and holds a failure of the engine. Raises InputError for an unknown method or setting, MethodRefusal,
    OutOfTimeError where a method cannot keep the samples it reached, RotorError where an array has a wrong shape, one
    of SYSTEM_ERRORS where the system lacks something or a library cannot be loaded, and what the method raises."""
    method = find_method(method) if isinstance(method, str) else method
    chosen = method.chosen(scene, settings)
    with system_errors_apart(OutOfTimeError):
        start = time.perf_counter()
        solver = method.build(scene, chosen)
        setup = time.perf_counter() - start
        run_times: list[float] = []
        gc_was_on = gc.isenabled()
        begun = time.monotonic()
        try:
            gc.disable()
            with time_limit(time_limit_s):
                while not run_times or (len(run_times) < repeats and sum(run_times) + run_times[-1] < budget_s):
                    start = time.perf_counter()
                    integration = solver.integrate()
                    run_times.append(time.perf_counter() - start)
                    if integration.out_of_time:  # another would not be stopped
                        break
        finally:
            if gc_was_on:
                gc.enable()
        start = time.perf_counter()
        left = max(begun + time_limit_s - time.monotonic(), _OBSERVING_S)
        with (
            time_limit(left),
            np.errstate(over="ignore", invalid="ignore"),
        ):  # of a runaway: the judgement sees what is not finite
            trajectory = solver.observe()
        output = time.perf_counter() - start
    if fault := shape_fault(scene, trajectory):
        raise RotorError(f"{method.name}: {fault}")
    return Solution(scene, method.name, trajectory, integration, chosen.as_dict(), setup, run_times, output)
