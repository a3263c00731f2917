"""Numbers of a sweep for its picture: how fast nearby starts part (Lyapunov exponent), and a map of stability."""

from __future__ import annotations

import json
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from rotor_mbs.errors import InputError
from rotor_mbs.runs.sweeps import StoredSweep, parameter_name
from rotor_mbs.solution.trajectory import Array

# A pitch that has grown tenfold is leaving: what stays bounded in a stable rotor only swings, by its amplitude.
GROWN = 10.0

_PAIRS_AT_ONCE = 256
_BLOCKS = 8
# The growth is exponential after the first tenfold, in which the separation turns to the fastest direction, and while
# a separation is small against a radian.
_TURNED, _SMALL = 10.0, 0.1


@dataclass(frozen=True)
class Spread:
    """Separations (rad) of runs 2i and 2i + 1: root of the summed squares of the angles' differences, over time (s).

    low, median, high: tenth, fiftieth and ninetieth percentile over the pairs; growth: geometric mean. exponent and
    uncertainty: 1/s, slope of log(growth) between `start` and `end` (s), and its standard error.
    """

    time: Array
    low: Array
    median: Array
    high: Array
    growth: Array
    exponent: float
    uncertainty: float
    start: float
    end: float
    pairs: int


def spread_of(sweep: StoredSweep) -> Spread:
    """From the runs that ended well. Raises StoreError without angles, InputError where nothing grows."""
    time, stored = sweep.column("time"), sweep.column("angles")
    well = sweep.column("status") == 0
    parts = []
    for first in range(0, len(stored), 2 * _PAIRS_AT_ONCE):
        angles = stored[first : first + 2 * _PAIRS_AT_ONCE]
        pairs = len(angles) // 2
        both = well[first : first + 2 * pairs].reshape(pairs, 2).all(axis=1)
        difference = angles[1 : 2 * pairs : 2].astype(float) - angles[0 : 2 * pairs : 2]
        parts.append(np.sqrt((difference[both] ** 2).sum(axis=2)))
    if not sum(map(len, parts)):
        raise InputError("spread: no pair of runs ended well; allowed: a sweep with two or more such runs")
    separations = np.concatenate(parts)
    low, median, high = np.percentile(separations, [10.0, 50.0, 90.0], axis=0)
    growth = np.exp(np.log(np.maximum(separations, np.finfo(float).tiny)).mean(axis=0))
    exponent, uncertainty, start, end = lyapunov_exponent(time, growth)
    return Spread(time, low, median, high, growth, exponent, uncertainty, start, end, len(separations))


def lyapunov_exponent(time: Array, growth: Array) -> tuple[float, float, float, float]:
    """Exponent and standard error in 1/s, start and end of the window in s. Raises InputError where nothing grows.

    The mean rate over the window, as the mean over equal blocks of it; the blocks' scatter gives the standard error.
    A finite-time exponent, of the stretch of motion that was run. Source: Wolf et al., Physica D 16, 1985, 285-317.
    """
    turned = np.flatnonzero(growth >= _TURNED * growth[0])
    grown = np.flatnonzero(growth >= _SMALL)
    first = int(turned[0]) if len(turned) else len(growth)
    last = int(grown[0]) if len(grown) else len(growth) - 1
    if last - first < 2 * _BLOCKS:
        raise InputError(
            f"spread: the growth from {growth[0]:.1e} rad has {max(last - first, 0)} samples of exponential growth; "
            f"allowed: at least {2 * _BLOCKS}, from {_TURNED:g} times the start to {_SMALL:g} rad"
        )
    ends = np.linspace(first, last, _BLOCKS + 1).round().astype(int)
    rates = np.diff(np.log(growth[ends])) / np.diff(time[ends])
    lengths = np.diff(time[ends])
    mean = float(np.average(rates, weights=lengths))
    return mean, float(rates.std(ddof=1) / np.sqrt(_BLOCKS)), float(time[first]), float(time[last])


@dataclass(frozen=True)
class StabilityMap:
    """x, y: (columns,), (rows,) values of the second and the first axis; growth: (rows, columns) the largest pitch of
    the run, of the largest at its start; NaN where the run left nothing."""

    x: Array
    y: Array
    growth: Array

    @property
    def unstable(self) -> NDArray[np.bool_]:
        return np.asarray(self.growth >= GROWN)


def stability_map(sweep: StoredSweep, start: float) -> StabilityMap:
    """start: the largest pitch at the start, rad. Raises InputError where the sweep is no grid of two axes."""
    shape = json.loads(sweep.attributes["shape"])  # values along every axis of the grid, slowest first
    if len(shape) != 2 or len(sweep.keys) != 2:
        raise InputError(f"map: {len(sweep.keys)} axes; allowed: a grid of two axes, by one method")
    if not start > 0.0:
        raise InputError("map: every pitch starts at zero and nothing could grow; allowed: a small pitch at the start")
    rows, columns = shape
    y, x = (sweep.column(parameter_name(key))[: rows * columns].reshape(rows, columns) for key in sweep.keys)
    largest = sweep.column("pitch_max")[: rows * columns].reshape(rows, columns)
    return StabilityMap(x[0], y[:, 0], largest / start)
