"""Cells and tables of stored runs that several pages have, from the metrics stored with the runs."""

from __future__ import annotations

from collections.abc import Mapping

from rotor_mbs.analysis import run_selection
from rotor_mbs.methods.catalogue import REFERENCE, look_up
from rotor_mbs.report.core.elements import PageTable, Row, TableCell
from rotor_mbs.report.core.looks import label_of
from rotor_mbs.report.core.numbers import number, prefixed, with_unit
from rotor_mbs.runs.read import StoredRun, StoredScene
from rotor_mbs.solution.status import GOOD

_ERRORS_OF_RUNS = ("angle_error_max", "angle_error_whole", "tip_error_max")  # against the reference
# Attributes of a results file that say what made it.
_VERSIONS = ("rotor_mbs", "python", "exudyn", "heyoka", "numpy", "scipy", "h5py", "platform", "cpu", "created")


def status_text(status: str) -> str:
    """A stored status as text: "solver failed" of "solver_failed"."""
    return status.replace("_", " ")


def status_cell(run: StoredRun) -> TableCell | str:
    """The status; nothing good or bad is said of a completed run, of which nothing is claimed."""
    if run.status in GOOD:
        return TableCell("ok", tone="good") if run.status == "ok" else run.status
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
    head = {
        "angle_error_max": "Angle error to the horizon (rad)",
        "angle_error_whole": "Angle error, whole run (rad)",
        "tip_error_max": "Tip error to the horizon (m)",
        "energy_drift_max": "Energy drift (relative)",
        "angular_impulse_error_max": "Angular momentum about the shaft, error (relative)",
        "constraint_error_max": "Joint gap (m)",
    }
    rows: list[Row] = []
    for run in run_selection.in_order(scene).values():
        row = [run_cell(run), status_cell(run)]
        for name in head:
            is_own_error = run.method == REFERENCE and name in _ERRORS_OF_RUNS
            row.append("" if is_own_error else number(metric(run, name)))
        # Whether pitches that are exactly zero in the reference stayed so, and until when.
        left, rate = metric(run, "zero_pitch_left_s"), metric(run, "zero_pitch_growth_per_s")
        if "zero_pitch_max" not in run.attributes:
            row.append("")
        elif left is None:
            row.append("kept")
        else:
            growing = "" if rate is None else f", growing {with_unit(rate, '/s', 3)}"
            row.append(f"left at {with_unit(left, 's', 3)}{growing}")
        for name in ("steps", "rhs_evaluations"):
            count = metric(run, name)
            row.append("" if count is None else f"{count:.0f}")
        row += [prefixed(metric(run, name), "s") for name in ("setup_time_s", "run_time_s")]
        rows.append(row)
    columns = ("Method", "Status", *head.values(), "Zero pitch", "Steps", "Evaluations", "Set-up", "Run")
    return PageTable("", columns, rows, numeric=(2, 3, 4, 5, 6, 7, 9, 10, 11, 12)).without_empty_columns()


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
