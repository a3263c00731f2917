"""What an exact run conserves, without dampers and changing loads: the scene, its images, itself backwards in time."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from rotor_mbs.methods.solve import solve
from rotor_mbs.scenario.scene import Scene
from rotor_mbs.solution.impulse import angular_momentum
from rotor_mbs.solution.trajectory import Array, Trajectory


def symmetry_errors(scene: Scene, method: str) -> dict[str, float]:
    """Of a scene without gravity and torque: errors in rad, of the angular momentum relative."""

    def run(scene: Scene) -> Trajectory:
        return solve(method, scene, {}).trajectory

    there = run(scene)
    # From the last sample on with all rates reversed it runs back to its start.
    end = {"initial_angles": tuple(there.angles[-1].tolist()), "initial_rates": tuple((-there.rates[-1]).tolist())}
    back = run(replace(scene, **end))
    momentum = angular_momentum(scene, there.angles, there.rates)
    return {
        "mirror_error": mirror_error(there.angles, run(mirrored(scene)).angles),
        "relabelling_error": relabelling_error(there.angles, run(relabelled(scene)).angles),
        "reversal_error": float(np.abs(back.angles[-1] - np.array(scene.initial_angles)).max()),
        "angular_momentum_drift": float(np.abs(momentum - momentum[0]).max() / abs(momentum[0])),
    }


def mirrored(scene: Scene) -> Scene:
    """The mirror image in the plane of rotation: pitches and the blades' y change sign, the rotor angle does not.

    Of a scene without loads on its pitches.
    """
    blades = []
    for blade in scene.blades:
        x, y, z = blade.centre_of_mass
        xx, yy, zz, xy, xz, yz = blade.inertia
        blades.append(replace(blade, centre_of_mass=(x, -y, z), inertia=(xx, yy, zz, -xy, xz, -yz)))
    return replace(
        scene,
        blades=tuple(blades),
        initial_angles=(scene.initial_angles[0], *(-angle for angle in scene.initial_angles[1:])),
        initial_rates=(scene.initial_rates[0], *(-rate for rate in scene.initial_rates[1:])),
    )


def mirror_error(angles: Array, other: Array) -> float:
    """rad: of (n, 1 + blades) angles of a scene and of its mirror image."""
    sign = np.array([1.0, *([-1.0] * (angles.shape[1] - 1))])
    return float(np.abs(angles - sign * other).max())


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
