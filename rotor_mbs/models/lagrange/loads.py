"""Loads of the closed form by Newton's and Euler's laws, from its own accelerations: roots, shaft bearing, actuators.

Like the closed form it takes numbers of any kind that knows + - * /: arrays, and quad precision through heyoka.

Symbols, in the frame of a blade with azimuth φ and pitch θ: s = sin θ, c = cos θ; angular velocity
ω = (Ω s, Ω c, θ̇) and acceleration α = dω/dt; centre of mass r, inertia I about it; up = the base frame's z.
F = m (α × r + ω × (ω × r) + g up),  M = I α + ω × I ω + r × F: of the hub on the blade, about the hub centre.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from fractions import Fraction
from typing import Any, NamedTuple

import numpy as np

from rotor_mbs.models.lagrange import closed_form
from rotor_mbs.models.lagrange.closed_form import LoadValues, load_values
from rotor_mbs.models.lagrange.heyoka_adapter import Parameters, array_of, heyoka
from rotor_mbs.models.lagrange.parameters import Convert, Number, load_tables, loads_before, phase_of, rotor_form
from rotor_mbs.scenario.scene import Scene
from rotor_mbs.solution.trajectory import Array

Function = Callable[[Any], Any]
Vector = tuple[Number, Number, Number]


@dataclass(frozen=True, slots=True)
class BladeBody:
    """A blade as Newton's law needs it, in numbers of one kind.

    mass                    kg
    centre                  (3,) m, centre of mass in the blade's frame
    inertia                 (6,) kg m² about it: xx yy zz xy xz yz
    cos_phase, sin_phase    of its mounting angle
    stiffness, damping      N m/rad, N m s/rad; zero where the pitch does not move
    """

    mass: Number
    centre: Vector
    inertia: Sequence[Number]
    cos_phase: Number
    sin_phase: Number
    stiffness: Number
    damping: Number


class Motion(NamedTuple):
    """The motion of all coordinates, rotor first: angles in rad, rates in rad/s, accelerations in rad/s²."""

    angles: Sequence[Number]
    rates: Sequence[Number]
    accelerations: Sequence[Number]


class Loads(NamedTuple):
    """Force (N) and moment (N m) of the hub on each blade, of the bearing on the rotor; N m of the actuators."""

    root_forces: list[Vector]
    root_moments: list[Vector]
    shaft_force: Vector
    shaft_moment: Vector
    actuator_moments: list[Number]

    def numbers(self) -> list[Number]:
        """One after the other."""
        vectors = (*self.root_forces, *self.root_moments, self.shaft_force, self.shaft_moment)
        return [*(x for vector in vectors for x in vector), *self.actuator_moments]


def blade_bodies(scene: Scene, convert: Convert = float) -> list[BladeBody]:
    """The blades of `scene`, each number rounded once by `convert`."""

    def converted(values: Sequence[float]) -> list[Number]:
        return [convert(Fraction(value)) for value in values]

    return [
        BladeBody(
            convert(Fraction(blade.mass)),
            (*converted(blade.centre_of_mass),),
            converted(blade.inertia),
            *map(convert, phase_of(i, len(scene.blades))),
            *converted(scene.bearing(i) if blade.has_pitch_inertia else (0.0, 0.0)),
        )
        for i, blade in enumerate(scene.blades)
    ]


def loads(
    bodies: Sequence[BladeBody],
    motion: Motion,
    hub_inertia: Number,
    gravity: Number,
    applied: LoadValues,
    sin: Function,
    cos: Function,
) -> Loads:
    """All loads of a motion; hub_inertia in kg m², gravity in m/s²; applied: of every blade, pitching or not."""
    sin_q, cos_q = sin(motion.angles[0]), cos(motion.angles[0])
    forces, moments, actuators = [], [], []
    shaft_force: Vector = (0.0 * sin_q,) * 3
    shaft_moment: Vector = (0.0, hub_inertia * motion.accelerations[0] - applied.rotor, 0.0)
    for i, body in enumerate(bodies, start=1):
        azimuth = (
            sin_q * body.cos_phase + cos_q * body.sin_phase,
            cos_q * body.cos_phase - sin_q * body.sin_phase,
        )
        pitch = sin(motion.angles[i]), cos(motion.angles[i])
        turning = motion.rates[0], motion.rates[i], motion.accelerations[0], motion.accelerations[i]
        force, moment = root_load(body, azimuth, pitch, turning, gravity)
        forces.append(force)
        moments.append(moment)
        deflection = motion.angles[i] - applied.rests[i - 1]
        actuators.append(applied.pitches[i - 1] - body.stiffness * deflection - body.damping * motion.rates[i])
        shaft_force = _sum(shaft_force, _in_base_frame(force, azimuth, pitch))
        shaft_moment = _sum(shaft_moment, _in_base_frame(moment, azimuth, pitch))
    return Loads(forces, moments, shaft_force, shaft_moment, actuators)


def root_load(
    body: BladeBody,
    azimuth: tuple[Number, Number],
    pitch: tuple[Number, Number],
    turning: tuple[Number, Number, Number, Number],
    gravity: Number,
) -> tuple[Vector, Vector]:
    """Force and moment in the blade's frame. azimuth, pitch: sine and cosine; turning: Ω, θ̇, dΩ/dt, dθ̇/dt."""
    (sin_phi, cos_phi), (s, c) = azimuth, pitch
    spin, rate, spin_rate, rate_rate = turning
    omega = (spin * s, spin * c, rate)
    alpha = (spin_rate * s + spin * rate * c, spin_rate * c - spin * rate * s, rate_rate)
    up = (-sin_phi * c, sin_phi * s, cos_phi)
    r = body.centre
    acceleration = _sum(_cross(alpha, r), _cross(omega, _cross(omega, r)))
    force: Vector = tuple(body.mass * (a + gravity * u) for a, u in zip(acceleration, up, strict=True))
    change = _sum(_applied(body.inertia, alpha), _cross(omega, _applied(body.inertia, omega)))
    return force, _sum(change, _cross(r, force))


def _in_base_frame(vector: Vector, azimuth: tuple[Number, Number], pitch: tuple[Number, Number]) -> Vector:
    """Ry(φ)·Rz(θ)·vector."""
    (sin_phi, cos_phi), (s, c), (x, y, z) = azimuth, pitch, vector
    across = x * c - y * s
    return cos_phi * across + sin_phi * z, x * s + y * c, cos_phi * z - sin_phi * across


def _cross(a: Vector, b: Vector) -> Vector:
    return a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]


def _sum(a: Vector, b: Vector) -> Vector:
    return a[0] + b[0], a[1] + b[1], a[2] + b[2]


def _applied(inertia: Sequence[Number], v: Vector) -> Vector:
    xx, yy, zz, xy, xz, yz = inertia
    x, y, z = v
    return xx * x + xy * y + xz * z, xy * x + yy * y + yz * z, xz * x + yz * y + zz * z


def sampled_loads(scene: Scene, times: Array, angles: Array, rates: Array) -> dict[str, Array]:
    """The load quantities at the samples, in double precision; angles and rates (n, 1 + blades) rad, rad/s."""
    moving, applied = scene.moving_coordinates, load_values(loads_before(scene, times))
    accelerations: list[Any] = [0.0] * angles.shape[1]
    with np.errstate(all="ignore"):  # near a singularity; what is not finite cuts the run
        found = closed_form.accelerations(
            list(angles[:, moving].T), list(rates[:, moving].T), rotor_form(scene), applied, np.sin, np.cos
        )
        for column, values in zip(moving, found, strict=True):
            accelerations[column] = values
        motion = Motion(list(angles.T), list(rates.T), accelerations)
        every = _of_every_blade(scene, applied)
        numbers = loads(blade_bodies(scene), motion, scene.hub_inertia, scene.gravity, every, np.sin, np.cos).numbers()
    return _named(scene, np.array([np.broadcast_to(values, times.shape) for values in numbers]))


def quad_loads(scene: Scene, times: Array, states: Any) -> dict[str, Array]:
    """The loads in quad precision, rounded at the end; states (n, 2 × moving coordinates): angles, then rates."""
    engine, parameters = heyoka(), Parameters()
    form, moving = rotor_form(scene, parameters), scene.moving_coordinates
    count = len(moving)
    tables = load_tables(scene)
    names = [f"{letter}{i}" for letter, n in (("q", count), ("w", count), ("load", len(tables))) for i in range(n)]
    symbols = engine.make_vars(*names)
    state, applied = symbols[: 2 * count], load_values(symbols[2 * count :])
    found = closed_form.accelerations(state[:count], state[count:], form, applied, engine.sin, engine.cos)
    angles = [parameters.own(Fraction(angle)) for angle in scene.initial_angles]
    rates, accelerations = [0.0] * len(angles), [0.0] * len(angles)
    for i, column in enumerate(moving):
        angles[column], rates[column], accelerations[column] = state[i], state[count + i], found[i]
    bodies = blade_bodies(scene, parameters)
    hub, gravity = parameters(Fraction(scene.hub_inertia)), parameters(Fraction(scene.gravity))
    numbers = loads(
        bodies,
        Motion(angles, rates, accelerations),
        hub,
        gravity,
        _of_every_blade(scene, applied),
        engine.sin,
        engine.cos,
    ).numbers()
    rows = [engine.expression(0.0) + number for number in numbers]
    function = engine.cfunc(rows, symbols, fp_type=engine.real128, compact_mode=True)
    values = [
        array_of([Fraction(x) for x in over_time.tolist()], quad=True) for over_time in loads_before(scene, times)
    ]
    inputs = np.ascontiguousarray(np.vstack([states[:, : 2 * count].T, *values]))
    pars = array_of(parameters.values, quad=True)
    spread = np.ascontiguousarray(np.repeat(pars[:, None], len(times), axis=1))
    return _named(scene, function(inputs, pars=spread).astype(float))


def _of_every_blade(scene: Scene, applied: LoadValues) -> LoadValues:
    """Zero where the pitch does not move."""
    torques, rests = ([0.0] * len(scene.blades) for _ in range(2))
    for column, torque, rest in zip(scene.moving_coordinates[1:], applied.pitches, applied.rests, strict=True):
        torques[column - 1], rests[column - 1] = torque, rest
    return LoadValues(applied.rotor, torques, rests)


def _named(scene: Scene, numbers: Array) -> dict[str, Array]:
    """The quantities by name, of the (numbers, n) of `Loads.numbers`."""
    blades, rows = len(scene.blades), numbers.T
    cuts = np.cumsum([3 * blades, 3 * blades, 3, 3])
    forces, moments, shaft_force, shaft_moment, actuators = map(np.ascontiguousarray, np.split(rows, cuts, axis=1))
    return {
        "blade_root_force": forces.reshape(-1, blades, 3),
        "blade_root_moment": moments.reshape(-1, blades, 3),
        "shaft_force": shaft_force,
        "shaft_moment": shaft_moment,
        "pitch_actuator_moment": actuators,
    }
