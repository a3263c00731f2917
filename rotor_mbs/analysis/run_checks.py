"""Check the samples of a run: compare numbers with bounds.

The status of a run and the commands `check` and `test-method` use the same checks. Times, initial
state, tips and energies are checked for every run. Defects, energy balance, quantities such as
loads, angle errors and exact solutions are checked only for a run that claims the corrected
equations.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np

from rotor_mbs.analysis import kinematics
from rotor_mbs.methods.catalogue import is_built_in
from rotor_mbs.models.lagrange.samples import load_conditioning, load_rounding
from rotor_mbs.models.lagrange.singularity import least_inertia_shares
from rotor_mbs.scenario.accuracy_bounds import Bounds
from rotor_mbs.scenario.scene import Scene
from rotor_mbs.solution.defects import FLOOR_SAFETY, LEFT_ZERO, Defects, row_blocks
from rotor_mbs.solution.metrics import Metrics, energy_scale
from rotor_mbs.solution.quantities import (
    Array,
    Quantity,
    QuantityMetric,
    array_of,
    energy_error,
    known_quantities,
    sizes,
)
from rotor_mbs.solution.status import OK_ERROR
from rotor_mbs.solution.trajectory import Trajectory

# The share of the rotor's inertia is its inertia with all pitches free to move, divided by that
# with fixed pitches, see `models.lagrange.singularity`. A share below NO_INERTIA counts as zero,
# because so small a share depends on the last bit of a pitch. At a singularity the share is about
# the square of the distance of a pitch from π/2. The double nearest to π/2 is within 1e-16 of it.
# NO_INERTIA is a hundred times the square of 1e-16.
NO_INERTIA = 1e-30
# If the share is below this limit where a run broke off, the singularity is the reason.
SINGULAR_SHARE = 1e-3
# Relative round-off of a run's state after some hundred steps. Near a singularity it is magnified
# and adds to the energy error.
_ROUND_OFF = 1e-14
# Relative round-off (ten units in the last place) of an initial angle of more than one turn. An
# angle error of this size is not an error of the method.
_START_ROUND_OFF = 10.0 * float(np.finfo(float).eps)
# About the number of intervals of a run. An angle error that is more than this many times the
# largest defect cannot be the mere sum of the defects: the motion has amplified them.
_GROWN = 1e4


class Where(NamedTuple):
    """Locate a check by scene, method and channel; the method "*" stands for the whole scene."""

    scene: str
    method: str
    channel: str


@dataclass(frozen=True, slots=True)
class Check:
    """Hold a check: a number that is compared with a bound.

    Attributes
    ----------
    name : name of the check, such as "defect".
    where : scene, method and channel that are checked.
    value, bound : number and largest number that passes, both in `unit`. A value of NaN fails.
    hint : probable cause of a failure.
    unit : unit of value and bound.
    fault : message of a run that fails the check; "" if it is made from name, value and bound.
    """

    name: str
    where: Where
    value: float
    bound: float
    hint: str
    unit: str = ""
    fault: str = ""

    @property
    def passed(self) -> bool:
        """Return whether the value is at most the bound; False for NaN."""
        return self.value <= self.bound  # False for NaN

    @property
    def margin(self) -> float:
        """Return the bound divided by the value: infinite for a value of 0, and 0 for NaN."""
        if math.isnan(self.value):
            return 0.0
        return self.bound / self.value if self.value else math.inf

    @property
    def message(self) -> str:
        """Return the message, in one line, of a run that fails the check."""
        what = f"{self.name}, {self.where.channel}: {self.value:.1e} {self.unit}".rstrip()
        return self.fault or f"{what}, allowed {self.bound:.0e}; {self.hint}"


@dataclass(frozen=True)
class RunSamples:
    """Hold the samples of a run, with the metrics and the defects that follow from them.

    Attributes
    ----------
    scene, method, trajectory : scene, name of the method, and samples of the run.
    metrics : result of `metrics_of`.
    defects : interval defects; None without angles and rates, or with fewer than two samples.
    """

    scene: Scene
    method: str
    trajectory: Trajectory
    metrics: Metrics
    defects: Defects | None

    def where(self, channel: str) -> Where:
        """Return the scene and the method of this run with a channel, to locate a check."""
        return Where(self.scene.name, self.method, channel)


def bounded(
    bounds: Bounds, name: str, where: Where, value: float, unit: str, hint: str, fault: str = ""
) -> Check:
    """Return a check whose bound is looked up by its name and its method.

    Parameters
    ----------
    bounds : bounds of the scene, in which the bound is looked up.
    name, where, value, unit, hint, fault : fields of the check.
    """
    return Check(name, where, float(value), bounds.of(name, where.method).value, hint, unit, fault)


def run_checks(run: RunSamples, bounds: Bounds, *, is_corrected: bool = True) -> Iterator[Check]:
    """Yield every check of a run that has samples.

    The first check that fails gives the message of the run, so that the order matters. The motion
    is checked before the outputs, because a wrong motion may be the cause of wrong outputs.

    Parameters
    ----------
    run : the run, with at least one sample.
    bounds : bounds of the scene.
    is_corrected : whether the run claims the corrected equations. If not, its motion is not
        checked.
    """
    yield from _checks_of_rows(run, bounds)
    if is_corrected:
        yield from _checks_of_motion(run, bounds)
    yield from _checks_of_outputs(run, bounds)


def _checks_of_rows(run: RunSamples, bounds: Bounds) -> Iterator[Check]:
    """Yield the checks that sample times and initial state equal those of the scene.

    Parameters
    ----------
    run, bounds : see `run_checks`.
    """
    scene, trajectory = run.scene, run.trajectory
    times = np.linspace(0.0, scene.duration, scene.samples)[: len(trajectory.time)]
    off = float(np.abs(trajectory.time - times).max()) / scene.duration
    yield bounded(
        bounds,
        "times",
        run.where("time"),
        off,
        "of duration",
        "samples are equally spaced, both ends included",
    )
    if not scene.wants("angles"):
        return
    # A pitch without inertia is fixed: its rate is zero, whatever initial rate the scene has.
    free = [True, *(blade.has_pitch_inertia for blade in scene.blades)]
    rates = np.where(free, scene.initial_rates, 0.0)
    off = float(np.abs(trajectory.angles[0] - scene.initial_angles).max())
    if scene.wants("rates"):
        off = max(off, float(np.abs(trajectory.rates[0] - rates).max()))
    size = max(1.0, *map(abs, scene.initial_angles), *map(abs, rates.tolist()))
    yield bounded(
        bounds, "start", run.where("angles, rates"), off / size, "rad, rad/s", "the initial state"
    )


def _checks_of_outputs(run: RunSamples, bounds: Bounds) -> Iterator[Check]:
    """Yield the checks of stored tips and energies.

    They are compared with the tips and energies of rigid bodies at the run's own angles and rates.
    The stored energy error is compared with that of the stored energies.

    Parameters
    ----------
    run, bounds : see `run_checks`.
    """
    scene, trajectory = run.scene, run.trajectory
    if not scene.wants("angles"):
        return
    if trajectory.tip is not None:
        largest = []
        for rows in row_blocks(len(trajectory.time)):
            paths = kinematics.tip_paths(scene, trajectory.angles[rows])
            largest.append(np.linalg.norm(trajectory.tip[rows] - paths, axis=2).max())
        away = np.max(largest)
        length = max(float(np.linalg.norm(blade.tip)) for blade in scene.blades) or 1.0
        hint = "the tip point, the azimuth or the rotation of a blade"
        fault = f"a tip is {away:.1e} m from where its angles put it, allowed {{bound}} m"
        yield _with_fault(
            bounded(bounds, "tip", run.where("tip"), float(away) / length, "of length", hint),
            fault,
            length,
        )
    if trajectory.energy_error is not None:
        own = energy_error(trajectory)
        off = math.nan if own is None else float(np.abs(trajectory.energy_error - own).max())
        hint = "differs from the balance of the stored energies"
        scale = energy_scale(scene, trajectory) or 1.0
        yield bounded(bounds, "energies", run.where("energy error"), off / scale, "of scale", hint)
    if scene.wants("rates") and trajectory.kinetic_energy is not None:
        yield from _checks_of_energies(run, bounds)


def _with_fault(check: Check, fault: str, scale: float = 1.0) -> Check:
    """Return the check with a message for its failure, in which the bound is filled in.

    Parameters
    ----------
    check : the check.
    fault : the message, with a field {bound}.
    scale : factor that converts the bound into the unit of the message.
    """
    return replace(check, fault=fault.format(bound=f"{check.bound * scale:.0e}"))


def _checks_of_energies(run: RunSamples, bounds: Bounds) -> Iterator[Check]:
    """Yield the checks of stored energies and work against those computed from angles and rates.

    Parameters
    ----------
    run, bounds : see `run_checks`; the run has angles, rates and energies.
    """
    scene, trajectory = run.scene, run.trajectory
    angles, work = trajectory.angles, trajectory.work
    kinetic = kinematics.kinetic_energy(scene, angles, trajectory.rates)
    potential = kinematics.potential_energy(scene, trajectory.time, angles)
    formulas: dict[str, tuple[Array | None, Array | None]] = {
        "kinetic energy": (trajectory.kinetic_energy, kinetic),
        "potential energy": (trajectory.potential_energy, potential),
        "work": (work, kinematics.work_of_constant_loads(scene, angles)),
        "work at the start": (None if work is None else work[:1], np.zeros(1)),
    }
    scale = max(energy_scale(scene, trajectory), float(np.abs(kinetic).max())) or 1.0
    hint = "its angles and rates give a different energy: a mass, an inertia, a spring"
    for name, (stored, own) in formulas.items():
        if stored is not None and own is not None:
            off = float(np.abs(stored - own).max()) / scale
            check = bounded(bounds, "energies", run.where(name), off, "of scale", hint)
            if name == "work" and not is_built_in(run.method):
                # A method of another package may integrate the work with the motion. Then the work
                # is only as accurate as the energy balance.
                check = replace(check, bound=max(check.bound, energy_allowed(run, bounds)))
            yield check


def _checks_of_motion(run: RunSamples, bounds: Bounds) -> Iterator[Check]:
    """Yield the checks of the motion: energy, quantities, defects, angle error, exact solution.

    Only a run that claims the corrected equations has to pass these checks.

    Parameters
    ----------
    run, bounds : see `run_checks`.
    """
    scene, trajectory, metrics = run.scene, run.trajectory, run.metrics
    if "energy_drift_max" in metrics:
        drift = max(metrics["energy_drift_max"] - energy_slack(scene, trajectory), 0.0)
        hint = "a force without its potential, a wrong mass matrix, or too long a step"
        fault = (
            f"energy drift {metrics['energy_drift_max']:.1e} of the energy scale, allowed {{bound}}"
        )
        balance = Check(
            "energy",
            run.where("balance"),
            drift,
            energy_allowed(run, bounds),
            hint,
            "of scale",
        )
        yield _with_fault(balance, fault)
    yield from _checks_of_quantities(run, bounds)
    if "defect_max" in metrics:
        yield from _checks_of_defects(run, bounds)
    if "angle_error_max" in metrics:
        hint = (
            f"up to the horizon at {metrics['horizon_s']:.2f} s: defects, amplified by the motion"
        )
        error = max(metrics["angle_error_max"] - start_slack(scene), 0.0)
        fault = _error_fault(run, metrics["angle_error_max"], "angle error")
        yield _with_fault(bounded(bounds, "error", run.where("angles"), error, "rad", hint), fault)
    elif "angle_error_predicted" in metrics:
        # Without a reference the error is predicted from the defects. The bounds of shipped scenes
        # are for the error from the reference, so that they do not apply to a predicted error.
        error, where = metrics["angle_error_predicted"], run.where("angles, predicted")
        value, fault = (
            max(error - start_slack(scene), 0.0),
            _error_fault(run, error, "predicted angle error"),
        )
        yield Check(
            "error", where, value, OK_ERROR, "defects, amplified by the motion", "rad", fault
        )
    exact = kinematics.exact_rotor_angle(scene, trajectory.time) if scene.wants("angles") else None
    if exact is not None:
        name, angle = exact
        off = max(float(np.abs(trajectory.angles[:, 0] - angle).max()) - start_slack(scene), 0.0)
        yield bounded(
            bounds, "exact", run.where("rotor angle"), off, "rad", f"{name}, solved analytically"
        )


def _checks_of_defects(run: RunSamples, bounds: Bounds) -> Iterator[Check]:
    """Yield a check of the median of the defects, and a check of the defect in the worst interval.

    The median is checked only if it has a bound. The bound of the second check is at most 0.01 rad.
    The worst interval is that of `solution.metrics.worst_interval`.

    Parameters
    ----------
    run, bounds : see `run_checks`; the run has defects.
    """
    metrics = run.metrics
    if bounds.find("defect median", run.method):
        fault = f"median of the defects {metrics['defect_median']:.1e} rad, allowed {{bound}}"
        value, hint = metrics["defect_median"], "a term, a parameter, the step"
        median = bounded(bounds, "defect median", run.where("median"), value, "rad", hint)
        yield _with_fault(median, fault)
    bound = defect_bound(bounds, run.method)
    where = run.where("largest")
    hint = f"up to t = {metrics['defect_time']:.6g} s: a term, a parameter, the step"
    allowed = defect_allowed(metrics, bound)
    fault = (
        f"defect {metrics['defect_excess']:.1e} rad in the interval up to t = "
        f"{metrics['defect_time']:.6g} s"
    )
    fault += f", allowed {allowed:.1e}"
    if allowed > 1.05 * bound:
        fault += f" ({bound:.0e} rad per 0.01 s, times length and error growth)"
    error = max(metrics.get("angle_error_max", 0.0), metrics.get("angle_error_predicted", 0.0))
    if error > OK_ERROR:
        known = "" if "angle_error_max" in metrics else "predicted "
        fault += f"; {known}angle error {error:.1e} rad up to {metrics['horizon_s']:.3g} s"
    if bounds.of("defect", run.method).method == "*":
        fault += "; a method's own accuracy is declared by Bound('defect', name, value, reason)"
    yield Check("defect", where, metrics["defect_judged"], bound, hint, "rad", fault)


def _error_fault(run: RunSamples, error: float, what: str) -> str:
    """Return the message for an angle error that is too large, with its probable cause.

    Parameters
    ----------
    run : see `run_checks`.
    error : angle error, rad.
    what : name of the error in the message.
    """
    metrics, scene = run.metrics, run.scene
    text = (
        f"{what} {error:.1e} rad up to the horizon at {metrics['horizon_s']:.3g} s of "
        f"{scene.duration:g} s"
    )
    left = symmetry_loss(run)
    if left is not None:
        pitch, time = left
        return (
            f"pitch {pitch} leaves zero at t = {time:.3g} s, where symmetry keeps it: rounding, "
            f"which this unstable motion amplifies; {text}"
        )
    if error > _GROWN * metrics.get("defect_max", error):
        text += ", because the motion amplifies small errors"
    return f"{text}; allowed {OK_ERROR:g} rad"


def symmetry_loss(run: RunSamples) -> tuple[int, float] | None:
    """Return the first pitch that leaves zero although symmetry keeps it there, and the time.

    None is returned if no pitch leaves zero up to the horizon.

    Parameters
    ----------
    run : see `run_checks`. Its defects say which pitches rest at zero by symmetry.

    Returns
    -------
    int
        Number of the pitch, from 1.
    float
        Time of its first sample away from zero, s.
    """
    if run.defects is None or not run.defects.resting:
        return None
    away = np.abs(run.trajectory.angles[:, list(run.defects.resting)]) > LEFT_ZERO
    if not away.any():
        return None
    row = int(np.argmax(away.any(axis=1)))
    pitch, time = run.defects.resting[int(np.argmax(away[row]))], float(run.trajectory.time[row])
    return (pitch, time) if time <= run.metrics["horizon_s"] else None


def defect_bound(bounds: Bounds, method: str) -> float:
    """Return the bound for defects of a method in intervals of 0.01 s, at most 0.01 rad."""
    return min(bounds.of("defect", method).value, OK_ERROR)


def defect_allowed(metrics: Metrics, bound: float) -> float:
    """Return the largest defect beyond rounding (rad) that is allowed in the worst interval.

    Parameters
    ----------
    metrics : metrics of the run; defect_judged and defect_excess are those of the worst interval.
    bound : bound of the method for an interval of 0.01 s, rad.
    """
    judged, excess = metrics.get("defect_judged", 0.0), metrics.get("defect_excess", 0.0)
    return bound * (excess / judged) if 0.0 < judged < math.inf else bound


def energy_allowed(run: RunSamples, bounds: Bounds) -> float:
    """Return the largest energy drift that is allowed, as a share of the energy scale.

    As for defects, more is allowed if the intervals are longer than 0.01 s or if errors grow over
    them. The method's bound is multiplied by the mean of the intervals' `bound_factors`. The
    product is at most 0.01, unless the bound itself is larger.

    Parameters
    ----------
    run, bounds : see `run_checks`.
    """
    bound = bounds.of("energy", run.method).value
    if run.defects is None:
        return bound
    factor = float(run.defects.bound_factors.mean())
    return max(bound, min(bound * factor, OK_ERROR)) if math.isfinite(factor) else bound


def quantity_bound(rule: QuantityMetric, bounds: Bounds, method: str) -> float | None:
    """Return the bound of a quantity's metric; None if the metric is not checked.

    Parameters
    ----------
    rule : rule of the quantity, which names a check or has a bound of its own.
    bounds, method : bounds and name of the method, to look up the bound of that check.
    """
    entry = bounds.find(rule.check, method) if rule.check else None
    return entry.value if entry else rule.bound


def quantity_errors(
    scene: Scene, metrics: Metrics
) -> Iterator[tuple[Quantity, QuantityMetric, float]]:
    """Yield each judged quantity, its rule, and its metric divided by `relative_to` of the rule.

    Parameters
    ----------
    scene : the scene of the run. Its outputs decide which quantities there are.
    metrics : metrics of the run. A quantity whose metric is missing is left out.
    """
    for quantity in known_quantities(scene.outputs):
        rule = quantity.judgement
        if rule is not None and rule.metric in metrics:
            yield (
                quantity,
                rule,
                metrics[rule.metric] / (rule.relative_to(scene) if rule.relative_to else 1.0),
            )


def _checks_of_quantities(run: RunSamples, bounds: Bounds) -> Iterator[Check]:
    """Yield the checks of quantities that have a rule and a bound.

    Such quantities are gaps of joints, loads, and quantities of other packages. The error that
    rounding may cause is subtracted from the errors of loads.

    Parameters
    ----------
    run, bounds : see `run_checks`.
    """
    scene, trajectory = run.scene, run.trajectory
    rounding = _load_floors(run, bounds) if scene.wants("loads") and run.defects is not None else {}
    for quantity, rule, error in quantity_errors(scene, run.metrics):
        bound = quantity_bound(rule, bounds, run.method)
        if bound is None:
            continue
        own_state = None if run.defects is None else run.defects.own_loads
        if quantity.name in rounding and own_state is not None and rule.scale_of is not None:
            stored, exact = (
                array_of(quantity, scene, samples) for samples in (trajectory, own_state)
            )
            assert stored is not None
            assert exact is not None
            off = sizes(quantity, stored - exact) - sizes(quantity, rounding[quantity.name])
            error = max(float(off.max(initial=0.0)), 0.0) / rule.scale_of(scene, trajectory)
            # NaN and infinity fail. Minus infinity passes: rounding may cause any error there.
            if not (off < math.inf).all():
                error = math.inf
        where = run.where(rule.channel or quantity.name)
        hint, unit = rule.look_at or quantity.long_name, rule.unit or quantity.units
        what = rule.fault or f"{rule.metric} is {{value}} {rule.unit}".rstrip()
        fault = f"{what.format(value=f'{error:.1e}')}, allowed {bound:.0e}"
        yield Check(rule.check or quantity.name, where, error, bound, hint, unit, fault)


def _load_floors(run: RunSamples, bounds: Bounds) -> dict[str, Array]:
    """Return the errors of the loads that rounding can cause, as arrays by name of the load.

    An error includes that of rounding the state. If the method has no bound of its own for loads,
    it also includes the rounding errors in the arithmetic of any engine.
    """
    samples = run.trajectory.time, run.trajectory.angles, run.trajectory.rates
    floors = load_rounding(run.scene, *samples)
    if bounds.of("loads", run.method).method == "*":
        for name, values in load_conditioning(run.scene, *samples).items():
            floors[name] = floors[name] + FLOOR_SAFETY * values
    return floors


def start_slack(scene: Scene) -> float:
    """Return the largest angle error (rad) due to rounding of large initial angles.

    It is 0 if all initial angles are within one turn of zero.
    """
    return _START_ROUND_OFF * max(
        0.0, *(abs(angle) - 2.0 * np.pi for angle in scene.initial_angles)
    )


def energy_slack(scene: Scene, run: Trajectory) -> float:
    """Return the largest energy drift that round-off can cause, as a share of the energy scale.

    It has two causes: round-off of the state, magnified near a singularity, and rounding of large
    initial angles.
    """
    return _ROUND_OFF * (energy_conditioning(scene, run) - 1.0) + start_slack(scene)


def energy_conditioning(scene: Scene, run: Trajectory) -> float:
    """Return the factor, at least 1, by which the energy magnifies round-off of the state.

    Where all pitches are near ±π/2, the terms of the kinetic energy are larger than their sum, by a
    factor that is proportional to 1/√share. The share is the smallest share of the rotor's inertia
    along the run. The factor is taken as 1 for a share of SINGULAR_SHARE or more.
    """
    smallest = max(float(least_inertia_shares(scene, run.angles).min()), NO_INERTIA)
    return max(1.0, float(np.sqrt(SINGULAR_SHARE / smallest)))
