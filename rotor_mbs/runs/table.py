"""Tables of runs in an HDF5 file, each its own journal: laid out first, rows filled in place, the status of a row last.

    /runs                 a row per run of the file: scene, method, settings, status, metrics
    /paper/fig11          the arrays of a scene: dimensions run, time, ...
    /bench, /stability    a row per point
    /                     of a sweep's file: one table

All space is taken when a file is laid out. From then on no HDF5 metadata changes, so that the file is valid and can be
read at every moment. The bytes of a row are written to their offsets, its status after a sync: a row is stored where
its status is not -1 and its checksum is right. What the design says of a row (its scene, method, settings, versions) is
written with the layout and covered by the digest in the file's trailer (`runs.trailer`).

An HDF5 handle that is open while rows are written reads old values, and one that writes would destroy them: nothing is
written by the HDF5 library after the layout.
"""

from __future__ import annotations

import copy
import errno
import functools
import io
import itertools
import json
import math
import os
import threading
import time
import zlib
from collections.abc import Collection, Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager, nullcontext, suppress
from dataclasses import dataclass, field, replace
from datetime import UTC, datetime
from pathlib import Path
from typing import IO, Any, NamedTuple, TypeVar

import h5py
import numpy as np
from numpy.typing import NDArray

from rotor_mbs.errors import InputError, StoreError
from rotor_mbs.methods.catalogue import REFERENCE, method_names
from rotor_mbs.runs.design import (
    CHARACTER,
    COLUMNS,
    KNOWN,
    MISSING,
    NUMBERS,
    ONCE_A_SCENE,
    POINT_COLUMNS,
    REPEATED,
    RUNS,
    Asked,
    arrays_of,
    metric_columns,
)
from rotor_mbs.runs.hdf5 import (
    CHARACTERS,
    TEXT,
    TEXT_IN_MEMORY,
    TEXT_TYPE,
    WITHOUT_VALUES,
    Column,
    StoredGroup,
    attribute,
    is_dimension_only,
    is_group,
    place_of,
    read_content,
    reading,
    reason_of,
)
from rotor_mbs.runs.output_files import locked, replacing, store_errors, write_file
from rotor_mbs.runs.trailer import (
    FORMAT_VERSION,
    INTEGRITY,
    RESULTS,
    SWEEP,
    digest_of,
    may_extend,
    read_trailer,
    trailer_of,
)
from rotor_mbs.runs.untrusted import trust
from rotor_mbs.runs.versions import machine, versions
from rotor_mbs.scenario.catalogue import natural_key
from rotor_mbs.scenario.scene import Scene, scene_hash
from rotor_mbs.solution.quantities import SCALES, scale_values
from rotor_mbs.solution.status import STATUSES, code_of
from rotor_mbs.solution.trajectory import Solution

FORMAT = "rotor_mbs"
CONVENTIONS = "CF-1.11, ACDD-1.3"
# What every file is about: the attribute `keywords` of the ACDD conventions.
KEYWORDS = "multibody dynamics, wind turbine rotor, Euler-Lagrange equations, model verification"
IDENTITY = "sweep_identity"  # the attribute of a sweep's file with a hash of all that the design says
_HEAD_BYTES = 1 << 17  # of a file beside its rows, at most: descriptions and texts
_READ_BYTES = 1 << 25  # read at once when checksums are verified
_LONGEST_LABEL = 1000  # characters; names of files are shorter
_TEXT_LENGTH = 600  # characters of a message

# What says how an array of another program is to be read.
ARRAY_ATTRIBUTES = ("units", "unit", "scale_factor", "add_offset", "_FillValue", "missing_value", "_Unsigned")
_MAX_MEMBERS = 1000  # of a group, that are listed with what they are

T = TypeVar("T")
# (rows, ...) arrays by the name of their dataset.
Rows = dict[str, NDArray[Any]]


@dataclass(frozen=True)
class Table:
    """A table: as it is to be laid out, or as it lies in a file.

    Attributes
    ----------
    group : where it stands in the file; "" for the root.
    runs : (rows,) the scale `run`: texts that tell the rows apart, or their numbers.
    known : by name, column and values of the other dimensions' scales, and of what the design says of each row.
    computed : columns that are computed, in the order in which the checksum of a row covers them. One without the
        dimension `run` belongs to the reference.
    attributes : of the group.
    characters : of each computed text.
    path, inode, offsets : of a table in a file: the file, and where each computed column begins in it, in bytes.
    """

    group: str
    runs: Sequence[str] | NDArray[Any]
    known: Mapping[str, tuple[Column, Any]]
    computed: Mapping[str, Column]
    attributes: Mapping[str, Any] = field(default_factory=dict)
    characters: int = 0
    path: Path = Path()
    inode: int = 0
    offsets: Mapping[str, int] = field(default_factory=dict)

    @functools.cached_property
    def row_type(self) -> np.dtype[np.void]:
        """The computed columns of one row, in the order in which its checksum covers them."""
        lengths = {name: len(values) for name, (_, values) in self.known.items()} | {CHARACTERS: self.characters}
        shapes = {
            name: tuple(lengths[dimension] for dimension in column.dimensions if dimension != "run")
            for name, column in self.computed.items()
        }
        return np.dtype([(name, column.kind, shapes[name]) for name, column in self.computed.items()])

    def shape(self, name: str) -> tuple[int, ...]:
        """Of a computed column."""
        rows = (len(self.runs),) if "run" in self.computed[name].dimensions else ()
        return (*rows, *self.row_type[name].shape)

    @functools.cached_property
    def known_rows(self) -> Mapping[str, Mapping[str, Any]]:
        """By run, what the design says of it."""
        columns = {name: list(values) for name, (_, values) in self.known.items()}
        return {str(run): {name: values[i] for name, values in columns.items()} for i, run in enumerate(self.runs)}

    @functools.cached_property
    def row_of(self) -> Mapping[str, int]:
        """By run, the number of its row."""
        return {str(run): row for row, run in enumerate(self.runs)}

    def column(self, name: str) -> NDArray[Any]:
        """(rows, ...) A column, or a scale, of a table in a file; a computed one as it lies there, read where it is
        indexed. Raises StoreError where there is none of that name."""
        if name == "run":
            return np.asarray(self.runs)
        if name in self.known:
            return np.asarray(self.known[name][1])
        if name not in self.computed:
            raise StoreError(f"{self.path}: has no {name}; allowed: a sweep whose outputs have it")
        kind, shape = self.row_type[name].base, self.shape(name)
        if not all(shape):
            return np.empty(shape, kind)
        with reading(self.path, name), self.path.open("rb") as file:
            if os.fstat(file.fileno()).st_ino != self.inode:
                raise StoreError(f"{self.path}: has been replaced by another file")
            values: NDArray[Any] = np.memmap(file, kind, "r", self.offsets[name], shape)
        return values

    def statuses(self) -> NDArray[np.int8]:
        """(rows,) of those that are there as they were written; MISSING for the others."""
        marked, place = np.array(self.column("status")), self.place()
        statuses = np.full_like(marked, MISSING)
        step = max(_READ_BYTES // place.row_type.itemsize, 1)
        for start in range(0, len(marked), step):
            status, part = marked[start : start + step], place.at(start)
            if (status == MISSING).all():
                continue
            rows = part.read(len(status))
            is_right = checksums(part.first, rows, part.row_type) == rows["crc32"]
            is_known = (status >= 0) & (status < len(STATUSES))
            statuses[start : start + step] = np.where(is_right & is_known, status, MISSING)
        return statuses

    def clear(self) -> None:
        """Write blank rows, which a reader of an unfinished file sees; their statuses stay as they are."""
        with self.path.open("r+b") as file:
            for name, blank in blank_rows(1, self.row_type).items():
                if name != "status":
                    file.seek(self.offsets[name])
                    for _ in range(len(self.runs) if "run" in self.computed[name].dimensions else 1):
                        file.write(blank.data)

    def place(self, row: int = 0) -> Place:
        """Where the rows from `row` on are. Their checksums begin with the run where that is a number, else the row."""
        is_numbered = isinstance(self.runs, np.ndarray) and self.runs.dtype.kind == "i" and len(self.runs) > 0
        names = [name for name, column in self.computed.items() if "run" in column.dimensions]
        kinds = np.dtype([(name, self.row_type[name]) for name in names])
        offsets = {name: self.offsets[name] for name in names}
        return Place(self.path, self.inode, int(self.runs[0]) if is_numbered else 0, offsets, kinds).at(row)


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


def runs_table(asked: Sequence[Asked]) -> Table:
    """The table /runs of a file with these runs."""
    outputs = dict.fromkeys(output for run in asked for output in run.scene.outputs)
    known = known_columns([run.known for run in asked])
    return Table(RUNS, [run.label for run in asked], known, metric_columns(outputs), characters=_TEXT_LENGTH)


def scene_table(runs: Sequence[Asked], arrays: Collection[str] | None = None) -> Table:
    """Return the table of the arrays of one scene's runs. arrays: names of those that are stored, by default all."""
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
    """All tables of a file with these runs: /runs, then the arrays of each scene."""
    asked = sorted(asked, key=lambda run: _order(run.label))
    by_scene: dict[str, list[Asked]] = {}
    for run in asked:
        by_scene.setdefault(run.scene.name, []).append(run)
    return [
        runs_table(asked),
        *(scene_table(runs) for runs in by_scene.values()),
    ]


@dataclass(frozen=True)
class Place:
    """Where consecutive rows lie in a file. Worker processes that see the file write them by it.

    inode: of the file; another file of that name is not written to. first: number of the first row; its checksum begins
    with it. offsets: bytes from the beginning of the file to the first row, by column. row_type: its columns
    are in the order in which the checksum covers them.
    """

    path: Path
    inode: int
    first: int
    offsets: Mapping[str, int]
    row_type: np.dtype[np.void]

    def rows_of(self, values: Mapping[str, object], count: int = 1) -> Rows:
        """Return rows with these values, the same in each, by the name of their column: numbers, a text, the name of a
        status, the first samples of an array. The other columns are blank; what is no column here is left out."""
        rows = blank_rows(count, self.row_type)
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
        offsets = {name: offset + row * self.row_type[name].itemsize for name, offset in self.offsets.items()}
        return replace(self, first=self.first + row, offsets=offsets)

    def write(self, rows: Rows) -> None:
        """Store consecutive rows, their statuses last; meanwhile they are missing. Raises StoreError."""
        columns = rows | {"crc32": checksums(self.first, rows, self.row_type)}
        statuses = {name: columns.pop(name) for name in (REPEATED["status"], "status") if name in columns}
        with store_errors(self.path), self.path.open("r+b") as file:
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
            for name in self.row_type.names or ():
                kind = self.row_type[name]
                source.seek(self.offsets[name])
                content = source.read(count * kind.itemsize)
                rows[name] = np.frombuffer(content, kind.base).reshape(count, *kind.shape)
        return rows

    @property
    def is_stored(self) -> bool:
        """Whether the first row is there as it was written."""
        row = self.read()
        is_known = 0 <= row["status"][0] < len(STATUSES)
        return bool(is_known and checksums(self.first, row, self.row_type)[0] == row["crc32"][0])

    def mark_missing(self, rows: Collection[int]) -> None:
        """Take back the statuses of some rows, counted from the first, before they are computed again."""
        with store_errors(self.path), self.path.open("r+b") as file:
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


# The rows of a run


def row_of_run(run: Solution, place: Place, facts: Mapping[str, object]) -> Rows:
    """Return the row of a run: status, metrics, times, arrays. facts: further columns by name."""
    integration, run_times_s = run.integration, run.run_times_s or [math.nan]
    # A reference is read back by its angles and rates, whatever the scene asks for.
    own = {"angles": run.angles, "rates": run.rates} if run.method == REFERENCE else {}
    return place.rows_of(
        {
            "status": run.status,
            "message": run.message,
            "engine_message": integration.message,
            "samples": len(run.time),
            "time_reached": float(run.time[-1]) if len(run.time) else 0.0,
            "steps": -1 if integration.steps is None else integration.steps,
            "rhs_evaluations": -1 if integration.rhs_evaluations is None else integration.rhs_evaluations,
            "engine_success": int(integration.success),
            "setup_time_s": run.setup_time_s,
            "run_time_s": float(np.median(run_times_s)),
            "run_time_min_s": min(run_times_s),
            "output_time_s": run.output_time_s,
            "repeats": len(run.run_times_s),
            **run.metrics,
            **facts,
            **run.quantities,
            **own,
        }
    )


# Laying out


@contextmanager
def laid_out(path: Path, tables: Sequence[Table], attributes: Mapping[str, object]) -> Iterator[TableFile]:
    """Yield a new file with room for all rows, under a temporary name; after the block it is complete under its name,
    or not there.

    Its space is reserved twice: HDF5 does not survive a disk that fills up under it, and truncates the file it begins.
    Raises StoreError.

    Parameters
    ----------
    path : of the file.
    tables : as they are to be laid out.
    attributes : of the file.
    """
    with replacing(path) as temporary:
        rows = sum(len(table.runs) * (table.row_type.itemsize + 8 * (4 + len(table.known))) for table in tables)
        _reserve(temporary, _HEAD_BYTES + rows)
        with begin_file(temporary) as file:
            put_attributes(file, attributes)
            rows_of = {table.group: _put_table(file, table) for table in tables}
        kind = SWEEP if "" in rows_of else RESULTS
        with temporary.open("r+b") as laid:
            trailer = trailer_of(laid, kind, rows_of)
            trust(digest_of(trailer))
            laid.seek(0, os.SEEK_END)
            laid.write(trailer)
        _reserve(temporary, temporary.stat().st_size)
        # All that a reader would find is known here: reading it back would take longer than writing it.
        inode = temporary.stat().st_ino
        laid_tables = []
        for table in tables:
            offsets = {name: offset for name, (offset, _) in rows_of[table.group].items()}
            known = {name: (column, _as_stored(values)) for name, (column, values) in table.known.items()}
            runs = _as_stored(table.runs)
            laid_tables.append(replace(table, runs=runs, known=known, path=temporary, inode=inode, offsets=offsets))
        yield TableFile(temporary, laid_out_as=(attributes, laid_tables))


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


def _put_table(file: Any, table: Table) -> dict[str, tuple[int, int]]:
    """Offset and length in bytes of its computed columns."""
    group = new_group(file, table.group) if table.group else file
    put_attributes(group, table.attributes)
    put(group, "run", table.runs, Column(("run",), "1", "name or number of the run"))
    if table.characters:
        put_dimension(group, CHARACTERS, table.characters)
    for name, (column, values) in table.known.items():
        put(group, name, values, column)
    rows = {}
    for name, column in table.computed.items():
        kind, shape = table.row_type[name].base, table.shape(name)
        dataset = put_empty(group, name, shape, kind, column, MISSING if name == "status" else None)
        rows[name] = place_of(dataset)
    return rows


def begin_file(place: Path | str, **driver: object) -> Any:
    """A new HDF5 file with the attributes of the format; on the disk, where it must not fill up, without a `driver`."""
    file = h5py.File(place, "w", libver=("earliest", "v108"), track_order=True, **driver)
    file.attrs["Conventions"] = CONVENTIONS
    file.attrs["format"] = FORMAT
    file.attrs["format_version"] = FORMAT_VERSION
    file.attrs["integrity"] = INTEGRITY
    return file


def new_group(parent: Any, name: str) -> Any:
    """A group, and those above it, that list their members in the order of writing."""
    for part in name.split("/"):
        parent = parent[part] if part in parent else parent.create_group(part, track_order=True)
    return parent


def put(group: Any, name: str, values: Any, column: Column) -> Any:
    """A dataset of numbers or texts. The scales of its dimensions must be there; a scale is its own dimension."""
    return _described(group.create_dataset(name, data=_as_stored(values)), group, name, column)


def _as_stored(values: Any) -> NDArray[Any]:
    """Return numbers or texts as a reader of the file gets them."""
    is_text = len(values) > 0 and isinstance(values[0], str)
    return np.array(list(values), dtype=TEXT) if is_text else np.asarray(values)


def _described(dataset: Any, group: Any, name: str, column: Column) -> Any:
    put_attributes(dataset, {"units": column.units, "long_name": column.long_name, **column.attributes})
    for axis, dimension in enumerate(column.dimensions):
        if dimension == name:
            dataset.make_scale(dimension)
        else:
            h5py.h5ds.attach_scale(dataset.id, h5py.h5d.open(group.id, dimension.encode()), axis)
    return dataset


def put_dimension(group: Any, name: str, length: int) -> None:
    """A dimension without values, as the netCDF-4 library has them."""
    scale = group.create_dataset(name, (length,), ">f4")
    scale.make_scale(f"{WITHOUT_VALUES}{length:10d}")


def put_empty(group: Any, name: str, shape: tuple[int, ...], kind: Any, column: Column, fill: int | None = None) -> Any:
    """A contiguous dataset that has its place in the file now and is written by others; fill: its first value, by
    default what the file system makes of a new file, zeros."""
    layout = h5py.h5p.create(h5py.h5p.DATASET_CREATE)
    layout.set_layout(h5py.h5d.CONTIGUOUS)
    layout.set_obj_track_times(False)  # the same call gives the same bytes
    layout.set_alloc_time(h5py.h5d.ALLOC_TIME_EARLY)
    layout.set_fill_time(h5py.h5d.FILL_TIME_NEVER if fill is None else h5py.h5d.FILL_TIME_ALLOC)
    if fill is not None:
        layout.set_fill_value(np.array(fill, kind))
    dataset = _described(group.create_dataset(name, shape, kind, dcpl=layout), group, name, column)
    if np.dtype(kind).kind == "S":
        dataset.attrs["_Encoding"] = "utf-8"
    return dataset


def put_attributes(target: Any, values: Mapping[str, object]) -> None:
    """Write attributes that are not there: numbers as float64 or int64, truth as int8 (netCDF-4 has no booleans), lists
    of names as strings."""
    for name, value in values.items():
        if isinstance(value, str):
            # Nearly all are single texts, which the general way writes three times slower.
            stored = h5py.h5a.create(target.id, name.encode(), TEXT_TYPE, h5py.h5s.create(h5py.h5s.SCALAR))
            stored.write(np.array(value, TEXT), mtype=TEXT_IN_MEMORY)
        elif isinstance(value, bool):
            target.attrs[name] = np.int8(value)
        elif isinstance(value, (list, tuple)):
            target.attrs.create(name, list(value), dtype=TEXT)
        else:
            target.attrs[name] = value


# Reading


def parsed(text: object, kind: type[T], place: object) -> T:
    """The value of a JSON text, of this type. Raises StoreError: a file may hold anything."""
    try:
        value = json.loads(str(text))
    except (ValueError, RecursionError):
        value = None
    if not isinstance(value, kind):
        raise StoreError(f"{place}: {str(text)[:50]!r} is no JSON text of a {kind.__name__}; damaged")
    return value


class TableFile:
    """The tables of a file, by their groups; rows are read and written by their places.

    only: groups of the tables that are read, by default all. laid_out_as: attributes and all tables of a file that was
    just laid out, which is not read. Raises StoreError where the file cannot be read, or what was laid out has changed
    since.
    """

    def __init__(
        self,
        path: Path,
        only: Collection[str] | None = None,
        *,
        laid_out_as: tuple[Mapping[str, Any], Sequence[Table]] | None = None,
    ) -> None:
        self.path = path
        self.attributes: dict[str, Any] = {}
        self.groups: list[str] = []
        self.tables: dict[str, Table] = {}
        if laid_out_as is None:
            self.read(only)
        else:
            attributes, tables = laid_out_as
            self.attributes = dict(attributes)
            self.tables = {table.group: table for table in tables}
            self.groups = list(self.tables)

    def read(self, only: Collection[str] | None = None) -> None:
        """Read further tables of the file, by default all that have not been read."""
        if self.tables:
            missing = set(self.groups) - set(self.tables)
            only = missing if only is None else missing & set(only)
            if not only:
                return
        content = read_content(self.path, (RESULTS, SWEEP), only)
        self.attributes = content.attributes
        self.groups = content.names
        with reading(self.path):
            for name, stored in content.groups.items():
                self.tables[name] = _table(self.path, name, stored, content.inode)
            self._check_runs()

    def copy(self) -> TableFile:
        """Return a copy with the same tables, to which others can be added, or from which they can be removed."""
        other = copy.copy(self)
        other.tables = dict(self.tables)
        return other

    def _check_runs(self) -> None:
        """Raises StoreError where a run has no arrays."""
        rows = self.tables[RUNS].known_rows if RUNS in self.tables else {}
        for run, row in rows.items():
            scene, method = row["scene"], row["method_name"]
            is_there = scene in self.groups and (scene not in self.tables or method in self.tables[scene].runs)
            if run != f"{scene}/{method}" or not is_there or len(run) > _LONGEST_LABEL:
                raise StoreError(f"{self.path}: {run[:_LONGEST_LABEL]} has no arrays; damaged")

    def place(self, run: str, group: str = RUNS) -> Place:
        """Return where a row is; of a run, together with its arrays."""
        stored = self.tables[group]
        row = stored.row_of[run]
        place = stored.place(row)
        if group != RUNS:
            return place
        scene = str(stored.column("scene")[row])
        arrays = self.tables[scene]
        label = run.removeprefix(f"{scene}/")
        others = arrays.place(arrays.row_of[label])
        offsets = {REPEATED.get(name, name): offset for name, offset in others.offsets.items()}
        kinds = [(REPEATED.get(name, name), others.row_type[name]) for name in others.row_type.names or ()]
        for name, column in arrays.computed.items():
            if label == REFERENCE and "run" not in column.dimensions:
                offsets[name] = arrays.offsets[name]
                kinds.append((name, arrays.row_type[name]))
        own = [(name, place.row_type[name]) for name in place.row_type.names or ()]
        return replace(place, offsets={**place.offsets, **offsets}, row_type=np.dtype([*own, *kinds]))


_opened: dict[tuple[Path, Path, tuple[int, ...]], TableFile] = {}
_opening = threading.Lock()  # held while `_opened` is used
_MAX_OPENED = 4  # files whose tables are kept
_SETTLED_NS = 100_000_000  # since the last write, which a clock's tick might hide


def opened_tables(path: Path, only: Collection[str] | None = None) -> TableFile:
    """Return the tables of a file, read once for this process as long as it is the same file.

    Rows are not kept, but what the layout says: descriptions, and the design of the runs.

    Parameters
    ----------
    path, only : see `TableFile`; the result may have further tables, which an earlier call asked for.
    """
    try:
        state = path.stat()
    except OSError:
        return TableFile(path, only)  # says what is wrong
    # The path as it is given, too: it stands in the tables' messages.
    stamp = (path, path.absolute(), (state.st_dev, state.st_ino, state.st_size, state.st_mtime_ns))
    with _opening:
        file = _opened.pop(stamp, None)
    if file is None:
        file = TableFile(path, only)
    else:
        file.read(only)
    is_settled = time.time_ns() - state.st_mtime_ns > _SETTLED_NS
    with suppress(OSError):  # removed meanwhile
        is_settled = is_settled and path.stat().st_mtime_ns == state.st_mtime_ns
        with _opening:
            if is_settled:
                _opened[stamp] = file
            while len(_opened) > _MAX_OPENED:
                del _opened[next(iter(_opened))]
    return file.copy()


def _table(path: Path, group: str, stored: StoredGroup, inode: int) -> Table:
    """Return the table of a group. Raises StoreError where it is not what was laid out, or is no table."""
    known = {name: (stored.columns[name], values) for name, values in stored.values.items()}
    computed = {name: stored.columns[name] for name in stored.rows}
    offsets = {name: rows.offset for name, rows in stored.rows.items()}
    _, runs = known.pop("run")
    table = Table(group, runs, known, computed, stored.attributes, stored.characters, path, inode, offsets)
    for name, column in computed.items():
        kind, shape, rows = np.dtype(column.kind), table.shape(name), stored.rows[name]
        is_wrong = rows.shape != shape or kind.kind not in "fiuS" or not rows.is_in_place
        if name in COLUMNS and name not in ONCE_A_SCENE:
            usual = COLUMNS[name]
            is_wrong = is_wrong or kind != np.dtype(usual.kind) or column.dimensions != usual.dimensions
        if is_wrong:
            raise StoreError(f"{path}: {group}/{name} has shape {rows.shape} of {kind}; damaged")
    _check(table)
    return table


# What every table of a kind has: computed columns; columns that the design says; attributes.
_ALWAYS: Mapping[str, tuple[Collection[str], Collection[str], Collection[str]]] = {
    "": (("status", "crc32"), (), ()),
    RUNS: (
        ("status", "message", "engine_message", "samples", "time_limit_s", "crc32"),
        ("scene", "method_name", "settings", "versions", "scene_hash"),
        (),
    ),
    **{group: (columns, ("scene", "method_name"), ()) for group, columns in POINT_COLUMNS.items()},
}
_OF_A_SCENE = (REPEATED, ("time",), ("title", "scene_toml", "scene_hash"))


def _check(table: Table) -> None:
    """Raise StoreError where a table lacks what every table of its kind has, or a column has another length.

    A digest can be right although another program wrote the file.
    """
    place = f"{table.path}: {table.group or 'file'}"
    computed, known, attributes = _ALWAYS.get(table.group, _OF_A_SCENE)
    for name in computed:
        if name not in table.computed:
            raise StoreError(f"{place}: has no {name}; damaged")
    columns = {"run": (Column(("run",), "", ""), np.asarray(table.runs)), **table.known}
    lengths = {name: len(values) for name, (_, values) in columns.items() if values.ndim}
    for name in known:
        if name not in columns:
            raise StoreError(f"{place}: has no {name}; damaged")
    for name, (column, values) in columns.items():
        if values.shape != tuple(lengths[dimension] for dimension in column.dimensions):
            raise StoreError(f"{place}/{name} has shape {values.shape}; damaged")
        is_text = name in KNOWN and name not in NUMBERS
        if is_text != (values.dtype.kind == "O") and name != "run":
            raise StoreError(f"{place}/{name} has values of another type; damaged")
        if name == "time" and not (np.isfinite(values).all() and (np.diff(values) > 0.0).all()):
            raise StoreError(f"{place}/time does not increase; damaged")
    if len(set(table.runs)) != len(table.runs):
        raise StoreError(f"{place}/run names a run twice; damaged")
    require_texts(table.attributes, attributes, place)


def require_texts(attributes: Mapping[str, object], names: Iterable[str], place: object) -> None:
    """Raises StoreError where one of these attributes is no text."""
    for name in names:
        if not isinstance(attributes.get(name), str):
            raise StoreError(f"{place}: its attribute {name} is no text; damaged")


def extend_file(path: Path, wanted: Sequence[Table], replaced: Collection[tuple[str, str, str]] = ()) -> TableFile:
    """Make the file hold the rows of `wanted` tables, beside those that it has.

    replaced: (group, scene, curve or method) of stored rows that go where they are not wanted.

    Where the file has all rows as they are asked for, nothing is written. Else a file is laid out beside it, the rows
    that stay are copied, and it takes the place of the old one. A row of which anything in the design differs
    (settings, versions, the scene's numbers) is missing afterwards. Raises InputError where runs of a scene that has
    other numbers by now would be dropped and not computed again, or the file holds something else, StoreError where it
    cannot be read or written.
    """
    if path.is_symlink():  # a link stays one
        path = path.resolve()
    if not may_extend(path, RESULTS):
        return _write_tables(path, wanted, [])
    old, new = TableFile(path), {made.group: made for made in wanted}
    stored = old.tables
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
    return _write_tables(path, list(merged.values()), rows_kept)


def copy_file(source: Path, target: Path) -> None:
    """Copy a file with tables; one at `target` is replaced where the copy has all its rows, and is of the same sweep.

    Raises InputError where rows would be lost, or `target` holds something else, StoreError where it is damaged, not
    this program's, or cannot be written.
    """
    with locked(target):
        if may_extend(target, read_trailer(source).kind):
            old, new = TableFile(target), TableFile(source)
            is_same = old.attributes.get(IDENTITY) == new.attributes.get(IDENTITY)
            for group, table in old.tables.items():
                copied = {str(run) for run in new.tables[group].runs} if is_same and group in new.tables else set()
                for run, status in zip(map(str, table.runs), table.column("status"), strict=True):
                    if status != MISSING and run not in copied:
                        raise InputError(
                            f"{target}: has {f'{group}: ' if group else 'run '}{run}, which would be lost; allowed: "
                            "another name, or remove that file"
                        )
        write_file(target, source.read_bytes())


def _known_rows(table: Table | None) -> Mapping[str, Mapping[str, Any]]:
    return {} if table is None else table.known_rows


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


def _write_tables(path: Path, tables: Sequence[Table], rows: Sequence[tuple[str, str, Rows]]) -> TableFile:
    """Write a new file with these tables; of its rows those that are given, the others blank."""
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
    with laid_out(path, tables, attributes) as file:
        for table in file.tables.values():
            table.clear()
        for group, run, values in rows:
            place = file.place(run, group)
            blank = blank_rows(1, place.row_type)
            place.write({name: values.get(name, blank[name]) for name in place.row_type.names or ()})
    # It is the same file under its name now.
    return TableFile(path, laid_out_as=(attributes, [replace(table, path=path) for table in file.tables.values()]))


# Other HDF5 files


@contextmanager
def new_file(path: Path, kind: str) -> Iterator[Any]:
    """Create an HDF5 file of a kind, put in the place of `path` when all of it is written and on the disk.

    It is made in memory: HDF5 does not survive a disk that fills up under it, a plain write does. Raises StoreError
    where the file cannot be written; what stood there before then still stands. Whether it may be replaced is decided
    before, by `may_extend`.
    """
    memory = {"driver": "core", "backing_store": False, "block_size": 1 << 20}
    with begin_file(f"{path.name}.{threading.get_ident()}", **memory) as file:
        yield file
        groups: dict[str, Mapping[str, tuple[int, int]]] = {place: {} for place in _groups_with_arrays(file)}
        file.flush()
        image = io.BytesIO(file.id.get_file_image())
    trailer = trailer_of(image, kind, groups)
    trust(digest_of(trailer))
    image.seek(0, io.SEEK_END)
    image.write(trailer)
    write_file(path, image.getbuffer())


def _groups_with_arrays(group: Any, place: str = "") -> Iterator[str]:
    """Yield the path of the group of each array below a group, in the order in which they were written."""
    for name, item in group.items():
        if is_group(item):
            yield from _groups_with_arrays(item, f"{place}/{name}" if place else name)
        else:
            yield place


class StoredArrays(NamedTuple):
    """The arrays of one group of any HDF5 file.

    Attributes
    ----------
    arrays : by name, of up to three dimensions, as they are stored.
    attributes : by name of the array those of `ARRAY_ATTRIBUTES` that it has, numbers and texts.
    others : by name what else is in the group, and what that is; whether it is a column of something else than numbers.
    """

    arrays: dict[str, NDArray[Any]]
    attributes: dict[str, dict[str, Any]]
    others: dict[str, tuple[str, bool]]


def read_arrays(path: Path, group: str = "", scene: str = "", max_bytes: float = math.inf) -> StoredArrays:
    """Read arrays of numbers of up to three dimensions and their attributes from one group of any HDF5 file.

    Parameters
    ----------
    path : the file; of another program, or of this one.
    group : path of the group, or the end of it, "/" for the root; may be left out where one group alone has arrays, or
        one alone but the reference below `scene`.
    scene : name of a scene, whose groups are preferred.
    max_bytes : of all arrays as float64, by what the file claims of them, before any is read.

    Raises
    ------
    StoreError
        If the file cannot be read or claims more, or with the groups that there are.
    """
    try:
        with h5py.File(path, "r") as file:
            places = _array_places(file)
            place = chosen_group(path, list(places), group, scene)
            chosen = file[place or "/"]
            datasets = {name: chosen[name] for name in places[place]}
            _refuse_claims(path, datasets.values(), max_bytes)
            arrays = {name: dataset[()] for name, dataset in datasets.items()}
            attributes = {name: _attributes_of_array(dataset) for name, dataset in datasets.items()}
            others = {}
            for name in itertools.islice(chosen, _MAX_MEMBERS):
                if name not in datasets:
                    others[name] = _what_it_is(chosen, name)
            for other in itertools.islice(places, _MAX_MEMBERS):
                if other != place and other.rpartition("/")[0] != place:
                    others[f"/{other}"] = ("another group", False)
    except (OSError, RuntimeError, KeyError, ValueError, TypeError) as exc:
        raise StoreError(f"{path}: not a readable HDF5 file ({reason_of(exc)})") from exc
    return StoredArrays(arrays, attributes, others)


def refuse_claims(path: Path, max_bytes: float) -> None:
    """Raise StoreError if an HDF5 file claims more than `max_bytes`, or has arrays that other files store."""
    datasets: list[Any] = []

    def note(_: str, item: Any) -> None:
        if isinstance(item, h5py.Dataset) and item.size:
            datasets.append(item)

    try:
        with h5py.File(path, "r") as file:
            file.visititems(note)
            _refuse_claims(path, datasets, max_bytes)
    except (OSError, RuntimeError, KeyError, ValueError, TypeError) as exc:
        raise StoreError(f"{path}: not a readable HDF5 file ({reason_of(exc)})") from exc


def _refuse_claims(path: Path, datasets: Iterable[Any], max_bytes: float) -> None:
    """Raise StoreError if datasets are larger than `max_bytes` in all, or stored in other files."""
    size = 0.0
    for dataset in datasets:
        size += 8.0 * dataset.size
        if dataset.is_virtual or dataset.external:
            raise StoreError(f"{path}: {dataset.name} is stored in another file; allowed: arrays of this one")
    if size > max_bytes:
        allowed = f"up to {max_bytes / 2**30:g} GB: export fewer rows or arrays"
        raise StoreError(f"{path}: its arrays claim {size / 2**30:.1f} GB; allowed: {allowed}")


def _what_it_is(group: Any, name: str) -> tuple[str, bool]:
    """Return what a member of a group is that is no array of numbers, and whether it is a column for all that."""
    if group.get(name, getlink=True).__class__ is not h5py.HardLink:
        return "a link to another file or place", False
    item = group[name]
    if not isinstance(item, h5py.Dataset):
        return "another group", False
    if not item.size or is_dimension_only(item):
        return "no values", False
    if item.size == 1:
        return "one value", False
    if item.dtype.kind in "fiu":
        return f"an array of {len(item.shape)} dimensions", False
    return ("records, no numbers" if item.dtype.kind == "V" else "no numbers"), True


def _attributes_of_array(dataset: Any) -> dict[str, Any]:
    """Return those of `ARRAY_ATTRIBUTES` that an array has.

    Many texts, which may take long to read, and what is neither a number nor a text are no unit.
    """
    found = {}
    for name in ARRAY_ATTRIBUTES:
        if name in dataset.attrs and dataset.attrs.get_id(name).get_space().get_simple_extent_npoints() == 1:
            value = attribute(dataset, name)
            # A number keeps the type with which it was written.
            is_text = isinstance(value, str) or (isinstance(value, list) and isinstance(value[0], str))
            found[name] = value if is_text else np.asarray(dataset.attrs[name]).ravel()[0]
    return found


def chosen_group(path: Path, places: Sequence[str], group: str, scene: str) -> str:
    """Return the one of `places` that is meant, see `read_arrays`. Raises StoreError."""
    inside = [place for place in places if place.startswith(f"{scene}/")] or list(places)
    fitting: list[str]
    is_root, group = group.strip() == "/", group.strip("/")
    if is_root:
        fitting = [place for place in places if not place]
    elif group:
        fitting = [place for place in inside if place == group]
        fitting = fitting or [place for place in inside if f"/{place}".endswith(f"/{group}")]
    else:
        fitting = [place for place in inside if not place.endswith("/reference")]
    if len(fitting) == 1:
        return fitting[0]
    if not places:
        raise StoreError(f"{path}: no arrays of numbers in it; allowed: a time and angles")
    shown = ", ".join(place or "/" for place in inside[:12]) + (", ..." if len(inside) > 12 else "")
    problem = f"no group {group or '/'!r}" if group or is_root else "arrays in several groups"
    raise StoreError(f"{path}: {problem}; allowed: a mapping file with group = one of {shown}")


def _array_places(file: Any) -> dict[str, list[str]]:
    """Return the names of the arrays of numbers by their group; groups without any are left out."""
    places: dict[str, list[str]] = {}

    def note(path: str, item: Any) -> None:
        if (
            isinstance(item, h5py.Dataset)
            and item.dtype.kind in "fiu"
            and 0 < len(item.shape or ()) <= 3
            and item.size > 1
            and not is_dimension_only(item)
        ):
            folder, _, name = path.rpartition("/")
            places.setdefault(folder, []).append(name)

    file.visititems(note)
    return places
