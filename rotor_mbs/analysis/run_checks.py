"""The checks of a run's samples, in one table: its status, `check` and `test-method` read the same.

Each check is a number against a bound. What samples say of each other (times, start, tips,
energies) is asked of every run; defects, balances, loads and exact solutions only of a run that
claims the corrected equations.
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

# Below this share of the rotor's inertia the last bit of a pitch decides its value: a hundred times
# the square of the 1e-16 to which π/2 is known.
NO_INERTIA = 1e-30
# Share of the rotor's inertia that is left once every pitch is free: if it is below this where a
# run broke off, the singularity is the reason.
SINGULAR_SHARE = 1e-3
# Round-off of a run's state after some hundred steps; magnified it may add to the energy error.
_ROUND_OFF = 1e-14
# Ten units in the last place of an angle that starts turns away from zero are no error of the
# method.
_START_ROUND_OFF = 10.0 * float(np.finfo(float).eps)
# About the number of intervals of a run: an error that is more than this many times the largest
# defect is not only their sum, but has been amplified.
_GROWN = 1e4


class Where(NamedTuple):
    """Locate a check by scene, method and channel; the method is "*" for a whole scene."""

    scene: str
    method: str
    channel: str


@dataclass(frozen=True, slots=True)
class Check:
    """Hold a number and its bound.

    Attributes
    ----------
    name, where : of the check.
    value, bound : both in `unit`; NaN fails.
    hint : probable cause of a failure.
    fault : what a failure is called in a run's message; "" if its name, value and bound say it.
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
        """Return whether the value is at most the bound; NaN is not."""
        return self.value <= self.bound  # False for NaN

    @property
    def margin(self) -> float:
        """Return how many times the value fits into the bound; infinite for a value of zero."""
        if math.isnan(self.value):
            return 0.0
        return self.bound / self.value if self.value else math.inf

    @property
    def message(self) -> str:
        """Return the reason of a status, in a line."""
        what = f"{self.name}, {self.where.channel}: {self.value:.1e} {self.unit}".rstrip()
        return self.fault or f"{what}, allowed {self.bound:.0e}; {self.hint}"


@dataclass(frozen=True)
class RunSamples:
    """Hold the samples of a run, and what follows from them.

    Attributes
    ----------
    scene, method, trajectory : the run.
    metrics : those of `metrics_of`.
    defects : None without angles and rates, or with fewer than two samples.
    """

    scene: Scene
    method: str
    trajectory: Trajectory
    metrics: Metrics
    defects: Defects | None

    def where(self, channel: str) -> Where:
        """Return the place of a check of one of its channels."""
        return Where(self.scene.name, self.method, channel)


def bounded(
    bounds: Bounds, name: str, where: Where, value: float, unit: str, hint: str, fault: str = ""
) -> Check:
    """Return a value against the bound of the check `name` for the method.

    Parameters
    ----------
    bounds : bounds of the scene.
    name, where, value, unit, hint, fault : as the fields of the check.
    """
    return Check(name, where, float(value), bounds.of(name, where.method).value, hint, unit, fault)


def run_checks(run: RunSamples, bounds: Bounds, *, is_corrected: bool = True) -> Iterator[Check]:
    """Yield every check of a run that has samples.

    The first check that fails names the reason of a status, so the order matters: where a motion is
    wrong, so is much of what follows from it.

    Parameters
    ----------
    run : the samples of the run, at least one.
    bounds : bounds of the scene.
    is_corrected : whether the run claims the corrected equations; the motion of others is not
        checked.
    """
    yield from _checks_of_rows(run, bounds)
    if is_corrected:
        yield from _checks_of_motion(run, bounds)
    yield from _checks_of_outputs(run, bounds)


def _checks_of_rows(run: RunSamples, bounds: Bounds) -> Iterator[Check]:
    """Yield the checks of sample times and initial state, which are the scene's.

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
    # A pitch without inertia is fixed: its rate is zero, whatever the scene says.
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
    """Yield the checks of tips and energies against those of rigid bodies.

    The bodies are at the run's own angles and rates.

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
    """Return the check with a fault whose field {bound} is filled in.

    Parameters
    ----------
    check, fault : the check, and its message.
    scale : by which the bound is multiplied in the message, to have its unit.
    """
    return replace(check, fault=fault.format(bound=f"{check.bound * scale:.0e}"))


def _checks_of_energies(run: RunSamples, bounds: Bounds) -> Iterator[Check]:
    """Yield the checks of stored energies against those of the bodies at the run's states.

    Parameters
    ----------
    run, bounds : see `run_checks`; the run has rates and energies.
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
                # Work that is integrated with the motion is no function of the state alone: it is
                # only as accurate as the balance of energy.
                check = replace(check, bound=max(check.bound, energy_allowed(run, bounds)))
            yield check


def _checks_of_motion(run: RunSamples, bounds: Bounds) -> Iterator[Check]:
    """Yield the checks of the motion: energy balance, loads, defects, error, exact motion.

    Only a run that claims the corrected equations has to pass them.

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
        # Without a reference the error is predicted from the defects; bounds of shipped scenes do
        # not apply to it, as they are for the true error.
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
    """Yield the checks of the median and the largest of the defects.

    A bound on the largest that is above 0.01 rad counts as 0.01 rad.

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
    """Return the message for an angle error that is too large, with the probable cause.

    Parameters
    ----------
    run : see `run_checks`.
    error : rad.
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
    """Return the first pitch that leaves zero although symmetry keeps it there, and when.

    None is returned where there is no such pitch before the horizon.

    Parameters
    ----------
    run : its defects say which pitches rest at zero by symmetry.

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
    """Return the bound on defects of a method, rad: at most 0.01."""
    return min(bounds.of("defect", method).value, OK_ERROR)


def defect_allowed(metrics: Metrics, bound: float) -> float:
    """Return the defect beyond rounding (rad) that is allowed in the worst interval.

    Parameters
    ----------
    metrics : have the defect_judged and defect_excess of that interval.
    bound : rad, of the method for 0.01 s.
    """
    judged, excess = metrics.get("defect_judged", 0.0), metrics.get("defect_excess", 0.0)
    return bound * (excess / judged) if 0.0 < judged < math.inf else bound


def energy_allowed(run: RunSamples, bounds: Bounds) -> float:
    """Return the error of the energy balance that is allowed, a share of the energy scale.

    What a method may do to the energy in 0.01 s adds up over the run, as defects do, and more of
    it is allowed in an interval that is longer or in which errors grow: the bound is multiplied by
    the mean of the intervals' factors for defects, but is at most 0.01.

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
    """Return the largest value of a quantity that passes; None where it is not checked.

    Parameters
    ----------
    rule : names a check, or has a bound of its own.
    bounds, method : where the bound of that check is looked up.
    """
    entry = bounds.find(rule.check, method) if rule.check else None
    return entry.value if entry else rule.bound


def quantity_errors(
    scene: Scene, metrics: Metrics
) -> Iterator[tuple[Quantity, QuantityMetric, float]]:
    """Yield each judged quantity, its rule, and its error relative to the scale of the rule.

    Parameters
    ----------
    scene : its outputs decide which quantities there are.
    metrics : of the run; quantities without a value in it are left out.
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

    These are gaps of joints, loads, and quantities of plug-ins. What rounding may cause is
    subtracted from the errors of loads.

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
            # also NaN; minus infinity: rounding leaves everything open
            if not (off < math.inf).all():
                error = math.inf
        where = run.where(rule.channel or quantity.name)
        hint, unit = rule.look_at or quantity.long_name, rule.unit or quantity.units
        what = rule.fault or f"{rule.metric} is {{value}} {rule.unit}".rstrip()
        fault = f"{what.format(value=f'{error:.1e}')}, allowed {bound:.0e}"
        yield Check(rule.check or quantity.name, where, error, bound, hint, unit, fault)


def _load_floors(run: RunSamples, bounds: Bounds) -> dict[str, Array]:
    """Return the error of each load that rounding can cause, by name.

    It is that of rounding the state and, unless the method has a bound of its own, that of any
    engine's arithmetic.
    """
    samples = run.trajectory.time, run.trajectory.angles, run.trajectory.rates
    floors = load_rounding(run.scene, *samples)
    if bounds.of("loads", run.method).method == "*":
        for name, values in load_conditioning(run.scene, *samples).items():
            floors[name] = floors[name] + FLOOR_SAFETY * values
    return floors


def start_slack(scene: Scene) -> float:
    """Return the error (rad) due to rounding of an initial angle that is turns away from zero.

    It is 0 within a turn.
    """
    return _START_ROUND_OFF * max(
        0.0, *(abs(angle) - 2.0 * np.pi for angle in scene.initial_angles)
    )


def energy_slack(scene: Scene, run: Trajectory) -> float:
    """Return the share of the energy scale that magnified round-off may add to an energy error."""
    return _ROUND_OFF * (energy_conditioning(scene, run) - 1.0) + start_slack(scene)


def energy_conditioning(scene: Scene, run: Trajectory) -> float:
    """Return the factor, at least 1, by which the energy magnifies round-off of the state.

    Near a pitch of π/2 its terms are 1/√share larger than it.
    """
    smallest = max(float(least_inertia_shares(scene, run.angles).min()), NO_INERTIA)
    return max(1.0, float(np.sqrt(SINGULAR_SHARE / smallest)))
