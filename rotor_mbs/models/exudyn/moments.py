"""Moments over time as load functions of the engine: which loads drive which coordinate. Knows no engine."""

from __future__ import annotations

from dataclasses import dataclass

from rotor_mbs.scenario.scene import Scene
from rotor_mbs.scenario.time_table import Interval, is_constant, segments

# Places in `Scene.load_tables`.
ROTOR = 0


def torque_of(blade: int) -> int:
    """Number of the pitch torque of a blade; blades are counted from 0."""
    return 1 + 2 * blade


def rest_of(blade: int) -> int:
    """Number of the rest angle of a blade's spring."""
    return 2 + 2 * blade


class Loads:
    """The loads over time; `segment` is the one of the interval being integrated."""

    def __init__(self, scene: Scene) -> None:
        self.segments = segments(scene.load_tables, scene.duration)
        self.segment = self.segments[0]

    def enter(self, interval: Interval) -> None:
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
