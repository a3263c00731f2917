"""Loads of the closed form by Newton's and Euler's laws, from its own accelerations: roots, shaft bearing, actuators.

Symbols, in the frame of a blade with azimuth φ and pitch θ: s = sin θ, c = cos θ; angular velocity
ω = (Ω s, Ω c, θ̇) and acceleration α = dω/dt; centre of mass r, inertia I about it; up = the base frame's z.
F = m (α × r + ω × (ω × r) + g up),  M = I α + ω × I ω + r × F: of the hub on the blade, about the hub centre.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from rotor_mbs.models.lagrange import closed_form
from rotor_mbs.models.lagrange.closed_form import Function, load_values
from rotor_mbs.models.lagrange.heyoka_adapter import quad_arithmetic
from rotor_mbs.models.lagrange.parameters import Convert, load_segments, phase_of, rotor_form
from rotor_mbs.scenario.scene import Blade, Scene
from rotor_mbs.scenario.time_table import values_before
from rotor_mbs.solution.quantities import named_loads
from rotor_mbs.solution.trajectory import Array, all_coordinates

# (n,) or (n, 3) numbers of one kind: doubles, or quad numbers as objects.
Numbers = Any


def sampled_loads(scene: Scene, times: Array, angles: Array, rates: Array) -> dict[str, Array]:
    """The load quantities at (n,) times in s, in double precision; angles and rates (n, 1 + blades) rad, rad/s."""
    with np.errstate(all="ignore"):  # near a singularity; what is not finite cuts the run
        return _loads(scene, times, angles, rates, float, np.sin, np.cos)


def quad_loads(scene: Scene, times: Array, states: Any) -> dict[str, Array]:
    """The loads in quad precision, rounded at the end; states (n, 2 × moving coordinates): angles, then rates."""
    count = len(scene.moving_coordinates)
    states = states.astype(object)
    angles, rates = all_coordinates(scene, states[:, :count], states[:, count : 2 * count])
    return _loads(scene, times, angles, rates, *quad_arithmetic())


def _loads(
    scene: Scene, times: Array, angles: Numbers, rates: Numbers, convert: Convert, sin: Function, cos: Function
) -> dict[str, Array]:
    moving, applied = scene.moving_coordinates, values_before(load_segments(scene), times)
    accelerations = np.zeros_like(angles)
    of_moving = closed_form.accelerations(
        angles[:, moving].T, rates[:, moving].T, rotor_form(scene, convert), load_values(list(applied)), sin, cos
    )
    for column, values in zip(moving, of_moving, strict=True):
        accelerations[:, column] = values
    actuators = np.zeros_like(angles[:, 1:])
    for i, column in enumerate(moving[1:], start=1):
        (stiffness, damping), torque, rest = scene.bearing(column - 1), applied[i], applied[len(moving) - 1 + i]
        actuators[:, column - 1] = torque - stiffness * (angles[:, column] - rest) - damping * rates[:, column]
    sin_q, cos_q = sin(angles[:, 0]), cos(angles[:, 0])
    roots, in_base = [], []
    for i, blade in enumerate(scene.blades):
        cos_phase, sin_phase = map(convert, phase_of(i, len(scene.blades)))
        azimuth = sin_q * cos_phase + cos_q * sin_phase, cos_q * cos_phase - sin_q * sin_phase
        pitch = sin(angles[:, 1 + i]), cos(angles[:, 1 + i])
        turning = rates[:, 0], rates[:, 1 + i], accelerations[:, 0], accelerations[:, 1 + i]
        roots.append(root_load(blade, azimuth, pitch, turning, scene.gravity))
        in_base.append([_in_base_frame(vectors, azimuth, pitch) for vectors in roots[-1]])
    shaft_force, shaft_moment = (sum(vectors) for vectors in zip(*in_base, strict=True))
    shaft_moment[:, 1] += scene.hub_inertia * accelerations[:, 0] - applied[0]
    return named_loads(roots, shaft_force, shaft_moment, actuators)


def root_load(
    blade: Blade,
    azimuth: tuple[Numbers, Numbers],
    pitch: tuple[Numbers, Numbers],
    turning: tuple[Numbers, Numbers, Numbers, Numbers],
    gravity: float,
) -> tuple[Numbers, Numbers]:
    """(n, 3) force and moment in the blade's frame, from (n,) sine and cosine of azimuth and pitch; turning: Ω, θ̇,
    dΩ/dt, dθ̇/dt."""
    (sin_phi, cos_phi), (s, c) = azimuth, pitch
    spin, rate, spin_rate, rate_rate = turning
    omega = np.stack([spin * s, spin * c, rate], axis=1)
    alpha = np.stack([spin_rate * s + spin * rate * c, spin_rate * c - spin * rate * s, rate_rate], axis=1)
    up = np.stack([-sin_phi * c, sin_phi * s, cos_phi], axis=1)
    r, inertia = np.array(blade.centre_of_mass), blade.inertia_tensor
    force = blade.mass * (np.cross(alpha, r) + np.cross(omega, np.cross(omega, r)) + gravity * up)
    return force, alpha @ inertia + np.cross(omega, omega @ inertia) + np.cross(r, force)


def _in_base_frame(vectors: Numbers, azimuth: tuple[Numbers, Numbers], pitch: tuple[Numbers, Numbers]) -> Numbers:
    """(n, 3): Ry(φ)·Rz(θ)·vector."""
    (sin_phi, cos_phi), (s, c), (x, y, z) = azimuth, pitch, vectors.T
    across = x * c - y * s
    return np.stack([cos_phi * across + sin_phi * z, x * s + y * c, cos_phi * z - sin_phi * across], axis=1)
