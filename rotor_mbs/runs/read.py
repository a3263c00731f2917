"""Read scenes, runs and records from results files; write records.

The row of a run is read when one of its values is used. A stored run can be returned as a Solution,
so that it can be judged again. No engine is needed.

Studies also store records. A record is the points of a curve or ladder in a table, or a group of
arrays with its own dimensions.

/bench                          a row per point of a curve: a method at one setting on a scene
/stability                      a row per step of a ladder: a fixed-step method on a scene
/modes/<scene>/<model>/<kind>   modes over rotor speed, in a file of modes
/comparison/<scene>/data/trajectory   data of another program over time, with reference values
/comparison/<scene>/data/modes        modes of another program over rotor speed, with reference
                                      values
"""

from __future__ import annotations

import functools
import math
import os
from collections.abc import Callable, Collection, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, field
from functools import partial
from pathlib import Path
from typing import IO, Any

import numpy as np
from numpy.typing import NDArray

from rotor_mbs.errors import StoreError, shown_value
from rotor_mbs.methods.catalogue import PRINTED, REFERENCE, is_built_in, is_corrected
from rotor_mbs.runs.arrays import chosen_group
from rotor_mbs.runs.design import (
    MISSING,
    NUMBERS,
    POINT_COLUMNS,
    REFERENCE_ARRAYS,
    RUNS,
    STATUS_COPIES,
    known_columns,
)
from rotor_mbs.runs.hdf5 import ATTEMPTS, Column, TableSpec, read_groups, reading
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
    """A run in a results file or in the file of a sweep; the reference of a scene is a run, too.

    The row of the run is read and verified when one of its values is used.

    Attributes
    ----------
    scene_name, method : name of the scene and name of the method.
    known : values of the row in the known columns, by column: settings, versions, ... (see
        `runs.design`).
    scales : the scales time, coordinate, blade and axis, as far as the table has them.
    """

    scene_name: str
    method: str
    known: Mapping[str, Any]
    scales: Mapping[str, NDArray[Any]]
    _place: RowLocation
    _read_scene: Callable[[], Scene]
    _read_reference: Callable[[], Trajectory | None] = lambda: None
    _file: IO[bytes] | None = None
    _verify: bool = True

    @functools.cached_property
    def _stored(self) -> Rows:
        """Return the columns of the run's row as they are in the file, without verifying them."""
        with reading(self._name):
            return self._place.read(file=self._file)

    @functools.cached_property
    def is_damaged(self) -> bool:
        """Return whether the checksum of the run's row is wrong."""
        row = self._stored
        return bool((checksums(self._place.first, row, self._place.row_type) != row["crc32"]).any())

    @functools.cached_property
    def _row(self) -> Rows:
        """Return the values of the run's row, by column.

        Raises StoreError if their checksum is wrong, unless runs are opened without verifying.
        """
        if self._verify and self.is_damaged:
            raise StoreError(f"{self._name} changed after it was written")
        return {name: values[0] for name, values in self._stored.items()}

    @property
    def _name(self) -> str:
        return f"{self._place.path}: {self.scene_name}/{self.method}"

    @functools.cached_property
    def scene(self) -> Scene:
        """Return the scene of the run. Raises InputError if the stored text is no scene."""
        return self._read_scene()

    @property
    def reference(self) -> Trajectory | None:
        """Return the samples of the reference in the file.

        None is returned for the reference itself, for a run of a sweep, and if the file has no
        reference whose arrays can be used.
        """
        return None if self.method == REFERENCE else self._read_reference()

    @functools.cached_property
    def attributes(self) -> dict[str, Any]:
        """Return status, message, metrics, times ... of the run as plain values, by name.

        Values that the run does not have are left out.
        """
        facts: dict[str, Any] = {"status": self.status, "settings": self.known["settings"]}
        facts |= {name: text_of(self._row[name]) for name in _TEXTS if name in self._row}
        for name, value in self._row.items():
            if name in ("status", "crc32", *STATUS_COPIES.values(), *_TEXTS) or np.ndim(value):
                continue
            number = value.item()
            # -1 and NaN stand for a number that the run does not have.
            is_whole = isinstance(number, int) and number >= 0
            is_real = isinstance(number, float) and not math.isnan(number)
            if is_whole or is_real:
                facts[name] = number
        return facts

    def verify(self) -> None:
        """Raise StoreError if the row has changed after it was written."""
        _ = self._row

    @property
    def is_frozen(self) -> bool:
        """Return whether the run is a reference that was shipped, or copied from a shipped file."""
        return "frozen_with" in parsed(self.known.get("versions", "{}"), dict, self._name)

    @property
    def status(self) -> str:
        """Return the status of the run; "" for an unknown code."""
        code = int(self._row["status"])
        return STATUSES[code] if 0 <= code < len(STATUSES) else ""

    @property
    def settings(self) -> dict[str, Any]:
        """Return the settings of the method. Raises StoreError if they are damaged."""
        return parsed(self.known["settings"], dict, self._name)

    @property
    def labels(self) -> list[str]:
        """Return the names of the coordinates: rotor, pitch 1, ...

        The list is empty if neither angles nor rates are stored.
        """
        is_known = "angles" in self or "rates" in self
        return list(coordinate_labels(len(self.scales["coordinate"]) - 1)) if is_known else []

    @functools.cached_property
    def samples(self) -> int:
        """Return the number of samples that the run computed."""
        if not self._is_of_sweep:
            return int(self._row["samples"])
        # The samples of a run of a sweep are counted in its arrays, which are NaN after its end.
        is_finite = []
        for values in self._own_arrays.values():
            if len(values) == len(self.scales["time"]):
                is_finite.append(np.isfinite(values.reshape(len(values), -1)).all(axis=1))
        return int(np.all(is_finite, axis=0).sum()) if is_finite else 0

    @property
    def _is_of_sweep(self) -> bool:
        """Return whether the run is one of a sweep, whose file has no numbers of samples."""
        return "samples" not in self._row

    @property
    def _own_arrays(self) -> dict[str, NDArray[Any]]:
        """Return the arrays of the run by name, including the blank rows after its last sample."""
        return {
            name: values
            for name, values in self._row.items()
            if np.ndim(values) and name not in _TEXTS
        }

    @functools.cached_property
    def _arrays(self) -> dict[str, NDArray[Any]]:
        """Return the arrays of the run up to its last sample, and the scales, by name.

        An array that is NaN in all samples is left out: the run does not have it.
        """
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
        """Return the names of the arrays of the run, and of the scales."""
        return list(self._arrays)

    def __contains__(self, name: str) -> bool:
        return name in self._arrays

    def array(self, name: str) -> NDArray[Any]:
        """Return an array or a scale by name. Raises StoreError if the run does not have it."""
        if name not in self:
            raise StoreError(f"{self._name} has no {name}")
        return self._arrays[name]

    def get(self, name: str) -> NDArray[Any] | None:
        """Return an array or a scale by name, or None if the run does not have it."""
        return self._arrays.get(name)

    def faults(self, *, complete: bool = True) -> list[str]:
        """Return a line for every array that is missing or wrong.

        A frozen reference needs only angles, rates and the arrays that cannot be derived from them.
        A run of a method that is not built in needs only angles and rates.

        Parameters
        ----------
        complete : whether the run must have all samples of the scene. Otherwise it may end early,
            but each array must have a row for each stored time.
        """
        scene, faults = self.scene, []
        rows = len(self.array("time")) if "time" in self else scene.samples
        if complete and rows != scene.samples:
            faults.append(f"{rows} of {scene.samples} samples" if rows else "no samples")
        always_there = REFERENCE_ARRAYS if self.is_frozen else ("angles", "rates")
        may_omit_others = self.is_frozen or not is_built_in(self.method)
        expected: dict[str, tuple[int, ...]] = {"time": (rows,)}
        for quantity in quantities(scene.outputs):
            # The outputs of a sweep may differ from those of its scene.
            if self._is_of_sweep and quantity.name not in self._row:
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
                sample = int(np.argwhere(~np.isfinite(values))[0][0])
                faults.append(f"{name} is not finite at sample {sample}")
        return faults

    def trajectory(self) -> Trajectory | None:
        """Return the samples of the run, or None if its arrays cannot be used.

        Angles and rates that are not stored are NaN.
        """
        if self.faults(complete=False):
            return None
        scene, time = self.scene, self.array("time")
        blank = np.full((len(time), 1 + len(scene.blades)), np.nan)
        names = {quantity.name for quantity in known_quantities(scene.outputs)}
        arrays = {name: np.asarray(self.array(name), float) for name in names if name in self}
        return Trajectory(**{"time": time, "angles": blank, "rates": blank, **arrays})

    def solution(self) -> Solution | None:
        """Return the run as the Solution that was stored, or None if its arrays cannot be used."""
        trajectory, facts = self.trajectory(), self.attributes
        if trajectory is None:
            return None
        # A results file stores the engine's report. A shipped reference has no report, and counts
        # as a success. The file of a sweep has no reports, so that the status takes their place.
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
            self.scene,
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
    """A scene in an open file.

    Attributes
    ----------
    name : name of the scene.
    attributes : attributes of its table: title, figures, blades, scene_toml, scene_hash.
    runs : stored runs by name of the method. The reference comes first, and the methods follow in
        the order of the catalogue.
    """

    name: str
    attributes: dict[str, Any]
    runs: dict[str, StoredRun]

    @functools.cached_property
    def scene(self) -> Scene:
        """Return the scene that its text describes. Raises InputError if it is no scene."""
        return parse_scene(str(self.attributes["scene_toml"]), self.name)

    @functools.cached_property
    def reference_trajectory(self) -> Trajectory | None:
        """Return the samples of the reference.

        None is returned if the file has no reference, or its arrays cannot be used.
        """
        return None if self.reference is None else self.reference.trajectory()

    @functools.cached_property
    def changes(self) -> list[SceneChange] | None:
        """Return how the scene differs from the shipped scene of the same name.

        None is returned if no scene of that name is shipped.
        """
        shipped = shipped_scene(self.name)
        return None if shipped is None else scene_changes(shipped, self.scene)

    @property
    def label(self) -> str:
        """Return the name of the scene, with its changes to the shipped scene of that name."""
        return label_with_changes(self.name, self.changes or ())

    @property
    def is_shipped(self) -> bool:
        """Return whether the scene is the shipped scene of the same name.

        Only samples and outputs may differ.
        """
        return moves_as_shipped(self.changes)

    @property
    def figures(self) -> str:
        """Return the paper's figures that show the scene, such as "11, 13a"; "" if none does."""
        return str(self.attributes.get("figures", "")) if self.is_shipped else ""

    @property
    def title(self) -> str:
        """Return the title of the scene."""
        return str(self.attributes["title"])

    @property
    def reference(self) -> StoredRun | None:
        """Return the run of the reference, or None if the file has none."""
        return self.runs.get(REFERENCE)

    @property
    def methods(self) -> dict[str, StoredRun]:
        """Return all runs except the reference, in the order of the file."""
        return {name: run for name, run in self.runs.items() if name != REFERENCE}

    @property
    def printed(self) -> StoredRun | None:
        """Return the run of the equations as printed, or None if there is none with samples."""
        run = self.runs.get(PRINTED)
        return run if run is not None and run.samples else None

    @property
    def corrected_runs(self) -> dict[str, StoredRun]:
        """Return the runs of corrected models by method, except the reference.

        Runs without samples are included.
        """
        return {name: run for name, run in self.methods.items() if is_corrected(name)}

    @property
    def corrected(self) -> StoredRun | None:
        """Return the run that represents the corrected model, or None.

        It is the reference, or the first run of a corrected model that has samples.
        """
        candidates = [self.reference, *self.corrected_runs.values()]
        return next((run for run in candidates if run is not None and run.samples), None)

    @property
    def sides(self) -> dict[str, StoredRun]:
        """Return the runs `printed` and `corrected` by these names, as far as they exist."""
        sides = {"printed": self.printed, "corrected": self.corrected}
        return {side: run for side, run in sides.items() if run is not None}


@dataclass(frozen=True)
class OpenResults:
    """An open results file.

    Attributes
    ----------
    path : path of the file.
    attributes : attributes of the file: versions, platform, created, ...
    scenes : scenes with stored runs by name, in natural order.
    rows : labels of all rows of `/runs`, in the order of the file, including rows that are missing.
    """

    path: Path
    attributes: dict[str, Any]
    scenes: dict[str, StoredScene]
    rows: list[str]


@contextmanager
def open_results(
    path: Path, *, verify: bool = True, only: Collection[str] | None = None
) -> Iterator[OpenResults]:
    """Open a results file for the block.

    If another file replaces it during the block, the block still reads the old file.

    Parameters
    ----------
    path : the file.
    verify : whether a run is compared with its checksum when it is read.
    only : names of the scenes that are opened, by default all.

    Yields
    ------
    OpenResults

    Raises
    ------
    StoreError
        If the file cannot be read, or its content causes an error in the block.
    """
    for _ in range(ATTEMPTS):
        stored = opened_tables(path, None if only is None else {RUNS, *only})
        with path.open("rb") as file:
            inode = os.fstat(file.fileno()).st_ino
            if any(table.inode != inode for table in stored.tables.values()):
                continue
            with reading(path):  # the caller's block is included, as it reads rows
                scenes = {scene.name: scene for scene in _scenes(stored, file, verify, only)}
                yield OpenResults(
                    path,
                    stored.attributes,
                    {name: scenes[name] for name in natural_order(scenes)},
                    list(stored.tables[RUNS].runs) if RUNS in stored.tables else [],
                )
            return
    raise StoreError(f"{path}: is being replaced by another process")


class StoredRuns:
    """The runs of a results file, or of one scene in it.

    The file is open only while values are read. `StoredSweep` has the same members for the runs of
    a sweep.

    Attributes
    ----------
    labels : labels of the stored runs, in the order of `open_results`. For one scene they are the
        names of the methods, otherwise "scene/method".
    scenes : names of the scenes.
    subsets : names of the scenes, each of which can be given as `scene` to select its runs.
    group : group of the arrays over time; None for several scenes.
    keys : keys of varied parameters; always empty, as only a sweep varies parameters.
    """

    keys: Sequence[str] = ()

    def __init__(self, path: Path, scene: str = "") -> None:
        """Read the labels of the runs.

        Parameters
        ----------
        path : a results file.
        scene : name of a scene; "" for all scenes.

        Raises
        ------
        StoreError
            If the file cannot be read, or has no such scene.
        """
        self._path = path
        tables = opened_tables(path, {RUNS}).tables
        methods: dict[str, list[str]] = {}
        if RUNS in tables:
            with reading(path):
                statuses = tables[RUNS].column("status").tolist()
                for status, row in zip(statuses, tables[RUNS].known_rows.values(), strict=True):
                    if status != MISSING:
                        methods.setdefault(str(row["scene"]), []).append(str(row["method_name"]))
        self.scenes = natural_order(methods)
        if scene:
            if scene not in methods:
                allowed = ", ".join(self.scenes)
                raise StoreError(f"{path}: has no scene {shown_value(scene)}; allowed: {allowed}")
            self.scenes = [scene]
        self.subsets, self.group = self.scenes, scene or None
        self._names: dict[str, tuple[str, str]] = {}  # scene and method by label
        for name in self.scenes:
            for method in methods[name]:
                self._names[method if scene else f"{name}/{method}"] = name, method

    @property
    def labels(self) -> list[str]:
        """Return the labels of the stored runs."""
        return list(self._names)

    @functools.cached_property
    def title(self) -> str:
        """Return the name of the scene, with changes to the shipped one; "" for several scenes."""
        if self.group is None:
            return ""
        with open_results(self._path, only=[self.group]) as results:
            return results.scenes[self.group].label

    @contextmanager
    def opened_run(self, label: str) -> Iterator[StoredRun]:
        """Open the file and yield a run. Raises StoreError if the run is not in it any more."""
        scene, method = self._names[label]
        with open_results(self._path, only=[scene]) as results:
            if scene not in results.scenes or method not in results.scenes[scene].runs:
                raise StoreError(
                    f"{self._path}: has no {scene}/{method} any more: another file has taken its "
                    "place"
                )
            yield results.scenes[scene].runs[method]

    def verify(self) -> None:
        """Raise StoreError if a run has changed after it was written."""
        with open_results(self._path, only=self.scenes) as results:
            for scene in results.scenes.values():
                for run in scene.runs.values():
                    run.verify()

    @property
    def columns(self) -> dict[str, Column]:
        """Return the columns of /runs by name; for one scene also the columns of its arrays."""
        columns: dict[str, Column] = {}
        for table in reversed(self._tables()):
            columns = {**table.columns, **columns}
        return columns

    def values(self, name: str, sample: int | None = None) -> NDArray[Any]:
        """Return a column of all runs in the order of the labels, (runs, ...), or a scale.

        Parameters
        ----------
        name : name of the column or the scale.
        sample : for an array over time, the number of the only sample that is returned; None for
            all samples.

        Raises
        ------
        StoreError
            If there is no such column.
        """
        for table in self._tables():
            if name in table.columns:
                rows = [
                    table.row_of[f"{scene}/{method}" if table.group == RUNS else method]
                    for scene, method in self._names.values()
                ]
                return table.rows(name, rows, sample)
        raise StoreError(f"{self._path}: has no {shown_value(name)}")

    def _tables(self) -> list[StoredTable]:
        """Return the table /runs and, for one scene, the table of its arrays."""
        groups = [RUNS] if self.group is None else [self.group, RUNS]
        tables = opened_tables(self._path, groups).tables
        return [tables[group] for group in reversed(groups) if group in tables]


def run_arrays(path: Path, group: str = "", scene: str = "") -> dict[str, NDArray[Any]]:
    """Return the arrays of up to three dimensions of one run of a results file, by name.

    The parameters select the run as `runs.arrays.read_arrays` selects a group; the name
    "scene/method" of a run takes the place of the path of a group.
    """
    with open_results(path) as results:
        runs = {}
        for name, stored in results.scenes.items():
            for run in stored.runs.values():
                runs[f"{name}/{run.method}"] = run
        run = runs[chosen_group(path, list(runs), group, scene)]
        return {name: run.array(name) for name in run.names if run.array(name).ndim <= 3}


def is_sweep(path: Path) -> bool:
    """Return whether a file of this program is the dataset of a sweep.

    Raises StoreError if the file cannot be read.
    """
    return read_trailer(path).kind == SWEEP


def _scenes(
    stored: TableFile, file: IO[bytes], verify: bool, only: Collection[str] | None
) -> Iterator[StoredScene]:
    """Yield the scenes of an open file with their runs.

    Parameters
    ----------
    stored : the tables of the file.
    file : the file, open for reading.
    verify : whether a run is compared with its checksum when it is read.
    only : names of the scenes; None for all.
    """
    if RUNS not in stored.tables:
        return
    runs = stored.tables[RUNS]
    file.seek(runs.offsets["status"])
    statuses = np.frombuffer(file.read(len(runs.runs)), np.int8)
    scenes: dict[str, StoredScene] = {}
    for status, (run, known) in zip(statuses, runs.known_rows.items(), strict=True):
        name, method = str(known["scene"]), str(known["method_name"])
        if status == MISSING or (only is not None and name not in only):
            continue
        table = stored.tables[name]
        scene = scenes.setdefault(name, StoredScene(name, dict(table.attributes), {}))
        scene.runs[method] = StoredRun(
            name,
            method,
            known,
            {scale: values for scale, (_, values) in table.known.items()},
            stored.place(run),
            partial(getattr, scene, "scene"),
            partial(getattr, scene, "reference_trajectory"),
            file,
            verify,
        )
    yield from scenes.values()


_MESSAGE_LENGTH = 300


@dataclass(frozen=True)
class Record:
    """A curve of a bench, a ladder of steps, or another group of arrays that belong together.

    Attributes
    ----------
    kind : "bench" or "stability" (the keys of `POINT_COLUMNS`), "modes" or "comparison".
    scene : name of the scene.
    name : name of a curve or a ladder: the method, then those settings that are constant along the
        curve and differ from their defaults. For modes and comparisons the name is the end of the
        group's path, such as "data/modes".
    attributes : further values by name.
    arrays : arrays by name. Those of a curve or a ladder have the shape (points,); `status` has
        codes of `solution.status.STATUSES`.
    columns : descriptions of the arrays by name, scales first; empty for a curve or a ladder.
    """

    kind: str
    scene: str
    name: str
    attributes: Mapping[str, Any] = field(default_factory=dict)
    arrays: Mapping[str, NDArray[Any]] = field(default_factory=dict)
    columns: Mapping[str, Column] = field(default_factory=dict)

    @property
    def method(self) -> str:
        """Return the name of the method."""
        return str(self.attributes.get("method", self.name))

    @property
    def statuses(self) -> list[str]:
        """Return the status of each point."""
        return [STATUSES[int(code)] for code in self.arrays["status"]]

    @property
    def messages(self) -> list[str]:
        """Return the message of each point."""
        return [
            str(text) for text in self.attributes.get("messages", [""] * len(self.arrays["status"]))
        ]


# Tables of points


def points_table(group: str, points: Sequence[Mapping[str, object]]) -> TableSpec:
    """Return the table /bench or /stability with a row for each point.

    A point has the values of its known columns by name, and its label as `run`.
    """
    runs = [str(point["run"]) for point in points]
    return TableSpec(
        group, runs, known_columns(points), POINT_COLUMNS[group], characters=_MESSAGE_LENGTH
    )


def read_records(path: Path, kind: str) -> list[Record]:
    """Read all records of one kind, in the order of the file.

    A curve or ladder with a missing point is left out. Raises StoreError if the file cannot be
    read.
    """
    if kind in POINT_COLUMNS:
        tables = TableFile(path, [kind]).tables.values()
        with reading(path):
            return [record for table in tables for record in _point_records(table)]
    groups, _ = read_groups(path, [kind])
    with reading(path):
        return [_record(group) for name, group in groups.items() if name]


def _point_records(stored: StoredTable) -> Iterator[Record]:
    """Yield a record for each curve or ladder of a table whose points are all stored.

    Parameters
    ----------
    stored : the table.
    """
    kind, statuses, rows = stored.group, stored.statuses(), list(stored.known_rows.values())
    columns = stored.place().read(len(stored.runs)) | {
        name: stored.column(name) for name in NUMBERS if name in stored.known
    }
    curves = [(row["scene"], row.get("curve", row["method_name"])) for row in rows]
    for scene, name in dict.fromkeys(curves):
        row_numbers = [i for i, curve in enumerate(curves) if curve == (scene, name)]
        if (statuses[row_numbers] == MISSING).any():
            continue
        known = rows[row_numbers[0]]
        arrays = {column: values[row_numbers] for column, values in columns.items()}
        setting_kind = str(known.get("setting_kind", "step"))
        arrays["setting"] = arrays[setting_kind]
        # Values that belong to the whole curve, such as its order, are taken from its first row.
        # A number that the curve does not have is NaN.
        facts: dict[str, Any] = {}
        for column, values in arrays.items():
            if column not in ("status", "message", "setting"):
                value = values[0].item()
                if value == value:
                    facts[column] = value
        messages = [text_of(text) for text in arrays.pop("message")]
        if kind == "stability":  # steps that were not needed are left out
            is_used = arrays["status"] != code_of("left_out")
            arrays = {column: array[is_used] for column, array in arrays.items()}
            messages = [messages[step] for step in np.flatnonzero(is_used)]
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
    """Write records of one kind into a file, which keeps its records of other scenes.

    New modes of a scene replace all stored modes of the scene. A new comparison replaces a stored
    comparison of the same scene and name.

    Parameters
    ----------
    path : the file.
    records : one or more.

    Raises
    ------
    InputError
        If `path` is a file of another kind.
    StoreError
        If the file cannot be read or written.
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


def _record(group: TableSpec) -> Record:
    """Return the record that a group of a file of modes or comparisons holds."""
    kind, *scene, owner, name = group.group.split("/")
    scales_first = sorted(
        group.known.items(), key=lambda known: known[1][0].dimensions != (known[0],)
    )
    return Record(
        kind,
        "/".join(scene),
        f"{owner}/{name}",
        group.attributes,
        {array: values for array, (_, values) in group.known.items()},
        {array: column for array, (column, _) in scales_first},
    )
