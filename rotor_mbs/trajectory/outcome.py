"""The one judgement of a run, from its state: runner, bench, check and report all use it. Knows no engine, no file.

An engine's word counts only against it: a run it calls failed is never ok, a run it calls good is looked at all the
same. The printed model is not held to the reference or to its energy: that it departs from them is the finding.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from fractions import Fraction

import numpy as np

from rotor_mbs.scenario.scene import Blade, Scene
from rotor_mbs.trajectory.compare import Metrics, compare
from rotor_mbs.trajectory.record import Array, Run, Trajectory

STATUSES = ("ok", "inaccurate", "diverged", "singular", "solver_failed", "timed_out")


@dataclass(frozen=True, slots=True)
class Bound:
    """What a method's runs are held to.

    angle    relative error (of the largest angle, at least 1 rad) per unit of error growth: the scene's own growth,
             which is not the method's fault, carries every local error on (samples before the horizon)
    energy   of the scene's energy scale, over the whole run; see `energy_conditioning`
    gap      of the longest arm: the largest opening of a joint, where the model has joints that can open
    """

    angle: float
    energy: float
    gap: float = 1e-7


# Tight enough that a length wrong in its seventh digit shows, loose enough that another compiler, or a scene somewhat
# stiffer than the paper's, does not. Worst seen on the paper's scenes at default settings, angle and energy:
# lagrange 1.5e-14, 1.7e-14 (dop853); exudyn_tree 8.5e-15, 4.9e-14 (rk67); exudyn_chain 7.1e-7, 1.2e-6.
BOUNDS = {
    "lagrange": Bound(1e-12, 1e-11),
    "exudyn_tree": Bound(1e-11, 1e-10),
    "exudyn_chain": Bound(5e-6, 1e-5),
}
# Methods of low order or loose tolerance within those models.
METHOD_BOUNDS = {
    "lagrange/ode45": Bound(1e-4, 1e-4),
    "lagrange/radau": Bound(1e-8, 1e-7),
    "exudyn_tree/rk44": Bound(1e-8, 1e-8),
    "exudyn_tree/generalized_alpha": Bound(1e-5, 1e-5),
    # Constraints at velocity level: positions drift apart by the steps' own error.
    "exudyn_chain/newmark_index2": Bound(5e-6, 1e-5, gap=1e-5),
    # Its tolerance, 1e-11, is met step by step; over the thousands of steps of a stiff scene the errors add up.
    "exudyn_tree/dopri5": Bound(1e-10, 1e-9),
}

# Share of the rotor's inertia that is left once every pitch is free: below this a run that broke off broke off there.
_SINGULAR_SHARE = 1e-3

# Round-off of a run's state, what it becomes over some hundred steps; magnified it may add to the energy error.
_ROUND_OFF = 1e-14

# A hundredth of the energy scale, or of the largest angle beyond what the scene itself makes of an error at the start.
_RESEMBLES = 1e-2

# Below this share the last bit of a pitch decides the rotor's inertia: (π/2 known to 1e-16)², a hundredfold. What comes
# after such a sample follows from round-off alone, however well an engine likes it.
_NO_INERTIA = 1e-30


@dataclass(frozen=True, slots=True)
class Verdict:
    """status: one of STATUSES; message: one line, "" where all is well; false_success: the engine claimed too much."""

    status: str
    message: str
    false_success: bool
    metrics: Metrics


def bound_of(method: str) -> Bound | None:
    """The bound for "model/integrator"; None for methods that are not held to any (the printed model)."""
    return METHOD_BOUNDS.get(method) or BOUNDS.get(method.split("/")[0])


def is_held(method: str) -> bool:
    """Whether the method claims to solve the right equations, so that anything but "ok" is a failure."""
    return not method.startswith("printed")


def judge(scene: Scene, run: Run, reference: Trajectory | None) -> Verdict:
    """Finite? End reached? Through a singularity? Energy balance, joints, reference? The first no names the status."""
    metrics = compare(scene, run.trajectory, reference)
    status, message = _broken_off(scene, run)
    if not status and is_held(run.method):
        status, message = _through_singularity(scene, run, reference)
    if not status:
        status, message = _inaccurate(scene, run, metrics)
    false_success = run.integration.success and not _is_close(status, metrics)
    return Verdict(status, message, false_success, metrics)


def _is_close(status: str, metrics: Metrics) -> bool:
    """Whether a claim of success may stand: the end reached, and off by no more than a coarse step is.

    An inaccurate run is no false success as long as it resembles the motion; a wrong one is.
    """
    if status != "inaccurate":
        return status == "ok"
    return all(metrics.get(name, 0.0) <= _RESEMBLES for name in ("energy_drift_max", "angle_error_per_growth"))


def _broken_off(scene: Scene, run: Run) -> tuple[str, str]:
    """Runs that did not get to the end, or were called failed by their engine; ("", "") for the others."""
    integration, samples = run.integration, len(run.trajectory.time)
    complete = samples == scene.samples
    if complete and integration.success:
        return "", ""
    reached = f"at t = {run.trajectory.time[-1]:.6g} s of {scene.duration:g} s" if samples else "at the start"
    if integration.out_of_time:
        return "timed_out", f"{integration.message}, {reached}"
    said = integration.message or ("the engine reported success" if integration.success else "no reason given")
    if smallest_rotor_inertia_share(scene, run.trajectory) < _SINGULAR_SHARE:
        return "singular", f"every pitch at ±π/2 leaves the rotor no inertia, {reached}; {said}"
    if integration.success:
        return "diverged", f"the state is not finite after the last sample {reached}; {said}"
    return "solver_failed", f"{said}; {reached}"


def _through_singularity(scene: Scene, run: Run, reference: Trajectory | None) -> tuple[str, str]:
    """Complete runs of a motion that does not exist: from a singular state, or past the time where it ends."""
    share = rotor_inertia_shares(scene, run.trajectory.angles[:1])[0]
    if share < _NO_INERTIA:
        return "singular", "every pitch at ±π/2 leaves the rotor no inertia, from the start on"
    if reference is None or not 0 < len(reference.time) < scene.samples:
        return "", ""
    if smallest_rotor_inertia_share(scene, reference) < _SINGULAR_SHARE:
        return "singular", f"the motion ends in a singularity after t = {reference.time[-1]:.6g} s; the run went on"
    return "", ""


def _inaccurate(scene: Scene, run: Run, metrics: Metrics) -> tuple[str, str]:
    bound = bound_of(run.method)
    if bound is None:
        return "ok", ""
    energy = bound.energy + energy_slack(scene, run.trajectory)
    if not metrics.get("energy_drift_max", 0.0) <= energy:
        return "inaccurate", f"energy drift {metrics['energy_drift_max']:.1e} of its scale, allowed {energy:.0e}"
    gap = metrics.get("constraint_error_max", 0.0) / max(math.hypot(*blade.centre_of_mass) for blade in scene.blades)
    if not gap <= bound.gap:
        return "inaccurate", f"a joint opens by {gap:.1e} of the longest arm, allowed {bound.gap:.0e}"
    if not metrics.get("angle_error_per_growth", 0.0) <= bound.angle:
        return "inaccurate", (
            f"angle error {metrics['angle_error_max']:.1e} rad before the horizon, "
            f"{metrics['angle_error_per_growth']:.1e} per unit of error growth, allowed {bound.angle:.0e}"
        )
    return "ok", ""


def energy_slack(scene: Scene, run: Trajectory) -> float:
    """Of the energy scale: what magnified round-off may add to a method's own energy error."""
    return _ROUND_OFF * (energy_conditioning(scene, run) - 1.0)


def energy_conditioning(scene: Scene, run: Trajectory) -> float:
    """By how much the energy magnifies round-off of the state, beyond the ordinary; at least 1.

    Near a pitch of π/2 the rates grow like 1/√share while the energy stays: the terms that sum up to it are 1/√share
    times larger than it. A pitch that moves less than a right angle between samples is looked at on its way, too.
    """
    steps = np.abs(np.diff(run.angles[:, 1:], axis=0)).max(initial=0.0)
    shares = rotor_inertia_shares(scene, run.angles)
    if steps < 0.5 * np.pi:
        shares = np.concatenate([shares, _shares_at_quarter_turns(scene, run.angles)])
    smallest = max(float(shares.min(initial=1.0)), _NO_INERTIA)
    return max(1.0, float(np.sqrt(_SINGULAR_SHARE / smallest)))


def _shares_at_quarter_turns(scene: Scene, angles: Array) -> Array:
    """Where a pitch passes ±π/2 between two samples (straight way): the shares there."""
    found = [np.empty(0)]
    for column in range(1, angles.shape[1]):
        quarter = np.floor(angles[:, column] / np.pi - 0.5)
        for k in np.flatnonzero(np.diff(quarter)):
            before, after = angles[k], angles[k + 1]
            target = np.pi * (max(quarter[k], quarter[k + 1]) + 0.5)
            part = (target - before[column]) / (after[column] - before[column])
            there = before + part * (after - before)
            there[column] = target
            found.append(rotor_inertia_shares(scene, there[None, :]))
    return np.concatenate(found)


def smallest_rotor_inertia_share(scene: Scene, run: Trajectory) -> float:
    """Smallest S / (rotor inertia) at the last sample and on the straight way on to the next one.

    S = J_hub + Σ (a - b²/Jzz) is the Schur complement of the mass matrix: with every pitch free to give way, the
    rotor's remaining inertia. For point-mass blades it is m (c² + d²) cos²θ.
    """
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
        free, held = _shaft_inertia_forms(blade)
        remaining += free[0] * s * s + free[1] * c * c + free[2] * s * c
        whole += held[0] * s * s + held[1] * c * c + held[2] * s * c
    shares: Array = remaining / whole
    return shares


def _shaft_inertia_forms(blade: Blade) -> tuple[Sequence[float], Sequence[float]]:
    """Coefficients of s², c², s c (s, c of the pitch) in S and in the inertia about the shaft, kg m².

    In exact arithmetic until the end: for a point mass the first vanishes, and its rounding must not pass for inertia.
    """
    m = Fraction(blade.mass)
    x, y, z = map(Fraction, blade.centre_of_mass)
    xx, yy, zz, xy, xz, yz = map(Fraction, blade.inertia)
    xx, yy, zz = xx + m * (y * y + z * z), yy + m * (x * x + z * z), zz + m * (x * x + y * y)
    xy, xz, yz = xy - m * x * y, xz - m * x * z, yz - m * y * z
    held = [xx, yy, 2 * xy]
    taken = [xz * xz, yz * yz, 2 * xz * yz] if blade.has_pitch_inertia else [Fraction(0)] * 3
    free = [a - b / zz if b else a for a, b in zip(held, taken, strict=True)]
    return [float(value) for value in free], [float(value) for value in held]
