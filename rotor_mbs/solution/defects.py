"""Interval defects of a run: its error over each interval between samples.

A defect is the closed form integrated from a sample to the next, minus the run's next sample.
Within one interval between samples no chaos can grow, so that defects need no horizon: every second
of every run is judged, and a fault is located in time. Their signed sum, carried to the end by the
transition matrices of the intervals, predicts the error of the whole run without a reference.
`models.lagrange.defects` computes them.

The rule by which they are judged, with b the bound of a method for 0.01 s, h the length of an
interval and G the growth of an error over it:

    allowed = min(b, 0.01 rad) max(1, h / 0.01 s) max(1, G),    excess = size - 3 floor

An excess above what is allowed is a fault. An interval that shows no fault is not judged where its
excess is more than 0.01 rad, which is allowed only between rows that are far apart, or where
rounding alone may be as large (`is_judged`).
"""

from __future__ import annotations

import functools
from collections.abc import Callable, Iterator
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from rotor_mbs.solution.status import OK_ERROR
from rotor_mbs.solution.trajectory import Array, Trajectory

# The true effect of rounding on a defect may be this many times its estimate.
FLOOR_SAFETY = 3.0
# s, the interval for which bounds are given: over n such intervals the errors of a method add up,
# each grown by at most G.
_BOUND_INTERVAL = 0.01
# rad, below any defect that can be distinguished from zero.
_SMALLEST_FLOOR = 1e-18
# rad: a pitch that should stay zero has left it when it exceeds this: ten million times the
# round-off of a radian, far below what a plot shows.
LEFT_ZERO = 1e-9
# Rows over which defects are added up, to show a drift that is not visible in single defects.
DRIFT_ROWS = 100
# Intervals whose matrices are processed at once: all those of a run of a million samples would take
# gigabytes.
BLOCK_ROWS = 40 * DRIFT_ROWS
# Up to so many intervals their matrices are kept, 51 MB with three blades. Those of longer runs are
# computed again by each of the few loops that need them, which takes less than half as long as the
# integration from row to row.
KEPT_ROWS = 25 * BLOCK_ROWS


@dataclass(frozen=True)
class Defects:
    """Hold the interval defects of a run with n samples.

    The coordinates are the rotor, then the pitch of each blade; m is twice the number of those that
    move.

    Attributes
    ----------
    time : (n,) s, sample times.
    angles, rates : (n - 1, 1 + blades) rad and rad/s, closed form minus run; NaN if its integration
        fails.
    rate_units : (1 + blades,) rad/s, scale of the rates: a rate defect times the interval is an
        angle.
    find_transitions : function that computes those of `transitions` in a slice of the intervals.
    moving : coordinates with inertia.
    resting : pitches that stay at zero by symmetry, where the error is the state itself.
    states : (n, m) angles, then rates, of the moving coordinates of the run.
    rounding : (n, m) half a unit in the last place of each of these numbers, and the effect of half
        a unit in the last place of the row's time on them.
    conditioning : (n - 1,) factor by which the nearly singular mass matrix magnifies rounding
        inside an interval.
    start : (m,) initial state of the scene in these coordinates.
    growth_units : (m,) scales of the error growth of the scene: angles, then rates.
    own_loads : loads of the closed form at the states of the run; without arrays if not requested.
    precision : relative error of a step of the integration from row to row.
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
        """Return the state transition matrices of the moving coordinates, (n - 1, m, m).

        Angles come first, then rates. A matrix is infinite where the closed form does not reach the
        next row.
        """
        return self.find_transitions(slice(0, len(self.angles)))

    @functools.cached_property
    def sizes(self) -> Array:
        """Return the largest defect over the coordinates, (n - 1,) rad; inf for NaN.

        It is that of the angles, and of the rates in `rate_units`.
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
        """Return the magnitudes of the defects of the moving coordinates, (n - 1, m) rad.

        Angles come first, then rates; inf for NaN.
        """
        return self._channel_sizes(slice(0, len(self.angles)))

    @property
    def floor(self) -> Array:
        """Return the largest of `floors` over the coordinates, (n - 1,) rad."""
        return np.asarray(self.floors.max(axis=1))

    @functools.cached_property
    def floors(self) -> Array:
        """Return the largest defects that rounding can cause, per coordinate: (n - 1, m) rad.

        They add up from the rounding of the row at the start, carried to the end; that of the row
        at the end; and that of the arithmetic in between, which grows as much as any other error.
        """
        return self._floors_and_growth[0]

    @property
    def growth(self) -> Array:
        """Return the error growth over each interval, (n - 1,).

        It is the largest entry of the transition matrix, with the rates in `rate_units`.
        """
        return self._floors_and_growth[1]

    @property
    def channel_excess(self) -> Array:
        """Return the defects beyond rounding of the moving coordinates, (n - 1, m) rad.

        They are infinite where a defect is not finite.
        """
        return self._channel_excess(slice(0, len(self.angles)))

    @functools.cached_property
    def excess(self) -> Array:
        """Return the largest defect beyond rounding over all coordinates, (n - 1,) rad."""
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
        """Return the factor of a bound for 0.01 s in each interval, (n - 1,)."""
        length = np.maximum(np.diff(self.time) / _BOUND_INTERVAL, 1.0)
        return np.asarray(length * np.maximum(self.growth, 1.0))

    def in_bound_units(self, excess: Array) -> Array:
        """Return defects beyond rounding, each divided by its interval's `bound_factors`.

        Parameters
        ----------
        excess : (n - 1,) or (n - 1, m) rad.
        """
        factors = self.bound_factors.reshape(-1, *[1] * (excess.ndim - 1))
        with np.errstate(invalid="ignore"):
            return np.asarray(np.where(np.isfinite(excess), excess / factors, np.inf))

    @property
    def judged_sizes(self) -> Array:
        """Return the values that are compared with a method's bound, (n - 1,) rad.

        They are `excess` divided by `bound_factors`.
        """
        return self.in_bound_units(self.excess)

    @property
    def is_resolved(self) -> NDArray[np.bool_]:
        """Return whether rounding explains at most 0.01 rad in each interval, (n - 1,).

        An interval whose defect is not finite is resolved, too.
        """
        return np.asarray((FLOOR_SAFETY * self.floor <= OK_ERROR) | ~np.isfinite(self.sizes))

    @property
    def is_judged(self) -> NDArray[np.bool_]:
        """Return whether a defect of more than 0.01 rad would be seen in each interval, (n - 1,).

        It would be if the interval is resolved, and its own excess is at most 0.01 rad.
        """
        return np.asarray(self.is_resolved & (self.excess <= OK_ERROR))

    @property
    def predicted(self) -> Array:
        """Return the error of the angles that the defects predict, (n, 1 + blades) rad.

        The error of the initial state is included. It is valid for errors that are small compared
        with 1 rad.
        """
        angles = np.zeros((len(self.time), self.angles.shape[1]))
        angles[:, list(self.moving)] = self._errors_and_drift[0]
        return angles

    @property
    def drift(self) -> float:
        """Return the largest sum of defects over `DRIFT_ROWS` rows (rad).

        Each defect is propagated to the end of these rows.
        """
        return self._errors_and_drift[1]

    @functools.cached_property
    def error_growth(self) -> Array:
        """Return the error growth along the run, (n,).

        It is the 2-norm of the state transition matrix from the start in the moving coordinates,
        without those that rest at zero.
        """
        growth = np.full(len(self.time), np.inf)
        growth[0] = 1.0
        for block, stack in self._growth_matrices():
            growth[1 + block.start : 1 + block.stop] = _two_norms(stack)
        return growth

    @property
    def mean(self) -> float:
        """Return the largest signed mean of the defects over the finite ones (rad).

        NaN if there are none.
        """
        finite = np.isfinite(self.sizes)
        if not finite.any():
            return float("nan")
        total = np.zeros(2 * self.angles.shape[1])
        for rows in row_blocks(len(finite)):
            both = np.hstack([self.angles[rows], self.rates[rows] / self.rate_units])
            # The sum so far is the first row: the order of the additions is that of the rows.
            total = np.vstack([total, both[finite[rows]]]).sum(axis=0)
        return float(np.abs(total / finite.sum()).max())

    def over_rows(self, rows: int) -> tuple[Array, Array]:
        """Return sums of the defects over a number of rows, and what rounding can cause of them.

        They reveal a drift that is smaller than single defects. Roundings of the rows in between,
        and of their times, cancel: one row ends an interval and begins the next.

        Parameters
        ----------
        rows : number of intervals in a stretch.

        Returns
        -------
        sums, floors : (k, m) rad, of k stretches of `rows` intervals; floors are the largest sums
            that rounding can cause.
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
                # The errors of the arithmetic are independent of each other, and grow as much as
                # any other.
                growth = np.maximum(_largest_entry(products[:, -1], units), 1.0)
                size = self._arithmetic[inside].reshape(-1, rows).max(axis=1)
                floors[stretches] += (np.sqrt(rows) * size * growth)[:, None]
            return sums, _with_small_numbers(floors)

    def horizon_samples(self, limit: float) -> int:
        """Return the number of samples before the error growth along the run reaches `limit`.

        Parameters
        ----------
        limit : above 1, the growth at the start.
        """
        for block, stack in self._growth_matrices():
            # No 2-norm is larger than this one, which takes a tenth of the time.
            with np.errstate(all="ignore"):
                sizes = np.sqrt(np.square(stack).sum(axis=(1, 2)))
            near = np.flatnonzero(~(sizes < limit))
            beyond = near[~(_two_norms(stack[near]) < limit)]
            if len(beyond):
                return int(1 + block.start + beyond[0])
        return len(self.time)

    def _growth_matrices(self) -> Iterator[tuple[slice, Array]]:
        """Yield slices of the intervals with the transition matrices from the start to their ends.

        They are in the units of the growth, without the coordinates that rest at zero.
        """
        half = len(self.moving)
        free = [i for i, coordinate in enumerate(self.moving) if coordinate not in self.resting]
        rows = np.array([*free, *(half + i for i in free)])
        units = self.growth_units[rows]
        whole = np.eye(len(rows))  # product of the matrices since the start
        for block in row_blocks(len(self.angles)):
            matrices = self._transitions_in(block)
            scaled = matrices[:, rows[:, None], rows] * units / units[:, None]
            with np.errstate(all="ignore"):
                # First the products within all stretches at once, then from stretch to stretch.
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
        """Return `transitions` in a slice of the intervals; they are kept up to `KEPT_ROWS`."""
        if len(self.angles) <= KEPT_ROWS:
            return self.transitions[rows]
        return self.find_transitions(rows)

    @functools.cached_property
    def _floors_and_growth(self) -> tuple[Array, Array]:
        """Return `floors` and `growth`, by one loop over the transition matrices."""
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
        """Return the defects of the moving coordinates in a slice: angles, then rates, (k, m)."""
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
        """Return the error of the arithmetic within each interval, (n - 1,) rad.

        In every step it is of the size of its largest number, independent from step to step. A step
        is taken to span about a radian of the fastest coordinate.
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
        """Return the errors of the moving angles, (n, m / 2), and the largest sum of defects.

        The errors are those that the defects add up to; the sums are over `DRIFT_ROWS` rows. Both
        are in rad.
        """
        half = len(self.moving)
        resting = [i for i, coordinate in enumerate(self.moving) if coordinate in self.resting]
        at_zero = [*resting, *(half + i for i in resting)]
        angles, drift = np.empty((len(self.time), half)), 0.0
        error = self.states[0] - self.start  # at the current row, of all variables
        angles[0] = error[:half]
        for block in row_blocks(len(self.angles)):
            matrices, offsets = self._transitions_in(block).copy(), -self._vectors(block)
            # The error of a pitch that should be zero is known: it is the state itself.
            matrices[:, at_zero] = 0.0
            offsets[:, at_zero] = self.states[1:][block][:, at_zero]
            row = block.start
            with np.errstate(all="ignore"):
                products, sums = _carried(matrices, offsets, DRIFT_ROWS)
                drift = max(drift, float((np.abs(sums) / self._units).max(initial=0.0)))
                # The sums within the stretches are known: only their starts follow each other.
                for product, own in zip(products, sums, strict=True):
                    last = min(row + DRIFT_ROWS, block.stop)
                    errors = product[1:] @ error + own[1:]
                    angles[row + 1 : last + 1] = errors[: last - row, :half]
                    error = errors[last - row - 1]
                    row = last
        return angles, drift


def row_blocks(count: int) -> Iterator[slice]:
    """Yield slices of at most `BLOCK_ROWS` of `count` rows.

    Each is a multiple of `DRIFT_ROWS`, except the last.
    """
    for start in range(0, count, BLOCK_ROWS):
        yield slice(start, min(start + BLOCK_ROWS, count))


def _two_norms(matrices: Array) -> Array:
    """Return the 2-norm of each of (k, m, m) matrices, (k,); inf where one is not finite."""
    norms = np.full(len(matrices), np.inf)
    finite = np.isfinite(matrices).all(axis=(1, 2))
    norms[finite] = np.linalg.norm(matrices[finite], ord=2, axis=(1, 2))
    return norms


def _largest_entry(matrices: Array, units: Array) -> Array:
    """Return the largest entry of each of (k, m, m) matrices in these units, (k,).

    It is infinite for NaN. The growth of an error is at least this entry, and at most m times as
    large.
    """
    entries = np.abs(matrices * units / units[:, None]).max(axis=(1, 2))
    return np.asarray(np.where(np.isnan(entries), np.inf, entries))


def _with_small_numbers(floors: Array) -> Array:
    """Return (k, m) floors with the second-order effect of roundings of other coordinates.

    A coordinate that is next to zero has nearly no rounding of its own. The result is at least
    1e-18 rad; NaN becomes infinite.
    """
    floors = floors + np.square(floors.max(axis=1, keepdims=True, initial=0.0)) + _SMALLEST_FLOOR
    return np.asarray(np.where(np.isnan(floors), np.inf, floors))


def _carried(matrices: Array, offsets: Array, rows: int) -> tuple[Array, Array]:
    """Propagate errors e -> matrix @ e + offset in stretches of rows, all stretches at once.

    Parameters
    ----------
    matrices, offsets : (k, m, m) and (k, m) of every interval.
    rows : number of intervals in a stretch.

    Returns
    -------
    products, errors : (stretches, 1 + rows, m, m) and (stretches, 1 + rows, m)
        The product of the matrices since the start of the stretch, and the sum of the offsets since
        then, each propagated. The last stretch is filled with rows that change nothing.
    """
    k, m = offsets.shape
    stretches = max(-(-k // rows), 1)
    steps = np.broadcast_to(np.eye(m), (stretches * rows, m, m)).copy()
    added = np.zeros((stretches * rows, m))
    steps[:k], added[:k] = matrices, offsets
    steps, added = steps.reshape(stretches, rows, m, m), added.reshape(stretches, rows, m)
    products, errors = np.empty((stretches, 1 + rows, m, m)), np.zeros((stretches, 1 + rows, m))
    products[:, 0] = np.eye(m)
    # The loop is over the rows of a stretch, not over all intervals: each step does all stretches.
    for row in range(rows):
        products[:, row + 1] = steps[:, row] @ products[:, row]
        errors[:, row + 1] = np.einsum("kij,kj->ki", steps[:, row], errors[:, row]) + added[:, row]
    return products, errors
