"""Balances of momentum, from a run's own samples, independent of its equations of motion and
energies: about the shaft L(t) - L(0) = ∫ (torque + moment of the weights - damping) dt; in space
p(t) - p(0) = ∫ (force of the bearing + weights) dt."""

from __future__ import annotations

import functools
from typing import NamedTuple

import numpy as np

from rotor_mbs.scenario.scene import Blade, Scene
from rotor_mbs.solution.trajectory import Array, Trajectory

# Samples that one polynomial goes through; a narrower one shows how much is left open between
# samples.
_POINTS_WITH_SLOPES = (6, 4)
_POINTS_WITHOUT_SLOPES = (10, 8)
# How many times that difference counts: at a spike both polynomials are off.
_SLACK = 10.0
# rad: a motion that turns further from one sample to the next is not resolved by them.
_MAX_TURN_PER_SAMPLE = 1.0


class Balance(NamedTuple):
    error: Array  # (n,) kg m²/s or kg m/s, beyond what the samples leave open
    scale: float  # what it is relative to

    @property
    def largest(self) -> float:
        """The largest error relative to the scale, or the error itself where the scale is zero."""
        return float(self.error.max()) / (self.scale or 1.0)


def angular_balance(scene: Scene, run: Trajectory) -> Balance | None:
    """About the shaft, relative to the largest momentum, the torque's impulse, and what the weights
    give in a fall. None where the samples do not resolve the motion, or are too few to show what
    they leave open."""
    if len(run.time) < max(_POINTS_WITH_SLOPES) or not _is_resolved(scene, run):
        return None
    angles, rates, step = run.angles, run.rates, run.time[1]
    moment, change = np.zeros((2, len(run.time)))
    for i, blade in enumerate(scene.blades):
        position, velocity = _centre(scene, angles, rates, i)
        moment += blade.mass * scene.gravity * position[:, 0]
        change += blade.mass * scene.gravity * velocity[:, 0]
    momentum, torque = angular_momentum(scene, angles, rates), _torque_impulse(scene, run.time)
    wide, narrow = (_impulse(step, moment, change, points) for points in _POINTS_WITH_SLOPES)
    residual = (
        momentum - momentum[0] - torque + scene.shaft_damping * (angles[:, 0] - angles[0, 0]) - wide
    )
    fall = sum(
        blade.mass * _arm(blade) * np.sqrt(scene.gravity * _arm(blade)) for blade in scene.blades
    )
    return Balance(
        _beyond(residual, wide - narrow),
        float(np.abs(momentum).max() + np.abs(torque).max() + fall),
    )


def linear_balance(scene: Scene, run: Trajectory) -> Balance | None:
    """In space, relative to the largest momentum and what the weights give in a fall. None where
    the run has no force of the bearing, where a load has a kink (the force jumps there), or as for
    `angular_balance`, oscillations of a stiff bearing among the motion."""
    force = run.get("shaft_force")
    if force is None or len(run.time) < max(_POINTS_WITHOUT_SLOPES) or scene.kink_times:
        return None
    # rad/s: the largest natural frequency of a blade on the spring of its bearing.
    frequencies = [
        np.sqrt(stiffness / blade.pitch_inertia)
        for blade, (stiffness, _) in zip(scene.blades, scene.bearings, strict=True)
        if blade.has_pitch_inertia
    ]
    if not _is_resolved(scene, run, max(frequencies, default=0.0)):
        return None
    momentum, mass = np.zeros(force.shape), sum(blade.mass for blade in scene.blades)
    for i, blade in enumerate(scene.blades):
        momentum += blade.mass * _centre(scene, run.angles, run.rates, i)[1]
    weights = np.array([0.0, 0.0, mass * scene.gravity])
    wide, narrow = (
        _impulse(run.time[1], force - weights, None, points) for points in _POINTS_WITHOUT_SLOPES
    )
    residual = np.linalg.norm(momentum - momentum[0] - wide, axis=1)
    fall = sum(blade.mass * np.sqrt(scene.gravity * _arm(blade)) for blade in scene.blades)
    scale = float(np.linalg.norm(momentum, axis=1).max() + fall)
    return Balance(_beyond(residual, np.linalg.norm(wide - narrow, axis=1)), scale)


def _is_resolved(scene: Scene, run: Trajectory, frequency: float = 0.0) -> bool:
    """Whether little happens from sample to sample: at the run's rates, and at a frequency in
    rad/s."""
    step = scene.duration / (scene.samples - 1)
    return len(run.time) > 1 and bool(
        max(np.abs(run.rates).max(), frequency) * step < _MAX_TURN_PER_SAMPLE
    )


def _beyond(residual: Array, uncertainty: Array) -> Array:
    """(n,) the part of a residual that the samples' uncertainty does not explain."""
    return np.maximum(np.abs(residual) - _SLACK * np.maximum.accumulate(np.abs(uncertainty)), 0.0)


def _arm(blade: Blade) -> float:
    return float(np.linalg.norm(blade.centre_of_mass))


def _torque_impulse(scene: Scene, times: Array) -> Array:
    """(n,) N m s of the rotor torque from the first of `times` (s) to each; exact."""
    kinks = [time for time, _ in scene.rotor_torque if times[0] < time < times[-1]]
    ends = np.unique(np.concatenate([times, kinks]))
    middle = 0.5 * (ends[1:] + ends[:-1])
    torque = np.array([scene.torque_at(time) for time in middle.tolist()])
    total = np.concatenate([[0.0], np.cumsum(torque * np.diff(ends))])
    return np.asarray(total[np.searchsorted(ends, times)])


def angular_momentum(scene: Scene, angles: Array, rates: Array) -> Array:
    """(n,) kg m²/s about the shaft, from (n, 1 + blades) rad and rad/s: L = J_hub Ω + Σ e·(J ω), e
    the shaft's direction and ω the blade's angular velocity, both in the blade's own frame."""
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
    r = np.array(blade.centre_of_mass)
    return np.asarray(blade.inertia_tensor + blade.mass * (r @ r * np.eye(3) - np.outer(r, r)))


def _centre(scene: Scene, angles: Array, rates: Array, blade: int) -> tuple[Array, Array]:
    """(n, 3) m and m/s: position and velocity of a blade's centre of mass in the base frame."""
    x, y, z = scene.blades[blade].centre_of_mass
    s, c = np.sin(angles[:, 1 + blade]), np.cos(angles[:, 1 + blade])
    azimuth = angles[:, 0] + scene.phases[blade]
    sin_phi, cos_phi = np.sin(azimuth), np.cos(azimuth)
    across, along = x * c - y * s, x * s + y * c
    position = np.stack(
        [cos_phi * across + sin_phi * z, along, cos_phi * z - sin_phi * across], axis=1
    )
    spin, rate = rates[:, 0], rates[:, 1 + blade]
    by_pitch = np.stack([-cos_phi * along, across, sin_phi * along], axis=1)
    by_rotor = np.stack([position[:, 2], np.zeros_like(spin), -position[:, 0]], axis=1)
    return position, spin[:, None] * by_rotor + rate[:, None] * by_pitch


@functools.cache
def _interval_weights(points: int, interval: int, *, with_slopes: bool) -> tuple[Array, Array]:
    """Weights of values and slopes at the nodes 0 ... points - 1 in the integral from `interval` to
    the next node, of the polynomial through all of them; exact by Gauss's points."""
    nodes = np.arange(points, dtype=float)
    abscissae, gauss = np.polynomial.legendre.leggauss(points)
    at, gauss = interval + 0.5 + 0.5 * abscissae, 0.5 * gauss
    gaps = nodes[:, None] - nodes + np.eye(points)
    basis = np.array(
        [
            np.prod((at[:, None] - np.delete(nodes, j)) / np.delete(gaps[j], j), axis=1)
            for j in range(points)
        ]
    )
    if not with_slopes:
        return basis @ gauss, np.zeros(points)
    slopes = (1.0 / gaps - np.eye(points)).sum(axis=1)  # of each basis polynomial at its own node
    away = at - nodes[:, None]
    squares = basis * basis
    return ((1.0 - 2.0 * away * slopes[:, None]) * squares) @ gauss, (away * squares) @ gauss


def _impulse(step: float, values: Array, slopes: Array | None, points: int) -> Array:
    """(n, ...) integral from the first of n samples, `step` s apart, to each; slopes: their time
    derivatives."""
    n = len(values)
    points = min(points, n)
    first = np.clip(np.arange(n - 1) - (points // 2 - 1), 0, n - points)
    parts = np.zeros((n - 1, *values.shape[1:]))
    for interval in range(points - 1):
        chosen = np.flatnonzero(np.arange(n - 1) - first == interval)
        of_values, of_slopes = _interval_weights(points, interval, with_slopes=slopes is not None)
        for node in range(points):
            parts[chosen] += step * of_values[node] * values[first[chosen] + node]
            if slopes is not None:
                parts[chosen] += step * step * of_slopes[node] * slopes[first[chosen] + node]
    return np.concatenate([np.zeros((1, *values.shape[1:])), np.cumsum(parts, axis=0)])
