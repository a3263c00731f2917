"""Store the numbers of a page's plots: columns in single precision, each once, in base64."""

from __future__ import annotations

import base64
import hashlib
from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

# Where values exceed their range by this factor, as a rotor angle after an hour does, single
# precision would show steps: the difference from the first value is stored.
_FAR_FROM_ZERO = 1000.0
_LONG = 2000  # samples; a longer column may be thinned. About two per pixel of a page
# About the largest number of single precision.
_LARGEST = 3.0e38


class CurveStore:
    """Columns of numbers for the script of a page.

    The description of a column tells where it lies. "at" is [first, count], in numbers from the
    beginning; for a table of several runs [first, count, stride], with the stride from a run to the
    next. "from", if there is one, is a number to be added to each value.

    every : of long columns only one in so many samples is stored, so that a page does not become
    too large.
    """

    def __init__(self, every: int = 1) -> None:
        self.every = every
        self._parts: list[NDArray[np.float32]] = []
        self._places: dict[bytes, int] = {}
        self.size = 0

    def add(self, values: NDArray[Any] | Sequence[float]) -> dict[str, Any]:
        """Store a column, or the rows of a table, and return its description.

        Parameters
        ----------
        values : (n,) the column; or (runs, n), of which the page shows one row at a time. NaN is a
            gap.

        Returns
        -------
        dict
            Where the numbers lie and what is added to them, see the class.
        """
        table = np.asarray(values, dtype=np.float64)[..., :: self.step(values)]
        count = int(table.shape[-1])
        known = table[np.isfinite(table)]
        origin = 0.0
        if len(known) and float(np.abs(known).max()) > _FAR_FROM_ZERO * float(np.ptp(known)) > 0.0:
            origin = float(known[0])
        with np.errstate(invalid="ignore"):
            column = np.clip(table - origin, -_LARGEST, _LARGEST).astype("<f4").ravel()
        # The limits make infinities finite; they are gaps, as NaN is.
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
        """Return how many samples of a column make one that is stored: 1 for a short column."""
        return self.every if np.shape(values)[-1] > _LONG else 1

    def text(self) -> str:
        """Return all columns in base64, little endian; "" where none is stored."""
        if not self._parts:
            return ""
        return base64.b64encode(np.concatenate(self._parts).tobytes()).decode("ascii")


def extremes(values: Any, most: int) -> NDArray[np.int64]:
    """Return the indices of the samples to draw, ascending.

    They are the ends, and the smallest and the largest finite sample of equal intervals, so that no
    peak is lost.

    Parameters
    ----------
    values : (n,).
    most : approximate number of samples; where there are no more, all are returned.
    """
    count = len(values)
    if count <= most:
        return np.arange(count)
    lengths = np.full(most // 2, count // (most // 2))
    lengths[: count % len(lengths)] += 1
    ends = lengths.cumsum()
    # The samples of each interval; a shorter one has its last sample twice.
    intervals = np.minimum((ends - lengths)[:, None] + np.arange(lengths[0]), ends[:, None] - 1)
    known = np.isfinite(values[intervals])
    chosen = [0, count - 1]
    # Two samples of each; NaN is replaced by what is never the smallest or the largest.
    for replaced, place in ((np.inf, np.argmin), (-np.inf, np.argmax)):
        found = place(np.where(known, values[intervals], replaced), axis=1)
        chosen += intervals[np.arange(len(ends)), found].tolist()
    return np.unique(chosen)
