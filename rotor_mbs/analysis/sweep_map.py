"""A stability map: how far the pitches went, over the two axes of a grid."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from rotor_mbs.errors import InputError
from rotor_mbs.store.sweep_read import StoredSweep

Array = NDArray[np.float64]

# A pitch that has grown tenfold is leaving: what stays bounded in a stable rotor only swings, by its amplitude.
GROWN = 10.0


@dataclass(frozen=True)
class StabilityMap:
    """x, y: (columns,), (rows,) values of the second and the first axis; growth: (rows, columns) the largest pitch of
    the run, of the largest at its start; NaN where the run left nothing."""

    x_key: str
    y_key: str
    x_unit: str
    y_unit: str
    x: Array
    y: Array
    growth: Array

    @property
    def unstable(self) -> NDArray[np.bool_]:
        """Where the pitches grew tenfold or more."""
        grown: NDArray[np.bool_] = self.growth >= GROWN
        return grown


def stability_map(sweep: StoredSweep, start: float) -> StabilityMap:
    """start: the largest pitch at the start, rad. Raises InputError where the sweep is no grid of two axes."""
    if len(sweep.shape) != 2 or len(sweep.keys) != 2:
        raise InputError(f"map: {len(sweep.keys)} axes; allowed: a grid of two axes, by one method")
    if not start > 0.0:
        raise InputError("map: every pitch starts at zero and nothing could grow; allowed: a small pitch at the start")
    rows, columns = sweep.shape
    y, x = (sweep.parameter(key)[: rows * columns].reshape(rows, columns) for key in sweep.keys)
    largest = sweep.column("pitch_max")[: rows * columns].reshape(rows, columns)
    return StabilityMap(
        sweep.keys[1], sweep.keys[0], sweep.units[1], sweep.units[0],
        x[0], y[:, 0], largest / start,
    )  # fmt: skip
