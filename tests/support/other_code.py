"""Trajectories by a code that is not the package's: Lagrange's equations of the rotor, typed anew,
under SciPy.

From positions in the base frame; nothing of the package but a scene's numbers. `Mistakes` are those
that people make.
"""

from __future__ import annotations

import functools
from collections.abc import Callable
from dataclasses import dataclass
from itertools import pairwise
from typing import Any

import numpy as np
from scipy.integrate import solve_ivp
from scipy.spatial.transform import Rotation
from scipy.special import ellipj

from rotor_mbs.scenario.scene import Blade, Scene

Array = Any


@dataclass(frozen=True)
class Mistakes:
    """phases: rad, in place of the right ones; coriolis: factor; e1, e2, e3: the paper's errata,
    for point masses."""

    phases: tuple[float, ...] = ()
    coriolis: float = 1.0
    e1: bool = False
    e2: bool = False
    e3: bool = False


NONE = Mistakes()


def trajectory(
    scene: Scene, times: Array, mistakes: Mistakes = NONE, rtol: float = 1e-11, atol: float = 1e-12
) -> tuple[Array, Array]:
    """(n, 1 + blades) angles and rates at `times`, from 0 on."""
    count = 1 + len(scene.blades)
    accelerations = _equations(scene, mistakes)
    state = np.array([*scene.initial_angles, *scene.initial_rates])
    tables = [scene.rotor_torque, *scene.pitch_torque, *scene.bearing_rest]
    kinks = [t for table in tables for t, _ in table if 0.0 < t < times[-1]]
    rows = [state[None, :]]
    for start, end in pairwise(sorted({0.0, *kinks, float(times[-1])})):
        inside = times[(times > start) & (times <= end)]
        asked = inside if len(inside) and inside[-1] == end else np.append(inside, end)

        def derivative(t: float, y: Array, start: float = start, end: float = end) -> Array:
            # a jump of the torque belongs to the interval that it begins
            shift = 1e-9 * (end - start)
            loads = [value_at(table, min(max(t, start + shift), end - shift)) for table in tables]
            return np.concatenate([y[count:], accelerations(loads, y[:count], y[count:])])

        run = solve_ivp(derivative, (start, end), state, "DOP853", asked, rtol=rtol, atol=atol)
        rows.append(run.y.T[: len(inside)])
        state = run.y[:, -1]
    found = np.concatenate(rows)[1:] if times[0] > 0.0 else np.concatenate(rows)
    return found[:, :count], found[:, count:]


def acceleration(scene: Scene, t: float, state: Array) -> Array:
    """(2 (1 + blades),) time derivative of angles and rates."""
    count = 1 + len(scene.blades)
    loads = [
        value_at(table, t)
        for table in (scene.rotor_torque, *scene.pitch_torque, *scene.bearing_rest)
    ]
    return np.concatenate(
        [state[count:], _equations(scene, NONE)(loads, state[:count], state[count:])]
    )


def loads(scene: Scene, times: Array, angles: Array, rates: Array) -> dict[str, Array]:
    """The loads of docs/loads.md by Newton's and Euler's laws in the base frame, from the
    accelerations above."""
    states = np.hstack([angles, rates])
    slopes = np.array(
        [acceleration(scene, t, state) for t, state in zip(times, states, strict=True)]
    )
    accelerations = slopes[:, angles.shape[1] :]
    shaft = np.array([0.0, 1.0, 0.0])
    roots, total_force, total_moment = [], 0.0, scene.hub_inertia * accelerations[:, :1] * shaft
    for i, blade in enumerate(scene.blades):
        frame = about("y", angles[:, 0] + scene.phases[i]) * about("z", angles[:, 1 + i])
        axis = frame.apply([0.0, 0.0, 1.0])
        spin, rate = rates[:, :1] * shaft, rates[:, 1 + i, None] * axis
        omega = spin + rate
        alpha = (
            accelerations[:, :1] * shaft
            + accelerations[:, 1 + i, None] * axis
            + np.cross(spin, rate)
        )
        r = frame.apply(blade.centre_of_mass)
        xx, yy, zz, xy, xz, yz = blade.inertia
        matrices = frame.as_matrix()
        tensor = (
            matrices
            @ np.array([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]])
            @ matrices.transpose(0, 2, 1)
        )
        force = blade.mass * (
            np.cross(alpha, r) + np.cross(omega, np.cross(omega, r)) + [0.0, 0.0, scene.gravity]
        )
        spun = np.einsum("nij,nj->ni", tensor, omega)
        moment = np.einsum("nij,nj->ni", tensor, alpha) + np.cross(omega, spun) + np.cross(r, force)
        roots.append((frame.inv().apply(force), frame.inv().apply(moment)))
        total_force, total_moment = total_force + force, total_moment + moment
    forces, moments = (np.stack(vectors, axis=1) for vectors in zip(*roots, strict=True))
    torque = np.array([value_at(scene.rotor_torque, t) for t in times])
    return {
        "blade_root_force": forces,
        "blade_root_moment": moments,
        "shaft_force": total_force,
        "shaft_moment": total_moment - torque[:, None] * shaft,
        "pitch_actuator_moment": moments[:, :, 2],
    }


def about(axis: str, angles: Array) -> Rotation:
    """Rotations by (n,) rad about an axis."""
    return Rotation.from_rotvec(np.outer(angles, np.eye(3)["xyz".index(axis)]))


def value_at(table: Array, t: Array) -> Array:
    """Of rows of (time, value), linear between; of two rows with one time the last counts there."""
    times, values = zip(*table, strict=True) if table else ((0.0,), (0.0,))
    return np.interp(t, times, values)


def _equations(scene: Scene, mistakes: Mistakes) -> Callable[[list[float], Array, Array], Array]:
    """(values of the loads, angles, rates) -> accelerations: pitches eliminated, arrays over the
    blades."""
    blades = scene.blades
    phases = np.array(
        mistakes.phases or [2.0 * np.pi * i / len(blades) for i in range(len(blades))]
    )
    m = np.array([blade.mass for blade in blades])
    x, y, z = np.array([blade.centre_of_mass for blade in blades]).T
    xx, yy, zz, xy, xz, yz = np.array([blade.inertia for blade in blades]).T
    k, d = (
        np.array(values or [0.0] * len(blades))
        for values in (scene.bearing_stiffness, scene.bearing_damping)
    )

    pitch_loads = len(scene.pitch_torque)

    def accelerations(loads: list[float], q: Array, w: Array) -> Array:
        torque, pitch_torque, rest = (
            loads[0],
            loads[1 : 1 + pitch_loads] or 0.0,
            loads[1 + pitch_loads :] or 0.0,
        )
        sp, cp, s, c = np.sin(q[0] + phases), np.cos(q[0] + phases), np.sin(q[1:]), np.cos(q[1:])
        # the centre of mass, across the blade and along the shaft
        u, v = x * c - y * s, x * s + y * c
        spin, rate, zero = w[0], w[1:], 0.0 * u
        # First and second derivatives of its position (cp u + sp z, v, cp z - sp u) by the angle φ
        # and the pitch θ.
        phi = [cp * z - sp * u, x * c if mistakes.e1 else zero, -cp * u - sp * z]
        theta = [-cp * v, u, sp * v]
        phi_phi = [-cp * u - sp * z, zero, sp * u - cp * z]
        phi_theta = [sp * v, -0.5 * x * s if mistakes.e1 else zero, cp * v]
        theta_theta = [-(sp if mistakes.e2 else cp) * u, -v, sp * u]
        a, a_slope = (
            xx * s * s + yy * c * c + 2.0 * xy * s * c,
            2.0 * (xx - yy) * s * c + 2.0 * xy * (c * c - s * s),
        )
        b, b_slope = xz * s + yz * c, xz * c - yz * s
        coriolis = mistakes.coriolis * spin * rate
        last = rate if mistakes.e3 else rate * rate
        on_rotor = -m * _dot(
            phi, _sum(phi_phi, spin**2, phi_theta, 2.0 * coriolis, theta_theta, rate**2)
        )
        on_pitch = -m * _dot(
            theta, _sum(phi_phi, spin**2, phi_theta, 2.0 * coriolis, theta_theta, last)
        )
        on_rotor -= m * scene.gravity * phi[2] + a_slope * coriolis + b_slope * rate**2
        on_pitch += (
            -m * scene.gravity * theta[2]
            + 0.5 * a_slope * spin**2
            - k * (q[1:] - rest)
            - d * rate
            + pitch_torque
        )
        coupling, pitch_inertia = m * _dot(phi, theta) + b, m * _dot(theta, theta) + zz
        inertia = scene.hub_inertia + np.sum(m * _dot(phi, phi) + a - coupling**2 / pitch_inertia)
        moment = (
            torque
            - scene.shaft_damping * spin
            + np.sum(on_rotor - coupling * on_pitch / pitch_inertia)
        )
        rotor = moment / inertia
        return np.concatenate([[rotor], (on_pitch - coupling * rotor) / pitch_inertia])

    return accelerations


def _dot(first: list[Array], second: list[Array]) -> Array:
    return sum(one * other for one, other in zip(first, second, strict=True))


def _sum(*terms: Any) -> list[Array]:
    """The weighted sum of vectors, given as vector, weight, vector, weight, ..."""
    return [
        sum(vector[i] * weight for vector, weight in zip(terms[::2], terms[1::2], strict=True))
        for i in range(3)
    ]


# Motion and energies


def about_hub(blade: Blade):
    """(3, 3) kg m² about the hub centre."""
    xx, yy, zz, xy, xz, yz = blade.inertia
    r = np.array(blade.centre_of_mass)
    com = np.array([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]])
    return com + blade.mass * (r @ r * np.eye(3) - np.outer(r, r))


@functools.cache
def closed_form(scene: Scene, duration: float | None = None):
    """(n, 2 (1 + blades)) angles and rates at the samples up to `duration`, by `other_code`."""
    times = np.linspace(0.0, scene.duration, scene.samples)
    times = times[times <= (duration or scene.duration) + 1e-12]
    return np.hstack(trajectory(scene, times, rtol=1e-13, atol=1e-14))


def energies(scene: Scene, y):
    """Kinetic and potential energy (n,) J of rows of angles and rates.

    T = J_hub q'²/2 + Σ ω·J ω/2 with ω = (q' sin θ, q' cos θ, θ') in the blade frame and J about the
    hub centre; V = Σ m g z + Σ k (θ - rest)²/2.
    """
    n = 1 + len(scene.blades)
    kinetic = 0.5 * scene.hub_inertia * y[:, n] ** 2
    potential = np.zeros(len(y))
    for i, blade in enumerate(scene.blades):
        theta, w, v = y[:, 1 + i], y[:, n], y[:, n + 1 + i]
        omega = np.stack([w * np.sin(theta), w * np.cos(theta), v], axis=1)
        kinetic += 0.5 * np.einsum("ni,ij,nj->n", omega, about_hub(blade), omega)
        potential += (
            blade.mass * scene.gravity * (blade_points(scene, y, i, blade.centre_of_mass)[:, 2])
        )
        if scene.bearing_stiffness:
            times = np.linspace(0.0, scene.duration, scene.samples)[: len(y)]
            rest = value_at(scene.bearing_rest[i] if scene.bearing_rest else (), times)
            potential += 0.5 * scene.bearing_stiffness[i] * (theta - rest) ** 2
    return kinetic, potential


def blade_points(scene: Scene, y, index: int, point):
    """(n, 3) m: Ry(q + phase) Rz(θ) point."""
    psi, theta = y[:, 0] + scene.phases[index], y[:, 1 + index]
    x = np.cos(theta) * point[0] - np.sin(theta) * point[1]
    across = np.sin(theta) * point[0] + np.cos(theta) * point[1]
    z = np.full_like(x, point[2])
    return np.stack(
        [np.cos(psi) * x + np.sin(psi) * z, across, -np.sin(psi) * x + np.cos(psi) * z], axis=1
    )


def pendulum(start: float, length: float, lean: float, gravity: float, t):
    """Angle of a pendulum released from rest at `start` from the top, its mass `lean` ahead of the
    angle told.

    φ = angle + lean - π swings as φ = 2 asin(k cd(t sqrt(g/l), k²)), k = sin(φ(0)/2).
    """
    k = np.sin(0.5 * (start + lean - np.pi))
    _, cn, dn, _ = ellipj(t * np.sqrt(gravity / length), k * k)
    return np.pi - lean + 2.0 * np.arcsin(k * cn / dn)
