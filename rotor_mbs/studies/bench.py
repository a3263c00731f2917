"""Error against run time: curves of methods over ladders of settings, a row per point in the table /bench.

The curves of a scene are timed together, in rounds over all their points, by one worker process on one core.
"""

from __future__ import annotations

import heapq
import json
import math
import os
import time
from collections.abc import Callable, Hashable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import partial
from pathlib import Path
from typing import Any, Generic, TypeAlias, TypeVar

import numpy as np

from rotor_mbs.analysis.work_precision import SMALLEST_ERROR, fitted_order
from rotor_mbs.errors import InputError
from rotor_mbs.methods.base import STEP, TOLERANCE, Ladder
from rotor_mbs.methods.catalogue import find_method, ladders, settings_for
from rotor_mbs.runs import last_core
from rotor_mbs.runs.files import writing
from rotor_mbs.runs.pool import WorkerPool, run_in
from rotor_mbs.runs.records import points_table, row_of_point
from rotor_mbs.runs.results import TableFile, extend_file
from rotor_mbs.runs.table import Place, Rows, Table
from rotor_mbs.runs.versions import row_versions
from rotor_mbs.scenario.scene import Scene, scene_hash
from rotor_mbs.solution.metrics import horizon, horizon_samples
from rotor_mbs.solution.trajectory import Trajectory
from rotor_mbs.studies.bench_worker import ERRORS, Point, PointScenes, ask, prepared_scene, start_timer, thinned
from rotor_mbs.studies.run import OnProgress, Outcome, able_methods, ignore_progress, run_scenes

T = TypeVar("T", bound=Hashable)
WarmUp: TypeAlias = Callable[[T], tuple[float, bool]]

LONG_RUN_S = 0.5  # runs longer than this are repeated LONG_REPEATS times at most
LONG_REPEATS = 5
# Of the budget, what the warm-up runs may take before expensive rungs are left out, so that there is time for about two
# rounds; and what warm-ups and building may take together.
_WARM_UP_SHARE, _BUILD_SHARE = 0.3, 0.6


@dataclass
class Timings(Generic[T]):
    """What `conduct` found: by point, run times in s of those that can be repeated, seconds of the warm-up of all that
    were tried, and why the budget left out the others."""

    times: dict[T, list[float]] = field(default_factory=dict)
    warm: dict[T, float] = field(default_factory=dict)
    left_out: dict[T, str] = field(default_factory=dict)


def statistics(times: Sequence[float]) -> dict[str, float]:
    """Statistics of run times in s, by the names they are stored under; quartiles between the order statistics."""
    low, middle, high = map(float, np.quantile(times, (0.25, 0.5, 0.75)))
    return {
        "run_time_s": middle,
        "run_time_min_s": min(times),
        "run_time_q1_s": low,
        "run_time_q3_s": high,
        "repeats": len(times),
    }


def conduct(
    ladders: Sequence[Sequence[T]],
    warm_up: WarmUp[T],
    repeat: Callable[[T], float],
    budget_s: float,
    repeats: int,
    clock: Callable[[], float],
) -> Timings[T]:
    """Warms up every point, the cheapest next rung of any ladder first, then times them in rounds.

    ladders     each coarse to fine
    warm_up     builds the point and runs it once: seconds, and whether it came back, so that it can be repeated
    repeat      runs it once more: seconds
    budget_s    for all of it, on `clock` (s)
    """
    found: Timings[T] = Timings()
    start = clock()

    def left() -> float:
        return min(_WARM_UP_SHARE * budget_s - sum(found.warm.values()), _BUILD_SHARE * budget_s - (clock() - start))

    _warm_all(found, ladders, warm_up, left)
    alive = {point: max(found.warm[point], 1e-9) for point in found.times}
    few = min(repeats, LONG_REPEATS)
    wanted = {point: repeats if seconds <= LONG_RUN_S else few for point, seconds in alive.items()}
    allowed = allot(alive, wanted, budget_s - (clock() - start))
    for round_ in range(max(allowed.values(), default=0)):
        for point, count in allowed.items():
            if round_ and clock() - start > budget_s:  # the machine has become slower
                return found
            if round_ < count:
                found.times[point].append(repeat(point))
    return found


def _warm_all(
    found: Timings[T],
    ladders: Sequence[Sequence[T]],
    warm_up: WarmUp[T],
    left_s: Callable[[], float],
) -> None:
    """The rung expected to be cheapest comes next. What is left over when even that one does not fit is left out."""
    waiting = [(0.0, 0, number) for number, ladder in enumerate(ladders) if ladder]
    while waiting:
        expected, rung, number = heapq.heappop(waiting)
        ladder = ladders[number]
        if rung and expected > left_s():
            reason = f"not run: about {expected:.2g} s more were not in the budget"
            found.left_out.update(dict.fromkeys(ladder[rung:], reason))
            continue
        found.warm[ladder[rung]], returned = warm_up(ladder[rung])
        if returned:
            found.times[ladder[rung]] = []
        if rung + 1 < len(ladder):
            following = _expected([found.warm[point] for point in ladder[: rung + 1]])
            heapq.heappush(waiting, (following, rung + 1, number))


def _expected(earlier: Sequence[float]) -> float:
    """Expected time of the next rung in s: the last one's time, grown as from the one before it, at least doubled."""
    growth = earlier[-1] / earlier[-2] if len(earlier) > 1 and earlier[-2] > 0.0 else 2.0
    return earlier[-1] * min(max(growth, 2.0), 10.0)


def allot(seconds: Mapping[T, float], wanted: Mapping[T, int], budget_s: float) -> dict[T, int]:
    """Repeats of each point: all it wants or what an equal share of time allows, and one in any case.

    What points that want less than their share leave is shared by the others.
    """
    found: dict[T, int] = {}
    by_demand = sorted(seconds, key=lambda point: wanted[point] * seconds[point])
    for done, point in enumerate(by_demand):
        share = budget_s / (len(by_demand) - done) * (1.0 + 1e-12)
        found[point] = max(1, min(wanted[point], int(share / seconds[point])))
        budget_s -= found[point] * seconds[point]
    return {point: found[point] for point in seconds}


BENCH = "bench"

_REFERENCE_LIMIT_S = 60.0
# A run longer than this is ended: a hanging engine must not eat the budget of the others.
_RUN_LIMIT_S = 10.0


@dataclass(frozen=True)
class Curve:
    """A method over its ladder of settings on one scene: consecutive rows of the table.

    Attributes
    ----------
    scene, ladder : what is measured.
    options : of the study, stored with each point.
    """

    scene: Scene
    ladder: Ladder
    options: Mapping[str, object]

    @property
    def label(self) -> str:
        return f"{self.scene.name} {self.ladder.curve} bench"

    @property
    def first_run(self) -> str:
        """The label of its first row."""
        return str(self.rows[0]["run"])

    @property
    def rows(self) -> list[dict[str, object]]:
        """The known columns of its points."""
        method = find_method(self.ladder.method)
        known: dict[str, object] = {
            "scene": self.scene.name,
            "method_name": method.name,
            "curve": self.ladder.curve,
            "setting_kind": self.ladder.kind,
            "versions": json.dumps(row_versions(method), sort_keys=True),
            "scene_hash": scene_hash(self.scene),
            "options": json.dumps({**self.options, "duration_s": self.scene.duration}, sort_keys=True),
            "order_expected": math.nan if self.ladder.order is None else self.ladder.order,
        }
        rows = []
        short, _ = thinned(self.scene)
        for setting, chosen in self.ladder.rungs(short.duration / (short.samples - 1)).items():
            settings = method.settings.of(method.name, chosen).as_dict()
            row = known | {"settings": json.dumps(settings, sort_keys=True)}
            row |= {kind: setting if kind == self.ladder.kind else math.nan for kind in (STEP, TOLERANCE)}
            rows.append(row | {"run": f"{self.scene.name}/{self.ladder.curve} {self.ladder.kind}={setting:.6g}"})
        return rows


def bench_table(curves: Sequence[Curve]) -> Table:
    """The table of the points of these curves."""
    return points_table(BENCH, [row for curve in curves for row in curve.rows])


def replaced_points(output: Path, curves: Sequence[Curve]) -> list[tuple[str, str]]:
    """(group, run) of stored points of these curves that are no longer among them."""
    if not output.exists():
        return []
    file = TableFile(output)
    if BENCH not in file.groups:
        return []
    stored = file.table(BENCH)
    labels = {(curve.scene.name, curve.ladder.curve): [row["run"] for row in curve.rows] for curve in curves}
    owners = zip(stored.runs, stored.known["scene"], stored.known["curve"], strict=True)
    return [(BENCH, run) for run, scene, name in owners if run not in labels.get((scene, name), [run])]


def is_measured(file: TableFile, curve: Curve) -> bool:
    """Whether every point of the curve is stored."""
    return all(file.place(str(row["run"]), BENCH).is_stored for row in curve.rows)


def run_bench(
    scenes: Sequence[Scene],
    methods: Sequence[str],
    output: Path,
    *,
    repeats: int,
    budget_s: float,
    workers: int,
    settings: Mapping[str, object] | None = None,
    on_progress: OnProgress = ignore_progress,
) -> tuple[list[Outcome], list[str]]:
    """The curves of every scene into the results file `output`; what it has already is kept.

    Parameters
    ----------
    methods : whose ladders are measured; all where none is named.
    repeats : timed runs of each point at most.
    budget_s : s, for all curves of a scene.
    workers : processes that compute references before the first curve is timed.
    settings : of the methods that have them, the same at every point.

    Returns
    -------
    The curves measured by this call, and a line for each method that is left out on a scene.

    Raises
    ------
    InputError
        For a method without a ladder and for a scene without a usable reference.
    StoreError
        Where the file cannot be read or written.
    """
    chosen = with_settings(ladders(methods), settings or {})
    with writing(output):
        changed = _complete_references(scenes, output, workers)
        # Refused before the first is measured.
        prepared = {scene.name: prepared_scene(scene, output) for scene in scenes}
        curves: list[Curve] = []
        left_out: list[str] = []
        options = {"repeats": repeats, "budget_s": budget_s}
        for scene in scenes:
            able, refused = able_methods(scene, dict.fromkeys(ladder.method for ladder in chosen))
            curves += [Curve(scene, ladder, options) for ladder in chosen if ladder.method in able]
            left_out += refused
        file = extend_file(output, [bench_table(curves)], replaced_points(output, curves))
        missing = [curve for curve in curves if curve.scene.name in changed or not is_measured(file, curve)]
        made: list[Outcome] = []
        for scene in scenes:
            own = [curve for curve in missing if curve.scene.name == scene.name]
            for outcome in _measure_scene(file, own, *prepared[scene.name], repeats, budget_s) if own else ():
                made.append(replace(outcome, share=(len(made) + 1) / len(missing)))
                on_progress(len(made), len(missing), made[-1])
        return made, left_out


def with_settings(chosen: Sequence[Ladder], settings: Mapping[str, object]) -> list[Ladder]:
    """The ladders with these settings fixed, where their methods have them and they are no choice of the ladder itself.

    Raises
    ------
    InputError
        For a setting that no method has, that is not allowed, or that a ladder varies.
    """
    own = settings_for(list(dict.fromkeys(ladder.method for ladder in chosen)), settings)
    varied = {name for ladder in chosen for name in ladder.fill(1.0) if name in own[ladder.method]}
    if varied:
        raise InputError(f"bench varies {', '.join(sorted(varied))} itself; allowed: other settings of the methods")
    return [replace(ladder, choices={**own[ladder.method], **ladder.choices}) for ladder in chosen]


def _complete_references(scenes: Sequence[Scene], output: Path, workers: int) -> set[str]:
    """The names of the scenes whose reference this call computed or read."""
    none: Mapping[str, Sequence[str]] = {scene.name: () for scene in scenes}
    report = run_scenes(scenes, none, output, workers=workers, timeout_s=_REFERENCE_LIMIT_S)
    failed = [*report.failures, *report.not_computed]
    if failed:
        raise InputError(
            f"{run.label.partition(' ')[0]}: no usable reference ({run.status}: {run.message}); a bench needs one"
            for run in failed
        )
    return {run.label.partition(" ")[0] for run in report.made}


def _measure_scene(
    file: TableFile, curves: Sequence[Curve], short: Scene, reference: Trajectory, repeats: int, budget_s: float
) -> Iterator[Outcome]:
    """Time, judge and store every point of the curves of one scene."""
    load_before = os.getloadavg()[0]
    points = [points_of(curve.ladder, short.duration / (short.samples - 1)) for curve in curves]
    scenes = {point: (short, reference) for own in points for point in own}
    measured = measure_points(scenes, points, repeats, budget_s)
    core = last_core()
    shared = facts_of(short, reference) | {"load_before": load_before, "pinned_core": -1 if core is None else core}
    for curve, own in zip(curves, points, strict=True):
        lost = measured.lost(own)
        if lost:
            yield Outcome(curve.label, curve.ladder.method, "worker_died", lost, is_stored=False)
            continue
        facts = shared | {"repeatable": int(measured.is_repeatable(own))}
        yield store_curve(file, curve, measured.rows(own), facts)


def store_curve(
    file: TableFile, curve: Curve, points: Sequence[Mapping[str, Any]], facts: Mapping[str, object]
) -> Outcome:
    """Store the points of a curve; they are counted in the message."""
    place = file.place(curve.first_run, BENCH)
    place.write(place.first, rows_of_curve(place, curve, points, facts))
    return Outcome(curve.label, curve.ladder.method, "ok", counts_of(points))


def rows_of_curve(place: Place, curve: Curve, points: Sequence[Mapping[str, Any]], facts: Mapping[str, object]) -> Rows:
    """The rows of a curve, with its fitted order. facts: columns that all its points have in common."""
    facts = {**facts, "order": curve_order(curve.ladder, points)}
    rows = []
    for point in points:
        values = {name: value for name, value in point.items() if name not in ("status", "message")}
        values |= {**facts, "left_out": int(point["status"] == "left_out")}
        rows.append(row_of_point(place, str(point["status"]), str(point["message"]), values))
    return {name: np.concatenate([row[name] for row in rows]) for name in rows[0]}


def counts_of(rows: Sequence[Mapping[str, Any]]) -> str:
    """How many points a curve has, in words."""
    statuses = [row["status"] for row in rows]
    failed = sum(status not in ("ok", "left_out") for status in statuses)
    return f"{len(statuses)} points, {failed} failed, {statuses.count('left_out')} left out"


def curve_order(ladder: Ladder, rows: Sequence[Mapping[str, Any]]) -> float:
    """The order of convergence over the points that are ok; NaN where it cannot be fitted."""
    ok = [row for row in rows if row["status"] == "ok"]
    if ladder.kind != STEP:
        return math.nan
    errors = np.maximum(np.array([row["angle_error_max"] for row in ok]), SMALLEST_ERROR)
    order = fitted_order(np.array([row["setting"] for row in ok]), errors)
    return math.nan if order is None else order


def facts_of(short: Scene, reference: Trajectory) -> dict[str, Any]:
    """What all points of a scene have in common; the uncertainty over the samples that errors are taken at."""
    uncertainty = reference.angle_uncertainty
    compared = max(horizon_samples(reference), 1)
    return {
        "horizon_s": horizon(reference),
        "uncertainty_rad": 0.0 if uncertainty is None else float(uncertainty[:compared].max()),
        "samples": short.samples,
    }


def points_of(ladder: Ladder, interval: float) -> list[Point]:
    """A point per rung, on a scene whose samples are `interval` s apart."""
    return [
        Point(ladder.curve, ladder.method, setting, tuple(sorted(settings.items())))
        for setting, settings in ladder.rungs(interval).items()
    ]


@dataclass
class Measured:
    """What was measured, by point.

    Attributes
    ----------
    answers : of the timer, by the names they are stored under.
    unanswered : status and message of a point that failed; "worker_died": its process died twice, nothing is known.
    """

    timings: Timings[Point] = field(default_factory=Timings)
    answers: dict[Point, dict[str, Any]] = field(default_factory=dict)
    unanswered: dict[Point, tuple[str, str]] = field(default_factory=dict)

    def lost(self, points: Sequence[Point]) -> str:
        """Why a curve is not stored: one of its points is lost; "" where none is."""
        for point in points:
            status, message = self.unanswered.get(point, ("", ""))
            if status == "worker_died":
                return f"{point.method} at {point.setting:g}: {message}"
        return ""

    def is_repeatable(self, points: Sequence[Point]) -> bool:
        """Whether the last run of every point was bit for bit its first one."""
        return all(self.answers.get(point, {}).get("same", True) for point in points)

    def fail(self, point: Point, message: str) -> None:
        """Takes note of a point that raised an error."""
        self.unanswered[point] = ("solver_failed", message)
        self.timings.warm[point] = math.nan

    def rows(self, points: Sequence[Point]) -> list[dict[str, Any]]:
        """The columns of each point; NaN and 0 where there is nothing."""
        times = ("run_time_s", "run_time_min_s", "run_time_q1_s", "run_time_q3_s")
        others = ("setup_time_s", "setup_again_time_s", "output_time_s")
        rows = []
        for point in points:
            row: dict[str, Any] = {"setting": point.setting, **dict.fromkeys((*ERRORS, *times, *others), np.nan)}
            row |= {"repeats": 0, "steps": 0, "status": "left_out", "false_success": 0, "message": ""}
            if point in self.timings.left_out:
                row["message"] = self.timings.left_out[point]
            elif point in self.unanswered:
                row["status"], row["message"] = self.unanswered[point]
                row["run_time_s"] = self.timings.warm[point]
            else:
                row |= self.answers[point] | statistics(self.timings.times[point])
            rows.append(row)
        return rows


def measure_points(scenes: PointScenes, points: Sequence[Sequence[Point]], repeats: int, budget_s: float) -> Measured:
    """Times all points in rounds, and judges the last run of each; in one worker process on one core.

    Parameters
    ----------
    points : by curve, each coarse to fine.
    repeats, budget_s : timed runs of a point at most, and s for all of them.
    """
    methods = tuple(dict.fromkeys(point.method for point in scenes))
    limit = min(_RUN_LIMIT_S, budget_s)
    measured = Measured()
    with WorkerPool(1, partial(start_timer, methods, scenes), last_core()) as pool:

        def answer(task: str, point: Point) -> Any:
            """None where there is none."""
            if point in measured.unanswered:
                return None
            (end,) = run_in(pool, ask, [(task, point)], limit)
            if end.failure:
                status = "solver_failed" if end.failure == "error" else end.failure
                measured.unanswered[point] = status, end.message
            return end.value

        def warm_up(point: Point) -> tuple[float, bool]:
            start = time.perf_counter()
            prepared = answer("prepare", point)
            if prepared is None:
                return time.perf_counter() - start, False
            measured.answers[point] = prepared
            return prepared["run_time_s"], True

        def repeat(point: Point) -> float:
            seconds = answer("repeat", point)
            return math.nan if seconds is None else float(seconds)

        measured.timings = conduct(points, warm_up, repeat, budget_s, repeats, time.perf_counter)
        for point, known in measured.answers.items():
            known |= answer("judge", point) or {}
    return measured
