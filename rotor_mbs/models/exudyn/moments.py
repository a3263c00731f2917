"""Moments over time as load functions of the engine: which loads drive which coordinate."""

from __future__ import annotations

from dataclasses import dataclass

from rotor_mbs.scenario.scene import Scene
from rotor_mbs.scenario.time_table import Interval, is_constant, segments

ROTOR = 0  # the rotor's torque in `Scene.load_tables`


def drives(scene: Scene) -> list[tuple[int, int, float]]:
    """What drives a coordinate (0: rotor): a factor times the load at a place in `Scene.load_tables`. Torques, and the
    moments k r of springs whose rest angle r changes over time; one that is constant is the spring's own."""
    all_drives = [(0, ROTOR, 1.0)] if scene.has_torque else []
    for column in scene.moving_coordinates[1:]:
        torque, rest = scene.pitch_load(column - 1)
        if torque:
            all_drives.append((column, 2 * column - 1, 1.0))
        if not is_constant(rest):
            all_drives.append((column, 2 * column, scene.bearing(column - 1)[0]))
    return all_drives


class Loads:
    """The loads over time; `segment` is the one of the interval being integrated."""

    def __init__(self, scene: Scene) -> None:
        self.segments = segments(scene.load_tables, scene.duration)
        self.segment = self.segments[0]

    def enter(self, interval: Interval) -> None:
        self.segment = interval.segment


@dataclass(frozen=True)
class Moment:
    """A moment as a load function of the engine: the sum of factors times loads."""

    loads: Loads  # over time
    # (place in `Scene.load_tables`, factor); the factor of a rest angle is the spring's stiffness, N m/rad
    terms: tuple[tuple[int, float], ...]

    def at(self, time: float) -> float:
        """N m at `time` s."""
        return sum(factor * self.loads.segment.at(load, time) for load, factor in self.terms)

    def scalar(self, _system: object, time: float, _load: float) -> float:
        return self.at(time)

    def about_y(self, _system: object, time: float, _load: object) -> list[float]:
        """Load function of a torque vector along the shaft."""
        return [0.0, self.at(time), 0.0]


def moment_on(scene: Scene, loads: Loads, coordinate: int) -> Moment:
    return Moment(loads, tuple((load, factor) for driven, load, factor in drives(scene) if driven == coordinate))


def is_driven(scene: Scene, blade: int) -> bool:
    """Whether a spring, a damper or a torque acts on the pitch of a blade."""
    return any(scene.bearing(blade)) or any(driven == 1 + blade for driven, _, _ in drives(scene))
