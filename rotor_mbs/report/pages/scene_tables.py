"""Tables of a scene's numbers from the metrics stored with its runs, and from its samples. Draws nothing."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from rotor_mbs.analysis import methods
from rotor_mbs.analysis.escape_rate import escape_rate
from rotor_mbs.report import texts
from rotor_mbs.report.core.elements import Cell, Table, without_empty_columns
from rotor_mbs.report.core.numbers import number, prefixed
from rotor_mbs.report.names import name_of
from rotor_mbs.solution.judgement import is_held
from rotor_mbs.store.layout import REFERENCE
from rotor_mbs.store.read import StoredRun, StoredScene


def status_cell(run: StoredRun) -> Cell:
    """Not "ok" for a model that is held to nothing: that its run reached the end says nothing of its equations."""
    if run.status == "ok":
        return Cell(texts.status("ok"), tone="good") if is_held(run.method) else Cell(texts.RAN_TO_THE_END)
    return Cell(texts.status(run.status), tone="bad")


def metric(run: StoredRun, name: str) -> float | None:
    """A number stored with the run; None where it has none."""
    value = run.attributes.get(name)
    return float(value) if isinstance(value, float | int) else None


def horizon(scene: StoredScene) -> float | None:
    """s; None where no run was held against a reference."""
    known = [metric(run, "horizon_s") for run in scene.runs.values()]
    return next((value for value in known if value is not None), None)


def metrics_table(scene: StoredScene) -> Table:
    """Every run of the scene."""
    head = (texts.METHOD, texts.STATUS, *texts.METRIC_COLUMNS)
    rows = [_metrics_row(run) for run in methods.in_order(scene).values()]
    return without_empty_columns(Table(texts.METRICS, head, rows, numeric=(2, 3, 4, 5, 6, 8, 9, 10, 11)))


def _metrics_row(run: StoredRun) -> list[Cell]:
    errors = ("angle_error_max", "angle_error_whole", "tip_error_max")
    is_reference = run.method == REFERENCE
    cells = [Cell("" if is_reference else number(metric(run, name))) for name in errors]
    counts = [
        Cell(f"{count:.0f}" if (count := metric(run, name)) is not None else "")
        for name in ("steps", "rhs_evaluations")
    ]
    times = [Cell(prefixed(metric(run, name), "s")) for name in ("setup_time_s", "run_time_s")]
    drift, gap = metric(run, "energy_drift_max"), metric(run, "constraint_error_max")
    kept = ""
    if "zero_pitch_max" in run.attributes:
        kept = texts.left_zero(metric(run, "zero_pitch_left_s"), metric(run, "zero_pitch_growth_per_s"))
    return [
        Cell(name_of(run.method)), status_cell(run), *cells, Cell(number(drift)), Cell(number(gap)), Cell(kept),
        *counts, *times,
    ]  # fmt: skip


def metrics_notes(scene: StoredScene) -> list[str]:
    """What the numbers mean, and the reason of every run that is not ok."""
    notes = [texts.HORIZON_NOTE] if horizon(scene) is not None else []
    if any(run.status == "ok" and not is_held(run.method) for run in scene.runs.values()):
        notes.append(texts.NOT_HELD_NOTE)
    if any("zero_pitch_max" in run.attributes for run in scene.runs.values()):
        notes.append(texts.zero_pitch_note(escape_rate(scene)))
    return notes


def failures(scene: StoredScene) -> list[str]:
    """A sentence for every run that is not ok."""
    return [
        texts.ended_early(run.method, run.status, str(run.attributes.get("message", "")), _reached(run))
        for run in methods.in_order(scene).values()
        if run.status != "ok"
    ]


def _reached(run: StoredRun) -> float:
    return float(run.array("time")[-1]) if methods.has_samples(run) else 0.0


def range_table(runs: Mapping[str, StoredRun]) -> Table:
    """Extremes of each coordinate in each of the runs (heading -> run)."""
    labels = next(iter(runs.values())).labels
    head = [texts.COORDINATE]
    columns: list[list[str]] = []
    for heading, run in runs.items():
        if "angles" in run:
            low, high = run.array("angles").min(axis=0), run.array("angles").max(axis=0)
            head.append(texts.angle_column(heading))
            columns.append([texts.RANGE.format(number(a, 4), number(b, 4)) for a, b in zip(low, high, strict=True)])
        if "rates" in run:
            head.append(texts.LARGEST_RATE)
            columns.append([number(x, 3) for x in np.abs(run.array("rates")).max(axis=0)])
    rows = [[Cell(label), *(Cell(column[i]) for column in columns)] for i, label in enumerate(labels)]
    return Table(texts.EXTREMES_CAPTION, head, rows, numeric=range(1, len(head)))


def difference_table(runs: Mapping[str, StoredRun]) -> Table:
    """Errors of each run against the reference."""
    head = (texts.METHOD, *texts.DIFFERENCE_COLUMNS)
    names = ("angle_error_max", "angle_error_whole", "angle_error_end")
    rows = [[Cell(name_of(name)), *(Cell(number(metric(run, n))) for n in names)] for name, run in runs.items()]
    return without_empty_columns(Table(texts.DIFFERENCE_CAPTION, head, rows, numeric=(1, 2, 3)))


def energy_table(runs: Mapping[str, StoredRun]) -> Table:
    """Each run's energies and how well it keeps them."""
    head = (texts.METHOD, *texts.ENERGY_COLUMNS)
    rows = []
    for name, run in runs.items():
        kinetic = float(run.array("kinetic_energy").max()) if "kinetic_energy" in run else None
        work = float(run.array("work")[-1]) if "work" in run and run.array("work").any() else None
        gain, drift = metric(run, "energy_gain_J"), metric(run, "energy_drift_max")
        rows.append(
            [Cell(name_of(name)), *(Cell(prefixed(x, "J")) for x in (kinetic, work, gain)), Cell(number(drift))]
        )
    return without_empty_columns(Table(texts.ENERGY, head, rows, numeric=(1, 2, 3, 4)))


def path_table(runs: Mapping[str, StoredRun]) -> Table:
    """Length of each tip's path and how far it leaves the plane of rotation (heading -> run)."""
    blades = next(iter(runs.values())).array("tip").shape[1]
    head = [texts.BLADE]
    columns = []
    for heading, run in runs.items():
        tip = run.array("tip")
        lengths = np.linalg.norm(np.diff(tip, axis=0), axis=2).sum(axis=0)
        head += [texts.length_column(heading), texts.OFF_PLANE]
        columns += [[prefixed(x, "m") for x in lengths], [prefixed(x, "m") for x in np.abs(tip[:, :, 1]).max(axis=0)]]
    rows = [[Cell(str(blade + 1)), *(Cell(column[blade]) for column in columns)] for blade in range(blades)]
    return Table(texts.PATHS, head, rows, numeric=range(1, len(head)))
