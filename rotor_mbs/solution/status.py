"""Define the statuses of runs, which say how a run ended, and their integer codes in files.

For other programs, files have the meaning of each code in CF's attributes `flag_values` and
`flag_meanings`.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any, NamedTuple

# "unchecked": the run reached the end of the scene, but cannot be judged, or only in part.
# "completed": a run of the printed equations reached the end; its accuracy is not judged.
# "left_out": a bench or a ladder did not run this point.
# "worker_died": the process that computed the run died.
# The code of a status is its place in this list, so that new statuses are added at the end.
STATUSES = (
    "ok",
    "inaccurate",
    "diverged",
    "singular",
    "solver_failed",
    "timed_out",
    "left_out",
    "worker_died",
    "unchecked",
    "completed",
)
# Statuses of runs that reached the end of the scene.
COMPLETE = ("ok", "inaccurate", "unchecked", "completed")

# This text stands in place of a status where a method cannot represent the scene. Then there is no
# run, and nothing is stored.
REFUSED = "refused"

# Statuses that need no attention. An "ok" run is accurate; "completed" is the best status that a
# run of the printed equations can have.
GOOD = ("ok", "completed")


# Limit for a run that is ok, rad. It applies to the angle error up to the horizon, and to the
# defects beyond rounding.
OK_ERROR = 0.01


def code_of(status: str) -> int:
    """Return the code of a status in a file: its place in STATUSES."""
    return STATUSES.index(status)


class Comparison(NamedTuple):
    """Hold the numbers from which the status of a run follows, as texts for a table.

    A text is "" if the run does not have the number.

    Attributes
    ----------
    defect : rad, defect beyond rounding in the worst interval: the interval whose defect beyond
        rounding is the largest multiple, or share, of what is allowed. If no defect is beyond
        rounding, this is the largest defect.
    allowed : rad, largest defect beyond rounding that is allowed in the worst interval; "rounding"
        if no defect is beyond rounding.
    error : rad, largest angle error up to the horizon. Without a reference it is predicted from
        the defects, and "predicted" follows the number.
    compared : the horizon and the duration of the scene, such as "6.15 of 10 s".
    """

    defect: str
    allowed: str
    error: str
    compared: str


def comparison(metrics: Mapping[str, Any], duration: float) -> Comparison:
    """Return the numbers from which the status of a run follows, as texts for a table.

    Parameters
    ----------
    metrics : metrics of the run by name.
    duration : duration of the run's scene, s.
    """
    excess, allowed = metrics.get("defect_excess"), metrics.get("defect_allowed")
    defect = excess or metrics.get("defect_max")
    of_bound = "" if allowed is None else "rounding" if excess == 0.0 else short_number(allowed)
    error = short_number(metrics.get("angle_error_max"))
    if not error and (predicted := short_number(metrics.get("angle_error_predicted"))):
        error = f"{predicted} predicted"
    horizon = metrics.get("horizon_s")
    compared = (
        "" if horizon is None or not error else f"{_seconds(horizon)} of {_seconds(duration)} s"
    )
    return Comparison(short_number(defect), of_bound, error, compared)


def _seconds(time: float) -> str:
    """Return a time in s as text: with three digits below 1000 s, else as a whole number."""
    return f"{time:.3g}" if time < 1000.0 else f"{time:.0f}"


def short_number(value: object) -> str:
    """Return a number as text with two digits; "" for any value that is not a finite float."""
    return f"{value:.1e}" if isinstance(value, float) and math.isfinite(value) else ""
