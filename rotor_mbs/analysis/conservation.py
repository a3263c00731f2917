"""What an exact run conserves: angular momentum, symmetry, time reversal, energy up to a random walk of round-off.

Knows scenes and samples; no model, no file.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from rotor_mbs.scenario.scene import Blade, Scene

Array = NDArray[np.float64]


def angular_momentum(scene: Scene, angles: Array, rates: Array) -> Array:
    """(n,) kg m²/s about the shaft, from (n, 1 + blades) rad and rad/s; constant where neither gravity nor torque acts.

    Summed over hub and blades as L = J_hub Ω + Σ e·(J ω), e the shaft's direction and ω the blade's angular velocity,
    both in the blade's own frame.
    """
    spin = rates[:, 0]
    total = scene.hub_inertia * spin
    for i, blade in enumerate(scene.blades):
        s, c = np.sin(angles[:, 1 + i]), np.cos(angles[:, 1 + i])
        shaft = np.stack([s, c, np.zeros_like(s)])
        omega = shaft * spin
        omega[2] = rates[:, 1 + i]
        total = total + np.einsum("in,ij,jn->n", shaft, _inertia_about_hub(blade), omega)
    return np.asarray(total)


def _inertia_about_hub(blade: Blade) -> Array:
    xx, yy, zz, xy, xz, yz = blade.inertia
    r = np.array(blade.centre_of_mass)
    own = np.array([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]])
    return np.asarray(own + blade.mass * (r @ r * np.eye(3) - np.outer(r, r)))


def largest_relative_change(values: Array) -> float:
    """Largest departure from the first value, of its size."""
    return float(np.abs(values - values[0]).max() / abs(values[0]))


def mirrored(scene: Scene) -> Scene:
    """The mirror image in the plane of rotation: pitches and the blades' y change sign, the rotor angle does not."""
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


def mirror_error(one: Array, other: Array) -> float:
    """rad: of (n, 1 + blades) angles of a scene and of its mirror image."""
    sign = np.array([1.0, *([-1.0] * (one.shape[1] - 1))])
    return float(np.abs(one - sign * other).max())


def relabelled(scene: Scene) -> Scene:
    """The same rotor with every blade's number raised by one; the rotor's zero goes back by a blade's phase."""
    turn = 2.0 * math.pi / len(scene.blades)
    return replace(
        scene,
        blades=_rolled(scene.blades),
        initial_angles=(scene.initial_angles[0] - turn, *_rolled(scene.initial_angles[1:])),
        initial_rates=(scene.initial_rates[0], *_rolled(scene.initial_rates[1:])),
        bearing_stiffness=_rolled(scene.bearing_stiffness),
        bearing_damping=_rolled(scene.bearing_damping),
    )


def _rolled(values: Sequence[object]) -> tuple:  # type: ignore[type-arg]
    return (*values[-1:], *values[:-1])


def relabelling_error(one: Array, other: Array) -> float:
    """rad: of angles of a scene and of the relabelled one."""
    turn = 2.0 * math.pi / (one.shape[1] - 1)
    rotor = np.abs(one[:, 0] - (other[:, 0] + turn)).max()
    return float(max(rotor, np.abs(one[:, 1:] - np.roll(other[:, 1:], -1, axis=1)).max()))


def reversed_from(scene: Scene, angles: Array, rates: Array) -> Scene:
    """The scene from its last sample on with all rates reversed: it runs back to its start."""
    return replace(scene, initial_angles=tuple(angles[-1].tolist()), initial_rates=tuple((-rates[-1]).tolist()))


def drift_exponent(time: Array, drift: Array) -> float:
    """p of drift ~ t^p over the last hundredfold of time: 1/2 for a random walk of round-off, 1 for a steady loss."""
    used = time >= 0.01 * time[-1]
    # Equally spaced in log t: else the last decade alone would decide.
    at = np.geomspace(time[used][0], time[-1], 40)
    values = np.interp(at, time[used], drift[used])
    return float(np.polyfit(np.log(at), np.log(values), 1)[0])
