"""Judge a run by its samples, with the checks and bounds of `rotor-mbs check`.

A run is ok if it reaches the end of the scene and all that it stores is right. Its times and
initial state are the scene's. Its tips and energies are those of its angles and rates, its loads
those of the closed form at its states. Every interval's defect is within the method's bound, and
the energy balance is kept. The error of the angles up to the horizon, from the reference or
predicted from the defects, is at most 0.01 rad.

An engine's report can only lower a status. Runs of the printed equations that reach the end are
"completed": nothing is claimed of them.
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

# If an engine reports success of an inaccurate run, this is not called false as long as the run
# resembles the motion: its energy drift (relative to the energy scale), its defects (rad) and the
# errors of its quantities (relative to their scales) are at most the first of these numbers, and
# its angle error up to the horizon (rad) is at most the second.
_RESEMBLES = 1e-2
_RESEMBLING_ANGLE = 1.0

# An initial state is certainly not singular if its share of the rotor's inertia is larger than
# this, see `smallest_rotor_inertia_share`.
_CLEAR_SHARE = 1e-6


@dataclass(frozen=True, slots=True)
class Judgement:
    """Hold the outcome of a run.

    Attributes
    ----------
    status, message : one of `status.STATUSES`, and the reason in a line; "" for ok.
    advice : what to do about it, where that is known; else "".
    false_success : whether the engine reported success of a run that is wrong.
    metrics, defects : see `metrics_of` and `defects_of`.
    """

    status: str
    message: str
    advice: str
    false_success: bool
    metrics: Metrics
    defects: Defects | None


def defects_of(scene: Scene, run: Trajectory) -> Defects | None:
    """Return the defects of a run's intervals.

    None is returned without angles and rates, or with fewer than two samples.
    """
    if len(run.time) < 2 or not (scene.wants("angles") and scene.wants("rates")):
        return None
    return interval_defects(scene, run.time, run.angles, run.rates)


def bounds_of(method: str) -> Bounds:
    """Return the bounds by which runs of a method are judged: its own precede the shipped ones."""
    known = find_method_or_none(method)
    return shipped_bounds().with_entries(known.bounds if known else ())


# A run that diverges overflows: numbers that are not finite are judged, too.
@np.errstate(over="ignore", invalid="ignore", divide="ignore")
def judge(scene: Scene, run: Solution, reference: Trajectory | None) -> Judgement:
    """Return the status of a run, its numbers, and whether its report of success is false.

    Parameters
    ----------
    scene : the scene.
    run : its method, its samples and its engine's report are used, not its status and metrics.
    reference : of the scene; without one errors are predicted from the defects.
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

    A few numbers of each run suffice to know that `judge` would call it ok without a reference. A
    run that is not clearly ok may be ok all the same.

    Parameters
    ----------
    scenes, method : the scene of each run, and the name of the method.
    integrations, samples : of each run its engine's report and its number of finite samples.
    metrics : of each run its energy_drift_max, and those of its defects where they were computed.
    angles : (k,) rad, the largest of each run.
    own : bounds of the method.
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
    shares = [rotor_inertia_shares(scene, np.array([scene.initial_angles]))[0] for scene in scenes]
    within = [
        run["energy_drift_max"] <= energy
        and not run.get("defects_not_judged", 0.0)
        and run.get("defect_judged", 0.0) <= defect
        and run.get("angle_error_predicted", 0.0) <= OK_ERROR
        for run in metrics
    ]
    return np.asarray(complete & np.array(within) & (np.array(shares) > _CLEAR_SHARE))


def _is_close(scene: Scene, status: str, metrics: Metrics) -> bool:
    """Return whether an engine's claim of success may stand.

    The claim stands for an inaccurate run if it resembles the motion. It also stands for an
    unchecked run, as no number contradicts it.

    Parameters
    ----------
    scene : its outputs and scales decide which errors of quantities there are, and their size.
    status, metrics : of the run.
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
    """Return the angle error (rad) up to the horizon; 0 where it is not known.

    It is that from the reference, or else the predicted one.
    """
    return metrics.get("angle_error_max", metrics.get("angle_error_predicted", 0.0))


def _status(
    run: RunSamples, integration: Integration, reference: Trajectory | None, bounds: Bounds
) -> tuple[str, str, str]:
    """Return status, message and advice of a run.

    The first of these that holds gives the status: the run did not reach the end; it is one of the
    printed equations; the scene has no solution up to its end; a check fails; the run could be
    judged only in part.

    Parameters
    ----------
    run : samples, metrics and defects.
    integration : the engine's report.
    reference : of the scene; None without one.
    bounds : by which the checks are judged.
    """
    scene, trajectory, metrics = run.scene, run.trajectory, run.metrics
    # Runs that did not reach the end, or whose engine reports a failure.
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

    # Complete runs of scenes without a solution: from a singular state, or past the time where the
    # solution ends.
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

    # The same checks as those of `check`; the first one that fails gives the reason.
    for check in run_checks(run, bounds):
        if not check.passed:
            lost = check.name == "error" and symmetry_loss(run) is not None
            advice = (
                "; next to try: a method in which the pitch stays zero, lagrange/* or exudyn_tree/*"
                if lost
                else ""
            )
            return "inaccurate", check.message, advice

    # Complete runs that could only be judged in part.
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
    """Return why a defect of more than 0.01 rad would not be seen in some intervals.

    Parameters
    ----------
    defects : of the run; the interval with the largest error growth is named.
    count : number of these intervals.
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

    The share is the rotor's inertia with every pitch free to give way, divided by that with fixed
    pitches, see `models.lagrange.singularity`. The smallest share on the straight line from the
    last sample to the next one is returned.

    Parameters
    ----------
    scene, run : a run without samples is at the initial angles of the scene.
    """
    if not len(run.time):
        angles = np.array([scene.initial_angles])
    else:
        # A singularity may lie between the last sample and the one that was not reached.
        step = scene.duration / (scene.samples - 1)
        angles = run.angles[-1] + np.linspace(0.0, step, 65)[:, None] * run.rates[-1]
    return float(rotor_inertia_shares(scene, angles).min())
