"""Loads over time as tables ((t, value), ...), t in s: linear between the rows, constant before the first and after the
last; two rows with equal t are a jump. A step over a kink loses its order: a run is cut into intervals without."""

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

Table = tuple[tuple[float, float], ...]
Time = TypeVar("Time", "float", "Array")

# A kink closer to a sample than this share of the sample interval is taken to be on it.
ALIGNMENT = 1e-6
# Rows kept between two samples where a quadrature or the unwrapping of angles needs them: all steps, or at least half
# as many as this. Fewer rows of a finer step would make the work of dampers less accurate.
MAX_ROWS = 100


def value_at(table: Table, time: float) -> float:
    """Value at `time` in s; at a jump, the value after it; 0 where there is no load."""
    following = bisect_right(table, time, key=itemgetter(0))
    if following in (0, len(table)):
        return table[max(following - 1, 0)][1] if table else 0.0
    (t0, value0), (t1, value1) = table[following - 1 : following + 1]
    return value0 + (value1 - value0) * (time - t0) / (t1 - t0)


def values_at(table: Table, times: Array) -> Array:
    import numpy as np

    return np.array([value_at(table, time) for time in times.tolist()])


def is_constant(table: Table) -> bool:
    return len({value for _, value in table}) <= 1


def is_one_table(value: list[Any]) -> bool:
    """Whether a list of a scene file is the rows of one table; else it has an entry (number or rows) for each blade."""
    return all(isinstance(row, list) and not any(isinstance(entry, list) for entry in row) for row in value)


def constant_value(table: Table) -> float:
    return value_at(table, 0.0) if is_constant(table) else 0.0


def knots(tables: Iterable[Table], end: float) -> list[float]:
    """Times in s, increasing, between 0 and `end`, at which one of the tables has a kink or a jump."""
    return sorted({time for table in tables if not is_constant(table) for time, _ in table if 0.0 < time < end})


@dataclass(frozen=True)
class Segment:
    """Linear loads from `start` to `end` (s): load i is offset + slope t, lines[i] = (offset, slope), exact."""

    start: float
    end: float
    lines: tuple[tuple[Fraction, Fraction], ...]

    @functools.cached_property
    def values(self) -> tuple[float, ...]:
        """(loads,) at its start."""
        return tuple(float(offset + slope * Fraction(self.start)) for offset, slope in self.lines)

    @functools.cached_property
    def slopes(self) -> tuple[float, ...]:
        """(loads,) per s."""
        return tuple(float(slope) for _, slope in self.lines)

    def at(self, load: int, time: Time) -> Time:
        """One load at one time in s, or at (n,) times."""
        return self.values[load] + self.slopes[load] * (time - self.start)

    def loads_at(self, time: float) -> list[float]:
        return [self.at(load, time) for load in range(len(self.lines))]


def segments(tables: Sequence[Table], duration: float) -> tuple[Segment, ...]:
    """The whole duration (s), cut where a table has a kink or a jump; one segment where all are constant."""
    cuts = [0.0, *knots(tables, duration), duration]
    parts = list(itertools.pairwise(cuts))
    lines = []  # offset and slope between every two cuts, of each table
    for table in tables:
        if is_constant(table):
            lines.append([(Fraction(table[0][1] if table else 0), Fraction(0))] * len(parts))
            continue
        times = [time for time, _ in table]
        of_table = []
        for start, end in parts:
            before = table[max(bisect_right(times, start) - 1, 0)]
            after = table[min(bisect_left(times, end), len(table) - 1)]
            (t0, value0), (t1, value1) = (map(Fraction, row) for row in (before, after))
            slope = (value1 - value0) / (t1 - t0) if t1 > t0 and value1 != value0 else Fraction(0)
            of_table.append((value0 - slope * t0, slope))
        lines.append(of_table)
    return tuple(Segment(*part, tuple(of_table[i] for of_table in lines)) for i, part in enumerate(parts))


def values_before(parts: Sequence[Segment], times: Array) -> Array:
    """(loads, n) at (n,) times in s: at a jump the value before it, at 0 the one after."""
    import numpy as np

    which = np.searchsorted([part.end for part in parts[:-1]], times * (1.0 - 1e-12))
    values, slopes = (np.array([getattr(part, name) for part in parts])[which] for name in ("values", "slopes"))
    starts = np.array([part.start for part in parts])[which]
    return np.asarray((values + slopes * (times - starts)[:, None]).T)


@dataclass(frozen=True)
class Interval:
    """From one stop of an engine to the next, s, within one segment."""

    start: float
    end: float
    sample_intervals: int  # how many intervals between samples it covers; 1 where it is a part of one
    ends_at_sample: bool  # whether a sample is at its end
    segment: Segment


def intervals(parts: Sequence[Segment], samples: int, *, every_sample: bool) -> list[Interval]:
    """The run from stop to stop: at every kink of a load, and at every sample or at those around a kink alone."""
    duration = parts[-1].end
    spacing = duration / (samples - 1)
    times = [*(k * spacing for k in range(samples - 1)), duration]
    cuts = set(range(samples)) if every_sample else {0, samples - 1}
    between: dict[float, float] = {}
    for part in parts[1:]:
        place = part.start / spacing
        near = round(place)
        if abs(place - near) <= ALIGNMENT:
            cuts.add(near)
        else:
            cuts.update((math.floor(place), math.ceil(place)))
            between[place] = part.start
    starts = [part.start for part in parts]
    stops = []
    for start, end in itertools.pairwise(sorted([*cuts, *between])):
        t0, t1 = (between.get(place, times[math.floor(place)]) for place in (start, end))
        segment = parts[bisect_right(starts, 0.5 * (t0 + t1)) - 1]
        stops.append(Interval(t0, t1, max(1, round(end - start)), end not in between, segment))
    return stops


def steps_and_rows(span: float, step: float, rows_between: bool) -> tuple[int, int]:
    """Equal steps of at most `step` s over one interval of `span` s, and rows to keep in it: a divisor of the steps."""
    steps = max(1, math.ceil(span / step * (1.0 - 1e-9)))
    if not rows_between:
        return steps, 1
    per_row = math.ceil(steps / MAX_ROWS)
    rows = math.ceil(steps / per_row)
    return per_row * rows, rows
