"""The rotor with its blades numbered otherwise: the same motion under other names."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from rotor_mbs.scenario.scene import Scene
from rotor_mbs.solution.trajectory import Array


def relabelled(scene: Scene) -> Scene:
    """The rotor with every blade's number raised by one; the rotor's zero goes back by a blade's phase."""
    turn = 2.0 * math.pi / len(scene.blades)
    return replace(
        scene,
        blades=_rolled(scene.blades),
        initial_angles=(scene.initial_angles[0] - turn, *_rolled(scene.initial_angles[1:])),
        initial_rates=(scene.initial_rates[0], *_rolled(scene.initial_rates[1:])),
        bearing_stiffness=_rolled(scene.bearing_stiffness),
        bearing_damping=_rolled(scene.bearing_damping),
        pitch_torque=_rolled(scene.pitch_torque),
        bearing_rest=_rolled(scene.bearing_rest),
    )


def _rolled(values: Sequence[object]) -> tuple:  # type: ignore[type-arg]
    return (*values[-1:], *values[:-1])


def relabelling_error(angles: Array, other: Array) -> float:
    """rad: of angles of a scene and of the relabelled scene."""
    turn = 2.0 * math.pi / (angles.shape[1] - 1)
    rotor = np.abs(angles[:, 0] - (other[:, 0] + turn)).max()
    return float(max(rotor, np.abs(angles[:, 1:] - np.roll(other[:, 1:], -1, axis=1)).max()))
