"""Check a results file, as `rotor-mbs check` does: compare numbers with bounds.

Each check has a hint to the cause of a failure. The numbers of a run are computed again from its
stored samples, and its stored metrics and status are compared with them. One check, "published",
compares the stored metrics with the paper's numbers instead.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from contextlib import nullcontext
from dataclasses import replace

import numpy as np

from rotor_mbs.analysis.judgement import Judgement, bounds_of, judge
from rotor_mbs.analysis.published import claims
from rotor_mbs.analysis.run_checks import Check as Check
from rotor_mbs.analysis.run_checks import (
    RunSamples,
    bounded,
    defect_allowed,
    defect_bound,
    run_checks,
)
from rotor_mbs.analysis.run_checks import Where as Where
from rotor_mbs.errors import InputError, StoreError
from rotor_mbs.methods.catalogue import (
    PRINTED,
    REFERENCE,
    find_method_or_none,
    is_corrected,
    methods,
)
from rotor_mbs.methods.solve import solve
from rotor_mbs.runs.hdf5 import reading
from rotor_mbs.runs.read import OpenResults, StoredRun, StoredScene
from rotor_mbs.scenario.accuracy_bounds import Bounds
from rotor_mbs.solution.defects import FLOOR_SAFETY
from rotor_mbs.solution.metrics import (
    HORIZON_GROWTH,
    METRICS,
    Metrics,
    interval_metrics,
    running_growth,
    worst_interval,
)
from rotor_mbs.solution.status import COMPLETE
from rotor_mbs.solution.trajectory import Solution, Trajectory

# Allowed difference between a stored extreme at ode45's own output points and the extreme that is
# computed again: relative, or absolute (rad, rad/s) for an extreme below 1. The two differ because
# ode45 has other output points if it is started again from a sample.
_READ_OFF = 1e-3
# Largest number of intervals in which a peak of the rate is searched for, in a run of the printed
# equations.
_MOST_INTERVALS = 12
# Allowed difference of the logarithms of stored and computed error growth. The transition matrix of
# each interval has a relative error of 1e-5.
_OWN_GROWTH = 0.05


def checks_of(results: OpenResults, frozen: Sequence[OpenResults], bounds: Bounds) -> list[Check]:
    """Return all checks of an open results file, in the order of its scenes.

    Parameters
    ----------
    results : file opened with verify=False, so that a row whose checksum is wrong is judged, too.
    frozen : open files of the shipped references.
    bounds : bounds for all scenes. Bounds that methods bring themselves precede them.

    Raises
    ------
    InputError
        If a stored scene is not valid.
    """
    bounds = bounds.with_entries(bound for method in methods() for bound in method.bounds)
    shipped = {name: scene.reference for file in frozen for name, scene in file.scenes.items()}
    checks: list[Check] = []
    # A file may hold any number. One that overflows fails a check, so that no warning is needed.
    with np.errstate(all="ignore"):
        for scene in results.scenes.values():
            # The bounds of a shipped scene apply only if nothing in the stored scene is changed,
            # not even the number of samples.
            own = replace(
                bounds, scene="" if scene.changes is None or scene.changes else scene.name
            )
            # If the reference ends early in a singularity, the motion does not exist beyond it.
            motion_ends = scene.reference is not None and scene.reference.status == "singular"
            for run in scene.runs.values():
                hint = "its row changed after it was written" if run.is_damaged else "as written"
                checks.append(
                    bounded(own, "integrity", _where(run, "row"), run.is_damaged, "rows", hint)
                )
                try:
                    # If the checksum of a row is wrong, `reading` raises any exception as
                    # StoreError, because the damage is its cause.
                    with reading(str(scene.name), run.method) if run.is_damaged else nullcontext():
                        faults, solution = run.faults(), run.solution()
                        checks += _of_run(
                            run, own, solution, faults, scene.reference_trajectory, motion_ends
                        )
                except StoreError as exc:
                    checks.append(
                        bounded(own, "complete", _where(run, "all"), math.nan, "faults", str(exc))
                    )
            checks += _of_reference(scene, shipped.get(scene.name) if own.scene else None, own)
        # Compare stored metrics with the paper's numbers, in units of their last printed digit.
        for claim in claims(results.scenes):
            if claim.printed is not None:
                off = abs(round(claim.printed, claim.decimals) - claim.value) * 10**claim.decimals
                gives = f"the paper prints {claim.value}, the run gives {claim.printed:.6f}"
                hint = f"{gives}: the printed entries, g, ode45"
                where = Where(claim.scene, PRINTED, claim.id)
                checks.append(bounded(bounds, "published", where, off, "last digits", hint))
    return checks


def _where(run: StoredRun, channel: str) -> Where:
    return Where(run.scene_name, run.method, channel)


def _of_run(
    run: StoredRun,
    bounds: Bounds,
    solution: Solution | None,
    faults: list[str],
    reference: Trajectory | None,
    motion_ends: bool,
) -> Iterator[Check]:
    """Yield the checks of a run.

    Missing samples are no fault if the status of the run says that it stopped early, and if either
    the motion ends in a singularity or the run is one of the printed equations.

    Parameters
    ----------
    run, bounds : the stored run, and the bounds of its scene.
    solution : the run rebuilt from its samples; None if it cannot be rebuilt.
    faults : a line for each stored array that is missing or wrong.
    reference : samples of the scene's reference; None if it has none.
    motion_ends : whether the motion of the scene ends in a singularity.
    """
    reports_it = solution is not None and run.status not in COMPLETE
    if reports_it and (motion_ends or not is_corrected(run.method)):
        faults = []
    hint = "every channel, row and number is present"
    if faults:
        message = run.attributes.get("message", "")
        hint = "; ".join([f"stored as {run.status}{': ' if message else ''}{message}", *faults])
    yield bounded(bounds, "complete", _where(run, "all"), float(len(faults)), "faults", hint)
    if solution is None:
        return
    scene = solution.scene
    judgement = judge(scene, solution, reference)
    claimed = bool(run.attributes.get("false_success", 0))
    # Without angles and rates it is not possible to decide whether a motion ended in a singularity.
    is_unknown = run.status == "singular" and not (scene.wants("angles") and scene.wants("rates"))
    wrong = (judgement.status != run.status and not is_unknown) + (
        judgement.false_success != claimed
    )
    hint = f"stored {run.status}, its samples give {judgement.status} {judgement.message}".rstrip()
    if judgement.false_success != claimed:
        hint += "; whether the engine's report of success is false differs from what is stored"
    yield bounded(bounds, "status", _where(run, "status"), float(wrong), "faults", hint)
    metrics = judgement.metrics | _of_stored_interval(run, judgement)
    channel, worst, hint = _changed_metric(run, metrics, solution)
    yield bounded(bounds, "metrics", _where(run, channel), worst, "relative", hint)
    faults = settings_faults(run)
    hint = "; ".join(faults) or "the method's, each within its range"
    yield bounded(bounds, "settings", _where(run, "settings"), float(len(faults)), "faults", hint)
    if len(solution.trajectory.time):
        samples = RunSamples(
            scene, run.method, solution.trajectory, judgement.metrics, judgement.defects
        )
        yield from run_checks(samples, bounds, is_corrected=is_corrected(run.method))
        growth = solution.trajectory.get("error_growth")
        if run.method == REFERENCE and growth is not None and judgement.defects is not None:
            own_growth = judgement.defects.error_growth
            known = np.isfinite(own_growth) & (own_growth < HORIZON_GROWTH)
            off = float(np.abs(np.log(growth[known] / own_growth[known])).max(initial=0.0))
            hint = "the stored horizon is not that computed from the samples"
            yield Check("growth", _where(run, "of the samples"), off, _OWN_GROWTH, hint, "log")


def _of_stored_interval(run: StoredRun, judgement: Judgement) -> Metrics:
    """Return the metrics of the interval that is stored as the worst, if it may be the worst.

    If several intervals are nearly equally far beyond their bounds, the last bits of the samples
    decide which one is the worst, and other hardware may round these bits differently. The result
    is empty if the stored interval is clearly less far beyond its bound than the worst one.

    Parameters
    ----------
    run : the stored run, whose metric defect_time is the end of the interval.
    judgement : judgement of the run's samples, with their defects.
    """
    defects, metrics = judgement.defects, judgement.metrics
    stored = run.attributes.get("defect_time", math.nan)
    if defects is None or "defect_time" not in metrics or not math.isfinite(stored):
        return {}
    has_bound = "defect_judged" in metrics
    interval = int(np.abs(defects.time[1:] - stored).argmin())
    worst = worst_interval(defects, is_corrected=has_bound)
    floor = _rounding(metrics)
    is_as_far = (
        not has_bound or defects.judged_sizes[interval] >= defects.judged_sizes[worst] - floor
    )
    # If no defect is beyond rounding, the worst interval is the one with the largest defect.
    if not metrics.get("defect_judged"):
        is_as_far = is_as_far and defects.sizes[interval] >= defects.sizes[worst] - floor
    if not is_as_far:
        return {}
    own = interval_metrics(defects, interval, is_corrected=has_bound)
    if "defect_allowed" in metrics:
        own["defect_allowed"] = defect_allowed(own, defect_bound(bounds_of(run.method), run.method))
    return own


def _rounding(metrics: Metrics) -> float:
    """Return the largest change of a defect (rad) that rounding of the samples can cause."""
    return FLOOR_SAFETY * metrics.get("defect_floor", float(np.finfo(float).eps))


def _changed_metric(run: StoredRun, metrics: Metrics, solution: Solution) -> tuple[str, float, str]:
    """Return the stored metric with the largest relative difference from that of the samples.

    Parameters
    ----------
    run, metrics : the stored run with its metrics, and the metrics computed from the samples.
    solution : the run rebuilt from its samples.

    Returns
    -------
    str
        Name of the metric.
    float
        Relative difference; 0 if no metric differs by more than its allowance.
    str
        Text with both values.
    """
    trajectory = solution.trajectory
    worst, hint, channel = 0.0, "stored numbers equal those of the samples", "stored numbers"
    if not any(name in run.attributes for name in metrics):
        # A file of references stores no metrics, and a run without samples has no metrics.
        return channel, worst, hint
    floor = _rounding(metrics)
    growth = min(float(running_growth(trajectory)[-1]), HORIZON_GROWTH)
    # Allow for differences due to the last bits of the samples, which other hardware may round
    # differently.
    allowances = {name: floor * value.rounding for name, value in METRICS.items() if value.rounding}
    allowances["defect_drift"] *= growth
    # The allowed defect is proportional to the computed error growth over its interval. If no
    # defect is beyond rounding, any interval may be the stored one.
    is_beyond = metrics.get("defect_excess", 0.0) > floor
    allowances["defect_allowed"] = (
        _OWN_GROWTH * metrics.get("defect_allowed", 0.0) if is_beyond else math.inf
    )
    # Angles and rates that are not stored are NaN, so that their metrics cannot be compared.
    lacking = set() if solution.scene.wants("rates") else {"rotor_rate_max"}
    if not solution.scene.wants("angles"):
        lacking |= {"rotor_angle_min", "rotor_angle_max"}
    own = _own_extremes(solution) if run.method == PRINTED and not lacking else {}
    allowances |= {name: _READ_OFF * max(abs(value), 1.0) for name, value in own.items()}
    if run.method == PRINTED and not own:
        lacking |= {"rotor_angle_min", "rotor_angle_max", "rotor_rate_max"}
    for name, value in (metrics | own).items():
        if name in lacking:
            continue
        stored = float(run.attributes.get(name, np.nan))
        allowance = allowances.get(name, 0.0)
        off = abs(stored - value)
        if not (off <= allowance or stored == value):
            share = off / max(abs(value), abs(stored)) if math.isfinite(off) else math.nan
            if not share <= worst:
                worst, channel, hint = (
                    share,
                    name,
                    f"stored {stored:.6g}, its samples give {value:.6g}",
                )
    return channel, worst, hint


def _own_extremes(solution: Solution) -> dict[str, float]:
    """Return the rotor's extremes at ode45's own output points, in a run of the printed equations.

    An output point may lie between samples. Therefore the equations are integrated again over the
    intervals beside the samples with extreme values, and over those in which the slope of the rate
    changes most. Where a blade passes its singular pitch, a peak of the rate is narrower than an
    interval. The result is empty if loads change over time. It is also empty for a run that broke
    off, because the run may have become singular after its last sample.

    Parameters
    ----------
    solution : the run rebuilt from its samples.
    """
    scene, trajectory = solution.scene, solution.trajectory
    angles, speeds = trajectory.angles[:, 0], np.abs(trajectory.rates[:, 0])
    if len(angles) < scene.samples or not scene.has_constant_loads:
        return {}
    # Second differences of the rate: they are large where a peak may lie between two samples.
    bends = np.abs(np.diff(speeds, 2, prepend=speeds[0], append=speeds[-1]))
    intervals = {*np.argsort(-np.maximum(bends[:-1], bends[1:]))[:_MOST_INTERVALS].tolist()}
    for row in (int(angles.argmin()), int(angles.argmax()), int(speeds.argmax())):
        intervals |= {row - 1, row} & {*range(len(angles) - 1)}
    extremes = {
        "rotor_angle_min": angles.min(),
        "rotor_angle_max": angles.max(),
        "rotor_rate_max": speeds.max(),
    }
    for k in intervals:
        part = replace(
            scene,
            initial_angles=tuple(trajectory.angles[k].tolist()),
            initial_rates=tuple(trajectory.rates[k].tolist()),
            duration=scene.duration / (scene.samples - 1),
            samples=2,
        )
        own = solve(PRINTED, part, solution.settings).trajectory.refined
        assert own is not None
        extremes["rotor_angle_min"] = min(extremes["rotor_angle_min"], own.angles[:, 0].min())
        extremes["rotor_angle_max"] = max(extremes["rotor_angle_max"], own.angles[:, 0].max())
        extremes["rotor_rate_max"] = max(extremes["rotor_rate_max"], np.abs(own.rates[:, 0]).max())
    return {name: float(value) for name, value in extremes.items()}


def settings_faults(run: StoredRun) -> list[str]:
    """Return what is wrong with the stored settings of a run, a line for each fault.

    All settings of the run's method must be stored, each within its range, and no other setting.
    The list is empty if the method is unknown.
    """
    method = find_method_or_none(run.method)
    if method is None:
        return []
    stored = run.settings
    faults = [f"{name} is missing" for name in method.defaults if name not in stored]
    try:
        method.settings.of(method.name, stored)
    except InputError as exc:
        faults += exc.problems
    return faults


def _of_reference(scene: StoredScene, shipped: StoredRun | None, bounds: Bounds) -> Iterator[Check]:
    """Yield the checks of a stored reference against the shipped reference of the same scene.

    A check fails if the file has no reference for the scene.

    Parameters
    ----------
    scene : the stored scene.
    shipped : the shipped reference; None if the scene has none.
    bounds : bounds of the scene.
    """
    stored = scene.reference
    hint = "an altered reference, or a changed scene or closed form"
    if stored is None:
        hint = "the file has no reference to compare the runs with"
        yield bounded(
            bounds, "reference", Where(scene.name, REFERENCE, "all"), math.nan, "rad", hint
        )
    elif shipped is not None:
        if stored.is_frozen:  # the stored reference is marked as read from the shipped file
            changed = []
            for name in ("angles", "rates", "error_growth", "angle_uncertainty"):
                if name in shipped and name in stored:
                    values, others = stored.array(name), shipped.array(name)
                    if values.shape != others.shape or values.tobytes() != others.tobytes():
                        changed.append(name)
            channel = ", ".join(changed) or "all"
            yield bounded(
                bounds,
                "frozen",
                _where(stored, channel),
                float(len(changed)),
                "arrays",
                "as in the shipped file",
            )
        for name in ("angles", "rates"):
            if name in stored:
                first, second, off = shipped.array(name), stored.array(name), math.nan
                if first.shape == second.shape and second.dtype.kind == "f":
                    off = float(
                        (np.abs(first - second) / np.maximum(1.0, np.abs(first))).max(initial=0.0)
                    )
                yield bounded(bounds, "reference", _where(stored, name), off, "rad, rad/s", hint)
        for name, check_name in (("error_growth", "growth"), ("angle_uncertainty", "uncertainty")):
            if name in shipped:
                first, off = shipped.array(name), math.nan
                second = stored.array(name) if name in stored else np.empty(0)
                if first.shape == second.shape and second.dtype.kind == "f":
                    # Compare the samples at which the shipped value is positive and finite. If the
                    # stored value of such a sample is not positive and finite, `off` is infinite or
                    # NaN, so that the check fails.
                    used = np.isfinite(first) & (first > 0.0)
                    off = float(np.abs(np.log(second[used] / first[used])).max(initial=0.0))
                yield bounded(
                    bounds, check_name, _where(stored, name.replace("_", " ")), off, "log", hint
                )
