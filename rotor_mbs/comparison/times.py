"""Order the rows of a motion by their times, and find the rounding of the times.

Programs write a row twice at an event, rows of an initialisation before t = 0, rows from the end to
the start. Repeated rows are dropped; rows that contradict each other are refused.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from rotor_mbs.errors import InputError
from rotor_mbs.scenario.keys import counted
from rotor_mbs.scenario.time_table import ALIGNMENT
from rotor_mbs.solution.trajectory import Array

_NEAR_ZERO = 1e-9  # of an interval: a time that is nearer to 0 is taken as 0
_SAME_STATE = 1e-9  # absolute or relative: difference of the same state computed twice
_EQUAL = 1e-6  # of an interval between rows
_MOSTLY = 0.9  # of the intervals
_STEP_DIGITS = 12  # of a step that was chosen
_ROUNDOFF = 2.0**-53
_MIN_ROWS = 3  # fewer have no motion to be compared


class OrderedRows(NamedTuple):
    """The rows that are compared.

    Attributes
    ----------
    places : (n,) numbers of the rows in the data, in the order of their times.
    time : (n,) s, increasing from 0 or later.
    notes : what was done to the rows, a line each.
    """

    places: NDArray[np.int64]
    time: Array
    notes: tuple[str, ...]


def ordered_rows(
    source: str, time: Array, motion: Array, others: Array, jumps: Sequence[float]
) -> OrderedRows:
    """Order rows by their times, one row for each time, from t = 0 on.

    Parameters
    ----------
    source : what messages call the data.
    time : (n,) s, in the order of the data.
    motion : (n, channels) angles and rates, rad and rad/s.
    others : (n, channels) loads, N and N m.
    jumps : s, times at which a load of the scene jumps.

    Raises
    ------
    InputError
        If two different rows have one time, unless a load jumps there and they have the same
        motion; or if fewer than three rows are left.
    """
    notes = []
    if len(time) < _MIN_ROWS:
        raise InputError(f"{source}: {counted(len(time), 'row')}; allowed: {_MIN_ROWS} or more")
    steps = np.abs(np.diff(time))
    usual = float(np.median(steps[steps > 0.0])) if (steps > 0.0).any() else 0.0
    time = np.where(np.abs(time) <= _NEAR_ZERO * usual, 0.0, time)
    places = np.arange(len(time))
    if (np.diff(time) < 0.0).any():
        is_descending = bool((np.diff(time) <= 0.0).all())
        if is_descending:
            # At a jump of a load, a descending file has the row after the jump first. The sort
            # keeps the order of rows of one time, so the rows are reversed before it.
            places = places[::-1]
        places = places[np.argsort(time[places], kind="stable")]
        was = "from the end to the start" if is_descending else "not in the order of their times"
        notes.append(f"the rows are {was}: sorted")
    early = int(np.count_nonzero(time < 0.0))
    if early == len(time):
        allowed = "times from 0, the scene's start (`offset` of the time)"
        raise InputError(f"{source}: ends at t = {time.max():g} s; allowed: {allowed}")
    if early:
        places = places[time[places] >= 0.0]
        verb = "is" if early == 1 else "are"
        notes.append(f"{counted(early, 'row')} before t = 0 {verb} not compared")
    is_kept = np.ones(len(places), dtype=bool)
    twice = at_jumps = 0
    for row in np.flatnonzero(np.diff(time[places]) == 0.0):
        first, second = places[row], places[row + 1]
        is_kept[row] = False
        if _are_same(motion[first], motion[second], 0.0) and _are_same(
            others[first], others[second], 0.0
        ):
            twice += 1
        elif _are_same(motion[first], motion[second], _SAME_STATE) and any(
            abs(time[first] - jump) <= ALIGNMENT * usual for jump in jumps
        ):
            at_jumps += 1
        else:
            problem = f"the time of row {second + 1}, {time[second]:.9g} s, repeats that of row"
            allowed = "one row for each time, or two with the same angles where a load jumps"
            raise InputError(
                f"{source}: {problem} {first + 1} with other numbers; allowed: {allowed}"
            )
    if twice:
        verb = "is" if twice == 1 else "are"
        notes.append(f"{counted(twice, 'row')} {verb} there twice: one of each is compared")
    if at_jumps:
        text = "rows before a jump of a load are not compared, those after it are"
        if at_jumps == 1:
            text = "row before a jump of a load is not compared, the one after it is"
        notes.append(f"{at_jumps} {text}")
    places = places[is_kept]
    if len(places) < _MIN_ROWS:
        problem = f"{counted(len(places), 'row')} at different times from t = 0 on"
        raise InputError(f"{source}: {problem}; allowed: {_MIN_ROWS} or more")
    return OrderedRows(places, time[places], tuple(notes))


def _are_same(first: Array, second: Array, tolerance: float) -> bool:
    """Return whether two rows are equal to a tolerance, relative for numbers larger than 1."""
    scale = np.maximum(np.maximum(np.abs(first), np.abs(second)), 1.0)
    return bool((np.abs(first - second) <= tolerance * scale).all())


def rounding_of_steps(time: Array) -> Array | None:
    """Find the rounding of times whose intervals are equal, or equal but for a few.

    Equal intervals are taken as exact, though the times have few digits; a few that differ are
    mistakes in the times. Times that are sums of a step are off by the rounding of the additions,
    which no single time shows.

    Parameters
    ----------
    time : (n,) s, increasing.

    Returns
    -------
    ndarray or None
        (n,) s; None for times whose intervals are not equal.
    """
    intervals = np.diff(time)
    usual = float(np.median(intervals))
    is_usual = np.abs(intervals - usual) <= _EQUAL * usual
    if not is_usual.mean() >= _MOSTLY:
        return None
    rounding: Array = np.abs(time) * _ROUNDOFF
    if not is_usual.all():
        return rounding
    mean = (time[-1] - time[0]) / (len(time) - 1)
    rows = np.arange(len(time))
    from_line = np.abs(time - (time[0] + mean * rows))
    if from_line.max() <= 4.0 * _ROUNDOFF * np.abs(time).max():
        return rounding
    # Otherwise the times are sums of a chosen step: the mean interval, rounded to some digits. The
    # additions make them differ from multiples of this step; a larger difference is no rounding.
    digits = _STEP_DIGITS - 1 - math.floor(math.log10(mean))
    from_chosen = np.abs(time - (time[0] + round(mean, digits) * rows))
    return np.asarray(rounding + np.minimum(from_chosen, rows * rounding))
