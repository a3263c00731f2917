"""Measurement of error and run time: curves of methods over ladders of settings.

A point is a method at one step or tolerance. The table /bench has a row per point. One worker
process on one core times all curves of a scene: in each round it runs every point once.
"""

from __future__ import annotations

import gc
import heapq
import json
import math
import os
import time
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from rotor_mbs.analysis.judgement import judge
from rotor_mbs.analysis.work_precision import fitted_order, step_for, succeeded
from rotor_mbs.analysis.work_precision import points as points_of
from rotor_mbs.errors import (
    SYSTEM_ERRORS,
    InputError,
    MethodRefusal,
    RotorError,
    one_line,
    system_errors_apart,
)
from rotor_mbs.methods import catalogue
from rotor_mbs.methods.base import STEP, TOLERANCE, Ladder, Method
from rotor_mbs.methods.selection import Refusal, supporting_methods
from rotor_mbs.methods.time_limit import OutOfTimeError, caller_signals, time_limit
from rotor_mbs.processes import last_core
from rotor_mbs.processes.pool import WorkerPool
from rotor_mbs.runs.design import RunRequest
from rotor_mbs.runs.hdf5 import TableSpec
from rotor_mbs.runs.merge import fit_file_to_request
from rotor_mbs.runs.output_files import locked
from rotor_mbs.runs.read import Record, points_table
from rotor_mbs.runs.rows import RowLocation, Rows
from rotor_mbs.runs.runner import OnProgress, RunOutcome, Task, ignore_progress, run_tasks
from rotor_mbs.runs.table import TableFile
from rotor_mbs.scenario.scene import Scene
from rotor_mbs.solution.metrics import horizon, horizon_samples
from rotor_mbs.solution.status import COMPLETE, code_of
from rotor_mbs.solution.trajectory import Solution, Trajectory
from rotor_mbs.studies.run import run_scenes, work_of
from rotor_mbs.studies.stored_references import read_reference

BENCH = "bench"

LONG_RUN_S = 0.5  # a point whose run takes longer is timed LONG_REPEATS times at most
LONG_REPEATS = 5
# Two shares of the time budget. The first is for the warm-up runs: its size leaves time for about
# two rounds. The second is for warm-up runs and building together. A rung (one point of a ladder)
# that is expected to exceed a share is left out, with all finer ones of its ladder.
_WARM_UP_SHARE, _BUILD_SHARE = 0.3, 0.6
_REFERENCE_LIMIT_S = 60.0  # time limit for the run that computes the reference of a scene
# Time limit of a warm-up run: a hanging engine must not use up the budget of the other points.
_RUN_LIMIT_S = 10.0
# A worker process is ended after _HANGING times its budget plus _LOADING_S for loading engines: it
# is then taken to hang in an engine.
_HANGING, _LOADING_S = 3.0, 60.0
# A benched scene has at most this many sample intervals. With more, the steps of coarse rungs would
# not fit into an interval, and a bench would mostly time the output of samples.
_MOST_INTERVALS = 100


@dataclass(frozen=True, eq=False)
class Point:
    """Hold one method at one setting: a point of a curve, and a row of a table.

    Attributes
    ----------
    method : name of the method.
    setting : the step (s) or the tolerance.
    settings : the method's settings at this point, by name.
    known : columns of the row that are known before the point is measured, by name.
    """

    method: str
    setting: float
    settings: Mapping[str, object]
    known: Mapping[str, object]


@dataclass(frozen=True)
class Curve:
    """Hold a method over its ladder of settings on one scene: consecutive rows of a table.

    Attributes
    ----------
    scene : the scene with all its samples; a bench uses a part of them.
    name : the method's name, followed by the ladder's variant if there is one.
    kind : STEP or TOLERANCE, the kind of setting that changes along the curve.
    points : a point for each setting, coarse to fine.
    table : name of the table that has the curve's rows.
    target : error in rad for which the curve shall give the step; 0 if no step is wanted.
    """

    scene: Scene
    name: str
    kind: str
    points: Sequence[Point]
    table: str = BENCH
    target: float = 0.0

    @property
    def method(self) -> str:
        """Return the name of the method."""
        return self.points[0].method

    @property
    def label(self) -> str:
        """Return the scene, curve and table as text for messages."""
        return f"{self.scene.name} {self.name} {self.table}"

    @property
    def key(self) -> tuple[str, str, str]:
        """Return the names of table, scene and curve, which identify the curve in a file."""
        return self.table, self.scene.name, self.name

    def places(self, file: TableFile) -> list[RowLocation]:
        """Return the location in `file` of the row of each point."""
        return [file.place(str(point.known["run"]), self.table) for point in self.points]

    def is_stored(self, file: TableFile) -> bool:
        """Return whether the rows of all points are stored in `file`."""
        return all(place.is_stored for place in self.places(file))


def curve_of(scene: Scene, method: Method, ladder: Ladder, options: Mapping[str, object]) -> Curve:
    """Return the curve of a method's ladder on a scene.

    The curve ends before the first step that is too small for the scene's duration.

    Parameters
    ----------
    scene, method : the scene, and the method that computes it.
    ladder : settings of the method, coarse to fine; its variant is part of the curve's name.
    options : options of the study; each point stores them, together with facts about scene and
        method that the report shows.
    """
    name, (short, _) = method.name + ladder.variant, coarsened(scene)
    facts = {
        **options,
        "duration_s": scene.duration,
        "linearizes": any(
            other.linearize for other in catalogue.methods() if other.model == method.model
        ),
        "lines": sum(len(text.splitlines()) for text in method.sources if isinstance(text, str)),
    }
    of_all: dict[str, object] = {
        "curve": name,
        "setting_kind": ladder.kind,
        "options": json.dumps(facts, sort_keys=True),
        "order_expected": math.nan if method.order is None or ladder.kind != STEP else method.order,
    }
    points = []
    for setting, chosen in ladder.settings_by_value(short.duration / (short.samples - 1)).items():
        try:
            known = RunRequest(scene, method.name, chosen).known | of_all
        except InputError:  # the step is too small for the scene's duration, and finer ones are too
            break
        known |= {kind: setting if kind == ladder.kind else math.nan for kind in (STEP, TOLERANCE)}
        known["run"] = f"{scene.name}/{name} {ladder.kind}={setting:.6g}"
        points.append(Point(method.name, setting, dict(sorted(chosen.items())), known))
    return Curve(scene, name, ladder.kind, points)


class PointTimer:
    """Build the solver of a point, run it repeatedly, and judge the last run.

    Parameters
    ----------
    point, scene : the point, and the scene that it computes.
    reference : trajectory against which errors are computed; None if there is no reference.
    warm_up_limit_s : time limit of the warm-up run, s.
    clock : function that returns a time in s.

    Attributes
    ----------
    warm_s : duration of the warm-up run, s; if it failed, the time from the start of building.
    is_repeatable : whether the warm-up run was completed without an error.
    is_stopped : whether the warm-up run was ended at its limit.
    times : durations of the timed runs, s.
    left_out : the reason why the point was not run; "" if it was run.
    """

    def __init__(
        self,
        point: Point,
        scene: Scene,
        reference: Trajectory | None,
        warm_up_limit_s: float = math.inf,
        clock: Callable[[], float] = time.perf_counter,
    ) -> None:
        self._point, self._scene, self._reference = point, scene, reference
        self._warm_up_limit_s, self._clock = warm_up_limit_s, clock
        self._setup: dict[str, float] = {}
        self._failure = "", ""  # status and message
        self.warm_s, self.is_repeatable, self.is_stopped, self.left_out = math.nan, False, False, ""
        self.times: list[float] = []

    def warm_up(self) -> None:
        """Build the solver twice, and run it once.

        The first build includes compilation, the second does not. Errors of the system are raised;
        any other error is not raised, but becomes the outcome of the point.
        """
        start = self._clock()
        try:
            method = catalogue.find_method(self._point.method)
            settings = method.settings.of(self._point.method, self._point.settings)
            with system_errors_apart(OutOfTimeError):
                for name in ("setup_time_s", "setup_again_time_s"):
                    begun = self._clock()
                    self._solver = method.build(self._scene, settings)
                    self._setup[name] = self._clock() - begun
                if not gc.isenabled():
                    gc.collect()
                # Under a time limit, engines check the time after every step, which takes time.
                # Only the warm-up run has a limit, so that the timed runs are not slowed down.
                with time_limit(self._warm_up_limit_s):
                    self.warm_s = self.run()
                if self._integration.out_of_time:
                    raise OutOfTimeError(self._integration.message)
                self._first_angles = self._solver.observe().angles
            self.is_repeatable = True
        except SYSTEM_ERRORS:
            raise
        except OutOfTimeError as exc:
            self._failure, self.is_stopped = ("timed_out", str(exc)), True
        except MethodRefusal as exc:
            self.left_out = f"not run: {exc}"
        except Exception as exc:
            self._failure = (
                "solver_failed",
                str(exc) if isinstance(exc, RotorError) else one_line(exc),
            )
        if not self.is_repeatable:
            self.warm_s = self._clock() - start

    def run(self) -> float:
        """Integrate once, and return the run time in s."""
        start = self._clock()
        self._integration = self._solver.integrate()
        return self._clock() - start

    def row(self) -> dict[str, Any]:
        """Return the measured columns of the point, by name.

        The column `same` tells whether the last run has the angles of the warm-up run, bit by bit;
        a point that failed or was not run lacks it.
        """
        if self.is_repeatable:
            return self._setup | statistics(self.times) | self.judge()
        status, message = ("left_out", self.left_out) if self.left_out else self._failure
        nothing = {"false_success": 0, "repeats": 0, "steps": 0}
        return {"status": status, "message": message, "run_time_s": self.warm_s, **nothing}

    def judge(self) -> dict[str, Any]:
        """Compute the samples of the last run, and judge them.

        Returns
        -------
        dict
            Columns by name: status, message, false_success, metrics, steps, output_time_s (time in
            s to compute the samples) and `same`. A run that did not reach the end has no metrics.
        """
        start = self._clock()
        trajectory = self._solver.observe()
        output = self._clock() - start
        point, scene, integration = self._point, self._scene, self._integration
        run = Solution(scene, point.method, trajectory, integration, dict(point.settings))
        with np.errstate(over="ignore", invalid="ignore"):  # unbounded angles may overflow
            judgement = judge(scene, run, self._reference)
        del self._solver
        status = judgement.status
        return {
            # Metrics of a run that ended early would describe only the part that was computed.
            **(judgement.metrics if status in COMPLETE else {}),
            "status": status,
            "message": judgement.message,
            "false_success": int(judgement.false_success),
            "steps": integration.steps or 0,
            "output_time_s": output,
            "same": np.array_equal(trajectory.angles, self._first_angles),
        }


# When and how often each point runs


def statistics(times: Sequence[float]) -> dict[str, float]:
    """Return statistics of run times in s, by the names of their columns.

    Quartiles are interpolated between neighbouring times.
    """
    low, middle, high = map(float, np.quantile(times, (0.25, 0.5, 0.75)))
    return {
        "run_time_s": middle,
        "run_time_min_s": min(times),
        "run_time_q1_s": low,
        "run_time_q3_s": high,
        "repeats": len(times),
    }


def time_in_rounds(
    ladders: Sequence[Sequence[PointTimer]],
    budget_s: float,
    repeats: int,
    clock: Callable[[], float],
) -> None:
    """Warm up every point, then time the points in rounds.

    Parameters
    ----------
    ladders : points of each ladder, coarse to fine; their `times` are filled.
    budget_s : time budget for warming up and timing, s on `clock`.
    repeats : maximum number of timed runs of a point; for points whose run takes longer than
        LONG_RUN_S it is at most LONG_REPEATS.
    clock : function that returns a time in s.
    """
    start = clock()
    _warm_all(ladders, budget_s, clock)
    points = [point for ladder in ladders for point in ladder if point.is_repeatable]
    wanted = [
        repeats if point.warm_s <= LONG_RUN_S else min(repeats, LONG_REPEATS) for point in points
    ]
    allowed = allocate_repeats(
        [max(point.warm_s, 1e-9) for point in points], wanted, budget_s - (clock() - start)
    )
    # Each round runs every point once, so that a slow phase of the machine slows all points alike.
    for round_ in range(max(allowed, default=0)):
        for point, count in zip(points, allowed, strict=True):
            if round_ and clock() - start > budget_s:  # the machine has become slower
                return
            if round_ < count:
                point.times.append(point.run())


def _warm_all(
    ladders: Sequence[Sequence[PointTimer]], budget_s: float, clock: Callable[[], float]
) -> None:
    """Warm up the points of all ladders, in the order of their expected run time.

    If the next point of a ladder does not fit the budget, it and all finer ones are left out.

    Parameters
    ----------
    ladders : points of each ladder, coarse to fine.
    budget_s : time budget of the scene, s; warm-up runs and building may take a share of it.
    clock : function that returns a time in s.
    """
    start, warm_s = clock(), 0.0
    waiting = [(0.0, 0, number) for number, ladder in enumerate(ladders) if ladder]
    while waiting:
        expected, rung, number = heapq.heappop(waiting)
        ladder = ladders[number]
        left = min(_WARM_UP_SHARE * budget_s - warm_s, _BUILD_SHARE * budget_s - (clock() - start))
        if rung and expected > left:
            for point in ladder[rung:]:
                point.left_out = f"not run: about {expected:.2g} s over the time budget"
            continue
        ladder[rung].warm_up()
        warm_s += ladder[rung].warm_s
        if rung + 1 < len(ladder):
            # The last two run times of the ladder give a growth factor, limited to 2 to 10. The
            # next run is expected to take longer by this factor.
            last, before = ladder[rung].warm_s, ladder[rung - 1].warm_s if rung else 0.0
            growth = last / before if before > 0.0 else 2.0
            heapq.heappush(waiting, (last * min(max(growth, 2.0), 10.0), rung + 1, number))


def allocate_repeats(seconds: Sequence[float], wanted: Sequence[int], budget_s: float) -> list[int]:
    """Return the number of repeats of each point that fit its share of the time budget.

    The points share the budget equally. If the wanted repeats of a point take less than its share,
    the rest is divided among the other points. Every point is run at least once.

    Parameters
    ----------
    seconds : time of one run of each point, s.
    wanted : maximum number of repeats of each point.
    budget_s : time for all points, s.
    """
    counts = [0] * len(seconds)
    by_demand = sorted(range(len(seconds)), key=lambda i: wanted[i] * seconds[i])
    # Points that need the least time come first: the time that they leave over raises the share of
    # the points after them. The factor 1 + 1e-12 prevents that rounding removes a run from a share
    # that is a whole number of runs.
    for done, i in enumerate(by_demand):
        share = budget_s / (len(by_demand) - done) * (1.0 + 1e-12)
        counts[i] = max(1, min(wanted[i], int(share / seconds[i])))
        budget_s -= counts[i] * seconds[i]
    return counts


def measure(
    curves: Sequence[Curve],
    scene: Scene,
    reference: Trajectory | None,
    repeats: int,
    budget_s: float,
) -> list[list[dict[str, Any]]]:
    """Time the points of all curves in rounds, judge them, and return their columns.

    Engines are loaded before the first run, so that loading is not part of a run time. The garbage
    collector is switched off and stays off: the process must do nothing else.

    Parameters
    ----------
    curves : curves of one scene.
    scene, reference : the scene as it is benched, and its reference (`bench_inputs`).
    repeats, budget_s : maximum number of timed runs of a point, and time for all points in s.

    Returns
    -------
    list of list of dict
        Columns by name: a list for each curve, with a dict for each point.
    """
    for method in dict.fromkeys(curve.method for curve in curves):
        catalogue.find_method(method).import_engine()
    gc.disable()
    timers = [
        [PointTimer(point, scene, reference, _RUN_LIMIT_S) for point in curve.points]
        for curve in curves
    ]
    time_in_rounds(timers, budget_s, repeats, time.perf_counter)
    return [[timer.row() for timer in own] for own in timers]


def bench_inputs(scene: Scene, place: RowLocation) -> tuple[Scene, Trajectory]:
    """Return a scene as it is benched, and its reference at the samples of that scene.

    A benched scene has fewer samples (`coarsened`) and no output of loads.

    Parameters
    ----------
    scene : the scene with all its samples.
    place : location of the reference in a results file.

    Raises
    ------
    InputError
        If there is no reference, or the reference does not reach the end.
    """
    reference = read_reference(place, scene)
    if reference is None or len(reference.time) < scene.samples:
        raise InputError(
            f"{scene.name}: no usable reference (it does not reach the end); a bench needs one"
        )
    short, k = coarsened(scene)
    short = replace(short, outputs=tuple(name for name in short.outputs if name != "loads"))
    arrays = {name: values[::k] for name, values in reference.quantities.items()}
    return short, Trajectory(
        reference.time[::k], reference.angles[::k], reference.rates[::k], **arrays
    )


def coarsened(scene: Scene) -> tuple[Scene, int]:
    """Return the scene with every k-th sample only, and k.

    The smallest k is taken that divides the number of sample intervals and leaves at most
    _MOST_INTERVALS. If it leaves fewer than a fifth of _MOST_INTERVALS, k is 1.
    """
    intervals = scene.samples - 1
    k = next(
        (
            k
            for k in range(1, intervals + 1)
            if intervals % k == 0 and intervals // k <= _MOST_INTERVALS
        ),
        1,
    )
    # If the number of intervals has no suitable divisor, for example if it is a prime, too few
    # samples would be left to find the largest error.
    k = k if intervals // k >= _MOST_INTERVALS // 5 or intervals <= _MOST_INTERVALS else 1
    return replace(scene, samples=intervals // k + 1), k


# Curves in a results file


def curve_tables(curves: Sequence[Curve]) -> list[TableSpec]:
    """Return a list with the specification of the table that holds the points of `curves`.

    All curves must name the same table. The list is empty if there are no curves.
    """
    return (
        [points_table(curves[0].table, [p.known for curve in curves for p in curve.points])]
        if curves
        else []
    )


@dataclass(frozen=True, kw_only=True)
class CurveTask(Task):
    """Run each point of a curve once, in a worker process.

    Attributes
    ----------
    curve : the curve.
    longest_s : s; after a run that takes longer, the finer points are left out, because the next
        run would take several times as long. They are also left out after a run with status ok
        whose error is below a tenth of the curve's target.
    limit_s : time limit of a run, s.
    """

    curve: Curve
    longest_s: float
    limit_s: float

    def perform(self) -> Rows:
        """Run and judge the points of the curve, and return their rows."""
        curve, facts = self.curve, dict[str, Any]()
        scene, reference = curve.scene, None
        if curve.table == BENCH:
            assert self.reference is not None  # every curve of a bench has one
            scene, reference = bench_inputs(scene, self.reference)
            facts = facts_of(scene, reference)
        elif self.reference is not None:
            reference = read_reference(self.reference, scene)
        reason, points = "", []
        for point in curve.points:
            timer = PointTimer(point, scene, reference, self.limit_s)
            if reason:
                timer.left_out = reason
            else:
                timer.warm_up()
            if timer.is_repeatable:
                timer.times.append(timer.warm_s)
            points.append(timer.row())
            if (
                points[-1]["status"] == "ok"
                and points[-1].get("angle_error_max", math.inf) < 0.1 * curve.target
            ):
                reason = "not run: the setting before is accurate"
            elif (timer.is_repeatable or timer.is_stopped) and timer.warm_s > self.longest_s:
                reason = f"not run: the setting before took {timer.warm_s:.2g} s"
        return rows_of_curve(self.place, curve, points, facts)


def curve_tasks(
    file: TableFile,
    curves: Sequence[Curve],
    kill_after_s: float,
    longest_s: float,
    limit_s: float = math.inf,
) -> list[CurveTask]:
    """Return a task for each curve, which runs each point of the curve once.

    Parameters
    ----------
    file : the results file; it has a row for each point.
    curves : the curves that are measured.
    kill_after_s : time for a whole curve, s; after it the worker process is ended.
    longest_s, limit_s : limits in s, see `CurveTask`.
    """
    return [
        CurveTask(
            label=curve.label,
            method=curve.method,
            place=curve.places(file)[0],
            reference=file.place(f"{curve.scene.name}/{catalogue.REFERENCE}"),
            kill_after_s=kill_after_s,
            work=work_of(curve.scene, curve.method),
            curve=curve,
            longest_s=longest_s,
            limit_s=limit_s,
        )
        for curve in curves
    ]


@caller_signals()
def run_bench(
    scenes: Sequence[Scene],
    methods: Sequence[str],
    output: Path,
    *,
    repeats: int,
    budget_s: float,
    workers: int,
    on_progress: OnProgress = ignore_progress,
) -> tuple[list[RunOutcome], list[Refusal]]:
    """Measure the curves of every scene, and store them in a results file.

    A curve that the file has is measured again only if its settings or versions differ, or if the
    reference of its scene was computed again.

    Parameters
    ----------
    scenes : the scenes; one without a reference that reaches the end is left out.
    methods : names of the methods whose ladders are measured; if empty, all methods.
    output : the results file.
    repeats : maximum number of timed runs of a point.
    budget_s : time for all curves of a scene, s.
    workers : number of processes that compute references before the first curve is timed.
    on_progress : called after each curve.

    Returns
    -------
    list of RunOutcome
        The curves measured by this call.
    list of Refusal
        Methods that cannot represent a scene, and scenes without a usable reference; both are left
        out.

    Raises
    ------
    InputError
        If a method has no ladder, or if no curve is left.
    StoreError
        If the file cannot be read or written.
    """
    chosen = catalogue.ladders(methods).values()
    with locked(output):
        none: Mapping[str, Sequence[str]] = {scene.name: () for scene in scenes}
        references = run_scenes(scenes, none, output, workers=workers, timeout_s=_REFERENCE_LIMIT_S)
        # Scenes whose reference was computed by this call: all their curves are measured again.
        changed = {run.scene: run for run in references if run.is_computed}
        failed = {name: run for name, run in changed.items() if run.has_failed or not run.is_stored}
        curves: list[Curve] = []
        refused: list[Refusal] = []
        options = {"repeats": repeats, "budget_s": budget_s}
        names = dict.fromkeys(method.name for method, _ in chosen)
        for scene in scenes:
            if scene.name in failed:
                run = failed[scene.name]
                reason = f"no usable reference ({run.status}: {run.message}); a bench needs one"
                refused.append(Refusal(scene.name, "", reason))
                continue
            place = TableFile(output).place(f"{scene.name}/{catalogue.REFERENCE}")
            try:
                bench_inputs(scene, place)
            except InputError as exc:
                reason = str(exc).removeprefix(f"{scene.name}: ")
                refused.append(Refusal(scene.name, "", reason))
                continue
            able, others = supporting_methods(scene, names, are_named=bool(methods))
            curves += [
                curve_of(scene, method, ladder, options)
                for method, ladder in chosen
                if method.name in able
            ]
            refused += others
        if not curves:
            raise InputError(map(str, refused))
        file = fit_file_to_request(output, curve_tables(curves), [curve.key for curve in curves])
        missing = [
            curve for curve in curves if curve.scene.name in changed or not curve.is_stored(file)
        ]
        made: list[RunOutcome] = []
        for scene in scenes:
            own = [curve for curve in missing if curve.scene.name == scene.name]
            for outcome in measured(bench_task(file, own, repeats, budget_s)) if own else ():
                made.append(replace(outcome, share=(len(made) + 1) / len(missing)))
                on_progress(len(made), len(missing), made[-1])
        return made, refused


@dataclass(frozen=True, kw_only=True)
class BenchTask(Task):
    """Time the curves of one scene together, in a worker process.

    Attributes
    ----------
    curves, places : the curves, and the location of the first row of each.
    repeats, budget_s : maximum number of timed runs of a point, and time for all points in s.
    """

    curves: Sequence[Curve]
    places: Sequence[RowLocation]
    repeats: int
    budget_s: float

    def perform(self) -> Rows:
        """Time all points of the curves, and return their rows, curve after curve."""
        assert self.reference is not None
        scene, reference = bench_inputs(self.curves[0].scene, self.reference)
        core = last_core()  # `measured` has bound this process to that core
        facts = facts_of(scene, reference) | {"pinned_core": -1 if core is None else core}
        points = measure(self.curves, scene, reference, self.repeats, self.budget_s)
        parts = []
        for curve, place, points_of_curve in zip(self.curves, self.places, points, strict=True):
            parts.append(rows_of_curve(place, curve, points_of_curve, facts))
        return {name: np.concatenate([part[name] for part in parts]) for name in parts[0]}

    def store(self, rows: Rows) -> None:
        """Write the rows of each curve to their location in the file."""
        for part, place in zip(self.parts(rows), self.places, strict=True):
            place.write(part)

    def split(self) -> list[BenchTask]:
        """Return a task for each curve; an empty list if the task has only one curve."""
        if len(self.curves) == 1:
            return []
        pairs = zip(self.curves, self.places, strict=True)
        return [
            replace(self, curves=[curve], places=[place], place=place) for curve, place in pairs
        ]

    def parts(self, rows: Rows) -> list[Rows]:
        """Divide the rows of the task into those of each curve."""
        parts, first = [], 0
        for curve in self.curves:
            last = first + len(curve.points)
            parts.append({name: values[first:last] for name, values in rows.items()})
            first = last
        return parts


def bench_task(
    file: TableFile, curves: Sequence[Curve], repeats: int, budget_s: float
) -> BenchTask:
    """Return the task that times curves of one scene together.

    Parameters
    ----------
    file : the results file; it has a row for each point.
    curves : at least one curve; all are of the same scene.
    repeats, budget_s : maximum number of timed runs of a point, and time for all points in s; a
        process that takes several times as long is ended.
    """
    scene = curves[0].scene.name
    places = [curve.places(file)[0] for curve in curves]
    return BenchTask(
        label=scene,
        method="",
        place=places[0],
        reference=file.place(f"{scene}/{catalogue.REFERENCE}"),
        kill_after_s=_HANGING * budget_s + _LOADING_S,
        curves=curves,
        places=places,
        repeats=repeats,
        budget_s=budget_s,
    )


def measured(task: BenchTask) -> Iterator[RunOutcome]:
    """Perform a task in a worker process on one core, and yield the outcome of each curve.

    If the process died, the curves that it computed are reported as not stored.

    Parameters
    ----------
    task : curves of one scene.
    """
    with WorkerPool(1, core=last_core()) as pool:
        for end in run_tasks(pool, [task]):
            if end.value is None:
                for curve in end.task.curves:
                    yield RunOutcome(
                        curve.label, curve.method, end.failure, end.message, is_stored=False
                    )
                continue
            for curve, rows in zip(end.task.curves, end.task.parts(end.value), strict=True):
                codes = rows["status"].tolist()
                ok, inaccurate, left_out = (
                    codes.count(code_of(status)) for status in ("ok", "inaccurate", "left_out")
                )
                failed = len(codes) - ok - inaccurate - left_out
                counts = f"{ok} ok, {inaccurate} inaccurate, {failed} failed, {left_out} omitted"
                yield RunOutcome(
                    curve.label, curve.method, "measured", f"{len(codes)} points: {counts}"
                )


def rows_of_curve(
    place: RowLocation,
    curve: Curve,
    points: Sequence[Mapping[str, Any]],
    facts: Mapping[str, object],
) -> Rows:
    """Return the rows of a curve.

    If the curve has a target, its rows include the step for that error. Otherwise the rows of a
    curve over steps include the order of convergence.

    Parameters
    ----------
    place : location of the first row of the curve.
    curve : the curve.
    points : measured columns of each point, by name.
    facts : columns with the same value at all points of the curve, by name.
    """
    facts = {**facts, "repeatable": int(all(point.get("same", True) for point in points))}
    each = [
        place.encode({**point, **facts, "left_out": int(point["status"] == "left_out")})
        for point in points
    ]
    rows = {name: np.concatenate([row[name] for row in each]) for name in each[0]}
    measured = Record(curve.table, curve.scene.name, curve.name, arrays=rows)
    if curve.target:
        tried = rows["status"] != code_of("left_out")
        steps = np.array([point.setting for point in curve.points])[tried]
        step = step_for(curve.target, steps, rows["angle_error_max"][tried])
        rows["step_for_target_s"][tried] = np.nan if step is None else step
    elif curve.kind == STEP:
        steps = np.array([point.setting for point in curve.points])[succeeded(measured)]
        order = fitted_order(steps, points_of(measured)[0])
        rows["order"][:] = np.nan if order is None else order
    return rows


def facts_of(short: Scene, reference: Trajectory) -> dict[str, Any]:
    """Return the columns that have the same value at all points of a benched scene, by name.

    Parameters
    ----------
    short : the scene as it is benched, with fewer samples.
    reference : the reference at the same samples; the largest uncertainty up to its horizon is one
        of the columns.
    """
    uncertainty = reference.angle_uncertainty
    compared = max(horizon_samples(reference), 1)
    return {
        "horizon_s": horizon(reference),
        "uncertainty_rad": 0.0 if uncertainty is None else float(uncertainty[:compared].max()),
        "samples": short.samples,
        "load_before": os.getloadavg()[0],
        "pinned_core": -1,
    }
