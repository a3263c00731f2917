"""Compute rotations and rigid bodies of the rotor, and describe the parts of an engine's system.

Base frame: z up; the shaft is y of the shaft frame, which is the base frame turned by the tilt
about x. Blade i is mounted in the hub frame, turned by its phase about y and by its cone about -x,
and turns by its pitch about its own z: R_i = Rx(tilt) Ry(rotor + phase_i) Rx(-cone_i) Rz(pitch_i).
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field

import numpy as np

from rotor_mbs.methods.base import BuiltItem
from rotor_mbs.scenario.scene import Blade, Scene
from rotor_mbs.solution.trajectory import Array

# (3, 3) frame whose z axis is the shaft: columns are its x, y, z.
ALONG_SHAFT = np.array([[0.0, 1.0, 0.0], [0.0, 0.0, 1.0], [1.0, 0.0, 0.0]])


@dataclass(frozen=True)
class Body:
    """Hold a rigid body in its own frame, whose origin is the apex."""

    mass: float  # kg
    com: Array  # (3,) m, centre of mass
    inertia: Array  # (3, 3) kg m² about the centre of mass


def rotation_y(cosine: float, sine: float) -> Array:
    """Return the turn about the shaft, (3, 3), by the cosine and the sine of its angle.

    Its y row and column are exact, so that components out of the rotor plane stay exactly zero.
    """
    return np.array([[cosine, 0.0, sine], [0.0, 1.0, 0.0], [-sine, 0.0, cosine]])


def rotation_z(angle: float) -> Array:
    """Return the turn about z by an angle in rad, (3, 3)."""
    c, s = math.cos(angle), math.sin(angle)
    return np.array([[c, -s, 0.0], [s, c, 0.0], [0.0, 0.0, 1.0]])


def rotation_x(angle: float) -> Array:
    """Return the turn about x by an angle in rad, (3, 3); exactly the identity for 0."""
    if not angle:
        return np.eye(3)
    c, s = math.cos(angle), math.sin(angle)
    return np.array([[1.0, 0.0, 0.0], [0.0, c, -s], [0.0, s, c]])


def mounting(scene: Scene, index: int) -> Array:
    """Return the rotation from a blade's frame at zero pitch to the hub frame, (3, 3).

    Parameters
    ----------
    scene : the rotor.
    index : number of the blade, from 0.
    """
    mounted, cone = rotation_y(*_turn(index, len(scene.blades))), scene.blades[index].cone
    return mounted @ rotation_x(-cone) if cone else mounted


def shaft_axis(scene: Scene) -> Array:
    """Return the direction of the shaft in the base frame, (3,)."""
    return rotation_x(scene.shaft_tilt)[:, 1]


def _turn(part: int, whole: int) -> tuple[float, float]:
    """Return cosine and sine of 2π part/whole, folded into the first half quadrant.

    This makes blades that balance each other balance exactly.
    """
    quarter, rest = divmod(4 * part, whole)
    quarters = min(rest, whole - rest) / whole
    angle = 0.5 * math.pi * quarters
    cosine = math.cos(angle)
    # math.sin(π/6) is not exactly 0.5, with which three blades balance exactly.
    sine = 0.5 if math.isclose(quarters, 1.0 / 3.0, rel_tol=1e-15) else math.sin(angle)
    if 2 * rest > whole:
        cosine, sine = sine, cosine
    return [(cosine, sine), (-sine, cosine), (-cosine, -sine), (sine, -cosine)][quarter % 4]


def quaternion(about_shaft: float, pitch: float, tilt: float = 0.0, cone: float = 0.0) -> Array:
    """Return the Euler parameters of Rx(tilt) Ry(about_shaft) Rx(-cone) Rz(pitch).

    Parameters
    ----------
    about_shaft, pitch, tilt, cone : rad.

    Returns
    -------
    ndarray, shape (4,)
        Scalar first.
    """
    c, s = math.cos(0.5 * about_shaft), math.sin(0.5 * about_shaft)
    cp, sp = math.cos(0.5 * pitch), math.sin(0.5 * pitch)
    if not (tilt or cone):
        return np.array([c * cp, s * sp, s * cp, c * sp])
    about_x = [
        np.array([math.cos(0.5 * angle), math.sin(0.5 * angle), 0.0, 0.0])
        for angle in (tilt, -cone)
    ]
    rotor = _quaternion_product(about_x[0], np.array([c, 0.0, s, 0.0]))
    blade = _quaternion_product(about_x[1], np.array([cp, 0.0, 0.0, sp]))
    return _quaternion_product(rotor, blade)


def _quaternion_product(p: Array, q: Array) -> Array:
    """Return the Euler parameters of the rotation `p` after the rotation `q`, (4,)."""
    scalar = p[0] * q[0] - p[1:] @ q[1:]
    return np.concatenate([[scalar], p[0] * q[1:] + q[0] * p[1:] + np.cross(p[1:], q[1:])])


def quaternion_rate(p: Array, omega: Array) -> Array:
    """Return the time derivative of Euler parameters, (4,) per s.

    Parameters
    ----------
    p : (4,), scalar first.
    omega : (3,) rad/s, angular velocity in the base frame.
    """
    e0, e = p[0], p[1:]
    return 0.5 * np.concatenate([[-(e @ omega)], e0 * omega + np.cross(omega, e)])


def rotation_vector(p: Array) -> Array:
    """Return axis times angle, (3,) rad, of the rotation with given Euler parameters.

    Its length is at most π.

    Parameters
    ----------
    p : (4,), scalar first.
    """
    p = p if p[0] >= 0.0 else -p  # both are the same rotation
    length = float(np.linalg.norm(p[1:]))
    return 2.0 * p[1:] if length == 0.0 else p[1:] * (2.0 * math.atan2(length, p[0]) / length)


def movable_blades(scene: Scene) -> tuple[int, ...]:
    """Return the indices (from 0) of the blades whose pitch has inertia.

    The other blades are rigid parts of the hub.
    """
    return tuple(i for i, blade in enumerate(scene.blades) if blade.has_pitch_inertia)


def fixed_blade_rotation(scene: Scene, index: int) -> Array:
    """Return the rotation from the frame of a blade that cannot pitch to the hub frame, (3, 3).

    Parameters
    ----------
    scene : the rotor. The blade is fixed at its initial pitch.
    index : number of the blade, from 0.
    """
    return mounting(scene, index) @ rotation_z(scene.initial_angles[1 + index])


def body_of_point(scene: Scene, index: int, point: Sequence[float]) -> tuple[int, Array]:
    """Return the body that a point of a blade belongs to, and its place in that body's frame.

    Parameters
    ----------
    scene : the rotor.
    index : number of the blade, from 0.
    point : (3,) m in the blade's frame.

    Returns
    -------
    body : int
        0 for the hub, k for the k-th blade that pitches.
    place : ndarray, shape (3,)
        Place of the point in the frame of this body, m.
    """
    blades = movable_blades(scene)
    if index in blades:
        return 1 + blades.index(index), np.array(point)
    return 0, fixed_blade_rotation(scene, index) @ np.array(point)


def blade_body(blade: Blade) -> Body:
    """Return a blade as a rigid body in its own frame."""
    return Body(blade.mass, np.array(blade.centre_of_mass), blade.inertia_tensor)


def hub_body(scene: Scene) -> Body:
    """Return the hub as one rigid body with every blade that cannot pitch.

    The hub itself is a thin disc about the shaft. The disc's other two moments, half of the axial
    one, have no effect, but without them no such body could exist. The mass of the hub is at the
    apex and affects only the load on the shaft bearing. It is left out unless loads are requested.

    Parameters
    ----------
    scene : the rotor and its outputs.
    """
    half = 0.5 * scene.hub_inertia
    mass = scene.hub_mass if scene.wants("loads") else 0.0
    parts = [Body(mass, np.zeros(3), np.diag([half, scene.hub_inertia, half]))]
    for index, blade in enumerate(scene.blades):
        if not blade.has_pitch_inertia:
            body, rotation = blade_body(blade), fixed_blade_rotation(scene, index)
            parts.append(Body(body.mass, rotation @ body.com, rotation @ body.inertia @ rotation.T))
    return _joined(parts)


def _joined(parts: list[Body]) -> Body:
    """Return several bodies, given in one frame, as a single one."""
    mass = sum(part.mass for part in parts)
    com = sum((part.mass * part.com for part in parts), np.zeros(3)) / mass if mass else np.zeros(3)
    inertia = np.zeros((3, 3))
    for part in parts:
        r = part.com - com
        inertia += part.inertia + part.mass * (r @ r * np.eye(3) - np.outer(r, r))
    return Body(mass, com, inertia)


# Arguments that are lists in the engine's own types, and these types.
LISTS = {
    "jointTransformations": "Matrix3DList",
    "linkInertiasCOM": "Matrix3DList",
    "jointOffsets": "Vector3DList",
    "linkCOMs": "Vector3DList",
}


@dataclass(frozen=True)
class Ref:
    """Refer to another part by kind and name, in place of the number that the engine gives it."""

    kind: str
    name: str


@dataclass(frozen=True)
class Part:
    """Describe one item of the engine's system.

    `type` is the engine's name of it, `parameters` its arguments, with Ref where they name other
    parts.
    """

    kind: str
    name: str
    type: str
    parameters: Mapping[str, object] = field(default_factory=dict)
    detail: str = ""


def sensor(name: str, type_: str, quantity: str, detail: str = "", **where: object) -> Part:
    """Return a sensor that keeps its readings in memory.

    Parameters
    ----------
    name : name of the sensor.
    type_ : the engine's name of the sensor's type.
    quantity : the engine's name of the quantity that the sensor reads.
    detail : text for `show --build`; "" for the quantity.
    where : arguments that say what is measured.
    """
    stored = {"outputVariableType": quantity, "storeInternal": True, "writeToFile": False, **where}
    return Part("sensor", name, type_, stored, detail or quantity)


def items(parts: Sequence[Part]) -> list[BuiltItem]:
    """Return the parts as `show --build` lists them."""
    built = []
    for part in parts:
        detail = f"{part.type}: {part.detail}" if part.detail else part.type
        built.append(BuiltItem(part.kind, part.name, detail))
    return built
