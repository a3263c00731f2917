"""Interval defects of a run: the closed form integrated from each sample to the next, minus the run's next sample.

Within one interval between samples no chaos can grow, so that defects need no horizon: every second of every run is
judged, and a fault is located in time. Their signed sum, carried to the end by the transition matrices of the
intervals, predicts the error of the whole run without a reference. `models.lagrange.defects` computes them.
"""

from __future__ import annotations

import functools
import itertools
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from rotor_mbs.solution.trajectory import Array, Trajectory

# An interval over which an error may grow this many times says little of the numbers at its start: it is not judged.
MAX_INTERVAL_GROWTH = 1e5
# What the rounding of a run's own numbers makes of a defect, as it is estimated, may be this many times larger.
FLOOR_SAFETY = 3.0
# Bounds on defects are for intervals as the paper's scenes have: 0.01 s, in which an error grows fivefold at most.
_BOUND_INTERVAL, _BOUND_GROWTH = 0.01, 5.0
# rad: a pitch that should stay zero has left it when it is past this: ten million times above round-off of a radian,
# far below what a plot shows.
LEFT_ZERO = 1e-9
# Of a pitch that has left zero: a larger defect in an interval is not of a step or of rounding.
_MOVED_SHARE = 1e-4
# Rows over which defects are added up, to show a drift that every one of them hides.
DRIFT_ROWS = 100


@dataclass(frozen=True)
class Defects:
    """Interval defects of a run with n samples. Coordinates: rotor, then the pitch of each blade.

    Attributes
    ----------
    time : (n,) s, sample times.
    angles, rates : (n - 1, 1 + blades) rad and rad/s, closed form minus run; NaN if its integration fails.
    rate_units : (1 + blades,) rad/s, scale of the rates: a rate defect times the interval is an angle.
    find_transitions : function that computes `transitions`.
    moving : coordinates with inertia.
    resting : pitches that stay at zero by symmetry, where the error is the state itself.
    own_loads : loads of the closed form at the states of the run; without arrays if not requested.
    growth_rate : 1/s, estimated largest growth rate of an error (gravity and centrifugal forces).
    growth_units : (m,) scales of the error growth of the scene: angles, then rates.
    states : (n, m) angles, then rates, of the moving coordinates of the run.
    rounding, time_rounding : (n, m), (n,) half a unit in the last place of each of these numbers, and of the times.
    start : (m,) initial state of the scene in these coordinates.
    """

    time: Array
    angles: Array
    rates: Array
    rate_units: Array
    find_transitions: Callable[[], Array | None]
    moving: tuple[int, ...]
    resting: tuple[int, ...]
    states: Array
    rounding: Array
    time_rounding: Array
    start: Array
    growth_rate: float
    growth_units: Array
    own_loads: Trajectory

    @functools.cached_property
    def transitions(self) -> Array | None:
        """State transition matrices of the moving coordinates, (n - 1, m, m): angles, then rates; None if unknown."""
        return self.find_transitions()

    @functools.cached_property
    def sizes(self) -> Array:
        """Largest defect over the coordinates, of angles and of rates in `rate_units`: (n - 1,) rad; inf for NaN."""
        both = np.hstack([np.abs(self.angles), np.abs(self.rates) / self.rate_units])
        return np.asarray(np.where(np.isfinite(both), both, np.inf).max(axis=1))

    @property
    def floor(self) -> Array:
        """Largest of `floors` over the coordinates: (n - 1,) rad."""
        return np.asarray(self.floors.max(axis=1))

    @functools.cached_property
    def floors(self) -> Array:
        """Largest defects that rounding of the samples can cause, per coordinate: (n - 1, m) rad."""
        units = self._units
        half = self.states.shape[1] // 2
        # The sample times are rounded, too: by as much the state goes on.
        late = (self.time_rounding[1:] + self.time_rounding[:-1])[:, None]
        slip = late * np.abs(self.states[1:, half:])
        carried = self.rounding[:-1]
        if self.transitions is not None:
            known = np.where(np.isfinite(self.transitions), np.abs(self.transitions), 0.0)
            carried = np.einsum("kij,kj->ki", known, self.rounding[:-1])
        total = carried + self.rounding[1:]
        total[:, :half] += slip
        # and the rates by their change
        change = np.abs(np.diff(self.states[:, half:], axis=0)) / np.diff(self.time)[:, None]
        total[:, half:] += late * change
        return np.asarray(total / units)

    @property
    def channel_sizes(self) -> Array:
        """Magnitudes of the defects of the moving coordinates: (n - 1, m) rad, angles, then rates; inf for NaN."""
        sizes = np.abs(self._vectors) / self._units
        return np.asarray(np.where(np.isfinite(sizes), sizes, np.inf))

    @functools.cached_property
    def growth(self) -> Array:
        """Error growth over each interval, (n - 1,); estimated from `growth_rate` if the transition matrices are
        unknown."""
        if self.transitions is None:
            with np.errstate(over="ignore"):
                return np.asarray(np.exp(self.growth_rate * np.diff(self.time)))
        units = self._units
        scaled = self.transitions * units / units[:, None]
        # Between the largest entry and m times it: what is asked is whether it is huge.
        return np.asarray(np.abs(scaled).max(axis=(1, 2)))

    @property
    def is_judged(self) -> NDArray[np.bool_]:
        """Whether each interval is assessed, (n - 1,): its error growth is at most `MAX_INTERVAL_GROWTH`, or its defect
        is not finite although its transition matrix is known."""
        judged = ~(self.growth > MAX_INTERVAL_GROWTH)
        if self.transitions is not None:
            judged |= ~np.isfinite(self.sizes)
        return np.asarray(judged)

    @functools.cached_property
    def judged_size(self) -> float:
        """Value that is compared with a method's bound (rad): the largest defect beyond rounding. For intervals over
        0.01 s it is scaled to 0.01 s and to a fivefold error growth. 0 if no interval is assessed."""
        longer = np.maximum(np.diff(self.time) / _BOUND_INTERVAL, 1.0) * np.fmax(self.growth / _BOUND_GROWTH, 1.0)
        judged = self.is_judged
        sizes = self.sizes[judged]
        with np.errstate(invalid="ignore"):
            beyond = np.maximum(sizes - FLOOR_SAFETY * self.floor[judged].max(initial=0.0), 0.0) / longer[judged]
        # Of a runaway whose floor overflows, too, nothing is within a bound.
        return float(np.where(np.isfinite(sizes) & ~np.isnan(beyond), beyond, np.inf).max(initial=0.0))

    @functools.cached_property
    def predicted(self) -> Array | None:
        """Error of the angles predicted from the initial state and the defects, (n, 1 + blades) rad; None if the
        transition matrices are unknown. Valid for errors that are small compared with 1 rad."""
        if self._errors_over_rows is None:
            return None
        products, sums = self._errors_over_rows
        rows = [self.states[0] - self.start]
        with np.errstate(all="ignore"):
            for product, own in zip(products, sums, strict=True):
                rows.extend(product[1:] @ rows[-1] + own[1:])
        errors = np.array(rows[: len(self.time)])
        half = len(self.moving)
        angles = np.zeros((len(self.time), self.angles.shape[1]))
        angles[:, list(self.moving)] = errors[:, :half]
        return angles

    @functools.cached_property
    def error_growth(self) -> Array | None:
        """Error growth along the run, (n,): 2-norm of the state transition matrix from the start in the moving
        coordinates."""
        if self.transitions is None:
            return None
        half = len(self.moving)
        free = [i for i, coordinate in enumerate(self.moving) if coordinate not in self.resting]
        rows = np.array([*free, *(half + i for i in free)])
        units = self.growth_units[rows]
        scaled = self.transitions[:, rows[:, None], rows] * units / units[:, None]
        with np.errstate(all="ignore"):
            products, _ = _carried(scaled, np.zeros((len(scaled), len(rows))), DRIFT_ROWS)
            for before, block in itertools.pairwise(products):
                block[:] = block @ before[-1]
        stack = np.concatenate([products[:1, 0], products[:, 1:].reshape(-1, len(rows), len(rows))])[: len(self.time)]
        growth = np.full(len(stack), np.inf)
        finite = np.isfinite(stack).all(axis=(1, 2))
        growth[finite] = np.linalg.norm(stack[finite], ord=2, axis=(1, 2))
        return growth

    @property
    def mean(self) -> float:
        """Largest signed mean of the defects over the assessed intervals (rad)."""
        judged = self.is_judged & np.isfinite(self.sizes)
        if not judged.any():
            return float("nan")
        both = np.hstack([self.angles, self.rates / self.rate_units])[judged]
        return float(np.abs(both.mean(axis=0)).max())

    @property
    def drift(self) -> float:
        """Largest sum of defects over `DRIFT_ROWS` rows, each propagated to their end (rad); NaN if unknown."""
        if self._errors_over_rows is None:
            return float("nan")
        return float((np.abs(self._errors_over_rows[1]) / self._units).max(initial=0.0))

    @property
    def _units(self) -> Array:
        columns = list(self.moving)
        return np.concatenate([np.ones(len(columns)), self.rate_units[columns]])

    def over_rows(self, rows: int) -> tuple[Array, Array]:
        """Return sums of the defects over a number of rows, and the largest sums that rounding can cause: (k, m) rad.

        They reveal a drift that is smaller than single defects. Sums over rows in which errors may grow by more than
        `MAX_INTERVAL_GROWTH` are omitted; without transition matrices there are none.
        """
        empty = np.empty((0, len(self.start)))
        if self.transitions is None or len(self.time) <= rows:
            return empty, empty
        count = len(self.transitions) // rows * rows
        units = self._units
        with np.errstate(all="ignore"):
            products, errors = _carried(self.transitions[:count], -self._vectors[:count], rows)
            product, error = np.abs(products[:, -1]), np.abs(errors[:, -1])
            kept = (product * units / units[:, None]).max(axis=(1, 2)) <= MAX_INTERVAL_GROWTH
            floors = (
                np.einsum("kij,kj->ki", product, self.rounding[:count:rows]) + self.rounding[rows : count + 1 : rows]
            )
        return error[kept] / units, floors[kept] / units

    def horizon_samples(self, limit: float) -> int:
        """Return the number of samples before the error growth along the run reaches `limit`."""
        growth = self.error_growth
        if growth is None:
            return len(self.time)
        beyond = np.flatnonzero(~(growth < limit))
        return int(beyond[0]) if len(beyond) else len(growth)

    def samples_at_rest(self, limit: float) -> int:
        """Return the number of samples before pitches that are zero by symmetry exceed `limit` times the threshold at
        which they count as nonzero; all samples if they stay zero, or if wrong equations move them.

        The error growth is that of motions that preserve the symmetry; a deviation from it by rounding grows faster.
        Wrong equations are distinguished by defects proportional to the pitch.
        """
        places = [i for i, coordinate in enumerate(self.moving) if coordinate in self.resting]
        away = np.abs(self.states[:, places]).max(axis=1, initial=0.0)
        beyond = np.flatnonzero(away > LEFT_ZERO * limit)
        if not len(beyond):
            return len(self.time)
        first, resting = int(beyond[0]), list(self.resting)
        moved = np.abs(self.rates[:first, resting] / self.rate_units[resting]).max(axis=1, initial=0.0)
        by_rounding = (moved <= LEFT_ZERO + _MOVED_SHARE * away[1 : first + 1]).all()
        return first if by_rounding else len(self.time)

    @property
    def _vectors(self) -> Array:
        """(n - 1, m) defects of the angles, then rates, of the coordinates that move."""
        columns = list(self.moving)
        return np.hstack([self.angles[:, columns], self.rates[:, columns]])

    @functools.cached_property
    def _errors_over_rows(self) -> tuple[Array, Array] | None:
        """`_carried` over `DRIFT_ROWS` rows; None where the transition matrices are not known."""
        if self.transitions is None:
            return None
        matrices, offsets = self.transitions.copy(), -self._vectors
        half = len(self.moving)
        resting = [i for i, coordinate in enumerate(self.moving) if coordinate in self.resting]
        for place in (*resting, *(half + i for i in resting)):
            matrices[:, place], offsets[:, place] = 0.0, self.states[1:, place]
        with np.errstate(all="ignore"):
            return _carried(matrices, offsets, DRIFT_ROWS)


def _carried(matrices: Array, offsets: Array, rows: int) -> tuple[Array, Array]:
    """Errors e that go on as matrix @ e + offset, in stretches of so many rows, all stretches at once.

    Parameters
    ----------
    matrices, offsets : (k, m, m) and (k, m) of every interval.

    Returns
    -------
    products, errors : (stretches, 1 + rows, m, m) and (stretches, 1 + rows, m)
        The product of the matrices since the start of the stretch, and what the offsets since then add up to. The last
        stretch is filled with rows that change nothing.
    """
    k, m = offsets.shape
    stretches = max(-(-k // rows), 1)
    steps = np.broadcast_to(np.eye(m), (stretches * rows, m, m)).copy()
    added = np.zeros((stretches * rows, m))
    steps[:k], added[:k] = matrices, offsets
    steps, added = steps.reshape(stretches, rows, m, m), added.reshape(stretches, rows, m)
    products, errors = np.empty((stretches, 1 + rows, m, m)), np.zeros((stretches, 1 + rows, m))
    products[:, 0] = np.eye(m)
    for row in range(rows):
        products[:, row + 1] = steps[:, row] @ products[:, row]
        errors[:, row + 1] = np.einsum("kij,kj->ki", steps[:, row], errors[:, row]) + added[:, row]
    return products, errors
