"""Load segments and integration intervals: where the engine stops and starts. Knows no engine.

A step across a kink of a load loses its order, so each linear segment of the tables is integrated by itself. An
interval also ends where a sample must be met.
"""

from __future__ import annotations

import itertools
import math
from dataclasses import dataclass
from typing import TypeVar

import numpy as np

from rotor_mbs.scenario.scene import Scene
from rotor_mbs.scenario.time_table import Table, is_constant, knots, value_at
from rotor_mbs.solution.trajectory import Array

Time = TypeVar("Time", float, Array)

# A kink closer to a sample than this share of the sample interval is taken to be on it.
_ALIGNED = 1e-6
# Rows kept between two samples where a quadrature or the unwrapping of angles needs them: all steps, or some _ROWS of
# them where that makes more than _MOST_ROWS.
_ROWS, _MOST_ROWS = 10, 100


@dataclass(frozen=True)
class LoadSegment:
    """Loads on [start, end] s, in the order of `Scene.load_tables`: values at its start, and slopes per s."""

    start: float
    end: float
    values: tuple[float, ...]
    slopes: tuple[float, ...]

    def at(self, load: int, time: Time) -> Time:
        """N m or rad at one time in s, or at (n,) times."""
        return self.values[load] + self.slopes[load] * (time - self.start)


# Places in `Scene.load_tables`.
ROTOR = 0


def torque_of(blade: int) -> int:
    """Number of the pitch torque of a blade; blades are counted from 0."""
    return 1 + 2 * blade


def rest_of(blade: int) -> int:
    """Number of the rest angle of a blade's spring."""
    return 2 + 2 * blade


@dataclass(frozen=True)
class IntegrationInterval:
    """One call of the engine: from start to end (s), with the loads of one segment.

    sample_intervals: how many intervals between samples it covers, at least 1.
    """

    start: float
    end: float
    sample_intervals: int
    segment: LoadSegment


class Loads:
    """The loads over time; `segment` is the one of the interval being integrated."""

    def __init__(self, scene: Scene) -> None:
        self.segments = load_segments(scene)
        self.segment = self.segments[0]

    def enter(self, interval: IntegrationInterval) -> None:
        """From now on the loads of that interval act."""
        self.segment = interval.segment


@dataclass(frozen=True)
class Moment:
    """A moment as a load function of the engine: the sum of factors times loads.

    terms    (place in `Scene.load_tables`, factor); the factor of a rest angle is the spring's stiffness, N m/rad
    """

    loads: Loads
    terms: tuple[tuple[int, float], ...]

    def at(self, time: float) -> float:
        """N m at `time` s."""
        return sum(factor * self.loads.segment.at(load, time) for load, factor in self.terms)

    def scalar(self, _system: object, time: float, _load: float) -> float:
        return self.at(time)

    def about_y(self, _system: object, time: float, _load: object) -> list[float]:
        return [0.0, self.at(time), 0.0]


def pitch_terms(scene: Scene, blade: int) -> tuple[tuple[int, float], ...]:
    """The terms that drive a pitch: its torque, and the moment k r of a spring whose rest angle r changes over time.

    A rest angle that is constant is the spring's own.
    """
    torque, rest = scene.pitch_load(blade)
    terms = [(torque_of(blade), 1.0)] if torque else []
    return (*terms, (rest_of(blade), scene.bearing(blade)[0])) if not is_constant(rest) else tuple(terms)


def is_driven(scene: Scene, blade: int) -> bool:
    """Whether a spring, a damper or a torque acts on the pitch of a blade."""
    return any(scene.bearing(blade)) or bool(pitch_terms(scene, blade))


def constant_rest(scene: Scene, blade: int) -> float:
    """rad: at which the spring of a blade is unloaded, 0 where that changes over time."""
    rest = scene.pitch_load(blade)[1]
    return value_at(rest, 0.0) if is_constant(rest) else 0.0


def load_segments(scene: Scene) -> tuple[LoadSegment, ...]:
    """The loads over the run as linear segments in order; one segment where all are constant or absent."""
    tables = scene.load_tables
    cuts = [0.0, *knots(tables, scene.duration), scene.duration]
    return tuple(
        LoadSegment(start, end, *zip(*(_line(table, start, end) for table in tables), strict=True))
        for start, end in itertools.pairwise(cuts)
    )


def _line(table: Table, start: float, end: float) -> tuple[float, float]:
    """Value at `start`, and slope, of a table without a kink up to `end`."""
    if is_constant(table):
        return value_at(table, start), 0.0
    first, middle = value_at(table, start), value_at(table, 0.5 * (start + end))
    last = 2.0 * middle - first
    return first, (last - first) / (end - start)


def sample_times(scene: Scene) -> Array:
    """(samples,) s, both ends included."""
    return np.linspace(0.0, scene.duration, scene.samples)


def integration_intervals(
    scene: Scene, segments: tuple[LoadSegment, ...], every_sample: bool
) -> list[IntegrationInterval]:
    """The calls of the engine in order; `every_sample` for a scheme that chooses its own steps."""
    times = sample_times(scene)
    cuts = set(range(scene.samples)) if every_sample else {0, scene.samples - 1}
    between: dict[float, float] = {}
    for segment in segments[1:]:
        place = segment.start / scene.duration * (scene.samples - 1)
        near = round(place)
        if abs(place - near) <= _ALIGNED:
            cuts.add(near)
        else:
            cuts.update((math.floor(place), math.ceil(place)))
            between[place] = segment.start
    places = sorted([*cuts, *between])
    out = []
    for start, end in itertools.pairwise(places):
        t0, t1 = (between.get(place, float(times[math.floor(place)])) for place in (start, end))
        middle = 0.5 * (t0 + t1)
        segment = next(segment for segment in reversed(segments) if segment.start <= middle)
        out.append(IntegrationInterval(t0, t1, max(1, round(end - start)), segment))
    return out


def steps_and_rows(span: float, step: float, rows_between: bool) -> tuple[int, int]:
    """Equal steps of at most `step` s over one interval of `span` s, and rows to keep in it: a divisor of the steps."""
    steps = max(1, math.ceil(span / step * (1.0 - 1e-9)))
    if not rows_between:
        return steps, 1
    per_row = math.ceil(steps / _ROWS)
    steps = per_row * math.ceil(steps / per_row)
    return steps, steps if steps <= _MOST_ROWS else steps // per_row
