"""Tables of a scene's runs, from the metrics stored with them and from their samples."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from rotor_mbs.analysis import run_selection
from rotor_mbs.analysis.exact import escape_rate
from rotor_mbs.analysis.rehydrate import scene_of
from rotor_mbs.methods.catalogue import REFERENCE, is_corrected, look_up
from rotor_mbs.report.core.elements import PageTable, Row, TableCell
from rotor_mbs.report.core.looks import label_of
from rotor_mbs.report.core.numbers import number, prefixed, with_unit
from rotor_mbs.runs.read import StoredRun, StoredScene
from rotor_mbs.solution.trajectory import Array

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
        "Tip error to the horizon (m)", "Energy drift (relative)", "Momentum about the shaft (relative)",
        "Joint gap (m)", "Zero pitch", "Steps", "Evaluations", "Set-up", "Run",
    )  # fmt: skip
    rows = [_metrics_row(run) for run in run_selection.in_order(scene).values()]
    return PageTable("", head, rows, numeric=(2, 3, 4, 5, 6, 7, 9, 10, 11, 12)).without_empty_columns()


def _metrics_row(run: StoredRun) -> Row:
    errors = ("angle_error_max", "angle_error_whole", "tip_error_max")
    texts = ["" if run.method == REFERENCE else number(metric(run, name)) for name in errors]
    texts += [
        number(metric(run, name)) for name in ("energy_drift_max", "angular_impulse_error_max", "constraint_error_max")
    ]
    texts.append(_zero_pitch(run))
    counts = [metric(run, name) for name in ("steps", "rhs_evaluations")]
    texts += ["" if count is None else f"{count:.0f}" for count in counts]
    texts += [prefixed(metric(run, name), "s") for name in ("setup_time_s", "run_time_s")]
    return [run_cell(run), status_cell(run), *texts]


def _zero_pitch(run: StoredRun) -> str:
    """Whether pitches that are exactly zero in the reference stayed so, and until when."""
    if "zero_pitch_max" not in run.attributes:
        return ""
    left, rate = metric(run, "zero_pitch_left_s"), metric(run, "zero_pitch_growth_per_s")
    if left is None:
        return "kept"
    return f"left at {with_unit(left, 's', 3)}" + ("" if rate is None else f", growing {with_unit(rate, '/s', 3)}")


def metrics_notes(scene: StoredScene) -> list[str]:
    """What the columns mean, as far as it depends on the runs."""
    notes = []
    if any(run.status == "ok" and not is_corrected(run.method) for run in scene.runs.values()):
        notes.append(
            "The printed equations are not judged against the reference or by their energy: that they depart from both "
            "is the finding. A run of theirs that reaches its end is not thereby correct."
        )
    if any("zero_pitch_max" in run.attributes for run in scene.runs.values()):
        text = "Zero pitch: whether pitches that are exactly zero in the reference stay below 10⁻⁹ rad."
        parsed = scene_of(scene)
        rate = None if parsed is None else escape_rate(parsed)
        if rate is not None:
            text += (
                " A pitch below the shaft is an inverted pendulum: rounding errors grow at up to √(g/c) = "
                f"{with_unit(rate, '/s', 3)}."
            )
        notes.append(text)
    return notes


def failures(scene: StoredScene) -> list[str]:
    """A sentence for every run that is not ok."""
    found = []
    for run in run_selection.in_order(scene).values():
        if run.status != "ok":
            message = str(run.attributes.get("message", ""))
            reached = float(run.array("time")[-1]) if run_selection.has_samples(run) else 0.0
            parts = [f"{label_of(run.method)}: {status_text(run.status)}", *([message] if message else [])]
            found.append(f"{'. '.join(parts)} (samples up to {with_unit(reached, 's', 4)})")
    return found


def range_table(runs: Mapping[str, StoredRun]) -> PageTable:
    """Extremes of each coordinate in each of the runs (heading -> run), where they are known from the integrator's own
    output points, as the published numbers are: a sample need not meet a crest."""
    head = ["Coordinate"]
    columns: list[list[str]] = []
    for heading, run in runs.items():
        if "angles" in run:
            angles = _finest(run, "angles")
            low, high = angles.min(axis=0), angles.max(axis=0)
            head.append(f"{heading}: angle (rad)")
            columns.append([f"{number(a, 4)} to {number(b, 4)}" for a, b in zip(low, high, strict=True)])
        if "rates" in run:
            head.append("largest rate (rad/s)")
            columns.append([number(x, 3) for x in np.abs(_finest(run, "rates")).max(axis=0)])
    labels = next(iter(runs.values())).labels
    rows = [[label, *(column[i] for column in columns)] for i, label in enumerate(labels)]
    return PageTable("Extremes", head, rows, numeric=range(1, len(head)))


def _finest(run: StoredRun, name: str) -> Array:
    refined = f"refined_{name}"
    return run.array(refined if refined in run else name)


def energy_table(runs: Mapping[str, StoredRun]) -> PageTable:
    """Each run's energies and how well it conserves them."""
    head = ("Method", "Largest kinetic energy", "Work at the end", "Largest gain", "Drift (relative)")
    rows = []
    for name, run in runs.items():
        kinetic = float(run.array("kinetic_energy").max()) if "kinetic_energy" in run else None
        work = float(run.array("work")[-1]) if "work" in run and run.array("work").any() else None
        joules = [prefixed(x, "J") for x in (kinetic, work, metric(run, "energy_gain_J"))]
        rows.append([method_cell(name), *joules, number(metric(run, "energy_drift_max"))])
    return PageTable("", head, rows, numeric=(1, 2, 3, 4)).without_empty_columns()


def path_table(runs: Mapping[str, StoredRun]) -> PageTable:
    """Length of each tip's path and how far it leaves the plane of rotation (heading -> run)."""
    head = ["Blade"]
    columns = []
    for heading, run in runs.items():
        tip = run.array("tip")
        lengths = np.linalg.norm(np.diff(tip, axis=0), axis=2).sum(axis=0)
        head += [f"{heading}: length of path", "off the plane"]
        columns += [[prefixed(x, "m") for x in lengths], [prefixed(x, "m") for x in np.abs(tip[:, :, 1]).max(axis=0)]]
    blades = range(len(columns[0]))
    rows = [[str(blade + 1), *(column[blade] for column in columns)] for blade in blades]
    return PageTable("Paths of the tips", head, rows, numeric=range(1, len(head)))


def versions(attributes: Mapping[str, object]) -> list[tuple[str, str]]:
    """(what, version) of the programs and the computer that made a file."""
    return [(name, str(attributes[name])) for name in _VERSIONS if attributes.get(name)]
