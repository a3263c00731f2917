"""Torques over time as segments on which they are linear, and the times at which the engine stops. Knows no engine.

A step across a kink of a torque loses its order, and MuJoCo keeps a load constant within a step. Both are avoided: the
engine stops at every kink, and within a segment a torque is a state of the engine (see `mjcf`), which every stage of a
step evaluates at its own time.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from rotor_mbs.scenario.scene import Scene
from rotor_mbs.solution.record import Array

Table = Sequence[tuple[float, float]]

# A kink closer to a sample than this share of the sample interval is moved onto it.
_SAME = 1e-9
# States kept in a sample interval where the work has to be integrated along the path.
_ROWS = 10


@dataclass(frozen=True)
class Segment:
    """On [start, end] s the torques are torque + slope (t - start).

    torque, slope   (loads,) N m and N m/s, in the order of `loaded`
    """

    start: float
    end: float
    torque: tuple[float, ...]
    slope: tuple[float, ...]

    def at(self, time: float) -> list[float]:
        """(loads,) N m at `time` s."""
        return [torque + slope * (time - self.start) for torque, slope in zip(self.torque, self.slope, strict=True)]


@dataclass(frozen=True)
class Interval:
    """From one stop of the engine to the next, s: within one segment and between two samples."""

    start: float
    end: float
    segment: Segment
    is_sample: bool  # whether a sample is at its end


def loaded(scene: Scene) -> dict[int, Table]:
    """Table of the torque over time by coordinate (0 = rotor); coordinates without a torque are left out."""
    return {0: scene.rotor_torque} if scene.has_torque else {}


def segments(scene: Scene) -> tuple[Segment, ...]:
    """The whole run, cut where a torque has a kink or a jump; one segment where all are constant."""
    tables = list(loaded(scene).values())
    varying = [table for table in tables if len({torque for _, torque in table}) > 1]
    kinks = {time for table in varying for time, _ in table if 0.0 < time < scene.duration}
    knots = sorted({0.0, scene.duration, *kinks})
    return tuple(
        Segment(start, end, *_columns([_line(table, start, end) for table in tables]))
        for start, end in itertools.pairwise(knots)
    )


def _columns(lines: Sequence[tuple[float, float]]) -> tuple[tuple[float, ...], tuple[float, ...]]:
    return tuple(torque for torque, _ in lines), tuple(slope for _, slope in lines)


def _line(table: Table, start: float, end: float) -> tuple[float, float]:
    """Torque at `start`, and its slope to `end`, of a table that has no row between the two."""
    before = [row for row in table if row[0] <= start]
    after = [row for row in table if row[0] >= end]
    if not before or not after or before[-1][1] == after[0][1]:
        return (before[-1] if before else table[0])[1], 0.0
    (t0, torque0), (t1, torque1) = before[-1], after[0]
    slope = (torque1 - torque0) / (t1 - t0)
    return torque0 + slope * (start - t0), slope


def sample_times(scene: Scene) -> Array:
    """(samples,) s, both ends included."""
    return np.linspace(0.0, scene.duration, scene.samples)


def intervals(scene: Scene) -> list[Interval]:
    """The run from stop to stop: at every sample, and at every kink of a torque between samples."""
    times = sample_times(scene).tolist()
    spacing = scene.duration / (scene.samples - 1)
    parts = segments(scene)
    kinks = [part.start for part in parts[1:] if not _is_sample(part.start / spacing)]
    stops = sorted([*((time, True) for time in times), *((time, False) for time in kinks)])
    out, position = [], 0
    for (start, _), (end, is_sample) in itertools.pairwise(stops):
        while parts[position].end < 0.5 * (start + end):
            position += 1
        out.append(Interval(start, end, parts[position], is_sample))
    return out


def _is_sample(place: float) -> bool:
    return abs(place - round(place)) <= _SAME


def steps_and_rows(span: float, step: float, rows_between: bool) -> tuple[int, int]:
    """How many equal steps of at most `step` s fill `span` s, and how many states to keep of them: a divisor."""
    steps = max(1, math.ceil(span / step * (1.0 - 1e-9)))
    if not rows_between:
        return steps, 1
    rows = min(steps, _ROWS)
    return rows * math.ceil(steps / rows), rows
