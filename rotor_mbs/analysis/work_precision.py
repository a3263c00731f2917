"""Numbers of a work-precision diagram: Pareto front, time to an accuracy, orders."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping, Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from rotor_mbs.runs.read import Record
from rotor_mbs.solution.status import COMPLETE, code_of
from rotor_mbs.solution.trajectory import Array

TARGETS_RAD = (1e-3, 1e-6, 1e-9)

ANGLE_ERROR = "angle_error_max"  # up to the horizon, rad

# An error as large as the motion itself: such a run is a failure, not a point on the curve.
USELESS_RAD = 1.0

# Errors below this, far under the rounding of a double of order one, are drawn and interpolated as
# this value: zero has no logarithm.
SMALLEST_ERROR = 1e-17
# A curve turns into its round-off floor gradually: errors within this factor of the floor carry no
# order.
_ABOVE_FLOOR = 20.0
# Above this error a step is too coarse for its order to show.
_ASYMPTOTIC_RAD = 0.05
_FITTED = 4  # points, the finest ones above the floor


class Reach(NamedTuple):
    """Tell when a curve reaches an error.

    Attributes
    ----------
    seconds : s of run time.
    ratio : how many times the run time of the fastest curve.
    """

    seconds: float
    ratio: float


def succeeded(curve: Record, error: str = ANGLE_ERROR) -> NDArray[np.bool_]:
    """Return which points are on the curve, (settings,): run to the end, with a useful error.

    The error of the angles is below USELESS_RAD; a coarse point need not be ok.

    Parameters
    ----------
    curve : record of a bench.
    error : column of errors that must be finite.
    """
    is_complete = np.isin(curve.arrays["status"], [code_of(status) for status in COMPLETE])
    is_known = np.isfinite(curve.arrays[error]) & np.isfinite(curve.arrays["run_time_s"])
    return np.asarray(is_complete & is_known & (curve.arrays[ANGLE_ERROR] < USELESS_RAD))


def failed(curve: Record) -> NDArray[np.bool_]:
    """Return which points are failures, (settings,).

    They were run, and are neither on the curve nor left out by the budget.
    """
    return np.asarray(~succeeded(curve) & (curve.arrays["status"] != code_of("left_out")))


def left_out(curve: Record) -> int:
    """Return how many of the finest settings of its ladder the budget left out.

    An error that the curve does not reach might be reached by these.
    """
    return curve.statuses.count("left_out")


def points(curve: Record, error: str = ANGLE_ERROR) -> tuple[Array, Array]:
    """Return the errors (rad) and times (s) of the points on the curve.

    Parameters
    ----------
    curve : record of a bench.
    error : column of the errors; those below SMALLEST_ERROR are raised to it.
    """
    chosen = succeeded(curve, error)
    return np.maximum(curve.arrays[error][chosen], SMALLEST_ERROR), curve.arrays["run_time_s"][
        chosen
    ]


def pareto(errors: Array, seconds: Array) -> NDArray[np.intp]:
    """Return the indices of the points that no other beats in both error and time.

    They are sorted by rising time; errors fall strictly.

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
    """Return the run time (s) that an error needs; None where no point is as accurate.

    It is interpolated on the Pareto front, linearly in the logarithms. Where already the fastest
    point is more accurate than requested, it is the time of that point.

    Parameters
    ----------
    errors, seconds : (points,) rad and s.
    target : rad.
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
    target : rad.
    """
    times = [(curve, time_to_reach(*points(curve), target)) for curve in curves]
    able = sorted(
        ((curve, time) for curve, time in times if time is not None), key=lambda pair: pair[1]
    )
    return [(curve, Reach(time, time / able[0][1])) for curve, time in able]


def fitted_order(steps: Array, errors: Array) -> float | None:
    """Return the slope of log error over log step; None with fewer than two usable points.

    It is fitted to the finest points above the round-off floor.

    Parameters
    ----------
    steps : (points,) s, coarse to fine.
    errors : (points,) rad, > 0.
    """
    usable = errors < _ASYMPTOTIC_RAD
    h, e = steps[usable], errors[usable]
    if len(e) < 2:
        return None
    # Errors stop falling at a round-off floor: the smallest is not the last one, or the last slope
    # is clearly below the median. Points near the floor are then left out.
    slopes = np.diff(np.log(e)) / np.diff(np.log(h))
    if int(np.argmin(e)) < len(e) - 1 or bool(slopes[-1] < 0.75 * np.median(slopes)):
        above = e > _ABOVE_FLOOR * e.min()
        h, e = h[above], e[above]
    h, e = h[-_FITTED:], e[-_FITTED:]
    return float(np.polyfit(np.log(h), np.log(e), 1)[0]) if len(e) >= 2 else None


def step_for(target: float, steps: Array, errors: Array) -> float | None:
    """Return the step (s) below which the error stays below `target`; None where it does not.

    It is interpolated linearly in the logarithms.

    Parameters
    ----------
    target : rad.
    steps : (points,) s, coarse to fine.
    errors : (points,) rad.
    """
    below = errors <= target
    if not below.any() or not below[-1]:
        return None
    # The last step whose error is above the target; -1 where all are below.
    last = len(errors) - 1 - int(np.argmin(below[::-1])) if not below.all() else -1
    if last < 0 or not np.isfinite(errors[last]) or errors[last + 1] == 0.0:
        return float(steps[last + 1])
    slope = np.log(errors[last] / errors[last + 1]) / np.log(steps[last] / steps[last + 1])
    return float(steps[last + 1] * (target / errors[last + 1]) ** (1.0 / slope))


def values_of(curves: Iterable[Record], column: str) -> list[float]:
    """Return the finite values of a column over the points on some curves.

    Parameters
    ----------
    curves : records of a bench; those without the column are left out.
    column : name of the column.
    """
    values = [curve.arrays[column][succeeded(curve)] for curve in curves if column in curve.arrays]
    return [value for array in values for value in array.tolist() if math.isfinite(value)]


def by_scene(curves: Sequence[Record]) -> Mapping[str, list[Record]]:
    """Return the curves of each scene, in order."""
    names = dict.fromkeys(curve.scene for curve in curves)
    return {name: [curve for curve in curves if curve.scene == name] for name in names}
