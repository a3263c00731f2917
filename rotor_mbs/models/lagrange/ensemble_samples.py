"""From states of many runs to their samples, all runs at once: angles, tips, energies. Knows no integrator."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, fields
from typing import Any

import numpy as np
from numpy.typing import NDArray

from rotor_mbs.models.lagrange import closed_form
from rotor_mbs.models.lagrange.parameters import BladeForm, RotorForm
from rotor_mbs.scenario.scene import Scene
from rotor_mbs.trajectory.record import Array, Integration, Run, Trajectory

_AT_ONCE = 1 << 13  # samples


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
    for name in ("angles", "rates", "tip", "kinetic_energy", "potential_energy", "work"):
        values, target = getattr(run.trajectory, name), getattr(block, name)
        if target is not None and values is not None:
            target[i, :n], target[i, n:] = values, np.nan
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
    """Runs of one structure, as the runs `numbers` of the block. states: (variables, runs, samples).

    A few at a time: what is worked on then stays in the processor's cache.
    """
    at_once = max(_AT_ONCE // states.shape[2], 1)
    for first in range(0, len(numbers), at_once):
        part = slice(first, first + at_once)
        _put_states(block, numbers[part], scenes[part], forms[part], moving, states[:, part], words[part])


def _put_states(
    block: Block,
    numbers: Sequence[int],
    scenes: Sequence[Scene],
    forms: Sequence[RotorForm],
    moving: tuple[int, ...],
    states: Array,
    words: Sequence[Integration],
) -> None:
    columns, count = list(moving), len(moving)
    starts = np.array([scene.initial_angles for scene in scenes]).T
    broken = np.isnan(states[0])
    trigonometry = _Trigonometry()
    angles, rates = [], []
    for i in range(starts.shape[0]):
        k = columns.index(i) if i in columns else None
        angles.append(_held(starts[i], broken) if k is None else states[k])
        rates.append(_held(0.0 * starts[i], broken) if k is None else states[count + k])
        block.angles[numbers, :, i], block.rates[numbers, :, i] = angles[i], rates[i]
    if block.tip is not None:
        for blade, path in _tips(scenes, angles, trigonometry):
            for axis in range(3):
                block.tip[numbers, :, blade, axis] = path[axis]
    if block.kinetic_energy is not None and block.potential_energy is not None and block.work is not None:
        q, qd = [angles[i] for i in columns], [rates[i] for i in columns]
        with np.errstate(over="ignore", invalid="ignore"):  # of rates like 1e200, as in `samples`
            kinetic, potential = closed_form.energies(q, qd, _stacked(forms), trigonometry.sin, trigonometry.cos)
        block.kinetic_energy[numbers], block.potential_energy[numbers] = kinetic, potential
        has_work = len(states) > 2 * count
        block.work[numbers] = states[2 * count] if has_work else _constant_work(scenes, angles[0])
    samples = states.shape[2] - broken.sum(axis=1)
    for i, word, rows in zip(numbers, words, samples.tolist(), strict=True):
        word.time_reached = float(block.time[i, max(rows - 1, 0)])
        block.words[i], block.samples[i] = word, rows


class _Trigonometry:
    """Sines and cosines, each found once for an array: energies and tips ask for the same ones."""

    def __init__(self) -> None:
        self._sines: dict[int, tuple[Array, Array]] = {}
        self._cosines: dict[int, tuple[Array, Array]] = {}

    def turned(self, angle: Array, phase: float) -> Array:
        """angle + phase, whose sine and cosine follow from those of the angle."""
        s, c, turned = self.sin(angle), self.cos(angle), angle + phase
        sin_phase, cos_phase = math.sin(phase), math.cos(phase)
        self._sines[id(turned)] = turned, s * cos_phase + c * sin_phase
        self._cosines[id(turned)] = turned, c * cos_phase - s * sin_phase
        return turned

    def sin(self, angle: Array) -> Array:
        return self._found(self._sines, np.sin, angle)

    def cos(self, angle: Array) -> Array:
        return self._found(self._cosines, np.cos, angle)

    @staticmethod
    def _found(known: dict[int, tuple[Array, Array]], function: np.ufunc, angle: Array) -> Array:
        if id(angle) not in known:
            known[id(angle)] = angle, function(angle)  # held, so that its number stays its own
        return known[id(angle)][1]


def _held(values: Array, broken: NDArray[np.bool_]) -> Array:
    """(runs, samples) of a pitch that does not move; NaN after a run broke off."""
    return np.where(broken, np.nan, values[:, None])


def _constant_work(scenes: Sequence[Scene], angle: Array) -> Array:
    """Of a constant torque: τ·(q2 - q2(0)), exact."""
    torque = np.array([scene.torque_at(0.0) for scene in scenes])
    work: Array = torque[:, None] * (angle - angle[:, :1])
    return work


def _tips(
    scenes: Sequence[Scene], angles: Sequence[Array], trigonometry: _Trigonometry
) -> Iterator[tuple[int, tuple[Any, Any, Any]]]:
    """(blade, its tip's path (x, y, z))."""
    sin, cos = trigonometry.sin, trigonometry.cos
    for i, phase in enumerate(scenes[0].phases):
        point: Any = [np.array([scene.blades[i].tip[axis] for scene in scenes])[:, None] for axis in range(3)]
        yield i, closed_form.point_path(trigonometry.turned(angles[0], phase), angles[1 + i], point, sin, cos)


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
