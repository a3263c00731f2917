"""Encode rows of a table as bytes, and write and read them at their offsets in a file.

A row has a status and a checksum. Its status is written last, after a sync of its other columns. A
row counts as stored if its status is not -1 and its checksum is right.
"""

from __future__ import annotations

import math
import os
import zlib
from collections.abc import Collection, Iterator, Mapping
from contextlib import contextmanager, nullcontext
from dataclasses import dataclass, replace
from pathlib import Path
from typing import IO, Any

import numpy as np
from numpy.typing import NDArray

from rotor_mbs.errors import StoreError
from rotor_mbs.methods.catalogue import REFERENCE
from rotor_mbs.runs.design import CHARACTER, MISSING, STATUS_COPIES
from rotor_mbs.runs.output_files import store_errors
from rotor_mbs.solution.status import STATUSES, code_of
from rotor_mbs.solution.trajectory import Solution

# Columns of one or more rows: arrays of shape (rows, ...) by name of the column.
Rows = dict[str, NDArray[Any]]


@dataclass(frozen=True)
class RowLocation:
    """Location of consecutive rows in a file, by which worker processes write the rows.

    Attributes
    ----------
    path : the file.
    inode : inode of the file. If another file has this path now, nothing is written to it.
    first : initial value of the first row's checksum: the number of its run if runs are numbered,
        otherwise the number of the row in the table.
    offsets : for each column, bytes from the beginning of the file to the value of the first row.
    row_type : type of a row; its columns are in the order in which the checksum covers them.
    """

    path: Path
    inode: int
    first: int
    offsets: Mapping[str, int]
    row_type: np.dtype[np.void]

    def encode(self, values: Mapping[str, object], count: int = 1) -> Rows:
        """Return the columns of rows that all have the same values.

        Parameters
        ----------
        values : values by name of the column: a number, a text, a status, or the first samples of
            an array. Values that have no column are ignored; columns that have no value are blank.
        count : number of rows.

        Returns
        -------
        dict of ndarray, shape (count, ...)
        """
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
        for name, repeated in STATUS_COPIES.items():
            if repeated in rows:
                rows[repeated][:] = rows[name]
        return rows

    def at(self, row: int) -> RowLocation:
        """Return the location that begins `row` rows after the first row."""
        offsets = {
            name: offset + row * self.row_type[name].itemsize
            for name, offset in self.offsets.items()
        }
        return replace(self, first=self.first + row, offsets=offsets)

    def write(self, rows: Rows) -> None:
        """Write consecutive rows into the file.

        The statuses in the file are MISSING while the other columns are written. The new statuses
        are written last, after a sync.

        Parameters
        ----------
        rows : the columns of the rows; their checksums are computed here.

        Raises
        ------
        StoreError
            If the file cannot be written, or has been replaced.
        """
        columns = rows | {"crc32": checksums(self.first, rows, self.row_type)}
        statuses = {
            name: columns.pop(name)
            for name in (STATUS_COPIES["status"], "status")
            if name in columns
        }
        with self._open_to_write() as file:
            # The rows are missing until all columns are written: a reader must not take a part of a
            # row for the whole row.
            for name, status in statuses.items():
                file.seek(self.offsets[name])
                file.write(np.full(len(status), MISSING, np.int8).data)
            for name, values in columns.items():
                file.seek(self.offsets[name])
                file.write(np.ascontiguousarray(values).data)
            # The columns must be on the disk before a status marks the row as stored.
            file.flush()
            os.fsync(file.fileno())
            for name, status in statuses.items():
                file.seek(self.offsets[name])
                file.write(np.ascontiguousarray(status, np.int8).data)

    @contextmanager
    def _open_to_write(self) -> Iterator[IO[bytes]]:
        """Open the file, and close it after the block.

        Raises StoreError if the file has been replaced, or for an OSError in the block.
        """
        with store_errors(self.path), self.path.open("r+b") as file:
            if os.fstat(file.fileno()).st_ino != self.inode:
                raise StoreError(f"{self.path}: has been replaced by another file")
            yield file

    def read(self, count: int = 1, file: IO[bytes] | None = None) -> Rows:
        """Read the columns of the first `count` rows, each (count, ...), without verifying them.

        `file` is the open file; if it is None, the file is opened. Raises OSError, ValueError.
        """
        with nullcontext(file) if file is not None else self.path.open("rb") as source:
            rows = {}
            for name in self.row_type.names or ():
                kind = self.row_type[name]
                source.seek(self.offsets[name])
                content = source.read(count * kind.itemsize)
                rows[name] = np.frombuffer(content, kind.base).reshape(count, *kind.shape)
        return rows

    def statuses(self, count: int = 1) -> NDArray[np.int8]:
        """Return the verified statuses of the first `count` rows, (count,) int8.

        A status is MISSING if the row is not stored, or its checksum is wrong.
        """
        rows = self.read(count)
        status = rows["status"]
        is_right = checksums(self.first, rows, self.row_type) == rows["crc32"]
        is_known = (status >= 0) & (status < len(STATUSES))
        return np.where(is_right & is_known, status, np.int8(MISSING))

    @property
    def is_stored(self) -> bool:
        """Return whether the first row is stored with a right checksum."""
        return bool(self.statuses()[0] != MISSING)

    def mark_missing(self, rows: Collection[int]) -> None:
        """Mark rows as missing before they are computed again.

        Parameters
        ----------
        rows : numbers of the rows, counted from 0 at the first row of this location.

        Raises
        ------
        StoreError
            If the file cannot be written, or has been replaced.
        """
        with self._open_to_write() as file:
            for row in rows:
                for name in ("status", STATUS_COPIES["status"]):
                    if name in self.offsets:
                        file.seek(self.offsets[name] + row)
                        file.write(np.int8(MISSING).tobytes())
            file.flush()
            os.fsync(file.fileno())


def checksums(first: int, rows: Rows, row_type: np.dtype[np.void]) -> NDArray[np.uint32]:
    """Return the CRC-32 of each row over its columns, (rows,) uint32.

    Parameters
    ----------
    first : initial value of the first row's checksum, see `RowLocation`. It increases by 1 from row
        to row.
    rows : columns of the rows.
    row_type : type of a row; its columns are in the order in which the checksum covers them.
    """
    # Each row has its own initial value, so that a row that was written at the location of another
    # row is detected.
    sums = [(first + i) & 0xFFFFFFFF for i in range(len(rows["status"]))]
    for name in row_type.names or ():
        if name == "crc32":
            continue
        values = np.ascontiguousarray(rows[name], row_type[name].base)
        contents: Any = values.reshape(len(sums), -1)
        sums = [zlib.crc32(content, so_far) for content, so_far in zip(contents, sums, strict=True)]
    return np.array(sums, np.uint32)


def blank_rows(count: int, row_type: np.dtype[np.void]) -> Rows:
    """Return blank rows: numbers are NaN or -1 (0 if unsigned), texts are empty."""
    blanks = {"f": np.nan, "i": -1, "u": 0, "S": b""}
    kinds = {name: row_type[name] for name in row_type.names or ()}
    return {
        name: np.full((count, *kind.shape), blanks[kind.base.kind], kind.base)
        for name, kind in kinds.items()
    }


def characters(text: str, length: int) -> NDArray[np.bytes_]:
    """Return a text as (length,) UTF-8 bytes, cut or filled up with zeros."""
    return np.frombuffer(text.encode()[:length].ljust(length, b"\0"), CHARACTER)


def text_of(values: NDArray[np.bytes_]) -> str:
    """Return the text in an array that `characters` has returned."""
    return values.tobytes().rstrip(b"\0").decode(errors="ignore")


def row_of_run(run: Solution, place: RowLocation, facts: Mapping[str, object]) -> Rows:
    """Return the row of a run: status, metrics, times, arrays.

    Parameters
    ----------
    run : the run.
    place : location of the row. It determines which columns the returned row has.
    facts : further values by name of the column.
    """
    integration = run.integration
    steps, evaluations = integration.steps, integration.rhs_evaluations
    run_times_s = run.run_times_s or [math.nan]
    arrays = dict(run.quantities)
    if run.method == REFERENCE:
        # Angles and rates of a reference are always stored, as it is rebuilt from them when it is
        # read.
        arrays |= {"angles": run.angles, "rates": run.rates}
    return place.encode(
        {
            "status": run.status,
            "message": run.message,
            "engine_message": integration.message,
            "samples": len(run.time),
            "time_reached": float(run.time[-1]) if len(run.time) else 0.0,
            "steps": -1 if steps is None else steps,
            "rhs_evaluations": -1 if evaluations is None else evaluations,
            "engine_success": int(integration.success),
            "setup_time_s": run.setup_time_s,
            "run_time_s": float(np.median(run_times_s)),
            "run_time_min_s": min(run_times_s),
            "output_time_s": run.output_time_s,
            "repeats": len(run.run_times_s),
            **run.metrics,
            **facts,
            **arrays,
        }
    )
