"""One number read off a run: an extreme, a range, how it grows.

Extremes are read at an integrator's own output points where the run has them, as off a printed figure.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import NamedTuple, Protocol

import numpy as np

from rotor_mbs.analysis.published import TrajectoryNumber
from rotor_mbs.solution.trajectory import Array

_DATASETS = {"angle": "angles", "rate": "rates"}


class RunArrays(Protocol):
    """Arrays of a run by name: time (n,), angles, rates (n, 1 + blades); refined_time and so on, None without them."""

    def get(self, name: str, /) -> Array | None: ...


def measure(run: RunArrays, asked: TrajectoryNumber) -> float | None:
    """The number in rad or rad/s (reversals and growth: 1); None where the run has no such data or it is undefined."""
    series = _series(run, _DATASETS[asked.quantity], asked.coordinate)
    if series is None:
        return None
    return STATISTICS[asked.statistic].of(*series)


def _series(run: RunArrays, name: str, coordinate: int) -> tuple[Array, Array] | None:
    for prefix in ("refined_", ""):
        time, values = run.get(f"{prefix}time"), run.get(f"{prefix}{name}")
        if time is not None and values is not None and len(values) and coordinate < values.shape[1]:
            return time, values[:, coordinate]
    return None


def _reversals(x: Array) -> float:
    signs = np.sign(x[x != 0.0])
    return float(np.count_nonzero(signs[1:] != signs[:-1]))


def _growth(t: Array, x: Array) -> float | None:
    """Largest departure from the start over the second half of the time reached by that over the first half."""
    first = t <= 0.5 * (t[0] + t[-1])
    away = np.abs(x - x[0])
    before = float(away[first].max())
    return float(away[~first].max()) / before if before > 0.0 and not first.all() else None


def _swing_ratio(x: Array) -> float | None:
    """Largest by smallest way from one turning point to the next; the start counts as one."""
    moving = np.flatnonzero(np.diff(x) != 0.0)
    signs = np.sign(np.diff(x)[moving])
    turning = moving[1:][signs[1:] != signs[:-1]]
    swings = np.abs(np.diff(x[[0, *turning]]))
    return float(swings.max() / swings.min()) if len(swings) >= 2 else None


class Statistic(NamedTuple):
    """of: from times (n,) s and values (n,) to the number; text: before the name of what it is of; without a unit?"""

    of: Callable[[Array, Array], float | None]
    text: str
    has_unit: bool = True


STATISTICS = {
    "min": Statistic(lambda _, x: float(x.min()), "smallest"),
    "max": Statistic(lambda _, x: float(x.max()), "largest"),
    "max_abs": Statistic(lambda _, x: float(np.abs(x).max()), "largest magnitude of"),
    "range": Statistic(lambda _, x: float(np.ptp(x)), "range of"),
    "max_abs_change": Statistic(lambda _, x: float(np.abs(x - x[0]).max()), "largest change of"),
    "net_change": Statistic(lambda _, x: float(x[-1] - x[0]), "change from start to end of"),
    "reversals": Statistic(lambda _, x: _reversals(x), "changes of sign of", has_unit=False),
    "growth": Statistic(_growth, "growth (later by earlier departure) of", has_unit=False),
    "swing_ratio": Statistic(lambda _, x: _swing_ratio(x), "largest by smallest swing of", has_unit=False),
}
