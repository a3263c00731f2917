"""When the engine stops and starts: at kinks of the torque, and where samples must be met. Knows no engine.

A step across a kink of the torque loses its order, so each linear piece of the table is integrated by itself.
"""

from __future__ import annotations

import itertools
import math
from dataclasses import dataclass

import numpy as np

from rotor_mbs.scenario.scene import Scene
from rotor_mbs.solution.record import Array

# A kink closer to a sample than this share of the sample interval is taken to be on it.
_ALIGNED = 1e-6
# Rows kept between two samples where a quadrature or the unwrapping of angles needs them.
_ROWS = 10


@dataclass(frozen=True)
class Piece:
    """Rotor torque in N m on [start, end] s, linear between its two ends."""

    start: float
    end: float
    torque_start: float
    torque_end: float

    def at(self, time: Array) -> Array:
        """(n,) N m at (n,) s."""
        return self.torque_start + self._slope * (time - self.start)

    def torque_at(self, time: float) -> float:
        """N m at one time in s."""
        return self.torque_start + self._slope * (time - self.start)

    @property
    def _slope(self) -> float:
        return (self.torque_end - self.torque_start) / (self.end - self.start)


@dataclass(frozen=True)
class Leg:
    """One call of the engine: from start to end (s), over so many sample intervals, with the torque of one piece."""

    start: float
    end: float
    intervals: int
    piece: Piece


class RotorTorque:
    """The load function of the rotor torque; `piece` is the one of the leg being integrated."""

    def __init__(self, scene: Scene) -> None:
        self.pieces = torque_pieces(scene)
        self.piece = self.pieces[0]

    def scalar(self, _system: object, time: float, _load: float) -> float:
        return self.piece.torque_at(time)

    def vector(self, _system: object, time: float, _load: object) -> list[float]:
        return [0.0, self.piece.torque_at(time), 0.0]


def torque_pieces(scene: Scene) -> tuple[Piece, ...]:
    """The torque over the run as linear pieces in order; one piece where it is constant or absent."""
    kinks = () if scene.has_constant_torque else (time for time, _ in scene.rotor_torque)
    knots = sorted({0.0, scene.duration, *(time for time in kinks if 0.0 < time < scene.duration)})
    pieces = []
    for start, end in itertools.pairwise(knots):
        first, middle = scene.torque_at(start), scene.torque_at(0.5 * (start + end))
        pieces.append(Piece(start, end, first, 2.0 * middle - first))
    return tuple(pieces)


def sample_times(scene: Scene) -> Array:
    """(samples,) s, both ends included."""
    return np.linspace(0.0, scene.duration, scene.samples)


def legs(scene: Scene, pieces: tuple[Piece, ...], every_sample: bool) -> list[Leg]:
    """The calls of the engine in order; `every_sample` for a scheme that chooses its own steps."""
    times = sample_times(scene)
    cuts = set(range(scene.samples)) if every_sample else {0, scene.samples - 1}
    between: dict[float, float] = {}
    for piece in pieces[1:]:
        place = piece.start / scene.duration * (scene.samples - 1)
        near = round(place)
        if abs(place - near) <= _ALIGNED:
            cuts.add(near)
        else:
            cuts.update((math.floor(place), math.ceil(place)))
            between[place] = piece.start
    places = sorted([*cuts, *between])
    out = []
    for start, end in itertools.pairwise(places):
        t0, t1 = (between.get(place, float(times[math.floor(place)])) for place in (start, end))
        middle = 0.5 * (t0 + t1)
        piece = next(piece for piece in reversed(pieces) if piece.start <= middle)
        out.append(Leg(t0, t1, max(1, round(end - start)), piece))
    return out


def steps_and_rows(span: float, step: float, rows_between: bool) -> tuple[int, int]:
    """Equal steps of at most `step` s over one interval of `span` s, and rows to keep in it: a divisor of the steps."""
    steps = max(1, math.ceil(span / step * (1.0 - 1e-9)))
    if not rows_between:
        return steps, 1
    per_row = math.ceil(steps / _ROWS)
    rows = math.ceil(steps / per_row)
    return rows * per_row, rows
