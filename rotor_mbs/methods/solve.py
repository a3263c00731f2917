"""The one loop that builds a method's solver, times it and takes its samples."""

from __future__ import annotations

import gc
import time
from collections.abc import Mapping

import numpy as np

from rotor_mbs.methods.base import Method
from rotor_mbs.methods.catalogue import find_method
from rotor_mbs.methods.time_limit import time_limit
from rotor_mbs.scenario.scene import Scene
from rotor_mbs.solution.solution import Solution


def solve(
    method: Method | str,
    scene: Scene,
    settings: Mapping[str, object],
    repeats: int = 1,
    budget_s: float = float("inf"),
    time_limit_s: float = float("inf"),
) -> Solution:
    """Build once, integrate up to `repeats` times while within `budget_s` (garbage collector off), observe once.

    The integrations together end themselves after `time_limit_s`; building (which may compile code) does not count.
    Raises InputError for an unknown method or setting, MethodRefusal as `Method.build` does, OutOfTimeError where a
    method cannot keep the samples it reached. A failure of the engine is in the result, not an exception.
    """
    method = find_method(method) if isinstance(method, str) else method
    chosen = method.settings.of(method.name, settings)
    start = time.perf_counter()
    solver = method.build(scene, chosen)
    setup = time.perf_counter() - start
    run_times: list[float] = []
    gc_was_on = gc.isenabled()
    gc.disable()
    try:
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
    with np.errstate(over="ignore", invalid="ignore"):  # of a runaway: the judgement sees what is not finite
        trajectory = solver.observe()
    output = time.perf_counter() - start
    found = Solution(scene, method.name, trajectory, integration, chosen.as_dict(), setup, run_times, output)
    found.is_corrected, found.bounds = method.is_corrected, method.bounds
    return found
