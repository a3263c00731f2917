"""Torque segments and integration intervals: where the engine stops and starts. Knows no engine.

A step across a kink of the torque loses its order, so each linear segment of the table is integrated by itself. An
interval also ends where a sample must be met.
"""

from __future__ import annotations

import itertools
import math
from dataclasses import dataclass
from typing import TypeVar

import numpy as np

from rotor_mbs.scenario.scene import Scene
from rotor_mbs.solution.record import Array

Time = TypeVar("Time", float, Array)

# A kink closer to a sample than this share of the sample interval is taken to be on it.
_ALIGNED = 1e-6
# Rows kept between two samples where a quadrature or the unwrapping of angles needs them.
_ROWS = 10


@dataclass(frozen=True)
class TorqueSegment:
    """Rotor torque on [start, end] s: torque_start (N m) at its start, and a slope (N m/s)."""

    start: float
    end: float
    torque_start: float
    slope: float

    def at(self, time: Time) -> Time:
        """N m at one time in s, or at (n,) times."""
        return self.torque_start + self.slope * (time - self.start)


@dataclass(frozen=True)
class IntegrationInterval:
    """One call of the engine: from start to end (s), with the torque of one segment.

    sample_intervals: how many intervals between samples it covers, at least 1.
    """

    start: float
    end: float
    sample_intervals: int
    segment: TorqueSegment


class RotorTorque:
    """The load function of the rotor torque; `segment` is the one of the interval being integrated."""

    def __init__(self, scene: Scene) -> None:
        self.segments = torque_segments(scene)
        self.segment = self.segments[0]

    def enter(self, interval: IntegrationInterval) -> None:
        """From now on the torque of that interval acts."""
        self.segment = interval.segment

    def scalar(self, _system: object, time: float, _load: float) -> float:
        return self.segment.at(time)

    def vector(self, _system: object, time: float, _load: object) -> list[float]:
        return [0.0, self.segment.at(time), 0.0]


def torque_segments(scene: Scene) -> tuple[TorqueSegment, ...]:
    """The torque over the run as linear segments in order; one segment where it is constant or absent."""
    kinks = () if scene.has_constant_torque else (time for time, _ in scene.rotor_torque)
    knots = sorted({0.0, scene.duration, *(time for time in kinks if 0.0 < time < scene.duration)})
    segments = []
    for start, end in itertools.pairwise(knots):
        first, middle = scene.torque_at(start), scene.torque_at(0.5 * (start + end))
        last = 2.0 * middle - first
        segments.append(TorqueSegment(start, end, first, (last - first) / (end - start)))
    return tuple(segments)


def sample_times(scene: Scene) -> Array:
    """(samples,) s, both ends included."""
    return np.linspace(0.0, scene.duration, scene.samples)


def integration_intervals(
    scene: Scene, segments: tuple[TorqueSegment, ...], every_sample: bool
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
    rows = math.ceil(steps / per_row)
    return rows * per_row, rows
