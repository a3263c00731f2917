"""Where chunks lie, read from a file's own index: the library tells them one by one, 2 µs each, seven chunks a run.

Knows version 1 B-trees of chunks and nothing else. Source: HDF5 File Format Specification, version 3.0, III.A.1.
"""

from __future__ import annotations

from collections.abc import Iterable

import numpy as np
from numpy.typing import NDArray

_LEAF = b"TREE\x01\x00"  # signature, type 1 (chunks), level 0
_HEAD = np.dtype([("leaf", "S6"), ("entries", "<u2"), ("left", "<u8"), ("right", "<u8")])
_NONE = 2**64 - 1


class ChunkIndex:
    """Of all datasets in a file, whose parts are given as (place, content)."""

    def __init__(self, extents: Iterable[tuple[int, bytes]]) -> None:
        self._leaves: dict[int, memoryview] = {}
        for place, content in extents:
            at = content.find(_LEAF)
            while at >= 0:
                self._leaves[place + at] = memoryview(content)[at:]
                at = content.find(_LEAF, at + 1)

    def places(self, first: int, rows: int, rank: int) -> NDArray[np.int64] | None:
        """(rows,) where in the file the chunks of a dataset begin, one for each entry of its first dimension.

        None where the index is of another kind, or not whole. first: where the first chunk begins.
        """
        entry = np.dtype([("size", "<u4"), ("mask", "<u4"), ("offsets", "<u8", rank + 1), ("place", "<u8")])
        found = np.full(rows, -1, np.int64)
        try:
            leaf = self._leftmost(first, entry)
            while leaf != _NONE:
                content = self._leaves[leaf]
                head = np.frombuffer(content, _HEAD, 1)[0]
                entries = np.frombuffer(content, entry, head["entries"], _HEAD.itemsize)
                found[entries["offsets"][:, 0]] = entries["place"]
                leaf = int(head["right"])
        except (KeyError, ValueError, IndexError):  # no such leaf, one that is cut, one of something else
            return None
        return found if (found >= 0).all() else None

    def _leftmost(self, first: int, entry: np.dtype[np.void]) -> int:
        for leaf, content in self._leaves.items():
            is_leftmost = np.frombuffer(content, _HEAD, 1)[0]["left"] == _NONE
            if is_leftmost and np.frombuffer(content, entry, 1, _HEAD.itemsize)[0]["place"] == first:
                return leaf
        raise KeyError(first)
