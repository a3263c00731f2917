"""Energy of the bearing springs, and the work done on the rotor.

Knows no engine and no equations of motion.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from rotor_mbs.models.exudyn.geometry import pitching
from rotor_mbs.models.exudyn.timetable import TorqueSegment
from rotor_mbs.scenario.scene import Scene
from rotor_mbs.solution.record import Array

# Points of the local polynomial that stands in for the power between rows.
_POINTS = 6


def spring_energy(scene: Scene, angles: Array) -> Array:
    """(n,) J of the bearing springs, from (n, 1 + blades) rad."""
    total = np.zeros(len(angles))
    if scene.bearing_stiffness:
        for i in pitching(scene):
            total += 0.5 * scene.bearing_stiffness[i] * angles[:, 1 + i] ** 2
    return total


def work_needs_rows(scene: Scene) -> bool:
    """Whether the work has to be integrated along the path: it is exact for a constant torque without dampers."""
    return scene.has_damping or (scene.has_torque and not scene.has_constant_torque)


def work(scene: Scene, segments: Sequence[TorqueSegment], time: Array, angles: Array, rates: Array) -> Array:
    """(n,) J of the rotor torque less what the dampers took, from rows of time s, angles rad, rates rad/s."""
    if not work_needs_rows(scene):
        exact: Array = scene.torque_at(0.0) * (angles[:, 0] - angles[:1, 0])
        return exact
    losses = _losses(scene, rates)
    out, done = np.zeros(len(time)), 0.0
    slack = 1e-9 * scene.duration / (scene.samples - 1)
    for segment in segments:
        first, last = np.searchsorted(time, [segment.start - slack, segment.end + slack])
        if last - first < 2:
            break
        inside = slice(first, last)
        power = segment.at(time[inside]) * rates[inside, 0] - losses[inside]
        out[inside] = done + cumulative_integral(time[inside], power)
        done = out[last - 1]
    return out


def _losses(scene: Scene, rates: Array) -> Array:
    """(n,) W turned into heat."""
    losses = scene.shaft_damping * rates[:, 0] ** 2
    if scene.bearing_damping:
        for i in pitching(scene):
            losses = losses + scene.bearing_damping[i] * rates[:, 1 + i] ** 2
    return losses


def cumulative_integral(time: Array, values: Array) -> Array:
    """(n,) integral from the first row to each row, by a local polynomial through the six nearest rows.

    Rows need not be equally spaced; the polynomial is integrated exactly by Gauss-Legendre points.
    """
    points = min(_POINTS, len(time))
    first = np.clip(np.arange(len(time) - 1) - (points // 2 - 1), 0, len(time) - points)
    window = first[:, None] + np.arange(points)
    nodes, known = time[window], values[window]
    abscissae, weights = np.polynomial.legendre.leggauss((points + 1) // 2)
    half = 0.5 * np.diff(time)
    at = (time[:-1] + half)[:, None] + half[:, None] * abscissae
    polynomial = np.zeros_like(at)
    for j in range(points):
        basis = np.ones_like(at)
        for k in range(points):
            if k != j:
                basis *= (at - nodes[:, k, None]) / (nodes[:, j] - nodes[:, k])[:, None]
        polynomial += basis * known[:, j, None]
    return np.concatenate([[0.0], np.cumsum(half * (polynomial @ weights))])
