"""Loads over time as tables ((t, value), ...), t in s: linear between the rows, constant before the first and after the
last; two rows with equal t are a jump; () where there is no such load. Must not know scenes.
"""

from __future__ import annotations

from bisect import bisect_right
from collections.abc import Iterable
from operator import itemgetter
from typing import Any

Table = tuple[tuple[float, float], ...]


def value_at(table: Table, time: float) -> float:
    """Value at `time` in s; at a jump, the value after it; 0 where there is no load.

    >>> value_at(((0.0, 1.0), (2.0, 5.0), (2.0, 7.0)), 2.0)
    7.0
    """
    following = bisect_right(table, time, key=itemgetter(0))
    if following in (0, len(table)):
        return table[max(following - 1, 0)][1] if table else 0.0
    (t0, value0), (t1, value1) = table[following - 1 : following + 1]
    return value0 + (value1 - value0) * (time - t0) / (t1 - t0)


def is_constant(table: Table) -> bool:
    """Whether the value never changes."""
    return len({value for _, value in table}) <= 1


def is_one_table(value: list[Any]) -> bool:
    """Whether a list of a scene file is the rows of one table; else it has an entry (number or rows) for each blade."""
    return all(isinstance(row, list) and not any(isinstance(entry, list) for entry in row) for row in value)


def knots(tables: Iterable[Table], end: float) -> list[float]:
    """Times in s, increasing, between 0 and `end`, at which one of the tables has a kink or a jump."""
    return sorted({time for table in tables if not is_constant(table) for time, _ in table if 0.0 < time < end})
