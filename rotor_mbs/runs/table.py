"""Tables of runs in an HDF5 file, each its own journal: laid out first, rows filled in place, the status of a row last.

    /runs                 a row per run of the file: scene, method, settings, status, metrics
    /paper/fig11          the arrays of a scene: dimensions run, time, ...
    /bench, /stability    a row per point
    /                     of a sweep's file: one table

All space is taken when a file is laid out. From then on no HDF5 metadata changes, so that the file is valid and can be
read at every moment. The bytes of a row are written to their offsets, its status after a sync: a row is stored where
its status is not -1 and its checksum is right. What the design says of a row (its scene, method, settings, versions) is
written with the layout and covered by the digests of its group.

An HDF5 handle that is open while rows are written reads old values, and one that writes would destroy them: nothing is
written by the HDF5 library after the layout.
"""

from __future__ import annotations

import errno
import functools
import json
import math
import os
import zlib
from collections.abc import Collection, Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager, nullcontext
from dataclasses import dataclass, field, replace
from datetime import UTC, datetime
from pathlib import Path
from typing import IO, Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from rotor_mbs.errors import InputError, StoreError
from rotor_mbs.methods.catalogue import REFERENCE, find_method, method_names
from rotor_mbs.runs import files
from rotor_mbs.runs.files import CHARACTERS, KEYWORDS, Column, saving
from rotor_mbs.runs.versions import machine, row_versions, versions
from rotor_mbs.scenario.catalogue import natural_key
from rotor_mbs.scenario.scene import Scene, scene_hash
from rotor_mbs.solution.quantities import LOADS, SCALES, quantities, scale_values
from rotor_mbs.solution.status import STATUSES, code_of
from rotor_mbs.solution.trajectory import Solution

# (rows, ...) arrays by the name of their dataset.
Rows = dict[str, NDArray[Any]]

MISSING = -1  # status of a row that is not stored
# What the table of a scene's arrays repeats of the run's row in another table; in a row it has this name.
REPEATED = {"status": "status_repeated", "samples": "samples_repeated"}
CHARACTER = "S1"  # kind of a column of texts that are computed: (run, characters), UTF-8, then zeros


def flags(names: Sequence[str], first: int = 0) -> dict[str, Any]:
    """The attributes of a column of codes, as CF has them: what each code from `first` on means."""
    return {"flag_values": np.arange(first, first + len(names), dtype=np.int8), "flag_meanings": " ".join(names)}


# What a computed column with a value a row is, whichever table has it: units, long name, type where it is no double.
COLUMNS = {
    name: Column(("run", CHARACTERS) if CHARACTER in kind else ("run",), units, long_name, kind[0] if kind else "<f8")
    for name, (units, long_name, *kind) in {
        "status": ("1", "outcome of the run, determined from its samples; -1: not computed yet", "i1"),
        "message": ("1", "reason for a status other than ok", CHARACTER),
        "samples": ("1", "number of samples stored", "<i8"),
        "time_reached": ("s", "time of the last sample"),
        "time_limit_s": ("s", "time limit that stopped the run; NaN if it was not stopped"),
        "steps": ("1", "number of integration steps; -1: unknown", "<i8"),
        "rhs_evaluations": ("1", "number of evaluations of the right-hand side; -1: unknown", "<i8"),
        "setup_time_s": ("s", "time to build the model"),
        "setup_again_time_s": ("s", "time to build the model a second time"),
        "run_time_s": ("s", "median run time of the integration"),
        "run_time_min_s": ("s", "shortest run time of the integration"),
        "run_time_q1_s": ("s", "lower quartile of the run times"),
        "run_time_q3_s": ("s", "upper quartile of the run times"),
        "output_time_s": ("s", "time to read and compute the samples"),
        "repeats": ("1", "number of timed runs", "<i8"),
        "repeatable": ("1", "1 if the first and last run of every point of the curve are bitwise equal", "i1"),
        "engine_success": ("1", "1 if the engine reported success, -1 without a report", "i1"),
        "engine_message": ("1", "message of the engine", CHARACTER),
        "false_success": ("1", "1 if the engine reported success although the samples are wrong", "i1"),
        "energy_scale_J": ("J", "energy scale, to which energy errors are relative"),
        "energy_drift_max": ("1", "largest energy error over the run, relative to the energy scale"),
        "energy_gain_J": ("J", "largest energy gain beyond the work"),
        "angle_error_max": ("rad", "largest angle error up to the horizon"),
        "angle_error_predicted": ("rad", "largest angle error up to the horizon, predicted from the defects"),
        "defect_max": ("rad", "largest defect of an interval between samples"),
        "defect_median": ("rad", "median of the interval defects"),
        "defect_time": ("s", "end of the interval of the largest defect"),
        "defect_judged": (
            "rad",
            "largest defect beyond rounding, scaled in intervals over 0.01 s; the value compared with the bound",
        ),
        "defect_mean": ("rad", "signed mean of the defects, of the coordinate with the largest one"),
        "defect_drift": ("rad", "largest sum of the defects of 100 intervals, each propagated to their end"),
        "defect_floor": ("rad", "largest defect that rounding of the samples can cause"),
        "defects_not_judged": ("1", "number of intervals in which errors may grow by more than 1e5"),
        "angle_error_whole": ("rad", "largest angle error over the whole run"),
        "angle_error_end": ("rad", "angle error at the last sample"),
        "tip_error_max": ("m", "largest distance of a tip from the reference up to the horizon"),
        "error_growth": ("1", "largest factor by which a small error of the initial state has grown"),
        "horizon_s": ("s", "time of the last sample before the error growth reaches 1e5"),
        "uncertainty_rad": ("rad", "uncertainty of the reference up to the horizon"),
        "angular_impulse_error_max": ("1", "largest error of the angular momentum balance, relative to its scale"),
        "linear_impulse_error_max": ("1", "largest error of the linear momentum balance, relative to its scale"),
        "zero_pitch_max": ("rad", "largest pitch angle among those that are zero in the reference"),
        "zero_pitch_left_s": ("s", "time at which such a pitch angle becomes nonzero"),
        "zero_pitch_growth_per_s": ("1/s", "growth rate of such a pitch angle"),
        "rotor_angle_min": ("rad", "smallest rotor angle, at the integrator's own output points"),
        "rotor_angle_max": ("rad", "largest rotor angle, at the integrator's own output points"),
        "rotor_rate_max": ("rad/s", "largest magnitude of the rotor rate, at the integrator's own output points"),
        "pitch_max": ("rad", "largest magnitude of a pitch angle"),
        "left_out": ("1", "1 if the point was omitted because of the time budget", "i1"),
        "load_before": ("1", "load average of the machine before the timing"),
        "pinned_core": ("1", "number of the core used for timing; -1: any", "<i8"),
        "order": ("1", "order of convergence of the curve, fitted above its round-off floor"),
        "step_for_target_s": ("s", "step at which the ladder reaches 1e-6 rad"),
        "code": ("1", "CRC-32 of the versions of package, libraries and code that computed the run", "<u4"),
        "crc32": ("1", "CRC-32 of the row, over all computed columns", "<u4"),
    }.items()
}
COLUMNS["status"] = COLUMNS["status"]._replace(attributes=flags(("missing", *STATUSES), MISSING))
# What the design says of each row of a table, in this order: units, long name. What has no entry is no column.
KNOWN = {
    "scene": ("1", "scene"),
    "method_name": ("1", "method, model/integrator"),
    "curve": ("1", "method with its fixed settings"),
    "setting_kind": ("1", "setting that varies along the curve: step or tolerance"),
    "settings": ("1", "settings of the method, JSON"),
    "options": ("1", "options of the study, JSON"),
    "versions": ("1", "versions of package, libraries and code that computed the row, JSON"),
    "scene_hash": ("1", "SHA-256 of the numbers of the scene"),
    "step": ("s", "time step"),
    "tolerance": ("1", "tolerance"),
    "order_expected": ("1", "order of the method"),
}
_HEAD_BYTES = 1 << 17  # of a file beside its rows, at most: descriptions and texts
_OF_REFERENCE = "columns_of_the_reference"  # the attribute with the names of those that have no value a run
_READ_BYTES = 1 << 25  # read at once when checksums are verified


@dataclass(frozen=True)
class Table:
    """A table before its rows are computed.

    Attributes
    ----------
    group : where it stands in the file; "" for the root.
    runs : (rows,) the scale `run`: texts that tell the rows apart, or their numbers.
    known : by name, column and values of the other dimensions' scales, and of what the design says of each row.
    computed : columns that are computed. One without the dimension `run` belongs to the reference.
    attributes : of the group.
    characters : of each computed text.
    """

    group: str
    runs: Sequence[str] | NDArray[np.int64]
    known: Mapping[str, tuple[Column, Any]]
    computed: Mapping[str, Column]
    attributes: Mapping[str, object] = field(default_factory=dict)
    characters: int = 0

    @property
    def row_type(self) -> np.dtype[np.void]:
        """The computed columns of one row, in the order in which its checksum covers them."""
        lengths = {name: len(values) for name, (_, values) in self.known.items()} | {CHARACTERS: self.characters}
        shapes = {
            name: tuple(lengths[dimension] for dimension in column.dimensions if dimension != "run")
            for name, column in self.computed.items()
        }
        return np.dtype([(name, column.kind, shapes[name]) for name, column in self.computed.items()])


def known_columns(rows: Sequence[Mapping[str, object]]) -> dict[str, tuple[Column, Any]]:
    """`known` of a table with these rows, texts and numbers by name, all with the same names."""
    columns: dict[str, tuple[Column, Any]] = {}
    for name, (units, long_name) in KNOWN.items():
        if rows and name in rows[0]:
            values: Any = [row[name] for row in rows]
            is_text = isinstance(values[0], str)
            columns[name] = Column(("run",), units, long_name), values if is_text else np.array(values, float)
    return columns


def scene_scales(scene: Scene, columns: Iterable[Column]) -> dict[str, tuple[Column, Any]]:
    """The scales of a table with these columns over a scene's samples, as part of `known`."""
    used = {"time"}.union(*(column.dimensions for column in columns))
    values = scale_values(scene)
    attributes: dict[str, Any] = {
        "time": {"standard_name": "time"},
        "coordinate": {"labels": scene.coordinate_labels},
    }
    return {
        name: (Column((name,), scale.units, scale.long_name, attributes=attributes.get(name, {})), values[name])
        for name, scale in SCALES.items()
        if name in used
    }


@dataclass(frozen=True)
class Place:
    """Where consecutive rows lie in a file. Worker processes that see the file write them by it.

    inode: of the file; another file of that name is not written to. first: number of the first row; its checksum begins
    with it. offsets: bytes from the beginning of the file to the first row, by column. row: type of a row, its columns
    in the order in which the checksum covers them.
    """

    path: Path
    inode: int
    first: int
    offsets: Mapping[str, int]
    row: np.dtype[np.void]

    def rows_of(self, values: Mapping[str, object], count: int = 1) -> Rows:
        """Rows with these values, the same in each, by the name of their column: numbers, a text, the name of a status,
        the first samples of an array. The other columns are blank; what is no column here is left out."""
        rows = blank_rows(count, self.row)
        for name, value in values.items():
            if name == "status":
                rows[name][:] = code_of(str(value))
            elif name in rows and isinstance(value, str):
                rows[name][:] = characters(value, rows[name].shape[1])
            elif name in rows and isinstance(value, np.ndarray):
                rows[name][:, : len(value)] = value
            elif name in rows:
                rows[name][:] = value
        for name, repeated in REPEATED.items():
            if repeated in rows:
                rows[repeated][:] = rows[name]
        return rows

    def at(self, row: int) -> Place:
        """The place of a later row, counted from the first."""
        offsets = {name: offset + row * self.row[name].itemsize for name, offset in self.offsets.items()}
        return replace(self, first=self.first + row, offsets=offsets)

    def write(self, rows: Rows) -> None:
        """Store consecutive rows, their statuses last; meanwhile they are missing. Raises StoreError."""
        columns = rows | {"crc32": checksums(self.first, rows, self.row)}
        statuses = {name: columns.pop(name) for name in (REPEATED["status"], "status") if name in columns}
        with saving(self.path), self.path.open("r+b") as file:
            if os.fstat(file.fileno()).st_ino != self.inode:
                raise StoreError(f"{self.path}: has been replaced by another file")
            for name, status in statuses.items():
                file.seek(self.offsets[name])
                file.write(np.full(len(status), MISSING, np.int8).data)
            for name, values in columns.items():
                file.seek(self.offsets[name])
                file.write(np.ascontiguousarray(values).data)
            file.flush()
            os.fsync(file.fileno())
            for name, status in statuses.items():
                file.seek(self.offsets[name])
                file.write(np.ascontiguousarray(status, np.int8).data)

    def read(self, count: int = 1, file: IO[bytes] | None = None) -> Rows:
        """(count, ...) The columns of so many rows; file: one that is open. Raises OSError, ValueError."""
        with nullcontext(file) if file is not None else self.path.open("rb") as source:
            rows = {}
            for name in self.row.names or ():
                kind = self.row[name]
                source.seek(self.offsets[name])
                content = source.read(count * kind.itemsize)
                rows[name] = np.frombuffer(content, kind.base).reshape(count, *kind.shape)
        return rows

    @property
    def is_stored(self) -> bool:
        """Whether the first row is there as it was written."""
        row = self.read()
        return bool(row["status"][0] != MISSING and checksums(self.first, row, self.row)[0] == row["crc32"][0])

    def clear(self) -> None:
        """Write a blank row, which a reader of an unfinished file sees; its status stays as it is."""
        with saving(self.path), self.path.open("r+b") as file:
            for name, values in blank_rows(1, self.row).items():
                if name != "status":
                    file.seek(self.offsets[name])
                    file.write(values.data)

    def mark_missing(self, rows: Collection[int]) -> None:
        """Take back the statuses of some rows, counted from the first, before they are computed again."""
        with saving(self.path), self.path.open("r+b") as file:
            for row in rows:
                for name in ("status", REPEATED["status"]):
                    if name in self.offsets:
                        file.seek(self.offsets[name] + row)
                        file.write(np.int8(MISSING).tobytes())
            file.flush()
            os.fsync(file.fileno())


def checksums(first: int, rows: Rows, row: np.dtype[np.void]) -> NDArray[np.uint32]:
    """(rows,) CRC-32 of each row, over its number and its columns."""
    sums = [first + i & 0xFFFFFFFF for i in range(len(rows["status"]))]
    for name in (name for name in row.names or () if name != "crc32"):
        contents: Any = np.ascontiguousarray(rows[name], row[name].base).reshape(len(sums), -1)
        sums = [zlib.crc32(content, so_far) for content, so_far in zip(contents, sums, strict=True)]
    return np.array(sums, np.uint32)


def blank_rows(count: int, row: np.dtype[np.void]) -> Rows:
    """Rows of which nothing is known: NaN, -1, no text."""
    blanks = {"f": np.nan, "i": -1, "u": 0, "S": b""}
    kinds = {name: row[name] for name in row.names or ()}
    return {name: np.full((count, *kind.shape), blanks[kind.base.kind], kind.base) for name, kind in kinds.items()}


def characters(text: str, length: int) -> NDArray[np.bytes_]:
    """(length,) The text as UTF-8 characters, cut or filled up with zeros."""
    return np.frombuffer(text.encode()[:length].ljust(length, b"\0"), CHARACTER)


def text_of(values: NDArray[np.bytes_]) -> str:
    """The text in an array of `characters`."""
    return values.tobytes().rstrip(b"\0").decode(errors="ignore")


# Laying out


@contextmanager
def laid_out(path: Path, tables: Sequence[Table], attributes: Mapping[str, object]) -> Iterator[Path]:
    """A new file with room for all rows, under a temporary name; after the block it is complete under its name, or not
    there. Its space is reserved twice: HDF5 does not survive a disk that fills up under it, and truncates the file it
    begins. Raises StoreError."""
    with files.replacing(path) as temporary:
        rows = sum(len(table.runs) * (table.row_type.itemsize + 8 * (4 + len(table.known))) for table in tables)
        _reserve(temporary, _HEAD_BYTES + rows)
        with files.begin_file(temporary) as file:
            files.put_attributes(file, attributes)
            for table in tables:
                _put_table(file, table)
            files.seal_all(file)
        _reserve(temporary, temporary.stat().st_size)
        yield temporary
    files.sync_folder(path.parent)


def _reserve(path: Path, size: int) -> None:
    """Takes the space on the disk, where the system and the file system can: not on macOS and Windows, where a disk
    that fills up is reported by the row that finds it full. Raises OSError."""
    with path.open("ab") as file:
        try:
            if hasattr(os, "posix_fallocate"):
                os.posix_fallocate(file.fileno(), 0, size)
        except OSError as exc:
            if exc.errno not in (errno.EOPNOTSUPP, errno.EINVAL, errno.ENOSYS):
                raise OSError(exc.errno, f"{exc.strerror} ({size:.2g} bytes for all runs)") from exc
        os.fsync(file.fileno())


def _put_table(file: Any, table: Table) -> None:
    group = files.new_group(file, table.group) if table.group else file
    files.put_attributes(group, table.attributes)
    files.put(group, "run", table.runs, Column(("run",), "1", "name or number of the run"))
    if table.characters:
        files.put_dimension(group, CHARACTERS, table.characters)
    for name, (column, values) in table.known.items():
        files.put(group, name, values, column)
    row = table.row_type
    for name, column in table.computed.items():
        kind = row[name].base
        shape = (len(table.runs), *row[name].shape) if "run" in column.dimensions else row[name].shape
        files.put_empty(group, name, shape, kind, column, MISSING if name == "status" else None)
    of_reference = [name for name, column in table.computed.items() if "run" not in column.dimensions]
    if of_reference:
        files.put_attributes(group, {_OF_REFERENCE: of_reference})
    files.seal(group, later=table.computed.keys())


# Reading


class StoredColumn(NamedTuple):
    """A computed column in a file: the type of its values, its shape, where it begins; whether it has a value a run."""

    kind: np.dtype[Any]
    shape: tuple[int, ...]
    offset: int
    is_of_runs: bool


@dataclass(frozen=True)
class StoredTable:
    """A table in a file as it was laid out; rows are read by their `Place`.

    runs: (rows,) texts or numbers. known: by name, the values of scales and of what the design says of each row.
    computed: the computed columns by name, in the order of the checksum.
    """

    path: Path
    inode: int
    group: str
    runs: NDArray[Any]
    known: Mapping[str, NDArray[Any]]
    computed: Mapping[str, StoredColumn]
    attributes: Mapping[str, Any]

    def column(self, name: str) -> NDArray[Any]:
        """(rows, ...) A column, or a scale; a computed one as it lies in the file, read where it is indexed. Raises
        StoreError where there is none of that name."""
        if name == "run":
            return self.runs
        if name in self.known:
            return self.known[name]
        if name not in self.computed:
            raise StoreError(f"{self.path}: does not hold {name}; allowed: a sweep whose outputs have it")
        stored = self.computed[name]
        if not all(stored.shape):
            return np.empty(stored.shape, stored.kind)
        with files.reading(self.path, name):
            values: NDArray[Any] = np.memmap(self.path, stored.kind, "r", stored.offset, stored.shape)
        return values

    def statuses(self) -> NDArray[np.int8]:
        """(rows,) of those that are there as they were written; MISSING for the others."""
        marked, place = np.array(self.column("status")), self.place()
        statuses = np.full_like(marked, MISSING)
        step = max(_READ_BYTES // place.row.itemsize, 1)
        for start in range(0, len(marked), step):
            status, part = marked[start : start + step], place.at(start)
            if (status == MISSING).all():
                continue
            rows = part.read(len(status))
            is_right = checksums(part.first, rows, part.row) == rows["crc32"]
            statuses[start : start + step] = np.where(is_right & (status < len(STATUSES)), status, MISSING)
        return statuses

    def place(self, row: int = 0) -> Place:
        """Where the rows from `row` on are. Their checksums begin with the run where that is a number, else the row."""
        first = int(self.runs[0]) if self.runs.dtype.kind == "i" and len(self.runs) else 0
        columns = {name: stored for name, stored in self.computed.items() if stored.is_of_runs}
        kinds = np.dtype([(name, stored.kind, stored.shape[1:]) for name, stored in columns.items()])
        return Place(self.path, self.inode, first, {name: stored.offset for name, stored in columns.items()}, kinds).at(
            row
        )


def stored_table(file: Any, group: str = "") -> StoredTable:
    """A table in an open file. Raises StoreError where what was laid out has changed since."""
    path, item = Path(file.filename), file[group] if group else file
    _refuse_changes(item, group)
    computed_names = files.computed_in(files.stored_digests(item))
    attributes = files.attributes_of(item)
    of_reference = attributes.pop(_OF_REFERENCE, [])
    known: dict[str, NDArray[Any]] = {}
    computed: dict[str, StoredColumn] = {}
    for name, dataset in item.items():
        if files.is_group(dataset):
            continue
        if name in computed_names:
            if dataset.shape is None or dataset.dtype.kind not in "fiuS":
                raise StoreError(f"{path}: {dataset.name} is no array of numbers or characters")
            offset = dataset.id.get_offset()
            if offset is None and dataset.size:
                raise StoreError(f"{path}: {dataset.name} is not contiguous; allowed: a file as it was laid out")
            computed[name] = StoredColumn(dataset.dtype, dataset.shape, offset or 0, name not in of_reference)
        elif name != CHARACTERS:
            known[name] = files.values_of(dataset)
    runs = known.pop("run")
    _refuse_shapes(path, runs, known, computed, str(item.name))
    return StoredTable(path, path.stat().st_ino, group, runs, known, computed, attributes)


def _refuse_shapes(
    path: Path,
    runs: NDArray[Any],
    known: Mapping[str, NDArray[Any]],
    computed: Mapping[str, StoredColumn],
    place: str,
) -> None:
    """Raises StoreError where a column has not the shape of its dimensions, which its digest does not cover, or not the
    type of its name, or reaches beyond the file."""
    size = path.stat().st_size
    for name, column in computed.items():
        head: tuple[int, ...] = (len(runs),) if column.is_of_runs else ()
        is_scalar = column.is_of_runs and name in COLUMNS and CHARACTERS not in COLUMNS[name].dimensions
        is_wrong = column.shape[: len(head)] != head or (is_scalar and column.shape != head)
        if is_scalar and column.kind != np.dtype(COLUMNS[name].kind):
            is_wrong = True
        lengths = {len(known[scale]) for scale in known if known[scale].ndim} | {3}
        if name not in COLUMNS and not set(column.shape[len(head) :]) <= lengths:
            is_wrong = True
        if column.offset + math.prod(column.shape) * column.kind.itemsize > size:
            is_wrong = True
        if is_wrong:
            raise StoreError(f"{path}: {place.rstrip('/')}/{name} has shape {column.shape} of {column.kind}; damaged")
    for name, values in known.items():
        if values.ndim == 0:
            raise StoreError(f"{path}: {place.rstrip('/')}/{name} is a single value; damaged")


def refuse_changed_layout(path: Path) -> None:
    """Raises StoreError where what is said of a table, its units too, is not what was laid out. Reading a table
    compares all of this but the attributes of computed columns, which take most of the time."""
    groups = table_groups(path)
    with files.open_file(path) as file, files.reading(path):
        for group in groups:
            _refuse_changes(file[group] if group else file, group, with_columns=True)


def _refuse_changes(item: Any, group: str, *, with_columns: bool = False) -> None:
    changed = files.damages_of(item, with_columns=with_columns)
    if changed:
        place = f"{item.file.filename}: {group or 'file'}"
        raise StoreError(f"{place}: {', '.join(changed)} changed after the file was laid out")


def as_table(file: Any, group: str) -> Table:
    """What would lay out a table of an open file anew."""
    stored, item = stored_table(file, group), file[group] if group else file
    columns = files.columns_of(item)
    known = {name: (columns[name], values) for name, values in stored.known.items()}
    computed = {name: columns[name] for name in stored.computed}
    attributes = {name: value for name, value in stored.attributes.items() if group}
    characters = len(item[CHARACTERS]) if CHARACTERS in item else 0
    return Table(group, stored.runs.tolist(), known, computed, attributes, characters)


def table_groups(path: Path) -> list[str]:
    """The groups of a file that are tables. Raises StoreError where it is another program's."""
    with files.open_file(path) as file, files.reading(path):
        _refuse_changes(file, "")
        return [str(group.name).strip("/") for group in files.groups_in(file) if "run" in group]


RUNS = "runs"
# What a frozen reference stores: it cannot be computed again from angles and rates as precisely.
FROZEN = ("angles", "rates", "work", *(load.name for load in LOADS), "angle_uncertainty", "error_growth")
_ONCE_A_SCENE = ("angle_uncertainty", "error_growth")  # stored once a scene, over time
# What a method that is no reference says of itself under such a name: its name in the file.
OF_METHODS = {"angle_uncertainty": "own_uncertainty"}
_TEXT_LENGTH = 600  # characters of a message

_RUN_COLUMNS = (
    "status", "message", "samples", "time_reached", "time_limit_s", "steps", "rhs_evaluations", "setup_time_s",
    "run_time_s", "run_time_min_s", "output_time_s", "repeats", "engine_success", "engine_message", "false_success",
    "energy_scale_J", "energy_drift_max", "energy_gain_J", "angle_error_max", "angle_error_predicted",
    "angle_error_whole", "angle_error_end", "horizon_s", "defect_max", "defect_median", "defect_time",
    "defect_judged", "defect_mean", "defect_drift", "defect_floor", "defects_not_judged",
    "angular_impulse_error_max", "linear_impulse_error_max",
    "zero_pitch_max", "zero_pitch_left_s", "zero_pitch_growth_per_s", "rotor_angle_min", "rotor_angle_max",
    "rotor_rate_max",
)  # fmt: skip


@dataclass(frozen=True)
class Asked:
    """A run as it is asked for: a row of the design.

    versions: of what computes it, by default those of this installation; of a reference that is read from a shipped
    file also who computed it (`frozen_with`).
    """

    scene: Scene
    method: str
    settings: Mapping[str, object] = field(default_factory=dict)
    versions: Mapping[str, str] | None = None

    @property
    def is_shipped(self) -> bool:
        return self.versions is not None and "frozen_with" in self.versions

    @property
    def run(self) -> str:
        """The label of its row, "paper/fig11/lagrange/taylor"."""
        return f"{self.scene.name}/{self.method}"

    @property
    def known(self) -> dict[str, str]:
        """The columns of /runs that follow from the design."""
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
    """The computed columns of /runs for scenes that ask for these outputs."""
    columns = {name: COLUMNS[name] for name in _RUN_COLUMNS}
    for quantity in quantities(outputs):
        name, long_name = quantity.name, quantity.long_name
        if quantity.judgement is not None:
            unit = "1" if quantity.judgement.scale_of else quantity.units
            extreme = "largest error" if quantity.judgement.with_reference else "maximum"
            columns[quantity.judgement.metric] = Column(("run",), unit, f"{long_name}: {extreme}")
        if quantity.has_peak:
            columns[f"{name}_max"] = Column(("run",), quantity.units, f"{long_name}: maximum")
            columns[f"{name}_max_time_s"] = Column(("run",), "s", f"{long_name}: time of the maximum")
            if quantity.dimensions[1:2] == ("blade",):
                columns[f"{name}_max_blade"] = Column(("run",), "1", f"{long_name}: blade of the maximum, from 1")
    return columns | {"crc32": COLUMNS["crc32"]}


def runs_table(asked: Sequence[Asked]) -> Table:
    outputs = dict.fromkeys(output for run in asked for output in run.scene.outputs)
    known = known_columns([run.known for run in asked])
    return Table(RUNS, [run.run for run in asked], known, metric_columns(outputs), characters=_TEXT_LENGTH)


def arrays_of(run: Asked) -> dict[str, Column]:
    """The arrays over time that a run stores, by their name in the file."""
    method = find_method(run.method)
    own = method.arrays(method.settings.of(run.method, run.settings))
    # A reference is read back by its angles and rates, whatever the scene asks for.
    outputs = (*run.scene.outputs, "angles", "rates") if run.method == REFERENCE else run.scene.outputs
    columns = {}
    for quantity in quantities(outputs):
        if not quantity.is_over_time or not (quantity.required or quantity.name in own):
            continue
        if quantity.name in _ONCE_A_SCENE and run.method == REFERENCE:
            columns[quantity.name] = Column(quantity.dimensions, quantity.units, quantity.long_name)
        else:
            name = OF_METHODS.get(quantity.name, quantity.name)
            columns[name] = Column(("run", *quantity.dimensions), quantity.units, quantity.long_name)
    return columns


def scene_table(runs: Sequence[Asked], arrays: Collection[str] | None = None) -> Table:
    """The table of the arrays of one scene's runs. arrays: names of those that are stored, by default all."""
    scene = runs[0].scene
    computed = {
        name: column for run in runs for name, column in arrays_of(run).items() if arrays is None or name in arrays
    }
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
    repeated = {name: COLUMNS[name] for name in REPEATED}
    return Table(scene.name, [run.method for run in runs], scales, repeated | computed, attributes)


def results_tables(asked: Sequence[Asked]) -> list[Table]:
    asked = sorted(asked, key=lambda run: _order(run.run))
    by_scene: dict[str, list[Asked]] = {}
    for run in asked:
        by_scene.setdefault(run.scene.name, []).append(run)
    return [
        runs_table(asked),
        *(scene_table(runs) for runs in by_scene.values()),
    ]


# Making a file fit what is asked


class TableFile:
    """A file of tables whose rows are read and written by their places. Tables are read when they are asked for."""

    def __init__(self, path: Path) -> None:
        self.path = path
        self._tables: dict[str, StoredTable] = {}

    def table(self, group: str) -> StoredTable:
        """A table. Raises StoreError where the file has none of that name, or what was laid out has changed."""
        if group not in self._tables:
            with files.open_file(self.path) as file, files.reading(self.path):
                self._tables[group] = stored_table(file, group)
        return self._tables[group]

    @functools.cached_property
    def groups(self) -> list[str]:
        return table_groups(self.path)

    def place(self, run: str, group: str = RUNS) -> Place:
        """Where a row is; of a run, together with its arrays."""
        stored = self.table(group)
        row = stored.runs.tolist().index(run)
        place = stored.place(row)
        if group != RUNS:
            return place
        scene = str(stored.known["scene"][row])
        arrays = self.table(scene)
        label = run.removeprefix(f"{scene}/")
        others = arrays.place(arrays.runs.tolist().index(label))
        offsets = {REPEATED.get(name, name): offset for name, offset in others.offsets.items()}
        kinds = [(REPEATED.get(name, name), others.row[name]) for name in others.row.names or ()]
        for name, column in arrays.computed.items():
            if label == REFERENCE and not column.is_of_runs:
                offsets[name] = column.offset
                kinds.append((name, np.dtype((column.kind, column.shape))))
        own = [(name, place.row[name]) for name in place.row.names or ()]
        return replace(place, offsets={**place.offsets, **offsets}, row=np.dtype([*own, *kinds]))

    def known(self, group: str, row: int) -> dict[str, Any]:
        return {name: values[row] for name, values in self.table(group).known.items()}

    def take_back_missing(
        self, asked: Sequence[Asked], time_limit_s: float
    ) -> tuple[list[Asked], list[tuple[Asked, str, str]]]:
        """The runs that are to be computed, and those that are stored with their status and message; of `asked` runs,
        of each scene the reference first.

        To be computed are those that the file lacks, that a shorter time limit ended, or whose reference is one of
        these; what is stored of them is taken back.
        """
        missing: dict[str, Asked] = {}
        kept: list[tuple[Asked, str, str]] = []
        for run in asked:
            place = self.place(run.run)
            row = place.read()
            status = STATUSES[row["status"][0]] if place.is_stored else ""
            # A shipped reference may end early itself; it has a limit only where reading it was over one.
            limit = row["time_limit_s"][0]
            is_short = limit < time_limit_s if run.is_shipped else not limit >= time_limit_s
            is_over = status == "timed_out" and is_short
            if status and not is_over and f"{run.scene.name}/{REFERENCE}" not in missing:
                kept.append((run, status, text_of(row["message"][0])))
            else:
                missing[run.run] = run
                place.mark_missing([0])
        return list(missing.values()), kept


def extend_file(path: Path, wanted: Sequence[Table], replaced: Collection[tuple[str, str, str]] = ()) -> TableFile:
    """Make the file hold the rows of `wanted` tables, beside those that it has.

    replaced: (group, scene, curve or method) of stored rows that go where they are not wanted.

    Where the file has all rows as they are asked for, nothing is written. Else a file is laid out beside it, the rows
    that stay are copied, and it takes the place of the old one. A row of which anything in the design differs
    (settings, versions, the scene's numbers) is missing afterwards. Raises InputError where runs of a scene that has
    other numbers by now would be dropped and not computed again, StoreError where the file cannot be read or written,
    or is a sweep's.
    """
    if path.is_symlink():  # a link stays one
        path = path.resolve()
    if not path.exists():
        _write_tables(path, wanted, [])
        return TableFile(path)
    old, new = TableFile(path), {made.group: made for made in wanted}
    if "" in old.groups:
        raise StoreError(f"{path}: holds the dataset of a sweep; allowed: another output file")
    with files.open_file(path) as file, files.reading(path):
        stored = {group: as_table(file, group) for group in old.groups}
    wanted_runs = _known_rows(new.get(RUNS))
    hashes = {row["scene"]: row["scene_hash"] for row in wanted_runs.values()}
    lost = [
        f"{path}: {row['scene']}: has {row['method_name']} of a scene of that name with other numbers, which this call "
        "would drop; allowed: another output file, or a call that has this method too"
        for run, row in _known_rows(stored.get(RUNS)).items()
        if hashes.get(row["scene"], row["scene_hash"]) != row["scene_hash"] and run not in wanted_runs
    ]
    if lost:
        raise InputError(lost)
    merged: dict[str, Table] = {}
    kept: list[tuple[str, str]] = []
    for group in dict.fromkeys((*stored, *new)):
        before, made = stored.get(group), new.get(group)
        base = made or stored[group]
        if "crc32" not in base.computed:
            continue
        asked = _known_rows(made)
        rows = {
            run: row
            for run, row in _known_rows(before).items()
            if run in asked or (group, row["scene"], row.get("curve", row["method_name"])) not in replaced
        }
        kept += [(group, run) for run in rows if run not in asked or _is_same(rows[run], asked[run])]
        rows |= asked
        if rows:
            runs = sorted(rows, key=_order) if group == RUNS else list(rows)
            known = {name: (column, [rows[run][name] for run in runs]) for name, (column, _) in base.known.items()}
            merged[group] = replace(base, runs=runs, known=known, computed=_joined(before, made))
    methods: dict[str, list[str]] = {}  # by scene
    if RUNS in merged:
        for run, scene in zip(merged[RUNS].runs, merged[RUNS].known["scene"][1], strict=True):
            methods.setdefault(scene, []).append(str(run).removeprefix(f"{scene}/"))
    for scene, own in methods.items():
        before, made = stored.get(scene), new.get(scene)
        if before is not None and made is not None and before.attributes["scene_hash"] != made.attributes["scene_hash"]:
            before = None
        merged[scene] = replace(made or stored[scene], runs=own, computed=_joined(before, made))
    is_same = merged.keys() == stored.keys() and all(
        list(made.runs) == list(stored[group].runs) and made.computed.keys() == stored[group].computed.keys()
        for group, made in merged.items()
    )
    if is_same and len(kept) == sum(len(made.runs) for made in stored.values() if "crc32" in made.computed):
        return old
    places = [(group, run, old.place(run, group)) for group, run in kept]
    rows_kept = [(group, run, place.read()) for group, run, place in places if place.is_stored]
    _write_tables(path, list(merged.values()), rows_kept)
    return TableFile(path)


def _known_rows(made: Table | None) -> dict[str, dict[str, Any]]:
    """By run, what the design says of it."""
    if made is None:
        return {}
    columns = {name: list(values) for name, (_, values) in made.known.items()}
    return {str(run): {name: values[i] for name, values in columns.items()} for i, run in enumerate(made.runs)}


def _is_same(stored: Mapping[str, Any], asked: Mapping[str, Any]) -> bool:
    """Whether a row is as it is asked for; a number that it does not have is NaN in both."""
    return stored.keys() == asked.keys() and all(
        value == asked[name] or (value != value and asked[name] != asked[name]) for name, value in stored.items()
    )


def _joined(before: Table | None, made: Table | None) -> dict[str, Column]:
    """The computed columns of both, the checksum last."""
    columns = {**(before.computed if before else {}), **(made.computed if made else {})}
    checksum = columns.pop("crc32", None)
    return columns if checksum is None else {**columns, "crc32": checksum}


def _order(run: str) -> tuple[Any, ...]:
    """Scenes in natural order; of each the reference, then methods in the order of the catalogue."""
    scene, method = (run.removesuffix(f"/{REFERENCE}"), REFERENCE) if run.endswith(f"/{REFERENCE}") else (
        "/".join(run.split("/")[:-2]), "/".join(run.split("/")[-2:])
    )  # fmt: skip
    names = [REFERENCE, *method_names()]
    return natural_key(scene), names.index(method) if method in names else len(names), method


def _write_tables(path: Path, tables: Sequence[Table], rows: Sequence[tuple[str, str, Rows]]) -> None:
    """A new file with these tables; of its rows those that are given, the others blank."""
    created = datetime.now(UTC).isoformat(timespec="seconds")
    count, scenes = 0, set[str]()
    others = sorted(made.group for made in tables if made.group != RUNS and "crc32" in made.computed)
    for made in tables:
        if made.group == RUNS:
            count, scenes = len(made.runs), set(made.known["scene"][1])
    summary = f"runs: {count}, scenes: {len(scenes)}; trajectories, energies, status and errors"
    if others:
        summary += f"; tables {', '.join(others)}"
    described = {"title": "Rotor models compared", "summary": summary, "keywords": KEYWORDS}  # as ACDD asks for them
    attributes = {**described, **versions(), **machine(), "created": created, "date_created": created}
    with laid_out(path, tables, attributes) as temporary:
        file = TableFile(temporary)
        given = {(group, run): values for group, run, values in rows}
        for made in tables:
            for run in made.runs if "crc32" in made.computed else ():
                place = file.place(str(run), made.group)
                values = given.get((made.group, str(run)))
                if values is None:
                    place.clear()
                else:
                    blank = blank_rows(1, place.row)
                    place.write({name: values.get(name, blank[name]) for name in place.row.names or ()})


# The rows of a run


def row_of_run(run: Solution, place: Place, facts: Mapping[str, object]) -> Rows:
    """The row of a run: status, metrics, times, arrays. facts: further columns by name."""
    integration = run.integration
    arrays = dict(run.quantities)
    if run.method == REFERENCE:
        arrays |= {"angles": run.angles, "rates": run.rates}
    else:
        arrays = {OF_METHODS.get(name, name): array for name, array in arrays.items()}
    return place.rows_of(
        {
            "status": run.status,
            "message": run.message,
            "engine_message": integration.message,
            "samples": len(run.time),
            "time_reached": integration.time_reached,
            "steps": -1 if integration.steps is None else integration.steps,
            "rhs_evaluations": -1 if integration.rhs_evaluations is None else integration.rhs_evaluations,
            "engine_success": int(integration.success),
            "setup_time_s": run.setup_time_s,
            "run_time_s": float(np.median(run.run_times_s)),
            "run_time_min_s": min(run.run_times_s),
            "output_time_s": run.output_time_s,
            "repeats": len(run.run_times_s),
            **run.metrics,
            **facts,
            **arrays,
        }
    )
