"""Energy of the bearing springs, and the work of the loads.

Knows no engine and no equations of motion.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from rotor_mbs.models.exudyn.geometry import pitching
from rotor_mbs.models.exudyn.moments import ROTOR, drives
from rotor_mbs.scenario.scene import Scene
from rotor_mbs.scenario.time_table import Segment, is_constant, values_at
from rotor_mbs.solution.trajectory import Array, sample_times

# Points of the local polynomial that stands in for the power between rows.
_POINTS = 8


def spring_energy(scene: Scene, angles: Array) -> Array:
    """(n,) J of the bearing springs at the first n samples, from (n, 1 + blades) rad."""
    total = np.zeros(len(angles))
    if scene.bearing_stiffness:
        for i in pitching(scene):
            total += 0.5 * scene.bearing_stiffness[i] * (angles[:, 1 + i] - _rest(scene, i, angles)) ** 2
    return total


def _rest(scene: Scene, blade: int, angles: Array) -> Array:
    """(n,) rad at the first n samples."""
    return values_at(scene.pitch_load(blade)[1], sample_times(scene)[: len(angles)])


def work(scene: Scene, segments: Sequence[Segment], time: Array, angles: Array, rates: Array) -> Array:
    """(n,) J of the torques less what the dampers took, from rows of time s, angles rad, rates rad/s.

    A spring whose rest angle r changes counts as one that is unloaded at 0 and a torque k r; see `work_of_rests`.
    """
    if not scene.work_needs_path:
        turned, torques = angles - angles[:1], segments[0].values
        exact: Array = torques[ROTOR] * turned[:, 0]
        for column, load, _ in drives(scene):
            exact = exact + torques[load] * turned[:, column] if column else exact
        return exact
    losses = rates**2 @ np.array(scene.dampings)
    out, done = np.zeros(len(time)), 0.0
    slack = 1e-9 * scene.duration / (scene.samples - 1)
    for segment in segments:
        first, last = np.searchsorted(time, [segment.start - slack, segment.end + slack])
        if last - first < 2:
            break
        inside = slice(first, last)
        power = -losses[inside]
        for column, load, factor in drives(scene):
            power = power + factor * segment.at(load, time[inside]) * rates[inside, column]
        out[inside] = done + cumulative_integral(time[inside], power)
        done = out[last - 1]
    return out


def work_of_rests(scene: Scene, angles: Array) -> Array:
    """(n,) J: what `work` leaves out at the first n samples, from (n, 1 + blades) rad.

    With the spring's energy ½ k (θ - r)², a rest angle r that moves does the work -∫ k (θ - r) dr, jumps included.
    That is ∫ k r dθ, which `work` has, and the change of ½ k r (r - 2θ).
    """
    total = np.zeros(len(angles))
    for i in pitching(scene):
        if not is_constant(scene.pitch_load(i)[1]):
            rest = _rest(scene, i, angles)
            energy = 0.5 * scene.bearing_stiffness[i] * rest * (rest - 2.0 * angles[:, 1 + i])
            total += energy - energy[:1]
    return total


def cumulative_integral(time: Array, values: Array) -> Array:
    """(n,) integral from the first row to each row, by a local polynomial through the eight nearest rows.

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
