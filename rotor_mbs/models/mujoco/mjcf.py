"""Describe the rotor as a model in MuJoCo's own format (MJCF), from raw scene data.

World frame: z up. The hub's body is turned by the tilt of the shaft about x, and turns about its
own y by the hinge "rotor"; blade i is a child of the hub, mounted at its phase about y and then its
cone about -x, and turns about its own z by the hinge "pitch i". Hinge angles are the scene's
angles, unwrapped. All origins are at the apex. A blade without inertia about its pitch axis has no
hinge: it is welded to the hub at its initial pitch.

Loads are actuators with the activation dynamics da/dt = u: the activation a is the torque in N m,
the control u its slope in N m/s. So a torque that is linear in time enters every stage of a step at
the stage's own time. A spring's rest angle is its `springref` where it is constant; where it
changes, it is the activation (rad) of an actuator whose gain is the spring's stiffness.

MuJoCo compiles no moving body whose mass or one of whose principal moments is 1e-15 or less. In
the MJCF text such a mass or moment, as of a point mass or a hub without inertia, is therefore
`LEAST`. `solver.Engine` sets these values to zero in the compiled model. If MuJoCo itself loads a
file, the values remain. They cause a relative error LEAST / J of the moment J of a blade about its
pitch axis: below round-off for the paper's blade (J = 110 kg m²), but 1e-5 for a small model of 1 g
with J = 2.5e-10 kg m².
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from xml.etree import ElementTree as ET

import numpy as np

from rotor_mbs.methods.base import BuiltItem
from rotor_mbs.scenario.scene import Scene
from rotor_mbs.scenario.time_table import (
    ROTOR_TORQUE,
    Segment,
    constant_value,
    is_constant,
    rest_place,
    steps_and_rows,
    torque_place,
)

LEAST = 2e-15  # smallest mass (kg) and principal moment (kg m²) in the text

INTEGRATORS = {"rk4": "RK4", "implicitfast": "implicitfast", "implicit": "implicit"}
_FILE_STEP = 2.5e-4  # s, the largest time step of a file: the default of mujoco/rk4


@dataclass(frozen=True)
class Load:
    """Describe an actuator: a moment on a coordinate that is a gain times a load over time.

    Attributes
    ----------
    name : name of the actuator.
    coordinate : 0 for the rotor, i for the pitch of blade i.
    gain : 1, or the stiffness (N m/rad) of a spring whose rest angle (rad) changes over time.
    place : place of the load in `Scene.load_tables`.
    """

    name: str
    coordinate: int
    gain: float
    place: int

    def activation(self, segment: Segment, time: float) -> float:
        """Return the load (N m or rad) at a time (s) of a segment."""
        return segment.at(self.place, time)

    def control(self, segment: Segment) -> float:
        """Return the slope of the load (per s) on a segment."""
        return segment.slopes[self.place]


def loads_of(scene: Scene) -> list[Load]:
    """Return the actuators of a scene, one for each load that needs one.

    The first actuator is the torque on the rotor. For each pitch that moves, the torque and the
    spring's rest angle follow. A rest angle needs an actuator only if it changes over time.

    Parameters
    ----------
    scene : the rotor and its loads.
    """
    loads = []
    if scene.has_torque:
        loads.append(Load("torque rotor", 0, 1.0, ROTOR_TORQUE))
    for number in scene.moving_coordinates[1:]:
        torque, rest = scene.pitch_loads[number - 1]
        if torque:
            loads.append(Load(f"torque pitch {number}", number, 1.0, torque_place(number)))
        if not is_constant(rest):
            stiffness, _ = scene.bearings[number - 1]
            loads.append(Load(f"rest pitch {number}", number, stiffness, rest_place(number)))
    return loads


def joint_name(coordinate: int) -> str:
    """Return the name of the hinge of a coordinate (0: rotor)."""
    return f"pitch {coordinate}" if coordinate else "rotor"


def model(scene: Scene, integrator: str, step: float) -> ET.Element:
    """Return the MJCF element tree of a scene.

    Parameters
    ----------
    scene : the rotor, its loads and outputs.
    integrator : a key of `INTEGRATORS`.
    step : s, the time step.
    """
    root = ET.Element("mujoco", model=scene.name or "rotor")
    ET.SubElement(root, "compiler", angle="radian")
    option = ET.SubElement(
        root,
        "option",
        timestep=numbers(step),
        integrator=INTEGRATORS[integrator],
        gravity=numbers(0.0, 0.0, -scene.gravity),
    )
    # No contacts or limits in the model; a state that overflows must end the run, not restart it.
    ET.SubElement(option, "flag", constraint="disable", contact="disable", autoreset="disable")
    world = ET.SubElement(root, "worldbody")
    hub = ET.SubElement(world, "body", name="hub")
    if scene.shaft_tilt:
        hub.set(
            "quat",
            numbers(math.cos(0.5 * scene.shaft_tilt), math.sin(0.5 * scene.shaft_tilt), 0.0, 0.0),
        )
    _joint(hub, 0, "0 1 0", 0.0, scene.shaft_damping)
    # A thin disc about the shaft: the other two moments have no effect.
    half = 0.5 * scene.hub_inertia
    # The mass affects the load on the shaft bearing only.
    hub_mass = scene.hub_mass if scene.wants("loads") else 0.0
    _inertial(hub, hub_mass, (0.0, 0.0, 0.0), (half, scene.hub_inertia, half, 0.0, 0.0, 0.0))
    for number in range(1, len(scene.blades) + 1):
        _blade(hub, scene, number)
    loads = loads_of(scene)
    actuators = ET.SubElement(root, "actuator") if loads else root
    for load in loads:
        ET.SubElement(
            actuators, "general", name=load.name, joint=joint_name(load.coordinate),
            dyntype="integrator", gainprm="1" if load.gain == 1.0 else numbers(load.gain),
        )  # fmt: skip
    return root


def text(root: ET.Element) -> str:
    """Return an element tree as indented text; `root` is changed in place."""
    ET.indent(root)
    return ET.tostring(root, encoding="unicode") + "\n"


def items(scene: Scene) -> list[BuiltItem]:
    """Return the elements of a scene's model as `show --build` lists them.

    Parameters
    ----------
    scene : the rotor, its loads and outputs.
    """
    kinds = {"body": "object", "joint": "node", "site": "marker", "general": "load"}
    built = []
    for element in model(scene, "rk4", 1.0).iter():
        if element.tag not in kinds:
            continue
        detail = element.tag
        if len(element.attrib) > 1:
            facts = []
            for key, value in element.attrib.items():
                if key not in ("name", "type"):
                    facts.append(f"{key} {value}")
            detail = f"{element.get('type', element.tag)}: {', '.join(facts)}"
        built.append(BuiltItem(kinds[element.tag], element.get("name", element.tag), detail))
    return built


def _blade(hub: ET.Element, scene: Scene, number: int) -> None:
    """Add a blade to the hub: body, hinge, inertia and tip.

    Parameters
    ----------
    hub : the element of the hub's body.
    scene : the rotor. The tip is added if it is an output of the scene.
    number : number of the blade, from 1.
    """
    blade, phase = scene.blades[number - 1], scene.phases[number - 1]
    pitch = 0.0 if blade.has_pitch_inertia else scene.initial_angles[number]
    # The quaternion of Ry(phase) Rz(pitch), scalar part first; with a cone Rx(-cone) is between the
    # two.
    c, s = math.cos(0.5 * phase), math.sin(0.5 * phase)
    cp, sp = math.cos(0.5 * pitch), math.sin(0.5 * pitch)
    mounting = c * cp, s * sp, s * cp, c * sp
    if blade.cone:
        cc, sc = math.cos(0.5 * blade.cone), -math.sin(0.5 * blade.cone)
        w, x, y, z = c * cc, c * sc, s * cc, -s * sc
        mounting = w * cp - z * sp, x * cp + y * sp, y * cp - x * sp, z * cp + w * sp
    body = ET.SubElement(hub, "body", name=f"blade {number}", quat=numbers(*mounting))
    if blade.has_pitch_inertia:
        stiffness, damping = scene.bearings[number - 1]
        _joint(
            body,
            number,
            "0 0 1",
            stiffness,
            damping,
            constant_value(scene.pitch_loads[number - 1][1]),
        )
    _inertial(body, blade.mass, blade.centre_of_mass, blade.inertia)
    if scene.wants("tip"):
        ET.SubElement(body, "site", name=f"tip {number}", pos=numbers(*blade.tip))


def _joint(
    body: ET.Element,
    coordinate: int,
    axis: str,
    stiffness: float,
    damping: float,
    rest: float = 0.0,
) -> None:
    """Add a hinge with its spring and damper to a body.

    Parameters
    ----------
    body : the element.
    coordinate : 0 for the rotor, i for the pitch of blade i.
    axis : axis of the hinge, as MJCF writes a vector.
    stiffness, damping : N m/rad and N m s/rad.
    rest : rad, the spring's rest angle.
    """
    joint = ET.SubElement(body, "joint", name=joint_name(coordinate), type="hinge", axis=axis)
    if stiffness:
        joint.set("stiffness", numbers(stiffness))
    if rest:
        joint.set("springref", numbers(rest))
    if damping:
        joint.set("damping", numbers(damping))


def _inertial(
    body: ET.Element, mass: float, centre: Iterable[float], inertia: Sequence[float]
) -> None:
    """Add mass (kg) and principal moments to a body.

    Parameters
    ----------
    body : the element.
    mass : kg.
    centre : (3,) m, centre of mass.
    inertia : xx yy zz xy xz yz about it, kg m².
    """
    element = ET.SubElement(body, "inertial", pos=numbers(*centre), mass=numbers(max(mass, LEAST)))
    xx, yy, zz, xy, xz, yz = inertia
    if not (xy or xz or yz):
        element.set("diaginertia", numbers(*_possible([xx, yy, zz])))
        return
    moments, axes = np.linalg.eigh(np.array([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]]))
    element.set("diaginertia", numbers(*_possible(moments.tolist())))
    element.set("xyaxes", numbers(*axes[:, 0].tolist(), *axes[:, 1].tolist()))


def _possible(moments: list[float]) -> list[float]:
    """Return principal moments that MuJoCo accepts.

    None is below `LEAST`, and none exceeds the sum of the other two by rounding.
    """
    least = [max(moment, LEAST) for moment in moments]
    total = sum(least)
    return [min(moment, total - moment) for moment in least]


def numbers(*values: float) -> str:
    """Return numbers with all their digits, as the text of an MJCF attribute."""
    return " ".join(repr(float(value)) for value in values)


def mjcf_file(scene: Scene) -> str:
    """Return the MJCF text of a scene for plain MuJoCo.

    Its step is the sample interval divided by a whole number. The keyframe "start" has the initial
    state and the loads at t = 0. The numeric "segment i" has the start time of segment i, and its
    loads (torques or rest angles) with their slopes. The capsules only show the blades.

    Parameters
    ----------
    scene : the rotor, its loads and outputs.
    """
    spacing = scene.duration / (scene.samples - 1)
    steps, _ = steps_and_rows(spacing, _FILE_STEP, rows_between=False)
    root, loads = model(scene, "rk4", spacing / steps), loads_of(scene)
    root.insert(0, ET.Comment(_header(scene, steps, bool(loads))))
    # A capsule from the hub to each tip, without mass or contact.
    reach = max(math.hypot(*blade.tip) for blade in scene.blades)
    bodies = {body.get("name"): body for body in root.iter("body")}
    for number, blade in enumerate(scene.blades, start=1):
        if any(blade.tip):
            ET.SubElement(
                bodies[f"blade {number}"],
                "geom",
                type="capsule",
                fromto=numbers(0.0, 0.0, 0.0, *blade.tip),
                size=numbers(0.01 * reach),
                mass="0",
                contype="0",
                conaffinity="0",
            )
    moving = scene.moving_coordinates
    key = ET.Element("key", name="start")
    key.set("qpos", numbers(*(scene.initial_angles[i] for i in moving)))
    key.set("qvel", numbers(*(scene.initial_rates[i] for i in moving)))
    if loads:
        custom = ET.SubElement(root, "custom")
        for number, segment in enumerate(scene.load_segments, start=1):
            activations = [load.activation(segment, segment.start) for load in loads]
            controls = [load.control(segment) for load in loads]
            data = numbers(segment.start, *activations, *controls)
            ET.SubElement(custom, "numeric", name=f"segment {number}", data=data)
            if number == 1:
                key.set("act", numbers(*activations))
                key.set("ctrl", numbers(*controls))
    ET.SubElement(root, "keyframe").append(key)
    return text(root)


def _header(scene: Scene, steps: int, has_loads: bool) -> str:
    """Return the comment at the head of a file, which says how to run it.

    Parameters
    ----------
    scene : gives title, samples and duration.
    steps : number of steps from one sample to the next.
    has_loads : whether the model has actuators.
    """
    lines = [
        scene.title or scene.name,
        (
            f"SI units, rad. {scene.samples} samples over {scene.duration!r} s, {steps} steps from "
            "one to the next."
        ),
        (
            "Start from the keyframe: mj_resetDataKeyframe(model, data, 0); then mj_step(model, "
            "data, nstep=...)."
        ),
    ]
    if has_loads:
        lines += [
            (
                "An actuator's activation is its torque in N m, its control the slope of the "
                "torque in N m/s. An actuator"
            ),
            (
                '"rest ..." has the rest angle of a spring in rad instead, and the stiffness as '
                "its gain."
            ),
            (
                "At the start of each segment (custom numerics: time, values, slopes) set data.act "
                "and data.ctrl to them."
            ),
            "Where a segment starts between two steps, shorten model.opt.timestep to stop there.",
        ]
    lines.append(
        "Point masses have the least inertia that MuJoCo compiles, 2e-15 kg m^2 about the centre "
        "of mass."
    )
    # XML allows no two hyphens in a comment.
    return "\n  " + "\n  ".join(line.replace("--", "- -") for line in lines) + "\n"
