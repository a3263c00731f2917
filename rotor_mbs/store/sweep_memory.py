"""A file in memory that holds only what was written to it: a plan of a large file, small. Knows bytes only."""

from __future__ import annotations

import io
from collections.abc import Iterator
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from _typeshed import ReadableBuffer, WriteableBuffer

_PAGE = 1 << 12


class SparseFile(io.RawIOBase):
    """Reads as zeros where nothing was written. `extents` are the places that were, joined, with their bytes."""

    def __init__(self) -> None:
        self.size = 0
        self._pages: dict[int, bytearray] = {}
        self._written: list[tuple[int, int]] = []
        self._at = 0

    def extents(self) -> Iterator[tuple[int, bytes]]:
        """(place, bytes) in order, none touching another."""
        start = end = 0
        for first, last in sorted(self._written):
            if first > end:
                if end > start:
                    yield start, self._bytes(start, end)
                start = first
            end = max(end, last)
        if end > start:
            yield start, self._bytes(start, end)

    def readable(self) -> bool:
        return True

    def writable(self) -> bool:
        return True

    def seekable(self) -> bool:
        return True

    def seek(self, offset: int, whence: int = io.SEEK_SET) -> int:
        self._at = offset + {io.SEEK_SET: 0, io.SEEK_CUR: self._at, io.SEEK_END: self.size}[whence]
        return self._at

    def tell(self) -> int:
        return self._at

    def truncate(self, size: int | None = None) -> int:
        self.size = self._at if size is None else size
        return self.size

    def readinto(self, buffer: WriteableBuffer) -> int:
        target = memoryview(buffer).cast("B")
        content = self._bytes(self._at, min(self._at + len(target), self.size))
        target[: len(content)] = content
        self._at += len(content)
        return len(content)

    def write(self, data: ReadableBuffer) -> int:
        source = memoryview(data).cast("B")
        end = self._at + len(source)
        for place, start, stop in _on_pages(self._at, end):
            page = self._pages.setdefault(place // _PAGE, bytearray(_PAGE))
            page[place % _PAGE : place % _PAGE + stop - start] = source[start:stop]
        self._written.append((self._at, end))
        self._at, self.size = end, max(self.size, end)
        return len(source)

    def _bytes(self, first: int, last: int) -> bytes:
        blank = bytes(_PAGE)
        return b"".join(
            self._pages.get(place // _PAGE, blank)[place % _PAGE : place % _PAGE + stop - start]
            for place, start, stop in _on_pages(first, last)
        )


def _on_pages(first: int, last: int) -> Iterator[tuple[int, int, int]]:
    """(place, start, stop) of the pieces that first ... last falls into, start and stop counted from first."""
    place = first
    while place < last:
        end = min(last, (place // _PAGE + 1) * _PAGE)
        yield place, place - first, end - first
        place = end
