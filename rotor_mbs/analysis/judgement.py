"""The one judgement of a run, from its samples, by the bounds that `check` reads, too.

ok: every interval's defect within the method's bound, the energy balance kept, and the error of the angles up to the
horizon at most 0.01 rad (from the reference, or predicted from the defects). An engine's report can only lower a
status. The printed equations are "completed" where they reach the end: nothing is claimed of them.
"""

from __future__ import annotations

import functools
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from fractions import Fraction

import numpy as np
from numpy.typing import NDArray

from rotor_mbs.methods.catalogue import is_corrected, look_up
from rotor_mbs.models.lagrange.defects import interval_defects
from rotor_mbs.models.lagrange.samples import load_rounding
from rotor_mbs.scenario.accuracy_bounds import Bound, Bounds, shipped_bounds
from rotor_mbs.scenario.scene import Blade, Scene
from rotor_mbs.solution.defects import Defects
from rotor_mbs.solution.metrics import ANGLE_LIMIT, Metrics, metrics_of
from rotor_mbs.solution.quantities import Array, Quantity, QuantityMetric, known_quantities, sizes
from rotor_mbs.solution.trajectory import Integration, Solution, Trajectory

# rad: the largest error of an angle, up to the horizon, of a run that is called ok.
OK_ERROR = 0.01

# Share of the rotor's inertia that is left once every pitch is free: below this a run that broke off broke off there.
_SINGULAR_SHARE = 1e-3

# Round-off of a run's state, what it becomes over some hundred steps; magnified it may add to the energy error.
_ROUND_OFF = 1e-14

# Ten units in the last place of an angle that starts turns away from zero are no error of the method.
_START_ROUND_OFF = 10.0 * float(np.finfo(float).eps)

# A run is checked where one of these could be found.
_CHECKS = ("energy_drift_max", "defect_max", "angle_error_max")

# A claim of success is not false while a run resembles the motion: a hundredth, of the energy scale, of a radian for
# an interval's defect, of what a quantity is relative to; and a radian for the angles up to the horizon.
_RESEMBLES = 1e-2
_RESEMBLING_ANGLE = 1.0

# Below this share the last bit of a pitch decides the rotor's inertia: (π/2 known to 1e-16)², a hundredfold. What comes
# after such a sample follows from round-off alone, whatever an engine reports.
_NO_INERTIA = 1e-30

# Steps of a run: an error that is this many times the largest defect has not only been added up, but has grown.
_GROWN = 1e4

# Of the rotor's inertia at the start: above it, no start is singular.
_CLEAR_SHARE = 1e-6


@dataclass(frozen=True, slots=True)
class Judgement:
    status: str  # one of `status.STATUSES`
    message: str  # one line; "" for ok
    false_success: bool  # the engine reported success of a run that is wrong
    metrics: Metrics  # see `metrics.metrics_of`
    defects: Defects | None  # see `defects_of`


def defects_of(scene: Scene, run: Trajectory, *, is_corrected: bool = True) -> Defects | None:
    """The defects of a run's intervals; None where angles or rates are not asked for, or there is one sample. Of other
    equations without transition matrices: their defects add up to no error that could be predicted."""
    if len(run.time) < 2 or not (scene.wants("angles") and scene.wants("rates")):
        return None
    defects = interval_defects(scene, run.time, run.angles, run.rates)
    return defects if is_corrected else replace(defects, find_transitions=lambda: None)


def quantity_bound(rule: QuantityMetric, bounds: Bounds, method: str) -> float | None:
    entry = bounds.find(rule.check, method) if rule.check else None
    return entry.value if entry else rule.bound


@np.errstate(over="ignore", invalid="ignore", divide="ignore")  # of a runaway: what is not finite is judged
def judge(scene: Scene, run: Solution, reference: Trajectory | None) -> Judgement:
    """The status of a run, the numbers that it follows from, and whether its engine claims a success that it is not."""
    defects = defects_of(scene, run.trajectory, is_corrected=is_corrected(run.method))
    metrics = metrics_of(scene, run.trajectory, reference, defects)
    status, message = _status(scene, run, reference, metrics)
    false_success = run.integration.success and not _is_close(scene, status, metrics)
    return Judgement(status, message, false_success, metrics, defects)


def clearly_ok(
    scenes: Sequence[Scene],
    method: str,
    integrations: Sequence[Integration],
    samples: Sequence[int],
    metrics: Sequence[Metrics],
    angles: Array,
    own: tuple[Bound, ...] = (),
) -> NDArray[np.bool_]:
    """(k,) whether `judge`, without a reference, is certain to call each of k runs of a method ok.

    Parameters
    ----------
    metrics : of each run its energy_drift_max, and those of its defects where they were computed.
    angles : (k,) rad, the largest of each run.
    """
    bounds = shipped_bounds().with_entries(own)
    energy, defect = (bounds.of(check, method).value for check in ("energy", "defect"))
    complete = np.array([run.success and n == scenes[0].samples for run, n in zip(integrations, samples, strict=True)])
    complete &= angles <= ANGLE_LIMIT
    shares = [rotor_inertia_shares(scene, np.array([scene.initial_angles]))[0] for scene in scenes]
    within = [
        run["energy_drift_max"] <= energy
        and ("defect_max" in run or "defects_not_judged" not in run)
        and run.get("defect_judged", 0.0) <= defect
        and run.get("angle_error_predicted", 0.0) <= OK_ERROR
        for run in metrics
    ]
    return np.asarray(complete & np.array(within) & (np.array(shares) > _CLEAR_SHARE))


def _is_close(scene: Scene, status: str, metrics: Metrics) -> bool:
    """Whether a claim of success may stand: an inaccurate run that resembles the motion is no false success; against an
    unchecked run's claim nothing is known."""
    if status != "inaccurate":
        return status in ("ok", "unchecked", "completed")
    errors = [metrics[name] for name in ("energy_drift_max", "defect_max") if name in metrics]
    errors += [error for _, rule, error in quantity_errors(scene, metrics) if rule.relative_to or rule.check == "loads"]
    return all(error <= _RESEMBLES for error in errors) and largest_angle_error(metrics) <= _RESEMBLING_ANGLE


def largest_angle_error(metrics: Metrics) -> float:
    """rad: up to the horizon, from the reference, or predicted from the defects; 0 where neither is known."""
    return metrics.get("angle_error_max", metrics.get("angle_error_predicted", 0.0))


def quantity_errors(
    scene: Scene, metrics: Metrics, run: Trajectory | None = None
) -> Iterator[tuple[Quantity, QuantityMetric, float]]:
    """Each judged quantity, its rule, and its error relative to what the rule says; only those that the run has. Loads
    of a `run` that is given less what rounding of its state leaves open."""
    rounding: dict[str, Array] = {}
    if run is not None and scene.wants("loads"):
        rounding = load_rounding(scene, run.time, run.angles, run.rates)
    for quantity in known_quantities(scene.outputs):
        rule = quantity.judgement
        if rule is None or rule.metric not in metrics:
            continue
        error = metrics[rule.metric] / (rule.relative_to(scene) if rule.relative_to else 1.0)
        if run is not None and quantity.name in rounding and rule.scale_of is not None:
            unknown = float(sizes(quantity, rounding[quantity.name]).max()) / rule.scale_of(scene, run)
            error = max(error - unknown, 0.0)
        yield quantity, rule, error


def _status(scene: Scene, run: Solution, reference: Trajectory | None, metrics: Metrics) -> tuple[str, str]:
    """Finite? End reached? Through a singularity? Energy, quantities, defects, error? The first no names the status,
    with a message."""
    # Runs that did not reach the end, or that their engine calls failed.
    integration, samples = run.integration, len(run.trajectory.time)
    if samples != scene.samples or not integration.success:
        reached = f"at t = {run.trajectory.time[-1]:.6g} s of {scene.duration:g} s" if samples else "at the start"
        if integration.out_of_time:
            return "timed_out", f"{integration.message}, {reached}"
        reported = integration.message or ("the engine reported success" if integration.success else "no reason given")
        if smallest_rotor_inertia_share(scene, run.trajectory) < _SINGULAR_SHARE:
            return "singular", f"with all pitches at ±π/2 the mass matrix is nearly singular, {reached}; {reported}"
        if integration.success:
            end = f" after {reached.removeprefix('at ')}" if samples else ""
            return "diverged", f"no finite sample{end}; {reported}"
        return "solver_failed", f"{reported}; {reached}"
    if not is_corrected(run.method):
        return "completed", ""

    # Complete runs of scenes without a solution: from a singular state, or past the time where the solution ends.
    if rotor_inertia_shares(scene, run.trajectory.angles[:1])[0] < _NO_INERTIA:
        return "singular", "with all pitches at ±π/2 the initial mass matrix is singular"
    if (
        reference is not None
        and 0 < len(reference.time) < scene.samples
        and smallest_rotor_inertia_share(scene, reference) < _SINGULAR_SHARE
    ):
        return "singular", f"the motion ends in a singularity after t = {reference.time[-1]:.6g} s; the run continued"

    method = look_up(run.method)
    bounds = shipped_bounds().with_entries(method.bounds if method else ())
    energy = bounds.of("energy", run.method).value + energy_slack(scene, run.trajectory)
    if "energy_drift_max" in metrics and not metrics["energy_drift_max"] <= energy:
        return "inaccurate", f"energy drift {metrics['energy_drift_max']:.1e} of the energy scale, allowed {energy:.0e}"
    for _, rule, error in quantity_errors(scene, metrics, run.trajectory):
        bound = quantity_bound(rule, bounds, run.method)
        if bound is not None and not error <= bound:
            fault = rule.fault or f"{rule.metric} is {{value}} {rule.unit}".rstrip()
            return "inaccurate", f"{fault.format(value=f'{error:.1e}')}, allowed {bound:.0e}"
    defect = bounds.of("defect", run.method).value
    median = bounds.find("defect median", run.method)
    if "defect_max" in metrics and median is not None and not metrics["defect_median"] <= median.value:
        return "inaccurate", f"median of the defects {metrics['defect_median']:.1e} rad, allowed {median.value:.0e}"
    if "defect_max" in metrics and not metrics["defect_judged"] <= defect:
        largest = f"defect {metrics['defect_max']:.1e} rad in the interval up to t = {metrics['defect_time']:.6g} s"
        if metrics["defect_judged"] < 0.5 * metrics["defect_max"]:
            largest += f", {metrics['defect_judged']:.1e} rad scaled to 0.01 s and to a fivefold error growth"
        return "inaccurate", f"{largest}, allowed {defect:.0e}"
    error = largest_angle_error(metrics)
    if not error <= OK_ERROR + start_slack(scene):
        how = "angle error" if "angle_error_max" in metrics else "predicted angle error"
        has_grown = error > _GROWN * metrics.get("defect_max", error)
        growth = ", because the motion amplifies small errors" if has_grown else ""
        return "inaccurate", f"{how} {error:.1e} rad up to the horizon{growth}; allowed {OK_ERROR:g} rad"

    # Complete runs with nothing to judge them by.
    angle = float(np.abs(run.trajectory.angles).max())
    if angle > ANGLE_LIMIT:
        limit = f"above {ANGLE_LIMIT:.0e} rad double precision is not sufficient"
        return "unchecked", f"angles of {angle:.1e} rad; {limit}"
    if not any(name in metrics for name in _CHECKS):
        needed = "both angles and rates, or angles and a reference"
        return "unchecked", f"cannot be assessed: without energies it needs {needed}"
    if "defects_not_judged" in metrics and not any(name in metrics for name in ("defect_max", "angle_error_max")):
        return "unchecked", "only the energy balance could be assessed: the samples are too far apart for the motion"
    return "ok", ""


def start_slack(scene: Scene) -> float:
    """rad: what the digits of an angle that starts turns away from zero leave open; 0 for a start within a turn."""
    return _START_ROUND_OFF * max(0.0, *(abs(angle) - 2.0 * np.pi for angle in scene.initial_angles))


def energy_slack(scene: Scene, run: Trajectory) -> float:
    """Share of the energy scale that magnified round-off may add to a method's own energy error."""
    return _ROUND_OFF * (energy_conditioning(scene, run) - 1.0) + start_slack(scene)


def energy_conditioning(scene: Scene, run: Trajectory) -> float:
    """By how much the energy magnifies round-off of the state, at least 1: near a pitch of π/2 its terms are 1/√share
    larger than it. A pitch that moves less than a right angle between samples is examined between them, too."""
    angles = run.angles
    shares = [rotor_inertia_shares(scene, angles)]
    if np.abs(np.diff(angles[:, 1:], axis=0)).max(initial=0.0) < 0.5 * np.pi:
        for column in range(1, angles.shape[1]):
            # Where the pitch passes ±π/2 between two samples, on the straight way.
            quarter = np.floor(angles[:, column] / np.pi - 0.5)
            rows = np.flatnonzero(np.diff(quarter))
            before, after = angles[rows], angles[rows + 1]
            target = np.pi * (np.maximum(quarter[rows], quarter[rows + 1]) + 0.5)
            part = (target - before[:, column]) / (after[:, column] - before[:, column])
            there = before + part[:, None] * (after - before)
            there[:, column] = target
            shares.append(rotor_inertia_shares(scene, there))
    smallest = max(float(np.concatenate(shares).min()), _NO_INERTIA)
    return max(1.0, float(np.sqrt(_SINGULAR_SHARE / smallest)))


def smallest_rotor_inertia_share(scene: Scene, run: Trajectory) -> float:
    """Smallest S / (rotor inertia) at the last sample and on the straight way on to the next one. S = J_hub + Σ (a -
    b²/Jzz) is the rotor's inertia with every pitch free to give way: m (c² + d²) cos²θ for point masses."""
    if not len(run.time):
        angles = np.array([scene.initial_angles])
    else:
        step = scene.duration / (scene.samples - 1)
        angles = run.angles[-1] + np.linspace(0.0, step, 65)[:, None] * run.rates[-1]
    return float(rotor_inertia_shares(scene, angles).min())


def rotor_inertia_shares(scene: Scene, angles: Array) -> Array:
    """(n,) S / (rotor inertia) for (n, 1 + blades) rad."""
    remaining = np.full(len(angles), scene.hub_inertia)
    whole = np.full(len(angles), scene.hub_inertia)
    for i, blade in enumerate(scene.blades):
        s, c = np.sin(angles[:, 1 + i]), np.cos(angles[:, 1 + i])
        free, fixed = _shaft_inertia_forms(blade)
        remaining += free[0] * s * s + free[1] * c * c + free[2] * s * c
        whole += fixed[0] * s * s + fixed[1] * c * c + fixed[2] * s * c
    return np.asarray(remaining / whole)


@functools.lru_cache(maxsize=512)
def _shaft_inertia_forms(blade: Blade) -> tuple[Sequence[float], Sequence[float]]:
    """Coefficients of s², c², s c (of the pitch) in S and in the inertia about the shaft, kg m²; in exact arithmetic
    until the end: for a point mass the first vanishes, whose rounding is not inertia."""
    xx, yy, zz, xy, xz, yz = blade.inertia_about_apex(Fraction)
    fixed = [xx, yy, 2 * xy]
    taken = [xz * xz, yz * yz, 2 * xz * yz] if blade.has_pitch_inertia else [Fraction(0)] * 3
    free = [a - b / zz if b else a for a, b in zip(fixed, taken, strict=True)]
    return [float(value) for value in free], [float(value) for value in fixed]
