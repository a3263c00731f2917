"""Select methods for a scene by a rule if none is named.

The rule is drawn from the stability suite: which methods fail, or take minutes, on which scenes.
"""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

from rotor_mbs.errors import MethodRefusal

if TYPE_CHECKING:  # `rotor-mbs list` reads no scene
    from rotor_mbs.scenario.scene import Scene

# Explicit fixed steps at their default (1e-3 s and below) follow a swing up to this rate, rad/s,
# within their bounds.
_MAX_EXPLICIT_SWING = 90.0
# A decay rate, 1/s, times the run, beyond which stability alone, not accuracy, sets an explicit
# step.
_MAX_EXPLICIT_DECAY = 1e4
# Radians of the fastest swing in a run beyond which fixed steps take minutes, and the error of each
# has added up.
_MAX_FIXED_STEP_TURN = 3e4
# Share of the rotor's inertia that a quarter turn of the pitch leaves, below which rates jump
# there.
_NEARLY_SINGULAR = 1e-3
# The share below which SciPy's shortest step is too long to pass there: 3e-13 breaks off, 3e-10
# passes.
_NO_STEP_PASSES = 1e-11


def recommend(scene: Scene, defaults: tuple[str, ...]) -> tuple[tuple[str, ...], str]:
    """Return the methods to take for a scene, and the reason.

    Parameters
    ----------
    scene : the scene.
    defaults : names of the methods that run where nothing speaks against them.

    Returns
    -------
    names : the recommended method first.
    reason : in one line.

    Raises
    ------
    MethodRefusal
        With the reason, if there is no motion to follow.
    """
    reason = singular_reason(scene)
    if reason:
        advice = "select a method with -m to run it anyway"
        raise MethodRefusal(f"{scene.name}: rejected: {reason}; {advice}")
    of_lagrange = [name for name in defaults if name.partition("/")[0] == "lagrange"]
    closed_form = of_lagrange[0] if of_lagrange else "lagrange/dop853"
    swing, decay = fastest_rates(scene)
    if decay * scene.duration > _MAX_EXPLICIT_DECAY and decay > 10.0 * swing:
        reason = f"overdamped (largest decay rate {decay:.2g} 1/s): an implicit method in addition"
        return (closed_form, "lagrange/radau"), reason
    # One point-mass blade that may come to a quarter turn of its pitch, on a hub that is light
    # beside it: its inertia about the shaft all but vanishes there.
    has_one_point = len(scene.blades) == 1 and scene.blades[0].is_point_mass
    if has_one_point and _leaves_zero_pitch(scene):
        rotor_inertia = _largest_rotor_inertia(scene)
        if scene.hub_inertia < _NO_STEP_PASSES * rotor_inertia:
            return (closed_form,), "nearly singular at a pitch of ±π/2: other methods fail there"
        if scene.hub_inertia < _NEARLY_SINGULAR * rotor_inertia:
            reason = "near the singular pitch of ±π/2: methods with adaptive steps"
            return (closed_form, "lagrange/dop853"), reason
    if swing > _MAX_EXPLICIT_SWING:
        rate = f"highest angular frequency {swing:.2g} rad/s"
        reason = f"stiff or fast ({rate}): methods with adaptive steps"
        return (closed_form, "exudyn_tree/dopri5"), reason
    turn = swing * scene.duration
    if turn > _MAX_FIXED_STEP_TURN:
        reason = f"long ({turn:.2g} rad of the fastest oscillation): no fixed step"
        return (closed_form,), reason
    others = (name for name in defaults if name != closed_form)
    reason = "not stiff, nearly singular or long: the default methods, the best of each model"
    return (closed_form, *others), reason


def fastest_rates(scene: Scene) -> tuple[float, float]:
    """Estimate the fastest oscillation and the fastest decay in a motion.

    Parameters
    ----------
    scene : the scene.

    Returns
    -------
    swing : rad/s, of the pitches by spring, torque, gravity and a driven rotor, or the initial
        rate.
    decay : 1/s, of the shaft's and the bearings' dampers.
    """
    swing = abs(scene.initial_rates[0])
    rotor_inertia = _largest_rotor_inertia(scene)
    largest_torque = max((abs(torque) for _, torque in scene.rotor_torque), default=0.0)
    driven = largest_torque / rotor_inertia  # rad/s², of the rotor
    decay = scene.shaft_damping / rotor_inertia if scene.shaft_damping else 0.0
    blades = zip(
        scene.blades,
        scene.bearings,
        scene.pitch_loads,
        scene.initial_rates[1:],
        strict=True,
    )
    for blade, (stiffness, damping), (torques, _), rate in blades:
        if not blade.has_pitch_inertia:
            continue
        x, y, z = blade.centre_of_mass
        inertia = blade.pitch_inertia
        torque = max((abs(value) for _, value in torques), default=0.0)
        # N m about the pitch axis; of the spring, over a radian.
        acceleration = scene.gravity + driven * abs(z)
        moment = stiffness + torque + blade.mass * acceleration * math.hypot(x, y)
        swing = max(swing, math.sqrt(moment / inertia), abs(rate))
        decay = max(decay, damping / inertia)
    return swing, decay


def singular_reason(scene: Scene) -> str:
    """Return why the mass matrix of a scene is, or must become, singular; "" if it need not.

    Only point-mass blades on a hub without inertia can make it so.

    Parameters
    ----------
    scene : the scene; its mass matrix depends on the pitches.
    """
    if not _largest_rotor_inertia(scene):
        return "no inertia about the shaft; allowed: a hub or blade with inertia"
    are_points = all(blade.is_point_mass and blade.has_pitch_inertia for blade in scene.blades)
    if scene.hub_inertia or not are_points:
        return ""
    if all(abs(math.cos(angle)) < 1e-15 for angle in scene.initial_angles[1:]):
        at_start = "the initial mass matrix is singular"
        return f"all pitches are ±π/2 and the hub has no inertia: {at_start}"
    if len(scene.blades) == 1 and _leaves_zero_pitch(scene):
        return (
            "one point-mass blade on a hub without inertia: the mass matrix is singular at a pitch "
            "of ±π/2, where the motion ends; allowed: a hub with inertia"
        )
    return ""


def _largest_rotor_inertia(scene: Scene) -> float:
    """Return the largest inertia about the shaft (kg m²) that the rotor has at any pitches.

    No axis through the apex has more than half the trace of a tensor, and a point mass far from the
    axis has as much.
    """
    total = scene.hub_inertia
    for blade in scene.blades:
        total += 0.5 * sum(blade.inertia_about_apex()[:3])
    return total


def _leaves_zero_pitch(scene: Scene) -> bool:
    """Return whether the pitch of the first blade moves, and no spring keeps it below ±π/2."""
    _, y, _ = scene.blades[0].centre_of_mass
    starts_at_zero = scene.initial_angles[1] == 0.0 and scene.initial_rates[1] == 0.0
    leans = scene.blades[0].cone != 0.0 or (scene.shaft_tilt != 0.0 and scene.gravity != 0.0)
    stays = y == 0.0 and starts_at_zero and not scene.pitch_torque and not leans
    return not stays and not any(scene.bearing_stiffness)
