"""Newton's and Euler's laws for a rotor with tilt and cone, by rotation matrices; shares nothing
with the models.

Everything is in the base frame and about the apex: of each blade the axes R = Rx(tilt) Ry(q +
phase) Rx(-cone) Rz(θ), its angular velocity Ω shaft + θ' axis, and the force and moment that its
motion and weight ask of the hub.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

import numpy as np

from rotor_mbs.scenario.scene import Blade, Scene
from support.other_code import value_at

Array = Any
UP = np.array([0.0, 0.0, 1.0])


@dataclass(frozen=True)
class State:
    """What is measured of a rotor at one state.

    Attributes
    ----------
    accelerations : (1 + blades,) rad/s².
    kinetic, potential : J; of weights and springs.
    tips : (blades, 3) m.
    loads : by name as a scene's, vectors (blades, 3), (3,), and (blades,).
    axes : (blades, 3, 3) rotation matrices of the blades.
    """

    accelerations: Array
    kinetic: float
    potential: float
    tips: Array
    loads: dict[str, Array]
    axes: Array


def turn(axis: int, angle: float) -> Array:
    """Return the right-handed rotation matrix about a coordinate axis."""
    c, s = math.cos(angle), math.sin(angle)
    first, second = (axis + 1) % 3, (axis + 2) % 3
    matrix = np.eye(3)
    matrix[[first, first, second, second], [first, second, first, second]] = c, -s, s, c
    return matrix


def blade_axes(scene: Scene, blade: int, angles: Array) -> Array:
    """Return the rotation matrix of a blade (from 0): its columns are the blade's axes in the base
    frame."""
    azimuth = angles[0] + 2.0 * math.pi * blade / len(scene.blades)
    leaning = turn(0, -scene.blades[blade].cone)
    return turn(0, scene.shaft_tilt) @ turn(1, azimuth) @ leaning @ turn(2, angles[1 + blade])


def measure(scene: Scene, angles: Array, rates: Array, time: float = 0.0) -> State:
    """Return accelerations, energies, tips and loads of a rotor at one state, its loads as at
    `time`."""
    count = len(scene.blades)
    shaft = turn(0, scene.shaft_tilt)[:, 1]
    rotations = [blade_axes(scene, i, angles) for i in range(count)]
    torque = value_at(scene.rotor_torque, time)
    torques = [value_at(table, time) for table in scene.pitch_torque or ((),) * count]
    rests = [value_at(table, time) for table in scene.bearing_rest or ((),) * count]
    stiffness, damping = (
        scene.bearing_stiffness or (0.0,) * count,
        scene.bearing_damping or (0.0,) * count,
    )
    actuators = (
        np.array(torques)
        - np.array(stiffness) * (angles[1:] - np.array(rests))
        - np.array(damping) * rates[1:]
    )

    def asked(accelerations: Array) -> tuple[list[tuple[Array, Array]], Array]:
        """Return forces and moments on the blades, and the moments on shaft and pitches that
        accelerations need."""
        of_blades, needed = [], np.zeros(1 + count)
        needed[0] = scene.hub_inertia * accelerations[0]
        for i, (blade, R) in enumerate(zip(scene.blades, rotations, strict=True)):
            axis = R[:, 2]
            omega = rates[0] * shaft + rates[1 + i] * axis
            alpha = accelerations[0] * shaft + accelerations[1 + i] * axis
            alpha = alpha + np.cross(rates[0] * shaft, rates[1 + i] * axis)
            of_blades.append(_load(blade, R, omega, alpha, scene.gravity))
            needed[0] += shaft @ of_blades[-1][1]
            needed[1 + i] = axis @ of_blades[-1][1]
        return of_blades, needed

    moving = [0, *(i for i, blade in enumerate(scene.blades, 1) if blade.has_pitch_inertia)]
    _, still = asked(np.zeros(1 + count))
    matrix = np.stack([asked(unit)[1] - still for unit in np.eye(1 + count)[moving]], axis=1)[
        moving
    ]
    driven = np.array([torque - scene.shaft_damping * rates[0], *actuators]) - still
    accelerations = np.zeros(1 + count)
    accelerations[moving] = np.linalg.solve(matrix, driven[moving])

    on_blades, _ = asked(accelerations)
    kinetic, potential = 0.5 * scene.hub_inertia * rates[0] ** 2, 0.0
    for i, (blade, R) in enumerate(zip(scene.blades, rotations, strict=True)):
        omega, r = rates[0] * shaft + rates[1 + i] * R[:, 2], R @ blade.centre_of_mass
        kinetic += 0.5 * blade.mass * float(np.sum(np.cross(omega, r) ** 2))
        kinetic += 0.5 * float((R.T @ omega) @ blade.inertia_tensor @ (R.T @ omega))
        potential += blade.mass * scene.gravity * float(r[2])
        potential += 0.5 * stiffness[i] * (angles[1 + i] - rests[i]) ** 2
    root = np.array([0.0, 0.0, scene.hub_radius])
    root_forces = [R.T @ force for R, (force, _) in zip(rotations, on_blades, strict=True)]
    root_moments = []
    for R, (_, moment), force in zip(rotations, on_blades, root_forces, strict=True):
        root_moments.append(R.T @ moment - np.cross(root, force))
    about_shaft = scene.hub_inertia * accelerations[0] - torque
    loads = {
        "blade_root_force": np.array(root_forces),
        "blade_root_moment": np.array(root_moments),
        "shaft_force": sum(force for force, _ in on_blades) + scene.hub_mass * scene.gravity * UP,
        "shaft_moment": sum(moment for _, moment in on_blades) + about_shaft * shaft,
        "pitch_actuator_moment": actuators,
    }
    tips = np.array([R @ blade.tip for R, blade in zip(rotations, scene.blades, strict=True)])
    return State(accelerations, kinetic, potential, tips, loads, np.array(rotations))


def _load(
    blade: Blade, R: Array, omega: Array, alpha: Array, gravity: float
) -> tuple[Array, Array]:
    """Return the force on a blade and its moment about the apex, base frame."""
    r = R @ blade.centre_of_mass
    inertia = R @ blade.inertia_tensor @ R.T
    acceleration = np.cross(alpha, r) + np.cross(omega, np.cross(omega, r))
    force = blade.mass * (acceleration + gravity * UP)
    moment = inertia @ alpha + np.cross(omega, inertia @ omega) + np.cross(r, force)
    return force, moment
