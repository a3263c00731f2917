"""Read the tables of a file: their columns, and the locations of their rows.

    /runs                 a row per run of the file: scene, method, settings, status, metrics
    /paper/fig11          the arrays of a scene: dimensions run, time, ...
    /bench, /stability    a row per point
    /                     the only table of a sweep's file, with a row per run

All space is allocated when a file is laid out (`runs.layout`). No HDF5 metadata changes after that:
the file is valid and can be read at every moment. The known columns (scene, method, settings,
versions, see `runs.design`) are written with the layout, and the digest in the file's trailer
covers them (`runs.trailer`). The computed columns have a checksum per row (`runs.rows`).

The HDF5 library writes nothing after the layout. A handle of the library that is open while rows
are written reads old values. If it wrote, it would overwrite the new rows with the old values.
"""

from __future__ import annotations

import copy
import json
import os
import threading
import time
from collections.abc import Collection, Iterable, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, Self, TypeVar

import numpy as np
from numpy.typing import NDArray

from rotor_mbs.errors import StoreError, shown_value
from rotor_mbs.methods.catalogue import REFERENCE
from rotor_mbs.runs.design import (
    COLUMNS,
    DESIGN_COLUMNS,
    MISSING,
    NUMBERS,
    ONCE_A_SCENE,
    POINT_COLUMNS,
    RUNS,
    STATUS_COPIES,
)
from rotor_mbs.runs.hdf5 import Column, TableSpec, read_groups, reading
from rotor_mbs.runs.rows import RowLocation, blank_rows
from rotor_mbs.runs.trailer import RESULTS, SWEEP, Regions, Trailer

# Name of the attribute of a sweep's file that has a hash of its whole design.
IDENTITY = "sweep_identity"
_READ_BYTES = 1 << 25  # bytes that are read at once when checksums are verified
# Longest label of a run, in characters. A longer label can only come from a damaged file: a scene
# is named after its file, and file systems limit the length of names.
_LONGEST_LABEL = 1000
T = TypeVar("T")


@dataclass(frozen=True, kw_only=True)
class StoredTable(TableSpec):
    """A table in a file.

    Attributes
    ----------
    path : the file.
    inode : inode of the file.
    offsets : position in the file at which each computed column begins, in bytes.
    """

    path: Path
    inode: int
    offsets: Mapping[str, int]

    @classmethod
    def of(cls, table: TableSpec, path: Path, inode: int, regions: Regions) -> Self:
        """Return a table with its location in a file.

        Parameters
        ----------
        table : the table.
        path, inode : path and inode of the file.
        regions : offset and length of each computed column in bytes, by group.
        """
        return cls(
            group=table.group,
            runs=table.runs,
            known=table.known,
            computed=table.computed,
            attributes=table.attributes,
            characters=table.characters,
            path=path,
            inode=inode,
            offsets={name: offset for name, (offset, _) in regions[table.group].items()},
        )

    @property
    def columns(self) -> dict[str, Column]:
        """Return the descriptions of all columns and scales but `run`, by name."""
        return {name: column for name, (column, _) in self.known.items()} | {**self.computed}

    def column(self, name: str) -> NDArray[Any]:
        """Return a column of the table, (rows, ...), or a scale in its own shape.

        A computed column is a memory map of the file: its values are read when it is indexed.

        Parameters
        ----------
        name : name of the column; "run" for the labels or numbers of the rows.

        Raises
        ------
        StoreError
            If there is no such column, or the file has been replaced.
        """
        if name == "run":
            return np.asarray(self.runs)
        if name in self.known:
            return np.asarray(self.known[name][1])
        if name not in self.computed:
            what = f"has no {shown_value(name)}"
            raise StoreError(f"{self.path}: {what}; allowed: a sweep whose outputs have it")
        kind, shape = self.row_type[name].base, self.shape(name)
        if not all(shape):
            return np.empty(shape, kind)
        with reading(self.path, name), self.path.open("rb") as file:
            if os.fstat(file.fileno()).st_ino != self.inode:
                raise StoreError(f"{self.path}: has been replaced by another file")
            values: NDArray[Any] = np.memmap(file, kind, "r", self.offsets[name], shape)
        return values

    def rows(
        self, name: str, rows: Sequence[int] | NDArray[np.intp], sample: int | None = None
    ) -> NDArray[Any]:
        """Return some rows of a column, (rows, ...), or a whole scale such as `time`.

        Parameters
        ----------
        name : name of the column or the scale.
        rows : numbers of the rows.
        sample : number of a sample. If it is given, the column must be an array over time, and only
            this sample of each row is returned. None for all samples.

        Raises
        ------
        StoreError
            If there is no such column, or the file has been replaced.
        """
        column = self.column(name)
        if name in self.known and self.known[name][0].dimensions[:1] != ("run",):
            return np.array(column)
        return np.array(column[rows] if sample is None else column[rows, sample])

    def statuses(self) -> NDArray[np.int8]:
        """Return the verified status of each row, (rows,) int8.

        The status is MISSING for a row that is not stored, or whose checksum is wrong.
        """
        marked, place = np.array(self.column("status")), self.place()
        statuses = np.full_like(marked, MISSING)
        # Rows are read in blocks, as all rows of a large file may not fit into memory.
        step = max(_READ_BYTES // place.row_type.itemsize, 1)
        for start in range(0, len(marked), step):
            part = marked[start : start + step]
            if (part != MISSING).any():
                statuses[start : start + step] = place.at(start).statuses(len(part))
        return statuses

    def clear(self) -> None:
        """Write blank values into all computed columns of this table except the status.

        The file must be new: its layout already has the status MISSING in each row.
        """
        with self.path.open("r+b") as file:
            for name, blank in blank_rows(1, self.row_type).items():
                if name == "status":
                    continue
                has_rows = "run" in self.computed[name].dimensions
                file.seek(self.offsets[name])
                for _ in range(len(self.runs) if has_rows else 1):
                    file.write(blank.data)

    def place(self, row: int = 0) -> RowLocation:
        """Return the location of a row and of the rows after it.

        The initial value of a row's checksum is the number of its run if runs are numbered,
        otherwise the number of the row in the table.

        Parameters
        ----------
        row : number of the first row, from 0.
        """
        first = 0
        if isinstance(self.runs, np.ndarray) and self.runs.dtype.kind == "i" and len(self.runs):
            first = int(self.runs[0])
        names = [name for name, column in self.computed.items() if "run" in column.dimensions]
        kinds = np.dtype([(name, self.row_type[name]) for name in names])
        offsets = {name: self.offsets[name] for name in names}
        return RowLocation(self.path, self.inode, first, offsets, kinds).at(row)


def parsed(text: object, kind: type[T], place: object) -> T:
    """Return the value of a JSON text.

    Parameters
    ----------
    text : the text as it was read; in a damaged file it may be of any type.
    kind : the type that the value must have.
    place : the file and the part of the file, for the message.

    Raises
    ------
    StoreError
        If the text is no JSON, or the value has another type.
    """
    try:
        value = json.loads(str(text))
    except (ValueError, RecursionError):
        value = None
    if not isinstance(value, kind):
        raise StoreError(
            f"{place}: {str(text)[:50]!r} is no JSON text of a {kind.__name__}; damaged"
        )
    return value


class TableFile:
    """The tables of a file, and the locations by which their rows are read and written.

    Attributes
    ----------
    path : the file.
    attributes : attributes of the file.
    groups : groups of all tables of the file.
    tables : the tables that have been read, by group.
    """

    def __init__(
        self,
        path: Path,
        only: Collection[str] | None = None,
        *,
        laid_out_as: tuple[Mapping[str, Any], Sequence[StoredTable]] | None = None,
    ) -> None:
        """Read the tables of a file.

        Parameters
        ----------
        path : the file.
        only : groups of the tables that are read, by default all.
        laid_out_as : attributes and all tables of a file that was just laid out. If they are given,
            the file is not read.

        Raises
        ------
        StoreError
            If the file cannot be read, or its tables are damaged.
        """
        self.path = path
        self.attributes: dict[str, Any] = {}
        self.groups: list[str] = []
        self.tables: dict[str, StoredTable] = {}
        if laid_out_as is None:
            self.read(only)
        else:
            attributes, tables = laid_out_as
            self.attributes = dict(attributes)
            self.tables = {table.group: table for table in tables}
            self.groups = list(self.tables)

    def read(self, only: Collection[str] | None = None) -> None:
        """Read tables that have not been read yet: those in `only`, by default all."""
        if self.tables:
            missing = set(self.groups) - set(self.tables)
            only = missing if only is None else missing & set(only)
            if not only:
                return
        kinds = RESULTS, SWEEP
        groups, trailer = read_groups(self.path, kinds, only)
        self.attributes = dict(groups[""].attributes)
        self.groups = list(trailer.groups) if trailer.kind in kinds else []
        with reading(self.path):
            for name in self.groups:
                if only is None or name in only:
                    self.tables[name] = _table(self.path, groups[name], trailer)
            self._check_runs()

    def copy(self) -> TableFile:
        """Return a copy with the same tables, whose `tables` can be changed independently."""
        other = copy.copy(self)
        other.tables = dict(self.tables)
        return other

    def _check_runs(self) -> None:
        """Raise StoreError if a run in /runs has a wrong label, or no row in its scene's table."""
        rows = self.tables[RUNS].known_rows if RUNS in self.tables else {}
        for run, row in rows.items():
            scene, method = row["scene"], row["method_name"]
            has_arrays = scene in self.groups
            if scene in self.tables:
                has_arrays = has_arrays and method in self.tables[scene].runs
            if run != f"{scene}/{method}" or not has_arrays or len(run) > _LONGEST_LABEL:
                raise StoreError(f"{self.path}: {run[:_LONGEST_LABEL]} has no arrays; damaged")

    def place(self, run: str, group: str = RUNS) -> RowLocation:
        """Return the location of a row. For a row of /runs, it includes the arrays of the run.

        Parameters
        ----------
        run : label of the row.
        group : group of the table.
        """
        stored = self.tables[group]
        row = stored.row_of[run]
        place = stored.place(row)
        if group != RUNS:
            return place
        scene = str(stored.column("scene")[row])
        arrays = self.tables[scene]
        label = run.removeprefix(f"{scene}/")
        # The columns of /runs come first, then those of the scene's table. A column of the scene's
        # table that repeats a column of /runs gets another name.
        offsets = dict(place.offsets)
        kinds = [(name, place.row_type[name]) for name in place.row_type.names or ()]
        of_arrays = arrays.place(arrays.row_of[label])
        for name in of_arrays.row_type.names or ():
            joined_name = STATUS_COPIES.get(name, name)
            offsets[joined_name] = of_arrays.offsets[name]
            kinds.append((joined_name, of_arrays.row_type[name]))
        # An array that a scene has only once is part of the reference's row.
        for name, column in arrays.computed.items():
            if label == REFERENCE and "run" not in column.dimensions:
                offsets[name] = arrays.offsets[name]
                kinds.append((name, arrays.row_type[name]))
        return replace(place, offsets=offsets, row_type=np.dtype(kinds))


_opened: dict[tuple[Path, Path, tuple[int, ...]], TableFile] = {}
_opened_lock = threading.Lock()  # held while `_opened` is used
_MAX_OPENED = 4  # number of files whose tables are kept in memory
# Time in ns. If two writes to a file are further apart than this, their time stamps differ.
_SETTLED_NS = 100_000_000


def opened_tables(path: Path, only: Collection[str] | None = None) -> TableFile:
    """Return the tables of a file, from memory if it has not changed since they were read.

    The tables in memory have descriptions and known columns, but no rows of computed columns.

    Parameters
    ----------
    path : the file.
    only : groups of the tables that are needed, by default all. The result also has the tables that
        earlier calls needed.

    Raises
    ------
    StoreError
        If the file cannot be read.
    """
    try:
        state = path.stat()
    except OSError:
        return TableFile(path, only)  # raises a StoreError with the reason
    # The key also has the path as it is given, because the messages of the tables show it.
    stamp = (path, path.absolute(), (state.st_dev, state.st_ino, state.st_size, state.st_mtime_ns))
    with _opened_lock:
        file = _opened.pop(stamp, None)
    if file is None:
        file = TableFile(path, only)
    else:
        file.read(only)
    is_settled = time.time_ns() - state.st_mtime_ns > _SETTLED_NS
    with suppress(OSError):  # the file was removed meanwhile
        is_settled = is_settled and path.stat().st_mtime_ns == state.st_mtime_ns
        with _opened_lock:
            if is_settled:
                _opened[stamp] = file
            while len(_opened) > _MAX_OPENED:
                del _opened[next(iter(_opened))]
    return file.copy()


def _table(path: Path, stored: TableSpec, trailer: Trailer) -> StoredTable:
    """Return the table of a group, with its location in the file.

    Parameters
    ----------
    path, trailer : path and trailer of the file.
    stored : the group as it was read.

    Raises
    ------
    StoreError
        If the group is no table of this program, or a column has a wrong type or wrong dimensions.
    """
    table = StoredTable.of(stored, path, trailer.inode, trailer.groups)
    for name, column in table.computed.items():
        kind = np.dtype(column.kind)
        is_wrong = kind.kind not in "fiuS"
        if name in COLUMNS and name not in ONCE_A_SCENE:
            usual = COLUMNS[name]
            is_wrong = (
                is_wrong or kind != np.dtype(usual.kind) or column.dimensions != usual.dimensions
            )
        if is_wrong:
            shape = table.shape(name)
            raise StoreError(f"{path}: {table.group}/{name} has shape {shape} of {kind}; damaged")
    _check_table(table)
    return table


# Names that a table must have, by group: of computed columns, of known columns, of attributes. All
# other groups are tables of scenes.
_REQUIRED: Mapping[str, tuple[Collection[str], Collection[str], Collection[str]]] = {
    "": (("status", "crc32"), (), ()),
    RUNS: (
        ("status", "message", "engine_message", "samples", "time_limit_s", "crc32"),
        ("scene", "method_name", "settings", "versions", "scene_hash"),
        (),
    ),
    **{group: (columns, ("scene", "method_name"), ()) for group, columns in POINT_COLUMNS.items()},
}
_REQUIRED_OF_SCENE = (STATUS_COPIES, ("time",), ("title", "scene_toml", "scene_hash"))


def _check_table(table: StoredTable) -> None:
    """Raise StoreError if a table lacks a required name, or its columns are inconsistent.

    This check is needed beside the digest: a file of another program can have a right digest.

    Parameters
    ----------
    table : the table.
    """
    place = f"{table.path}: {table.group or 'file'}"
    computed, known, attributes = _REQUIRED.get(table.group, _REQUIRED_OF_SCENE)
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
        is_text = name in DESIGN_COLUMNS and name not in NUMBERS
        if is_text != (values.dtype.kind == "O") and name != "run":
            raise StoreError(f"{place}/{name} has values of another type; damaged")
        if name == "time" and not (np.isfinite(values).all() and (np.diff(values) > 0.0).all()):
            raise StoreError(f"{place}/time does not increase; damaged")
    if len(set(table.runs)) != len(table.runs):
        raise StoreError(f"{place}/run names a run twice; damaged")
    require_texts(table.attributes, attributes, place)


def require_texts(attributes: Mapping[str, object], names: Iterable[str], place: object) -> None:
    """Raise StoreError if one of the named attributes is no text."""
    for name in names:
        if not isinstance(attributes.get(name), str):
            raise StoreError(f"{place}: its attribute {name} is no text; damaged")
