"""Compute tip paths, energies and exact solutions of a scene, without any model."""

from __future__ import annotations

import math

import numpy as np

from rotor_mbs.scenario.scene import Blade, Scene
from rotor_mbs.scenario.time_table import value_at, values_at
from rotor_mbs.solution.defects import row_blocks
from rotor_mbs.solution.trajectory import Array


def tip_paths(scene: Scene, angles: Array) -> Array:
    """Return the paths of the tips in the base frame, (n, blades, 3) m.

    Parameters
    ----------
    scene : the tilt of the shaft, and the azimuths, cones and tips of the blades are used.
    angles : (n, 1 + blades) rad, rotor first.
    """
    paths = np.empty((len(angles), len(scene.blades), 3))
    for rows in row_blocks(len(angles)):
        for i, blade in enumerate(scene.blades):
            paths[rows, i] = _rotated(_frames(scene, angles[rows], i), blade.tip)
    return paths


def kinetic_energy(scene: Scene, angles: Array, rates: Array) -> Array:
    """Return the kinetic energy of the blades and the hub, (n,) J.

    The energy of a blade is ½ m v² + ½ ω·I ω. The angular velocity is ω = q̇2 e_shaft + θ̇ e_z with
    the blade's z axis, the velocity of the centre of mass is v = ω × r, and I is the inertia about
    the centre of mass.

    Parameters
    ----------
    scene : the geometry of the rotor, the inertia of the hub, and the masses, centres of mass and
        inertias of the blades are used.
    angles, rates : (n, 1 + blades) rad and rad/s, rotor first.
    """
    energy = np.empty(len(angles))
    for rows in row_blocks(len(angles)):
        energy[rows] = _kinetic_energy(scene, angles[rows], rates[rows])
    return energy


def _kinetic_energy(scene: Scene, angles: Array, rates: Array) -> Array:
    """Return `kinetic_energy` of all rows at once."""
    total = 0.5 * scene.hub_inertia * rates[:, 0] ** 2
    for i, blade in enumerate(scene.blades):
        frames = _frames(scene, angles, i)
        omega = rates[:, 1 + i, None] * frames[:, :, 2]
        if scene.shaft_tilt:
            omega += rates[:, :1] * np.array(
                [0.0, math.cos(scene.shaft_tilt), math.sin(scene.shaft_tilt)]
            )
        else:
            omega[:, 1] += rates[:, 0]
        velocity = np.cross(omega, _rotated(frames, blade.centre_of_mass))
        tensor = blade.inertia_tensor
        own = np.einsum("nij,ni->nj", frames, omega)  # ω in the blade's frame
        total = (
            total
            + 0.5 * blade.mass * (velocity**2).sum(axis=1)
            + 0.5 * np.einsum("ni,ij,nj->n", own, tensor, own)
        )
    return total


def potential_energy(scene: Scene, time: Array, angles: Array) -> Array:
    """Return the potential energy of weights and bearing springs, (n,) J.

    A weight has no potential energy at the height of the apex. The spring of a pitch without
    inertia is left out, because this pitch does not move.

    Parameters
    ----------
    scene : gravity, blades and bearings are used.
    time : (n,) s, at which rest angles that change over time are evaluated.
    angles : (n, 1 + blades) rad, rotor first.
    """
    energy = np.empty(len(angles))
    for rows in row_blocks(len(angles)):
        energy[rows] = _potential_energy(scene, time[rows], angles[rows])
    return energy


def _potential_energy(scene: Scene, time: Array, angles: Array) -> Array:
    """Return `potential_energy` of all rows at once."""
    total = np.zeros(len(angles))
    for i, blade in enumerate(scene.blades):
        total += (
            blade.mass
            * scene.gravity
            * _rotated(_frames(scene, angles, i), blade.centre_of_mass)[:, 2]
        )
        if scene.bearing_stiffness and blade.has_pitch_inertia:
            rest = values_at(scene.pitch_loads[i][1], time)
            total += 0.5 * scene.bearing_stiffness[i] * (angles[:, 1 + i] - rest) ** 2
    return total


def work_of_constant_loads(scene: Scene, angles: Array) -> Array | None:
    """Return the work of constant loads, (n,) J; None if the work is no function of the angles.

    The work depends on more than the angles if a load changes over time, or if there is damping.

    Parameters
    ----------
    scene : the torques and the initial angles are used.
    angles : (n, 1 + blades) rad, rotor first.
    """
    if scene.has_damping or not scene.has_constant_loads:
        return None
    torques = [scene.torque_at(0.0), *(value_at(torque, 0.0) for torque, _ in scene.pitch_loads)]
    return np.asarray((angles - np.array(scene.initial_angles)) @ np.array(torques))


def _frames(scene: Scene, angles: Array, blade: int) -> Array:
    """Return the rotation matrices of a blade, Rx(tilt) Ry(q2 + phase) Rx(-cone) Rz(θ), (n, 3, 3).

    The columns of a matrix are the blade's axes in the base frame.

    Parameters
    ----------
    scene : the tilt of the shaft, and the phase and the cone of the blade are used.
    angles : (n, 1 + blades) rad, rotor first.
    blade : number of the blade, from 0.
    """
    azimuth, pitch = angles[:, 0] + scene.phases[blade], angles[:, 1 + blade]
    s, c, sp, cp = np.sin(azimuth), np.cos(azimuth), np.sin(pitch), np.cos(pitch)
    zero = np.zeros_like(s)
    if scene.has_tilt_or_cone:
        about_shaft = np.array([[c, zero, s], [zero, zero + 1.0, zero], [-s, zero, c]])
        about_pitch = np.array([[cp, -sp, zero], [sp, cp, zero], [zero, zero, zero + 1.0]])
        tilt, cone = _about_x(scene.shaft_tilt), _about_x(-scene.blades[blade].cone)
        return np.asarray(np.einsum("ij,jkn,kl,lmn->nim", tilt, about_shaft, cone, about_pitch))
    x_axis, y_axis, z_axis = (c * cp, sp, -s * cp), (-c * sp, cp, s * sp), (s, zero, c)
    return np.stack([np.stack(axis, axis=1) for axis in (x_axis, y_axis, z_axis)], axis=2)


def _about_x(angle: float) -> Array:
    """Return the matrix of a right-handed rotation about x by an angle (rad), (3, 3)."""
    c, s = math.cos(angle), math.sin(angle)
    return np.array([[1.0, 0.0, 0.0], [0.0, c, -s], [0.0, s, c]])


def _rotated(frames: Array, point: tuple[float, float, float]) -> Array:
    """Return a point that is given in a blade's frame, in the base frame, (n, 3) m."""
    return np.asarray(frames @ np.array(point))


def exact_rotor_angle(scene: Scene, time: Array) -> tuple[str, Array] | None:
    """Return the name of an exact solution and its rotor angle; None if no solution is known.

    Exact solutions are known for two kinds of rotors, if every pitch stays at zero:

    - One blade that is released at rest is a pendulum (elliptic functions; Abramowitz & Stegun
      22.2).
    - Several equal blades are in balance, so that gravity has no moment about the shaft. A constant
      torque τ gives the rotor angle q0 + Ω0 t + τ t² / (2 I).

    On a tilted shaft, gravity turns the pitch of a blade whose centre of mass is off its pitch
    axis. With a cone, the rotation of the rotor turns a pitch that has inertia. No solution is
    known in these two cases.

    Parameters
    ----------
    scene : the scene.
    time : (n,) s.

    Returns
    -------
    str
        "pendulum", "constant torque", "uniform rotation" or "rest".
    ndarray
        Rotor angle, (n,) rad.
    """
    # A pitch stays at zero if the blade is symmetric about its own x-z plane and no load acts on
    # the pitch. No exact solution is known if the shaft has damping.
    mirrored = all(
        b.centre_of_mass[1] == 0.0 and b.inertia[3] == 0.0 and b.inertia[5] == 0.0
        for b in scene.blades
    )
    at_zero = not any(scene.initial_angles[1:]) and not any(scene.initial_rates[1:])
    driven = any(table for tables in scene.pitch_loads for table in tables)
    if not mirrored or not at_zero or driven or scene.shaft_damping:
        return None
    weighs = scene.gravity != 0.0 and any(blade.centre_of_mass[0] for blade in scene.blades)
    if (scene.shaft_tilt and weighs) or any(
        blade.cone and blade.has_pitch_inertia for blade in scene.blades
    ):
        return None
    if len(scene.blades) == 1:
        return _pendulum(scene, time)
    if any(blade != scene.blades[0] for blade in scene.blades) or not scene.has_constant_torque:
        return None
    inertia = scene.hub_inertia + sum(_inertia_at_zero_pitch(blade) for blade in scene.blades)
    torque = scene.torque_at(0.0)
    angle = (
        scene.initial_angles[0] + scene.initial_rates[0] * time + torque * time**2 / (2.0 * inertia)
    )
    return (
        "constant torque" if torque else "uniform rotation" if scene.initial_rates[0] else "rest"
    ), angle


def _inertia_at_zero_pitch(blade: Blade) -> float:
    """Return a blade's inertia about the shaft at zero pitch, kg m².

    Without a cone it is the inertia about the blade's own y axis. A blade with a cone has no
    inertia about its pitch axis: it is a thin rod that is inclined by the cone.
    """
    yy: float = blade.inertia_about_apex()[1]
    return yy * math.cos(blade.cone) ** 2 if blade.cone else yy


def _pendulum(scene: Scene, time: Array) -> tuple[str, Array] | None:
    """Return "pendulum" and the rotor angle by elliptic functions, (n,) rad.

    None is returned for a rotor that is driven, turns at the start or has no restoring moment, or
    whose centre of mass is half a turn or more from straight down at the start.

    Parameters
    ----------
    scene : a scene with one blade.
    time : (n,) s.
    """
    from scipy.special import ellipj, ellipk

    blade = scene.blades[0]
    x, _, z = blade.centre_of_mass
    arm, lead = math.hypot(x, z), math.atan2(x, z)
    # Only gravity normal to the shaft and the distance from the shaft have an effect.
    if scene.has_tilt_or_cone:
        arm *= math.cos(scene.shaft_tilt) * math.cos(blade.cone)
    if scene.has_torque or scene.initial_rates[0] or not scene.gravity or not arm:
        return None
    frequency = math.sqrt(
        blade.mass * scene.gravity * arm / (scene.hub_inertia + _inertia_at_zero_pitch(blade))
    )
    amplitude = math.pi - (scene.initial_angles[0] + lead)  # initial angle from straight down
    if not -math.pi < amplitude < math.pi:
        return None
    # The pendulum starts at rest, a quarter of a period (ellipk) before it passes straight down.
    modulus = math.sin(amplitude / 2.0)
    sn = ellipj(ellipk(modulus**2) - frequency * time, modulus**2)[0]
    return "pendulum", math.pi - 2.0 * np.arcsin(modulus * sn) - lead
