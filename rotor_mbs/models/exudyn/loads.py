"""Loads that drive the rotor, as load functions of the engine; and the loads in N and N m on blade roots and hub that
follow. The chain: multipliers of joints, moments of connectors. The tree, and a blade that is part of the hub: Newton's
and Euler's laws on the engine's accelerations."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from rotor_mbs.models.exudyn.geometry import (
    ALONG_SHAFT,
    Body,
    Part,
    Ref,
    body_of_point,
    fixed_blade_rotation,
    mounting,
    movable_blades,
    sensor,
)
from rotor_mbs.scenario.scene import Scene
from rotor_mbs.scenario.time_table import ROTOR_TORQUE, Segment, is_constant, rest_place, torque_place, values_before
from rotor_mbs.solution.quantities import named_loads
from rotor_mbs.solution.trajectory import Array


class PrescribedMoment(NamedTuple):
    """A moment on a coordinate that is a factor times a load over time.

    Attributes
    ----------
    coordinate : 0 for the rotor, then the pitches.
    load : place of the load in `Scene.load_tables`.
    factor : 1 for a torque, the spring's stiffness (N m/rad) for a rest angle (rad).
    """

    coordinate: int
    load: int
    factor: float


def prescribed_moments(scene: Scene) -> list[PrescribedMoment]:
    """Return the moments that loads exert: torques, and k r of springs whose rest angle r changes over time.

    A rest angle that is constant is a parameter of the spring itself.
    """
    moments = []
    if scene.has_torque:
        moments.append(PrescribedMoment(0, ROTOR_TORQUE, 1.0))
    for coordinate in scene.moving_coordinates[1:]:
        torque, rest = scene.pitch_loads[coordinate - 1]
        if torque:
            moments.append(PrescribedMoment(coordinate, torque_place(coordinate), 1.0))
        if not is_constant(rest):
            stiffness, _ = scene.bearings[coordinate - 1]
            moments.append(PrescribedMoment(coordinate, rest_place(coordinate), stiffness))
    return moments


class Loads:
    """The loads of the interval that is being integrated, which the engine asks for by load functions."""

    def __init__(self, scene: Scene) -> None:
        self.segment = scene.load_segments[0]

    def set_segment(self, segment: Segment) -> None:
        """Set the loads to those of a segment."""
        self.segment = segment


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
    """Return the sum of the moments that loads exert on a coordinate (0: rotor)."""
    moments = [moment for moment in prescribed_moments(scene) if moment.coordinate == coordinate]
    return Moment(loads, tuple((moment.load, moment.factor) for moment in moments))


def is_driven(scene: Scene, blade: int) -> bool:
    """Return whether a spring, a damper or a torque acts on the pitch of a blade (counted from 0)."""
    if any(scene.bearings[blade]):
        return True
    return any(moment.coordinate == 1 + blade for moment in prescribed_moments(scene))


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
    turned = np.eye(3) if i in movable_blades(scene) else fixed_blade_rotation(scene, i)
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
    shaft_moment[:, 1] -= values_before(scene.load_segments, time)[ROTOR_TORQUE]
    if scene.hub_inertia:
        shaft_moment[:, 1] += scene.hub_inertia * sampled("hub spin rate")[:, 1]
    actuators = np.zeros((len(time), len(blades)))
    for i in movable_blades(scene):
        actuators[:, i] = blades[i][1][:, 2]
    roots = ((force, moment) for force, moment, _ in blades)
    return named_loads(roots, np.asarray(shaft_force), shaft_moment, actuators)


def tree_sensors(scene: Scene, on_link: Callable[[str, str, int, Array], Part]) -> list[Part]:
    sensors = []
    for i, blade in enumerate(scene.blades):
        place = body_of_point(scene, i, blade.centre_of_mass)
        sensors += [on_link(name, output, *place) for name, output in _motion_outputs(scene, i).items()]
    if scene.hub_inertia:
        sensors.append(on_link("hub spin rate", "AngularAccelerationLocal", 0, np.zeros(3)))
    return sensors


def chain_sensors(scene: Scene, hub: Body) -> list[Part]:
    """What `chain_loads` reads beside the rotations: joints, connectors, and blades that are part of the hub."""
    sensors = _joint_sensors("shaft bearing", "shaft damper" if scene.shaft_damping else "")
    for i in range(len(scene.blades)):
        if i in movable_blades(scene):
            sensors += _joint_sensors(f"pitch bearing {i + 1}", f"pitch spring {i + 1}" if is_driven(scene, i) else "")
            continue
        point = list(body_of_point(scene, i, scene.blades[i].centre_of_mass)[1] - hub.com)
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
        if i not in movable_blades(scene):
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
