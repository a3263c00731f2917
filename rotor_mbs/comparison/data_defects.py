"""Compute the interval defects of data, and their part beyond rounding.

The data may lack angles or rates.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from rotor_mbs.comparison.data import ForeignData
from rotor_mbs.errors import InputError
from rotor_mbs.models.lagrange.defects import FIT_ROWS, fitted_rates, interval_defects
from rotor_mbs.scenario.scene import Scene
from rotor_mbs.solution.defects import FLOOR_SAFETY, Defects
from rotor_mbs.solution.trajectory import Array, Trajectory

STRETCHES = (10, 100)  # numbers of rows over which defects are added up, to show a drift
SAME_START = 1e-3  # rad, rad/s: a first row and an initial state that differ by less are the same


def carried_errors(reference: Trajectory, growth: Array, units: Array) -> Array:
    """Return the size to which a relative error of 1 in the initial state may have grown.

    For each row, the initial state is assumed to have an error as large as the largest angle of the
    reference up to this row, but at least 1 rad. The result is this error, multiplied by the
    largest error growth up to this row.

    Parameters
    ----------
    reference : (n,) rows of the reference, with angles.
    growth, units : (n, 2 (1 + blades)) and (2 (1 + blades),), see `TimedReference`.

    Returns
    -------
    ndarray
        (n, 2 (1 + blades)) errors of the angles, rad, then of the rates, rad/s.
    """
    sizes = np.maximum(np.abs(reference.angles).max(axis=1), 1.0)
    largest = np.maximum.accumulate(sizes)
    largest_growth = np.maximum(np.maximum.accumulate(growth, axis=0), 1.0)
    return np.asarray(largest_growth * largest[:, None] * units)


def states_of(run: Trajectory) -> Array:
    """Return the states of a run: angles, then rates, (n, 2 (1 + blades))."""
    return np.hstack([run.angles, run.rates])


def defects_of_data(
    scene: Scene, data: ForeignData, reference: Trajectory, until: int
) -> tuple[Defects | None, str]:
    """Compute the interval defects of data.

    If the data have all angles, missing rates are fitted to the angles. If angles are missing, the
    reference replaces all missing angles and rates, and defects are computed only up to the
    horizon.

    Parameters
    ----------
    scene : the rotor.
    data, reference : the data, and the reference in the same rows.
    until : number of rows up to the horizon.

    Returns
    -------
    Defects or None, str
        The defects, None if they cannot be computed; a note on fitted rates, or on why rates cannot
        be fitted, else "".
    """
    count = len(scene.initial_angles)
    states = states_of(reference).copy()
    rounding = np.zeros((len(data.time), 2 * count))
    states[:, data.columns] = data.values
    rounding[:, data.columns] = data.rounding
    without_angles = [i for i in scene.moving_coordinates if i not in data.columns]
    without_rates = [i for i in scene.moving_coordinates if count + i not in data.columns]
    rows = until if without_angles else len(data.time)
    if rows < 2:
        return None, ""
    time, states, rounding = data.time[:rows], states[:rows], rounding[:rows]
    note = ""
    time_rounding = data.time_rounding[:rows]
    if without_rates and not without_angles:
        try:
            fitted = fitted_rates(scene, time, states[:, :count])
        except InputError as exc:
            return None, f"no defects: {exc}"
        columns = [count + i for i in without_rates]
        states[:, columns] = fitted.rates[:, without_rates]
        moving = scene.moving_coordinates
        at_times = time_rounding[:, None] * np.abs(fitted.rates)
        of_angles = np.maximum(rounding[:, :count], 2.0**-53 * np.abs(states[:, :count]))
        of_rates = np.zeros((rows, count))
        of_rates[:, moving] = fitted.rounding((of_angles + at_times)[:, moving])
        rounding[:, columns] = of_rates[:, without_rates]
        names = ", ".join(f"{scene.coordinate_labels[i]} rate" for i in without_rates)
        fitting = f"by fitting the equations of motion to {FIT_ROWS} rows"
        note = f"computed from the angles, {fitting}: {names}"
    if not np.isfinite(states).all():
        return None, ""
    angles, rates = states[:, :count], states[:, count:]
    return interval_defects(scene, time, angles, rates, rounding, time_rounding), note


@dataclass(frozen=True)
class JudgedDefects:
    """Hold the defects of data in rad, and their part beyond rounding.

    The data have n rows; m is twice the number of moving coordinates.

    Attributes
    ----------
    scene, defects : the rotor, and the interval defects of the data.
    tolerance : rad, the largest allowed defect of an interval.
    units : (m,) sizes that count as 1 rad: 1 rad for an angle, a number of rad/s for a rate.
    values : (n - 1, m) rad, signed defects of the moving coordinates: angles, then rates.
    floors : (n - 1, m) rad, estimates of the effect of rounding on `values`.
    is_judged : (n - 1,) whether an interval counts: its defects are finite, and rounding explains
        at most 0.01 rad of them.
    excess : (n - 1,) rad, largest defect of an interval beyond rounding; 0 if it does not count.
    has_fitted_rates : whether all rates are fitted to the angles, because the data have no rates.
    """

    scene: Scene
    defects: Defects
    tolerance: float
    units: Array
    values: Array
    floors: Array
    is_judged: NDArray[np.bool_]
    excess: Array
    has_fitted_rates: bool = False

    @property
    def largest(self) -> float:
        """Return the largest defect beyond rounding, rad."""
        return float(self.excess.max(initial=0.0))

    @property
    def is_rounding(self) -> bool:
        """Return whether no defect is larger than what rounding explains."""
        return not self.largest


def judged_defects(
    scene: Scene, defects: Defects, tolerance: float, *, has_fitted_rates: bool = False
) -> JudgedDefects:
    """Compute the part of the defects of data that is beyond rounding.

    Parameters
    ----------
    scene, defects : the rotor, and the interval defects of the data.
    tolerance : rad, the largest allowed defect of an interval.
    has_fitted_rates : whether all rates are fitted to the angles, because the data have no rates.
    """
    moving = list(defects.moving)
    vectors = np.hstack([defects.angles[:, moving], defects.rates[:, moving]])
    units = np.concatenate([np.ones(len(moving)), defects.rate_units[moving]])
    values = vectors / units
    # The estimated rounding of a number near zero is much smaller than that of its neighbours. A
    # small defect at such a number would look large compared with this estimate. Therefore each
    # floor has a lower limit: a share of the median of its channel's floors.
    floors = np.maximum(defects.floors, 0.3 * np.median(defects.floors, axis=0) + 1e-18)
    is_judged = defects.is_resolved & np.isfinite(vectors).all(axis=1)
    sizes = np.abs(np.where(is_judged[:, None], values, 0.0))
    excess = np.maximum(sizes - FLOOR_SAFETY * floors, 0.0).max(axis=1, initial=0.0)
    return JudgedDefects(
        scene, defects, tolerance, units, values, floors, is_judged, excess, has_fitted_rates
    )
