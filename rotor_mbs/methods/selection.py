"""Which method to take for a scene where none is named, and why; the rule is drawn from the stability suite."""

from __future__ import annotations

import math

from rotor_mbs.errors import MethodRefusal
from rotor_mbs.scenario.scene import Scene

# Explicit fixed steps at their default (1e-3 s and below) follow a swing up to this rate, rad/s, within their bounds.
_MAX_EXPLICIT_SWING = 90.0
# A decay rate, 1/s, times the run, beyond which stability alone, not accuracy, sets an explicit step.
_MAX_EXPLICIT_DECAY = 1e4
# Radians of the fastest swing in a run beyond which fixed steps take minutes, and the error of each has added up.
_MAX_FIXED_STEP_TURN = 3e4
# Share of the rotor's inertia that a quarter turn of the pitch leaves, below which rates jump there.
_NEARLY_SINGULAR = 1e-3
# The share below which SciPy's shortest step is too long to pass there: 3e-13 breaks off, 3e-10 passes.
_NO_STEP_PASSES = 1e-11


def choose(scene: Scene, defaults: tuple[str, ...]) -> tuple[tuple[str, ...], str]:
    """The methods for `scene`, the recommended one of the `defaults` first, and why, in one line. Raises MethodRefusal
    with the reason where no motion exists to be followed."""
    reason = singular_reason(scene)
    if reason:
        raise MethodRefusal(f"{scene.name}: refused: {reason}; name a method with -m to see what it makes of it")
    closed_form = next((name for name in defaults if name.partition("/")[0] == "lagrange"), "lagrange/dop853")
    swing, decay = fastest_rates(scene)
    if decay * scene.duration > _MAX_EXPLICIT_DECAY and decay > 10.0 * swing:
        reason = f"overdamped, fastest decay {decay:.2g} /s: an implicit method beside it"
        return (closed_form, "lagrange/radau"), reason
    # One point-mass blade that may come to a quarter turn of its pitch, on a hub that is light beside it.
    is_alone = len(scene.blades) == 1 and scene.blades[0].is_point_mass and _leaves_zero_pitch(scene)
    if is_alone and scene.hub_inertia < _NO_STEP_PASSES * _rotor_inertia(scene):
        return (closed_form,), "next to singular at a pitch of ±π/2: no other method passes there"
    if is_alone and scene.hub_inertia < _NEARLY_SINGULAR * _rotor_inertia(scene):
        return (closed_form, "lagrange/dop853"), "near the singular pitch of ±π/2: methods that choose their own step"
    if swing > _MAX_EXPLICIT_SWING:
        reason = f"stiff or fast, fastest swing {swing:.2g} rad/s: methods that choose their own step"
        return (closed_form, "exudyn_tree/dopri5"), reason
    if swing * scene.duration > _MAX_FIXED_STEP_TURN:
        return (closed_form,), f"long, {swing * scene.duration:.2g} rad of the fastest swing: no fixed step"
    others = (name for name in defaults if name != closed_form)
    return (closed_form, *others), "neither stiff, singular nor long: the default set, best of each model"


def fastest_rates(scene: Scene) -> tuple[float, float]:
    """Fastest swing of a pitch in rad/s (spring, torque, gravity, turning and driven rotor), fastest decay in 1/s."""
    swing = abs(scene.initial_rates[0])
    driven = max((abs(torque) for _, torque in scene.rotor_torque), default=0.0) / _rotor_inertia(scene)
    decay = scene.shaft_damping / _rotor_inertia(scene) if scene.shaft_damping else 0.0
    for i, blade in enumerate(scene.blades):
        if not blade.has_pitch_inertia:
            continue
        x, y, z = blade.centre_of_mass
        inertia = blade.pitch_inertia
        stiffness, damping = scene.bearing(i)
        torque = max((abs(value) for _, value in scene.pitch_load(i)[0]), default=0.0)
        moment = stiffness + torque + blade.mass * (scene.gravity + driven * abs(z)) * math.hypot(x, y)
        swing = max(swing, math.sqrt(moment / inertia), abs(scene.initial_rates[1 + i]))
        decay = max(decay, damping / inertia)
    return swing, decay


def _rotor_inertia(scene: Scene) -> float:
    """kg m², about the shaft: of blades that lie as far from it as they can."""
    arms = (blade.mass * sum(r * r for r in blade.centre_of_mass) + max(blade.inertia[:3]) for blade in scene.blades)
    return scene.hub_inertia + sum(arms)


def singular_reason(scene: Scene) -> str:
    """Why the mass matrix is, or must become, singular; "" where it need not. Point-mass blades on a massless hub."""
    if not _rotor_inertia(scene):
        return "nothing has inertia about the shaft; give the hub or a blade some"
    if scene.hub_inertia or not all(blade.is_point_mass and blade.has_pitch_inertia for blade in scene.blades):
        return ""
    if all(abs(math.cos(angle)) < 1e-15 for angle in scene.initial_angles[1:]):
        return "every blade stands at a pitch of ±π/2 on a massless hub: the mass matrix is singular at the start"
    if len(scene.blades) == 1 and _leaves_zero_pitch(scene):
        return (
            "one point-mass blade on a massless hub: its mass matrix is singular at a pitch of ±π/2, where the motion "
            "ends; give the hub some inertia"
        )
    return ""


def _leaves_zero_pitch(scene: Scene) -> bool:
    """Whether the pitch moves, and no spring holds it short of a right angle."""
    _, y, _ = scene.blades[0].centre_of_mass
    still = y == 0.0 and scene.initial_angles[1] == 0.0 and scene.initial_rates[1] == 0.0 and not scene.pitch_torque
    return not still and not any(scene.bearing_stiffness)
