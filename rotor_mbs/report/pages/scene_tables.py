"""Cells and tables of stored runs that several pages have, from the metrics stored with the runs."""

from __future__ import annotations

from collections.abc import Mapping

from rotor_mbs.analysis import run_selection
from rotor_mbs.methods.catalogue import REFERENCE, is_corrected, look_up
from rotor_mbs.report.core.elements import PageTable, Row, TableCell
from rotor_mbs.report.core.looks import label_of
from rotor_mbs.report.core.numbers import number, prefixed, with_unit
from rotor_mbs.runs.read import StoredRun, StoredScene

# Attributes of a results file that say what made it.
_VERSIONS = ("rotor_mbs", "python", "exudyn", "heyoka", "numpy", "scipy", "h5py", "platform", "cpu", "created")


def status_text(status: str) -> str:
    """A stored status as text: "solver failed" of "solver_failed"."""
    return status.replace("_", " ")


def status_cell(run: StoredRun) -> TableCell | str:
    """The status; "runs to the end" of an "ok" run of equations that are not claimed to be correct."""
    if run.status == "ok":
        return TableCell("ok", tone="good") if is_corrected(run.method) else "runs to the end"
    return TableCell(status_text(run.status), tone="bad")


def method_cell(name: str) -> TableCell | str:
    """A method's label, and below it the name that the command line and the file have."""
    label = label_of(name)
    return label if label == name else TableCell(label, note=name)


def run_cell(run: StoredRun) -> TableCell | str:
    """A run's method, and below it the settings that are not the method's defaults."""
    method = look_up(run.method)
    defaults = {} if method is None else method.defaults
    own = [f"{name} = {value}" for name, value in run.settings.items() if defaults.get(name, value) != value]
    note = ", ".join([run.method, *own])
    return TableCell(label_of(run.method), note=note) if own else method_cell(run.method)


def metric(run: StoredRun, name: str) -> float | None:
    """A number stored with the run; None where it has none."""
    value = run.attributes.get(name)
    return float(value) if isinstance(value, float | int) else None


def horizon(scene: StoredScene) -> float | None:
    """s; None where no run was compared with a reference."""
    known = [metric(run, "horizon_s") for run in scene.runs.values()]
    return next((value for value in known if value is not None), None)


def metrics_table(scene: StoredScene) -> PageTable:
    """Every run of the scene."""
    head = (
        "Method", "Status", "Angle error to the horizon (rad)", "Angle error, whole run (rad)",
        "Tip error to the horizon (m)", "Energy drift (relative)", "Angular momentum about the shaft, error (relative)",
        "Joint gap (m)", "Zero pitch", "Steps", "Evaluations", "Set-up", "Run",
    )  # fmt: skip
    rows: list[Row] = []
    for run in run_selection.in_order(scene).values():
        row = [run_cell(run), status_cell(run)]
        for name in ("angle_error_max", "angle_error_whole", "tip_error_max"):
            row.append("" if run.method == REFERENCE else number(metric(run, name)))
        for name in ("energy_drift_max", "angular_impulse_error_max", "constraint_error_max"):
            row.append(number(metric(run, name)))
        row.append(_zero_pitch(run))
        for name in ("steps", "rhs_evaluations"):
            count = metric(run, name)
            row.append("" if count is None else f"{count:.0f}")
        for name in ("setup_time_s", "run_time_s"):
            row.append(prefixed(metric(run, name), "s"))
        rows.append(row)
    return PageTable("", head, rows, numeric=(2, 3, 4, 5, 6, 7, 9, 10, 11, 12)).without_empty_columns()


def _zero_pitch(run: StoredRun) -> str:
    """Whether pitches that are exactly zero in the reference stayed so, and until when."""
    if "zero_pitch_max" not in run.attributes:
        return ""
    left, rate = metric(run, "zero_pitch_left_s"), metric(run, "zero_pitch_growth_per_s")
    if left is None:
        return "kept"
    text = f"left at {with_unit(left, 's', 3)}"
    return text if rate is None else f"{text}, growing {with_unit(rate, '/s', 3)}"


def failure_table(scene: StoredScene) -> PageTable:
    """The runs that are not ok."""
    rows = []
    for run in run_selection.in_order(scene).values():
        if run.status != "ok":
            reached = float(run.array("time")[-1]) if run_selection.has_samples(run) else 0.0
            message = str(run.attributes.get("message", ""))
            rows.append([run_cell(run), status_cell(run), message, with_unit(reached, "s", 4)])
    return PageTable("", ("Method", "Status", "Message", "Samples up to"), rows, numeric=(3,))


def versions(attributes: Mapping[str, object]) -> list[tuple[str, str]]:
    """(what, version) of the programs and the computer that made a file."""
    return [(name, str(attributes[name])) for name in _VERSIONS if attributes.get(name)]
