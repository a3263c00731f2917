"""Define the loads that drive the rotor, and compute the loads on blade roots and shaft.

The engine calls load functions for driving loads that change over time. The loads on roots and
shaft, in N and N m, are computed in two ways. In the chain they follow from multipliers of joints
and moments of connectors. In the tree, and for a blade that is part of the hub, they follow from
the engine's accelerations by Newton's and Euler's laws.
"""

from __future__ import annotations

import math
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
    rotation_x,
    sensor,
    shaft_axis,
)
from rotor_mbs.scenario.scene import Scene
from rotor_mbs.scenario.time_table import (
    ROTOR_TORQUE,
    Segment,
    is_constant,
    rest_place,
    torque_place,
    values_before,
)
from rotor_mbs.solution.quantities import named_loads
from rotor_mbs.solution.trajectory import Array


class PrescribedMoment(NamedTuple):
    """Describe a moment on a coordinate. It is a factor times a load over time.

    Attributes
    ----------
    coordinate : 0 for the rotor, i for the pitch of blade i.
    load : place of the load in `Scene.load_tables`.
    factor : 1 for a torque, the spring's stiffness (N m/rad) for a rest angle (rad).
    """

    coordinate: int
    load: int
    factor: float


def prescribed_moments(scene: Scene) -> list[PrescribedMoment]:
    """Return the moments that loads exert: torques, and moments of rest angles that change.

    A rest angle r that changes over time acts as a moment k r, with the stiffness k of the spring.
    A constant rest angle is a parameter of the spring itself.

    Parameters
    ----------
    scene : the rotor and its loads.
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
    """Hold the loads of the interval that is being integrated, for the engine's load functions."""

    def __init__(self, scene: Scene) -> None:
        self.segment = scene.load_segments[0]

    def set_segment(self, segment: Segment) -> None:
        """Set the loads to those of a segment."""
        self.segment = segment


@dataclass(frozen=True)
class Moment:
    """Compute a moment, the sum of factors times loads, for a load function of the engine.

    Attributes
    ----------
    loads : the loads of the present interval.
    terms : load and factor of each summand, as in `PrescribedMoment`.
    """

    loads: Loads
    terms: tuple[tuple[int, float], ...]

    def at(self, time: float) -> float:
        """Return the moment (N m) at a time (s)."""
        return sum(factor * self.loads.segment.at(load, time) for load, factor in self.terms)

    def scalar(self, _system: object, time: float, _load: float) -> float:
        """Return the moment (N m). The engine calls this function for a load on a coordinate."""
        return self.at(time)


def along_shaft(scene: Scene, size: float) -> list[float]:
    """Return a vector of a given size along the shaft, in the base frame."""
    tilt = scene.shaft_tilt
    return [0.0, size * math.cos(tilt), size * math.sin(tilt)] if tilt else [0.0, size, 0.0]


def moment_on(scene: Scene, loads: Loads, coordinate: int) -> Moment:
    """Return the sum of the moments that loads exert on a coordinate (0: rotor)."""
    moments = [moment for moment in prescribed_moments(scene) if moment.coordinate == coordinate]
    return Moment(loads, tuple((moment.load, moment.factor) for moment in moments))


def is_driven(scene: Scene, blade: int) -> bool:
    """Return whether a spring, a damper or a torque acts on the pitch of a blade.

    Parameters
    ----------
    scene : the rotor and its loads.
    blade : its index, from 0.
    """
    if any(scene.bearings[blade]):
        return True
    return any(moment.coordinate == 1 + blade for moment in prescribed_moments(scene))


# (name of a sensor) -> (samples, k) values
Sampled = Callable[[str], Array]


def _motion_outputs(scene: Scene, i: int) -> dict[str, str]:
    """Return the sensors that `_newton_euler` reads for a blade.

    Parameters
    ----------
    scene : the rotor.
    i : number of the blade, from 0.

    Returns
    -------
    dict
        The engine's names of the output variables, by names of the sensors.
    """
    outputs = {"root acceleration": "Acceleration", "root rotation": "RotationMatrix"}
    if not scene.blades[i].is_point_mass:
        outputs["root spin"] = "AngularVelocityLocal"
        outputs["root spin rate"] = "AngularAccelerationLocal"
    return {f"blade {i + 1} {what}": output for what, output in outputs.items()}


def _newton_euler(scene: Scene, i: int, sampled: Sampled) -> tuple[Array, Array, Array]:
    """Compute the load on a blade by Newton's and Euler's laws.

    F = m (a + g e_z) and M = I α + ω × I ω + r × F, with the centre of mass r, its acceleration a
    and the inertia I about it.

    Parameters
    ----------
    scene : the rotor.
    i : number of the blade, from 0.
    sampled : (name of a sensor) -> its values.

    Returns
    -------
    force, moment : ndarray, shape (n, 3)
        Force (N) and moment about the apex (N m), both in the frame of the blade.
    frames : ndarray, shape (n, 3, 3)
        Rotations from the frame of the blade to the base frame.
    """
    blade, name = scene.blades[i], f"blade {i + 1} root"
    # Rotation from the blade's frame to that of the body in the engine. This body is the blade
    # itself, or the hub if the blade cannot pitch.
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
    """Compute the loads of the tree from the engine's accelerations.

    Newton's and Euler's laws give the load on each blade. The load on the shaft is the sum of these
    loads and the hub's share, minus the rotor torque. The moment of a pitch actuator is the blade's
    moment about the pitch axis.

    Parameters
    ----------
    scene : the rotor.
    time : (n,) s, times of the samples.
    sampled : (name of a sensor) -> its values.

    Returns
    -------
    dict of ndarray
        The loads, (n, ...), by name of the quantity.
    """
    blades = [_newton_euler(scene, i, sampled) for i in range(len(scene.blades))]
    shaft_force = sum(_in_base(frames, force) for force, _, frames in blades)
    shaft_moment = sum(_in_base(frames, moment) for _, moment, frames in blades)
    assert isinstance(shaft_moment, np.ndarray)
    _add_along_shaft(scene, shaft_moment, -values_before(scene.load_segments, time)[ROTOR_TORQUE])
    if scene.hub_inertia:
        _add_along_shaft(scene, shaft_moment, scene.hub_inertia * sampled("hub spin rate")[:, 1])
    shaft_force = np.asarray(shaft_force)
    if scene.hub_mass:
        shaft_force[:, 2] += scene.hub_mass * scene.gravity
    actuators = np.zeros((len(time), len(blades)))
    for i in movable_blades(scene):
        actuators[:, i] = blades[i][1][:, 2]
    roots = (_at_root(scene, force, moment) for force, moment, _ in blades)
    return named_loads(roots, shaft_force, shaft_moment, actuators)


def _add_along_shaft(scene: Scene, moments: Array, sizes: Array) -> None:
    """Add moments along the shaft, (n,) N m, to moments in the base frame, (n, 3) N m, in place."""
    if not scene.shaft_tilt:
        moments[:, 1] += sizes
    else:
        moments += sizes[:, None] * shaft_axis(scene)


def _at_root(scene: Scene, force: Array, moment: Array) -> tuple[Array, Array]:
    """Return force and moment about the root of a blade, from those about the apex.

    Parameters
    ----------
    scene : the rotor, with the radius of its hub.
    force, moment : (n, 3) N and N m in the blade's frame.
    """
    if scene.hub_radius:
        moment = moment - np.cross([0.0, 0.0, scene.hub_radius], force)
    return force, moment


def tree_sensors(scene: Scene, on_link: Callable[[str, str, int, Array], Part]) -> list[Part]:
    """Return the sensors that `tree_loads` reads.

    Parameters
    ----------
    scene : the rotor.
    on_link : (name, quantity, link, point) -> sensor.
    """
    sensors = []
    for i, blade in enumerate(scene.blades):
        place = body_of_point(scene, i, blade.centre_of_mass)
        sensors += [
            on_link(name, output, *place) for name, output in _motion_outputs(scene, i).items()
        ]
    if scene.hub_inertia:
        sensors.append(on_link("hub spin rate", "AngularAccelerationLocal", 0, np.zeros(3)))
    return sensors


def chain_sensors(scene: Scene, hub: Body) -> list[Part]:
    """Return the sensors that `chain_loads` reads, except for the bodies' rotations.

    They are on joints, connectors, and blades that are part of the hub.

    Parameters
    ----------
    scene : the rotor.
    hub : the hub's body, from whose centre of mass the engine measures points.
    """
    sensors = _joint_sensors("shaft bearing", "shaft damper" if scene.shaft_damping else "")
    for i in range(len(scene.blades)):
        if i in movable_blades(scene):
            sensors += _joint_sensors(
                f"pitch bearing {i + 1}", f"pitch spring {i + 1}" if is_driven(scene, i) else ""
            )
            continue
        point = list(body_of_point(scene, i, scene.blades[i].centre_of_mass)[1] - hub.com)
        for name, output in _motion_outputs(scene, i).items():
            sensors.append(
                sensor(
                    name, "SensorBody", output, bodyNumber=Ref("object", "hub"), localPosition=point
                )
            )
    return sensors


def _joint_sensors(joint: str, connector: str) -> list[Part]:
    """Return the sensors of a joint and of its connector, a spring or damper; "" for none."""
    outputs = {f"{joint} force": ("ForceLocal", joint), f"{joint} torque": ("TorqueLocal", joint)}
    if connector:
        outputs[f"{connector} torque"] = ("TorqueLocal", connector)
    sensors = []
    for name, (output, item) in outputs.items():
        sensors.append(sensor(name, "SensorObject", output, objectNumber=Ref("object", item)))
    return sensors


def chain_loads(scene: Scene, sampled: Sampled) -> dict[str, Array]:
    """Compute the loads of the chain from multipliers of joints and moments of connectors.

    Parameters
    ----------
    scene : the rotor.
    sampled : (name of a sensor) -> its values.

    Returns
    -------
    dict of ndarray
        The loads, (n, ...), by name of the quantity.
    """
    hub = matrices(sampled("hub rotation"))
    roots, actuators = [], np.zeros((len(hub), len(scene.blades)))
    for i in range(len(scene.blades)):
        if i not in movable_blades(scene):
            roots.append(_at_root(scene, *_newton_euler(scene, i, sampled)[:2]))
            continue
        frames = matrices(sampled(f"blade {i + 1} rotation"))
        seat = hub @ mounting(scene, i)
        force, moment = _joint_reaction(f"pitch bearing {i + 1}", seat, frames, sampled)
        if is_driven(scene, i):
            actuators[:, i] = -sampled(f"pitch spring {i + 1} torque")[:, 0]
        # A joint exerts no moment about its own axis. The moment about this axis is that of the
        # connector.
        along = actuators[:, i, None] * [0.0, 0.0, 1.0]
        roots.append(_at_root(scene, _in_frames(frames, force), _in_frames(frames, moment) + along))
    ground = np.broadcast_to(rotation_x(scene.shaft_tilt) @ ALONG_SHAFT, hub.shape)
    force, moment = _joint_reaction("shaft bearing", ground, hub @ ALONG_SHAFT, sampled)
    if scene.shaft_damping:
        _add_along_shaft(scene, moment, -sampled("shaft damper torque")[:, 0])
    return named_loads(roots, force, moment, actuators)


def _joint_reaction(joint: str, seat: Array, root: Array, sampled: Sampled) -> tuple[Array, Array]:
    """Compute the force and the moment of a joint on its second body.

    The engine returns the force on the first body, in the axes of `seat`, and the multipliers λ of
    the constraints x₁·z₀ = 0 and y₁·z₀ = 0. Here z₀ is an axis of `seat`, x₁ and y₁ are axes of
    `root`. The moment is λ₀ z₀ × x₁ + λ₁ z₀ × y₁.

    Parameters
    ----------
    joint : name of the joint.
    seat, root : (n, 3, 3) frames of the joint on the first and on the second body.
    sampled : (name of a sensor) -> its values.

    Returns
    -------
    force, moment : ndarray, shape (n, 3)
        N and N m, in the base frame.
    """
    force = -_in_base(seat, sampled(f"{joint} force"))
    multipliers = sampled(f"{joint} torque")
    x, y, z = root[:, :, 0], root[:, :, 1], seat[:, :, 2]
    return force, multipliers[:, :1] * np.cross(z, x) + multipliers[:, 1:2] * np.cross(z, y)


def matrices(rows: Array) -> Array:
    """Return (n, 3, 3) matrices from the engine's rows of nine elements."""
    return rows.reshape(-1, 3, 3)


def _in_base(frames: Array, vectors: Array) -> Array:
    """Transform (n, 3) vectors to the base frame from a body's frames, (n, 3, 3)."""
    return np.asarray((frames @ vectors[:, :, None])[:, :, 0])


def _in_frames(frames: Array, vectors: Array) -> Array:
    """Transform (n, 3) vectors from the base frame to a body's frames, (n, 3, 3)."""
    return np.asarray((vectors[:, None, :] @ frames)[:, 0, :])
