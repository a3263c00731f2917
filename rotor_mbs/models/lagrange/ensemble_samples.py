"""Samples of many runs in arrays of their own, and a run's way into them. Knows no integrator and no equation."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from rotor_mbs.scenario.scene import Scene
from rotor_mbs.solution.record import Array, Integration, Trajectory
from rotor_mbs.solution.solution import Solution

_COLUMNS = ("angles", "rates", "tip", "kinetic_energy", "potential_energy", "work")


@dataclass
class Block:
    """Samples of k runs, NaN after a run broke off; what the scenes do not ask for is None.

    angles, rates   (k, n, 1 + blades) rad, rad/s
    tip             (k, n, blades, 3) m
    kinetic_energy, potential_energy, work   (k, n) J
    integrations           the engine's report of each run; samples: how many rows of each are finite
    """

    time: Array
    angles: Array
    rates: Array
    tip: Array | None
    kinetic_energy: Array | None
    potential_energy: Array | None
    work: Array | None
    integrations: list[Integration]
    samples: list[int]

    def trajectory(self, i: int) -> Trajectory:
        """Run i alone, cut where it broke off."""
        n = self.samples[i]
        found = Trajectory(self.time[i, :n], self.angles[i, :n], self.rates[i, :n])
        for name in ("tip", "kinetic_energy", "potential_energy", "work"):
            values = getattr(self, name)
            if values is not None:
                setattr(found, name, values[i, :n])
        return found


def empty_block(scenes: Sequence[Scene]) -> Block:
    """Room for their samples, all of which are to be put there."""
    first, runs = scenes[0], len(scenes)
    shape = (runs, first.samples)
    columns = 1 + len(first.blades)
    time = np.linspace(0.0, np.array([scene.duration for scene in scenes]), first.samples, axis=1)
    tip = np.empty((*shape, len(first.blades), 3)) if first.wants("tip") else None
    kinetic, potential, work = (np.empty(shape) if first.wants("energy") else None for _ in range(3))
    angles, rates = np.empty((*shape, columns)), np.empty((*shape, columns))
    integrations = [Integration(False)] * runs
    return Block(time, angles, rates, tip, kinetic, potential, work, integrations, [0] * runs)


def put_single(block: Block, i: int, run: Solution) -> None:
    """A run of its own as run i of the block."""
    n = len(run.trajectory.time)
    for name in _COLUMNS:
        values, target = getattr(run.trajectory, name), getattr(block, name)
        if target is not None and values is not None:
            target[i, :n], target[i, n:] = values, np.nan
    block.integrations[i], block.samples[i] = run.integration, n


def put(
    block: Block,
    places: Sequence[int],
    scenes: Sequence[Scene],
    moving: Sequence[int],
    states: Array,
    found: Array,
    integrations: Sequence[Integration],
) -> None:
    """Runs of one structure as runs `places` of the block; k of them.

    states   (variables, k, samples): of the equations, NaN after a run broke off
    found    (rows, k, samples): each blade's tip, x y z in m; then kinetic and potential energy in J, where asked for
    """
    count, length = len(moving), states.shape[2]
    where = _span(places)
    if count < block.angles.shape[2]:  # pitches that are fixed
        block.angles[where] = np.array([scene.initial_angles for scene in scenes])[:, None]
        block.rates[where] = 0.0
    for i, column in enumerate(moving):
        block.angles[where, :, column], block.rates[where, :, column] = states[i], states[count + i]
    rows = 0
    if block.tip is not None:
        tip = block.tip.reshape(len(block.tip), length, -1)
        rows = tip.shape[2]
        tip[where] = found[:rows].transpose(1, 2, 0)
    if block.kinetic_energy is not None and block.potential_energy is not None and block.work is not None:
        block.kinetic_energy[where], block.potential_energy[where] = found[rows], found[rows + 1]
        has_work = len(states) > 2 * count
        block.work[where] = states[2 * count] if has_work else _constant_work(scenes, states[0])
    samples = length - np.isnan(states[0]).sum(axis=1)
    for i, integration, n in zip(places, integrations, samples.tolist(), strict=True):
        if n < length:
            _cut(block, i, n)
        integration.time_reached = float(block.time[i, max(n - 1, 0)])
        block.integrations[i], block.samples[i] = integration, n


def _span(places: Sequence[int]) -> slice | list[int]:
    """Of runs that lie side by side, which NumPy finds faster than one by one."""
    first, last = places[0], places[-1]
    return slice(first, last + 1) if last - first == len(places) - 1 else list(places)


def _cut(block: Block, i: int, samples: int) -> None:
    """Some quantities stay finite after a run broke off: a fixed pitch, or a term that vanishes."""
    for name in _COLUMNS:
        values = getattr(block, name)
        if values is not None:
            values[i, samples:] = np.nan


def _constant_work(scenes: Sequence[Scene], angles: Array) -> Array:
    """Of constant torques: τ·(q2 - q2(0)), exact."""
    torques = np.array([scene.torque_at(0.0) for scene in scenes])
    work: Array = torques[:, None] * (angles - angles[:, :1])
    return work
