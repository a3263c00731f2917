"""Statuses of runs: how a run ended, and the integer codes of files.

Files have CF's `flag_values` and `flag_meanings`, so that the order of the list may differ between
files.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any, NamedTuple

# Outcomes of a run ("unchecked": complete, but it cannot be judged; "completed": a run of the
# printed equations that reached the end, whose accuracy is not judged), of a point that was not run
# ("left_out"), and of a run whose process died. Codes are places in this list: new ones go to its
# end.
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
# Those of runs that reached the end.
COMPLETE = ("ok", "inaccurate", "unchecked", "completed")

# In place of a status: there is no run, as its method cannot represent the scene; nothing is
# stored.
REFUSED = "refused"

# Statuses that need no attention: an "ok" run is accurate, a "completed" one can be no better.
GOOD = ("ok", "completed")


# rad: the largest error of an angle, up to the horizon, and the largest defect beyond rounding, of
# a run that is ok.
OK_ERROR = 0.01


def code_of(status: str) -> int:
    """Return the code of a status in a file: its place in STATUSES."""
    return STATUSES.index(status)


class Comparison(NamedTuple):
    """Hold what a status follows from, as texts for a table; "" for what a run does not have.

    Attributes
    ----------
    defect, allowed : rad, the defect furthest beyond rounding and what is allowed in its interval,
        or "rounding".
    error : rad, the largest angle error up to the horizon; predicted from the defects without a
        reference.
    compared : until when, of which duration.
    """

    defect: str
    allowed: str
    error: str
    compared: str


def comparison(metrics: Mapping[str, Any], duration: float) -> Comparison:
    """Return what a status follows from, as texts.

    Parameters
    ----------
    metrics : of a run, by name.
    duration : of its scene, s.
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
    """Return a time in s with three digits, or as a whole number from 1000 s."""
    return f"{time:.3g}" if time < 1000.0 else f"{time:.0f}"


def short_number(value: object) -> str:
    """Return a number with two digits; "" for None and what is not a finite float."""
    return f"{value:.1e}" if isinstance(value, float) and math.isfinite(value) else ""
