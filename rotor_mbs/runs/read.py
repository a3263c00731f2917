"""Results files read back: scenes and runs by name, rows when they are asked for; of a run also
what was stored, its Solution, so that it can be judged again. Needs no engine.

What studies store beside runs are records: tables of points, and groups of arrays with dimensions
of their own.

/bench                          a row per point of a curve: a method at one setting on a scene
/stability                      a row per step of a ladder: a fixed-step method on a scene
/modes/<scene>/<model>/<kind>   modes over speed, in a file of modes
/comparison/<scene>/data/trajectory   data of another program and the reference at their times;
modes: over speed
"""

from __future__ import annotations

import functools
import math
import os
from collections.abc import Collection, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, field
from pathlib import Path
from typing import IO, Any

import numpy as np
from numpy.typing import NDArray

from rotor_mbs.errors import StoreError
from rotor_mbs.methods.catalogue import PRINTED, REFERENCE, is_built_in, is_corrected
from rotor_mbs.runs.arrays import chosen_group
from rotor_mbs.runs.design import (
    MISSING,
    NUMBERS,
    POINT_COLUMNS,
    REFERENCE_ARRAYS,
    RUNS,
    STATUS_COPIES,
    TableSpec,
    known_columns,
)
from rotor_mbs.runs.hdf5 import ATTEMPTS, Column, StoredGroup, read_content, reading
from rotor_mbs.runs.layout import new_file, new_group, put, put_attributes
from rotor_mbs.runs.output_files import locked
from rotor_mbs.runs.rows import RowLocation, Rows, checksums, text_of
from rotor_mbs.runs.table import StoredTable, TableFile, opened_tables, parsed
from rotor_mbs.runs.trailer import MODES, SWEEP, may_extend, read_trailer
from rotor_mbs.runs.versions import machine, versions
from rotor_mbs.scenario.catalogue import (
    label_with_changes,
    moves_as_shipped,
    natural_order,
    shipped_scene,
)
from rotor_mbs.scenario.scene import (
    Scene,
    SceneChange,
    coordinate_labels,
    parse_scene,
    scene_changes,
)
from rotor_mbs.solution.quantities import known_quantities, quantities, row_shape
from rotor_mbs.solution.status import STATUSES, code_of
from rotor_mbs.solution.trajectory import Integration, Solution, Trajectory

_TEXTS = ("message", "engine_message")


@dataclass(frozen=True, eq=False)
class StoredRun:
    """A run, or the reference, or a run of a sweep, in a file; its row is read, and verified, when
    something of it is asked for.

    Attributes
    ----------
    scene, method : names.
    known : what the design says of it: settings, versions, ...
    scales : time, coordinate, blade, axis, as far as there are.
    """

    scene: str
    method: str
    known: Mapping[str, Any]
    scales: Mapping[str, NDArray[Any]]
    _place: RowLocation
    _file: IO[bytes] | None = None
    _verify: bool = True

    @functools.cached_property
    def _stored(self) -> Rows:
        """Return the columns of its row as they are in the file."""
        with reading(self._name):
            return self._place.read(file=self._file)

    @functools.cached_property
    def is_damaged(self) -> bool:
        """Return whether its row is not what was written."""
        row = self._stored
        return bool((checksums(self._place.first, row, self._place.row_type) != row["crc32"]).any())

    @functools.cached_property
    def _row(self) -> Rows:
        """Return the columns of its row. Raises StoreError where they are not what was written."""
        if self._verify and self.is_damaged:
            raise StoreError(f"{self._name} changed after it was written")
        return {name: values[0] for name, values in self._stored.items()}

    @property
    def _name(self) -> str:
        return f"{self._place.path}: {self.scene}/{self.method}"

    @functools.cached_property
    def attributes(self) -> dict[str, Any]:
        """Return status, message, metrics, times ... as plain values; those that the run does not
        have are left out."""
        facts: dict[str, Any] = {"status": self.status, "settings": self.known["settings"]}
        facts |= {name: text_of(self._row[name]) for name in _TEXTS if name in self._row}
        for name, value in self._row.items():
            if name in ("status", "crc32", *STATUS_COPIES.values(), *_TEXTS) or np.ndim(value):
                continue
            number = value.item()
            if (isinstance(number, int) and number >= 0) or (
                isinstance(number, float) and number == number
            ):
                facts[name] = number
        return facts

    @property
    def is_frozen(self) -> bool:
        """Return whether it is a reference that was read from a shipped file."""
        return "frozen_with" in parsed(self.known.get("versions", "{}"), dict, self._name)

    @property
    def status(self) -> str:
        code = int(self._row["status"])
        return STATUSES[code] if 0 <= code < len(STATUSES) else ""

    @property
    def settings(self) -> dict[str, Any]:
        return parsed(self.known["settings"], dict, self._name)

    @property
    def labels(self) -> list[str]:
        """Return the names of the coordinates: rotor, pitch 1, ...; none where neither angles nor
        rates are stored."""
        is_known = "angles" in self or "rates" in self
        return list(coordinate_labels(len(self.scales["coordinate"]) - 1)) if is_known else []

    @functools.cached_property
    def samples(self) -> int:
        """Return the number of samples up to which the run came."""
        if not self._is_of_sweep:
            return int(self._row["samples"])
        # Its arrays are NaN after a run broke off.
        arrays = [
            values
            for values in self._own_arrays.values()
            if len(values) == len(self.scales["time"])
        ]
        is_there = [np.isfinite(values.reshape(len(values), -1)).all(axis=1) for values in arrays]
        return int(np.all(is_there, axis=0).sum()) if is_there else 0

    @property
    def _is_of_sweep(self) -> bool:
        """Return whether it is a run of a sweep, in which samples are not counted."""
        return "samples" not in self._row

    @property
    def _own_arrays(self) -> dict[str, NDArray[Any]]:
        """Return its arrays by name, with the rows after its end."""
        return {
            name: values
            for name, values in self._row.items()
            if np.ndim(values) and name not in _TEXTS
        }

    @functools.cached_property
    def _arrays(self) -> dict[str, NDArray[Any]]:
        """Return its arrays by name, scales included. One that its method or its scene's outputs do
        not have is NaN in all samples, and left out."""
        count = self.samples
        scales = {
            name: values[:count] if name == "time" else values
            for name, values in self.scales.items()
        }
        own = {name: values[:count] for name, values in self._own_arrays.items()}
        return scales | {
            name: values for name, values in own.items() if count == 0 or not np.isnan(values).all()
        }

    @property
    def names(self) -> list[str]:
        """Return the names of its arrays, scales included."""
        return list(self._arrays)

    def __contains__(self, name: str) -> bool:
        return name in self._arrays

    def array(self, name: str) -> NDArray[Any]:
        """Return an array or a scale, (samples, ...). Raises StoreError where the run has none of
        that name."""
        if name not in self:
            raise StoreError(f"{self._name} has no {name}")
        return self._arrays[name]

    def get(self, name: str) -> NDArray[Any] | None:
        return self._arrays.get(name)

    def faults(self, scene: Scene, *, complete: bool = True) -> list[str]:
        """Return a line for every array that is missing or wrong; complete: every sample must be
        there, else as many as there are times. A frozen reference need not have what follows from
        its angles and rates, a method that is not built in no more than these."""
        faults = []
        rows = len(self.array("time")) if "time" in self else scene.samples
        if complete and rows != scene.samples:
            faults.append(f"{rows} of {scene.samples} samples" if rows else "no samples")
        always_there = REFERENCE_ARRAYS if self.is_frozen else ("angles", "rates")
        may_omit_others = self.is_frozen or not is_built_in(self.method)
        expected: dict[str, tuple[int, ...]] = {"time": (rows,)}
        for quantity in quantities(scene.outputs):
            if self._is_of_sweep and quantity.name not in self._row:  # which has outputs of its own
                continue
            if may_omit_others and quantity.name not in (*always_there, *self.names):
                continue
            if quantity.required or (
                quantity.name == "angle_uncertainty" and self.method == REFERENCE
            ):
                expected[quantity.name] = (rows, *row_shape(quantity, scene))
        for name, shape in expected.items():
            if name not in self:
                faults.append(f"{name} is missing")
                continue
            values = self.array(name)
            if values.dtype.kind != "f" or values.shape[1:] != shape[1:]:
                faults.append(
                    f"{name} has shape {values.shape} of {values.dtype}, not {shape} of numbers"
                )
            elif len(values) != shape[0]:
                faults.append(f"{name} has {len(values)} rows, not {shape[0]}")
            elif not np.isfinite(values).all():
                faults.append(
                    f"{name} is not finite at sample {int(np.argwhere(~np.isfinite(values))[0][0])}"
                )
        return faults

    def trajectory(self, scene: Scene) -> Trajectory | None:
        """Return its samples; None where its arrays cannot be used. Angles and rates that are not
        stored are NaN."""
        if self.faults(scene, complete=False):
            return None
        time = self.array("time")
        blank = np.full((len(time), 1 + len(scene.blades)), np.nan)
        names = {quantity.name for quantity in known_quantities(scene.outputs)}
        arrays = {name: np.asarray(self.array(name), float) for name in names if name in self}
        return Trajectory(**{"time": time, "angles": blank, "rates": blank, **arrays})

    def solution(self, scene: Scene) -> Solution | None:
        """Return the run with what was stored of it; None where its arrays cannot be used."""
        trajectory, facts = self.trajectory(scene), self.attributes
        if trajectory is None:
            return None
        # A frozen reference has no report of its engine, and of a sweep's runs none is stored.
        is_reported = "engine_success" in self._row
        success = self.is_frozen if is_reported else self.status == "ok"
        success = bool(facts.get("engine_success", success))
        integration = Integration(
            success,
            str(facts.get("engine_message" if is_reported else "message", "")),
            facts.get("time_reached", 0.0),
            facts.get("steps"),
            facts.get("rhs_evaluations"),
            out_of_time=self.status == "timed_out" and not success,
        )
        return Solution(
            scene,
            self.method,
            trajectory,
            integration,
            self.settings,
            setup_time_s=facts.get("setup_time_s", math.nan),
            run_times_s=[facts["run_time_s"]] if "run_time_s" in facts else [],
            output_time_s=facts.get("output_time_s", math.nan),
            status=self.status,
            message=str(facts.get("message", "")),
            metrics={name: value for name, value in facts.items() if isinstance(value, float)},
        )


@dataclass(frozen=True)
class StoredScene:
    """A scene in an open file: name, attributes (title, figures, blades, scene_toml, scene_hash)
    and its runs, the reference first, then methods in the order of the catalogue."""

    name: str
    attributes: dict[str, Any]
    runs: dict[str, StoredRun]

    @functools.cached_property
    def scene(self) -> Scene:
        """Return the scene that its text describes. Raises InputError where its text is no
        scene."""
        return parse_scene(str(self.attributes["scene_toml"]), self.name)

    @functools.cached_property
    def reference_trajectory(self) -> Trajectory | None:
        """Return the samples of the reference; None where there is none, or its arrays cannot be
        used."""
        return None if self.reference is None else self.reference.trajectory(self.scene)

    @functools.cached_property
    def changes(self) -> list[SceneChange] | None:
        """Return what differs from this package's scene of its name; None where there is none."""
        known = shipped_scene(self.name)
        return None if known is None else scene_changes(known, self.scene)

    @property
    def label(self) -> str:
        """Return its name, with what was changed in a scene of this package."""
        return label_with_changes(self.name, self.changes or ())

    @property
    def is_shipped(self) -> bool:
        """Return whether its motion is that of this package's scene of its name; samples and
        outputs may be others."""
        return moves_as_shipped(self.changes)

    @property
    def figures(self) -> str:
        """Return the paper's figures that show its motion, as "11, 13a"; "" where none does."""
        return str(self.attributes.get("figures", "")) if self.is_shipped else ""

    @property
    def title(self) -> str:
        return str(self.attributes["title"])

    @property
    def reference(self) -> StoredRun | None:
        return self.runs.get(REFERENCE)

    @property
    def methods(self) -> dict[str, StoredRun]:
        """Return the runs but the reference, in the order of the file."""
        return {name: run for name, run in self.runs.items() if name != REFERENCE}

    @property
    def printed(self) -> StoredRun | None:
        """Return the run of the printed equations with all their errata, where it has samples."""
        run = self.runs.get(PRINTED)
        return run if run is not None and run.samples else None

    @property
    def corrected_runs(self) -> dict[str, StoredRun]:
        """Return the runs of the corrected models but the reference; those without samples too."""
        return {name: run for name, run in self.methods.items() if is_corrected(name)}

    @property
    def corrected(self) -> StoredRun | None:
        """Return the reference, else the first run of a corrected model that has samples; None
        without either."""
        candidates = [self.reference, *self.corrected_runs.values()]
        return next((run for run in candidates if run is not None and run.samples), None)

    @property
    def sides(self) -> dict[str, StoredRun]:
        """Return the "printed" run and the one that stands for the "corrected" model, those that
        there are."""
        sides = {"printed": self.printed, "corrected": self.corrected}
        return {side: run for side, run in sides.items() if run is not None}


@dataclass(frozen=True)
class OpenResults:
    """An open results file: its attributes (versions, platform, created) and its scenes by name, in
    natural order."""

    path: Path
    attributes: dict[str, Any]
    scenes: dict[str, StoredScene]


@contextmanager
def open_results(
    path: Path, *, verify: bool = True, only: Collection[str] | None = None
) -> Iterator[OpenResults]:
    """Open a results file; of a file that replaces it meanwhile nothing is seen. A run is compared
    with its checksum when it is read, but for verify=False; only: names of scenes, by default all.
    Raises StoreError, also for whatever goes wrong in the block with what the file holds."""
    for _ in range(ATTEMPTS):
        stored = opened_tables(path, None if only is None else {RUNS, *only})
        with path.open("rb") as file:
            inode = os.fstat(file.fileno()).st_ino
            if any(table.inode != inode for table in stored.tables.values()):
                continue
            with reading(path):  # what is made of it, too: rows are read when they are asked for
                scenes = {scene.name: scene for scene in _scenes(stored, file, verify, only)}
                yield OpenResults(
                    path, stored.attributes, {name: scenes[name] for name in natural_order(scenes)}
                )
            return
    raise StoreError(f"{path}: is being replaced by another process")


def run_names(path: Path) -> list[tuple[str, str]]:
    """Return scene and method of every stored run, in the order of `open_results`. Raises
    StoreError."""
    stored = opened_tables(path, {RUNS})
    if RUNS not in stored.tables:
        return []
    runs = stored.tables[RUNS]
    methods: dict[str, list[str]] = {}
    with reading(path):
        for status, row in zip(
            runs.column("status").tolist(), runs.known_rows.values(), strict=True
        ):
            if status != MISSING:
                methods.setdefault(str(row["scene"]), []).append(str(row["method_name"]))
    return [(scene, method) for scene in natural_order(methods) for method in methods[scene]]


def run_arrays(path: Path, group: str = "", scene: str = "") -> dict[str, NDArray[Any]]:
    """Return the arrays of one run of a results file; group, scene: as for `read_arrays`, the run
    "scene/method"."""
    with open_results(path) as results:
        runs = {
            f"{name}/{run.method}": run
            for name, known in results.scenes.items()
            for run in known.runs.values()
        }
        run = runs[chosen_group(path, list(runs), group, scene)]
        return {name: run.array(name) for name in run.names if run.array(name).ndim <= 3}


def is_sweep(path: Path) -> bool:
    """Return whether a file of this program is the dataset of a sweep. Raises StoreError where it
    cannot be read."""
    return read_trailer(path).kind == SWEEP


def _scenes(
    stored: TableFile, file: IO[bytes], verify: bool, only: Collection[str] | None
) -> Iterator[StoredScene]:
    """Yield the scenes of an open file with their runs."""
    if RUNS not in stored.tables:
        return
    runs = stored.tables[RUNS]
    file.seek(runs.offsets["status"])
    statuses = np.frombuffer(file.read(len(runs.runs)), np.int8)
    by_scene: dict[str, dict[str, StoredRun]] = {}
    for status, (run, known) in zip(statuses, runs.known_rows.items(), strict=True):
        scene, method = str(known["scene"]), str(known["method_name"])
        if status == MISSING or (only is not None and scene not in only):
            continue
        scales = {name: values for name, (_, values) in stored.tables[scene].known.items()}
        stored_run = StoredRun(scene, method, known, scales, stored.place(run), file, verify)
        by_scene.setdefault(scene, {})[method] = stored_run
    for scene, methods in by_scene.items():
        yield StoredScene(scene, dict(stored.tables[scene].attributes), methods)


_MESSAGE_LENGTH = 300


@dataclass(frozen=True)
class Record:
    """A curve of a bench, a ladder of steps, or another group of arrays that belong together.

    kind: a key of `POINT_COLUMNS`, "modes" or "comparison". name: the method, "lagrange/taylor"; of
    a bench with its fixed choices behind, where they are not the default ones. arrays: (rows,) by
    name; `status` as codes of `solution.status.STATUSES`. columns: what the arrays are, scales
    first; of groups of arrays alone.
    """

    kind: str
    scene: str
    name: str
    attributes: Mapping[str, Any] = field(default_factory=dict)
    arrays: Mapping[str, NDArray[Any]] = field(default_factory=dict)
    columns: Mapping[str, Column] = field(default_factory=dict)

    @property
    def method(self) -> str:
        return str(self.attributes.get("method", self.name))

    @property
    def statuses(self) -> list[str]:
        return [STATUSES[int(code)] for code in self.arrays["status"]]

    @property
    def messages(self) -> list[str]:
        """Return a message for each row."""
        return [
            str(text) for text in self.attributes.get("messages", [""] * len(self.arrays["status"]))
        ]


# Tables of points


def points_table(group: str, points: Sequence[Mapping[str, object]]) -> TableSpec:
    """Return the table `group` of these points, each with its known columns by name."""
    runs = [str(point["run"]) for point in points]
    return TableSpec(
        group, runs, known_columns(points), POINT_COLUMNS[group], characters=_MESSAGE_LENGTH
    )


def read_records(path: Path, kind: str) -> list[Record]:
    """Read the records of a kind, in the order of the file; no curve of which a point is missing.
    Raises StoreError."""
    if kind in POINT_COLUMNS:
        tables = TableFile(path, [kind]).tables.values()
        with reading(path):
            return [record for table in tables for record in _point_records(table)]
    with reading(path):
        return [_record(name, group) for name, group in read_content(path, [kind]).groups.items()]


def _point_records(stored: StoredTable) -> Iterator[Record]:
    """Yield the rows of a table that belong to one curve or one ladder."""
    kind, statuses, rows = stored.group, stored.statuses(), list(stored.known_rows.values())
    columns = stored.place().read(len(stored.runs)) | {
        name: stored.column(name) for name in NUMBERS if name in stored.known
    }
    owners = [(row["scene"], row.get("curve", row["method_name"])) for row in rows]
    for scene, name in dict.fromkeys(owners):
        own = [i for i, owner in enumerate(owners) if owner == (scene, name)]
        if (statuses[own] == MISSING).any():
            continue
        known = rows[own[0]]
        arrays = {column: values[own] for column, values in columns.items()}
        setting_kind = str(known.get("setting_kind", "step"))
        arrays["setting"] = arrays[setting_kind]
        facts: dict[str, Any] = {
            column: value
            for column, values in arrays.items()
            if column not in ("status", "message", "setting")
            and (value := values[0].item()) == value
        }
        messages = [text_of(text) for text in arrays.pop("message")]
        if kind == "stability":  # without steps that were not needed
            used = arrays["status"] != code_of("left_out")
            arrays = {column: array[used] for column, array in arrays.items()}
        facts |= {
            "messages": messages,
            "method": known["method_name"],
            "setting_kind": setting_kind,
        }
        facts |= {column: known[column] for column in ("scene_hash", "versions") if column in known}
        yield Record(
            kind, scene, name, facts | parsed(known.get("options", "{}"), dict, stored.path), arrays
        )


# Groups of arrays


def write_records(path: Path, records: Sequence[Record]) -> None:
    """Write records, all of one kind, into a file that has those of other scenes still.

    The modes of a scene replace all earlier ones of it, a comparison those of the same name. Raises
    InputError where `path` is a file of another kind, StoreError where it cannot be read or
    written.
    """
    kind = records[0].kind
    scenes = {record.scene for record in records}
    names = {(record.scene, record.name) for record in records}
    with locked(path):
        earlier = read_records(path, kind) if may_extend(path, kind) else []
        for record in earlier:
            is_replaced = (
                record.scene in scenes if kind == MODES else (record.scene, record.name) in names
            )
            if not is_replaced:
                records = [*records, record]
        with new_file(path, kind) as file:
            put_attributes(file, {**versions(), **machine()})
            for record in records:
                group = new_group(file, "/".join((kind, record.scene, record.name)))
                put_attributes(group, record.attributes)
                for name, column in record.columns.items():
                    dataset = put(group, name, np.asarray(record.arrays[name]), column)
                    if f"{name}_labels" in record.attributes:
                        put_attributes(dataset, {"labels": record.attributes[f"{name}_labels"]})


def _record(path: str, group: StoredGroup) -> Record:
    """Return the record of the group at `path`."""
    kind, *scene, owner, name = path.split("/")
    scales_first = dict(
        sorted(group.columns.items(), key=lambda column: column[1].dimensions != (column[0],))
    )
    return Record(
        kind, "/".join(scene), f"{owner}/{name}", group.attributes, group.values, scales_first
    )
