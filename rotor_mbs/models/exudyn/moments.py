"""Moments over time as load functions of the engine: which loads drive which coordinate."""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

from rotor_mbs.scenario.scene import Scene
from rotor_mbs.scenario.time_table import Interval, is_constant, segments

ROTOR = 0  # the rotor's torque in `Scene.load_tables`


class Drive(NamedTuple):
    """What drives a coordinate (0: rotor): `factor` times the load at a place in `Scene.load_tables`."""

    coordinate: int
    load: int
    factor: float


def drives(scene: Scene) -> list[Drive]:
    """Torques, and the moments k r of springs whose rest angle r changes over time; one that is constant is the
    spring's own."""
    all_drives = [Drive(0, ROTOR, 1.0)] if scene.has_torque else []
    for column in scene.moving_coordinates[1:]:
        torque, rest = scene.pitch_load(column - 1)
        if torque:
            all_drives.append(Drive(column, 2 * column - 1, 1.0))
        if not is_constant(rest):
            all_drives.append(Drive(column, 2 * column, scene.bearing(column - 1)[0]))
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
    return Moment(loads, tuple((drive.load, drive.factor) for drive in drives(scene) if drive.coordinate == coordinate))


def is_driven(scene: Scene, blade: int) -> bool:
    """Whether a spring, a damper or a torque acts on the pitch of a blade."""
    return any(scene.bearing(blade)) or any(drive.coordinate == 1 + blade for drive in drives(scene))
