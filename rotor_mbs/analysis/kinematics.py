"""Tip paths and energies by plain rotation of the scene's bodies: computed again, independently of all models."""

from __future__ import annotations

import numpy as np

from rotor_mbs.scenario.scene import Scene
from rotor_mbs.scenario.time_table import value_at
from rotor_mbs.solution.trajectory import Array


def tip_paths(scene: Scene, angles: Array) -> Array:
    """(n, blades, 3) m, base frame, of (n, 1 + blades) rad."""
    return np.stack([_rotated(_frames(scene, angles, i), blade.tip) for i, blade in enumerate(scene.blades)], axis=1)


def kinetic_energy(scene: Scene, angles: Array, rates: Array) -> Array:
    """(n,) J: ½ m v² + ½ ω·I ω of every blade, v = ω × r and ω = q̇2 e_y + θ̇ e_z(blade), and of the hub."""
    total = 0.5 * scene.hub_inertia * rates[:, 0] ** 2
    for i, blade in enumerate(scene.blades):
        frames = _frames(scene, angles, i)
        omega = rates[:, 1 + i, None] * frames[:, :, 2]
        omega[:, 1] += rates[:, 0]
        velocity = np.cross(omega, _rotated(frames, blade.centre_of_mass))
        xx, yy, zz, xy, xz, yz = blade.inertia
        tensor = np.array([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]])
        own = np.einsum("nij,ni->nj", frames, omega)  # ω in the blade's frame
        total = total + 0.5 * blade.mass * (velocity**2).sum(axis=1) + 0.5 * np.einsum("ni,ij,nj->n", own, tensor, own)
    return total


def potential_energy(scene: Scene, time: Array, angles: Array) -> Array:
    """(n,) J: of weights, zero at the shaft's height, and of bearing springs (a pitch that cannot move has none).

    time (n,) s, for rest angles that move
    """
    total = np.zeros(len(angles))
    for i, blade in enumerate(scene.blades):
        total += blade.mass * scene.gravity * _rotated(_frames(scene, angles, i), blade.centre_of_mass)[:, 2]
        if scene.bearing_stiffness and blade.has_pitch_inertia:
            rest = np.array([value_at(scene.pitch_load(i)[1], t) for t in time.tolist()])
            total += 0.5 * scene.bearing_stiffness[i] * (angles[:, 1 + i] - rest) ** 2
    return total


def work_of_constant_loads(scene: Scene, angles: Array) -> Array | None:
    """(n,) J; None where a load changes or there is damping: there the work is no function of the angles."""
    if scene.work_needs_path:
        return None
    torques = [scene.torque_at(0.0), *(value_at(scene.pitch_load(i)[0], 0.0) for i in range(len(scene.blades)))]
    return np.asarray((angles - np.array(scene.initial_angles)) @ np.array(torques))


def _frames(scene: Scene, angles: Array, blade: int) -> Array:
    """(n, 3, 3) Ry(q2 + phase) Rz(θ): columns are the blade's axes in the base frame."""
    azimuth, pitch = angles[:, 0] + scene.phases[blade], angles[:, 1 + blade]
    s, c, sp, cp = np.sin(azimuth), np.cos(azimuth), np.sin(pitch), np.cos(pitch)
    zero = np.zeros_like(s)
    x_axis, y_axis, z_axis = (c * cp, sp, -s * cp), (-c * sp, cp, s * sp), (s, zero, c)
    return np.stack([np.stack(axis, axis=1) for axis in (x_axis, y_axis, z_axis)], axis=2)


def _rotated(frames: Array, point: tuple[float, float, float]) -> Array:
    """(n, 3) m."""
    return np.asarray(frames @ np.array(point))
