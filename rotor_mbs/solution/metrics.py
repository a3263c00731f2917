"""Compute the metrics of a run: its distance from a reference, its energy error, its defects.

Runs, reports and checks use the same metrics.

`METRICS` declares the unit of each metric, and the tables of a file that have it. The metrics of
output quantities are declared with the quantities, in `solution.quantities`.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from rotor_mbs.scenario.scene import Scene
from rotor_mbs.scenario.time_table import value_at
from rotor_mbs.solution.defects import DRIFT_ROWS, LEFT_ZERO, Defects
from rotor_mbs.solution.quantities import (
    Array,
    array_of,
    deviation,
    energy_error,
    known_quantities,
    sizes,
)
from rotor_mbs.solution.trajectory import Trajectory

# The horizon of a scene is the last sample before the error growth reaches this factor.
HORIZON_GROWTH = 1e5

Metrics = dict[str, float]


@dataclass(frozen=True)
class RowValue:
    """The declaration of a column: a computed number or text that a row of runs or points has.

    Attributes
    ----------
    units, long_name : attributes of its column in the file.
    tables : names of the tables that have it, separated by blanks: "runs", "bench", "stability",
        "sweep", and "sweep_growth" for sweeps that request the error growth.
    kind : NumPy type of the column in the file; "S1" for a text.
    rounding : factor of the difference that is allowed between values from different hardware. The
        difference may be this factor times `FLOOR_SAFETY` times the run's `defect_floor`; for
        `defect_drift` it may be larger by the error growth, too.
    is_main : whether the summary of a run in Python shows it.
    """

    units: str
    long_name: str
    tables: str = "runs"
    kind: str = "<f8"
    rounding: float = 0.0
    is_main: bool = False


_OWN_POINTS = "for printed/ode45: over ode45's own output points"
_ALL, _BENCH = "runs bench stability", "runs bench"  # see `RowValue.tables`
# Metrics in the order of their columns. Those that a quantity declares for the table of runs
# (`Quantity.judgement`, `Quantity.has_peak`) are added by `runs.design.metric_columns`.
METRICS = {
    "energy_scale_J": RowValue("J", "energy scale, to which energy errors are relative"),
    "energy_drift_max": RowValue(
        "1",
        "largest energy error over the run, relative to the energy scale",
        f"{_ALL} sweep",
        is_main=True,
    ),
    "energy_gain_J": RowValue(
        "J", "largest increase of the total energy beyond the work", is_main=True
    ),
    "angle_error_max": RowValue("rad", "largest angle error up to the horizon", _ALL),
    "angle_error_predicted": RowValue(
        "rad",
        "largest angle error up to the horizon, predicted from the defects",
        "runs sweep",
        rounding=HORIZON_GROWTH,
    ),
    "angle_error_whole": RowValue("rad", "largest angle error over the whole run"),
    "angle_error_end": RowValue("rad", "angle error at the last sample of the scene", _BENCH),
    "tip_error_max": RowValue(
        "m", "largest distance of a tip from the reference up to the horizon", "bench"
    ),
    "error_growth": RowValue(
        "1", "largest factor by which a small error of the initial state has grown", "sweep_growth"
    ),
    "horizon_s": RowValue(
        "s",
        "time of the last sample before the error growth reaches 1e5",
        f"{_BENCH} sweep_growth",
        is_main=True,
    ),
    "uncertainty_rad": RowValue("rad", "uncertainty of the reference up to the horizon", "bench"),
    "defect_max": RowValue(
        "rad", "largest defect of a coordinate in an interval", f"{_BENCH} sweep", rounding=1.0
    ),
    "defect_median": RowValue(
        "rad", "median of the interval defects", f"{_BENCH} sweep", rounding=1.0
    ),
    "defect_time": RowValue(
        "s",
        "end of the interval with the largest ratio of defect beyond rounding to bound; of the "
        "largest defect if none is beyond rounding",
        "runs sweep",
    ),
    "defect_judged": RowValue(
        "rad",
        "value compared with the bound: defect beyond rounding divided by (interval / 0.01 s), if "
        "above 1, and by the error growth over the interval, if above 1; largest over the run",
        rounding=1.0,
    ),
    "defect_excess": RowValue(
        "rad", "defect beyond rounding in the interval at defect_time", rounding=1.0
    ),
    "defect_allowed": RowValue(
        "rad", "largest defect beyond rounding that is allowed in the interval at defect_time"
    ),
    "defect_mean": RowValue(
        "rad", "largest magnitude of the mean defect of a coordinate", rounding=1.0
    ),
    "defect_drift": RowValue(
        "rad",
        "largest sum of the defects of up to 100 consecutive intervals, each multiplied by the "
        "state transition matrix from its interval to the last of them",
        rounding=DRIFT_ROWS,
    ),
    "defect_floor": RowValue(
        "rad", "estimated largest effect of rounding of the samples on a defect"
    ),
    "defects_not_judged": RowValue(
        "1",
        (
            "number of intervals with a defect beyond rounding of more than 0.01 rad, or in which "
            "rounding alone may cause as much"
        ),
    ),
    "zero_pitch_max": RowValue(
        "rad", "largest magnitude of the pitch angles that stay zero in the reference", _BENCH
    ),
    "zero_pitch_left_s": RowValue(
        "s", "time at which a pitch angle that stays zero in the reference becomes nonzero"
    ),
    "zero_pitch_growth_per_s": RowValue(
        "1/s", "growth rate of a pitch angle that stays zero in the reference"
    ),
    "rotor_angle_min": RowValue(
        "rad",
        f"smallest rotor angle (signed) over the samples; {_OWN_POINTS}",
        "runs sweep",
        is_main=True,
    ),
    "rotor_angle_max": RowValue(
        "rad",
        f"largest rotor angle (signed) over the samples; {_OWN_POINTS}",
        "runs sweep",
        is_main=True,
    ),
    "rotor_angle_size_max": RowValue(
        "rad", f"largest magnitude of the rotor angle over the samples; {_OWN_POINTS}", "sweep"
    ),
    "rotor_rate_max": RowValue(
        "rad/s",
        f"largest magnitude of the rotor rate over the samples; {_OWN_POINTS}",
        "runs sweep",
        is_main=True,
    ),
    "pitch_max": RowValue("rad", "largest magnitude of a pitch angle", "sweep", is_main=True),
}

# Largest angle that can be judged, rad. Larger doubles are more than 1e-10 rad apart: errors of
# 1e-9 rad are hardly resolved.
ANGLE_LIMIT = 1e6

# A pitch angle that leaves zero grows exponentially while its magnitude is between these limits,
# rad. A smaller angle is round-off. The motion of a larger one is no longer linear.
_LINEAR_FROM, _LINEAR_TO = 1e-12, 1e-2


def running_growth(reference: Trajectory) -> Array:
    """Return the largest error growth up to each sample, at least 1: (n,).

    It is 1 at all samples if the reference has no array of the error growth.
    """
    growth = reference.get("error_growth")
    if growth is None:
        return np.ones(len(reference.time))
    return np.maximum(np.maximum.accumulate(growth), 1.0)


def horizon_samples(reference: Trajectory) -> int:
    """Return the number of samples up to the horizon.

    All samples are counted if the error growth stays below HORIZON_GROWTH.
    """
    beyond = running_growth(reference) >= HORIZON_GROWTH
    return int(np.argmax(beyond)) if beyond.any() else len(beyond)


def horizon(reference: Trajectory) -> float:
    """Return the time (s) of the last sample before the error growth reaches HORIZON_GROWTH."""
    return float(reference.time[max(horizon_samples(reference) - 1, 0)])


def angle_error(run: Trajectory, reference: Trajectory) -> Array:
    """Return the largest angle error at each common sample, (common samples,) rad.

    The largest is taken over the coordinates. Angles are unwrapped, so that a lost turn is an error
    of 2π.

    Parameters
    ----------
    run, reference : samples at the same times; either may end early.
    """
    n = min(len(run.time), len(reference.time))
    return np.asarray(np.abs(run.angles[:n] - reference.angles[:n]).max(axis=1))


def energy_scale(scene: Scene, run: Trajectory) -> float:
    """Return the energy scale (J), to which energy errors are relative.

    The scale is Σ m g |r| + kinetic and spring energy at the start + largest |work|. It is zero
    only if nothing moves.

    Parameters
    ----------
    scene : the blades' masses and the springs are used.
    run : the arrays of kinetic energy and work are used, if the run has them.
    """
    weights = sum(
        blade.mass * scene.gravity * float(np.linalg.norm(blade.centre_of_mass))
        for blade in scene.blades
    )
    springs = sum(
        0.5 * stiffness * float(np.square(angle - value_at(scene.pitch_loads[i][1], 0.0)))
        for i, (stiffness, angle) in enumerate(
            zip(scene.bearing_stiffness, scene.initial_angles[1:], strict=False)
        )
    )
    kinetic = (
        float(run.kinetic_energy[0]) if run.kinetic_energy is not None and len(run.time) else 0.0
    )
    work = float(np.abs(run.work).max(initial=0.0)) if run.work is not None else 0.0
    return weights + springs + kinetic + work


def metrics_of(
    scene: Scene,
    run: Trajectory,
    reference: Trajectory | None,
    defects: Defects | None = None,
    *,
    is_corrected: bool = True,
) -> Metrics:
    """Return the metrics that are stored with a run, by their names in the file.

    Metrics that cannot be computed are left out.

    Parameters
    ----------
    scene, run : the scene and the samples of the run. A run without samples has no metrics.
    reference : samples of the scene's reference; None if it has none.
    defects : interval defects of the run; None if they are not computed.
    is_corrected : whether the method of the run solves the corrected equations. Defects are
        computed with these equations, so they predict the error only of such a run.
    """
    metrics: Metrics = {}
    if not len(run.time):
        return metrics
    energy = energy_error(run)
    # The energy error of the first sample is zero by definition: a second one is needed.
    if energy is not None and len(energy) > 1:
        scale = energy_scale(scene, run)
        metrics["energy_scale_J"] = scale
        metrics["energy_drift_max"] = (
            float(np.abs(energy).max()) / scale if scale else float(np.abs(energy).max())
        )
        metrics["energy_gain_J"] = float(energy.max())
    until = len(run.time)  # number of samples up to the horizon
    if reference is not None:
        until = min(until, horizon_samples(reference))
        if len(reference.time) and scene.wants("angles"):
            metrics |= _angle_errors(run, reference, until)
    if defects is not None:
        metrics |= defect_metrics(defects, metrics.get("horizon_s"), is_corrected=is_corrected)
    # The extremes of the rotor are taken over the integrator's own output points, if the run has
    # them.
    own = run.refined or run
    metrics["rotor_angle_min"] = float(own.angles[:, 0].min())
    metrics["rotor_angle_max"] = float(own.angles[:, 0].max())
    metrics["rotor_rate_max"] = float(np.abs(own.rates[:, 0]).max())
    # The peak of a quantity: its largest magnitude, the time (s) at which it occurs, and the number
    # of the blade, from 1.
    peaks: Metrics = {}
    for quantity in known_quantities(scene.outputs):
        values = array_of(quantity, scene, run) if quantity.has_peak else None
        if values is not None:
            lengths = sizes(quantity, values)
            peak = np.unravel_index(int(lengths.argmax()), lengths.shape)
            peaks[f"{quantity.name}_max"] = float(lengths[peak])
            peaks[f"{quantity.name}_max_time_s"] = float(run.time[peak[0]])
            if quantity.dimensions[1:2] == ("blade",):
                peaks[f"{quantity.name}_max_blade"] = float(peak[1] + 1)
        rule, compared = quantity.judgement, reference
        if rule is not None and rule.at_own_state:
            compared = None if defects is None else defects.own_loads
        errors = deviation(quantity, scene, run, compared)
        if rule is None or errors is None:
            continue
        if rule.with_reference and reference is not None and not rule.at_own_state:
            # The first sample is the initial state, which is equal in every run. An error needs a
            # second sample.
            errors = errors[: until if until > 1 else 0]
        if len(errors):
            metrics[rule.metric] = float(errors.max()) / (
                rule.scale_of(scene, run) if rule.scale_of else 1.0
            )
    return metrics | peaks


def defect_metrics(
    defects: Defects, horizon_s: float | None, *, is_corrected: bool = True
) -> Metrics:
    """Return the metrics of a run's interval defects.

    Metrics that are NaN are left out.

    Parameters
    ----------
    defects : interval defects of the run.
    horizon_s : horizon of the reference, s; None if it is to be computed from the defects.
    is_corrected : see `metrics_of`.
    """
    metrics = {
        "defect_max": float(defects.sizes.max()),
        "defect_median": float(np.median(defects.sizes)),
        "defect_mean": defects.mean,
    } | interval_metrics(
        defects, worst_interval(defects, is_corrected=is_corrected), is_corrected=is_corrected
    )
    if is_corrected:
        if horizon_s is None:
            until = defects.horizon_samples(HORIZON_GROWTH)
            horizon_s = float(defects.time[max(until - 1, 0)])
        # These metrics are not computed for the printed equations, because they need the transition
        # matrices of all intervals, which take longer to compute than the defects.
        floor = defects.floor
        metrics |= {
            "defect_floor": float(floor[np.isfinite(floor)].max(initial=0.0)),
            "defects_not_judged": float((~defects.is_judged).sum()),
            "defect_drift": defects.drift,
            "horizon_s": horizon_s,
            "angle_error_predicted": float(
                np.abs(defects.predicted[defects.time <= horizon_s]).max()
            ),
        }
    return {name: value for name, value in metrics.items() if not np.isnan(value)}


def worst_interval(defects: Defects, *, is_corrected: bool = True) -> int:
    """Return the index of the interval with the largest of `Defects.judged_sizes`.

    The interval with the largest defect is returned if no defect is beyond rounding, or if the
    method of the run does not solve the corrected equations.

    Parameters
    ----------
    defects : interval defects of the run.
    is_corrected : whether the method of the run solves the corrected equations.
    """
    judged = defects.judged_sizes if is_corrected else np.zeros(1)
    return int(judged.argmax()) if judged.any() else int(defects.sizes.argmax())


def interval_metrics(defects: Defects, interval: int, *, is_corrected: bool = True) -> Metrics:
    """Return the metrics of one interval: its end, its defect beyond rounding, its judged value.

    The metrics of the worst interval are stored with the run.

    Parameters
    ----------
    defects : interval defects of the run.
    interval : number of the interval, from 0.
    is_corrected : if false, only the end of the interval is returned.
    """
    metrics = {"defect_time": float(defects.time[1 + interval])}
    if is_corrected:
        metrics["defect_excess"] = float(defects.excess[interval])
        metrics["defect_judged"] = float(defects.judged_sizes[interval])
    return metrics


def _angle_errors(run: Trajectory, reference: Trajectory, until: int) -> Metrics:
    """Return the metrics of the angle errors, and of pitches that should stay at zero.

    The first sample is the initial state, which is equal in every run. An error up to the horizon
    or over the run is therefore returned only if there is a second sample.

    Parameters
    ----------
    run, reference : samples of the run and of the reference, both with angles.
    until : number of samples up to the horizon.
    """
    error = angle_error(run, reference)
    metrics: Metrics = {}
    # Some pitches are exactly zero in the reference. Their metrics say whether they stay at zero in
    # the run, and if not, when and how fast they leave zero.
    zero = [i for i in range(1, reference.angles.shape[1]) if not reference.angles[:, i].any()]
    if zero:
        away = np.abs(run.angles[:, zero]).max(axis=1)
        metrics["zero_pitch_max"] = float(away.max())
        if (away > LEFT_ZERO).any():
            metrics["zero_pitch_left_s"] = float(run.time[int(np.argmax(away > LEFT_ZERO))])
            # The logarithm of an exponential growth is a straight line over time. The line is
            # fitted to samples above round-off, up to where the motion is no longer linear.
            large = away >= _LINEAR_TO
            linear_until = int(np.argmax(large)) if large.any() else len(away)
            linear = (away > _LINEAR_FROM) & (np.arange(len(away)) < linear_until)
            if linear.sum() >= 10:
                slope = np.polyfit(run.time[linear], np.log(away[linear]), 1)[0]
                metrics["zero_pitch_growth_per_s"] = float(slope)
    metrics["horizon_s"] = float(reference.time[max(until - 1, 0)])
    if until > 1:
        metrics["angle_error_max"] = float(error[:until].max())
    if len(error) > 1:
        metrics["angle_error_whole"] = float(error.max())
        if len(run.time) == len(reference.time):
            metrics["angle_error_end"] = float(error[-1])
    return metrics


def largest(values: Array) -> Array:
    """Return the largest magnitude of each row of (k, n) values, (k,).

    Samples that are not finite are ignored.
    """
    result: Array = np.abs(
        np.maximum(values.max(axis=1), -values.min(axis=1))
    )  # abs turns -0 into 0
    if not np.isfinite(result).all():
        magnitudes = np.abs(values)
        result = magnitudes.max(axis=1, initial=0.0, where=np.isfinite(magnitudes))
    return result


def extremes(values: Array) -> tuple[Array, Array]:
    """Return the smallest and the largest value of each row of (k, n) values, each (k,).

    Samples that are not finite are ignored.
    """
    lows, highs = values.min(axis=1), values.max(axis=1)
    if not (np.isfinite(lows) & np.isfinite(highs)).all():
        is_known = np.isfinite(values)
        lows = values.min(axis=1, initial=np.inf, where=is_known)
        highs = values.max(axis=1, initial=-np.inf, where=is_known)
    return lows, highs


def energy_drifts(scenes: Sequence[Scene], kinetic: Array, work: Array, errors: Array) -> Array:
    """Return the largest energy error of each of k runs, relative to its energy scale, (k,).

    The error is in J if the energy scale is zero. Samples that are not finite are ignored.

    Parameters
    ----------
    scenes : scene of each run.
    kinetic, work, errors : (k, n) J, kinetic energy, work and energy error at the samples.
    """
    # The energy scales are sums as in `energy_scale`. Its terms from weights and springs are
    # computed for a run at rest; the kinetic energy and the work of each run are added.
    nothing = np.zeros((1, 1))
    still = Trajectory(nothing[0], nothing, nothing)
    at_rest = np.array([energy_scale(scene, still) for scene in scenes])
    scales = at_rest + kinetic[:, 0] + largest(work)
    return np.asarray(largest(errors) / np.where(scales == 0.0, 1.0, scales))
