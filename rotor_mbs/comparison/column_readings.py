"""Find the mistake in a column of a trajectory that explains how it differs from the reference.

Possible mistakes are wrong units, signs and zeros; rows that are late or early; differences of
angles in place of rates; means; numbers in coarse steps; and others. A reading assumes that the
column has one of these mistakes. Each reading is compared with the reference in the rows up to the
horizon, and the simplest reading that fits is taken.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from rotor_mbs.comparison.data import ForeignData
from rotor_mbs.solution.defects import FLOOR_SAFETY
from rotor_mbs.solution.trajectory import Array

DEGREE, _TURN = math.pi / 180.0, 2.0 * math.pi
DEGREE_TEXTS = {"angle": "degrees taken as rad", "rate": "deg/s taken as rad/s"}
# Factors by which numbers with a wrong unit are multiplied, and the mistake in words.
_FACTORS = {
    "angle": (
        (DEGREE, DEGREE_TEXTS["angle"]),
        (1.0 / DEGREE, "rad taken as degrees"),
        (_TURN, "turns taken as rad"),
    ),
    "rate": (
        (DEGREE, DEGREE_TEXTS["rate"]),
        (_TURN / 60.0, "rpm taken as rad/s"),
        (_TURN, "Hz taken as rad/s"),
    ),
}
LATE_OR_EARLY = (" late", " early")
HELD = "every number is held"
_MAX_ROWS_LATE = 3  # largest number of rows by which a column may be late or early
_MEANS_OF_ROWS = range(2, 22)  # numbers of rows over which a mean may be taken
_FINE_ROWS = 100  # means over an interval are computed for this many intervals, from the first on
_SAMPLES = 20  # number of parts of an interval, at whose ends the reference is computed for a mean
_MEANS_OF_SAMPLES = (2, 4, 5, 10, 20)  # numbers of samples over which a mean may be taken
# A mistake is accepted only if the error that it leaves is below this share of the error of the
# uncorrected column.
_FAR_LESS = 0.02
_MIN_COMPARED = 10  # smallest number of rows for a comparison: in fewer rows, some mean always fits
_MIN_LIMITED = 3  # smallest number of intervals without change in a limited column
_MIN_STEPS = 10  # smallest number of distinct numbers from which a step is found
_MAX_STEPS = 1 << 20  # largest number of steps in the range of a column with coarse steps
_MAX_DIVISIONS = 12  # largest number of iterations of Euclid's algorithm
_WHOLE = 1e-3  # largest deviation, in steps, from an integer number of steps
_EQUAL_STEPS = 1e-6  # relative: time steps that differ by no more than this are taken as equal
# Smallest share of the distance to the right number that a filter covers from row to row. The share
# must also be smaller than 1 by more than this number.
_MIN_SHARE = 0.01
# Largest rounding of the corrected numbers, relative to the difference that a filter explains.
_MAX_ROUNDING = 0.02
# Ways of bringing numbers to coarse steps, and the largest error of each, in steps.
_TRUNCATED = (("rounded", 0.5), ("cut off", 1.0))


@dataclass(frozen=True)
class Reading:
    """A mistake that a column may have, and the error that remains if the mistake is assumed.

    Attributes
    ----------
    text : the mistake in words, "" for none.
    left : the largest remaining error per unit of error growth, beyond rounding.
    corrected : (rows,) the right numbers; None if they cannot be found from the column.
    rounding : (rows,) largest error of each right number that rounding or coarse steps may cause.
    is_processed : whether the mistake is more than a wrong unit, sign, zero or factor.
    """

    text: str
    left: float
    corrected: Array | None
    rounding: Array
    is_processed: bool = False


class ColumnReadings:
    """The readings of the columns of data.

    Parameters
    ----------
    data : all rows of the data.
    states, carried : (n, 2 (1 + blades)) the angles and rates of the reference, and its
        `carried_errors`, in the rows from t = 0 to the horizon.
    states_at : function that returns the angles and rates of the reference at given times, s.
    allowed : largest error per unit of error growth that a reading may leave.
    tolerance : largest error per unit of error growth of a column without a mistake.
    with_factor : whether a column may also be wrong by any factor.
    """

    def __init__(
        self,
        data: ForeignData,
        states: Array,
        carried: Array,
        states_at: Callable[[Array], Array],
        allowed: float,
        tolerance: float,
        *,
        with_factor: bool,
    ) -> None:
        self.data = data
        self._begin = int(np.searchsorted(data.time, 0.0))  # before t = 0 there is no reference
        self._rows = slice(self._begin, self._begin + len(states))
        self._states, self._carried, self._states_at = states, carried, states_at
        self.allowed, self._tolerance = allowed, tolerance
        self._with_factor = with_factor
        self._fine: Array | None = None

    def best(self, j: int) -> Reading | None:
        """Return the simplest reading of a column among those that fit about equally well.

        The column without a mistake is tried first, then wrong units, signs, zeros and factors,
        then all other mistakes. A reading with a mistake fits only if it leaves a far smaller error
        than the uncorrected column has.

        Parameters
        ----------
        j : index of the column.

        Returns
        -------
        Reading or None
            The reading; None if none fits.
        """
        right = self._inverse(j, "", self.data.values[:, j])
        if right.left <= self._tolerance:
            return right
        enough = min(self.allowed, _FAR_LESS * right.left)
        reading = self._simplest(self._units(j), enough)
        if reading is not None:
            return reading
        # In a slow motion, differences, means and late rows give nearly the same numbers. All these
        # readings are therefore compared before one is taken.
        kinds = (self._late_rows, self._steps, self._limits, self._sums, self._held, self._filtered)
        processed = itertools.chain.from_iterable(
            kind(j) for kind in (*kinds, self._differences, self._means)
        )
        reading = self._simplest(processed, enough)
        if reading is not None:
            return replace(reading, is_processed=True)
        return right if right.left <= self.allowed else None

    def _simplest(self, readings: Iterable[Reading], enough: float) -> Reading | None:
        """Return the first of some readings that fits about as well as the best of them.

        Parameters
        ----------
        readings : the readings, the simplest first.
        enough : largest error per unit of error growth that a reading may leave.

        Returns
        -------
        Reading or None
            The reading; None if none fits.
        """
        readings = list(readings)
        least = min((reading.left for reading in readings), default=math.inf)
        if not least <= enough:
            return None
        alike = min(10.0 * max(least, 1e-3 * self._tolerance), enough)
        return next(reading for reading in readings if reading.left <= alike)

    def _left(self, j: int, expected: Array, values: Array, rounding: Array | float) -> float:
        """Return the largest error of a column per unit of error growth, beyond rounding.

        Parameters
        ----------
        j : index of the column.
        expected, values : (n,) expected numbers, and numbers of the column, in the rows up to the
            horizon. Rows in which one of them is NaN are left out.
        rounding : part of each error that is due to rounding.
        """
        is_known = np.isfinite(expected) & np.isfinite(values)
        if not is_known.any():
            return math.inf
        scale = self._carried[:, self.data.channels[j].column]
        error = np.maximum(np.abs(values - expected) - rounding, 0.0) / scale
        return float(error[is_known].max())

    def _expected(self, j: int) -> Array:
        """Return the numbers of the reference for a column, in the rows up to the horizon."""
        return np.asarray(self._states[:, self.data.channels[j].column])

    def _inverse(self, j: int, text: str, corrected: Array, factor: float = 1.0) -> Reading:
        """Return a reading whose right numbers are found from the column.

        Parameters
        ----------
        j : index of the column.
        text : the mistake in words, "" for none.
        corrected : (rows,) the right numbers, NaN in rows where they are unknown.
        factor : factor by which the numbers of the column, and so their rounding, were multiplied.
        """
        rounding = self.data.rounding[:, j] * abs(factor)
        left = self._left(
            j, self._expected(j), corrected[self._rows], FLOOR_SAFETY * rounding[self._rows]
        )
        return Reading(text, left, corrected, rounding)

    def _units(self, j: int) -> Iterator[Reading]:
        """Yield readings of a column with a wrong unit, sign, zero or factor, or missing turns.

        Parameters
        ----------
        j : index of the column.
        """
        values, kind = self.data.values[:, j], self.data.channels[j].kind
        begin, start = self._begin, float(self._expected(j)[0])
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
                yield self._inverse(j, ", ".join(mistakes), corrected, factor)
                # Whole turns cannot be restored if the rounding is half a turn or more.
                is_known = FLOOR_SAFETY * abs(factor) * self.data.rounding[:, j].max() < 0.5 * _TURN
                has_jumps = np.abs(np.diff(corrected)).max() > 0.5 * _TURN
                if kind == "angle" and is_known and has_jumps:
                    unwrapped = np.unwrap(corrected)
                    unwrapped += _TURN * np.round((start - unwrapped[begin]) / _TURN)
                    text_of_turns = ", ".join([*mistakes, "wrapped, taken as unwrapped"])
                    yield self._inverse(j, text_of_turns, unwrapped, factor)
        expected = self._expected(j)
        if self._with_factor:
            # The factor is found by least squares.
            factor = float(values[self._rows] @ expected / (expected @ expected))
            if factor:
                text = f"too large by a factor of {factor:.6g}"
                yield self._inverse(j, text, values / factor, 1.0 / factor)

    def _late_rows(self, j: int) -> Iterator[Reading]:
        """Yield readings of a column that is some rows late or early."""
        values = self.data.values[:, j]
        for late in range(1, _MAX_ROWS_LATE + 1):
            rows = "a row" if late == 1 else f"{late} rows"
            unknown = np.full(min(late, len(values)), np.nan)
            yield self._inverse(j, f"{rows} late", np.concatenate([values[late:], unknown]))
            yield self._inverse(j, f"{rows} early", np.concatenate([unknown, values[:-late]]))

    def _steps(self, j: int) -> Iterator[Reading]:
        """Yield readings of a column with numbers in coarse steps, or in half precision.

        Parameters
        ----------
        j : index of the column.
        """
        values, expected = self.data.values[:, j], self._expected(j)
        unit = self.data.channels[j].unit
        with np.errstate(over="ignore"):
            is_half = bool((values.astype(np.float16).astype(float) == values).all())
        found: list[tuple[str, Array]] = []
        if is_half:
            found.append(("numbers of half precision (float16)", 2.0**-11 * np.abs(values)))
        step = self._step(j)
        if step is not None:
            turns = _TURN / step
            of_turn = ""
            if unit == "rad" and abs(turns - round(turns)) < _WHOLE * turns and turns < _MAX_STEPS:
                of_turn = f", {round(turns)} a turn"
            for how, error in _TRUNCATED:
                text = f"{how} to steps of {step:.6g} {unit}{of_turn}"
                found.append((text, np.full(len(values), error * step)))
        for text, rounding in found:
            left = self._left(j, expected, values[self._rows], rounding[self._rows])
            yield Reading(text, left, values, np.maximum(rounding, self.data.rounding[:, j]))

    def _step(self, j: int) -> float | None:
        """Return the coarse step between the numbers of a column, None if there is none.

        If no step is found from the column itself, the step of another column of the same kind is
        tried: a column may have too few distinct numbers.
        """
        channels = self.data.channels
        for other in (j, *range(len(channels))):
            if channels[other].kind == channels[j].kind:
                step = _step_between(self.data.values[:, other])
                if step is not None:
                    numbers = (self.data.values[:, j] - self.data.values[0, other]) / step
                    is_whole = np.abs(numbers - np.round(numbers)).max() <= _WHOLE
                    return step if is_whole else None
        return None

    def _forward(self, j: int, text: str, expected: Array) -> Reading:
        """Return a reading whose right numbers cannot be found from the column.

        Parameters
        ----------
        j : index of the column.
        text : the mistake in words.
        expected : (n,) numbers that the mistake makes of the reference, in the rows up to the
            horizon; NaN in rows where they are unknown.
        """
        values, rounding = self.data.values[self._rows, j], self.data.rounding[:, j]
        if np.count_nonzero(np.isfinite(expected)) < _MIN_COMPARED:
            return Reading(text, math.inf, None, rounding)
        rounding_here = FLOOR_SAFETY * rounding[self._rows]
        left = self._left(j, expected, values, rounding_here)
        # The uncorrected column has to be wrong in the same rows. If nothing moves in these rows,
        # any reading fits, and then none is accepted.
        is_known = np.isfinite(expected)
        as_it_is = np.where(is_known, self._expected(j), np.nan)
        if not left < _FAR_LESS * self._left(j, as_it_is, values, rounding_here):
            left = math.inf
        return Reading(text, left, None, rounding)

    def _limits(self, j: int) -> Iterator[Reading]:
        """Yield readings of a column whose numbers a limit has cut off above or below.

        Parameters
        ----------
        j : index of the column.
        """
        values, expected = self.data.values[:, j], self._expected(j)
        here = values[self._rows]
        for which, limit, beyond in (
            ("most", float(values.max()), expected - here),
            ("least", float(values.min()), here - expected),
        ):
            is_limit = values == limit
            at_limit = is_limit[self._rows]
            is_held = np.count_nonzero(is_limit[1:] & is_limit[:-1]) >= _MIN_LIMITED
            if is_held and (beyond[at_limit] >= -self.allowed).all():
                known = np.where(is_limit, np.nan, values)
                unit = self.data.channels[j].unit
                yield self._inverse(j, f"limited to at {which} {limit:.6g} {unit}", known)

    def _sums(self, j: int) -> Iterator[Reading]:
        """Yield readings of a pitch plus or minus the rotor's angle, or a mean of all pitches.

        The same is tried for rates.

        Parameters
        ----------
        j : index of the column.
        """
        channel = self.data.channels[j]
        half = self._states.shape[1] // 2
        rotor = 0 if channel.kind == "angle" else half
        if channel.column in (0, half):
            return
        which = "rotor's angle" if channel.kind == "angle" else "rotor's rate"
        expected, of_rotor = self._expected(j), self._states[:, rotor]
        yield self._forward(j, f"with the {which} added", expected + of_rotor)
        yield self._forward(j, f"with the {which} subtracted", expected - of_rotor)
        mean = self._states[:, rotor + 1 : rotor + half].mean(axis=1)
        yield self._forward(j, "mean of the pitches of all blades", mean)

    def _held(self, j: int) -> Iterator[Reading]:
        """Yield the reading of a column whose numbers change only every few rows."""
        values = self.data.values[:, j]
        period = held_rows(values[:, None])
        if period > 1:
            held = np.full(len(values), np.nan)
            held[::period] = values[::period]
            yield self._inverse(j, f"{HELD} for {period} rows", held)

    def _filtered(self, j: int) -> Iterator[Reading]:
        """Yield the reading of a column that was smoothed by a first-order filter.

        From row to row, such a filter covers a constant share of the distance between its last
        output and the right number. The share is found by least squares. With the share, all right
        numbers but the first are computed from the column.

        Parameters
        ----------
        j : index of the column.
        """
        values, rounding = self.data.values[:, j], self.data.rounding[:, j]
        steps = np.diff(self.data.time)
        if np.ptp(steps) > _EQUAL_STEPS * steps[0]:
            return
        here, expected = values[self._rows], self._expected(j)
        distances = expected[1:] - here[:-1]
        share = float(np.diff(here) @ distances) / (float(distances @ distances) or 1.0)
        if not _MIN_SHARE < share < 1.0 - _MIN_SHARE:
            return
        right, growing = np.full(len(values), np.nan), rounding.copy()
        right[1:] = values[:-1] + np.diff(values) / share
        growing[1:] = (2.0 / share - 1.0) * np.maximum(rounding[1:], rounding[:-1])
        # Undoing the filter amplifies the rounding. The reading is dropped if the rounding is not
        # small compared with the difference, because it could then explain any difference.
        if not FLOOR_SAFETY * growing.max() <= _MAX_ROUNDING * np.abs(here - expected).max():
            return
        constant = float(-np.median(steps) / np.log1p(-share))
        text = f"smoothed by a filter of first order, time constant {constant:.3g} s"
        left = self._left(j, expected, right[self._rows], FLOOR_SAFETY * growing[self._rows])
        yield Reading(text, left, right, growing)

    def _differences(self, j: int) -> Iterator[Reading]:
        """Yield readings of a rate column that has difference quotients of the angle.

        Parameters
        ----------
        j : index of the column.
        """
        channel = self.data.channels[j]
        if channel.kind != "rate":
            return
        angle = self._states[:, channel.column - self._states.shape[1] // 2]
        time = self.data.time[self._rows]
        slopes = np.diff(angle) / np.diff(time)
        central = np.full(len(time), np.nan)
        central[1:-1] = np.gradient(angle, time)[1:-1]
        text = "differences of the angles"
        yield self._forward(j, f"{text} over two intervals, around each row", central)
        yield self._forward(
            j, f"{text}, the mean over the interval before each row", np.append(np.nan, slopes)
        )
        yield self._forward(
            j, f"{text}, the mean over the interval after each row", np.append(slopes, np.nan)
        )

    def _means(self, j: int) -> Iterator[Reading]:
        """Yield readings of a column that has means over rows or over an interval.

        Parameters
        ----------
        j : index of the column.
        """
        expected = self._expected(j)
        count = len(expected)
        sums = np.concatenate([[0.0], np.cumsum(expected)])
        for width in _MEANS_OF_ROWS:
            if count < 2 * width + _MIN_COMPARED:
                break
            means = (sums[width:] - sums[:-width]) / width
            ends = [("up to each row", width - 1)]
            if width % 2:
                ends.insert(0, ("around each row", width // 2))
            for text, before in ends:
                of_rows = np.full(count, np.nan)
                of_rows[before : before + len(means)] = means
                # Programs treat the rows at the ends in different ways; these rows are left out.
                of_rows[: width - 1] = of_rows[count - width + 1 :] = np.nan
                yield self._forward(j, f"mean of {width} rows {text}", of_rows)
        for text, means in self._means_of_samples(self.data.channels[j].column):
            of_rows = np.full(count, np.nan)
            of_rows[: len(means)] = means
            yield self._forward(j, text, of_rows)

    def _means_of_samples(self, column: int) -> Iterator[tuple[str, Array]]:
        """Yield means of the reference over the interval before, after or around a row.

        A mean is an integral over the whole interval, or a mean of equally spaced samples. Means
        are computed in the first `_FINE_ROWS` intervals only.

        Parameters
        ----------
        column : index of the angle or rate in the matrix of angles, then rates.

        Yields
        ------
        str, ndarray
            The kind of mean in words; (at most `_FINE_ROWS` + 1,) the mean for each of the first
            rows, rad or rad/s, NaN if its interval is not within these rows.
        """
        time = self.data.time[self._rows][: _FINE_ROWS + 1]
        if len(time) < _MIN_COMPARED:
            return
        if self._fine is None:
            shares = np.arange(_SAMPLES) / _SAMPLES
            fine = (time[:-1, None] + np.diff(time)[:, None] * shares).ravel()
            self._fine = self._states_at(np.append(fine, time[-1]))
        fine_values = self._fine[:, column]
        rows = np.arange(len(time)) * _SAMPLES
        weights = np.ones(_SAMPLES + 1)
        weights[1:-1:2], weights[2:-1:2] = 4.0, 2.0  # Simpson's rule
        whole = (np.arange(_SAMPLES + 1), weights / (3.0 * _SAMPLES))
        for where, shift in (("before", -_SAMPLES), ("after", 0), ("around", -_SAMPLES // 2)):
            kinds = [(f"mean over the interval {where} each row", *whole)]
            for samples in _MEANS_OF_SAMPLES:
                stride = _SAMPLES // samples
                # The samples of an interval before a row include its end, but not its start. Those
                # of the other intervals include the start, but not the end.
                offsets = stride * np.arange(samples) + (stride if where == "before" else 0)
                text = f"mean of {samples} samples of the interval {where} each row"
                kinds.append((text, offsets, np.full(samples, 1.0 / samples)))
            for text, offsets, weight in kinds:
                places: NDArray[np.int64] = rows[:, None] + offsets + shift
                is_inside = (places >= 0).all(axis=1) & (places < len(fine_values)).all(axis=1)
                means = np.full(len(time), np.nan)
                means[is_inside] = fine_values[places[is_inside]] @ weight
                yield text, means


def held_rows(values: Array) -> int:
    """Return the number of rows for which every number is held, 0 if the numbers never change.

    The result is the largest number of rows that divides all distances between changes; it is 1 if
    numbers change in two successive rows.

    Parameters
    ----------
    values : (n, columns) numbers. They change in a row if any column differs from the row before.
    """
    changes = np.flatnonzero(np.diff(values, axis=0).any(axis=1)) + 1
    if not len(changes):
        return 0
    # The first number may be held for fewer rows than the others, for example if each row has the
    # number of the nearest sample. The differences between changes do not depend on the first.
    return int(np.gcd.reduce(np.diff(changes))) if len(changes) > 1 else int(changes[0])


def _step_between(values: Array) -> float | None:
    """Return the step of which all differences between numbers are integer multiples.

    Parameters
    ----------
    values : (n,) numbers.

    Returns
    -------
    float or None
        The step; None if there is none, if it is not coarse, or if fewer than `_MIN_STEPS` numbers
        are distinct.
    """
    distinct = np.unique(values)
    if len(distinct) < _MIN_STEPS:
        return None
    differences = np.diff(distinct)
    step = float(differences.min())
    # The step is found by Euclid's algorithm, because the smallest difference may be several steps:
    # a fast column passes several steps from row to row.
    for _ in range(_MAX_DIVISIONS):
        if not distinct[-1] - distinct[0] < _MAX_STEPS * step:
            return None
        off = np.abs(differences - step * np.round(differences / step))
        if off.max() <= _WHOLE * step:
            break
        step = float(off[off > _WHOLE * step].min())
    # The step is accurate enough to count the steps in each difference. The sum of the differences,
    # divided by the sum of the counts, then gives the step with more digits.
    counts = np.round(differences / step)
    step = float(differences.sum() / counts.sum())
    if np.abs(differences / step - counts).max() > _WHOLE:
        return None
    return step
