"""Represent prescribed loads over time: tables, linear segments, and stops of an engine.

A table has rows (t, value), t in s. A load is linear between the rows, and constant before the
first and after the last; two rows with equal t are a jump. A step over a kink or a jump would lose
its order: a run is cut into segments, in each of which all loads are linear, and these into
intervals, from one stop of an engine to the next.
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

if TYPE_CHECKING:  # a scene is read without it
    import numpy as np
    from numpy.typing import NDArray

    Array = NDArray[np.float64]

LoadTable = tuple[tuple[float, float], ...]
Time = TypeVar("Time", "float", "Array")

# A kink closer to a sample than this share of the sample interval is taken to be on it.
ALIGNMENT = 1e-6
# Rows kept between two samples where a quadrature or the unwrapping of angles needs them: all
# steps, or at least half as many as this. Fewer rows of a finer step would make the work of
# dampers less accurate.
MAX_ROWS = 100
# Samples that are far apart need more of them, or the quadrature misses the first decay of a
# damped pitch: one in so many seconds, up to this number, which bounds the memory.
_ROW_STEP = 5e-4
_MOST_ROWS = 1000
# Rows of a segment, at least, where they are integrated by polynomials through so many.
POLYNOMIAL_ROWS = 8

# Place of the rotor's torque in `Scene.load_tables`, and in the segments that are cut from it.
ROTOR_TORQUE = 0


def torque_place(coordinate: int) -> int:
    """Return the place in `Scene.load_tables` of the torque on a coordinate (0: rotor)."""
    return 2 * coordinate - 1 if coordinate else ROTOR_TORQUE


def rest_place(coordinate: int) -> int:
    """Return the place in `Scene.load_tables` of the rest angle of a pitch (1, 2, ...)."""
    return 2 * coordinate


def value_at(table: LoadTable, time: float) -> float:
    """Return a load at `time` (s): at a jump the value after it; 0 where there is no load."""
    following = bisect_right(table, time, key=itemgetter(0))
    if following in (0, len(table)):
        return table[max(following - 1, 0)][1] if table else 0.0
    (t0, value0), (t1, value1) = table[following - 1 : following + 1]
    return value0 + (value1 - value0) * (time - t0) / (t1 - t0)


def values_at(table: LoadTable, times: Array) -> Array:
    """Return a load at (n,) times in s: at a jump the value after it.

    Each value has the bits of `value_at`: the operations are the same, in the same order.
    """
    import numpy as np

    if not table:
        return np.zeros(len(times))
    rows = np.array(table)
    following = np.searchsorted(rows[:, 0], times, side="right")
    # Outside the table both neighbours are its first or last row, and the value is that row's.
    before, after = np.maximum(following - 1, 0), np.minimum(following, len(rows) - 1)
    (t0, value0), (t1, value1) = rows[before].T, rows[after].T
    with np.errstate(all="ignore"):
        between = value0 + (value1 - value0) * (times - t0) / (t1 - t0)
    return np.asarray(np.where(before == after, value0, between))


def is_constant(table: LoadTable) -> bool:
    """Return whether a load has one value at all times, or is none."""
    return len({value for _, value in table}) <= 1


def is_one_table(value: list[Any]) -> bool:
    """Return whether a list of a scene file is the rows of one table.

    Else it has an entry, a number or rows, for each blade.
    """

    def is_row(entry: object) -> bool:
        return isinstance(entry, list) and not any(isinstance(item, list) for item in entry)

    return all(map(is_row, value))


def constant_value(table: LoadTable) -> float:
    """Return the value of a constant load; 0 for one that changes."""
    return value_at(table, 0.0) if is_constant(table) else 0.0


def kink_times(tables: Iterable[LoadTable], end: float) -> list[float]:
    """Return the times (s) of kinks and jumps between 0 and `end`, both excluded, increasing."""
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
    linear_loads : (offset, slope) of each table that it was cut from, in the order of the tables:
        the load is offset + slope t at t s. Exact.
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
    """Cut a run where a load has a kink or a jump.

    Parameters
    ----------
    tables : the loads over time; their order is that of the loads in a segment.
    duration : s, of the run.

    Returns
    -------
    tuple of Segment
        From 0 to the duration, each beginning where the one before ends; a single one where all
        loads are constant.
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
            # The last row up to the start and the first from the end on: no row lies between them.
            # At a jump these are the rows of the segment's own side.
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
    """Return the loads at given times, at a jump the values before it.

    Parameters
    ----------
    parts : the segments of a run.
    times : (n,) s, at least 0; at 0 a load has the value after a jump.

    Returns
    -------
    ndarray, shape (loads, n)
    """
    import numpy as np

    # A time that is off a jump by rounding belongs to the segment before it.
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
    sample_intervals : how many intervals between samples it covers; 1 where it is a part of one.
    ends_at_sample : whether a sample is at its end.
    segment : the loads on it.
    """

    start: float
    end: float
    sample_intervals: int
    ends_at_sample: bool
    segment: Segment


def intervals(parts: Sequence[Segment], samples: int, *, every_sample: bool) -> list[Interval]:
    """Divide a run into intervals that an engine integrates in one go.

    Parameters
    ----------
    parts : the segments of the run.
    samples : number of equally spaced samples, both ends included.
    every_sample : whether to stop at every sample; else only where a load has a kink, and at the
        samples around a kink that lies between two of them.

    Returns
    -------
    list of Interval
    """
    duration = parts[-1].end
    spacing = duration / (samples - 1)
    times = [*(k * spacing for k in range(samples - 1)), duration]
    # Places of the stops, counted in sample intervals: whole numbers at samples, others between.
    at_samples = set(range(samples)) if every_sample else {0, samples - 1}
    between: dict[float, float] = {}  # time of a stop, by its place
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
        # By its middle: its ends are off those of the segment by rounding where a kink is taken
        # to be on a sample.
        segment = parts[bisect_right(segment_starts, 0.5 * (t0 + t1)) - 1]
        stops.append(Interval(t0, t1, max(1, round(end - start)), end not in between, segment))
    return stops


def step_within(segment: Segment, step: float) -> float:
    """Return the largest step (s) with which a segment has a row for each point of a polynomial.

    Work is integrated through these rows; between two kinks of the loads that are a step or two
    apart it would else be of second order.

    Parameters
    ----------
    segment : the loads.
    step : s, the largest step allowed elsewhere.
    """
    return min(step, (segment.end - segment.start) / (POLYNOMIAL_ROWS - 1))


def steps_and_rows(span: float, step: float, rows_between: bool) -> tuple[int, int]:
    """Return how many steps an interval takes, and how many rows of them are kept.

    Parameters
    ----------
    span : s, of the interval.
    step : s, the largest step allowed.
    rows_between : whether rows are needed within the interval; else the one at its end is kept.

    Returns
    -------
    steps, rows : int
        The number of equal steps, and a divisor of it.
    """
    steps = max(1, math.ceil(span / step * (1.0 - 1e-9)))
    if not rows_between:
        return steps, 1
    most_rows = min(max(MAX_ROWS, math.ceil(span / _ROW_STEP)), _MOST_ROWS)
    per_row = math.ceil(steps / most_rows)
    rows = math.ceil(steps / per_row)
    return per_row * rows, rows
