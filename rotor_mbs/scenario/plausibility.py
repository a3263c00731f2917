"""Numbers of a scene that are allowed and yet look like a slip: degrees for radians, millimetres for metres, tonnes."""

from __future__ import annotations

import math

from rotor_mbs.scenario.scene import Scene

TURN = 2.0 * math.pi
MAX_RATE = 100.0  # rad/s: a thousand revolutions per minute
MAX_DISTANCE, MIN_DISTANCE = (
    300.0,
    0.01,
)  # m, from the shaft to the farthest point of a blade: the longest built have 130
MAX_MASS, MIN_MASS = 1e6, 0.01  # kg
USUAL_GRAVITY = (1.0, 30.0)  # m/s^2: the Moon, Jupiter


def doubts(scene: Scene) -> list[str]:
    """A line for each number that looks like a slip: key, value, and what may have been meant; [] where all is well."""
    lines = []
    # Where one is more than a turn, other whole numbers are in degrees, too.
    in_degrees = any(abs(angle) > TURN for angle in scene.initial_angles)
    for i, angle in enumerate(scene.initial_angles):
        if abs(angle) > TURN or (in_degrees and abs(angle) >= 1.0 and angle == round(angle)):
            lines.append(f"initial.angles[{i}]: {_as_degrees(angle)}")
    for i in range(len(scene.blades)):
        rest = max((value for _, value in scene.pitch_load(i)[1]), key=abs, default=0.0)
        if abs(rest) > 0.5 * TURN:
            lines.append(f"bearing.rest[{i}]: {_as_degrees(rest)}")
    for i, rate in enumerate(scene.initial_rates):
        if abs(rate) > MAX_RATE:
            lines.append(f'initial.rates[{i}]: {rate:g} rad/s; degrees per second? write "deg({rate:g})"')
    blades = scene.blades[:1] if len(set(scene.blades)) == 1 else scene.blades
    for i, blade in enumerate(blades):
        name = "blade" if len(blades) == 1 else f"blade[{i}]"
        if not MIN_MASS <= blade.mass <= MAX_MASS:
            lines.append(f"{name}.mass: {blade.mass:g} kg; is it in kg?")
        for key, point in (("centre_of_mass", blade.centre_of_mass), ("tip", blade.tip)):
            distance = math.hypot(*point)
            if not MIN_DISTANCE <= distance <= MAX_DISTANCE:
                lines.append(f"{name}.{key}: {distance:g} m from the shaft; is it in m?")
        gyration = math.sqrt(max(blade.inertia[:3]) / blade.mass) if blade.mass else 0.0
        if gyration > 2.0 * math.hypot(*blade.tip):
            far = f"a radius of gyration of {gyration:.3g} m, far beyond the tip"
            lines.append(f"{name}.inertia: {far}; is it in kg m^2, mass in kg?")
    if scene.gravity and not USUAL_GRAVITY[0] <= scene.gravity <= USUAL_GRAVITY[1]:
        lines.append(f"gravity: {scene.gravity:g} m/s^2; 9.81 is usual, 0 is none")
    return lines


def _as_degrees(angle: float) -> str:
    return f'{angle:g} rad are {round(abs(angle) / TURN, 1):.6g} turns; degrees? write "deg({angle:g})"'
