"""Interval defects of a run: what the closed form makes of each sample by the next one, less what the run has there.

Within one interval between samples no chaos can grow, so that defects need no horizon: every second of every run is
judged, and a fault is located in time. Their signed sum, carried to the end by the transition matrices of the
intervals, predicts the error of the whole run without a reference. `models.lagrange.defects` computes them.
"""

from __future__ import annotations

import functools
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from rotor_mbs.solution.trajectory import Array, Trajectory

# An interval over which an error may grow this many times says little of the numbers at its start: it is not judged.
MAX_INTERVAL_GROWTH = 1e5
# Rows over which defects are added up, to show a drift that every one of them hides.
DRIFT_ROWS = 100


@dataclass(frozen=True)
class Defects:
    """Of the n - 1 intervals between n samples; coordinates: rotor, then the pitch of each blade.

    Attributes
    ----------
    time : (n,) s, of the samples.
    angles, rates : (n - 1, 1 + blades) rad and rad/s, closed form less run; NaN where the closed form has no end.
    rate_units : (1 + blades,) rad/s, what counts as 1 rad: the defect of a rate times the interval is an angle.
    find_transitions : computes `transitions`.
    moving : the coordinates that move.
    resting : pitches that stay at zero by symmetry: there the error is the state itself.
    own_loads : the loads of the closed form at the run's own states, as samples; without arrays where not asked for.
    growth_rate : 1/s, in which an error grows e-fold at most, roughly: falling blades, and centrifugal forces.
    growth_units : (m,) in which the error growth of the scene counts angles, then rates.
    states : (n, m) angles, then rates, of the run, in the coordinates that move.
    rounding, time_rounding : (n, m), (n,) half a unit in the last place of each of these numbers, and of the times.
    start : (m,) the scene's own start in these coordinates.
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
        """(n - 1, m, m) of the angles, then rates, of the coordinates that move; None where they are not known."""
        return self.find_transitions()

    @functools.cached_property
    def sizes(self) -> Array:
        """(n - 1,) rad: the largest over the coordinates, of angles and of rates in `rate_units`; inf for NaN."""
        both = np.hstack([np.abs(self.angles), np.abs(self.rates) / self.rate_units])
        return np.asarray(np.where(np.isfinite(both), both, np.inf).max(axis=1))

    @property
    def floor(self) -> Array:
        """(n - 1,) rad: the largest of `floors` over the coordinates."""
        return np.asarray(self.floors.max(axis=1))

    @functools.cached_property
    def floors(self) -> Array:
        """(n - 1, m) rad: what the rounding of the run's own numbers may add up to in an interval, of each number."""
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
        """(n - 1, m) rad: of the angles, then rates, of the coordinates that move; inf where there is no end."""
        columns = list(self.moving)
        both = np.abs(np.hstack([self.angles[:, columns], self.rates[:, columns]])) / self._units
        return np.asarray(np.where(np.isfinite(both), both, np.inf))

    @functools.cached_property
    def growth(self) -> Array:
        """(n - 1,) how many times an error may grow over each interval, at most; by `growth_rate` where the transition
        matrices are not known."""
        if self.transitions is None:
            with np.errstate(over="ignore"):
                return np.asarray(np.exp(self.growth_rate * np.diff(self.time)))
        units = self._units
        scaled = self.transitions * units / units[:, None]
        # Between the largest entry and m times it: what is asked is whether it is huge.
        return np.asarray(np.abs(scaled).max(axis=(1, 2)))

    @property
    def is_judged(self) -> NDArray[np.bool_]:
        """(n - 1,) not where an error grows by more than `MAX_INTERVAL_GROWTH` within the interval; what is not finite
        fails there, too, unless the interval is too long even for the transition matrix."""
        judged = ~(self.growth > MAX_INTERVAL_GROWTH)
        if self.transitions is not None:
            judged |= ~np.isfinite(self.sizes)
        return np.asarray(judged)

    @functools.cached_property
    def predicted(self) -> Array | None:
        """(n, 1 + blades) rad: the error of the angles that the start and the defects add up to; None where the
        transition matrices are not known. Good while the error is small against a radian."""
        errors = self._accumulated(len(self.time))
        if errors is None:
            return None
        half = len(self.moving)
        angles = np.zeros((len(self.time), self.angles.shape[1]))
        angles[:, list(self.moving)] = errors[:, :half]
        return angles

    @functools.cached_property
    def error_growth(self) -> Array | None:
        """(n,) how many times a small error of the start may have grown, along the run itself; 2-norms in the
        coordinates that can move."""
        if self.transitions is None:
            return None
        half = len(self.moving)
        free = [i for i, coordinate in enumerate(self.moving) if coordinate not in self.resting]
        rows = np.array([*free, *(half + i for i in free)])
        units = self.growth_units[rows]
        product, matrices = np.eye(len(rows)), [np.eye(len(rows))]
        with np.errstate(all="ignore"):
            for matrix in self.transitions[:, rows[:, None], rows] * units / units[:, None]:
                product = matrix @ product
                matrices.append(product)
        stack = np.array(matrices)
        growth = np.full(len(stack), np.inf)
        finite = np.isfinite(stack).all(axis=(1, 2))
        growth[finite] = np.linalg.norm(stack[finite], ord=2, axis=(1, 2))
        return growth

    @property
    def mean(self) -> float:
        """rad: the largest signed mean over the judged intervals: what defects of one sign hide below the largest."""
        judged = self.is_judged & np.isfinite(self.sizes)
        if not judged.any():
            return float("nan")
        both = np.hstack([self.angles, self.rates / self.rate_units])[judged]
        return float(np.abs(both.mean(axis=0)).max())

    @property
    def drift(self) -> float:
        """rad: the largest sum of defects over `DRIFT_ROWS` rows, each carried to their end; NaN where not known."""
        errors = self._accumulated(DRIFT_ROWS)
        if errors is None:
            return float("nan")
        return float((np.abs(errors[1:]) / self._units).max(initial=0.0))

    @property
    def _units(self) -> Array:
        columns = list(self.moving)
        return np.concatenate([np.ones(len(columns)), self.rate_units[columns]])

    def over_rows(self, rows: int) -> tuple[Array, Array]:
        """Defects over longer stretches, of so many rows each, and what rounding may make of them; both (k, m) rad.

        A drift of one sign hides in every interval and shows over a hundred. Stretches over which an error may grow by
        more than `MAX_INTERVAL_GROWTH` are left out; without transition matrices there is none.
        """
        empty = np.empty((0, len(self.start)))
        if self.transitions is None or len(self.time) <= rows:
            return empty, empty
        half = len(self.moving)
        columns = list(self.moving)
        defects = np.hstack([self.angles[:, columns], self.rates[:, columns]])
        units, sizes, floors = self._units, [], []
        with np.errstate(all="ignore"):
            for first in range(0, len(self.transitions) - rows + 1, rows):
                error, product = np.zeros(2 * half), np.eye(2 * half)
                for k in range(first, first + rows):
                    error = self.transitions[k] @ error - defects[k]
                    product = self.transitions[k] @ product
                scaled = np.abs(product) * units / units[:, None]
                if not scaled.max() <= MAX_INTERVAL_GROWTH:
                    continue
                sizes.append(np.abs(error) / units)
                floors.append((np.abs(product) @ self.rounding[first] + self.rounding[first + rows]) / units)
        return (np.array(sizes), np.array(floors)) if sizes else (empty, empty)

    def horizon_samples(self, limit: float) -> int:
        """How many samples lie before the error growth along the run reaches `limit`."""
        growth = self.error_growth
        if growth is None:
            return len(self.time)
        beyond = np.flatnonzero(~(growth < limit))
        return int(beyond[0]) if len(beyond) else len(growth)

    def _accumulated(self, rows: int) -> Array | None:
        """(n, m) errors of the state, from zero again after so many rows; over all rows from the start's own error."""
        if self.transitions is None:
            return None
        half = len(self.moving)
        columns = list(self.moving)
        defects = np.hstack([self.angles[:, columns], self.rates[:, columns]])
        places = [i for i, coordinate in enumerate(self.moving) if coordinate in self.resting]
        places += [half + i for i in places]
        error = self.states[0] - self.start if rows >= len(self.time) else np.zeros(len(self.start))
        errors = [error]
        with np.errstate(all="ignore"):
            for k, matrix in enumerate(self.transitions):
                if rows < len(self.time) and k % rows == 0:
                    error = np.zeros(len(self.start))
                error = matrix @ error - defects[k]
                error[places] = self.states[k + 1, places]
                errors.append(error)
        return np.array(errors)
