"""Describe the rotor as a chain of free bodies connected by joints: ground, hub, blades.

Its coordinates are redundant. Nodes are at centres of mass. The hub is a body even without mass and
inertia. Its joints then determine its motion.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np

from rotor_mbs.methods.base import BuiltItem
from rotor_mbs.models.exudyn import geometry
from rotor_mbs.models.exudyn.geometry import Part, Ref, sensor
from rotor_mbs.models.exudyn.loads import (
    Loads,
    Moment,
    along_shaft,
    chain_sensors,
    is_driven,
    moment_on,
)
from rotor_mbs.scenario.scene import Scene
from rotor_mbs.scenario.time_table import constant_value, is_constant
from rotor_mbs.solution.trajectory import Array


@dataclass(frozen=True)
class Placed:
    """Hold a body as it is placed at the start."""

    name: str
    body: geometry.Body
    rotation: Array  # (3, 3) from its frame to the base frame
    quaternion: Array  # (4,) Euler parameters of the same rotation
    axis: Array  # (3,) axis of its bearing, in the base frame
    omega: Array  # (3,) rad/s in the base frame, angular velocity


def placed_bodies(scene: Scene) -> list[Placed]:
    """Return hub and blades that pitch as forward kinematics places them at the start.

    Positions and velocities fit the joints.

    Parameters
    ----------
    scene : the rotor and its initial state.
    """
    rotor, tilt = scene.initial_angles[0], scene.shaft_tilt
    shaft = geometry.shaft_axis(scene)
    spin = scene.initial_rates[0] * shaft
    rotation, pose = _rotor_rotation(scene, rotor), geometry.quaternion(rotor, 0.0, tilt)
    bodies = [Placed("hub", geometry.hub_body(scene), rotation, pose, shaft, spin)]
    for i in geometry.movable_blades(scene):
        pitch, pitch_rate = scene.initial_angles[1 + i], scene.initial_rates[1 + i]
        about_shaft, cone = rotor + scene.phases[i], scene.blades[i].cone
        unpitched = _rotor_rotation(scene, about_shaft)
        if cone:
            unpitched = unpitched @ geometry.rotation_x(-cone)
        axis = unpitched[:, 2].copy()
        rotation, pose = (
            unpitched @ geometry.rotation_z(pitch),
            geometry.quaternion(about_shaft, pitch, tilt, cone),
        )
        body = geometry.blade_body(scene.blades[i])
        bodies.append(
            Placed(f"blade {i + 1}", body, rotation, pose, axis, spin + pitch_rate * axis)
        )
    return bodies


def _rotor_rotation(scene: Scene, about_shaft: float) -> Array:
    """Return the rotation from a frame of the rotor to the base frame, (3, 3).

    Parameters
    ----------
    scene : the rotor, whose shaft may be tilted.
    about_shaft : rad, by which the frame is turned about the shaft.
    """
    turned = geometry.rotation_y(np.cos(about_shaft), np.sin(about_shaft))
    return geometry.rotation_x(scene.shaft_tilt) @ turned if scene.shaft_tilt else turned


def parts(scene: Scene, loads: Loads, node: str = "euler_parameters") -> list[Part]:
    """Return all parts of the engine's system for a scene, in the order in which they are added.

    Parameters
    ----------
    scene : the rotor, its start, and the outputs that are read by sensors.
    loads : the loads that the load functions read while the engine integrates.
    node : coordinates of a body's rotation, as in the settings.
    """
    hub, *blades = placed_bodies(scene)
    built = [Part("object", "ground", "ObjectGround")]
    for placed in (hub, *blades):
        built += _body(placed, node)
        # Free bodies have no gravity in the engine: gravity is a load on every body.
        if scene.gravity != 0.0 and placed.body.mass:
            mass = Part(
                "marker",
                f"{placed.name} mass",
                "MarkerBodyMass",
                {"bodyNumber": Ref("object", placed.name)},
            )
            weight = {
                "markerNumber": Ref("marker", mass.name),
                "loadVector": [0.0, 0.0, -scene.gravity],
            }
            built += [
                mass,
                Part("load", f"gravity on {placed.name}", "LoadMassProportional", weight),
            ]
    ground = _marker(
        "ground",
        "at shaft",
        geometry.rotation_x(scene.shaft_tilt) @ geometry.ALONG_SHAFT,
        np.zeros(3),
    )
    built += _bearing("shaft bearing", ground, _on_body(hub, "at shaft", geometry.ALONG_SHAFT))
    for i, blade in zip(geometry.movable_blades(scene), blades, strict=True):
        seat = _on_body(hub, f"at bearing {i + 1}", geometry.mounting(scene, i))
        built += _bearing(f"pitch bearing {i + 1}", seat, _on_body(blade, "at bearing", np.eye(3)))
        built += _pitch_spring(scene, loads, i, seat.name, f"{blade.name} at bearing")
    if scene.shaft_damping:
        built.append(
            _spring("shaft damper", "ground at shaft", "hub at shaft", damping=scene.shaft_damping)
        )
    if scene.has_torque:
        load: dict[str, object] = {
            "markerNumber": Ref("marker", "hub at shaft"),
            "loadVector": along_shaft(scene, scene.rotor_torque[0][1]),
        }
        if not scene.has_constant_torque:
            load["loadVectorUserFunction"] = _torque_on_shaft(scene, moment_on(scene, loads, 0))
        detail = "constant" if scene.has_constant_torque else "over time"
        built.append(Part("load", "rotor torque", "LoadTorqueVector", load, detail))
    # Joint angles and rates are no coordinates here. They are computed from these sensors.
    bodies = [hub, *blades]
    for placed in bodies:
        name, of_node = placed.name, Ref("node", placed.name)
        built.append(sensor(f"{name} position", "SensorNode", "Position", nodeNumber=of_node))
        built.append(sensor(f"{name} rotation", "SensorNode", "RotationMatrix", nodeNumber=of_node))
        built.append(
            sensor(f"{name} spin", "SensorNode", "AngularVelocityLocal", nodeNumber=of_node)
        )
        if scene.wants("energy") and placed.body.mass:
            built.append(sensor(f"{name} velocity", "SensorNode", "Velocity", nodeNumber=of_node))
    if scene.wants("tip"):
        for i, tip in enumerate(blade.tip for blade in scene.blades):
            number, point = geometry.body_of_point(scene, i, tip)
            body, position = (
                Ref("object", bodies[number].name),
                list(point - bodies[number].body.com),
            )
            built.append(
                sensor(
                    f"tip {i + 1}",
                    "SensorBody",
                    "Position",
                    bodyNumber=body,
                    localPosition=position,
                )
            )
    if scene.wants("loads"):
        built += chain_sensors(scene, hub.body)
    return built


def items(scene: Scene) -> list[BuiltItem]:
    """Return the parts of a scene as `show --build` lists them."""
    return geometry.items(parts(scene, Loads(scene)))


def _body(placed: Placed, node: str) -> list[Part]:
    """Return the node and the object of a body.

    Parameters
    ----------
    placed : the body and its initial pose and velocity.
    node : coordinates of the body's rotation, as in the settings.
    """
    body, name = placed.body, placed.name
    position = placed.rotation @ body.com
    # A rate without bound may overflow here; the run then reports the failure.
    with np.errstate(over="ignore", invalid="ignore"):
        velocity = np.cross(placed.omega, position)
    p = placed.quaternion
    if node == "euler_parameters":
        type_, pose, motion = "NodeRigidBodyEP", p, geometry.quaternion_rate(p, placed.omega)
    else:
        # Velocity coordinates of this node are the angular velocity in the body's frame.
        type_, pose = "NodeRigidBodyRotVecLG", geometry.rotation_vector(p)
        motion = placed.rotation.T @ placed.omega
    parameters = {
        "referenceCoordinates": [*position, *pose],
        "initialCoordinates": [0.0] * (3 + len(pose)),
        "initialVelocities": [*velocity, *motion],
    }
    tensor = body.inertia
    inertia = {
        "nodeNumber": Ref("node", name),
        "mass": body.mass,
        # the engine's order
        "inertia": [*np.diag(tensor), tensor[1, 2], tensor[0, 2], tensor[0, 1]],
    }
    what = f"{body.mass:g} kg" if body.mass else "massless"
    return [
        Part("node", name, type_, parameters, "at the centre of mass"),
        Part("object", name, "ObjectRigidBody", inertia, what),
    ]


def _on_body(placed: Placed, where: str, rotation: Array) -> Part:
    """Return a marker at the apex, with a (3, 3) rotation, that is fixed on a body."""
    return _marker(placed.name, where, rotation, -placed.body.com)


def _marker(body: str, where: str, rotation: Array, position: Array) -> Part:
    """Return a marker fixed on a body.

    Parameters
    ----------
    body : its name.
    where : text after the body's name in the marker's name.
    rotation, position : (3, 3), and (3,) m, both in the body's frame.
    """
    parameters = {"bodyNumber": Ref("object", body), "localHT": (rotation, position)}
    return Part("marker", f"{body} {where}", "MarkerBodyRigid", parameters)


def _bearing(name: str, first: Part, second: Part) -> list[Part]:
    """Return two markers and the revolute joint about the z axes of both."""
    markers = (Ref("marker", first.name), Ref("marker", second.name))
    return [first, second, Part("object", name, "ObjectJointRevoluteZ", {"markerNumbers": markers})]


def _pitch_spring(scene: Scene, loads: Loads, blade: int, seat: str, root: str) -> list[Part]:
    """Return spring, damper and torque between hub and blade; [] where none of them acts.

    Parameters
    ----------
    scene : the rotor.
    loads : the loads that a torque over time reads while the engine integrates.
    blade : counted from 0.
    seat, root : names of the markers on the hub and on the blade.
    """
    if not is_driven(scene, blade):
        return []
    stiffness, damping = scene.bearings[blade]
    _, rest = scene.pitch_loads[blade]
    name, moment = f"pitch spring {blade + 1}", moment_on(scene, loads, 1 + blade)
    constants = {"stiffness": stiffness, "damping": damping, "offset": constant_value(rest)}
    if all(map(is_constant, scene.pitch_loads[blade])):
        constants["torque"] = -moment.at(0.0)  # the engine takes it as a resisting torque
    constants = {key: value for key, value in constants.items() if value}
    built, counter = [], ""
    if stiffness:
        counter = f"turns of {name}"
        turns = {
            "initialCoordinates": [scene.initial_angles[1 + blade]],
            "numberOfDataCoordinates": 1,
        }
        built.append(Part("node", counter, "NodeGenericData", turns, "the angle over many turns"))
    spring = _spring(name, seat, root, counter, **constants)
    if "torque" not in constants and moment.terms:
        parameters = {**spring.parameters, "springTorqueUserFunction": _spring_torque(moment)}
        detail = f"{spring.detail}, torque over time".removeprefix(", ")
        spring = replace(spring, parameters=parameters, detail=detail)
    return [*built, spring]


def _torque_on_shaft(scene: Scene, moment: Moment) -> Callable[..., list[float]]:
    """Return the load function of the rotor torque: a vector in the base frame, N m."""

    def torque(_system: object, time: float, _load: object) -> list[float]:
        return along_shaft(scene, moment.at(time))

    return torque


def _spring_torque(moment: Moment) -> Callable[..., float]:
    """Return the function by which the engine computes a spring's torque.

    It gives the torque (N m) that resists a rotation (rad) and its rate (rad/s).
    """

    def torque(
        _system: object, time: float, _item: int, rotation: float, rate: float,
        stiffness: float, damping: float, offset: float,
    ) -> float:  # fmt: skip
        return stiffness * (rotation - offset) + damping * rate - moment.at(time)

    return torque


def _spring(name: str, first: str, second: str, counter: str = "", **constants: float) -> Part:
    """Return a torsional spring and damper between two markers.

    Parameters
    ----------
    first, second : names of the markers.
    counter : name of the node that counts its turns; "" for none.
    constants : the engine's arguments, such as stiffness and damping.
    """
    parameters: dict[str, object] = {
        "markerNumbers": (Ref("marker", first), Ref("marker", second)),
        **constants,
    }
    if counter:
        parameters["nodeNumber"] = Ref("node", counter)
    detail = ", ".join(f"{key} {value:g}" for key, value in constants.items())
    return Part("object", name, "ObjectConnectorTorsionalSpringDamper", parameters, detail)
