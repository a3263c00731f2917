"""What came out, as small tables for a terminal or a notebook: of runs, of methods over many runs, of bench curves."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping, Sequence

from rotor_mbs.analysis.claims import agreement
from rotor_mbs.analysis.work_precision import TARGETS_RAD, points, succeeded, time_to_reach
from rotor_mbs.methods.catalogue import REFERENCE
from rotor_mbs.runs.read import StoredRun, StoredScene
from rotor_mbs.runs.records import Record
from rotor_mbs.solution.text_table import TextTable

RUN_HEAD = ("method", "status", "largest defect (rad)", "error (rad), ok to 0.01", "energy drift", "time (s)")
_MOST_ROWS = 40  # of a table with a row for each run


def run_row(method: str, status: str, facts: Mapping[str, object], seconds: float | None) -> tuple[str, ...]:
    """Cells under RUN_HEAD; facts: metrics by their stored names; seconds: None where nothing was integrated."""
    time = "read" if seconds is None else f"{seconds:.3g}"
    numbers = (_short(facts.get(name)) for name in ("defect_max", "angle_error_max", "energy_drift_max"))
    return (method, status, *numbers, time)


def run_table(scenes: Mapping[str, StoredScene], wanted: Mapping[str, Iterable[str]]) -> TextTable:
    """A row for each of the `wanted` runs and their references; of many runs, one for each method."""
    runs = [
        scenes[name].runs[method]
        for name, methods in wanted.items()
        if name in scenes
        for method in (REFERENCE, *methods)
        if method in scenes[name].runs
    ]
    if len(runs) > _MOST_ROWS:
        return method_table(run for run in runs if run.method != REFERENCE)
    rows = []
    for run in runs:
        facts = dict(run.attributes)
        seconds = None if "frozen_with" in facts else facts.get("run_time_s", 0.0)
        if run.method == REFERENCE:  # it has no error against itself
            facts.pop("angle_error_max", None)
        rows.append((run.scene, *run_row(run.method, run.status, facts, seconds)))
    return TextTable(("scene", *RUN_HEAD), rows)


def method_table(runs: Iterable[StoredRun]) -> TextTable:
    """A row for each method: how many of its runs ended well, and the largest numbers among those."""
    rows = []
    for row in agreement(runs):
        worst = {"defect_max": row.defect, "angle_error_max": row.angle_error, "energy_drift_max": row.energy_drift}
        rows.append(run_row(row.method, row.runs, worst, row.longest_s))
    return TextTable(
        ("method", "runs", "largest defect (rad)", "largest error (rad)", "largest drift", "longest (s)"), rows
    )


def bench_table(curves: Sequence[Record]) -> TextTable:
    """A row for each curve: how many settings are ok, the smallest error, and the run time to reach given errors."""
    rows = []
    for curve in curves:
        errors, seconds = points(curve)
        times = [time_to_reach(errors, seconds, target) for target in TARGETS_RAD]
        count = f"{int(succeeded(curve).sum())} of {len(curve.statuses)}"
        best = _short(float(errors.min())) if len(errors) else ""
        rows.append((curve.scene, curve.name, count, best, *("" if t is None else f"{t:.2e}" for t in times)))
    return TextTable(
        ("scene", "method", "ok", "best error (rad)", *(f"s to {target:.0e}" for target in TARGETS_RAD)), rows
    )


def _short(value: object) -> str:
    return f"{value:.1e}" if isinstance(value, float) and math.isfinite(value) else ""
