"""Make tables for a terminal or a notebook: of runs, methods, bench curves and sweep parameters."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from html import escape

import numpy as np

from rotor_mbs.analysis.work_precision import TARGETS_RAD, left_out, points, time_to_reach
from rotor_mbs.methods.catalogue import REFERENCE, is_corrected
from rotor_mbs.runs.read import Record, StoredRun, StoredScene
from rotor_mbs.runs.sweeps import StoredSweep, parameter_name
from rotor_mbs.solution.status import GOOD, comparison, short_number

RUN_HEAD = (
    "method",
    "status",
    "defect (rad)",
    "allowed",
    "error (rad), limit 0.01",
    "compared",
    "energy drift",
    "time (s)",
)
MOST_ROWS = 40  # largest number of runs in a table with a row for each run


def run_row(run: StoredRun) -> tuple[str, ...]:
    """Return the row of a run in a table with the heading RUN_HEAD."""
    facts = run.attributes
    shown = comparison(facts, float(run.scales["time"][-1]))
    if run.method == REFERENCE:  # the reference is not compared with itself
        shown = shown._replace(error="", compared="")
    seconds = facts.get("run_time_s")  # None if the process was ended
    time = "read" if run.is_frozen else "" if seconds is None else f"{seconds:.3g}"
    return run.method, run.status, *shown, short_number(facts.get("energy_drift_max")), time


def table_of_runs(
    scenes: Mapping[str, StoredScene], wanted: Mapping[str, Iterable[str]]
) -> TextTable:
    """Return a table with a row for each requested run and for the reference of each scene.

    If there are more than MOST_ROWS runs, the table has a row for each method instead.

    Parameters
    ----------
    scenes : stored scenes by name.
    wanted : names of the requested methods by scene name.
    """
    runs = []
    rows: list[tuple[str, ...]] = []
    for name, methods in wanted.items():
        if name not in scenes:
            continue
        for method in (REFERENCE, *methods):
            if method in scenes[name].runs:
                run = scenes[name].runs[method]
                runs.append(run)
                rows.append((scenes[name].label, *run_row(run)))
    if len(runs) > MOST_ROWS:
        return method_table(run for run in runs if run.method != REFERENCE)
    return TextTable(("scene", *RUN_HEAD), rows)


def method_table(runs: Iterable[StoredRun]) -> TextTable:
    """Return a table with a row for each method: how many of its runs ended well, and numbers.

    The numbers are the largest defect, error and energy drift of the runs that ended well, and the
    longest run time of all runs.

    Parameters
    ----------
    runs : runs of any scenes and methods.
    """
    head = (
        "method",
        "runs",
        "largest defect (rad)",
        "largest error (rad)",
        "energy drift",
        "longest run time (s)",
    )
    by_method: dict[str, list[StoredRun]] = {}
    for run in runs:
        by_method.setdefault(run.method, []).append(run)
    rows = []
    for method, own in by_method.items():
        ended_well = [run for run in own if run.status in GOOD]
        count = f"{len(ended_well)} of {len(own)} {'ok' if is_corrected(method) else 'completed'}"
        numbers = []
        for name in ("defect_max", "angle_error_max", "energy_drift_max"):
            known = [float(run.attributes[name]) for run in ended_well if name in run.attributes]
            numbers.append(short_number(max(known, default=None)))
        seconds = [run.attributes["run_time_s"] for run in own if "run_time_s" in run.attributes]
        rows.append((method, count, *numbers, f"{max(seconds):.3g}" if seconds else ""))
    return TextTable(head, rows)


def bench_table(curves: Sequence[Record]) -> TextTable:
    """Return a table with a row per curve: number of ok settings, smallest error, run times.

    The run times are those to reach the errors TARGETS_RAD. If a curve does not reach an error, the
    cell is empty. The cell is "not measured" if the time budget of the bench left out finer
    settings, which might reach the error.

    Parameters
    ----------
    curves : records of a bench.
    """
    rows = []
    for curve in curves:
        errors, seconds = points(curve)
        times = [time_to_reach(errors, seconds, target) for target in TARGETS_RAD]
        count = f"{curve.statuses.count('ok')} of {len(curve.statuses)}"
        best = short_number(float(errors.min())) if len(errors) else ""
        missing = "not measured" if left_out(curve) else ""
        rows.append(
            (
                curve.scene,
                curve.name,
                count,
                best,
                *(missing if t is None else f"{t:.2e}" for t in times),
            )
        )
    return TextTable(
        (
            "scene",
            "method",
            "ok",
            "best error (rad)",
            *(f"s to {target:.0e} rad" for target in TARGETS_RAD),
        ),
        rows,
    )


def sweep_parameters(sweep: StoredSweep) -> TextTable:
    """Return a table with a row for each varied parameter of a sweep: unit, range, value count."""
    rows = []
    for key in sweep.keys:
        name = parameter_name(key)
        values = np.asarray(sweep.column(name), float)
        unit = sweep.columns[name].units
        ends = (
            f"{value:.6g}" for value in (values.min(initial=np.inf), values.max(initial=-np.inf))
        )
        rows.append((key, "" if unit == "1" else unit, *ends, str(len(np.unique(values)))))
    return TextTable(("varied", "unit", "from", "to", "values"), rows)


@dataclass(frozen=True)
class TextTable:
    """Hold a table of texts with a heading, which is printed in columns, in a notebook as HTML."""

    head: tuple[str, ...]
    rows: list[tuple[str, ...]]

    def __str__(self) -> str:
        rows = [self.head, *self.rows]
        widths = [max(len(cell) for cell in column) for column in zip(*rows, strict=True)]
        lines = [
            "  ".join(f"{cell:{width}}" for cell, width in zip(row, widths, strict=True))
            for row in rows
        ]
        return "\n".join(line.rstrip() for line in lines)

    __repr__ = __str__

    def _repr_html_(self) -> str:
        head = "".join(f"<th>{escape(cell)}</th>" for cell in self.head)
        rows = "".join(
            f"<tr>{''.join(f'<td>{escape(cell)}</td>' for cell in row)}</tr>" for row in self.rows
        )
        return f"<table><tr>{head}</tr>{rows}</table>"
