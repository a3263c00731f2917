"""Fair timing against hand-computed values: a clock that is wound by hand, methods that take what they are told."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace

import numpy as np
import pytest
from support.scenes import paper

from rotor_mbs.analysis import judgement
from rotor_mbs.methods.base import BuiltItem, Settings
from rotor_mbs.scenario.accuracy_bounds import Bound
from rotor_mbs.scenario.scene import Scene
from rotor_mbs.solution.trajectory import Integration, Trajectory
from rotor_mbs.studies import bench_worker
from rotor_mbs.studies.bench import Timings, allot, conduct, statistics
from rotor_mbs.studies.bench_worker import Point, PointTimer

SCENE = paper("fig08", duration=1.0, samples=11)


@dataclass
class Clock:
    """Stands still unless told."""

    now: float = 0.0

    def __call__(self) -> float:
        return self.now


@dataclass
class FakeMethod:
    """Takes 10 s to build, 3 s to read out, and the next of `durations` to run; stands `error` rad off."""

    clock: Clock
    durations: list[float]
    error: float = 0.0
    success: bool = True
    rows: int = SCENE.samples
    settings: type[Settings] = Settings
    is_corrected: bool = True
    bounds: tuple[Bound, ...] = ()

    def items(self, _scene: Scene) -> list[BuiltItem]:
        return []

    def build(self, scene: Scene, _settings: Settings) -> FakeMethod:
        self.clock.now += 10.0
        self.scene = scene
        return self

    def integrate(self) -> Integration:
        self.clock.now += self.durations.pop(0)
        return Integration(self.success, steps=7)

    def observe(self) -> Trajectory:
        self.clock.now += 3.0
        time_ = np.linspace(0.0, self.scene.duration, self.scene.samples)[: self.rows]
        return Trajectory(time_, still(self.rows).angles + self.error, still(self.rows).rates)


def still(rows: int = SCENE.samples) -> Trajectory:
    times = np.linspace(0.0, 1.0, SCENE.samples)[:rows]
    return Trajectory(times, np.zeros((rows, 4)), np.zeros((rows, 4)), error_growth=np.ones(rows))


def point(curve: str = "a", rung: int = 0) -> Point:
    return Point(curve, curve, float(rung), ())


def timing_process(fake: FakeMethod, monkeypatch: pytest.MonkeyPatch) -> PointTimer:
    monkeypatch.setattr(bench_worker, "find_method", lambda _name: fake)
    monkeypatch.setattr(judgement, "defects_of", lambda *_, **__: None)  # of a motion that is none
    return PointTimer(defaultdict(lambda: (SCENE, still())), fake.clock)


def test_median_and_quartiles() -> None:
    """Of 1, 2, 4, 8: the median between 2 and 4, the quartiles a quarter of the way from 2 down and from 4 up."""
    found = statistics([8.0, 1.0, 4.0, 2.0])
    names = ("run_time_min_s", "run_time_q1_s", "run_time_s", "run_time_q3_s", "repeats")
    assert [found[name] for name in names] == [1.0, 1.75, 3.0, 5.0, 4]


def test_only_the_integration_is_timed(monkeypatch: pytest.MonkeyPatch) -> None:
    process = timing_process(FakeMethod(Clock(), [0.5, 0.25], error=1e-3), monkeypatch)
    assert list(process.prepare(point()).values()) == [10.0, 10.0, 0.5]
    assert process.repeat(point()) == 0.25
    judged = process.judge(point())
    names = ("status", "false_success", "steps", "output_time_s", "angle_error_max", "same")
    assert [judged[name] for name in names] == ["ok", 0, 7, 3.0, 1e-3, True]


def test_a_useless_run_that_claims_success_is_a_failure_with_its_reason(monkeypatch: pytest.MonkeyPatch) -> None:
    for error, rows, success, status, false in (
        (2.0, 11, True, "inaccurate", True),
        (0.0, 5, True, "diverged", True),
        (0.0, 5, False, "solver_failed", False),
    ):
        fake = FakeMethod(Clock(), [1.0], error, success, rows)
        process = timing_process(fake, monkeypatch)
        process.prepare(point())
        judged = process.judge(point())
        assert (judged["status"], judged["false_success"]) == (status, false)
        assert judged["message"]


def run_conduct(
    seconds: Mapping[Point, float], budget: float, repeats: int = 20, hanging: Callable[[Point], bool] = lambda _: False
) -> tuple[Timings[Point], list[Point]]:
    """Conducts points that take what `seconds` says; also the order in which they were repeated."""
    clock, order = Clock(), []

    def warm_up(one: Point) -> tuple[float, bool]:
        clock.now += seconds[one]
        return seconds[one], not hanging(one)

    def repeat(one: Point) -> float:
        order.append(one)
        clock.now += seconds[one]
        return seconds[one]

    names = dict.fromkeys(one.curve for one in seconds)
    ladders = [[one for one in seconds if one.curve == name] for name in names]
    return conduct(ladders, warm_up, repeat, budget, repeats, clock), order


def test_rounds_go_over_all_points_in_turn() -> None:
    a, b = point("a"), point("b")
    timings, order = run_conduct({a: 0.001, b: 0.002}, budget=60.0, repeats=3)
    assert order == [a, b, a, b, a, b]
    assert timings.times == {a: [0.001] * 3, b: [0.002] * 3}


def test_long_runs_are_repeated_five_times() -> None:
    timings, _ = run_conduct({point("a"): 0.6, point("b"): 0.4}, budget=60.0)
    assert {one.curve: len(times) for one, times in timings.times.items()} == {"a": 5, "b": 20}


def test_what_cheap_points_leave_of_the_budget_goes_to_dear_ones() -> None:
    """Of 10 s, the cheap one wants 20 · 0.1 = 2; the two dear ones share 8: four runs of 1 s each."""
    assert allot({"cheap": 0.1, "x": 1.0, "y": 1.0}, {"cheap": 20, "x": 20, "y": 20}, 10.0) == {
        "cheap": 20, "x": 4, "y": 4,
    }  # fmt: skip
    assert allot({"x": 1.0, "y": 1.0}, {"x": 5, "y": 5}, 0.0) == {"x": 1, "y": 1}
    assert allot({"x": 1.0}, {"x": 5}, 100.0) == {"x": 5}


def test_a_rung_that_does_not_fit_the_budget_is_told_and_those_after_it_too() -> None:
    """1, 2, 4 s warm up of the 9 s (three tenths of 30); the next, 8 s, would not fit, nor what comes after it."""
    seconds = {point("a", rung): 2.0**rung for rung in range(6)}
    timings, _ = run_conduct(seconds, budget=30.0)
    assert [one.setting for one in timings.warm] == [0, 1, 2]
    assert [one.setting for one in timings.left_out] == [3, 4, 5]
    assert timings.left_out[point("a", 3)] == "not run: about 8 s more were not in the budget"
    assert set(timings.times) == set(timings.warm)


def test_a_cheap_ladder_is_not_cut_by_a_dear_one() -> None:
    seconds = {point("dear", rung): 4.0 * 2**rung for rung in range(3)}
    seconds |= {point("cheap", rung): 0.01 for rung in range(9)}
    timings, _ = run_conduct(seconds, budget=30.0)
    assert sum(one.curve == "cheap" for one in timings.times) == 9
    assert [one.setting for one in timings.left_out] == [1, 2]


def test_a_point_that_never_came_back_is_not_repeated() -> None:
    a, b = point("a"), point("b")
    timings, order = run_conduct({a: 1.0, b: 0.01}, 60.0, 4, hanging=lambda one: one == a)
    assert order == [b] * 4
    assert a in timings.warm
    assert a not in timings.times


def test_samples_are_thinned_to_a_divisor() -> None:
    cases = {1001: (101, 10), 101: (101, 1), 1084: (58, 19), 998: (998, 1), 401: (101, 4)}
    for samples, (left, every) in cases.items():
        short, k = bench_worker.thinned(replace(SCENE, samples=samples))
        assert (short.samples, k) == (left, every)
