"""The one judgement of a run, from its state: runner, bench, check and report all use it. Knows no engine, no file.

An engine's word counts only against it: a run it calls failed is never ok, a run it calls good is looked at all the
same. The printed model is not held to the reference or to its energy: that it departs from them is the finding.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from rotor_mbs.scenario.scene import Scene
from rotor_mbs.trajectory.compare import Metrics, compare
from rotor_mbs.trajectory.record import Run, Trajectory

STATUSES = ("ok", "inaccurate", "diverged", "singular", "solver_failed", "timed_out")


@dataclass(frozen=True, slots=True)
class Bound:
    """What a method's runs are held to.

    angle    relative error (of the largest angle, at least 1 rad) per unit of error growth: the scene's own growth,
             which is not the method's fault, carries every local error on (samples before the horizon)
    energy   of the scene's energy scale, over the whole run
    """

    angle: float
    energy: float


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
}

# Share of the rotor's inertia that is left once every pitch is free: below this a run that broke off broke off there.
_SINGULAR_SHARE = 1e-3


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
    """Finite? End reached? Energy balance? Reference? In this order; the first that fails names the status."""
    metrics = compare(scene, run.trajectory, reference)
    status, message = _broken_off(scene, run)
    if not status:
        status, message = _inaccurate(run.method, metrics)
    false_success = run.integration.success and status != "ok"
    return Verdict(status, message, false_success, metrics)


def _broken_off(scene: Scene, run: Run) -> tuple[str, str]:
    """Runs that did not get to the end, or were called failed by their engine; ("", "") for the others."""
    integration, samples = run.integration, len(run.trajectory.time)
    complete = samples == scene.samples
    if complete and integration.success:
        return "", ""
    reached = f"at t = {run.trajectory.time[-1]:.6g} s of {scene.duration:g} s" if samples else "at the start"
    said = integration.message or ("the engine reported success" if integration.success else "no reason given")
    if smallest_rotor_inertia_share(scene, run.trajectory) < _SINGULAR_SHARE:
        return "singular", f"every pitch at ±π/2 leaves the rotor no inertia, {reached}; {said}"
    if integration.success:
        return "diverged", f"the state is not finite after the last sample {reached}; {said}"
    return "solver_failed", f"{said}; {reached}"


def _inaccurate(method: str, metrics: Metrics) -> tuple[str, str]:
    bound = bound_of(method)
    if bound is None:
        return "ok", ""
    if not metrics.get("energy_drift_max", 0.0) <= bound.energy:
        return "inaccurate", f"energy drift {metrics['energy_drift_max']:.1e} of its scale, allowed {bound.energy:.0e}"
    if not metrics.get("angle_error_per_growth", 0.0) <= bound.angle:
        return "inaccurate", (
            f"angle error {metrics['angle_error_max']:.1e} rad before the horizon, "
            f"{metrics['angle_error_per_growth']:.1e} per unit of error growth, allowed {bound.angle:.0e}"
        )
    return "ok", ""


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
    remaining = np.full(len(angles), scene.hub_inertia)
    whole = np.full(len(angles), scene.hub_inertia)
    for i, blade in enumerate(scene.blades):
        s, c = np.sin(angles[:, 1 + i]), np.cos(angles[:, 1 + i])
        xx, yy, zz, xy, xz, yz = blade.inertia
        x, y, z = blade.centre_of_mass
        tensor = np.array([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]])
        tensor = tensor + blade.mass * ((x * x + y * y + z * z) * np.eye(3) - np.outer((x, y, z), (x, y, z)))
        axis = np.stack([s, c])
        about_shaft = np.einsum("in,ij,jn->n", axis, tensor[:2, :2], axis)
        coupling = tensor[2, :2] @ axis
        whole += about_shaft
        remaining += about_shaft - (coupling**2 / tensor[2, 2] if blade.has_pitch_inertia else 0.0)
    return float((remaining / whole).min())
