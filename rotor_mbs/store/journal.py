"""Finished runs, appended to one file: on the disk before they are told, and whole again after any kind of end.

    header   magic, length, JSON (identity of what is stored, first run, number of runs, bytes of a row), checksum
    record   magic, first run, number of rows, checksum over these and the rows; the rows
A torn tail fails its checksum and is cut off when the file is opened. Knows rows of fixed size, not their meaning.
"""

from __future__ import annotations

import json
import os
import struct
import zlib
from collections.abc import Iterable, Iterator
from contextlib import suppress
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from rotor_mbs.errors import InputError, StoreError

Rows = NDArray[np.void]

_FILE = struct.Struct("<8sI")
_RECORD = struct.Struct("<4sQII")
_MAGIC, _MARK = b"RMBSJRN1", b"rows"
_PIECE = 1 << 22  # bytes read at once


class Journal:
    """Rows of the runs first ... first + count - 1, in any order, each once.

    Raises InputError where the file holds something else, StoreError where it cannot be read or written.
    """

    def __init__(self, path: Path, identity: str, first: int, count: int, row: np.dtype[np.void]) -> None:
        self.path, self._row, self._first = path, row, first
        self._places = np.full(count, -1, np.int64)  # of each run's row in the file
        facts = {"identity": identity, "first": first, "count": count, "row_bytes": row.itemsize}
        header = json.dumps(facts, sort_keys=True).encode()
        self._header = _FILE.pack(_MAGIC, len(header)) + header + zlib.crc32(header).to_bytes(4, "little")
        try:
            self._file = self._opened()
            self._end = self._scan()
            os.ftruncate(self._file, self._end)
        except OSError as exc:
            raise StoreError(f"{path}: cannot be written: {exc.strerror}") from exc

    @property
    def has(self) -> NDArray[np.bool_]:
        """(count,) whether each run is there."""
        there: NDArray[np.bool_] = self._places >= 0
        return there

    def append(self, blocks: Iterable[tuple[int, Rows]]) -> None:
        """Adds (first run, rows); returns when they are on the disk. What was there stays whole if that fails."""
        records, places = [], []
        end = self._end
        for first, rows in blocks:
            head = _RECORD.pack(_MARK, first, len(rows), _checksum(first, rows))
            records += [head, rows.tobytes()]
            places.append((first - self._first, len(rows), end + _RECORD.size))
            end += _RECORD.size + rows.nbytes
        try:
            _write_all(self._file, records, self._end)
            os.fsync(self._file)
        except OSError as exc:
            with suppress(OSError):
                os.ftruncate(self._file, self._end)
            raise StoreError(f"{self.path}: cannot be written: {exc.strerror}; nothing stored before is lost") from exc
        for start, number, place in places:
            self._places[start : start + number] = place + self._row.itemsize * np.arange(number)
        self._end = end

    def read(self, first: int, last: int) -> Rows:
        """The rows of the runs first ... last - 1, all of which are there."""
        rows = np.empty(last - first, self._row)
        places = self._places[first - self._first : last - self._first]
        breaks = np.flatnonzero(np.diff(places) != self._row.itemsize) + 1
        for piece in np.split(np.arange(len(places)), breaks):
            content = _read(self._file, int(places[piece[0]]), len(piece) * self._row.itemsize)
            rows[piece[0] : piece[-1] + 1] = np.frombuffer(content, self._row)
        return rows

    def stored(self) -> Iterator[tuple[int, Rows]]:
        """(run, one row or more) of all that is there, in the order of the runs."""
        there = np.flatnonzero(self.has)
        if not len(there):
            return
        most = max(_PIECE // self._row.itemsize, 1)
        for span in np.split(there, np.flatnonzero(np.diff(there) != 1) + 1):
            for start in range(int(span[0]), int(span[-1]) + 1, most):
                end = min(start + most, int(span[-1]) + 1)
                yield self._first + start, self.read(self._first + start, self._first + end)

    def close(self) -> None:
        os.close(self._file)

    def _opened(self) -> int:
        if not self.path.exists():
            temporary = self.path.with_name(self.path.name + ".tmp")
            with temporary.open("wb") as file:
                file.write(self._header)
                file.flush()
                os.fsync(file.fileno())
            temporary.replace(self.path)
            sync_folder(self.path.parent)
        return os.open(self.path, os.O_RDWR)

    def _scan(self) -> int:
        """Finds every row; returns where the last whole record ends."""
        if _read(self._file, 0, len(self._header)) != self._header:
            raise InputError(
                f"{self.path}: holds the runs of another sweep, or of another version; allowed: another output file, "
                "or remove this folder"
            )
        size, end = os.fstat(self._file).st_size, len(self._header)
        while size - end >= _RECORD.size:
            mark, first, number, checksum = _RECORD.unpack(_read(self._file, end, _RECORD.size))
            length = number * self._row.itemsize
            start = first - self._first
            fits = end + _RECORD.size + length <= size and start >= 0 and start + number <= len(self._places)
            if mark != _MARK or not fits:
                break
            rows = np.frombuffer(_read(self._file, end + _RECORD.size, length), self._row)
            if _checksum(first, rows) != checksum:
                break
            self._places[start : start + number] = end + _RECORD.size + self._row.itemsize * np.arange(number)
            end += _RECORD.size + length
        return end


def _checksum(first: int, rows: Rows) -> int:
    return zlib.crc32(rows.tobytes(), zlib.crc32(struct.pack("<QI", first, len(rows))))


def _write_all(file: int, pieces: Iterable[bytes], place: int) -> None:
    for piece in pieces:
        view = memoryview(piece)
        while view:
            written = os.pwrite(file, view, place)
            view, place = view[written:], place + written


def _read(file: int, place: int, length: int) -> bytes:
    content = os.pread(file, length, place)
    while len(content) < length:
        more = os.pread(file, length - len(content), place + len(content))
        if not more:
            break
        content += more
    return content


def sync_folder(folder: Path) -> None:
    """Makes a new or replaced name in `folder` durable, where the system can."""
    with suppress(OSError):
        handle = os.open(folder, os.O_RDONLY)
        try:
            os.fsync(handle)
        finally:
            os.close(handle)
