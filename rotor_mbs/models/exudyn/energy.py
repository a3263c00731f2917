"""Energy of the bearing springs, and the work of the loads."""

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


def springs(scene: Scene, angles: Array) -> tuple[Array, Array]:
    """(n,) J at the first n samples: energy ½ k (θ - r)² of the springs, and what `work` leaves out of the work -∫ k (θ
    - r) dr of rest angles r that move, jumps included: the change of ½ k r (r - 2θ); `work` has ∫ k r dθ."""
    energy, of_rests = np.zeros((2, len(angles)))
    for i in pitching(scene):
        stiffness, table = scene.bearing(i)[0], scene.pitch_load(i)[1]
        if stiffness:
            rest = values_at(table, sample_times(scene)[: len(angles)])
            energy += 0.5 * stiffness * (angles[:, 1 + i] - rest) ** 2
            if not is_constant(table):
                moved = 0.5 * stiffness * rest * (rest - 2.0 * angles[:, 1 + i])
                of_rests += moved - moved[:1]
    return energy, of_rests


def work(scene: Scene, segments: Sequence[Segment], time: Array, angles: Array, rates: Array) -> Array:
    """(n,) J of the torques less what the dampers took, from all rows, samples among them: s, rad, rad/s. A spring
    whose rest angle r changes counts as one that is unloaded at 0 and a torque k r; see `springs`."""
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


def cumulative_integral(time: Array, values: Array) -> Array:
    """(n,) integral from the first row to each row, by a local polynomial through the eight nearest rows, which need
    not be equally spaced; exact by Gauss-Legendre points."""
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
