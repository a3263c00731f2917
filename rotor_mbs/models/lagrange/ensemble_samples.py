"""From states of many runs to their samples, all runs at once: angles, tips, energies. Knows no integrator."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, fields

import numpy as np

from rotor_mbs.models.lagrange import closed_form
from rotor_mbs.models.lagrange.parameters import BladeForm, RotorForm
from rotor_mbs.scenario.scene import Scene
from rotor_mbs.trajectory.record import Array, Integration, Run, Trajectory


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
    first, runs = scenes[0], len(scenes)
    shape = (runs, first.samples)
    columns = 1 + len(first.blades)
    time = np.linspace(0.0, np.array([scene.duration for scene in scenes]), first.samples, axis=1)
    tip = np.full((*shape, len(first.blades), 3), np.nan) if first.wants("tip") else None
    kinetic, potential, work = (np.full(shape, np.nan) if first.wants("energy") else None for _ in range(3))
    angles, rates = np.full((*shape, columns), np.nan), np.full((*shape, columns), np.nan)
    words = [Integration(False)] * runs
    return Block(time, angles, rates, tip, kinetic, potential, work, words, [0] * runs)


def put_single(block: Block, i: int, run: Run) -> None:
    """A run of its own as run i of the block."""
    n = len(run.trajectory.time)
    for name in ("angles", "rates", "tip", "kinetic_energy", "potential_energy", "work"):
        values, target = getattr(run.trajectory, name), getattr(block, name)
        if target is not None and values is not None:
            target[i, :n] = values
    block.words[i], block.samples[i] = run.integration, n


def put_states(
    block: Block,
    numbers: Sequence[int],
    scenes: Sequence[Scene],
    forms: Sequence[RotorForm],
    moving: tuple[int, ...],
    states: Array,
    words: Sequence[Integration],
) -> None:
    """Runs of one structure, as the runs `numbers` of the block. states: (runs, samples, variables)."""
    columns, count = list(moving), len(moving)
    angles = np.repeat(np.array([scene.initial_angles for scene in scenes])[:, None, :], states.shape[1], axis=1)
    rates = np.zeros_like(angles)
    angles[:, :, columns] = states[:, :, :count]
    rates[:, :, columns] = states[:, :, count : 2 * count]
    broken = np.isnan(states[:, :, 0])
    angles[broken] = np.nan
    rates[broken] = np.nan
    block.angles[numbers], block.rates[numbers] = angles, rates
    if block.tip is not None:
        block.tip[numbers] = _tips(scenes, angles)
    if block.kinetic_energy is not None and block.potential_energy is not None and block.work is not None:
        q, qd = [angles[:, :, i] for i in columns], [rates[:, :, i] for i in columns]
        kinetic, potential = closed_form.energies(q, qd, _stacked(forms), np.sin, np.cos)
        block.kinetic_energy[numbers], block.potential_energy[numbers] = kinetic, potential
        block.work[numbers] = states[:, :, 2 * count] if states.shape[2] > 2 * count else _constant_work(scenes, angles)
    samples = states.shape[1] - broken.sum(axis=1)
    for i, word, rows in zip(numbers, words, samples.tolist(), strict=True):
        word.time_reached = float(block.time[i, max(rows - 1, 0)])
        block.words[i], block.samples[i] = word, rows


def _constant_work(scenes: Sequence[Scene], angles: Array) -> Array:
    """Of a constant torque: τ·(q2 - q2(0)), exact."""
    torque = np.array([scene.torque_at(0.0) for scene in scenes])
    work: Array = torque[:, None] * (angles[:, :, 0] - angles[:, :1, 0])
    return work


def _tips(scenes: Sequence[Scene], angles: Array) -> Array:
    tips = np.empty((*angles.shape[:2], len(scenes[0].blades), 3))
    for i, phase in enumerate(scenes[0].phases):
        point = [np.array([scene.blades[i].tip[axis] for scene in scenes])[:, None] for axis in range(3)]
        path = closed_form.point_path(angles[:, :, 0] + phase, angles[:, :, 1 + i], point, np.sin, np.cos)  # type: ignore[arg-type]
        for axis in range(3):
            tips[:, :, i, axis] = path[axis]
    return tips


def _stacked(forms: Sequence[RotorForm]) -> RotorForm:
    """One form whose numbers are (runs, 1): the closed form then works on all runs at once."""
    first = forms[0]
    if all(form is first for form in forms):
        return first
    blades = tuple(
        BladeForm(*(_column([getattr(form.blades[b], f.name) for form in forms]) for f in fields(BladeForm)))
        for b in range(len(first.blades))
    )
    held = tuple(
        (_column([form.held[h][0] for form in forms]), first.held[h][1], first.held[h][2])
        for h in range(len(first.held))
    )
    inertia = _column([form.inertia for form in forms])
    return RotorForm(blades, first.moving, held, inertia, first.shaft_damping)


def _column(values: Sequence[float]) -> Array:
    return np.array(values)[:, None]
