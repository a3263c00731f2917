"""Hold the interval defects of a run: its error over each interval between samples.

The closed form is integrated from a sample of the run over one interval. The defect of the interval
is the state that the integration reaches, minus the run's next sample. Errors have little time to
grow within one interval, even in a chaotic motion. Defects are therefore compared with bounds over
the whole run, not only up to a horizon, and a fault is located in time. The sum of the signed
defects, each propagated by the transition matrices of the later intervals, predicts the error of
the run without a reference. `models.lagrange.defects` computes defects.

This is the rule by which a defect is judged. b is the method's bound for an interval of 0.01 s, h
is the length of the interval, G is the growth of an error over the interval, `size` is the
magnitude of the defect, and `floor` is the largest defect that rounding can cause:

    allowed = min(b, 0.01 rad) max(1, h / 0.01 s) max(1, G),    excess = size - 3 floor

A defect is a fault if its excess is larger than `allowed`. An interval without a fault is not
judged (`is_judged`) in two cases. Either its excess is larger than 0.01 rad, which is allowed only
in a long interval or if errors grow over it. Or 3 floor is larger than 0.01 rad, so that rounding
would hide a fault of this size.
"""

from __future__ import annotations

import functools
from collections.abc import Callable, Iterator
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from rotor_mbs.solution.status import OK_ERROR
from rotor_mbs.solution.trajectory import Array, Trajectory

# The floor is an estimate of the effect of rounding on a defect. The true effect may be this many
# times as large.
FLOOR_SAFETY = 3.0
# Length (s) of the interval for which bounds of methods are given. In an interval of n times this
# length the errors of a method add up n times, and each grows by a factor of at most G.
_BOUND_INTERVAL = 0.01
# Smallest floor, rad. No defect as small as this can be distinguished from zero.
_SMALLEST_FLOOR = 1e-18
# A pitch that should stay at zero has left zero when its magnitude exceeds this limit, rad. The
# limit is ten million times the round-off of a radian, and far below what a plot shows.
LEFT_ZERO = 1e-9
# Number of intervals over which defects are added up, to show a drift that is not visible in single
# defects.
DRIFT_ROWS = 100
# Number of intervals whose transition matrices are processed at once. The matrices of all intervals
# of a run with a million samples would take gigabytes.
BLOCK_ROWS = 40 * DRIFT_ROWS
# The transition matrices of a run with at most this many intervals are kept in memory: 51 MB with
# three blades. For a longer run, each of the few loops that use the matrices computes them again.
# This takes less than half as long as the integration of the defects.
KEPT_ROWS = 25 * BLOCK_ROWS


@dataclass(frozen=True)
class Defects:
    """Hold the interval defects of a run with n samples.

    Coordinate 0 is the rotor angle, coordinate i is the pitch angle of blade i. The m variables are
    the angles, then the rates, of the coordinates that move.

    Attributes
    ----------
    time : (n,) s, sample times.
    angles, rates : (n - 1, 1 + blades) rad and rad/s, closed form minus run at the end of each
        interval; NaN where the closed form does not reach the end.
    rate_units : (1 + blades,) rad/s, unit of each rate. A rate defect divided by its unit counts
        like an angle in rad.
    find_transitions : function that computes the transition matrices of a slice of the intervals,
        see `transitions`.
    moving : numbers of the coordinates that move.
    resting : numbers of the pitch coordinates that stay at zero by symmetry. The error of such a
        pitch is its own angle.
    states : (n, m) rad, then rad/s, variables of the run at its samples.
    rounding : (n, m) rad, then rad/s, largest rounding error of `states`: half a unit in the last
        place of each number, plus its change while the time changes by half a unit in the last
        place.
    conditioning : (n - 1,) factor by which a nearly singular mass matrix magnifies rounding errors
        within each interval.
    start : (m,) rad, then rad/s, variables of the scene's initial state.
    growth_units : (m,) rad, then rad/s, units of the variables in which the error growth is
        computed.
    own_loads : loads of the closed form at the states of the run; without load arrays if the scene
        does not request loads.
    precision : relative error of one integration step of the closed form.
    """

    time: Array
    angles: Array
    rates: Array
    rate_units: Array
    find_transitions: Callable[[slice], Array]
    moving: tuple[int, ...]
    resting: tuple[int, ...]
    states: Array
    rounding: Array
    conditioning: Array
    start: Array
    growth_units: Array
    own_loads: Trajectory
    precision: float = 2.0**-52

    @functools.cached_property
    def transitions(self) -> Array:
        """Return the state transition matrix of each interval, (n - 1, m, m).

        A matrix is infinite if the closed form does not reach the end of its interval.
        """
        return self.find_transitions(slice(0, len(self.angles)))

    @functools.cached_property
    def sizes(self) -> Array:
        """Return the largest magnitude of the defects in each interval, (n - 1,) rad.

        The largest is taken over all angles, and all rates divided by `rate_units`. It is infinite
        if a defect is not finite.
        """
        largest: Array = np.empty(len(self.angles))
        for rows in row_blocks(len(largest)):
            both = np.hstack(
                [np.abs(self.angles[rows]), np.abs(self.rates[rows]) / self.rate_units]
            )
            largest[rows] = np.where(np.isfinite(both), both, np.inf).max(axis=1)
        return largest

    @property
    def channel_sizes(self) -> Array:
        """Return the magnitude of the defect of each variable, (n - 1, m) rad.

        Rates are divided by `rate_units`. A magnitude is infinite if the defect is not finite.
        """
        return self._channel_sizes(slice(0, len(self.angles)))

    @property
    def floor(self) -> Array:
        """Return the largest of `floors` in each interval, (n - 1,) rad."""
        return np.asarray(self.floors.max(axis=1))

    @functools.cached_property
    def floors(self) -> Array:
        """Return the largest defect of each variable that rounding can cause, (n - 1, m) rad.

        Three rounding errors are added: the error of the sample at the start of the interval,
        propagated to its end; the error of the sample at the end; and the error of the arithmetic
        between them, which grows as much as any other error.
        """
        return self._floors_and_growth[0]

    @property
    def growth(self) -> Array:
        """Return the error growth over each interval, (n - 1,).

        The growth is the largest magnitude of an entry of the transition matrix, with rates in
        `rate_units`.
        """
        return self._floors_and_growth[1]

    @property
    def channel_excess(self) -> Array:
        """Return the defect of each variable beyond rounding, (n - 1, m) rad.

        It is infinite where a defect is not finite.
        """
        return self._channel_excess(slice(0, len(self.angles)))

    @functools.cached_property
    def excess(self) -> Array:
        """Return the largest defect beyond rounding in each interval, (n - 1,) rad.

        The largest is taken over all coordinates, also those that do not move.
        """
        fixed = [i for i in range(self.angles.shape[1]) if i not in self.moving]
        excess: Array = np.empty(len(self.angles))
        for rows in row_blocks(len(excess)):
            angles, rates = self.angles[rows, fixed], self.rates[rows, fixed]
            sizes = np.hstack([np.abs(angles), np.abs(rates) / self.rate_units[fixed]])
            floor = self.floors[rows].max(axis=1)
            with np.errstate(invalid="ignore"):
                of_fixed = np.where(
                    np.isfinite(sizes), sizes - FLOOR_SAFETY * floor[:, None], np.inf
                )
            both = np.hstack([self._channel_excess(rows), of_fixed])
            excess[rows] = both.max(axis=1, initial=0.0)
        return excess

    @functools.cached_property
    def bound_factors(self) -> Array:
        """Return the factors by which a bound for 0.01 s is multiplied in the intervals, (n - 1,).

        The factor of an interval is max(1, h / 0.01 s) max(1, G), see the module's docstring.
        """
        length = np.maximum(np.diff(self.time) / _BOUND_INTERVAL, 1.0)
        return np.asarray(length * np.maximum(self.growth, 1.0))

    def in_bound_units(self, excess: Array) -> Array:
        """Return defects beyond rounding, each divided by the bound factor of its interval.

        A value that is not finite becomes infinite.

        Parameters
        ----------
        excess : (n - 1,) or (n - 1, m) rad, defects beyond rounding of each interval.
        """
        factors = self.bound_factors.reshape(-1, *[1] * (excess.ndim - 1))
        with np.errstate(invalid="ignore"):
            return np.asarray(np.where(np.isfinite(excess), excess / factors, np.inf))

    @property
    def judged_sizes(self) -> Array:
        """Return the value of each interval that is compared with a method's bound, (n - 1,) rad.

        The value is `excess` divided by `bound_factors`.
        """
        return self.in_bound_units(self.excess)

    @property
    def is_resolved(self) -> NDArray[np.bool_]:
        """Return for each interval whether rounding can cause at most a 0.01 rad defect, (n - 1,).

        An interval whose defect is not finite counts as resolved, because its fault is certain.
        """
        return np.asarray((FLOOR_SAFETY * self.floor <= OK_ERROR) | ~np.isfinite(self.sizes))

    @property
    def is_judged(self) -> NDArray[np.bool_]:
        """Return for each interval whether it is resolved and its excess <= 0.01 rad, (n - 1,).

        In such an interval a fault of more than 0.01 rad would be seen.
        """
        return np.asarray(self.is_resolved & (self.excess <= OK_ERROR))

    @property
    def predicted(self) -> Array:
        """Return the errors of the run's angles that its defects predict, (n, 1 + blades) rad.

        The error of the initial state is included. The prediction is linear, and therefore valid
        for errors that are small compared with 1 rad.
        """
        angles = np.zeros((len(self.time), self.angles.shape[1]))
        angles[:, list(self.moving)] = self._errors_and_drift[0]
        return angles

    @property
    def drift(self) -> float:
        """Return the largest magnitude of a sum of up to `DRIFT_ROWS` consecutive defects, rad.

        The run is divided into stretches of `DRIFT_ROWS` intervals. Within a stretch defects are
        added up from its start to each sample, each propagated to this sample.
        """
        return self._errors_and_drift[1]

    @functools.cached_property
    def error_growth(self) -> Array:
        """Return the error growth from the start of the run to each sample, (n,).

        The growth is the 2-norm of the state transition matrix from the start to the sample, in
        `growth_units`. Pitches that rest at zero are left out.
        """
        growth = np.full(len(self.time), np.inf)
        growth[0] = 1.0
        for block, stack in self._growth_matrices():
            growth[1 + block.start : 1 + block.stop] = _two_norms(stack)
        return growth

    @property
    def mean(self) -> float:
        """Return the largest magnitude of the mean defects, rad.

        The mean of each angle and each rate is taken over the signed defects of the intervals whose
        defects are finite. The result is NaN if there is no such interval.
        """
        finite = np.isfinite(self.sizes)
        if not finite.any():
            return float("nan")
        total = np.zeros(2 * self.angles.shape[1])
        for rows in row_blocks(len(finite)):
            both = np.hstack([self.angles[rows], self.rates[rows] / self.rate_units])
            # Put the sum of the earlier intervals in front, so that defects are added in the order
            # of the intervals.
            total = np.vstack([total, both[finite[rows]]]).sum(axis=0)
        return float(np.abs(total / finite.sum()).max())

    def over_rows(self, rows: int) -> tuple[Array, Array]:
        """Return sums of defects over stretches of intervals, and the sums that rounding can cause.

        A sum reveals a drift that the rounding of single samples hides. The rounding errors of the
        samples inside a stretch, and of their times, cancel in the sum, because each of these
        samples ends one interval and begins the next.

        Parameters
        ----------
        rows : number of intervals in a stretch.

        Returns
        -------
        sums : (k, m) rad, magnitude of the sum over each of the k stretches. Intervals after the
            last complete stretch are left out.
        floors : (k, m) rad, largest magnitude of each sum that rounding can cause.
        """
        count = len(self.angles) // rows * rows
        sums, floors = np.empty((2, count // rows, len(self.start)))
        units, stretches_at_once = self._units, max(BLOCK_ROWS // rows, 1)
        with np.errstate(all="ignore"):
            for first in range(0, len(sums), stretches_at_once):
                stretches = slice(first, min(first + stretches_at_once, len(sums)))
                inside = slice(first * rows, stretches.stop * rows)
                ends = slice(inside.start + rows, inside.stop + 1, rows)
                products, errors = _carried(
                    self._transitions_in(inside), -self._vectors(inside), rows
                )
                sums[stretches] = np.abs(errors[:, -1]) / units
                carried = np.einsum(
                    "kij,kj->ki", np.abs(products[:, -1]), self.rounding[inside][::rows]
                )
                floors[stretches] = (carried + self.rounding[ends]) / units
                # The rounding errors of the arithmetic in different intervals are independent, so
                # that their sum grows with the square root of the number of intervals. Each of them
                # also grows over the stretch like any other error.
                growth = np.maximum(_largest_entry(products[:, -1], units), 1.0)
                size = self._arithmetic[inside].reshape(-1, rows).max(axis=1)
                floors[stretches] += (np.sqrt(rows) * size * growth)[:, None]
            return sums, _with_small_numbers(floors)

    def horizon_samples(self, limit: float) -> int:
        """Return the number of samples before the error growth along the run reaches `limit`.

        Parameters
        ----------
        limit : error growth, larger than 1, which is the growth at the start.
        """
        for block, stack in self._growth_matrices():
            # The 2-norm of a matrix is at most its Frobenius norm, which is computed in a tenth of
            # the time. So the 2-norm is needed only if the Frobenius norm reaches the limit.
            with np.errstate(all="ignore"):
                sizes = np.sqrt(np.square(stack).sum(axis=(1, 2)))
            near = np.flatnonzero(~(sizes < limit))
            beyond = near[~(_two_norms(stack[near]) < limit)]
            if len(beyond):
                return int(1 + block.start + beyond[0])
        return len(self.time)

    def _growth_matrices(self) -> Iterator[tuple[slice, Array]]:
        """Yield slices of the intervals, with the transition matrices from the start of the run.

        There is a matrix for each interval of the slice: it leads from the start of the run to the
        end of the interval. The matrices are in `growth_units`. Pitches that rest at zero are left
        out.
        """
        half = len(self.moving)
        free = [i for i, coordinate in enumerate(self.moving) if coordinate not in self.resting]
        rows = np.array([*free, *(half + i for i in free)])
        units = self.growth_units[rows]
        whole = np.eye(len(rows))  # product of the matrices of all intervals so far
        for block in row_blocks(len(self.angles)):
            matrices = self._transitions_in(block)
            scaled = matrices[:, rows[:, None], rows] * units / units[:, None]
            with np.errstate(all="ignore"):
                # Compute the products within every stretch, all stretches at once. Then multiply
                # the products of each stretch by that of all intervals before it.
                products, _ = _carried(scaled, np.zeros((len(scaled), len(rows))), DRIFT_ROWS)
                for stretch in products:
                    stretch[:] = stretch @ whole
                    whole = stretch[-1]
            yield block, products[:, 1:].reshape(-1, len(rows), len(rows))[: len(scaled)]

    @property
    def _units(self) -> Array:
        columns = list(self.moving)
        return np.concatenate([np.ones(len(columns)), self.rate_units[columns]])

    def _transitions_in(self, rows: slice) -> Array:
        """Return the transition matrices of a slice of the intervals, (k, m, m).

        The matrices of a run with at most `KEPT_ROWS` intervals are computed once and kept.
        """
        if len(self.angles) <= KEPT_ROWS:
            return self.transitions[rows]
        return self.find_transitions(rows)

    @functools.cached_property
    def _floors_and_growth(self) -> tuple[Array, Array]:
        """Return `floors` and `growth`, computed in one loop over the transition matrices."""
        floors, growth = np.empty((len(self.angles), len(self.start))), np.empty(len(self.angles))
        for rows in row_blocks(len(growth)):
            matrices = self._transitions_in(rows)
            at_end = slice(rows.start + 1, rows.stop + 1)
            with np.errstate(all="ignore"):
                growth[rows] = _largest_entry(matrices, self._units)
                carried = np.einsum("kij,kj->ki", np.abs(matrices), self.rounding[rows])
                of_block = (carried + self.rounding[at_end]) / self._units
                of_block += (self._arithmetic[rows] * np.maximum(growth[rows], 1.0))[:, None]
                floors[rows] = _with_small_numbers(of_block)
        return floors, growth

    def _vectors(self, rows: slice) -> Array:
        """Return the defects of the variables in a slice of the intervals, (k, m).

        The units are rad for angles, then rad/s for rates.
        """
        columns = list(self.moving)
        return np.hstack([self.angles[rows, columns], self.rates[rows, columns]])

    def _channel_sizes(self, rows: slice) -> Array:
        """Return `channel_sizes` in a slice of the intervals, (k, m) rad."""
        sizes = np.abs(self._vectors(rows)) / self._units
        return np.asarray(np.where(np.isfinite(sizes), sizes, np.inf))

    def _channel_excess(self, rows: slice) -> Array:
        """Return `channel_excess` in a slice of the intervals, (k, m) rad."""
        sizes = self._channel_sizes(rows)
        with np.errstate(invalid="ignore"):
            excess = np.maximum(sizes - FLOOR_SAFETY * self.floors[rows], 0.0)
        return np.asarray(np.where(np.isfinite(sizes), excess, np.inf))

    @functools.cached_property
    def _arithmetic(self) -> Array:
        """Return the rounding error of the arithmetic within each interval, (n - 1,) rad.

        The error of one integration step is `precision` times the largest variable times
        `conditioning`. Errors of different steps are independent: their sum grows with the square
        root of the number of steps. A step is assumed to span one radian of the fastest coordinate.
        """
        sizes, fastest = np.empty((2, len(self.states)))
        for rows in row_blocks(len(self.states)):
            magnitudes = np.abs(self.states[rows])
            sizes[rows] = (magnitudes / self._units).max(axis=1)
            fastest[rows] = magnitudes[:, len(self.moving) :].max(axis=1)
        largest, rate = (np.maximum(values[:-1], values[1:]) for values in (sizes, fastest))
        steps = np.maximum(rate * np.diff(self.time), 1.0)
        return np.asarray(self.precision * largest * self.conditioning * np.sqrt(steps))

    @functools.cached_property
    def _errors_and_drift(self) -> tuple[Array, float]:
        """Return the predicted errors of the moving angles, (n, m / 2) rad, and `drift` (rad).

        Both are computed in one loop over the transition matrices.
        """
        half = len(self.moving)
        resting = [i for i, coordinate in enumerate(self.moving) if coordinate in self.resting]
        at_zero = [*resting, *(half + i for i in resting)]
        angles, drift = np.empty((len(self.time), half)), 0.0
        error = self.states[0] - self.start  # errors of all variables at the current sample
        angles[0] = error[:half]
        for block in row_blocks(len(self.angles)):
            matrices, offsets = self._transitions_in(block).copy(), -self._vectors(block)
            # The error of a pitch that should rest at zero is known: it is its angle and its rate.
            matrices[:, at_zero] = 0.0
            offsets[:, at_zero] = self.states[1:][block][:, at_zero]
            row = block.start
            with np.errstate(all="ignore"):
                products, sums = _carried(matrices, offsets, DRIFT_ROWS)
                drift = max(drift, float((np.abs(sums) / self._units).max(initial=0.0)))
                # The error at the end of a stretch is needed for the next one, so that this loop
                # goes from stretch to stretch.
                for product, own in zip(products, sums, strict=True):
                    last = min(row + DRIFT_ROWS, block.stop)
                    errors = product[1:] @ error + own[1:]
                    angles[row + 1 : last + 1] = errors[: last - row, :half]
                    error = errors[last - row - 1]
                    row = last
        return angles, drift


def row_blocks(count: int) -> Iterator[slice]:
    """Yield slices of at most `BLOCK_ROWS` of `count` rows.

    The length of each slice except the last is a multiple of `DRIFT_ROWS`.
    """
    for start in range(0, count, BLOCK_ROWS):
        yield slice(start, min(start + BLOCK_ROWS, count))


def _two_norms(matrices: Array) -> Array:
    """Return the 2-norms of (k, m, m) matrices, (k,); infinite for a matrix that is not finite."""
    norms = np.full(len(matrices), np.inf)
    finite = np.isfinite(matrices).all(axis=(1, 2))
    norms[finite] = np.linalg.norm(matrices[finite], ord=2, axis=(1, 2))
    return norms


def _largest_entry(matrices: Array, units: Array) -> Array:
    """Return the largest magnitude of an entry of each matrix, (k,).

    It is infinite if an entry is NaN. The 2-norm of a matrix is at least this magnitude, and at
    most m times as large.

    Parameters
    ----------
    matrices : (k, m, m) state transition matrices.
    units : (m,) units of the variables in which the entries are computed.
    """
    entries = np.abs(matrices * units / units[:, None]).max(axis=(1, 2))
    return np.asarray(np.where(np.isnan(entries), np.inf, entries))


def _with_small_numbers(floors: Array) -> Array:
    """Return floors, increased by the second-order effect of the other variables' rounding errors.

    The rounding error of a variable that is nearly zero is nearly zero, too. Then this effect may
    be larger than that error. The result is at least 1e-18 rad; NaN becomes infinite.

    Parameters
    ----------
    floors : (k, m) rad.
    """
    floors = floors + np.square(floors.max(axis=1, keepdims=True, initial=0.0)) + _SMALLEST_FLOOR
    return np.asarray(np.where(np.isnan(floors), np.inf, floors))


def _carried(matrices: Array, offsets: Array, rows: int) -> tuple[Array, Array]:
    """Propagate errors e -> matrix @ e + offset in stretches of intervals, all stretches at once.

    Parameters
    ----------
    matrices, offsets : (k, m, m) and (k, m), the matrix and the offset of each interval.
    rows : number of intervals in a stretch.

    Returns
    -------
    products : (stretches, 1 + rows, m, m)
        Product of the matrices from the start of the stretch to each of its samples.
    errors : (stretches, 1 + rows, m)
        Sum of the offsets from the start of the stretch to each of its samples, each offset
        propagated to the sample. The last stretch is padded with intervals that change nothing.
    """
    k, m = offsets.shape
    stretches = max(-(-k // rows), 1)
    steps = np.broadcast_to(np.eye(m), (stretches * rows, m, m)).copy()
    added = np.zeros((stretches * rows, m))
    steps[:k], added[:k] = matrices, offsets
    steps, added = steps.reshape(stretches, rows, m, m), added.reshape(stretches, rows, m)
    products, errors = np.empty((stretches, 1 + rows, m, m)), np.zeros((stretches, 1 + rows, m))
    products[:, 0] = np.eye(m)
    # The loop is over the intervals of one stretch. Each iteration computes this interval of all
    # stretches.
    for row in range(rows):
        products[:, row + 1] = steps[:, row] @ products[:, row]
        errors[:, row + 1] = np.einsum("kij,kj->ki", steps[:, row], errors[:, row]) + added[:, row]
    return products, errors
