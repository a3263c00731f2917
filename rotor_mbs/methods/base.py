"""What every model offers, and the one loop that builds, times and observes. Knows no particular model."""

from __future__ import annotations

import gc
import time
from collections.abc import Mapping
from typing import Protocol

from rotor_mbs.methods.time_limit import time_limit
from rotor_mbs.scenario.scene import Scene
from rotor_mbs.solution.record import Integration, Item, Trajectory
from rotor_mbs.solution.solution import Solution


class Solver(Protocol):
    """A model built for one scene with one integrator, ready to run from the initial state as often as wanted."""

    def integrate(self) -> Integration:
        """Run from the initial state to the end. Only this is timed; it does no work that is not integration."""

    def observe(self) -> Trajectory:
        """Samples of the last integration, cut before the first row that is not finite."""


class Method(Protocol):
    """A module that implements a method: its default settings, its items, its solver."""

    DEFAULTS: Mapping[str, object]

    def items(self, scene: Scene) -> list[Item]: ...

    def build(self, scene: Scene, settings: Mapping[str, object]) -> Solver:
        """Raises MethodRefusal where the method cannot represent the scene."""


def solve(
    name: str,
    method: Method,
    scene: Scene,
    settings: Mapping[str, object],
    repeats: int = 1,
    budget_s: float = float("inf"),
    time_limit_s: float = float("inf"),
) -> Solution:
    """Build once, integrate up to `repeats` times while within `budget_s` (garbage collector off), observe once.

    The integrations together end themselves after `time_limit_s`; building (a compiler may be at work) does not count.
    Raises MethodRefusal as `build` does, OutOfTimeError where a method cannot keep what it reached. An engine's failure
    is in the result, not an exception.
    """
    chosen = {**method.DEFAULTS, **settings}
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
    finally:
        if gc_was_on:
            gc.enable()
    start = time.perf_counter()
    trajectory = solver.observe()
    return Solution(scene, name, trajectory, integration, chosen, setup, run_times, time.perf_counter() - start)
