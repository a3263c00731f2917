"""Order the rows of a trajectory by their times, and find the rounding of the times.

Some programs write a row twice at an event, some write rows of an initialisation before t = 0, and
some write the rows from the end to the start. Rows that repeat another row are dropped. Data with
two different rows at one time are refused. An exception are rows that differ only in their loads,
at a time at which a load jumps: the row after the jump is kept.
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

_NEAR_ZERO = 1e-9  # a time whose distance from 0 is at most this share of an interval is taken as 0
# Largest difference, absolute or relative, of two rows that are taken as one state computed twice.
_SAME_STATE = 1e-9
_EQUAL = 1e-6  # relative: intervals that differ by no more than this are taken as equal
_MOSTLY = 0.9  # if at least this share of intervals is equal, the others are taken as mistakes
_STEP_DIGITS = 12  # largest number of significant digits of a step that a user has chosen
_ROUNDOFF = 2.0**-53  # relative rounding error of double precision
_MIN_ROWS = 3  # smallest number of rows that are compared as a motion


class OrderedRows(NamedTuple):
    """The rows that are compared.

    Attributes
    ----------
    places : (n,) indices of these rows in the data, in the order of their times.
    time : (n,) times of these rows, s, increasing from 0 or later.
    notes : what was done to the rows of the data, a line each.
    """

    places: NDArray[np.int64]
    time: Array
    notes: tuple[str, ...]


def ordered_rows(
    source: str, time: Array, motion: Array, others: Array, jumps: Sequence[float]
) -> OrderedRows:
    """Order rows by their times, and keep one row for each time from t = 0 on.

    Parameters
    ----------
    source : name of the data in messages.
    time : (n,) times, s, in the order of the data.
    motion : (n, channels) angles and rates, rad and rad/s.
    others : (n, channels) loads, N and N m.
    jumps : times, s, at which a load of the scene jumps.

    Raises
    ------
    InputError
        If two rows at one time differ, unless only their loads differ and a load of the scene jumps
        at this time; or if fewer than three rows are left.
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
            # At a jump of a load there are two rows at one time. In a file with descending times,
            # the row of the state after the jump comes first. Sorting keeps the order of rows with
            # equal times, so the rows are reversed before they are sorted.
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
    """Return whether two rows are equal within a tolerance.

    Parameters
    ----------
    first, second : (channels,) numbers of the rows.
    tolerance : largest difference; it is relative for numbers above 1, and absolute for others.
    """
    scale = np.maximum(np.maximum(np.abs(first), np.abs(second)), 1.0)
    return bool((np.abs(first - second) <= tolerance * scale).all())


def rounding_of_steps(time: Array) -> Array | None:
    """Find the rounding of times whose intervals are nearly all equal.

    Times with equal intervals are taken as exact to double precision, even if they have few digits.
    If a few intervals differ from the others, they are taken as mistakes in the times, not as
    rounding. A program may compute its times by adding a step repeatedly. The rounding of these
    times is that of the additions, and the digits of a time do not show it.

    Parameters
    ----------
    time : (n,) s, increasing.

    Returns
    -------
    ndarray or None
        (n,) the rounding of each time, s; None if too few intervals are equal.
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
    # The times are now taken as sums of a chosen step, which is the mean interval rounded to
    # _STEP_DIGITS digits. The rounding of the additions makes the sums differ from multiples of the
    # step. A difference larger than n roundings in row n is not explained by the additions.
    digits = _STEP_DIGITS - 1 - math.floor(math.log10(mean))
    from_chosen = np.abs(time - (time[0] + round(mean, digits) * rows))
    return np.asarray(rounding + np.minimum(from_chosen, rows * rounding))
