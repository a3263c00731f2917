"""Describe faults at a time in data: causes of large defects in a few neighbouring intervals.

Examples of faults are a stuck, repeated or wrong row, a load that jumps a row late, and a motion
that continues from another state. Each kind of fault has its own pattern of defects in one interval
or in a group of intervals. The other intervals have no defects.
"""

from __future__ import annotations

import itertools
import math
from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from rotor_mbs.comparison.data_defects import JudgedDefects
from rotor_mbs.models.lagrange import closed_form
from rotor_mbs.models.lagrange.defects import explicit_steps, quick_ends
from rotor_mbs.models.lagrange.parameters import rotor_form
from rotor_mbs.scenario.time_table import torque_place
from rotor_mbs.solution.defects import FLOOR_SAFETY
from rotor_mbs.solution.trajectory import Array

UNKNOWN_FAULT = "a fault"  # first words of the text on a fault without a recognized pattern
_MAX_NAMED = 6  # largest number of groups of faulty intervals that are described
_MAX_STEPS = 512  # largest number of Runge-Kutta steps in an interval
# An interval is faulty if its defect is more than _STANDS_OUT times the median of all defects, and
# more than the share _FAINT of the largest defect.
_STANDS_OUT = 30.0
_FAINT = 0.02
_EVERYWHERE = 0.6  # largest share of faulty intervals: an error in more intervals is no fault
# Faults explain the data only if the other intervals have small defects. In at least the share
# _MOST of them, defects must be within the tolerance, or within the share _OF_OTHERS of the largest
# defect.
_MOST, _OF_OTHERS = 0.9, 1e-3
# A fault has edges if the median defect of the intervals next to faulty intervals is at most this
# share of the median defect of the faulty intervals.
_EDGE = 0.1
_GAP = 6  # faulty intervals whose numbers differ by at most this belong to one group
_AT_END = 3  # number of intervals that count as an end of the data
# If the median of all defects is more than this share of the largest defect, large defects at the
# ends of the data have the same cause as the defects in between, and are no faults.
_OF_ENDS = 1e-3
_PARALLEL = 0.995  # smallest cosine of the angle between two vectors that count as parallel
_NEARLY = 0.05  # relative difference of two numbers that count as equal
# A load that is constant in each interval explains the defects if it leaves at most this share of
# them. It leaves a part because the actual load may change within the interval, and because the
# effect of a load changes as the rotor turns.
_LEFT_OF_LOADS = 0.15
_OF_COORDINATE = 0.1  # a load that explains a smaller share of a coordinate's defects is ignored
_OF_USUAL = 10.0  # the fit of loads gives less weight to defects below this many times the median
_MIN_CLOCK = 3  # smallest number of intervals that show a wrong clock: all late, or all early
# Rough number of intervals of a long fault for which loads are computed; it may be up to 39.
_MAX_DIRECTIONS = 20
# Angle (rad) by which the load whose effect is computed turns its coordinate in an interval: far
# above round-off, and small enough for a linear effect.
_SMALL_TURN = 1e-6


def faults_in_time(judged: JudgedDefects) -> list[str]:
    """Find faults at a time: intervals whose defects are far larger than those of all others.

    Parameters
    ----------
    judged : the defects of the data.

    Returns
    -------
    list of str
        Texts on the first `_MAX_NAMED` groups of faulty intervals, and one on the number of further
        groups. The list is empty if no defect exceeds the tolerance, if most intervals are faulty,
        if the large defects do not begin and end abruptly, or if the other intervals have errors,
        too.
    """
    excess = judged.excess
    if judged.largest <= judged.tolerance:
        return []
    # If most intervals are right, the median defect is that of a right interval.
    usual = float(np.median(excess[judged.is_judged])) if judged.is_judged.any() else 0.0
    wrong = np.flatnonzero(excess > max(_STANDS_OUT * usual, _FAINT * judged.largest))
    # An error in most intervals is no fault at a time, though it may be larger in some intervals
    # than in others.
    if not len(wrong) or len(wrong) > _EVERYWHERE * len(excess):
        return []
    # A fault begins and ends abruptly. Defects that decrease gradually on both sides of the largest
    # ones have another cause.
    edges = np.concatenate([wrong - 1, wrong + 1])
    is_interval = (edges >= 0) & (edges < len(excess))
    edges = edges[is_interval & ~np.isin(edges, wrong)]
    if len(edges):
        beside = float(np.median(excess[edges]))
        if beside > _EDGE * float(np.median(excess[wrong])):
            return []
    # Faults explain the data only if the defects of all other intervals are nearly zero.
    others = np.delete(excess, wrong)
    of_others = float(np.quantile(others, _MOST))
    if of_others > max(judged.tolerance, _OF_OTHERS * judged.largest):
        return []
    groups = np.split(wrong, np.flatnonzero(np.diff(wrong) > _GAP) + 1)
    # A filter, or differences of angles in place of rates, causes errors in all rows, and the
    # largest errors at the ends. Groups at the ends are left out if the median shows such errors.
    if usual > _OF_ENDS * judged.largest:
        last = len(excess) - _AT_END
        groups = [group for group in groups if group[-1] >= _AT_END and group[0] < last]
    texts = []
    for group in groups[:_MAX_NAMED]:
        texts += _faults_of(judged, group)
    # The errors of an integrator are larger while the motion is fast. If the other intervals have
    # errors, too, even within the tolerance, a group without a pattern may be such a fast part of
    # the motion, and is not named as a cause.
    if of_others > _OF_OTHERS * judged.largest:
        texts = [text for text in texts if not text.startswith(UNKNOWN_FAULT)]
    if len(groups) > _MAX_NAMED:
        end = float(judged.defects.time[groups[-1][-1] + 1])
        texts.append(f"and {len(groups) - _MAX_NAMED} more faults until t = {end:.6g} s")
    return texts


def _faults_of(judged: JudgedDefects, group: NDArray[np.int64]) -> list[str]:
    """Describe the fault of a group of intervals, or one fault for each part of the group.

    Parameters
    ----------
    judged : the defects of the data.
    group : (k,) numbers of faulty intervals that are near each other.

    Returns
    -------
    list of str
        Texts on the faults. If no pattern is recognized, the only text has the period of the fault
        and the coordinate with the largest defect.
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
    """Describe the fault of a group of intervals; return "" if no pattern is recognized.

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
    # Find the coordinates on which additional loads would cause these defects.
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
    """Return the name of a coordinate by its place among the moving coordinates."""
    return judged.scene.coordinate_labels[judged.defects.moving[place]]


def _wrong_row(judged: JudgedDefects, group: NDArray[np.int64]) -> str:
    """Describe a row that is repeated, omitted, stuck or wrong; return "" if there is none.

    A row at a wrong time is described, too. A defect is the closed form minus the data, so that it
    has the direction of the motion if the data lag behind.

    Parameters
    ----------
    judged : the defects of the data.
    group : (k,) numbers of faulty intervals that are near each other.
    """
    defects, units = judged.defects, judged.units
    first, last = int(group[0]), int(group[-1])
    values = judged.values[group]
    # If a row is repeated, the defect is the motion over the interval. If a time is wrong by a
    # small part of the interval, the defect is parallel to the rate at the end of the interval.
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
        # The second interval starts at the wrong row and ends at a right one. Its defect is the
        # defect of the first interval, carried over the second interval, with the opposite sign.
        carried = defects.transitions[first + 1] @ (values[0] * units) / units
        if _cosine(values[1], -carried) >= _PARALLEL:
            row = f"row {first + 2}, t = {defects.time[first + 1]:.6g} s"
            if abs(along) >= _PARALLEL:
                return f"a stuck row, or one at a wrong time: {row}"
            return f"a single wrong row: {row}"
    return ""


def _wrong_clock(judged: JudgedDefects, group: NDArray[np.int64]) -> str:
    """Describe a motion that gets later, or earlier, in every interval of a group.

    Return "" if it does not.

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
    """Describe the fault of interval number `row` as a jump of the rates, or of the state."""
    half = len(judged.defects.moving)
    start, end = (float(time) for time in judged.defects.time[row : row + 2])
    # If the rates jump within the interval, the angles change by the jump times the rest of the
    # interval. The length of this rest is a share, between 0 and 1, of the whole interval.
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
    judged : the defects of the data; its `units` divide the rates and accelerations.
    row : number of the interval.
    """
    states, time = judged.defects.states, judged.defects.time
    half = states.shape[1] // 2
    ahead = min(row + 2, len(states) - 1)
    # The row at the end of the interval may be wrong: the rows before and after it give the
    # accelerations.
    acceleration = (states[ahead, half:] - states[row, half:]) / (time[ahead] - time[row])
    rates = states[row + 1, half:]
    return np.asarray(np.concatenate([rates, acceleration]) / judged.units)


def _explaining_loads(judged: JudgedDefects, rows: NDArray[np.int64]) -> tuple[Array, list[int]]:
    """Fit additional loads on the coordinates to the defects of some intervals.

    Parameters
    ----------
    judged : the defects of the data.
    rows : (k,) numbers of the intervals.

    Returns
    -------
    loads : ndarray
        (k, coordinates) N m, loads that the data have in addition to those of the scene.
    acting : list of int
        Places of the coordinates on which these loads act; empty if the loads leave too much of the
        defects.
    """
    values, effects = judged.values[rows], _effect_of_unit_load(judged, rows)
    usual = np.median(np.abs(judged.values[judged.is_judged]), axis=0)
    usual = usual + FLOOR_SAFETY * judged.floors[rows].max(axis=0)
    # Each channel is divided by its own size, because a load may turn a pitch a million times as
    # far as the rotor.
    units = np.linalg.norm(values, axis=0) + _OF_USUAL * math.sqrt(len(rows)) * usual
    sizes = np.linalg.norm(effects / units, axis=2)
    if not (np.isfinite(sizes).all() and sizes.all()):
        return np.zeros(sizes.T.shape), []
    # Solve a least-squares problem in each interval, with the effects of loads scaled to unit size.
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
        channels = [place, len(parts) + place]  # angle and rate of the coordinate
        if np.linalg.norm(part[:, channels] / units[channels]) > _OF_COORDINATE:
            acting.append(place)
    return loads, acting


def _load_jump_fault(
    judged: JudgedDefects, place: int, start: float, end: float, more: Array
) -> str:
    """Describe a wrong load at a jump of a coordinate's prescribed load.

    Return "" if there is no such jump, or the load is wrong in another way.

    Parameters
    ----------
    judged : the defects of the data.
    place : place of the coordinate among those that move.
    start, end : s, start of the first interval and end of the last one.
    more : (k,) N m, load in each interval that the data have in addition to that of the scene.
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
        # A load that is smoothed over an upward jump is too large in the interval before the jump,
        # and too small in the next interval.
        is_balanced = abs(more.sum()) <= _NEARLY * np.abs(more).max()
        if len(more) == 2 and is_balanced and more[0] / jump > 0.0:
            return f"is smoothed over its jump at t = {t0:.6g} s"
    return ""


def _effect_of_unit_load(judged: JudgedDefects, rows: NDArray[np.int64]) -> Array:
    """Compute how 1 N m on each moving coordinate changes the states at the ends of intervals.

    Parameters
    ----------
    judged : the defects of the data.
    rows : (k,) numbers of the intervals.

    Returns
    -------
    ndarray
        (coordinates, k, m) rad per N m, of the angles, then the rates.
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
        # The torque is proportional to the inertia: every coordinate turns by the same small angle.
        torque = _SMALL_TURN * float(inertia) / longest**2
        pushed = quick_ends(scene, begins, ends, states, steps, _with_torque(place, torque))
        effects.append((pushed - free).T / judged.units / torque)
    return np.asarray(effects)


def _with_torque(place: int, torque: float) -> closed_form.Accelerations:
    """Return the closed form's equations with an additional torque on one coordinate.

    Parameters
    ----------
    place : 0 for the rotor; 1, 2, ... for the pitches that move.
    torque : N m, the additional torque.
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
    """Return the cosine of the angle between two vectors; 0 if one of them is zero."""
    size = float(np.linalg.norm(first) * np.linalg.norm(second))
    return float(first @ second) / size if size else 0.0
