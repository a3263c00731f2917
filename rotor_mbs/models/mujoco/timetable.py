"""Loads over time as segments on which they are linear, and the times at which the engine stops. Knows no engine.

A step across a kink of a load loses its order, and MuJoCo keeps a load constant within a step. Both are avoided: the
engine stops at every kink, and within a segment a load is a state of the engine (see `mjcf`), which every stage of a
step evaluates at its own time.
"""

from __future__ import annotations

import itertools
import math
from dataclasses import dataclass

import numpy as np

from rotor_mbs.scenario.scene import Scene
from rotor_mbs.scenario.time_table import Table, is_constant, knots, value_at
from rotor_mbs.solution.trajectory import Array

# A kink closer to a sample than this share of the sample interval is moved onto it.
_SAME = 1e-9
# States kept in a sample interval where the work has to be integrated along the path: of all steps, or of _ROWS of them
# where that makes more than _MOST_ROWS.
_ROWS, _MOST_ROWS = 10, 100


@dataclass(frozen=True)
class Load:
    """A moment `gain` times a table over time, on a coordinate (0 = rotor).

    gain   1, or the stiffness (N m/rad) of a spring whose rest angle (rad) changes over time
    """

    name: str
    coordinate: int
    gain: float
    table: Table


@dataclass(frozen=True)
class Segment:
    """On [start, end] s the tables are value + slope (t - start).

    value, slope   (loads,) N m or rad, and per s, in the order of `loads_of`
    """

    start: float
    end: float
    value: tuple[float, ...]
    slope: tuple[float, ...]

    def at(self, time: float) -> list[float]:
        """(loads,) N m or rad at `time` s."""
        return [value + slope * (time - self.start) for value, slope in zip(self.value, self.slope, strict=True)]


@dataclass(frozen=True)
class Interval:
    """From one stop of the engine to the next, s: within one segment and between two samples."""

    start: float
    end: float
    segment: Segment
    is_sample: bool  # whether a sample is at its end


def loads_of(scene: Scene) -> list[Load]:
    """Torque on the rotor, torques of the pitches that move, rest angles that change over time, as far as there are."""
    found = [Load("torque rotor", 0, 1.0, scene.rotor_torque)] if scene.has_torque else []
    for number in scene.moving_coordinates[1:]:
        torque, rest = scene.pitch_load(number - 1)
        if torque:
            found.append(Load(f"torque pitch {number}", number, 1.0, torque))
        if not is_constant(rest):
            found.append(Load(f"rest pitch {number}", number, scene.bearing(number - 1)[0], rest))
    return found


def constant_rest(scene: Scene, number: int) -> float:
    """rad: rest angle of the spring of blade `number` (from 1); 0 where that changes over time."""
    rest = scene.pitch_load(number - 1)[1]
    return value_at(rest, 0.0) if is_constant(rest) else 0.0


def segments(scene: Scene) -> tuple[Segment, ...]:
    """The whole run, cut where a load has a kink or a jump; one segment where all are constant."""
    tables = [load.table for load in loads_of(scene)]
    cuts = [0.0, *knots(tables, scene.duration), scene.duration]
    return tuple(
        Segment(start, end, *_columns([_line(table, start, end) for table in tables]))
        for start, end in itertools.pairwise(cuts)
    )


def _columns(lines: list[tuple[float, float]]) -> tuple[tuple[float, ...], tuple[float, ...]]:
    return tuple(value for value, _ in lines), tuple(slope for _, slope in lines)


def _line(table: Table, start: float, end: float) -> tuple[float, float]:
    """Value at `start`, and its slope to `end`, of a table that has no kink between the two."""
    before = [row for row in table if row[0] <= start]
    after = [row for row in table if row[0] >= end]
    if not before or not after or before[-1][1] == after[0][1]:
        return (before[-1] if before else table[0])[1], 0.0
    (t0, value0), (t1, value1) = before[-1], after[0]
    slope = (value1 - value0) / (t1 - t0)
    return value0 + slope * (start - t0), slope


def sample_times(scene: Scene) -> Array:
    """(samples,) s, both ends included."""
    return np.linspace(0.0, scene.duration, scene.samples)


def intervals(scene: Scene) -> list[Interval]:
    """The run from stop to stop: at every sample, and at every kink of a load between samples."""
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
    steps = rows * math.ceil(steps / rows)
    return steps, steps if steps <= _MOST_ROWS else rows
