"""Mistakes in the columns and times of a trajectory: units, signs, zeros, turns, lags, exchanges.

A mistake is looked for by the reference, at most carried on from one of its rows. It explains the
data where the data so corrected have no defects.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace

import numpy as np
from scipy.optimize import linear_sum_assignment

from rotor_mbs.comparison.channels import channels
from rotor_mbs.comparison.data import ForeignData
from rotor_mbs.comparison.data_defects import (
    carried_errors,
    defects_of_data,
    judged_defects,
    states_of,
)
from rotor_mbs.comparison.hypotheses import Hypothesis, explanations
from rotor_mbs.models.lagrange.defects import interval_ends
from rotor_mbs.models.lagrange.reference import TimedReference
from rotor_mbs.scenario.scene import Scene
from rotor_mbs.solution.metrics import horizon
from rotor_mbs.solution.trajectory import Array, Trajectory

# A mistake fits where what is left is within the tolerance, or a thousandth of what there was and
# at most this.
_LEFT, _MAX_LEFT = 1e-3, 1e-4
MIN_ROWS = 5  # with fewer, something always fits
_DEGREE, _TURN = math.pi / 180.0, 2.0 * math.pi
_FACTORS = {
    "angle": (
        (_DEGREE, "degrees taken as rad"),
        (1.0 / _DEGREE, "rad taken as degrees"),
        (_TURN, "turns taken as rad"),
    ),
    "rate": (
        (_DEGREE, "deg/s taken as rad/s"),
        (_TURN / 60.0, "rpm taken as rad/s"),
        (_TURN, "Hz taken as rad/s"),
    ),
}
_TIME_FACTORS = (
    (1e-3, "time in ms taken as s"),
    (1e-6, "time in us taken as s"),
    (60.0, "time in minutes taken as s"),
)
_MIN_LAG = 1e-4  # of an interval between rows: less is rounding
_WHOLE_ROWS = 1e-3  # of a row: a lag so near a number of rows is that number
_LAG_ROW = 50  # by which a lag is explanation
_LAG_ROUNDS = 8
_TIME_ROUNDING = 1e-9  # of the duration


@dataclass(frozen=True)
class TrajectorySearch:
    """Data, all rows, and a scene's reference at their times and at the scene's samples.

    Attributes
    ----------
    scene, data, exact : the scene, the data, the reference.
    tolerance : rad, of an interval's defect.
    worst : the largest error per unit of error growth.
    """

    scene: Scene
    data: ForeignData
    exact: TimedReference
    tolerance: float
    worst: float

    def states_at(self, time: Array) -> Array:
        """Compute the motion at other times, from the reference's row before each.

        Parameters
        ----------
        time : (n,) s, increasing, up to the horizon.

        Returns
        -------
        ndarray
            (n, 2 (1 + blades)) angles, then rates.
        """
        run, moving = self.exact.trajectory, self.scene.moving_coordinates
        before = np.searchsorted(run.time, time, side="right") - 1
        states = states_of(run)[before]
        count = len(self.scene.initial_angles)
        columns = [*moving, *(count + i for i in moving)]
        moved = interval_ends(self.scene, run.time[before], time, states[:, columns])
        states[:, columns] = moved
        return states

    def up_to_horizon(self, data: ForeignData) -> ForeignData:
        """Return the rows of data from the start to the horizon of the scene."""
        end = horizon(self.exact.trajectory)
        return data.rows((data.time >= 0.0) & (data.time <= end))

    def carried(self, time: Array) -> Array:
        """Return `carried_errors` at (n,) times up to the horizon, (n, 2 (1 + blades))."""
        run = self.exact.trajectory
        carried = carried_errors(run, self.exact.growth, self.exact.units)
        columns = [np.interp(time, run.time, column) for column in carried.T]
        return np.stack(columns, axis=1)

    @property
    def allowed(self) -> float:
        """The largest error per unit of growth, and defect, that a mistake may leave."""
        return max(self.tolerance, min(_LEFT * self.worst, _MAX_LEFT))

    def defect_left(self, correction: Correction) -> float:
        """Return the largest defect of corrected data beyond rounding; 0 where none is known.

        Parameters
        ----------
        correction : the data, whose times may begin before 0 and end after the scene.
        """
        data = correction.data
        end = self.scene.duration * (1.0 + _TIME_ROUNDING)
        data = data.rows((data.time >= 0.0) & (data.time <= end))
        inside = self.up_to_horizon(data)
        if len(data.time) < 2 or not len(inside.time):
            return 0.0
        count = len(self.scene.initial_angles)
        start = [*self.scene.initial_angles, *self.scene.initial_rates]
        states = np.tile(start, (len(data.time), 1))
        states[: len(inside.time)] = self.states_at(inside.time)
        reference = Trajectory(data.time, states[:, :count], states[:, count:])
        defects, _ = defects_of_data(self.scene, data, reference, len(inside.time))
        if defects is None:
            return 0.0
        return judged_defects(self.scene, defects, self.tolerance).largest


@dataclass(frozen=True)
class Correction:
    """Corrected data, and the mistakes that their columns had, in words."""

    data: ForeignData
    mistakes: tuple[str, ...] = ()


def data_mistakes(search: TrajectorySearch) -> list[str]:
    """Search for mistakes in the columns, and for those in the times with any in the columns."""
    texts = column_mistakes(search)
    if texts:
        return texts
    for hypothesis in _time_hypotheses(search):
        texts = column_mistakes(search, hypothesis)
        if texts:
            return texts
    return []


def column_mistakes(
    search: TrajectorySearch,
    times: Hypothesis[ForeignData] | None = None,
    *,
    with_factor: bool = False,
) -> list[str]:
    """Search for what is wrong with the columns of data.

    Parameters
    ----------
    search : the data.
    times : a mistake in their times, and the data without it.
    with_factor : whether any factor of a channel may be wrong.

    Returns
    -------
    list of str
        The mistakes, one text with the one in the times; none where they do not explain the data.
    """
    data = times.change if times is not None else search.data
    inside = search.up_to_horizon(data)
    if len(inside.time) < MIN_ROWS:
        return []
    hypotheses = _column_hypotheses(search, data, inside, with_factor=with_factor)
    # Without a mistake in the times there is one in the columns, or none at all.
    mistaken = (each for each in hypotheses if each.text or times is not None)
    explanation = next(explanations(mistaken, search.defect_left, search.allowed), None)
    if explanation is None:
        return []
    mistakes = explanation.hypothesis.change.mistakes
    return list(mistakes) if times is None else ["; and ".join([times.text, *mistakes])]


# Times


def _time_hypotheses(search: TrajectorySearch) -> Iterator[Hypothesis[ForeignData]]:
    """Yield times in another unit, numbers of rows, a constant lag, and time reversed."""
    data = search.data
    factors = list(_TIME_FACTORS)
    if np.array_equal(np.diff(data.time), np.ones(len(data.time) - 1)):
        step = search.scene.duration / (len(data.time) - 1)
        factors.append((step, "row numbers taken as s"))
    for factor, text in factors:
        time, rounding = data.time * factor, data.time_rounding * factor
        yield Hypothesis(text, replace(data, time=time, time_rounding=rounding))
    step = float(np.median(np.diff(data.time)))
    lag = _lag(search)
    if abs(lag) > _MIN_LAG * step:
        rows = lag / step
        in_rows = ""
        if round(rows) and abs(rows - round(rows)) < _WHOLE_ROWS:
            in_rows = f", {abs(round(rows))} rows"
        side = "late" if lag > 0.0 else "early"
        text = f"a constant lag of {lag:.6g} s{in_rows} ({side}): `offset = {-lag:.6g}` of the time"
        yield Hypothesis(text, replace(data, time=data.time - lag))
    reversed_time = (data.time[0] + data.time[-1] - data.time)[::-1]
    backward = replace(
        data, time=reversed_time, values=data.values[::-1], rounding=data.rounding[::-1]
    )
    yield Hypothesis("rows from the end to the start, time reversed", backward)


def _lag(search: TrajectorySearch) -> float:
    """Find by how much a row of the data is later than the reference is nearest to it, s.

    From the nearest row of the reference on by Gauss and Newton's iteration over the time.

    Parameters
    ----------
    search : the data and the reference, which is carried on from its rows.
    """
    data, run = search.data, search.exact.trajectory
    # Not the first row: at the start the motion may be slow, and the lag hardly seen.
    row = min(_LAG_ROW, len(data.time) // 4)
    columns, end = data.columns, horizon(run)
    states = states_of(run)[run.time <= end][:, columns]
    distances = np.abs(states - data.values[row]).max(axis=1)
    time = float(run.time[int(distances.argmin())])
    step = 1e-6 * max(end, 1e-9)  # for the derivative
    for _ in range(_LAG_ROUNDS):
        here, ahead = search.states_at(np.array([time, time + step]))[:, columns]
        slope = (ahead - here) / step
        size = float(slope @ slope)
        change = float((data.values[row] - here) @ slope) / size if size else 0.0
        time = min(max(time + change, 0.0), end - step)
    return float(data.time[row]) - time


# Columns


def _column_hypotheses(
    search: TrajectorySearch, data: ForeignData, inside: ForeignData, *, with_factor: bool
) -> Iterator[Hypothesis[Correction]]:
    """Yield what may be wrong with the columns of data whose times are right.

    Parameters
    ----------
    search : what the data should be.
    data, inside : all rows, and those up to the horizon.
    with_factor : whether any factor of a channel may be wrong.
    """
    states, carried = search.states_at(inside.time), search.carried(inside.time)
    columns = data.columns
    error = np.abs((inside.values - states[:, columns]) / carried[:, columns])
    if float(error.max()) <= search.allowed:
        yield Hypothesis("", Correction(data), price=0)
        return
    corrected = _corrected_channels(search, data, states, carried, with_factor=with_factor)
    if corrected is not None:
        yield corrected
    # Columns that are those of other channels, rates taken as angles among them: each column is
    # assigned another channel, so that the sum of the errors' digits is least.
    differences = np.abs(inside.values[:, :, None] - states[:, None, :])
    errors = (differences / carried[:, None, :]).max(axis=0)  # (columns, channels)
    preference = np.zeros_like(errors)
    places = range(len(columns))
    preference[places, columns] = -1e-3  # of equal ones, its own
    _, chosen = linear_sum_assignment(np.log10(np.clip(errors, 1e-16, 1e16)) + preference)
    if errors[places, chosen].max() <= search.allowed and list(chosen) != columns:
        yield _exchange(search.scene, data, list(chosen))


def _corrected_channels(
    search: TrajectorySearch,
    data: ForeignData,
    states: Array,
    carried: Array,
    *,
    with_factor: bool,
) -> Hypothesis[Correction] | None:
    """Correct each channel by itself: unit, sign, zero, turns.

    Parameters
    ----------
    search, data : what the data should be, and all rows.
    states, carried : (n, 2 (1 + blades)) in the rows from t = 0 to the horizon, see
        `TrajectorySearch`.
    with_factor : whether any factor of a channel may be wrong.

    Returns
    -------
    Hypothesis or None
        None where a channel fits by no correction.
    """
    begin = int(np.searchsorted(data.time, 0.0))  # rows before it have no reference
    rows = slice(begin, begin + len(states))
    names: dict[str, list[str]] = {}
    values, roundings = [], []
    for j, channel in enumerate(data.channels):
        expected, scale = states[:, channel.column], carried[:, channel.column]
        candidates = list(_corrections(channel.kind, data.values[:, j], begin, float(expected[0])))
        if with_factor:
            # By least squares.
            factor = float(data.values[rows, j] @ expected / (expected @ expected))
            if factor:
                text = f"too large by a factor of {factor:.6g}"
                candidates.append((text, 1.0 / factor, data.values[:, j] / factor))
        left = []
        for _, _, corrected in candidates:
            left.append(float(np.abs((corrected[rows] - expected) / scale).max()))
        least = max(min(left), 1e-3 * search.tolerance)
        if not least <= search.allowed:
            return None
        # The simplest of those that leave about as little as the best.
        for (text, factor, corrected), size in zip(candidates, left, strict=True):
            if size <= 10.0 * least:
                names.setdefault(text, []).append(channel.name)
                values.append(corrected)
                roundings.append(data.rounding[:, j] * abs(factor))
                break
    mistakes = [f"{', '.join(which)}: {text}" for text, which in names.items() if text]
    corrected_data = replace(
        data, values=np.stack(values, axis=1), rounding=np.stack(roundings, axis=1)
    )
    correction = Correction(corrected_data, tuple(mistakes))
    return Hypothesis("; and ".join(mistakes), correction, len(mistakes))


def _corrections(
    kind: str, values: Array, begin: int, start: float
) -> Iterator[tuple[str, float, Array]]:
    """Yield what may be wrong with a channel, the factor, and its values so corrected.

    The simplest first: another unit, the other sign, another zero, turns that are missing.

    Parameters
    ----------
    kind : "angle" or "rate".
    values : (rows,) of the channel.
    begin : the first row that is compared.
    start : the right value there.
    """
    factors = [(1.0, ""), *_FACTORS[kind]]
    signed = [(sign * factor, text) for sign in (1.0, -1.0) for factor, text in factors]
    for has_other_zero in (False, True):
        for factor, text in signed:
            mistakes = [text] if text else []
            if factor < 0.0:
                mistakes.append("sign reversed")
            zero = 0.0
            if has_other_zero:
                zero = factor * float(values[begin]) - start
                mistakes.append(f"zero off by {zero:.6g}")
            corrected = factor * values - zero
            yield ", ".join(mistakes), factor, corrected
            if kind == "angle" and np.abs(np.diff(corrected)).max() > 0.5 * _TURN:
                unwrapped = np.unwrap(corrected)
                unwrapped += _TURN * np.round((start - unwrapped[begin]) / _TURN)
                text_of_turns = ", ".join([*mistakes, "wrapped, taken as unwrapped"])
                yield text_of_turns, factor, unwrapped


def _exchange(scene: Scene, data: ForeignData, chosen: Sequence[int]) -> Hypothesis[Correction]:
    """Take the columns of data as those of other channels, by their numbers."""
    known = channels(scene)[1:]
    others = tuple(known[column] for column in chosen)
    moved = []
    for own, other in zip(data.channels, others, strict=True):
        if own != other:
            moved.append(f"{own.name} is {other.name}")
    text = f"columns exchanged: {', '.join(moved)}"
    return Hypothesis(text, Correction(replace(data, channels=others), (text,)))
