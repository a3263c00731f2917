"""One scene's curves: all points timed in rounds by one process on one core, judged, and put into arrays."""

from __future__ import annotations

import hashlib
import json
import os
import time
from collections.abc import Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np

from rotor_mbs.analysis.work_precision import SMALLEST_ERROR, fitted_order
from rotor_mbs.execution.environment import numerics_fingerprint, versions
from rotor_mbs.execution.servant import NoAnswerError, Servant, last_core
from rotor_mbs.execution.timing import Timings, Warm, conduct, statistics
from rotor_mbs.methods.ladders import STEP, Ladder
from rotor_mbs.scenario.scene import Scene, scene_hash
from rotor_mbs.solution.metrics import horizon, horizon_samples
from rotor_mbs.solution.record import Trajectory
from rotor_mbs.solution.status import STATUSES
from rotor_mbs.store.records import Record
from rotor_mbs.studies.bench_work import Judged, MakeTimingProcess, Point, Prepared, Request, prepared_scene

# A run longer than this is ended: a hanging engine must not eat the budget of the others.
_RUN_LIMIT_S = 10.0
_ERRORS = ("angle_error_max", "angle_error_end", "tip_error_max", "energy_drift_max")


@dataclass(frozen=True)
class Plan:
    """What to measure: budget_s for the scene; results: the file with the scene's reference."""

    scene: Scene
    ladders: tuple[Ladder, ...]
    results: Path
    repeats: int
    budget_s: float


@dataclass
class Findings:
    """By point."""

    prepared: dict[Point, Prepared] = field(default_factory=dict)
    judged: dict[Point, Judged] = field(default_factory=dict)
    unanswered: dict[Point, tuple[str, str]] = field(default_factory=dict)


def measure(plan: Plan) -> list[Record]:
    """Times, judges and collects every point of the plan."""
    load_before = os.getloadavg()[0]
    number = scene_hash(plan.scene)
    short, reference = prepared_scene(plan.scene, plan.results)
    interval = short.duration / (short.samples - 1)
    points = [_points(ladder, interval) for ladder in plan.ladders]
    methods = tuple(dict.fromkeys(ladder.method for ladder in plan.ladders))
    make = MakeTimingProcess(plan.scene, plan.results, methods)
    found = Findings()
    with Servant(make, last_core()) as servant:
        timings = time_points(servant, points, plan.repeats, plan.budget_s, found)
        judge_all(servant, timings, found, plan.budget_s)
    shared = {
        "scene_hash": number,
        "horizon_s": horizon(reference),
        "uncertainty_rad": _uncertainty(reference),
        "duration_s": plan.scene.duration,
        "samples": short.samples,
        "budget_s": plan.budget_s,
        "load_before": load_before,
        "load_after": os.getloadavg()[0],
        "pinned_core": -1 if last_core() is None else last_core(),
    }
    return [
        _curve(plan, ladder, chosen, timings, found, shared)
        for ladder, chosen in zip(plan.ladders, points, strict=True)
    ]


def _uncertainty(reference: Trajectory) -> float:
    """rad: the reference's own, over the samples that errors are taken at."""
    if reference.angle_uncertainty is None:
        return 0.0
    return float(reference.angle_uncertainty[: max(horizon_samples(reference), 1)].max())


def bench_hash(scene: Scene, ladder: Ladder, repeats: int, budget_s: float) -> str:
    """Of all that decides a curve: a stored one with the same is not measured again."""
    settings = [(rung.setting, sorted(rung.settings.items())) for rung in ladder.rungs(1.0)]
    content = [scene_hash(scene), ladder.curve, settings, repeats, budget_s, versions(), numerics_fingerprint()]
    return hashlib.sha256(json.dumps(content, sort_keys=True, default=str).encode()).hexdigest()


def _points(ladder: Ladder, interval: float) -> list[Point]:
    return [
        Point(ladder.curve, ladder.method, i, rung.setting, tuple(sorted(rung.settings.items())))
        for i, rung in enumerate(ladder.rungs(interval))
    ]


def time_points(
    servant: Servant, points: Sequence[Sequence[Point]], repeats: int, budget_s: float, found: Findings
) -> Timings[Point]:
    """Times all points by one servant; what it tells of them goes into `found`."""
    limit = min(_RUN_LIMIT_S, budget_s)

    def warm_up(point: Point) -> Warm:
        start = time.perf_counter()
        try:
            found.prepared[point] = servant.ask(Request("prepare", point), limit)
        except NoAnswerError as exc:
            found.unanswered[point] = ("timed_out" if exc.timed_out else "solver_failed", str(exc))
        except RuntimeError as exc:
            found.unanswered[point] = ("solver_failed", str(exc))
        else:
            return Warm(found.prepared[point].run_s, returned=True)
        return Warm(time.perf_counter() - start, returned=False)

    def repeat(point: Point) -> float:
        seconds: float = servant.ask(Request("repeat", point), limit)
        return seconds

    return conduct(points, warm_up, repeat, budget_s, repeats, time.perf_counter)


def judge_all(servant: Servant, timings: Timings[Point], found: Findings, budget_s: float) -> None:
    """Has the last run of every point judged."""
    for point in timings.warm:
        if point not in found.unanswered:
            found.judged[point] = servant.ask(Request("judge", point), min(_RUN_LIMIT_S, budget_s))


def rows(points: Sequence[Point], timings: Timings[Point], found: Findings) -> list[dict[str, Any]]:
    """Every dataset's value at each point."""
    return [_row(point, timings, found) for point in points]


def _curve(
    plan: Plan,
    ladder: Ladder,
    points: Sequence[Point],
    timings: Timings[Point],
    found: Findings,
    shared: dict[str, object],
) -> Record:
    values = rows(points, timings, found)
    arrays = {name: np.array([row[name] for row in values]) for name in values[0] if name != "message"}
    attributes: dict[str, Any] = {
        **shared,
        "method": ladder.method,
        "choices": json.dumps(dict(ladder.choices), sort_keys=True),
        "setting_kind": ladder.kind,
        "run_hash": bench_hash(plan.scene, ladder, plan.repeats, plan.budget_s),
        "messages": [str(row["message"]) for row in values],
        "repeatable": all(found.judged[point].same for point in points if point in found.judged),
    }
    if ladder.order is not None:
        attributes["order_expected"] = ladder.order
    ok = arrays["status"] == STATUSES.index("ok")
    errors = np.maximum(arrays["angle_error_max"][ok], SMALLEST_ERROR)
    if ladder.kind == STEP and (order := fitted_order(arrays["setting"][ok], errors)) is not None:
        attributes["order"] = order
    return Record("bench", plan.scene.name, ladder.curve, attributes, arrays)


def _row(point: Point, timings: Timings[Point], found: Findings) -> dict[str, Any]:
    """Every dataset's value at one setting; NaN and 0 where there is none."""
    row: dict[str, Any] = {"setting": point.setting, **dict.fromkeys(_ERRORS, np.nan)}
    names = ("run_time_s", "run_time_min_s", "run_time_q1_s", "run_time_q3_s")
    row |= dict.fromkeys((*names, "setup_time_s", "setup_again_time_s", "output_time_s"), np.nan)
    row |= {"repeats": 0, "steps": 0, "status": STATUSES.index("left_out"), "false_success": 0, "message": ""}
    if point in timings.left_out:
        row["message"] = timings.left_out[point]
    elif point in found.unanswered:
        status, row["message"] = found.unanswered[point]
        row["status"] = STATUSES.index(status)
        row["run_time_s"] = timings.warm[point].seconds
    else:
        times = statistics(timings.times[point])
        values = (times.median, times.minimum, times.lower_quartile, times.upper_quartile)
        row |= dict(zip(names, values, strict=True))
        judged, prepared = found.judged[point], found.prepared[point]
        if judged.status in ("ok", "inaccurate"):  # the errors of a run that broke off are those of its part
            row |= {name: judged.metrics.get(name, np.nan) for name in _ERRORS}
        row |= {
            "setup_time_s": prepared.setup_s,
            "setup_again_time_s": prepared.setup_again_s,
            "output_time_s": judged.output_s,
            "repeats": times.repeats,
            "steps": judged.steps,
            "status": STATUSES.index(judged.status),
            "false_success": int(judged.false_success),
            "message": judged.message,
        }
    return row
