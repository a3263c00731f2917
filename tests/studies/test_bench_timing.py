"""Fair timing by a clock that is wound by hand; a bench's points, their resuming, and workers that
are lost."""

from __future__ import annotations

import os
import signal
from collections.abc import Mapping
from dataclasses import dataclass, replace
from pathlib import Path

import h5py
import numpy as np
import pytest
from support.commands import rotor_mbs
from support.scenes import paper

from rotor_mbs.analysis import judgement
from rotor_mbs.methods.base import BuiltItem, Settings
from rotor_mbs.methods.catalogue import ladders
from rotor_mbs.runs.merge import fit_file_to_request
from rotor_mbs.runs.read import Record, read_records
from rotor_mbs.runs.rows import Rows
from rotor_mbs.scenario.accuracy_bounds import Bound
from rotor_mbs.scenario.scene import Scene
from rotor_mbs.solution.trajectory import Integration, Trajectory
from rotor_mbs.studies import bench
from rotor_mbs.studies.bench import Point, PointTimer, allocate_repeats, time_in_rounds
from rotor_mbs.studies.run import run_scenes

SCENE = paper("fig05", duration=1.0, samples=11, initial_angles=(0.0,) * 4)


@dataclass
class Clock:
    """Stands still unless told."""

    now: float = 0.0

    def __call__(self) -> float:
        return self.now


@dataclass
class FakeMethod:
    """Takes 10 s to build, 3 s to read out, the next of `durations` to run; after its start it is
    `error` rad off."""

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
        angles = still(self.rows).angles
        angles[1:] += self.error
        return Trajectory(time_, angles, still(self.rows).rates)


def still(rows: int = SCENE.samples) -> Trajectory:
    times = np.linspace(0.0, 1.0, SCENE.samples)[:rows]
    return Trajectory(times, np.zeros((rows, 4)), np.zeros((rows, 4)), error_growth=np.ones(rows))


def point(curve: str = "a", rung: int = 0) -> Point:
    return Point(curve, float(rung), {}, {})


def timer_of(fake: FakeMethod, monkeypatch: pytest.MonkeyPatch) -> PointTimer:
    monkeypatch.setattr(bench.catalogue, "find_method", lambda _name: fake)
    monkeypatch.setattr(judgement, "defects_of", lambda *_, **__: None)  # of a motion that is none
    return PointTimer(point(), SCENE, still(), clock=fake.clock)


def test_only_the_integration_is_timed(monkeypatch: pytest.MonkeyPatch) -> None:
    timer = timer_of(FakeMethod(Clock(), [0.5, 1.0, 2.0, 4.0, 8.0], error=1e-3), monkeypatch)
    timer.warm_up()
    assert timer.warm_s == 0.5
    timer.times += [timer.run() for _ in range(4)]
    row = timer.row()
    # The median between 2 and 4, the quartiles a quarter of the way from 2 down and from 4 up.
    names = ("run_time_min_s", "run_time_q1_s", "run_time_s", "run_time_q3_s", "repeats")
    assert [row[name] for name in names] == [1.0, 1.75, 3.0, 5.0, 4]
    names = (
        "setup_time_s",
        "setup_again_time_s",
        "status",
        "false_success",
        "steps",
        "output_time_s",
    )
    assert [row[name] for name in names] == [10.0, 10.0, "ok", 0, 7, 3.0]
    assert (row["angle_error_max"], row["same"]) == (1e-3, True)


def test_a_point_has_the_status_of_any_run_and_a_reason(monkeypatch: pytest.MonkeyPatch) -> None:
    for error, rows, success, status, false in (
        # above 0.01 rad nothing is ok, but it resembles the motion
        (0.2, 11, True, "inaccurate", False),
        (2.0, 11, True, "inaccurate", True),
        (0.0, 5, True, "diverged", True),
        (0.0, 5, False, "solver_failed", False),
    ):
        timer = timer_of(FakeMethod(Clock(), [1.0], error, success, rows), monkeypatch)
        timer.warm_up()
        judged = timer.judge()
        assert (judged["status"], judged["false_success"]) == (status, false)
        assert judged["message"]


def test_a_point_that_raises_is_a_failure_with_its_reason(monkeypatch: pytest.MonkeyPatch) -> None:
    timer = timer_of(FakeMethod(Clock(), []), monkeypatch)  # no duration to take: IndexError
    timer.warm_up()
    row = timer.row()
    assert (row["status"], row["message"]) == ("solver_failed", "IndexError: pop from empty list")
    assert row["run_time_s"] == 20.0


class FakeTimer(PointTimer):
    """Takes `seconds` a run, and says when it is repeated."""

    def __init__(
        self, one: Point, seconds: float, order: list[Point], clock: Clock, hangs: bool
    ) -> None:
        super().__init__(one, SCENE, None, clock=clock)
        self.point, self.seconds, self.order, self.clock, self.hangs = (
            one,
            seconds,
            order,
            clock,
            hangs,
        )

    def warm_up(self) -> None:
        self.clock.now += self.seconds
        self.warm_s, self.is_repeatable = self.seconds, not self.hangs

    def run(self) -> float:
        self.order.append(self.point)
        self.clock.now += self.seconds
        return self.seconds


def run_conduct(
    seconds: Mapping[Point, float], budget: float, repeats: int = 20, hanging: Point | None = None
) -> tuple[list[FakeTimer], list[Point]]:
    """Conducts points that take what `seconds` says; also the order in which they were repeated."""
    clock = Clock()
    order: list[Point] = []
    timers = [FakeTimer(one, taken, order, clock, one == hanging) for one, taken in seconds.items()]
    names = dict.fromkeys(one.method for one in seconds)
    time_in_rounds(
        [[timer for timer in timers if timer.point.method == name] for name in names],
        budget,
        repeats,
        clock,
    )
    return timers, order


def test_rounds_go_over_all_points_in_turn_and_over_long_runs_five_times() -> None:
    a, b = point("a"), point("b")
    timers, order = run_conduct({a: 0.001, b: 0.002}, budget=60.0, repeats=3)
    assert order == [a, b, a, b, a, b]
    assert [timer.times for timer in timers] == [[0.001] * 3, [0.002] * 3]
    timers, _ = run_conduct({a: 0.6, b: 0.4}, budget=60.0)
    assert [len(timer.times) for timer in timers] == [5, 20]


def test_what_cheap_points_leave_of_the_budget_goes_to_dear_ones() -> None:
    """Of 10 s, the cheap one wants 20 · 0.1 = 2; the two dear ones share 8: four runs of 1 s
    each."""
    assert allocate_repeats([1.0, 0.1, 1.0], [20, 20, 20], 10.0) == [4, 20, 4]
    assert allocate_repeats([1.0, 1.0], [5, 5], 0.0) == [1, 1]
    assert allocate_repeats([1.0], [5], 100.0) == [5]


def test_a_rung_that_does_not_fit_the_budget_is_told_those_after_it_too_and_no_cheap_ladder_is_cut() -> (
    None
):
    """1, 2, 4 s warm up of the 9 s (three tenths of 30); the next, 8 s, would not fit, nor what
    comes after it."""
    seconds = {point("dear", rung): 2.0**rung for rung in range(6)}
    timers, _ = run_conduct(
        seconds | {point("cheap", rung): 0.01 for rung in range(9)}, budget=30.0
    )
    assert [bool(timer.times) for timer in timers] == [True] * 3 + [False] * 3 + [True] * 9
    assert [bool(timer.left_out) for timer in timers] == [False] * 3 + [True] * 3 + [False] * 9
    assert timers[3].left_out == "not run: about 8 s over the time budget"
    assert timers[3].row()["status"] == "left_out"


def test_a_point_that_never_came_back_is_not_repeated() -> None:
    a, b = point("a"), point("b")
    timers, order = run_conduct({a: 1.0, b: 0.01}, 60.0, 4, hanging=a)
    assert order == [b] * 4
    assert (timers[0].warm_s, timers[0].times) == (1.0, [])


def test_samples_are_thinned_to_a_divisor() -> None:
    cases = {1001: (101, 10), 101: (101, 1), 1084: (58, 19), 998: (998, 1), 401: (101, 4)}
    for samples, (left, every) in cases.items():
        short, k = bench.coarsened(replace(SCENE, samples=samples))
        assert (short.samples, k) == (left, every)


QUICK = ("check/held", "-m", "exudyn_tree/rk44", "--repeats", "2", "--budget", "0.5")


def curves_of(path: Path) -> dict[str, Record]:
    return {curve.name: curve for curve in read_records(path, "bench")}


@pytest.mark.full
def test_the_stored_points_keep_the_contract_and_a_bench_goes_on_where_it_was(
    tmp_path: Path,
) -> None:
    path = tmp_path / "b.h5"
    ended = rotor_mbs("bench", *QUICK, "-o", path)
    assert ended.status == 0, ended.err
    with h5py.File(path) as file:
        table = file["bench"]
        columns = (
            "angle_error_max angle_error_end tip_error_max energy_drift_max run_time_s "
            "run_time_min_s run_time_q1_s run_time_q3_s setup_time_s output_time_s repeats steps "
            "status step tolerance left_out crc32"
        )
        for name in columns.split():
            assert table[name].dims[0][0].name == "/bench/run", name
        assert table["step"].attrs["units"] == "s"
        assert table["scene"].asstr()[0] == "check/held"
        assert table["run"].asstr()[0].startswith("check/held/exudyn_tree/rk44 step=")
    (first,) = curves_of(path).values()
    assert (first.attributes["setting_kind"], first.attributes["order_expected"]) == ("step", 4.0)
    assert len(first.arrays["setting"]) == len(first.messages) >= 6
    assert "0 scenes measured, 1 already stored" in rotor_mbs("bench", *QUICK, "-o", path).out
    assert rotor_mbs("bench", *QUICK, "-m", "lagrange/dop853", "-o", path).status == 0
    second = curves_of(path)
    assert set(second) == {"lagrange/dop853", "exudyn_tree/rk44"}
    # Kept, not measured again.
    np.testing.assert_array_equal(
        second[first.name].arrays["run_time_s"], first.arrays["run_time_s"]
    )
    assert (tmp_path / "b-report" / "index.html").is_file()
    assert sorted(entry.name for entry in tmp_path.iterdir()) == ["b-report", "b.h5"]


class DyingTask(bench.BenchTask):
    """Curves one of which kills the process that times it."""

    def perform(self) -> Rows:
        if any(curve.name.endswith("deadly") for curve in self.curves):
            os.kill(os.getpid(), signal.SIGKILL)
        return super().perform()


@pytest.mark.full
def test_curves_are_tried_alone_where_their_process_dies(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(bench, "BenchTask", DyingTask)
    ((method, ladder),) = ladders(["lagrange/ode45"]).values()
    short = replace(ladder, values=(1e-3,))
    variants = [replace(short, variant=f" {name}") for name in ("first", "deadly", "last")]
    curves = [bench.curve_of(SCENE, method, ladder, {}) for ladder in variants]
    run_scenes([SCENE], {SCENE.name: ()}, tmp_path / "b.h5", workers=0, timeout_s=60.0)
    file = fit_file_to_request(tmp_path / "b.h5", [*bench.curve_tables(curves)])
    ended = {
        outcome.label.split()[-2]: outcome
        for outcome in bench.measured(bench.bench_task(file, curves, 2, 5.0))
    }
    assert [curve.is_stored(file) for curve in curves] == [True, False, True]
    assert (ended["deadly"].status, ended["deadly"].is_stored) == ("worker_died", False)
    assert ended["deadly"].message.endswith("also when it was retried alone")
    assert ended["first"].message.endswith(" 0 failed, 0 omitted")
