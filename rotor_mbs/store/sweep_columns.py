"""Results of runs, column by column, and their way to their offsets in a file. Knows no file format.

A worker process writes the runs that it has computed by itself; loading this module is cheap.
"""

from __future__ import annotations

import os
import zlib
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from rotor_mbs.errors import StoreError
from rotor_mbs.solution.status import STATUSES

# (runs, ...) arrays by the name of their dataset.
Rows = dict[str, NDArray[Any]]

MISSING = -1  # status of a run that is not stored
_READ_BYTES = 1 << 25  # read at once when checksums are verified


@dataclass(frozen=True)
class RunColumns:
    """Where the runs of a file are; worker processes that see the file write them by it.

    path, inode   the file, and its number: another file of that name is not written to
    first         its first run
    offsets       bytes from its beginning to each column
    row           the type of a run
    """

    path: Path
    inode: int
    first: int
    offsets: Mapping[str, int]
    row: np.dtype[np.void]

    def write(self, first: int, rows: Rows) -> NDArray[np.int8]:
        """Stores the rows of the runs from `first` on; returns their statuses. Raises StoreError."""
        columns = {**rows, "crc32": checksums(first, rows, self.row)}
        status: NDArray[np.int8] = columns.pop("status")
        with self._opened(os.O_WRONLY) as file:
            for name, values in columns.items():
                self._put(file, name, first, values)
            os.fsync(file)
            self._put(file, "status", first, status)
        return status

    def stored(self, count: int) -> NDArray[np.int8]:
        """(count,) statuses of the runs; MISSING, too, where a checksum is wrong. Raises StoreError."""
        found = np.full(count, MISSING, np.int8)
        step = max(_READ_BYTES // self.row.itemsize, 1)
        with self._opened(os.O_RDONLY) as file:
            for start in range(0, count, step):
                runs = slice(start, min(start + step, count))
                status = self._get(file, "status", np.dtype("i1"), runs)
                if (status == MISSING).all():
                    continue
                rows = {name: self._get(file, name, self.row[name], runs) for name in self.row.names or ()}
                right = checksums(self.first + start, rows, self.row)
                is_right = right == self._get(file, "crc32", np.dtype("<u4"), runs)
                found[runs] = np.where(is_right & (status < len(STATUSES)), status, MISSING)
        return found

    def mark_missing(self, runs: NDArray[np.int64]) -> None:
        """Makes runs missing. Raises StoreError."""
        with self._opened(os.O_WRONLY) as file:
            for run in runs.tolist():
                self._put(file, "status", run, np.array([MISSING], np.int8))

    @contextmanager
    def _opened(self, flags: int) -> Iterator[int]:
        try:
            file = os.open(self.path, flags | getattr(os, "O_BINARY", 0))
            try:
                if os.fstat(file).st_ino != self.inode:
                    raise StoreError(f"{self.path}: is another file by now")
                yield file
            finally:
                os.close(file)
        except OSError as exc:
            raise StoreError(f"{self.path}: cannot be written: {exc.strerror}; nothing stored before is lost") from exc

    def _put(self, file: int, name: str, first: int, values: NDArray[Any]) -> None:
        content = np.ascontiguousarray(values).reshape(-1).view(np.uint8).data
        place = self.offsets[name] + (first - self.first) * (content.nbytes // len(values))
        os.lseek(file, place, os.SEEK_SET)
        while content:
            content = content[os.write(file, content) :]

    def _get(self, file: int, name: str, kind: np.dtype[Any], runs: slice) -> NDArray[Any]:
        os.lseek(file, self.offsets[name] + runs.start * kind.itemsize, os.SEEK_SET)
        count = runs.stop - runs.start
        content = os.read(file, count * kind.itemsize)
        return np.frombuffer(content, kind.base).reshape(count, *kind.shape)


def checksums(first: int, rows: Rows, row: np.dtype[np.void]) -> NDArray[np.uint32]:
    """(runs,) CRC-32 over each run's columns, one after the other, begun with its number."""
    names = row.names or ()
    flat = [name for name in names if not row[name].shape]
    metrics = np.empty(len(rows["status"]), np.dtype([(name, row[name]) for name in flat]))
    for name in flat:
        metrics[name] = rows[name]
    arrays = [metrics.view(np.uint8), *(rows[name] for name in names if row[name].shape)]
    arrays = [np.ascontiguousarray(array).reshape(len(metrics), -1) for array in arrays]
    found = np.empty(len(metrics), np.uint32)
    for i in range(len(found)):
        checksum = first + i & 0xFFFFFFFF
        for array in arrays:
            checksum = zlib.crc32(array[i], checksum)
        found[i] = checksum
    return found
