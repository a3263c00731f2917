"""Store the numbers of a page's plots as columns in single precision, encoded in base64.

Equal columns are stored once.
"""

from __future__ import annotations

import base64
import hashlib
from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

# If the largest magnitude of the values exceeds their range by this factor, a curve in single
# precision would have visible steps. A rotor angle after an hour is an example. The differences
# from the first value are then stored.
_FAR_FROM_ZERO = 1000.0
# A column with at most this number of samples is always stored whole. The number is about two for
# each pixel of a page.
_LONG = 2000
_LARGEST = 3.0e38  # largest magnitude that is stored; single precision ends at 3.4e38


class CurveStore:
    """The columns of numbers that the script of a page draws.

    A column is described by a dict. Its entry "at" is [first, count]: the index of the first number
    of the column among all stored numbers, and how many there are. For a table of several runs it
    is [first, count, stride], where stride is the distance from the first number of a run to that
    of the next run. The entry "from", if there is one, is a number to be added to each value.

    every : if it is n, only every n-th sample of long columns is stored, which limits the size of
        the page.
    """

    def __init__(self, every: int = 1) -> None:
        self.every = every
        self._parts: list[NDArray[np.float32]] = []
        self._places: dict[bytes, int] = {}
        self.size = 0

    def add(self, values: NDArray[Any] | Sequence[float]) -> dict[str, Any]:
        """Store a column or a table, and return its description.

        Parameters
        ----------
        values : (n,) a column; or (runs, n) a table, of which the page shows one row at a time. NaN
            is a gap.

        Returns
        -------
        dict
            The entries "at" and "from"; see the class.
        """
        table = np.asarray(values, dtype=np.float64)[..., :: self.step(values)]
        count = int(table.shape[-1])
        known = table[np.isfinite(table)]
        origin = 0.0
        if len(known) and float(np.abs(known).max()) > _FAR_FROM_ZERO * float(np.ptp(known)) > 0.0:
            origin = float(known[0])
        with np.errstate(invalid="ignore"):
            column = np.clip(table - origin, -_LARGEST, _LARGEST).astype("<f4").ravel()
        # `clip` made infinite values finite. They are made NaN again, because they are gaps.
        column[~np.isfinite(table.ravel())] = np.nan
        # Columns of equal numbers, such as the times of several plots, are stored once.
        digest = hashlib.sha256(column.tobytes()).digest()
        if digest not in self._places:
            self._places[digest] = self.size
            self._parts.append(column)
            self.size += len(column)
        first = self._places[digest]
        place: dict[str, Any] = {"at": [first, count] if table.ndim == 1 else [first, count, count]}
        if origin:
            place["from"] = origin
        return place

    def step(self, values: NDArray[Any] | Sequence[float]) -> int:
        """Return n if only every n-th sample of a column is stored; 1 for a short column."""
        return self.every if np.shape(values)[-1] > _LONG else 1

    def text(self) -> str:
        """Return all columns in base64, little endian; "" if no column is stored."""
        if not self._parts:
            return ""
        return base64.b64encode(np.concatenate(self._parts).tobytes()).decode("ascii")


def extremes(values: Any, most: int) -> NDArray[np.int64]:
    """Return the indices, ascending, of the samples that are drawn if a curve has too many.

    They are the first and the last sample, and the smallest and the largest finite sample of each
    of many equally long intervals, so that no peak is lost.

    Parameters
    ----------
    values : (n,) values of the curve.
    most : approximate largest number of samples that are drawn. If there are no more, all indices
        are returned.
    """
    count = len(values)
    if count <= most:
        return np.arange(count)
    lengths = np.full(most // 2, count // (most // 2))
    lengths[: count % len(lengths)] += 1
    ends = lengths.cumsum()
    # Indices of the samples by interval. Lengths differ by at most one; in a shorter interval the
    # last sample occurs twice.
    intervals = np.minimum((ends - lengths)[:, None] + np.arange(lengths[0]), ends[:, None] - 1)
    known = np.isfinite(values[intervals])
    chosen = [0, count - 1]
    # Two samples of each interval: the smallest, for which samples that are not finite are replaced
    # by infinity, and the largest, for which they are replaced by minus infinity.
    for replaced, place in ((np.inf, np.argmin), (-np.inf, np.argmax)):
        found = place(np.where(known, values[intervals], replaced), axis=1)
        chosen += intervals[np.arange(len(ends)), found].tolist()
    return np.unique(chosen)
