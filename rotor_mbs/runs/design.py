"""Define what a results file contains: the requested runs, the tables, and their columns.

Columns that are known before a row is computed have its scene, method, settings and versions; they
are called known columns, or the design. All other columns are called computed: they are filled in
row by row.
"""

from __future__ import annotations

import json
from collections.abc import Collection, Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from rotor_mbs.methods.catalogue import REFERENCE, find_method, method_names
from rotor_mbs.runs.hdf5 import CHARACTERS, Column, TableSpec
from rotor_mbs.runs.versions import row_versions
from rotor_mbs.scenario.catalogue import natural_key
from rotor_mbs.scenario.scene import Scene, scene_hash
from rotor_mbs.solution.metrics import METRICS, RowValue
from rotor_mbs.solution.quantities import DEFECT, LOADS, SCALES, quantities, scale_values
from rotor_mbs.solution.status import STATUSES

MISSING = -1  # status of a row that is not stored
# A run has a row in /runs and a row in the table of its scene's arrays. The second row has copies
# of the columns on the left, under the same names. `TableFile.place` joins both rows into one;
# there the copies have the names on the right.
STATUS_COPIES = {"status": "status_repeated", "samples": "samples_repeated"}
# Type of a column of computed texts. The column has the shape (run, characters): each text is
# UTF-8 bytes, filled up with zeros.
CHARACTER = "S1"
RUNS = "runs"
# Arrays of a frozen reference: angles, rates, and arrays that cannot be derived from angles and
# rates, or only with a loss of precision.
REFERENCE_ARRAYS = (
    "angles",
    "rates",
    "work",
    *(load.name for load in LOADS),
    "angle_uncertainty",
    "error_growth",
)
ONCE_A_SCENE = ("angle_uncertainty", "error_growth")  # arrays that only the reference has


def flags(names: Sequence[str], first: int = 0) -> dict[str, Any]:
    """Return the CF attributes of a column of integer codes, which give the meaning of each code.

    Parameters
    ----------
    names : meanings of consecutive codes.
    first : code of the first name.
    """
    return {
        "flag_values": np.arange(first, first + len(names), dtype=np.int8),
        "flag_meanings": " ".join(names),
    }


# Computed columns before those of the metrics, in the order of the file. Each has the names of the
# tables that store it.
_OUTCOME_VALUES = {
    "status": RowValue(
        "1",
        "outcome of the run, see the status codes; -1: not computed yet",
        "runs bench stability sweep",
        "i1",
    ),
    "message": RowValue(
        "1",
        "reason for a status other than ok and completed",
        "runs bench stability sweep",
        CHARACTER,
    ),
    "samples": RowValue("1", "number of samples stored", "runs bench", "<i8"),
    "time_reached": RowValue(
        "s", "time of the run's last sample; 0 if the run has no sample", "runs sweep"
    ),
    "time_limit_s": RowValue(
        "s", "time limit that stopped the run; NaN if it was not stopped", "runs sweep"
    ),
    "steps": RowValue("1", "number of integration steps; -1: unknown", "runs bench sweep", "<i8"),
    "rhs_evaluations": RowValue(
        "1", "number of evaluations of the right-hand side; -1: unknown", "runs sweep", "<i8"
    ),
    "setup_time_s": RowValue("s", "time to build the model", "runs bench"),
    "setup_again_time_s": RowValue("s", "time to build the model a second time", "bench"),
    "run_time_s": RowValue("s", "median run time of the integration", "runs bench"),
    "run_time_min_s": RowValue("s", "shortest run time of the integration", "runs bench"),
    "run_time_q1_s": RowValue("s", "lower quartile of the run times", "bench"),
    "run_time_q3_s": RowValue("s", "upper quartile of the run times", "bench"),
    "output_time_s": RowValue(
        "s", "time to compute the samples after the integration", "runs bench"
    ),
    "repeats": RowValue("1", "number of timed runs", "runs bench", "<i8"),
    "repeatable": RowValue(
        "1",
        "1 if the first and last run of every point of the curve are bitwise equal",
        "bench",
        "i1",
    ),
    "engine_success": RowValue(
        "1", "1: the engine reported success, 0: failure; -1: no report", kind="i1"
    ),
    "engine_message": RowValue("1", "message of the engine", kind=CHARACTER),
    "false_success": RowValue(
        "1",
        "1 if the engine reported success although the samples are wrong",
        "runs bench stability",
        "i1",
    ),
    "left_out": RowValue(
        "1", "1 if the point was omitted because of the time budget", "bench", "i1"
    ),
    "load_before": RowValue("1", "load average of the machine before the timing", "bench"),
    "pinned_core": RowValue("1", "number of the core used for timing; -1: any", "bench", "<i8"),
    "order": RowValue(
        "1", "order of convergence of the curve, fitted above its round-off floor", "bench"
    ),
    "step_for_target_s": RowValue(
        "s", "largest step of the ladder with an error of at most 1e-6 rad", "stability"
    ),
}
# Computed columns after those of the metrics. The checksum is the last.
_CHECKSUM_VALUES = {
    "code": RowValue(
        "1",
        "CRC-32 of the versions (package, code, libraries of the method) that computed the run",
        "sweep",
        "<u4",
    ),
    "crc32": RowValue(
        "1",
        "CRC-32 over the computed columns of the row; the known columns are not covered",
        "bench stability sweep",
        "<u4",
    ),
}
_ROW_VALUES = _OUTCOME_VALUES | METRICS | _CHECKSUM_VALUES


def _column(value: RowValue) -> Column:
    dimensions = ("run", CHARACTERS) if value.kind == CHARACTER else ("run",)
    return Column(dimensions, value.units, value.long_name, value.kind)


# Computed columns with one value per row, by name. `metric_columns` adds those of quantities.
COLUMNS = {name: _column(value) for name, value in _ROW_VALUES.items()}
COLUMNS["status"] = COLUMNS["status"]._replace(attributes=flags(("missing", *STATUSES), MISSING))


def columns_in(table: str) -> dict[str, Column]:
    """Return the columns in COLUMNS that a table has, by name.

    Parameters
    ----------
    table : name of the table, as in `RowValue.tables`.
    """
    columns = {}
    for name, value in _ROW_VALUES.items():
        if table in value.tables.split():
            columns[name] = COLUMNS[name]
    return columns


# Units and long name of each known column of runs and points, in the order of the file. Values with
# other names are not stored.
DESIGN_COLUMNS = {
    "scene": ("1", "name of the scene"),
    "method_name": ("1", "name of the method: model/integrator"),
    "curve": ("1", "method, and the settings that are constant along it"),
    "setting_kind": ("1", "setting that varies along the curve: step or tolerance"),
    "settings": ("1", "settings of the method, JSON"),
    "options": ("1", "options of the command, JSON"),
    "versions": ("1", "versions of package, libraries and code that computed the row, JSON"),
    "scene_hash": ("1", "SHA-256 of the numbers of the scene"),
    "step": ("s", "time step"),
    "tolerance": ("1", "tolerance of the method"),
    "order_expected": ("1", "order of the method"),
}
NUMBERS = ("step", "tolerance", "order_expected")  # known columns of numbers; the rest have texts

_TEXT_LENGTH = 600  # bytes of a computed text in /runs, such as a message
# Computed columns of the tables of points, by table.
POINT_COLUMNS: Mapping[str, Mapping[str, Column]] = {
    table: columns_in(table) for table in ("bench", "stability")
}


@dataclass(frozen=True)
class RunRequest:
    """A requested run: a row of the design.

    Attributes
    ----------
    scene : the scene.
    method : name of the method.
    settings : settings that are given for the method, by name.
    versions : versions of the software that computes the run; None for those of this installation.
        A reference that is read from a shipped file also has `frozen_with`, the versions of the
        software that computed it.
    """

    scene: Scene
    method: str
    settings: Mapping[str, object] = field(default_factory=dict)
    versions: Mapping[str, str] | None = None

    @property
    def is_shipped(self) -> bool:
        """Return whether the run is a reference that is read from a shipped file."""
        return self.versions is not None and "frozen_with" in self.versions

    @property
    def label(self) -> str:
        """Return the label of the run's row, such as "paper/fig11/lagrange/taylor"."""
        return f"{self.scene.name}/{self.method}"

    @property
    def reference_label(self) -> str:
        """Return the label of the row of the scene's reference."""
        return f"{self.scene.name}/{REFERENCE}"

    @property
    def known(self) -> dict[str, str]:
        """Return the values of the known columns of the run's row in /runs, by name."""
        method = find_method(self.method)
        settings = method.chosen(self.scene, self.settings).as_dict()
        return {
            "scene": self.scene.name,
            "method_name": self.method,
            "settings": json.dumps(settings, sort_keys=True),
            "versions": json.dumps(dict(self.versions or row_versions(method)), sort_keys=True),
            "scene_hash": scene_hash(self.scene),
        }


def metric_columns(outputs: Iterable[str]) -> dict[str, Column]:
    """Return the computed columns of /runs, by name.

    Parameters
    ----------
    outputs : names of the outputs of all scenes in the file.
    """
    columns = columns_in(RUNS)
    for quantity in quantities(outputs):
        name, long_name = quantity.name, quantity.long_name
        judgement = quantity.judgement
        if judgement is not None:
            unit, error = quantity.units, "largest error"
            if judgement.scale_of:
                unit, error = "1", "largest relative error"
            text = f"{long_name} over the run"
            if judgement.with_reference:
                text = f"{long_name}: {error}"
            columns[judgement.metric] = Column(("run",), unit, text)
        if quantity.has_peak:
            columns[f"{name}_max"] = Column(("run",), quantity.units, f"{long_name}: maximum")
            columns[f"{name}_max_time_s"] = Column(
                ("run",), "s", f"{long_name}: time of the maximum"
            )
            if quantity.dimensions[1:2] == ("blade",):
                columns[f"{name}_max_blade"] = Column(
                    ("run",), "1", f"{long_name}: blade of the maximum, from 1"
                )
    return columns | {"crc32": COLUMNS["crc32"]}


def arrays_of(run: RunRequest) -> dict[str, Column]:
    """Return the columns of the arrays over time that a run stores, by name.

    Parameters
    ----------
    run : the request. Its method, and the outputs that its scene requests, decide which arrays are
        stored.
    """
    method = find_method(run.method)
    outputs = run.scene.outputs
    if run.method == REFERENCE:
        # Angles and rates of a reference are always stored, as it is rebuilt from them when it is
        # read.
        outputs = (*outputs, "angles", "rates")
    columns = {}
    for quantity in quantities(outputs):
        is_computed = quantity.required or quantity.name in method.arrays
        if quantity.name == DEFECT:
            is_computed = {"angles", "rates"} <= {*outputs}
        if not is_computed:
            continue
        is_once = quantity.name in ONCE_A_SCENE
        if is_once and run.method != REFERENCE:
            continue
        dimensions = quantity.dimensions if is_once else ("run", *quantity.dimensions)
        columns[quantity.name] = Column(dimensions, quantity.units, quantity.long_name)
    return columns


def known_columns(rows: Sequence[Mapping[str, object]]) -> dict[str, tuple[Column, Any]]:
    """Return the known columns of a table and their values, by name.

    Parameters
    ----------
    rows : for each row its texts and numbers by name; all rows have the same names.
    """
    columns: dict[str, tuple[Column, Any]] = {}
    for name, (units, long_name) in DESIGN_COLUMNS.items():
        if rows and name in rows[0]:
            values: Any = [row[name] for row in rows]
            if not isinstance(values[0], str):
                values = np.array(values, float)
            columns[name] = Column(("run",), units, long_name), values
    return columns


def scene_scales(scene: Scene, columns: Iterable[Column]) -> dict[str, tuple[Column, Any]]:
    """Return the dimension scales (time, coordinate, ...) of the table of a scene's arrays.

    They are stored among the known columns of the table.

    Parameters
    ----------
    scene : the scene.
    columns : columns of the table. The scales of their dimensions are returned, and always that of
        time.
    """
    used = {"time"}.union(*(column.dimensions for column in columns))
    values = scale_values(scene)
    attributes: dict[str, Any] = {
        "time": {"standard_name": "time"},
        "coordinate": {"labels": scene.coordinate_labels},
    }
    scales = {}
    for name, scale in SCALES.items():
        if name in used:
            described = attributes.get(name, {})
            column = Column((name,), scale.units, scale.long_name, attributes=described)
            scales[name] = column, values[name]
    return scales


def runs_table(requests: Sequence[RunRequest]) -> TableSpec:
    """Return the table /runs of a file that has the requested runs."""
    outputs = dict.fromkeys(output for run in requests for output in run.scene.outputs)
    known = known_columns([run.known for run in requests])
    return TableSpec(
        RUNS,
        [run.label for run in requests],
        known,
        metric_columns(outputs),
        characters=_TEXT_LENGTH,
    )


def scene_table(runs: Sequence[RunRequest], arrays: Collection[str] | None = None) -> TableSpec:
    """Return the table of the arrays of one scene's runs.

    Parameters
    ----------
    runs : requests, all for the same scene.
    arrays : names of the arrays that are stored, by default all that the runs have.
    """
    scene = runs[0].scene
    computed = {}
    for run in runs:
        for name, column in arrays_of(run).items():
            if arrays is None or name in arrays:
                computed[name] = column
    attributes = {
        "title": scene.title,
        "figures": ", ".join(scene.figures),
        "blades": len(scene.blades),
        "scene_toml": scene.text,
        "scene_hash": scene_hash(scene),
        "NX_class": "NXdata",
        "signal": "angles",
        "axes": ["run", "time", "coordinate"],
    }
    scales = scene_scales(scene, computed.values())
    repeated = {name: COLUMNS[name] for name in STATUS_COPIES}
    return TableSpec(
        scene.name, [run.method for run in runs], scales, repeated | computed, attributes
    )


def results_tables(requests: Sequence[RunRequest]) -> list[TableSpec]:
    """Return all tables of a file that has the requested runs: /runs, then a table per scene."""
    requests = sorted(requests, key=lambda run: row_order(run.label))
    by_scene: dict[str, list[RunRequest]] = {}
    for run in requests:
        by_scene.setdefault(run.scene.name, []).append(run)
    return [
        runs_table(requests),
        *(scene_table(runs) for runs in by_scene.values()),
    ]


def row_order(run: str) -> tuple[Any, ...]:
    """Return the key by which runs are sorted, from the label of a run.

    Scenes are in natural order. In each scene the reference comes first, and the methods follow in
    the order of the catalogue.
    """
    parts = run.split("/")
    # The name of a method is model/integrator; that of the reference has no model.
    count = 1 if parts[-1] == REFERENCE else 2
    scene, method = "/".join(parts[:-count]), "/".join(parts[-count:])
    names = [REFERENCE, *method_names()]
    return natural_key(scene), names.index(method) if method in names else len(names), method
