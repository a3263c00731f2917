"""Judge a run by its samples, with the checks and bounds of `rotor-mbs check`.

A run must reach the end of the scene and pass these checks:

- Sample times and initial state equal those of the scene.
- Tips and energies agree with the angles and rates of the run.
- Loads agree with those of the closed form at the states of the run.
- Joint gaps, and quantities of other packages, are within their bounds.
- The defect of every interval is within the method's bound.
- The energy balance is kept.
- The angle error up to the horizon is at most 0.01 rad. It is computed from the reference, or else
  predicted from the defects.
- The rotor angle agrees with the exact solution, if the scene has one.

A run that passes is ok, or "unchecked" if it cannot be judged, or only in part. A failure that the
engine reports makes the status worse; a success that it reports never makes the status better. Runs
of the printed equations that reach the end are "completed": their accuracy is not judged.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from rotor_mbs.analysis.run_checks import (
    NO_INERTIA,
    SINGULAR_SHARE,
    RunSamples,
    defect_allowed,
    defect_bound,
    quantity_errors,
    run_checks,
    symmetry_loss,
)
from rotor_mbs.methods.catalogue import find_method_or_none, is_corrected
from rotor_mbs.models.lagrange.defects import interval_defects
from rotor_mbs.models.lagrange.singularity import rotor_inertia_shares
from rotor_mbs.scenario.accuracy_bounds import Bound, Bounds, shipped_bounds
from rotor_mbs.scenario.keys import counted
from rotor_mbs.scenario.scene import Scene
from rotor_mbs.solution.defects import Defects
from rotor_mbs.solution.metrics import ANGLE_LIMIT, Metrics, metrics_of
from rotor_mbs.solution.quantities import Array
from rotor_mbs.solution.status import OK_ERROR
from rotor_mbs.solution.trajectory import Integration, Solution, Trajectory

# A run that has none of these metrics cannot be judged.
_CHECKS = ("energy_drift_max", "defect_max", "angle_error_max")

# An engine may report success of a run that is inaccurate. The report is called false only if the
# run does not resemble the motion, that is, if one of these limits is exceeded. The first limit is
# for the energy drift (relative to the energy scale), the largest defect (rad) and the errors of
# quantities (relative to their scales). The second one is for the angle error up to the horizon
# (rad).
_RESEMBLES = 1e-2
_RESEMBLING_ANGLE = 1.0

# The mass matrix of an initial state is certainly not singular if the share of the rotor's inertia
# is larger than this number. `smallest_rotor_inertia_share` defines the share.
_CLEAR_SHARE = 1e-6


@dataclass(frozen=True, slots=True)
class Judgement:
    """Hold the judgement of a run: its status with the reason, and the numbers behind it.

    Attributes
    ----------
    status : one of `status.STATUSES`.
    message : reason of the status in one line; "" for ok.
    advice : what a user can do about the failure; "" if nothing is known.
    false_success : whether the engine reported success of a run that does not resemble the motion.
    metrics, defects : see `metrics_of` and `defects_of`.
    """

    status: str
    message: str
    advice: str
    false_success: bool
    metrics: Metrics
    defects: Defects | None


def defects_of(scene: Scene, run: Trajectory) -> Defects | None:
    """Return the interval defects of a run.

    None is returned if the scene does not request both angles and rates, or if the run has fewer
    than two samples.
    """
    if len(run.time) < 2 or not (scene.wants("angles") and scene.wants("rates")):
        return None
    return interval_defects(scene, run.time, run.angles, run.rates)


def bounds_of(method: str) -> Bounds:
    """Return the bounds for runs of a method: its own bounds, then the shipped ones."""
    known = find_method_or_none(method)
    return shipped_bounds().with_entries(known.bounds if known else ())


# Numbers of a run that diverges may overflow. They are judged, too, so that no warning is needed.
@np.errstate(over="ignore", invalid="ignore", divide="ignore")
def judge(scene: Scene, run: Solution, reference: Trajectory | None) -> Judgement:
    """Judge a run: return its status, its metrics, and whether its report of success is false.

    Parameters
    ----------
    scene : the scene of the run.
    run : the method, the samples and the engine's report are used; status and metrics are ignored.
    reference : samples of the scene's reference; if None, errors are predicted from the defects.
    """
    bounds = bounds_of(run.method)
    defects = defects_of(scene, run.trajectory)
    metrics = metrics_of(
        scene, run.trajectory, reference, defects, is_corrected=is_corrected(run.method)
    )
    if "defect_judged" in metrics and is_corrected(run.method):
        metrics["defect_allowed"] = defect_allowed(metrics, defect_bound(bounds, run.method))
    samples = RunSamples(scene, run.method, run.trajectory, metrics, defects)
    status, message, advice = _status(samples, run.integration, reference, bounds)
    false_success = run.integration.success and not _is_close(scene, status, metrics)
    return Judgement(status, message, advice, false_success, metrics, defects)


def clearly_ok(
    scenes: Sequence[Scene],
    method: str,
    integrations: Sequence[Integration],
    samples: Sequence[int],
    metrics: Sequence[Metrics],
    angles: Array,
    own: tuple[Bound, ...] = (),
) -> NDArray[np.bool_]:
    """Return whether each of k runs of a method is certain to be ok, (k,).

    The result is true if a few numbers of the run show that `judge` would return ok without a
    reference. If it is false, the run may still be ok, and `judge` decides.

    Parameters
    ----------
    scenes, method : the scene of each run, and the name of the method.
    integrations, samples : the engine's report and the number of finite samples of each run.
    metrics : energy_drift_max of each run, and the metrics of its defects if they were computed.
    angles : (k,) rad, largest magnitude of an angle of each run.
    own : bounds that the method brings itself.
    """
    bounds = shipped_bounds().with_entries(own)
    energy, defect = bounds.of("energy", method).value, defect_bound(bounds, method)
    complete = np.array(
        [
            run.success and n == scenes[0].samples
            for run, n in zip(integrations, samples, strict=True)
        ]
    )
    complete &= angles <= ANGLE_LIMIT
    shares = _initial_inertia_shares(scenes)
    within = [
        run["energy_drift_max"] <= energy
        and not run.get("defects_not_judged", 0.0)
        and run.get("defect_judged", 0.0) <= defect
        and run.get("angle_error_predicted", 0.0) <= OK_ERROR
        for run in metrics
    ]
    return np.asarray(complete & np.array(within) & (shares > _CLEAR_SHARE))


def _initial_inertia_shares(scenes: Sequence[Scene]) -> Array:
    """Return the share `rotor_inertia_shares` at the initial angles of each scene, (k,).

    Parameters
    ----------
    scenes : (k,) scenes, of one rotor or of several.
    """
    # In most sweeps over initial states all scenes have one rotor. Its coefficients, which are
    # computed in rational numbers, are then computed once.
    scenes_of_rotor: dict[tuple[object, ...], list[int]] = {}
    for number, scene in enumerate(scenes):
        scenes_of_rotor.setdefault(scene.rotor_key, []).append(number)
    shares = np.empty(len(scenes))
    for numbers in scenes_of_rotor.values():
        angles = np.array([scenes[number].initial_angles for number in numbers])
        shares[numbers] = rotor_inertia_shares(scenes[numbers[0]], angles)
    return shares


def _is_close(scene: Scene, status: str, metrics: Metrics) -> bool:
    """Return whether an engine's report of success is accepted, not called false.

    It is accepted for an inaccurate run that still resembles the motion. It is also accepted for an
    unchecked run, because no number contradicts it.

    Parameters
    ----------
    scene : the scene; it decides which quantities have errors, and the scales of these errors.
    status, metrics : status and metrics of the run.
    """
    if status != "inaccurate":
        return status in ("ok", "unchecked", "completed")
    errors = [metrics[name] for name in ("energy_drift_max", "defect_max") if name in metrics]
    errors += [
        error
        for _, rule, error in quantity_errors(scene, metrics)
        if rule.relative_to or rule.check == "loads"
    ]
    return (
        all(error <= _RESEMBLES for error in errors)
        and largest_angle_error(metrics) <= _RESEMBLING_ANGLE
    )


def largest_angle_error(metrics: Metrics) -> float:
    """Return the largest angle error (rad) up to the horizon; 0 if it is not known.

    The error is computed from the reference, or else predicted from the defects.
    """
    return metrics.get("angle_error_max", metrics.get("angle_error_predicted", 0.0))


def _status(
    run: RunSamples, integration: Integration, reference: Trajectory | None, bounds: Bounds
) -> tuple[str, str, str]:
    """Return status, message and advice of a run.

    The first of these conditions that holds decides the status:

    - The run did not reach the end, or its engine reports a failure.
    - The run is one of the printed equations.
    - The scene has no solution up to its end.
    - A check fails.
    - The run could be judged only in part.

    If none holds, the run is ok.

    Parameters
    ----------
    run : samples, metrics and defects of the run.
    integration : the engine's report.
    reference : samples of the scene's reference; None if it has none.
    bounds : bounds of the checks.
    """
    scene, trajectory, metrics = run.scene, run.trajectory, run.metrics
    # First come runs that did not reach the end, or whose engine reports a failure.
    samples = len(trajectory.time)
    if samples != scene.samples or not integration.success:
        reached = (
            f"at t = {trajectory.time[-1]:.6g} s of {scene.duration:g} s"
            if samples
            else "at the start"
        )
        if integration.out_of_time:
            return "timed_out", f"{integration.message}, {reached}", ""
        reported = integration.message or (
            "the engine reported success" if integration.success else "no reason given"
        )
        if smallest_rotor_inertia_share(scene, trajectory) < SINGULAR_SHARE:
            return (
                "singular",
                (
                    f"with all pitches at ±π/2 the mass matrix is nearly singular, {reached}; "
                    f"{reported}"
                ),
                "",
            )
        if integration.success:
            end = f" after {reached.removeprefix('at ')}" if samples else ""
            return "diverged", f"no finite sample{end}; {reported}", ""
        return "solver_failed", f"{reported}; {reached}", ""
    if not is_corrected(run.method):
        return "completed", "", ""

    # The next runs are complete, but their scenes have no solution up to the end: the initial state
    # is singular, or the run continued beyond the time at which the solution ends.
    if rotor_inertia_shares(scene, trajectory.angles[:1])[0] < NO_INERTIA:
        return "singular", "with all pitches at ±π/2 the initial mass matrix is singular", ""
    if (
        reference is not None
        and 0 < len(reference.time) < scene.samples
        and smallest_rotor_inertia_share(scene, reference) < SINGULAR_SHARE
    ):
        end = reference.time[-1]
        return (
            "singular",
            f"the motion ends in a singularity after t = {end:.6g} s; the run continued",
            "",
        )

    # The checks are those of the command `check`. The first one that fails gives the message.
    for check in run_checks(run, bounds):
        if not check.passed:
            lost = check.name == "error" and symmetry_loss(run) is not None
            advice = (
                "; next to try: a method in which the pitch stays zero, lagrange/* or exudyn_tree/*"
                if lost
                else ""
            )
            return "inaccurate", check.message, advice

    # The next runs are complete, but can be judged only in part, or not at all.
    angle = float(np.abs(trajectory.angles).max())
    if angle > ANGLE_LIMIT:
        limit = f"above {ANGLE_LIMIT:.0e} rad double precision is not sufficient"
        return "unchecked", f"angles of {angle:.1e} rad; {limit}", ""
    if not any(name in metrics for name in _CHECKS):
        needed = "both angles and rates, or angles and a reference"
        return "unchecked", f"cannot be assessed: without energies it needs {needed}", ""
    if run.defects is not None and metrics.get("defects_not_judged"):
        return "unchecked", _too_far_apart(run.defects, int(metrics["defects_not_judged"])), ""
    return "ok", "", ""


def _too_far_apart(defects: Defects, count: int) -> str:
    """Return the message that some intervals are too long to be judged.

    Parameters
    ----------
    defects : interval defects of the run. The message has the length and the error growth of the
        interval with the largest growth among those that are not judged.
    count : number of intervals that are not judged.
    """
    unseen = np.where(defects.is_judged, 0.0, defects.growth)
    worst = int(unseen.argmax())
    length = float(defects.time[worst + 1] - defects.time[worst])
    apart = f"rows {length:.3g} s apart, between which errors grow {defects.growth[worst]:.1e}-fold"
    return (
        f"{apart}: in {counted(count, 'interval')} a defect of {OK_ERROR:g} rad would not be seen; "
        "set a larger number of `samples` in the scene"
    )


def smallest_rotor_inertia_share(scene: Scene, run: Trajectory) -> float:
    """Return the smallest share of the rotor's inertia near the last sample of a run.

    The share is the rotor's inertia with all pitches free to move, divided by its inertia with
    fixed pitches, see `models.lagrange.singularity`. From the last sample the angles are continued
    at constant rates over one interval; the smallest share on this path is returned.

    Parameters
    ----------
    scene, run : the scene and the samples of the run. Without samples, the share at the scene's
        initial angles is returned.
    """
    if not len(run.time):
        angles = np.array([scene.initial_angles])
    else:
        # A singularity may lie between the last sample and the next one, which was not reached.
        step = scene.duration / (scene.samples - 1)
        angles = run.angles[-1] + np.linspace(0.0, step, 65)[:, None] * run.rates[-1]
    return float(rotor_inertia_shares(scene, angles).min())
