"""Finished runs, column by column, and their way to their places in a file. Knows no file format.

A run's numbers lie from the start where the dataset will have them: whoever made them writes them there, a worker on
this machine or the parent. What counts as stored is what the parent then notes in its journal, the `Receipt`.
"""

from __future__ import annotations

import struct
import zlib
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any, BinaryIO

import numpy as np
from numpy.typing import NDArray

from rotor_mbs.errors import StoreError

# (runs, ...) arrays by name: the datasets, and `message`, which is none.
Rows = dict[str, NDArray[Any]]

MESSAGE = "message"


def count_of(rows: Rows) -> int:
    """How many runs."""
    return len(rows["status"])


def part_of(rows: Rows, start: int, end: int) -> Rows:
    """The runs start ... end - 1 of them, without a copy."""
    return {name: values[start:end] for name, values in rows.items()}


@dataclass(frozen=True)
class Receipt:
    """The runs first ... first + len(statuses) - 1 are in their places.

    checksum   over all their bytes; statuses: a byte each; messages: (run, text) of those that have one
    """

    first: int
    checksum: int
    statuses: bytes
    messages: tuple[tuple[int, str], ...]


@dataclass(frozen=True)
class Places:
    """Where the runs from `first` on belong.

    columns   (runs,) of every dataset: bytes from the beginning of the file `path`
    sizes     bytes of a run in every dataset
    """

    path: Path
    first: int
    columns: Mapping[str, NDArray[np.int64]]
    sizes: Mapping[str, int]

    def part(self, start: int, end: int) -> Places:
        """Of the runs first + start ... first + end - 1."""
        columns = {name: places[start:end] for name, places in self.columns.items()}
        return Places(self.path, self.first + start, columns, self.sizes)

    def put(self, rows: Rows) -> Receipt:
        """Writes the rows of all these runs, durable when the file is synced. Raises StoreError."""
        checksum = self._seed()
        try:
            with self.path.open("r+b", buffering=0) as file:
                for name, start, end, place in self._spans():
                    content = rows[name][start:end].data.cast("B")
                    checksum = zlib.crc32(content, checksum)
                    write_at(file, place, content)
        except OSError as exc:
            raise StoreError(f"{self.path}: cannot be written: {exc.strerror}; nothing stored before is lost") from exc
        texts = rows[MESSAGE]
        messages = tuple((self.first + i, texts[i].decode(errors="replace")) for i in np.flatnonzero(texts).tolist())
        return Receipt(self.first, checksum, rows["status"].tobytes(), messages)

    def checksum_in(self, file: BinaryIO) -> int:
        """Of what stands there now; equal to the receipt's where it is what was put there."""
        checksum = self._seed()
        for name, start, end, place in self._spans():
            file.seek(place)
            checksum = zlib.crc32(file.read(self.sizes[name] * (end - start)), checksum)
        return checksum

    def _seed(self) -> int:
        return zlib.crc32(struct.pack("<QI", self.first, len(self.columns["status"])))

    def _spans(self) -> Iterator[tuple[str, int, int, int]]:
        """(dataset, start, end, place) of runs that lie one behind the other."""
        for name, places in self.columns.items():
            breaks = (np.flatnonzero(np.diff(places) != self.sizes[name]) + 1).tolist()
            for start, end in zip([0, *breaks], [*breaks, len(places)], strict=True):
                yield name, start, end, int(places[start])


def write_at(file: BinaryIO, place: int, content: bytes | memoryview) -> None:
    """All of it: an unbuffered file may take less at once."""
    view = memoryview(content)
    file.seek(place)
    while view:
        view = view[file.write(view) :]
