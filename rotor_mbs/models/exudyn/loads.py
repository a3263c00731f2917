"""Loads that drive the rotor, as load functions of the engine; and the loads in N and N m on blade roots and hub that
follow. The chain: multipliers of joints, moments of connectors. The tree, and a blade that is part of the hub: Newton's
and Euler's laws on the engine's accelerations."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from rotor_mbs.models.exudyn.geometry import (
    ALONG_SHAFT,
    Body,
    Part,
    Ref,
    fixed_blade_rotation,
    mounting,
    on_body,
    pitching,
    sensor,
)
from rotor_mbs.scenario.scene import Scene
from rotor_mbs.scenario.time_table import Interval, Segment, is_constant, segments, values_before
from rotor_mbs.solution.quantities import named_loads
from rotor_mbs.solution.trajectory import Array

ROTOR = 0  # the rotor's torque in `Scene.load_tables`


def load_segments(scene: Scene) -> tuple[Segment, ...]:
    """The whole run; the loads of a segment are those of `Scene.load_tables`."""
    return segments(scene.load_tables, scene.duration)


def drives(scene: Scene) -> list[tuple[int, int, float]]:
    """What drives a coordinate (0: rotor): a factor times the load at a place in `Scene.load_tables`. Torques, and the
    moments k r of springs whose rest angle r changes over time; one that is constant is the spring's own."""
    all_drives = [(0, ROTOR, 1.0)] if scene.has_torque else []
    for column in scene.moving_coordinates[1:]:
        torque, rest = scene.pitch_loads[column - 1]
        if torque:
            all_drives.append((column, 2 * column - 1, 1.0))
        if not is_constant(rest):
            all_drives.append((column, 2 * column, scene.bearings[column - 1][0]))
    return all_drives


class Loads:
    """The loads over time; `segment` is the one of the interval being integrated."""

    def __init__(self, scene: Scene) -> None:
        self.segment = load_segments(scene)[0]

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
    return any(scene.bearings[blade]) or any(driven == 1 + blade for driven, _, _ in drives(scene))


# (name of a sensor) -> (samples, k) values
Sampled = Callable[[str], Array]


def _motion_outputs(scene: Scene, i: int) -> dict[str, str]:
    """What Newton's and Euler's laws need of blade i: the engine's names of outputs by those of sensors."""
    outputs = {"root acceleration": "Acceleration", "root rotation": "RotationMatrix"}
    if not scene.blades[i].is_point_mass:
        outputs |= {"root spin": "AngularVelocityLocal", "root spin rate": "AngularAccelerationLocal"}
    return {f"blade {i + 1} {what}": output for what, output in outputs.items()}


def _newton_euler(scene: Scene, i: int, sampled: Sampled) -> tuple[Array, Array, Array]:
    """(n, 3) force, moment about the root in the frame of blade i; (n, 3, 3) that frame to the base frame. F = m (a + g
    e_z), M = I α + ω × I ω + r × F, r the centre of mass, I the inertia about it."""
    blade, name = scene.blades[i], f"blade {i + 1} root"
    # From the blade's frame to the engine's body that it is, or, where it cannot pitch, is part of.
    turned = np.eye(3) if i in pitching(scene) else fixed_blade_rotation(scene, i)
    frames = matrices(sampled(f"{name} rotation")) @ turned
    lifted = sampled(f"{name} acceleration") + np.array([0.0, 0.0, scene.gravity])
    force = blade.mass * _in_frames(frames, lifted)
    moment = np.cross(blade.centre_of_mass, force)
    if not blade.is_point_mass:
        inertia = blade.inertia_tensor
        omega, alpha = (sampled(f"{name} {what}") @ turned for what in ("spin", "spin rate"))
        moment += alpha @ inertia + np.cross(omega, omega @ inertia)
    return force, moment, frames


def tree_loads(scene: Scene, time: Array, sampled: Sampled) -> dict[str, Array]:
    """Every blade by Newton and Euler, their sum with the hub's share at the shaft; the moment of a pitch actuator is
    what they leave about the pitch axis."""
    blades = [_newton_euler(scene, i, sampled) for i in range(len(scene.blades))]
    shaft_force = sum(_in_base(frames, force) for force, _, frames in blades)
    shaft_moment = sum(_in_base(frames, moment) for _, moment, frames in blades)
    assert isinstance(shaft_moment, np.ndarray)
    shaft_moment[:, 1] -= values_before(load_segments(scene), time)[ROTOR]
    if scene.hub_inertia:
        shaft_moment[:, 1] += scene.hub_inertia * sampled("hub spin rate")[:, 1]
    actuators = np.zeros((len(time), len(blades)))
    for i in pitching(scene):
        actuators[:, i] = blades[i][1][:, 2]
    roots = ((force, moment) for force, moment, _ in blades)
    return named_loads(roots, np.asarray(shaft_force), shaft_moment, actuators)


def tree_sensors(scene: Scene, on_link: Callable[[str, str, int, Array], Part]) -> list[Part]:
    sensors = []
    for i, blade in enumerate(scene.blades):
        place = on_body(scene, i, blade.centre_of_mass)
        sensors += [on_link(name, output, *place) for name, output in _motion_outputs(scene, i).items()]
    if scene.hub_inertia:
        sensors.append(on_link("hub spin rate", "AngularAccelerationLocal", 0, np.zeros(3)))
    return sensors


def chain_sensors(scene: Scene, hub: Body) -> list[Part]:
    """What `chain_loads` reads beside the rotations: joints, connectors, and blades that are part of the hub."""
    sensors = _joint_sensors("shaft bearing", "shaft damper" if scene.shaft_damping else "")
    for i in range(len(scene.blades)):
        if i in pitching(scene):
            sensors += _joint_sensors(f"pitch bearing {i + 1}", f"pitch spring {i + 1}" if is_driven(scene, i) else "")
            continue
        point = list(on_body(scene, i, scene.blades[i].centre_of_mass)[1] - hub.com)
        for name, output in _motion_outputs(scene, i).items():
            sensors.append(sensor(name, "SensorBody", output, bodyNumber=Ref("object", "hub"), localPosition=point))
    return sensors


def _joint_sensors(joint: str, connector: str) -> list[Part]:
    outputs = {f"{joint} force": ("ForceLocal", joint), f"{joint} torque": ("TorqueLocal", joint)}
    if connector:
        outputs[f"{connector} torque"] = ("TorqueLocal", connector)
    return [
        sensor(name, "SensorObject", output, objectNumber=Ref("object", item))
        for name, (output, item) in outputs.items()
    ]


def chain_loads(scene: Scene, sampled: Sampled) -> dict[str, Array]:
    hub = matrices(sampled("hub rotation"))
    roots, actuators = [], np.zeros((len(hub), len(scene.blades)))
    for i in range(len(scene.blades)):
        if i not in pitching(scene):
            roots.append(_newton_euler(scene, i, sampled)[:2])
            continue
        frames = matrices(sampled(f"blade {i + 1} rotation"))
        force, moment = _joint_reaction(f"pitch bearing {i + 1}", hub @ mounting(i, len(scene.blades)), frames, sampled)
        if is_driven(scene, i):
            actuators[:, i] = -sampled(f"pitch spring {i + 1} torque")[:, 0]
        along = actuators[:, i, None] * [0.0, 0.0, 1.0]
        roots.append((_in_frames(frames, force), _in_frames(frames, moment) + along))
    ground = np.broadcast_to(ALONG_SHAFT, hub.shape)
    force, moment = _joint_reaction("shaft bearing", ground, hub @ ALONG_SHAFT, sampled)
    if scene.shaft_damping:
        moment[:, 1] -= sampled("shaft damper torque")[:, 0]
    return named_loads(roots, force, moment, actuators)


def _joint_reaction(joint: str, seat: Array, root: Array, sampled: Sampled) -> tuple[Array, Array]:
    """(n, 3) force and moment of a joint on its second body, base frame, from its (n, 3, 3) frames on both. The engine
    gives the force on the first body, and multipliers λ of x₁·z₀ = 0, y₁·z₀ = 0: a moment λ₀ z₀ × x₁ + λ₁ z₀ × y₁."""
    force = -_in_base(seat, sampled(f"{joint} force"))
    multipliers = sampled(f"{joint} torque")
    x, y, z = root[:, :, 0], root[:, :, 1], seat[:, :, 2]
    return force, multipliers[:, :1] * np.cross(z, x) + multipliers[:, 1:2] * np.cross(z, y)


def matrices(rows: Array) -> Array:
    return rows.reshape(-1, 3, 3)


def _in_base(frames: Array, vectors: Array) -> Array:
    return np.asarray((frames @ vectors[:, :, None])[:, :, 0])


def _in_frames(frames: Array, vectors: Array) -> Array:
    return np.asarray((vectors[:, None, :] @ frames)[:, 0, :])
