"""Represent prescribed loads over time: tables, linear segments, and stops of an engine.

A table has rows (t, value), with t in s. Between two rows the load is linear. Before the first and
after the last row it is constant. Two rows with equal t are a jump.

An integration step over a kink or a jump would lose its order of convergence. A run is therefore
divided into segments on which every load is linear. Segments are divided into intervals, from one
stop of an engine to the next.
"""

from __future__ import annotations

import functools
import itertools
import math
from bisect import bisect_left, bisect_right
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from fractions import Fraction
from operator import itemgetter
from typing import TYPE_CHECKING, Any, TypeVar

if TYPE_CHECKING:  # reading a scene does not need NumPy
    import numpy as np
    from numpy.typing import NDArray

    Array = NDArray[np.float64]

LoadTable = tuple[tuple[float, float], ...]
Time = TypeVar("Time", "float", "Array")

# A kink that is closer to a sample than this share of the sample interval counts as on the sample.
ALIGNMENT = 1e-6
# Most rows that an engine keeps between two samples, if a quadrature or the unwrapping of angles
# needs them. If there are at most MAX_ROWS steps between the samples, each is a row; otherwise at
# least MAX_ROWS / 2 rows are kept. With fewer rows the work of dampers would be less accurate.
MAX_ROWS = 100
# If samples are far apart, MAX_ROWS rows are too few: the quadrature would miss the first decay of
# a damped pitch. The limit is then a row in _ROW_STEP seconds, but at most _MOST_ROWS rows, which
# limits the memory.
_ROW_STEP = 5e-4  # s
_MOST_ROWS = 1000
# Work is integrated by polynomials through so many rows; `step_within` makes a segment have them.
POLYNOMIAL_ROWS = 8

# Place of the rotor torque in `Scene.load_tables`, and among the loads of a `Segment`.
ROTOR_TORQUE = 0


def torque_place(coordinate: int) -> int:
    """Return the place in `Scene.load_tables` of the torque on a coordinate (0: rotor)."""
    return 2 * coordinate - 1 if coordinate else ROTOR_TORQUE


def rest_place(coordinate: int) -> int:
    """Return the place in `Scene.load_tables` of the rest angle of a coordinate (1: pitch 1)."""
    return 2 * coordinate


def value_at(table: LoadTable, time: float) -> float:
    """Return a load at `time` (s): at a jump the value after it; 0 if the table is empty."""
    following = bisect_right(table, time, key=itemgetter(0))
    if following in (0, len(table)):
        return table[max(following - 1, 0)][1] if table else 0.0
    (t0, value0), (t1, value1) = table[following - 1 : following + 1]
    return value0 + (value1 - value0) * (time - t0) / (t1 - t0)


def values_at(table: LoadTable, times: Array) -> Array:
    """Return a load at (n,) times in s: at a jump the value after it; 0 if the table is empty.

    Each value has the same bits as that of `value_at`, because the operations and their order are
    the same.
    """
    import numpy as np

    if not table:
        return np.zeros(len(times))
    rows = np.array(table)
    following = np.searchsorted(rows[:, 0], times, side="right")
    # A time outside the table has the first or the last row as both neighbours. The load then has
    # the value of this row.
    before, after = np.maximum(following - 1, 0), np.minimum(following, len(rows) - 1)
    (t0, value0), (t1, value1) = rows[before].T, rows[after].T
    with np.errstate(all="ignore"):
        between = value0 + (value1 - value0) * (times - t0) / (t1 - t0)
    return np.asarray(np.where(before == after, value0, between))


def is_constant(table: LoadTable) -> bool:
    """Return whether a load has the same value at all times, or its table is empty."""
    return len({value for _, value in table}) <= 1


def is_one_table(value: list[Any]) -> bool:
    """Return whether a list of a scene file consists of the rows of one table over time.

    Otherwise the list has an entry for each blade: a table, or a number.
    """

    def is_row(entry: object) -> bool:
        return isinstance(entry, list) and not any(isinstance(item, list) for item in entry)

    return all(map(is_row, value))


def constant_value(table: LoadTable) -> float:
    """Return the value of a constant load; 0 if the load changes over time."""
    return value_at(table, 0.0) if is_constant(table) else 0.0


def kink_times(tables: Iterable[LoadTable], end: float) -> list[float]:
    """Return the sorted times (s) of kinks and jumps between 0 and `end`, both excluded."""
    times: set[float] = set()
    for table in tables:
        if not is_constant(table):
            times.update(time for time, _ in table if 0.0 < time < end)
    return sorted(times)


@dataclass(frozen=True)
class Segment:
    """A part of a run on which every load is linear over time.

    Attributes
    ----------
    start, end : s.
    linear_loads : (offset, slope) of each load, in the order of the tables given to `segments`.
        The load is offset + slope t, with t in s from the start of the run. The fractions are
        exact.
    """

    start: float
    end: float
    linear_loads: tuple[tuple[Fraction, Fraction], ...]

    @functools.cached_property
    def values(self) -> tuple[float, ...]:
        """Return the loads at the start of the segment, (loads,)."""
        start = Fraction(self.start)
        return tuple(float(offset + slope * start) for offset, slope in self.linear_loads)

    @functools.cached_property
    def slopes(self) -> tuple[float, ...]:
        """Return the slopes of the loads, (loads,), per s."""
        return tuple(float(slope) for _, slope in self.linear_loads)

    def at(self, load: int, time: Time) -> Time:
        """Return one load at a time (s), or at (n,) times, of the segment."""
        return self.values[load] + self.slopes[load] * (time - self.start)

    def loads_at(self, time: float) -> list[float]:
        """Return all loads at a time (s) of the segment, (loads,)."""
        return [self.at(load, time) for load in range(len(self.linear_loads))]


def segments(tables: Sequence[LoadTable], duration: float) -> tuple[Segment, ...]:
    """Divide a run into segments, at the times at which a load has a kink or a jump.

    Parameters
    ----------
    tables : the loads over time. Each segment has its loads in the same order.
    duration : duration of the run, s.

    Returns
    -------
    tuple of Segment
        The segments from 0 to the duration, without gaps. If all loads are constant there is one
        segment.
    """
    cuts = [0.0, *kink_times(tables, duration), duration]
    spans = list(itertools.pairwise(cuts))
    by_table = []
    for table in tables:
        if is_constant(table):
            constant = Fraction(table[0][1] if table else 0)
            by_table.append([(constant, Fraction(0))] * len(spans))
            continue
        times = [time for time, _ in table]
        linear_loads = []
        for start, end in spans:
            # `before` is the last row at or before the start, `after` the first row at or after the
            # end. Of the two rows of a jump, this is the row on the side of the segment.
            before = table[max(bisect_right(times, start) - 1, 0)]
            after = table[min(bisect_left(times, end), len(table) - 1)]
            t0, value0 = map(Fraction, before)
            t1, value1 = map(Fraction, after)
            slope = Fraction(0)
            if t1 > t0 and value1 != value0:
                slope = (value1 - value0) / (t1 - t0)
            linear_loads.append((value0 - slope * t0, slope))
        by_table.append(linear_loads)
    parts = []
    for i, (start, end) in enumerate(spans):
        parts.append(Segment(start, end, tuple(linear_loads[i] for linear_loads in by_table)))
    return tuple(parts)


def values_before(parts: Sequence[Segment], times: Array) -> Array:
    """Return the loads at given times: at a jump the values before it.

    Parameters
    ----------
    parts : the segments of a run.
    times : (n,) s, not negative. At a jump at time 0 the value after it is returned.

    Returns
    -------
    ndarray, shape (loads, n)
    """
    import numpy as np

    # A time that is later than a jump only by rounding belongs to the segment before the jump.
    which = np.searchsorted([part.end for part in parts[:-1]], times * (1.0 - 1e-12))
    values = np.array([part.values for part in parts])[which]
    slopes = np.array([part.slopes for part in parts])[which]
    starts = np.array([part.start for part in parts])[which]
    return np.asarray((values + slopes * (times - starts)[:, None]).T)


@dataclass(frozen=True)
class Interval:
    """A part of a segment from one stop of an engine to the next.

    Attributes
    ----------
    start, end : s.
    sample_intervals : number of sample intervals that it covers; 1 for a part of a sample interval.
    ends_at_sample : whether its end is the time of a sample.
    segment : the segment of which it is a part, with the loads.
    """

    start: float
    end: float
    sample_intervals: int
    ends_at_sample: bool
    segment: Segment


def intervals(parts: Sequence[Segment], samples: int, *, every_sample: bool) -> list[Interval]:
    """Divide a run into intervals, each of which an engine integrates without a stop.

    Parameters
    ----------
    parts : the segments of the run.
    samples : number of equally spaced samples, both ends included.
    every_sample : whether the engine stops at every sample. Otherwise it stops only at kinks and
        jumps of a load, and at the samples before and after a kink that is between two samples.

    Returns
    -------
    list of Interval
    """
    duration = parts[-1].end
    spacing = duration / (samples - 1)
    times = [*(k * spacing for k in range(samples - 1)), duration]
    # The place of a stop is its time in sample intervals: a whole number if it is at a sample.
    at_samples = set(range(samples)) if every_sample else {0, samples - 1}
    between: dict[float, float] = {}  # time (s) of each stop between samples, by its place
    for part in parts[1:]:
        place = part.start / spacing
        nearest = round(place)
        if abs(place - nearest) <= ALIGNMENT:
            at_samples.add(nearest)
        else:
            at_samples.update((math.floor(place), math.ceil(place)))
            between[place] = part.start
    segment_starts = [part.start for part in parts]
    stops = []
    for start, end in itertools.pairwise(sorted([*at_samples, *between])):
        t0 = between.get(start, times[math.floor(start)])
        t1 = between.get(end, times[math.floor(end)])
        # The segment is found by the middle of the interval. The ends may differ slightly from
        # those of the segment, since a kink close to a sample counts as on the sample.
        segment = parts[bisect_right(segment_starts, 0.5 * (t0 + t1)) - 1]
        stops.append(Interval(t0, t1, max(1, round(end - start)), end not in between, segment))
    return stops


def step_within(segment: Segment, step: float) -> float:
    """Return the largest step (s) with which a segment has at least POLYNOMIAL_ROWS rows.

    The work is integrated by polynomials through these rows. Between two kinks that are only one or
    two steps apart, it would otherwise be of second order.

    Parameters
    ----------
    segment : the segment.
    step : s, the largest step allowed in longer segments.
    """
    return min(step, (segment.end - segment.start) / (POLYNOMIAL_ROWS - 1))


def steps_and_rows(span: float, step: float, rows_between: bool) -> tuple[int, int]:
    """Return the number of steps from one sample to the next, and how many are kept as rows.

    Parameters
    ----------
    span : s, time between the samples, or between a sample and a kink that is nearer.
    step : s, the largest step allowed.
    rows_between : whether rows are needed within the span. Otherwise only the row at its end is
        kept.

    Returns
    -------
    steps, rows : int
        The number of equal steps, and the number of rows, which divides the number of steps.
    """
    steps = max(1, math.ceil(span / step * (1.0 - 1e-9)))
    if not rows_between:
        return steps, 1
    most_rows = min(max(MAX_ROWS, math.ceil(span / _ROW_STEP)), _MOST_ROWS)
    per_row = math.ceil(steps / most_rows)
    rows = math.ceil(steps / per_row)
    return per_row * rows, rows
