"""Search for mistakes in the columns and times of a trajectory.

Examples are wrong units, signs and zeros, missing turns, lags, and exchanged columns. The data are
compared with the reference; for a time between two of its rows, the reference is integrated from
the row before. A mistake explains the data if the corrected data have hardly any defects.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace

import numpy as np
from scipy.interpolate import make_interp_spline
from scipy.optimize import linear_sum_assignment

from rotor_mbs.comparison.channels import channels
from rotor_mbs.comparison.column_readings import (
    DEGREE,
    DEGREE_TEXTS,
    HELD,
    LATE_OR_EARLY,
    ColumnReadings,
    held_rows,
)
from rotor_mbs.comparison.data import ForeignData
from rotor_mbs.comparison.data_defects import (
    STRETCHES,
    carried_errors,
    defects_of_data,
    judged_defects,
    states_of,
)
from rotor_mbs.comparison.hypotheses import Hypothesis, explanations
from rotor_mbs.models.lagrange.defects import interval_ends
from rotor_mbs.models.lagrange.reference import TimedReference
from rotor_mbs.scenario.scene import Scene
from rotor_mbs.solution.defects import FLOOR_SAFETY
from rotor_mbs.solution.metrics import horizon
from rotor_mbs.solution.trajectory import Array, Trajectory

# A mistake fits if the error that it leaves is within the tolerance. It also fits if this error is
# at most the share _LEFT of the error of the data, and at most _MAX_LEFT per unit of error growth.
_LEFT, _MAX_LEFT = 1e-3, 1e-4
MIN_ROWS = 5  # smallest number of rows of a search: some mistake always fits fewer rows
_TIME_FACTORS = (
    (1e-3, "time in ms taken as s"),
    (1e-6, "time in us taken as s"),
    (60.0, "time in minutes taken as s"),
)
_MIN_LAG = 1e-4  # smallest lag, in intervals between rows: a smaller lag is rounding
_WHOLE_ROWS = 1e-3  # a lag in rows counts as a whole number if it differs by less than this
_LAG_ROW = 50  # number of the row whose lag is measured; in short data it is an earlier row
_LAG_ROUNDS = 8  # number of Gauss-Newton iterations for the time of a row
# A column is not used to find the time of a row if its distance from the reference is more than
# this many times the median distance of the columns.
_MAX_OFF = 30.0
# Largest factor of a wrong clock; smallest difference of the factor from 1 that is not rounding.
_MAX_CLOCK, _MIN_CLOCK = 1.2, 1e-7
_TIME_ROUNDING = 1e-9  # share of the duration by which rounding may make a time exceed it
# Smallest share of the duration that rows in another unit of time must cover: in a short part of a
# motion, any unit fits.
_MIN_COVERED = 0.3
_MAX_PERIOD = 20  # largest number of rows from a computed row to the next, in interpolated data
# A spline is tried on the first _FIRST_ROWS rows before it is tried on all rows. The allowed
# difference is larger in these rows, by the share _NEARLY_BETWEEN of a column's largest number.
_FIRST_ROWS, _NEARLY_BETWEEN = 401, 1e-6
# Smallest number of knots of a spline: a spline with fewer knots is hardly more than a polynomial,
# which fits a short motion that is not interpolated, too.
_MIN_KNOTS = 5
# Data are called interpolated only if the reference would not pass as interpolated itself: one of
# its rows must be off the spline by more than this many times the allowed difference.
_NOT_BY_CHANCE = 10.0
_INTERPOLATED = 1e-9  # rounding error of an interpolation, as a share of a column's largest number
# Long data are first searched in _WINDOWS windows of _WINDOW_ROWS rows: a mistake that explains all
# rows explains these rows, too. The bound is _WIDER times as wide there, because errors differ from
# window to window.
_WINDOWS, _WINDOW_ROWS, _WIDER = 3, 500, 10.0


@dataclass(frozen=True)
class TrajectorySearch:
    """Hold the data of a search for mistakes, the reference, and the allowed errors.

    Attributes
    ----------
    scene, data : the rotor; the data with all rows, also those after the scene's end.
    exact : the reference at the times of the data and at the scene's samples.
    tolerance : rad, the largest allowed defect of an interval.
    worst : the largest error of the data up to the horizon, per unit of error growth.
    is_within_tolerance : whether the data agree, and the search is for the cause of a smaller
        difference. A lag is not searched for then, because it may be an integrator's own error.
    """

    scene: Scene
    data: ForeignData
    exact: TimedReference
    tolerance: float
    worst: float
    is_within_tolerance: bool = False

    def states_at(self, time: Array) -> Array:
        """Compute the reference motion at given times.

        The motion is integrated to each time from the last row of the reference before it.

        Parameters
        ----------
        time : (n,) s, increasing, up to the horizon.

        Returns
        -------
        ndarray
            (n, 2 (1 + blades)) angles, rad, then rates, rad/s.
        """
        run, moving = self.exact.trajectory, self.scene.moving_coordinates
        before = np.searchsorted(run.time, time, side="right") - 1
        states = states_of(run)[before]
        count = len(self.scene.initial_angles)
        columns = [*moving, *(count + i for i in moving)]
        begins = run.time[before]
        between = np.flatnonzero(begins < time)
        places = between[:, None], np.array(columns)
        moved = interval_ends(self.scene, begins[between], time[between], states[places])
        states[places] = moved
        return states

    def up_to_horizon(self, data: ForeignData) -> ForeignData:
        """Return the rows of data from the start to the horizon of the scene."""
        end = horizon(self.exact.trajectory)
        return data.rows((data.time >= 0.0) & (data.time <= end))

    def carried(self, time: Array) -> Array:
        """Return the reference's `carried_errors` at (n,) times, (n, 2 (1 + blades)).

        The errors are interpolated linearly between the rows of the reference.
        """
        run = self.exact.trajectory
        carried = carried_errors(run, self.exact.growth, self.exact.units)
        columns = [np.interp(time, run.time, column) for column in carried.T]
        return np.stack(columns, axis=1)

    @property
    def allowed(self) -> float:
        """Return the largest error per unit of error growth that a mistake may leave.

        The same number, in rad, is the largest defect that may be left.
        """
        return max(self.tolerance, min(_LEFT * self.worst, _MAX_LEFT))

    def defect_left(self, correction: Correction) -> float:
        """Return the largest defect of corrected data beyond rounding, rad.

        Sums of defects over longer stretches count as defects, too. The result is 0 if no defects
        can be computed, for example because no column can be corrected. The comparison of the
        columns with the reference, which comes before, is then the only test.

        Parameters
        ----------
        correction : corrected data, whose times may begin before 0 and end after the scene.
        """
        data = correction.data
        if data is None:
            return 0.0
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
        left = judged_defects(self.scene, defects, self.tolerance).largest
        for stretch in STRETCHES:
            sizes, floors = defects.over_rows(stretch)
            left = max(left, float((sizes - FLOOR_SAFETY * floors).max(initial=0.0)))
        return left


@dataclass(frozen=True)
class Correction:
    """Hold corrected data, None if no column can be corrected, and the mistakes in words."""

    data: ForeignData | None
    mistakes: tuple[str, ...] = ()


def data_mistakes(search: TrajectorySearch) -> list[str]:
    """Search for mistakes in the columns; if none explains the data, also in rows and times."""
    return column_mistakes(search) or _row_mistakes(search, _row_hypotheses(search))


def clock_mistakes(search: TrajectorySearch) -> list[str]:
    """Search for a clock that is fast or slow, alone or with a mistake in the columns.

    In a motion under gravity alone, a wrong clock and a wrong gravity change the angles alike. The
    clock is then named in addition to the gravity.
    """
    return _row_mistakes(search, _clocks(search))


def _row_mistakes(
    search: TrajectorySearch, hypotheses: Iterator[Hypothesis[ForeignData]]
) -> list[str]:
    """Return the first mistake in rows or times that explains the data.

    A mistake in the columns may come with it.
    """
    for hypothesis in hypotheses:
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
    """Search for mistakes in the columns of data.

    Parameters
    ----------
    search : the data and the reference.
    times : a mistake in rows or times, with the data corrected for it; None for no such mistake.
    with_factor : whether a channel may be wrong by any factor.

    Returns
    -------
    list of str
        The mistakes in words; a mistake in rows or times and one in the columns are one text. Empty
        if mistakes do not explain the data.
    """
    data = times.change if times is not None else search.data
    inside = search.up_to_horizon(data)
    if len(inside.time) < MIN_ROWS or not _may_explain(search, inside, with_factor=with_factor):
        return []
    hypotheses = _column_hypotheses(search, data, inside, with_factor=with_factor)
    # Columns without a mistake explain the data only if there is a mistake in rows or times.
    mistaken = (each for each in hypotheses if each.text or times is not None)
    explanation = next(explanations(mistaken, search.defect_left, search.allowed), None)
    if explanation is None:
        return []
    mistakes = explanation.hypothesis.change.mistakes
    # With a mistake in the times, at most one in the columns is accepted: several mistakes would
    # explain any data.
    if times is not None and len(mistakes) > 1:
        return []
    return list(mistakes) if times is None else ["; and ".join([times.text, *mistakes])]


# Rows and times


def _row_hypotheses(search: TrajectorySearch) -> Iterator[Hypothesis[ForeignData]]:
    """Yield possible mistakes in rows and times, each with the data corrected for it."""
    yield from _times_in_other_units(search)
    yield from _rows_between(search)
    if not search.is_within_tolerance:
        yield from _lags(search)
    data = search.data
    reversed_time = (data.time[0] + data.time[-1] - data.time)[::-1]
    backward = replace(data.rows(slice(None, None, -1)), time=reversed_time)
    yield Hypothesis("rows from the end to the start, time reversed", backward)


def _times_in_other_units(search: TrajectorySearch) -> Iterator[Hypothesis[ForeignData]]:
    """Yield mistakes in the times: ms, us, minutes, row numbers, sums in single precision.

    Parameters
    ----------
    search : the data and the scene.
    """
    data = search.data
    count = len(data.time)
    factors = list(_TIME_FACTORS)
    if np.array_equal(np.diff(data.time), np.ones(count - 1)):
        factors.append((search.scene.duration / (count - 1), "row numbers taken as s"))
    for factor, text in factors:
        time, rounding = data.time * factor, data.time_rounding * factor
        if time[-1] >= _MIN_COVERED * search.scene.duration:
            yield Hypothesis(text, replace(data, time=time, time_rounding=rounding))
    # Times that are sums of a step in single precision are wrong by thousandths of a step.
    single = data.time.astype(np.float32)
    step = single[1] - single[0]
    summed = np.cumsum(np.append(single[:1], np.full(count - 1, step)), dtype=np.float32)
    if np.array_equal(summed, data.time.astype(float)):
        chosen = float(f"{step:.6e}")
        equal = np.asarray(float(single[0]) + chosen * np.arange(count))
        text = f"times are sums of {chosen:g} s in single precision"
        yield Hypothesis(text, replace(data, time=equal, time_rounding=2.0**-53 * equal))


def _rows_between(search: TrajectorySearch) -> Iterator[Hypothesis[ForeignData]]:
    """Yield every n-th row of the data, if the rows in between are held or interpolated.

    Parameters
    ----------
    search : the data and the reference.
    """
    data = search.data
    count = len(data.time)
    period = held_rows(data.values)
    if period > 1:
        text = f"every row is held for {period} rows"
        yield Hypothesis(text, data.rows(slice(0, None, period)))
    inside = search.up_to_horizon(data)
    right = search.states_at(inside.time)[:, data.columns]
    largest = np.abs(data.values).max(axis=0)
    allowed = FLOOR_SAFETY * data.rounding + _INTERPOLATED * largest
    for degree, text in ((1, "linearly"), (3, "by a cubic spline")):
        # Data that are interpolated between every fourth row are also interpolated between every
        # second row. The longest period is the right one: it is tried first.
        for period in range(min(_MAX_PERIOD, count // MIN_ROWS), 1, -1):
            # The first rows are enough to exclude most periods. A spline through these rows alone
            # is wrong near the last of them: only their first quarter is compared.
            first = _left_between(
                data.time[:_FIRST_ROWS], data.values[:_FIRST_ROWS], period, degree
            )
            first = first[: len(first) // 4]
            if not (first <= allowed[: len(first)] + _NEARLY_BETWEEN * largest).all():
                continue
            left = _left_between(data.time, data.values, period, degree)
            if not (left <= allowed[: len(left)]).all():
                continue
            # A slow motion lies nearly on a spline without being interpolated. Such a motion is no
            # evidence of interpolation.
            of_right = _left_between(inside.time, right, period, degree)
            if (of_right > _NOT_BY_CHANCE * allowed[: len(of_right)]).any():
                text = f"interpolated {text} between every {period} rows"
                yield Hypothesis(text, data.rows(slice(0, None, period)))
            break


def _left_between(time: Array, values: Array, period: int, degree: int) -> Array:
    """Return the absolute differences between rows and a spline through some of the rows.

    Parameters
    ----------
    time, values : (n,) s, (n, columns) rad and rad/s.
    period : number of rows from a knot of the spline to the next.
    degree : degree of the spline's polynomials, 1 or 3.

    Returns
    -------
    ndarray
        (rows up to the last knot, columns) rad and rad/s; for a cubic spline, the differences with
        the better of two end conditions. Infinite if the spline has too few knots.
    """
    last = (len(time) - 1) // period * period + 1
    knots = slice(0, last, period)
    left = np.full((last, values.shape[1]), np.inf)
    if len(time[knots]) < _MIN_KNOTS:
        return left
    for at_ends in (None, "natural") if degree > 1 else (None,):
        spline = make_interp_spline(time[knots], values[knots], k=degree, bc_type=at_ends)
        off = np.abs(spline(time[:last]) - values[:last])
        if off.max() < left.max():
            left = off
    return left


def _lags(search: TrajectorySearch) -> Iterator[Hypothesis[ForeignData]]:
    """Yield the data corrected for a constant lag of their times, if there is one.

    Parameters
    ----------
    search : the data and the reference.
    """
    data, end = search.data, horizon(search.exact.trajectory)
    step = float(np.median(np.diff(data.time)))
    # The first row is not used: the motion may be slow at the start, where a lag has little effect.
    row = min(_LAG_ROW, len(data.time) // 4)
    lag = float(data.time[row]) - _time_of_row(search, row, 0.0, end)
    if abs(lag) > _MIN_LAG * step:
        rows = lag / step
        in_rows = ""
        if round(rows) and abs(rows - round(rows)) < _WHOLE_ROWS:
            in_rows = f", {abs(round(rows))} rows"
        side = "late" if lag > 0.0 else "early"
        text = f"a constant lag of {lag:.6g} s{in_rows} ({side}): `offset = {-lag:.6g}` of the time"
        yield Hypothesis(text, replace(data, time=data.time - lag))


def _clocks(search: TrajectorySearch) -> Iterator[Hypothesis[ForeignData]]:
    """Yield the data with corrected times, if their clock is fast or slow.

    Parameters
    ----------
    search : the data and the reference.
    """
    data, end = search.data, horizon(search.exact.trajectory)
    row = int(np.searchsorted(data.time, 0.5 * end))
    if not 0 < row < len(data.time) or data.time[0] < 0.0:
        return
    written = float(data.time[row])
    right = _time_of_row(search, row, written / _MAX_CLOCK, written * _MAX_CLOCK)
    factor = written / right if right else 1.0
    if abs(factor - 1.0) > _MIN_CLOCK:
        side = "fast" if factor > 1.0 else "slow"
        text = f"a clock that is {100.0 * abs(factor - 1.0):.4g} % {side}: times / {factor:.8g}"
        time, rounding = data.time / factor, data.time_rounding / factor
        yield Hypothesis(text, replace(data, time=time, time_rounding=rounding))


def _time_of_row(search: TrajectorySearch, row: int, first: float, last: float) -> float:
    """Find the time, s, at which the reference is nearest to a row of the data.

    A Gauss-Newton iteration over the time starts at the nearest row of the reference. If the
    reference has no rows within the limits, or does not move, the data's own time is returned.

    Parameters
    ----------
    search : the data and the reference.
    row : number of the row of the data.
    first, last : s, limits of the time at which the iteration starts. The iteration stays before
        `last`, and before the horizon.
    """
    data, run = search.data, search.exact.trajectory
    columns, end = data.columns, min(horizon(run), last)
    is_tried = (run.time >= first) & (run.time <= end)
    if not is_tried.any():
        return float(data.time[row])
    states = states_of(run)[is_tried][:, columns]
    distances = np.abs(states - data.values[row])
    # The distance of a row is the median over the columns that move. Columns that are far beyond
    # the median are left out below, because they may have a mistake of their own.
    is_moving = np.ptp(states, axis=0) > 0.0
    if not is_moving.any():
        return float(data.time[row])
    usual = np.median(distances[:, is_moving], axis=1)
    nearest = int(usual.argmin())
    time = float(run.time[is_tried][nearest])
    is_right = is_moving & (distances[nearest] <= _MAX_OFF * usual[nearest])
    columns = [column for column, right in zip(columns, is_right, strict=True) if right]
    step = 1e-6 * max(end, 1e-9)  # s, for the difference quotient
    for _ in range(_LAG_ROUNDS):
        here, ahead = search.states_at(np.array([time, time + step]))[:, columns]
        slope = (ahead - here) / step
        size = float(slope @ slope)
        change = float((data.values[row, is_right] - here) @ slope) / size if size else 0.0
        time = min(max(time + change, 0.0), end - step)
    return time


# Columns


def _column_hypotheses(
    search: TrajectorySearch, data: ForeignData, inside: ForeignData, *, with_factor: bool
) -> Iterator[Hypothesis[Correction]]:
    """Yield possible mistakes in the columns of data whose times are right.

    Parameters
    ----------
    search : the reference, and the largest error that a mistake may leave.
    data, inside : the data with all rows, and with the rows up to the horizon.
    with_factor : whether a channel may be wrong by any factor.
    """
    states, carried = search.states_at(inside.time), search.carried(inside.time)
    columns = data.columns
    error = np.abs(inside.values - states[:, columns]) - FLOOR_SAFETY * inside.rounding
    if float((error / carried[:, columns]).max()) <= search.allowed:
        yield Hypothesis("", Correction(data), price=0)
        return
    corrected = _corrected_channels(
        _readings(search, data, states, carried, with_factor=with_factor)
    )
    if corrected is not None:
        yield corrected
    chosen, largest = _nearest_channels(inside, states, carried)
    if largest <= search.allowed and chosen != columns:
        yield _exchange(search.scene, data, chosen)
        return
    # Exchanged columns are often in degrees, too. Neither mistake explains such data alone.
    chosen, largest = _nearest_channels(_from_degrees(inside), states, carried)
    if largest <= search.allowed and chosen != columns:
        exchange = _exchange(search.scene, _from_degrees(data), chosen)
        mistakes = (*_degree_texts(data), *exchange.change.mistakes)
        correction = Correction(exchange.change.data, mistakes)
        yield Hypothesis("; and ".join(mistakes), correction, len(mistakes))


def _may_explain(search: TrajectorySearch, inside: ForeignData, *, with_factor: bool) -> bool:
    """Return whether mistakes in the columns may explain data, tested on windows of their rows.

    Short data are not tested: the result is True.

    Parameters
    ----------
    search : the reference, and the largest error that a mistake may leave.
    inside : rows of the data up to the horizon.
    with_factor : whether a channel may be wrong by any factor.
    """
    count = len(inside.time)
    if count <= _WINDOWS * _WINDOW_ROWS:
        return True
    wider = replace(search, tolerance=_WIDER * search.tolerance, worst=_WIDER * search.worst)
    for first in np.linspace(0, count - _WINDOW_ROWS, _WINDOWS).astype(int):
        window = inside.rows(slice(first, first + _WINDOW_ROWS))
        states, carried = search.states_at(window.time), search.carried(window.time)
        readings = _readings(wider, window, states, carried, with_factor=with_factor)
        places = range(len(window.channels))
        # A column whose numbers do not change in every row is not tested: if the column is held or
        # limited, the window may be too short to show this mistake.
        if all(held_rows(window.values[:, [j]]) != 1 or readings.best(j) for j in places):
            continue
        largest = min(
            _nearest_channels(columns, states, carried)[1]
            for columns in (window, _from_degrees(window))
        )
        if largest > wider.allowed:
            return False
    return True


def _readings(
    search: TrajectorySearch,
    data: ForeignData,
    states: Array,
    carried: Array,
    *,
    with_factor: bool,
) -> ColumnReadings:
    """Return the readings of the columns of data, with the allowed errors of a search."""
    return ColumnReadings(
        data,
        states,
        carried,
        search.states_at,
        search.allowed,
        search.tolerance,
        with_factor=with_factor,
    )


def _nearest_channels(
    inside: ForeignData, states: Array, carried: Array
) -> tuple[list[int], float]:
    """Assign to each column its nearest channel, to find columns that are exchanged.

    Parameters
    ----------
    inside : rows of the data up to the horizon.
    states, carried : (n, 2 (1 + blades)) the reference and `carried_errors` in these rows.

    Returns
    -------
    list of int, float
        For each column the place of its channel; the largest error of the columns with these
        channels, per unit of growth.
    """
    # Rates may be exchanged with angles, too: each column is compared with all channels. The sum of
    # the logarithms of the errors is minimized below, because a sum of the errors would depend on
    # the largest error alone.
    errors = np.empty((len(inside.columns), states.shape[1]))
    for j, values in enumerate(inside.values.T):
        errors[j] = (np.abs(values[:, None] - states) / carried).max(axis=0)
    preference = np.zeros_like(errors)
    places = range(len(errors))
    preference[places, inside.columns] = -1e-3  # if errors are equal, a column keeps its channel
    sizes = np.log10(np.clip(errors, 1e-16, 1e16)) + preference
    # If columns are exchanged, no two columns have the same channel. If a column is written in
    # place of another one, two columns have the same channel. Channels are assigned in both ways,
    # and the assignment whose largest error is smaller is taken.
    _, exchanged = linear_sum_assignment(sizes)
    chosen = min(exchanged, sizes.argmin(axis=1), key=lambda columns: errors[places, columns].max())
    return chosen.tolist(), float(errors[places, chosen].max())


def _from_degrees(data: ForeignData) -> ForeignData:
    """Return data converted from degrees and deg/s to rad and rad/s."""
    return replace(data, values=DEGREE * data.values, rounding=DEGREE * data.rounding)


def _degree_texts(data: ForeignData) -> list[str]:
    """Return the mistake that all angles are in degrees, and the same for the rates, in words."""
    texts = []
    for kind, text in DEGREE_TEXTS.items():
        names = [channel.name for channel in data.channels if channel.kind == kind]
        if names:
            texts.append(f"{', '.join(names)}: {text}")
    return texts


def _corrected_channels(readings: ColumnReadings) -> Hypothesis[Correction] | None:
    """Correct each channel by its own reading.

    Parameters
    ----------
    readings : the readings of all columns of the data.

    Returns
    -------
    Hypothesis or None
        The mistakes and the data corrected for them; None if no reading fits some channel, or the
        readings are not plausible together.
    """
    data = readings.data
    names: dict[str, list[str]] = {}
    kept, values, roundings = [], [], []
    processed = set()
    has_right_motion = False  # whether some column moves, and nothing is wrong in it
    for j, channel in enumerate(data.channels):
        reading = readings.best(j)
        if reading is None:
            return None
        names.setdefault(reading.text, []).append(channel.name)
        if reading.is_processed:
            processed.add(reading.text)
        elif not reading.text and float(np.ptp(data.values[:, j])) > readings.allowed:
            has_right_motion = True
        if reading.corrected is not None:
            kept.append(j)
            values.append(reading.corrected)
            roundings.append(reading.rounding)
    # Columns that are processed in different ways fit by chance. If all columns that move are late
    # or held, the mistake is in the rows, not in the columns.
    is_of_rows = any(text.endswith(LATE_OR_EARLY) or text.startswith(HELD) for text in processed)
    if len(processed) > 1 or (is_of_rows and not has_right_motion and len(data.channels) > 1):
        return None
    mistakes = tuple(f"{', '.join(which)}: {text}" for text, which in names.items() if text)
    if not values:
        return Hypothesis("; and ".join(mistakes), Correction(None, mistakes), len(mistakes))
    corrected = replace(
        data,
        channels=tuple(data.channels[j] for j in kept),
        values=np.stack(values, axis=1),
        rounding=np.stack(roundings, axis=1),
        wrapped=tuple(data.wrapped[j] for j in kept if data.wrapped),
    )
    # A channel that is some rows late has no right numbers in the last rows: they are left out.
    is_known = np.asarray(np.isfinite(corrected.values).all(axis=1))
    correction = Correction(corrected.rows(is_known), mistakes)
    return Hypothesis("; and ".join(mistakes), correction, len(mistakes))


def _exchange(scene: Scene, data: ForeignData, chosen: Sequence[int]) -> Hypothesis[Correction]:
    """Return the hypothesis that the columns of data are those of other channels.

    Parameters
    ----------
    scene : the rotor, with its channels.
    data : the data, whose columns are assigned other channels.
    chosen : for each column the place of its right channel, see `ForeignData.columns`.
    """
    known = channels(scene)[1:]
    others = tuple(known[column] for column in chosen)
    moved = []
    for own, other in zip(data.channels, others, strict=True):
        if own != other:
            moved.append(f"{own.name} is {other.name}")
    text = f"columns exchanged: {', '.join(moved)}"
    return Hypothesis(text, Correction(replace(data, channels=others), (text,)))
