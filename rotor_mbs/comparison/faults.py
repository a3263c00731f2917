"""Faults at a time, recognized by the defects of one interval or of a few beside each other.

A row that is stuck, repeated or wrong, a load that jumps a row late, another state from some row
on: each leaves defects of its own pattern in one to three intervals, and none in the others.
"""

from __future__ import annotations

import itertools
import math
from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from rotor_mbs.comparison.data_defects import AT_FLOOR, JudgedDefects
from rotor_mbs.models.lagrange import closed_form
from rotor_mbs.models.lagrange.defects import explicit_steps, quick_ends
from rotor_mbs.models.lagrange.parameters import rotor_form
from rotor_mbs.scenario.time_table import torque_place
from rotor_mbs.solution.trajectory import Array

UNKNOWN_FAULT = "a fault"  # begins the text of a fault of which only the time is known
_MAX_NAMED = 6  # faults
_MAX_STEPS = 512  # of Runge and Kutta in an interval
_STANDS_OUT = 30.0  # times the median of the defects
_FAINT = 0.02  # of the largest defect: smaller ones are not reported beside it
_EVERYWHERE = 0.6  # of the intervals
# In the share _MOST of the other intervals, defects are within the tolerance, or at most the share
# _OF_OTHERS of the largest defect.
_MOST, _OF_OTHERS = 0.9, 1e-3
# A fault has edges if the median defect of the intervals next to faulty ones is at most this share
# of the median of the faulty ones.
_EDGE = 0.1
_GAP = 6  # intervals: faulty ones that are at most this far apart are one group
_AT_END = 3  # intervals
# If the median of all defects is more than this share of the largest defect, large defects at the
# ends of the data have the same cause as the others, and are no faults.
_OF_ENDS = 1e-3
_PARALLEL = 0.995  # cosine
_NEARLY = 0.05
# Share of the defects that a constant load in each interval may leave: the actual load may change
# within the interval, and its effect does as the rotor turns.
_LEFT_OF_LOADS = 0.15
_OF_COORDINATE = 0.1  # of a coordinate's defects: a load with a smaller share does not act on it
_OF_USUAL = 10.0  # times a channel's median: smaller defects of it do not count
_MIN_CLOCK = 3  # intervals that are late or early alike
_MAX_DIRECTIONS = 20  # intervals of a fault for which loads are searched
_SMALL_TURN = 1e-6  # rad, by the load whose effect is computed: far above round-off, still linear


def faults_in_time(judged: JudgedDefects) -> list[str]:
    """Find faults at a time: intervals whose defects are far larger than those of all others.

    Parameters
    ----------
    judged : the defects of the data.

    Returns
    -------
    list of str
        The first `_MAX_NAMED` groups of faults, in words, and how many more there are. Empty where
        most intervals are wrong, no defect is more than the tolerance, the defects do not end
        abruptly, or the other intervals have errors, too.
    """
    excess = judged.excess
    if judged.largest <= judged.tolerance:
        return []
    # The median is that of right intervals, provided that most intervals are right.
    usual = float(np.median(excess[judged.is_judged])) if judged.is_judged.any() else 0.0
    wrong = np.flatnonzero(excess > max(_STANDS_OUT * usual, _FAINT * judged.largest))
    # An error in most intervals is no fault at a time, though it may be larger in some than in
    # others.
    if not len(wrong) or len(wrong) > _EVERYWHERE * len(excess):
        return []
    # Defects that decrease gradually beside the largest ones are no fault at a time either: a fault
    # has edges.
    edges = np.concatenate([wrong - 1, wrong + 1])
    is_interval = (edges >= 0) & (edges < len(excess))
    edges = edges[is_interval & ~np.isin(edges, wrong)]
    if len(edges):
        beside = float(np.median(excess[edges]))
        if beside > _EDGE * float(np.median(excess[wrong])):
            return []
    # The faults have to explain all: the defects of the other intervals are to be nearly zero.
    others = np.delete(excess, wrong)
    of_others = float(np.quantile(others, _MOST))
    if of_others > max(judged.tolerance, _OF_OTHERS * judged.largest):
        return []
    groups = np.split(wrong, np.flatnonzero(np.diff(wrong) > _GAP) + 1)
    # A filter, or differences in place of rates, makes errors in all rows, the largest at the ends:
    # where the usual defects are large, groups at the ends are left out.
    if usual > _OF_ENDS * judged.largest:
        last = len(excess) - _AT_END
        groups = [group for group in groups if group[-1] >= _AT_END and group[0] < last]
    texts = []
    for group in groups[:_MAX_NAMED]:
        texts += _faults_of(judged, group)
    # The errors of an integrator are larger while the motion is fast. If the other intervals have
    # errors, too, even within the tolerance, a period without a pattern is not named as a cause.
    if of_others > _OF_OTHERS * judged.largest:
        texts = [text for text in texts if not text.startswith(UNKNOWN_FAULT)]
    if len(groups) > _MAX_NAMED:
        end = float(judged.defects.time[groups[-1][-1] + 1])
        texts.append(f"and {len(groups) - _MAX_NAMED} more faults until t = {end:.6g} s")
    return texts


def _faults_of(judged: JudgedDefects, group: NDArray[np.int64]) -> list[str]:
    """Describe the fault of a group of intervals, or the faults of its parts.

    Parameters
    ----------
    judged : the defects of the data.
    group : (k,) numbers of faulty intervals that are near each other.

    Returns
    -------
    list of str
        The faults in words; without a recognized pattern, the period of the fault and the
        coordinate in which it is largest.
    """
    text = _fault(judged, group)
    if text:
        return [text]
    parts = np.split(group, np.flatnonzero(np.diff(group) > 1) + 1)
    texts = [_fault(judged, part) for part in parts] if len(parts) > 1 else []
    if texts and all(texts):
        return texts
    start, end = (float(judged.defects.time[row]) for row in (group[0], group[-1] + 1))
    half = len(judged.defects.moving)
    largest = int(np.abs(judged.values[group]).max(axis=0).argmax()) % half
    label = _label(judged, largest)
    return [f"{UNKNOWN_FAULT} from t = {start:.6g} to {end:.6g} s, largest in the {label}"]


def _fault(judged: JudgedDefects, group: NDArray[np.int64]) -> str:
    """Describe the fault of a group of intervals by its pattern; "" where it has none.

    Parameters
    ----------
    judged : the defects of the data.
    group : (k,) numbers of faulty intervals that are near each other.
    """
    time = judged.defects.time
    start, end = float(time[group[0]]), float(time[group[-1] + 1])
    text = _wrong_row(judged, group) or _wrong_clock(judged, group)
    if text:
        return text
    # Loads are tried next: on which coordinates would they make such defects?
    chosen = group[:: max(1, len(group) // _MAX_DIRECTIONS)]
    loads, acting = _explaining_loads(judged, chosen)
    if len(acting) == 1:
        place = acting[0]
        jump = _load_jump_fault(judged, place, start, end, loads[:, place])
        if jump:
            return f"the load on the {_label(judged, place)} {jump}"
    if len(group) == 1:
        return _change_of_state(judged, int(group[0]))
    if acting:
        amounts = []
        for place in acting:
            amounts.append(f"{loads[:, place].mean():+.3g} N m on the {_label(judged, place)}")
        period = f"from t = {start:.6g} to {end:.6g} s"
        return f"a load that is wrong or missing {period}: on average {' and '.join(amounts)}"
    return ""


def _label(judged: JudgedDefects, place: int) -> str:
    """Return the name of a coordinate by its place among those that move."""
    return judged.scene.coordinate_labels[judged.defects.moving[place]]


def _wrong_row(judged: JudgedDefects, group: NDArray[np.int64]) -> str:
    """Describe a row that is repeated, stuck, wrong or at a wrong time; "" where it is none.

    The defect is the closed form less the data: it has the direction of the motion if the data lag
    behind.

    Parameters
    ----------
    judged : the defects of the data.
    group : (k,) numbers of faulty intervals that are near each other.
    """
    defects, units = judged.defects, judged.units
    first, last = int(group[0]), int(group[-1])
    values = judged.values[group]
    # If a row is repeated, the defect is the motion over the interval; if a time is wrong by a
    # small part of the interval, it is along the rate at the interval's end.
    step_of_data = (defects.states[first + 1] - defects.states[first]) / units
    motion = values[0] + step_of_data
    rate = _state_rate(judged, first)
    along = max(_cosine(values[0], rate), _cosine(values[0], motion), key=abs)
    if len(group) == 1 and abs(along) >= _PARALLEL:
        clock = "late" if along > 0.0 else "early"
        event = "repeated" if along > 0.0 else "omitted and the others renumbered"
        at = f"at t = {defects.time[last + 1]:.6g} s"
        return f"a row {event}, or times {clock} by less than an interval, {at}"
    if len(group) == 2 and last == first + 1:
        # The second interval starts at the wrong row, and ends at a right one: its defect is that
        # of the first interval, carried over the second, with the opposite sign.
        carried = defects.transitions[first + 1] @ (values[0] * units) / units
        if _cosine(values[1], -carried) >= _PARALLEL:
            row = f"row {first + 2}, t = {defects.time[first + 1]:.6g} s"
            if abs(along) >= _PARALLEL:
                return f"a stuck row, or one at a wrong time: {row}"
            return f"a single wrong row: {row}"
    return ""


def _wrong_clock(judged: JudgedDefects, group: NDArray[np.int64]) -> str:
    """Describe intervals over each of which the motion becomes late or early; "" if it does not.

    Parameters
    ----------
    judged : the defects of the data.
    group : (k,) numbers of faulty intervals that are near each other.
    """
    if len(group) < _MIN_CLOCK:
        return ""
    lags = []
    for row in group:
        rate = _state_rate(judged, int(row))
        cosine = _cosine(judged.values[row], rate)
        if abs(cosine) < _PARALLEL:
            return ""
        lags.append(float(judged.values[row] @ rate) / float(rate @ rate))
    if min(lags) < 0.0 < max(lags):
        return ""
    clock = "late" if lags[0] > 0.0 else "early"
    time = judged.defects.time
    period = f"from t = {time[group[0]]:.6g} to {time[group[-1] + 1]:.6g} s"
    lag = f"{abs(float(np.median(lags))):.2g} s"
    intervals = f"each of {len(group)} intervals {period}"
    return f"the motion is {clock} by {lag} more in {intervals}: wrong steps, or times"


def _change_of_state(judged: JudgedDefects, row: int) -> str:
    """Describe the fault of a single interval, number `row`, that no load explains."""
    half = len(judged.defects.moving)
    start, end = (float(time) for time in judged.defects.time[row : row + 2])
    # If the rates jump within the interval, the angles have changed by the jump times the rest of
    # the interval, a share of its length between 0 and 1.
    angles = judged.values[row, :half]
    rates = judged.values[row, half:] * judged.units[half:] * (end - start)
    share = float(angles @ rates) / (float(rates @ rates) or 1.0)
    rest = float(np.linalg.norm(angles - share * rates))
    is_share = -_NEARLY <= share <= 1.0 + _NEARLY
    if is_share and rest <= _NEARLY * float(np.linalg.norm(rates)):
        return f"a jump of rates, or a load of one interval, before t = {end:.6g} s"
    text = f"the motion continues from another state after t = {end:.6g} s"
    sizes = np.abs(judged.values[row])
    place = int(sizes.argmax())
    if place < half and np.delete(sizes, place).max() <= _NEARLY * sizes[place]:
        text += f", or the {_label(judged, place)} is stored from another zero"
    return text


def _state_rate(judged: JudgedDefects, row: int) -> Array:
    """Return the rate of change of the state at the end of an interval, (m,) rad/s.

    Parameters
    ----------
    judged : the defects of the data, whose `units` convert rates to rad.
    row : number of the interval.
    """
    states, time = judged.defects.states, judged.defects.time
    half = states.shape[1] // 2
    ahead = min(row + 2, len(states) - 1)
    # The accelerations follow from the two rows beside the one that may be wrong.
    acceleration = (states[ahead, half:] - states[row, half:]) / (time[ahead] - time[row])
    rates = states[row + 1, half:]
    return np.asarray(np.concatenate([rates, acceleration]) / judged.units)


def _explaining_loads(judged: JudgedDefects, rows: NDArray[np.int64]) -> tuple[Array, list[int]]:
    """Find the loads on the coordinates that explain the defects of some intervals best.

    Parameters
    ----------
    judged : the defects of the data.
    rows : (k,) numbers of the intervals.

    Returns
    -------
    loads : ndarray
        (k, coordinates) N m that the data have in addition.
    acting : list of int
        Places of the coordinates on which they act; none where loads leave too much.
    """
    values, effects = judged.values[rows], _effect_of_unit_load(judged, rows)
    usual = np.median(np.abs(judged.values[judged.is_judged]), axis=0)
    usual = usual + AT_FLOOR * judged.floors[rows].max(axis=0)
    # Each channel is scaled by its own size: a load may move a pitch by a million times as much as
    # the rotor.
    units = np.linalg.norm(values, axis=0) + _OF_USUAL * math.sqrt(len(rows)) * usual
    sizes = np.linalg.norm(effects / units, axis=2)
    if not (np.isfinite(sizes).all() and sizes.all()):
        return np.zeros(sizes.T.shape), []
    # Least squares in each interval, over effects of unit size.
    matrices = (effects / units / sizes[:, :, None]).transpose(1, 2, 0)
    sides = (values / units)[:, :, None]
    solutions = (np.linalg.pinv(matrices) @ sides)[:, :, 0]
    loads = -solutions / sizes.T
    parts = loads.T[:, :, None] * effects
    left = np.linalg.norm((values + parts.sum(axis=0)) / units)
    if left > _LEFT_OF_LOADS * np.linalg.norm(values / units):
        return loads, []
    acting = []
    for place, part in enumerate(parts):
        channels = [place, len(parts) + place]  # its angle and rate
        if np.linalg.norm(part[:, channels] / units[channels]) > _OF_COORDINATE:
            acting.append(place)
    return loads, acting


def _load_jump_fault(
    judged: JudgedDefects, place: int, start: float, end: float, more: Array
) -> str:
    """Describe a wrong load at a jump of a coordinate's prescribed load; "" if there is none.

    Parameters
    ----------
    judged : the defects of the data.
    place : place of the coordinate among those that move.
    start, end : s, the time over which the intervals extend.
    more : (k,) N m that the data have in addition in these intervals.
    """
    table = judged.scene.load_tables[torque_place(judged.defects.moving[place])]
    for (t0, value0), (t1, value1) in itertools.pairwise(table):
        jump = value1 - value0
        is_inside = start * (1.0 - 1e-9) <= t0 <= end * (1.0 + 1e-9)
        if t0 != t1 or not jump or not is_inside:
            continue
        if len(more) == 1 and abs(abs(more[0] / jump) - 1.0) <= _NEARLY:
            side = "late" if more[0] / jump < 0.0 else "early"
            return f"jumps a row {side} at t = {t0:.6g} s, or has a wrong value in this row"
        # A load that is smoothed over a jump is too large in one interval, too small in the next.
        is_balanced = abs(more.sum()) <= _NEARLY * np.abs(more).max()
        if len(more) == 2 and is_balanced and more[0] / jump > 0.0:
            return f"is smoothed over its jump at t = {t0:.6g} s"
    return ""


def _effect_of_unit_load(judged: JudgedDefects, rows: NDArray[np.int64]) -> Array:
    """Compute the change of an interval's end by 1 N m on each of the moving coordinates.

    Parameters
    ----------
    judged : the defects of the data.
    rows : (k,) numbers of the intervals.

    Returns
    -------
    ndarray
        (coordinates, k, m) rad per N m.
    """
    scene, defects, form = judged.scene, judged.defects, rotor_form(judged.scene)
    begins, ends = defects.time[rows], defects.time[rows + 1]
    states = defects.states[rows].T
    steps = explicit_steps(scene, ends - begins, defects.states[rows], _MAX_STEPS) or 1
    free = quick_ends(scene, begins, ends, states, steps)
    rotor_inertia = form.inertia + sum(blade.schur_ss + blade.schur_cc for blade in form.blades)
    inertias = [rotor_inertia, *(blade.pitch_inertia for blade in form.blades)]
    longest = float((ends - begins).max())
    effects = []
    for place, inertia in enumerate(inertias):
        # A torque that moves the coordinate by a small angle, whatever its inertia.
        torque = _SMALL_TURN * float(inertia) / longest**2
        pushed = quick_ends(scene, begins, ends, states, steps, _with_torque(place, torque))
        effects.append((pushed - free).T / judged.units / torque)
    return np.asarray(effects)


def _with_torque(place: int, torque: float) -> closed_form.Accelerations:
    """Return the closed form's equations with an additional torque on one coordinate.

    Parameters
    ----------
    place : 0 for the rotor, from 1 on the pitches.
    torque : N m.
    """

    def equations(angles: Any, rates: Any, form: Any, loads: Any, *functions: Any) -> Any:
        pitches = list(loads.pitches or [0.0] * len(form.blades))
        if place == 0:
            pushed = replace(loads, rotor=loads.rotor + torque, pitches=pitches)
        else:
            pitches[place - 1] = pitches[place - 1] + torque
            pushed = replace(loads, pitches=pitches)
        return closed_form.accelerations(angles, rates, form, pushed, *functions)

    return equations


def _cosine(first: Array, second: Array) -> float:
    """Return the cosine between two vectors, 0 where one is zero."""
    size = float(np.linalg.norm(first) * np.linalg.norm(second))
    return float(first @ second) / size if size else 0.0
