"""Error against run time: each curve is a case, one method over its ladder of settings on one scene.

The curves of a scene are timed together, in rounds over all their points, by one worker process on one core.
"""

from __future__ import annotations

import json
import math
import os
import time
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import partial
from itertools import chain
from pathlib import Path
from typing import Any

import numpy as np

from rotor_mbs.analysis.work_precision import SMALLEST_ERROR, fitted_order
from rotor_mbs.errors import InputError
from rotor_mbs.methods.catalogue import ladders, settings_for
from rotor_mbs.methods.ladders import STEP, Ladder
from rotor_mbs.runs import last_core
from rotor_mbs.runs.case import Case
from rotor_mbs.runs.layout import KEY_ATTRIBUTE
from rotor_mbs.runs.pool import WorkerPool, run_in
from rotor_mbs.runs.records import Record, write_records
from rotor_mbs.runs.results_file import ResultsStore
from rotor_mbs.runs.runner import Job, OnProgress, Outcome, Result, execute, ignore_progress
from rotor_mbs.runs.timing import Timings, conduct, statistics
from rotor_mbs.scenario.scene import Scene
from rotor_mbs.solution.metrics import horizon, horizon_samples
from rotor_mbs.solution.status import code_of
from rotor_mbs.solution.trajectory import Trajectory
from rotor_mbs.studies.bench_worker import ERRORS, Point, PointScenes, ask, prepared_scene, start_timer
from rotor_mbs.studies.run import able_methods, reference_case, run_scenes

BENCH = "bench"
SOURCES = ("studies/bench.py", "studies/bench_worker.py", "runs/timing.py")

_REFERENCE_LIMIT_S = 60.0
# A run longer than this is ended: a hanging engine must not eat the budget of the others.
_RUN_LIMIT_S = 10.0


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

    Returns the curves measured by this call, and a line for each method that is left out on a scene.

    methods     whose ladders are measured; all where none is named
    repeats     timed runs of each point at most
    budget_s    s, for all curves of a scene
    workers     processes that compute references before the first curve is timed
    settings    of the methods that have them, the same at every point

    Raises InputError for a method without a ladder and for a scene without a usable reference, StoreError.
    """
    chosen = with_settings(ladders(methods), settings or {})
    _complete_references(scenes, output, workers)
    for scene in scenes:  # refused before the first is measured
        prepared_scene(scene, output)
    cases: list[Case] = []
    left_out: list[str] = []
    for scene in scenes:
        able, refused = able_methods(scene, dict.fromkeys(ladder.method for ladder in chosen))
        cases += [_bench_case(scene, ladder, repeats, budget_s) for ladder in chosen if ladder.method in able]
        left_out += refused
    return execute(cases, _time_by_scene, ResultsStore(output), on_progress), left_out


def with_settings(chosen: Sequence[Ladder], settings: Mapping[str, object]) -> list[Ladder]:
    """The ladders with these settings fixed, where their methods have them and they are no choice of the ladder itself.

    Raises InputError for a setting that no method has, that is not allowed, or that a ladder varies.
    """
    own = settings_for(list(dict.fromkeys(ladder.method for ladder in chosen)), settings)
    varied = {name for ladder in chosen for name in ladder.fill(1.0) if name in own[ladder.method]}
    if varied:
        raise InputError(f"bench varies {', '.join(sorted(varied))} itself; allowed: other settings of the methods")
    return [replace(ladder, choices={**own[ladder.method], **ladder.choices}) for ladder in chosen]


def _complete_references(scenes: Sequence[Scene], output: Path, workers: int) -> None:
    none: Mapping[str, Sequence[str]] = {scene.name: () for scene in scenes}
    report = run_scenes(scenes, none, output, workers=workers, timeout_s=_REFERENCE_LIMIT_S)
    failed = [*report.failures, *report.not_computed]
    if failed:
        raise InputError(
            f"{one.case.scene.name}: no usable reference ({one.result.status}: {one.result.message}); a bench needs one"
            for one in failed
        )


def _bench_case(scene: Scene, ladder: Ladder, repeats: int, budget_s: float) -> Case:
    rungs = [[setting, sorted(settings.items())] for setting, settings in ladder.rungs(1.0).items()]
    options = {"curve": ladder.curve, "rungs": rungs, "repeats": repeats, "budget_s": budget_s}
    return Case(scene, ladder.method, ladder.choices, BENCH, options, reference_case(scene).key, SOURCES)


def store_curve(job: Job, record: Record) -> Result:
    """Writes the part of a curve; its points are counted in the message."""
    write_records(job.part, [record])
    failed = sum(status not in ("ok", "left_out") for status in record.statuses)
    counts = f"{len(record.statuses)} points, {failed} failed, {record.statuses.count('left_out')} left out"
    return Result("ok", counts)


def _time_by_scene(waves: Iterable[Sequence[Job]]) -> Iterator[tuple[Job, Result]]:
    """Times, judges and collects every point of the curves of one scene, then of the next."""
    jobs = list(chain.from_iterable(waves))
    for name in dict.fromkeys(job.case.scene.name for job in jobs):
        yield from _measure_scene([job for job in jobs if job.case.scene.name == name])


def _measure_scene(jobs: Sequence[Job]) -> Iterator[tuple[Job, Result]]:
    load_before = os.getloadavg()[0]
    case, results = jobs[0].case, jobs[0].reference
    assert results is not None  # every bench case has a reference
    short, reference = prepared_scene(case.scene, results)
    by_curve = {ladder.curve: ladder for ladder in ladders()}
    own = [replace(by_curve[str(job.case.options["curve"])], choices=job.case.settings) for job in jobs]
    points = [points_of(ladder, short.duration / (short.samples - 1)) for ladder in own]
    scenes = {point: (short, reference) for curve in points for point in curve}
    measured = measure_points(scenes, points, case.options)
    shared = facts_of(case, short, reference) | {
        "budget_s": case.options["budget_s"],
        "load_before": load_before,
        "load_after": os.getloadavg()[0],
        "pinned_core": -1 if last_core() is None else last_core(),
    }
    for job, ladder, curve in zip(jobs, own, points, strict=True):
        facts = shared | {"repeatable": measured.is_repeatable(curve)}
        yield job, measured.lost(curve) or store_curve(job, curve_record(job.case, ladder, measured.rows(curve), facts))


def facts_of(case: Case, short: Scene, reference: Trajectory) -> dict[str, Any]:
    """Attributes that all curves of a scene have; the uncertainty over the samples that errors are taken at."""
    uncertainty = reference.angle_uncertainty
    compared = max(horizon_samples(reference), 1)
    return {
        "scene_hash": case.scene_hash,
        "horizon_s": horizon(reference),
        "uncertainty_rad": 0.0 if uncertainty is None else float(uncertainty[:compared].max()),
        "duration_s": case.scene.duration,
        "samples": short.samples,
    }


def points_of(ladder: Ladder, interval: float) -> list[Point]:
    """A point per rung, on a scene whose samples are `interval` s apart."""
    return [
        Point(ladder.curve, ladder.method, setting, tuple(sorted(settings.items())))
        for setting, settings in ladder.rungs(interval).items()
    ]


def curve_record(case: Case, ladder: Ladder, rows: Sequence[Mapping[str, Any]], shared: Mapping[str, Any]) -> Record:
    """The record of a curve from the rows of its points."""
    arrays = arrays_of(rows)
    attributes: dict[str, Any] = {
        **shared,
        "method": ladder.method,
        "choices": json.dumps(dict(ladder.choices), sort_keys=True),
        "setting_kind": ladder.kind,
        KEY_ATTRIBUTE: case.key,
        "messages": [str(row["message"]) for row in rows],
    }
    if ladder.order is not None:
        attributes["order_expected"] = ladder.order
    ok = arrays["status"] == code_of("ok")
    errors = np.maximum(arrays["angle_error_max"][ok], SMALLEST_ERROR)
    if ladder.kind == STEP and (order := fitted_order(arrays["setting"][ok], errors)) is not None:
        attributes["order"] = order
    return Record(BENCH, case.scene.name, ladder.curve, attributes, arrays)


def arrays_of(rows: Sequence[Mapping[str, Any]]) -> dict[str, Any]:
    """Arrays over the settings of a curve, from what was measured at each."""
    return {name: np.array([row[name] for row in rows]) for name in rows[0] if name != "message"}


@dataclass
class Measured:
    """What was measured, by point.

    answers      of the timer, by the names they are stored under
    unanswered   status and message of a point that failed; "worker_died": its process died twice, nothing is known
    """

    timings: Timings[Point] = field(default_factory=Timings)
    answers: dict[Point, dict[str, Any]] = field(default_factory=dict)
    unanswered: dict[Point, tuple[str, str]] = field(default_factory=dict)

    def lost(self, points: Sequence[Point]) -> Result | None:
        """Of a curve that is not stored, as one of its points is lost; None of others."""
        for point in points:
            status, message = self.unanswered.get(point, ("", ""))
            if status == "worker_died":
                return Result(status, f"{point.method} at {point.setting:g}: {message}")
        return None

    def is_repeatable(self, points: Sequence[Point]) -> bool:
        """Whether the last run of every point was bit for bit its first one."""
        return all(self.answers.get(point, {}).get("same", True) for point in points)

    def fail(self, point: Point, message: str) -> None:
        """Takes note of a point that raised an error."""
        self.unanswered[point] = ("solver_failed", message)
        self.timings.warm[point] = math.nan

    def rows(self, points: Sequence[Point]) -> list[dict[str, Any]]:
        """Every dataset's value at each point; NaN and 0 where there is none."""
        return [self._row(point) for point in points]

    def _row(self, point: Point) -> dict[str, Any]:
        names = ("run_time_s", "run_time_min_s", "run_time_q1_s", "run_time_q3_s")
        others = ("setup_time_s", "setup_again_time_s", "output_time_s")
        row: dict[str, Any] = {"setting": point.setting, **dict.fromkeys((*ERRORS, *names, *others), np.nan)}
        row |= {"repeats": 0, "steps": 0, "status": "left_out", "false_success": 0, "message": ""}
        if point in self.timings.left_out:
            row["message"] = self.timings.left_out[point]
        elif point in self.unanswered:
            row["status"], row["message"] = self.unanswered[point]
            row["run_time_s"] = self.timings.warm[point]
        else:
            row |= self.answers[point] | statistics(self.timings.times[point])
            del row["same"]
        return row | {"status": code_of(row["status"])}


def measure_points(scenes: PointScenes, points: Sequence[Sequence[Point]], options: Mapping[str, Any]) -> Measured:
    """Times all points in rounds, and judges the last run of each; in one worker process on one core.

    points     by curve, each coarse to fine
    options    `repeats` and `budget_s`
    """
    methods = tuple(dict.fromkeys(point.method for point in scenes))
    limit = min(_RUN_LIMIT_S, options["budget_s"])
    found = Measured()
    with WorkerPool(1, partial(start_timer, methods, scenes), last_core()) as pool:

        def answer(task: str, point: Point) -> Any:
            """None where there is none."""
            if point in found.unanswered:
                return None
            (end,) = run_in(pool, ask, [(task, point)], limit)
            if end.failure:
                found.unanswered[point] = "solver_failed" if end.failure == "error" else end.failure, end.message
            return end.value

        def warm_up(point: Point) -> tuple[float, bool]:
            start = time.perf_counter()
            prepared = answer("prepare", point)
            if prepared is None:
                return time.perf_counter() - start, False
            found.answers[point] = prepared
            return prepared["run_time_s"], True

        def repeat(point: Point) -> float:
            seconds = answer("repeat", point)
            return math.nan if seconds is None else float(seconds)

        found.timings = conduct(points, warm_up, repeat, options["budget_s"], options["repeats"], time.perf_counter)
        for point, known in found.answers.items():
            known |= answer("judge", point) or {}
    return found
