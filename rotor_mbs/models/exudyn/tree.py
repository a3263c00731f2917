"""Describe the rotor as a kinematic tree with hub and blades as links.

Its coordinates are the angles, so that exact zeros stay exact.
"""

from __future__ import annotations

import numpy as np

from rotor_mbs.methods.base import BuiltItem
from rotor_mbs.models.exudyn import geometry
from rotor_mbs.models.exudyn.geometry import (
    Body,
    Part,
    Ref,
    blade_body,
    body_of_point,
    hub_body,
    mounting,
    movable_blades,
    rotation_x,
    sensor,
)
from rotor_mbs.models.exudyn.loads import Loads, moment_on, tree_sensors
from rotor_mbs.scenario.scene import Scene
from rotor_mbs.scenario.time_table import constant_value, is_constant
from rotor_mbs.solution.trajectory import Array

_TREE = Ref("object", "rotor")
_NODE = Ref("node", "joint angles")


def parts(scene: Scene, loads: Loads) -> list[Part]:
    """Return all parts of the engine's system for a scene, in the order in which they are added.

    Parameters
    ----------
    scene : the rotor, its start, and the outputs that are read by sensors.
    loads : the loads that the load functions read while the engine integrates.
    """
    moving = scene.moving_coordinates
    node = {
        "referenceCoordinates": [0.0] * len(moving),
        "initialCoordinates": [scene.initial_angles[column] for column in moving],
        "initialCoordinates_t": [scene.initial_rates[column] for column in moving],
        "numberOfODE2Coordinates": len(moving),
    }
    built = [
        Part("node", _NODE.name, "NodeGenericODE2", node, f"{len(moving)} coordinates"),
        _tree(scene),
    ]
    for number, column in enumerate(moving):
        moment = moment_on(scene, loads, column)
        if not moment.terms:
            continue
        angle_name, torque_name = "rotor angle", "rotor torque"
        if column:
            angle_name, torque_name = f"pitch angle {column}", f"pitch torque {column}"
        marker = {"nodeNumber": _NODE, "coordinate": number}
        built.append(Part("marker", angle_name, "MarkerNodeCoordinate", marker))
        load: dict[str, object] = {
            "markerNumber": Ref("marker", angle_name),
            "load": moment.at(0.0),
        }
        # A load function costs time: the load has one only where it changes.
        detail = "constant"
        if not all(is_constant(scene.load_tables[place]) for place, _ in moment.terms):
            load["loadUserFunction"] = moment.scalar
            detail = "over time"
        built.append(Part("load", torque_name, "LoadCoordinate", load, detail))
    built += [
        sensor("angles", "SensorNode", "Coordinates", "joint angles", nodeNumber=_NODE),
        sensor("rates", "SensorNode", "Coordinates_t", "joint rates", nodeNumber=_NODE),
    ]
    if scene.wants("tip"):
        for i, blade in enumerate(scene.blades):
            built.append(
                _link_sensor(f"tip {i + 1}", "Position", *body_of_point(scene, i, blade.tip))
            )
    if scene.wants("energy"):
        for link, body in enumerate(bodies(scene)):
            name = link_name(link)
            if body.mass:  # a hub without mass needs no path of its centre of mass
                built.append(_link_sensor(f"{name} position", "Position", link, body.com))
                built.append(_link_sensor(f"{name} velocity", "Velocity", link, body.com))
            if np.any(body.inertia):
                built.append(
                    _link_sensor(f"{name} spin", "AngularVelocityLocal", link, np.zeros(3))
                )
    if scene.wants("loads"):
        built += tree_sensors(scene, _link_sensor)
    return built


def items(scene: Scene) -> list[BuiltItem]:
    """Return the parts of a scene as `show --build` lists them."""
    return geometry.items(parts(scene, Loads(scene)))


def bodies(scene: Scene) -> list[Body]:
    """Return the links in order: hub, then the blades that pitch."""
    return [hub_body(scene), *(blade_body(scene.blades[i]) for i in movable_blades(scene))]


def link_name(link: int) -> str:
    """Return the name of a link in the names of its sensors."""
    return f"link {link}" if link else "hub"


def _tree(scene: Scene) -> Part:
    """Return the tree of a scene, with gravity, springs and dampers as its parameters.

    Parameters
    ----------
    scene : the rotor and gravity.
    """
    blades, links = movable_blades(scene), bodies(scene)
    mountings = [mounting(scene, i) for i in blades]
    parameters: dict[str, object] = {
        "nodeNumber": _NODE,
        "jointTypes": ["RevoluteY", *("RevoluteZ" for _ in blades)],
        "linkParents": [-1, *(0 for _ in blades)],
        "jointTransformations": [rotation_x(scene.shaft_tilt), *mountings],
        "jointOffsets": [[0.0, 0.0, 0.0] for _ in links],
        "linkMasses": [link.mass for link in links],
        "linkCOMs": [list(link.com) for link in links],
        "linkInertiasCOM": [link.inertia for link in links],
    }
    detail = f"{len(links)} links"
    if scene.gravity != 0.0:
        parameters["gravity"] = [0.0, 0.0, -scene.gravity]
        detail += ", gravity"
    if any(stiffness := [scene.bearings[i][0] for i in blades]):
        parameters["jointPControlVector"] = [0.0, *stiffness]
        parameters["jointPositionOffsetVector"] = [
            0.0,
            *(constant_value(scene.pitch_loads[i][1]) for i in blades),
        ]
        detail += ", bearing stiffness"
    damping = [scene.dampings[column] for column in scene.moving_coordinates]
    if any(damping):
        parameters["jointDControlVector"] = damping
        parameters["jointVelocityOffsetVector"] = [0.0 for _ in links]
        detail += ", damping"
    return Part("object", _TREE.name, "ObjectKinematicTree", parameters, detail)


def _link_sensor(name: str, quantity: str, link: int, point: Array) -> Part:
    """Return a sensor at a point, (3,) m in the frame of a link."""
    return sensor(
        name,
        "SensorKinematicTree",
        quantity,
        objectNumber=_TREE,
        linkNumber=link,
        localPosition=list(point),
    )
