"""Random rotors for tests: one to six blades of full inertia, springs, dampers, loads that ramp and
jump, rows near and far, half a second to a minute."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np

from rotor_mbs.scenario.scene import Blade, Scene

Array = Any
OUTPUTS = ("angles", "rates", "tip", "energy", "loads")
MAX_ROWS = 401


def random_scene(seed: int) -> Scene:
    """Return the rotor of a seed. Times scale with its size: a blade swings by a few radians
    between far rows."""
    rng = np.random.default_rng([39, seed])
    count = int(rng.integers(1, 7))
    size = float(10.0 ** rng.uniform(-0.5, 1.3))  # m
    blades = tuple(_blade(rng, size) for _ in range(count))
    gravity = float(rng.choice([0.0, 1.62, 9.81]))
    # s, of a swing of the rotor under gravity, or of a turn of it
    period = 2.0 * np.pi * np.sqrt(size / max(gravity, 1.0))
    duration = float(np.clip(period * 10.0 ** rng.uniform(-0.5, 0.7), 0.5, 60.0))
    rows = int(np.clip(duration / period * 10.0 ** rng.uniform(0.7, 2.2), 11, MAX_ROWS))
    inertia = blades[0].mass * size**2
    weight = blades[0].mass * (gravity or 1.0) * size
    pitch_moment = 0.05 * weight
    fields: dict[str, Any] = {}
    if rng.random() < 0.5:
        fields["bearing_stiffness"] = tuple((pitch_moment * rng.uniform(0.0, 20.0, count)).tolist())
        if rng.random() < 0.5:
            fields["bearing_rest"] = tuple(_table(rng, duration, 0.5) for _ in range(count))
    if rng.random() < 0.5:
        fields["bearing_damping"] = tuple(
            (pitch_moment * period * rng.uniform(0.0, 1.0, count)).tolist()
        )
    if rng.random() < 0.3:
        fields["shaft_damping"] = float(inertia / period * rng.uniform(0.0, 3.0))
    if rng.random() < 0.5:
        fields["rotor_torque"] = _table(rng, duration, 0.5 * weight)
    if rng.random() < 0.5:
        fields["pitch_torque"] = tuple(_table(rng, duration, pitch_moment) for _ in range(count))
    return Scene(
        name=f"random {seed}",
        title=f"random rotor of seed {seed}",
        figures=(),
        gravity=gravity,
        duration=duration,
        samples=rows,
        outputs=OUTPUTS,
        blades=blades,
        hub_inertia=float(rng.choice([0.0, 0.1, 2.0])) * inertia,
        initial_angles=tuple(rng.uniform(-1.0, 1.0, 1 + count).tolist()),
        initial_rates=tuple((rng.uniform(-2.0, 2.0, 1 + count) / period).tolist()),
        **fields,
    )


def leaning_scene(seed: int, blades: int = 0) -> Scene:
    """Return the rotor of a seed with a tilted shaft, a cone of each blade of its own, a hub with
    radius and mass.

    blades: how many, 0 for those of the seed; all have a hub, so that a rotor of one blade is not
    singular.
    """
    scene = random_scene(seed)
    rng = np.random.default_rng([41, seed])
    size = scene.blades[0].centre_of_mass[2]
    if blades:
        scene = replace(
            scene,
            blades=tuple(_blade(rng, size) for _ in range(blades)),
            bearing_stiffness=(),
            bearing_rest=(),
            bearing_damping=(),
            pitch_torque=(),
            initial_angles=tuple(rng.uniform(-1.0, 1.0, 1 + blades).tolist()),
            initial_rates=tuple(rng.uniform(-1.0, 1.0, 1 + blades).tolist()),
        )
    cones = rng.uniform(-0.5, 0.5, len(scene.blades)).tolist()
    return replace(
        scene,
        name=f"leaning {seed}",
        blades=tuple(
            replace(blade, cone=cone) for blade, cone in zip(scene.blades, cones, strict=True)
        ),
        shaft_tilt=float(rng.uniform(-0.6, 0.6)),
        hub_inertia=max(scene.hub_inertia, 0.1 * scene.blades[0].mass * size**2),
        hub_mass=float(scene.blades[0].mass * rng.uniform(0.5, 2.0)),
        hub_radius=float(0.1 * size),
    )


def _blade(rng: np.random.Generator, size: float) -> Blade:
    """Return a blade: a slender cloud of eight points, so that its inertia is that of a body."""
    points = size * rng.normal(0.0, 1.0, (8, 3)) * [0.06, 0.04, 0.4]
    masses = rng.uniform(0.5, 2.0, 8) * size**2
    centre = masses @ points / masses.sum()
    tensor = np.zeros((3, 3))
    for mass, r in zip(masses, points - centre, strict=True):
        tensor += mass * (r @ r * np.eye(3) - np.outer(r, r))
    offset = size * np.array([*rng.normal(0.0, 0.03, 2), rng.uniform(0.3, 0.8)])
    tip = size * np.array([*rng.normal(0.0, 0.1, 2), 1.5])
    elements = tensor[[0, 1, 2, 0, 0, 1], [0, 1, 2, 1, 2, 2]]
    return Blade(
        float(masses.sum()), tuple(offset.tolist()), tuple(elements.tolist()), tuple(tip.tolist())
    )


def _table(
    rng: np.random.Generator, duration: float, size: float
) -> tuple[tuple[float, float], ...]:
    """Return a load over time: a constant, a ramp, or ramps with a jump between rows."""
    values = (size * rng.uniform(-1.0, 1.0, 4)).tolist()
    times = np.sort(rng.uniform(0.1, 0.9, 3) * duration).tolist()
    kind = int(rng.integers(3))
    if kind == 0:
        return ((0.0, values[0]),)
    if kind == 1:
        return ((times[0], values[0]), (times[2], values[1]))
    return (
        (times[0], values[0]),
        (times[1], values[1]),
        (times[1], values[2]),
        (times[2], values[3]),
    )
