"""Samples of many runs in arrays of their own, and a run's way into them. Knows no integrator and no equation."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from rotor_mbs.scenario.scene import Scene
from rotor_mbs.trajectory.record import Array, Integration, Run, Trajectory

_COLUMNS = ("angles", "rates", "tip", "kinetic_energy", "potential_energy", "work")


@dataclass
class Block:
    """Samples of k runs, NaN after a run broke off; what the scenes do not ask for is None.

    angles, rates   (k, n, 1 + blades) rad, rad/s
    tip             (k, n, blades, 3) m
    kinetic_energy, potential_energy, work   (k, n) J
    words           the engine's word on each run; samples: how many rows of each are finite
    """

    time: Array
    angles: Array
    rates: Array
    tip: Array | None
    kinetic_energy: Array | None
    potential_energy: Array | None
    work: Array | None
    words: list[Integration]
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
    words = [Integration(False)] * runs
    return Block(time, angles, rates, tip, kinetic, potential, work, words, [0] * runs)


def put_single(block: Block, i: int, run: Run) -> None:
    """A run of its own as run i of the block."""
    n = len(run.trajectory.time)
    for name in _COLUMNS:
        values, target = getattr(run.trajectory, name), getattr(block, name)
        if target is not None and values is not None:
            target[i, :n], target[i, n:] = values, np.nan
    block.words[i], block.samples[i] = run.integration, n


def put_lane(
    block: Block, i: int, scene: Scene, moving: tuple[int, ...], states: Array, found: Array, word: Integration
) -> None:
    """A run as run i of the block.

    states   (variables, samples): of the equations, NaN after it broke off
    found    (rows, samples): each blade's tip, x y z in m; then kinetic and potential energy in J, where asked for
    """
    count, columns = len(moving), list(moving)
    broken = np.isnan(states[0])
    if len(columns) < block.angles.shape[2]:  # pitches that are held
        block.angles[i], block.rates[i] = scene.initial_angles, 0.0
    block.angles[i][:, columns] = states[:count].T
    block.rates[i][:, columns] = states[count : 2 * count].T
    rows = 0
    if block.tip is not None:
        tip = block.tip[i].reshape(len(broken), -1)
        rows = tip.shape[1]
        tip[:] = found[:rows].T
    if block.kinetic_energy is not None and block.potential_energy is not None and block.work is not None:
        block.kinetic_energy[i], block.potential_energy[i] = found[rows], found[rows + 1]
        has_work = len(states) > 2 * count
        block.work[i] = states[2 * count] if has_work else _constant_work(scene, states[0])
    samples = len(broken) - int(broken.sum())
    if samples < len(broken):  # some numbers do not feel it: what is held, or a term that vanishes
        for name in _COLUMNS:
            values = getattr(block, name)
            if values is not None:
                values[i, samples:] = np.nan
    word.time_reached = float(block.time[i, max(samples - 1, 0)])
    block.words[i], block.samples[i] = word, samples


def _constant_work(scene: Scene, angle: Array) -> Array:
    """Of a constant torque: τ·(q2 - q2(0)), exact."""
    work: Array = scene.torque_at(0.0) * (angle - angle[0])
    return work
