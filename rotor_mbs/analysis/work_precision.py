"""Compute the numbers of a work-precision diagram: Pareto front, time to an accuracy, orders."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping, Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from rotor_mbs.runs.read import Record
from rotor_mbs.solution.status import COMPLETE, code_of
from rotor_mbs.solution.trajectory import Array

TARGETS_RAD = (1e-3, 1e-6, 1e-9)  # errors for which the run time is given

ANGLE_ERROR = "angle_error_max"  # name of the column with the angle error up to the horizon, rad

# An error of this size is as large as the motion itself. A run with such an error is a failure, not
# a point on the curve.
USELESS_RAD = 1.0

# Smaller errors are raised to this value, because zero has no logarithm. The value is far below the
# rounding error of a double of order one.
SMALLEST_ERROR = 1e-17
# A curve approaches its round-off floor gradually. Errors within this factor of the floor do not
# show the order of the method.
_ABOVE_FLOOR = 20.0
# A step with a larger error is too coarse to show the order of the method.
_ASYMPTOTIC_RAD = 0.05
# Largest number of points to which an order is fitted: the finest ones above the floor.
_FITTED = 4


class Reach(NamedTuple):
    """Hold the run time that a curve needs to reach an error.

    Attributes
    ----------
    seconds : run time, s.
    ratio : run time divided by that of the fastest curve.
    """

    seconds: float
    ratio: float


def succeeded(curve: Record, error: str = ANGLE_ERROR) -> NDArray[np.bool_]:
    """Return whether each point is on the curve, (settings,).

    A point is on the curve if its run reached the end of the scene, if the error and the run time
    are finite, and if the angle error is below USELESS_RAD. The status of a coarse point may be
    "inaccurate".

    Parameters
    ----------
    curve : record of a bench.
    error : name of the column of errors.
    """
    is_complete = np.isin(curve.arrays["status"], [code_of(status) for status in COMPLETE])
    is_known = np.isfinite(curve.arrays[error]) & np.isfinite(curve.arrays["run_time_s"])
    return np.asarray(is_complete & is_known & (curve.arrays[ANGLE_ERROR] < USELESS_RAD))


def failed(curve: Record) -> NDArray[np.bool_]:
    """Return whether each point is a failure, (settings,).

    A failure was run, that is, not left out by the time budget, and is not on the curve.
    """
    return np.asarray(~succeeded(curve) & (curve.arrays["status"] != code_of("left_out")))


def left_out(curve: Record) -> int:
    """Return the number of settings of a ladder that the time budget of the bench left out.

    These settings are the finest ones. They might reach an error that the curve does not reach.
    """
    return curve.statuses.count("left_out")


def points(curve: Record, error: str = ANGLE_ERROR) -> tuple[Array, Array]:
    """Return the errors (rad) and times (s) of the points on the curve.

    Parameters
    ----------
    curve : record of a bench.
    error : name of the column of errors. Errors below SMALLEST_ERROR are raised to it.
    """
    chosen = succeeded(curve, error)
    return np.maximum(curve.arrays[error][chosen], SMALLEST_ERROR), curve.arrays["run_time_s"][
        chosen
    ]


def pareto(errors: Array, seconds: Array) -> NDArray[np.intp]:
    """Return the indices of the points on the Pareto front of error and run time.

    No other point has both a smaller error and a shorter time. The points are sorted by increasing
    time, and their errors strictly decrease.

    Parameters
    ----------
    errors, seconds : (points,) rad and s.
    """
    front: list[int] = []
    for i in np.lexsort((errors, seconds)):
        if not front or errors[i] < errors[front[-1]]:
            front.append(int(i))
    return np.array(front, dtype=np.intp)


def time_to_reach(errors: Array, seconds: Array, target: float) -> float | None:
    """Return the run time (s) that is needed for an error; None if no point is as accurate.

    The time is interpolated on the Pareto front, linearly in the logarithms. If the fastest point
    is already more accurate than requested, its time is returned.

    Parameters
    ----------
    errors, seconds : (points,) rad and s.
    target : the error, rad.
    """
    front = pareto(errors, seconds)
    if not len(front) or errors[front[-1]] > target:
        return None
    # Errors fall along the front; np.interp needs increasing abscissas, hence the minus signs.
    e, t = np.log(errors[front]), np.log(seconds[front])
    return float(np.exp(np.interp(-math.log(target), -e, t)))


def fastest(curves: Sequence[Record], target: float) -> list[tuple[Record, Reach]]:
    """Return the curves that reach an error, the fastest first.

    Parameters
    ----------
    curves : records of a bench.
    target : the error, rad.
    """
    times = [(curve, time_to_reach(*points(curve), target)) for curve in curves]
    able = sorted(
        ((curve, time) for curve, time in times if time is not None), key=lambda pair: pair[1]
    )
    return [(curve, Reach(time, time / able[0][1])) for curve, time in able]


def fitted_order(steps: Array, errors: Array) -> float | None:
    """Return the order of a method: the slope of the log of the error over the log of the step.

    The slope is fitted to the finest points above the round-off floor. None is returned if there
    are fewer than two such points.

    Parameters
    ----------
    steps : (points,) s, coarse to fine.
    errors : (points,) rad, > 0.
    """
    usable = errors < _ASYMPTOTIC_RAD
    h, e = steps[usable], errors[usable]
    if len(e) < 2:
        return None
    # Errors stop decreasing at a round-off floor. The curve has reached its floor if the smallest
    # error is not the last one, or if the last slope is clearly below the median. Then points near
    # the floor are left out.
    slopes = np.diff(np.log(e)) / np.diff(np.log(h))
    if int(np.argmin(e)) < len(e) - 1 or bool(slopes[-1] < 0.75 * np.median(slopes)):
        above = e > _ABOVE_FLOOR * e.min()
        h, e = h[above], e[above]
    h, e = h[-_FITTED:], e[-_FITTED:]
    return float(np.polyfit(np.log(h), np.log(e), 1)[0]) if len(e) >= 2 else None


def step_for(target: float, steps: Array, errors: Array) -> float | None:
    """Return the step (s) up to which the error is at most `target`; None if there is no such step.

    The step is interpolated linearly in the logarithms. The coarsest step is returned if all errors
    are at most `target`.

    Parameters
    ----------
    target : the error, rad.
    steps : (points,) s, coarse to fine.
    errors : (points,) rad.
    """
    below = errors <= target
    if not below.any() or not below[-1]:
        return None
    # Index of the last step whose error is above the target; -1 if no error is above it.
    last = len(errors) - 1 - int(np.argmin(below[::-1])) if not below.all() else -1
    if last < 0 or not np.isfinite(errors[last]) or errors[last + 1] == 0.0:
        return float(steps[last + 1])
    slope = np.log(errors[last] / errors[last + 1]) / np.log(steps[last] / steps[last + 1])
    return float(steps[last + 1] * (target / errors[last + 1]) ** (1.0 / slope))


def values_of(curves: Iterable[Record], column: str) -> list[float]:
    """Return the finite values of a column at the points that are on given curves.

    Parameters
    ----------
    curves : records of a bench; records without the column are left out.
    column : name of the column.
    """
    values = [curve.arrays[column][succeeded(curve)] for curve in curves if column in curve.arrays]
    return [value for array in values for value in array.tolist() if math.isfinite(value)]


def by_scene(curves: Sequence[Record]) -> Mapping[str, list[Record]]:
    """Return the curves by name of the scene, in the given order."""
    names = dict.fromkeys(curve.scene for curve in curves)
    return {name: [curve for curve in curves if curve.scene == name] for name in names}
