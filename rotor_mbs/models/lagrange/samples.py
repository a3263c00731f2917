"""Run any integrator from segment to segment of the loads, and compute its trajectory.

The forces and moments in blade roots, shaft bearing and actuators follow by Newton's and Euler's
laws from the closed form's accelerations.

Symbols: a blade has azimuth φ, pitch θ, cone β, mass m, centre of mass r and inertia I about r;
s = sin θ, c = cos θ. Its angular velocity is ω = (Ω cos β s, Ω cos β c, θ̇ + Ω sin β), its angular
acceleration α = dω/dt. `up` is the z axis of the base frame, and e = (0, 0, hub radius) is the
root. All vectors are in the blade's frame. The force and the moment of the hub on the blade, about
its root, are

    F = m (α × r + ω × (ω × r) + g up),  M = I α + ω × I ω + (r - e) × F.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from fractions import Fraction
from typing import Any, NamedTuple

import numpy as np

from rotor_mbs.methods import time_limit
from rotor_mbs.models.lagrange import closed_form
from rotor_mbs.models.lagrange.closed_form import Function, LoadValues, load_values
from rotor_mbs.models.lagrange.heyoka_adapter import quad_arithmetic
from rotor_mbs.models.lagrange.parameters import (
    Convert,
    Lean,
    changing_rests,
    leans,
    phase_of,
    rotor_form,
)
from rotor_mbs.scenario.scene import Blade, Scene
from rotor_mbs.scenario.time_table import (
    ROTOR_TORQUE,
    Segment,
    is_constant,
    rest_place,
    torque_place,
    value_at,
    values_at,
    values_before,
)
from rotor_mbs.solution.quantities import named_loads
from rotor_mbs.solution.trajectory import (
    Array,
    Integration,
    Trajectory,
    all_coordinates,
    finite_rows,
)

# Difference (s, rad and rad/s) of the difference quotients of loads: far above rounding, and so
# small that loads change linearly.
_DIFFERENCE = 1e-6

# An array of shape (n,) or (n, 3), of doubles, or of quad numbers with the type object.
Numbers = Any


class Advance(NamedTuple):
    """Hold the result of the integration of one segment.

    Attributes
    ----------
    states : (k, variables) states at the samples that the integration reached.
    end : (variables,) state at the end of the segment, or where the integration failed.
    steps : number of steps.
    evaluations : number of evaluations of the right-hand side; None if they are not counted.
    message : why the end of the segment was not reached; "" if it was reached.
    """

    states: Any
    end: Any
    steps: int
    evaluations: int | None
    message: str


def over_segments(
    times: Array,
    segments: Sequence[Segment],
    initial: Any,
    advance: Callable[[Segment, Any, Array], Advance],
) -> tuple[Any, Integration]:
    """Integrate from segment to segment of the loads, and collect the samples.

    Parameters
    ----------
    times : (samples,) s, sample times; the first is the time of the initial state.
    segments : segments of the loads, in the order of time.
    initial : (variables,) initial state.
    advance : function (segment, state at its start, sample times inside) that integrates over a
        segment and returns an Advance.

    Returns
    -------
    states : ndarray, shape (n, variables)
        States at the samples before the first one that is not finite.
    integration : Integration
        The engine's report.
    """
    state, rows = initial, [initial[None, :]]
    steps, evaluations, message = 0, None, ""
    for segment in segments:
        # A sample at which two segments meet belongs to the earlier segment.
        inside = times[(times > segment.start) & (times <= segment.end)]
        part = advance(segment, state, inside)
        rows.append(part.states)
        steps, state, message = steps + part.steps, part.end, part.message
        if part.evaluations is not None:
            evaluations = (evaluations or 0) + part.evaluations
        if message:
            break
    states = np.concatenate(rows)
    states = states[: finite_rows(states.astype(float, copy=False))]
    reached = float(times[max(len(states) - 1, 0)])
    return states, Integration(
        not message, message, reached, steps, evaluations, message == time_limit.MESSAGE
    )


def trajectory(scene: Scene, times: Array, states: Array) -> Trajectory:
    """Return the quantities that the scene requests, computed from the states of a run.

    Parameters
    ----------
    scene : the rotor, its loads and the requested outputs.
    times : (samples,) s, sample times; the first n belong to `states`.
    states : (n, 2k) angles, then rates, of the k coordinates that move; or (n, 2k + 1) with the
        work (J) in the last column, if it was integrated.
    """
    count, time = len(scene.moving_coordinates), times[: len(states)]
    angles, rates = all_coordinates(scene, states[:, :count], states[:, count : 2 * count])
    fields: dict[str, Array] = {}
    if scene.wants("tip"):
        paths = []
        blades = zip(scene.blades, scene.phases, leans(scene), strict=True)
        for i, (blade, phase, lean) in enumerate(blades):
            azimuth, pitch = angles[:, 0] + phase, angles[:, 1 + i]
            path = closed_form.point_path(azimuth, pitch, blade.tip, np.sin, np.cos, lean)
            paths.append(np.broadcast_arrays(*path))
        rows = np.array(paths)
        fields["tip"] = np.ascontiguousarray(rows.transpose(2, 0, 1))
    if scene.wants("energy"):
        fields |= _energies(scene, time, angles, rates, states)
    if scene.wants("loads"):
        fields |= sampled_loads(scene, time, angles, rates)
    return Trajectory(time, angles, rates, **fields)


def _energies(
    scene: Scene, time: Array, all_angles: Array, all_rates: Array, states: Array
) -> dict[str, Array]:
    """Return kinetic and potential energy, and the work of the loads, (n,) J each.

    Parameters
    ----------
    scene : the rotor, its loads and gravity.
    time : (n,) s.
    all_angles, all_rates : (n, 1 + blades) rad and rad/s.
    states : see `trajectory`.
    """
    form, columns = rotor_form(scene), scene.moving_coordinates
    angles = list(all_angles[:, columns].T)
    rates = list(all_rates[:, columns].T)
    loads = loads_at(scene, time)
    # Rates of 1e200 overflow here. The judgement of the run finds numbers that are not finite.
    with np.errstate(over="ignore", invalid="ignore"):
        kinetic, potential = closed_form.energies(angles, rates, form, loads, np.sin, np.cos)
        if states.shape[1] <= 2 * len(columns):
            work = constant_work(scene, all_angles)
        else:
            work = states[:, 2 * len(columns)]
            # Add the part of the work of changing rest angles that `closed_form.power` leaves out.
            rests = at_constant_rests(changing_rests(scene), loads).rests
            energy = closed_form.rest_energy(angles, form, rests)
            if isinstance(energy, np.ndarray):
                work = work + (energy - energy[0])
    return {"kinetic_energy": kinetic, "potential_energy": potential, "work": work}


def loads_at(scene: Scene, time: Array) -> LoadValues:
    """Return the prescribed loads at the given times; at a jump, the values after it.

    Parameters
    ----------
    scene : the scene with the load tables.
    time : (n,) s.

    Returns
    -------
    LoadValues
        Loads of the coordinates that move. A constant load is a number, a changing one an array
        (n,).
    """
    return loads_over_time(scene)(time)


def loads_over_time(scene: Scene) -> Callable[[Array], LoadValues]:
    """Return the function `loads_at` of one scene, whose only parameter is the times (n,) in s.

    Parameters
    ----------
    scene : the scene with the load tables.
    """
    tables, pitches = scene.load_tables, scene.moving_coordinates[1:]
    constants = [value_at(table, 0.0) if is_constant(table) else None for table in tables]
    if None not in constants:
        constant_loads = load_values(constants, pitches)
        return lambda _time: constant_loads

    def at(time: Array) -> LoadValues:
        values: list[Any] = []
        for table, constant in zip(tables, constants, strict=True):
            values.append(values_at(table, time) if constant is None else constant)
        return load_values(values, pitches)

    return at


def loads_at_start(scene: Scene, torque: float = 0.0) -> LoadValues:
    """Return the loads of the coordinates that move at t = 0, with a given rotor torque.

    Parameters
    ----------
    scene : the scene with the pitch torques and rest angles.
    torque : N m, rotor torque that replaces that of the scene.
    """
    values = [value_at(table, 0.0) for table in scene.load_tables]
    values[ROTOR_TORQUE] = torque
    return load_values(values, scene.moving_coordinates[1:])


def at_constant_rests(changing: Sequence[bool], loads: LoadValues) -> LoadValues:
    """Return loads in which constant rest angles are set to zero, because they do no work.

    Parameters
    ----------
    changing : (pitches that move,) result of `changing_rests`.
    loads : loads of the coordinates that move.
    """
    rests = [rest if changes else 0.0 for rest, changes in zip(loads.rests, changing, strict=True)]
    return LoadValues(loads.rotor, loads.pitches, rests)


def constant_work(scene: Scene, angles: Array) -> Array:
    """Return the work of constant torques, (n,) J: the sum of torque times change of the angle.

    Parameters
    ----------
    scene : the scene with the torques and the initial angles.
    angles : (n, 1 + blades) rad.
    """
    work: Array = scene.torque_at(0.0) * (angles[:, 0] - scene.initial_angles[0])
    for i, torque in enumerate(scene.pitch_torque):
        work = work + value_at(torque, 0.0) * (angles[:, 1 + i] - scene.initial_angles[1 + i])
    return work


@dataclass(frozen=True)
class LoadParts:
    """Hold factors of the terms in the load quantities: 1 keeps a term, 0 leaves it out.

    Attributes
    ----------
    weight : factor of gravity.
    accelerations : factor of the coordinates' accelerations.
    rates : factor of the rates in the inertia forces that depend on rates.
    hub : factor of the hub's inertia in the moment of the shaft.
    inertia : factor of the blades' inertia about their centres of mass, in the moments of roots and
        shaft.
    dampers, torques : factors of the dampers and of the prescribed torques in the moments of the
        pitch actuators.
    """

    weight: float = 1.0
    accelerations: float = 1.0
    rates: float = 1.0
    hub: float = 1.0
    inertia: float = 1.0
    dampers: float = 1.0
    torques: float = 1.0


def sampled_loads(
    scene: Scene, times: Array, angles: Array, rates: Array, parts: LoadParts | None = None
) -> dict[str, Array]:
    """Return the load quantities (forces and moments in roots, shaft and actuators) of a motion.

    Parameters
    ----------
    scene : the rotor, its prescribed loads and gravity.
    times : (n,) s.
    angles, rates : (n, 1 + blades) rad and rad/s.
    parts : factors of the terms; by default all are 1.

    Returns
    -------
    dict of ndarray
        The result of `named_loads`, (n, ...) each. At a jump of a prescribed load, the quantities
        are those before the jump.
    """
    # Near a singularity numbers may overflow. The run is cut before samples that are not finite.
    with np.errstate(all="ignore"):
        return _loads(scene, times, angles, rates, float, np.sin, np.cos, parts)


def load_rounding(scene: Scene, times: Array, angles: Array, rates: Array) -> dict[str, Array]:
    """Return the errors of the load quantities that the rounding of times and states may cause.

    They can be large: the moment of a stiff bearing is a small difference of large moments. Each
    number counts with two roundings of half a unit in the last place. The first is its own, the
    second that of the number from which it is subtracted, such as the angle of a pitch command.

    Parameters
    ----------
    scene : the rotor, its loads and gravity.
    times : (n,) s.
    angles, rates : (n, 1 + blades) rad and rad/s.

    Returns
    -------
    dict of ndarray
        The error of each quantity of `sampled_loads`, in its shape and unit.
    """
    loads = sampled_loads(scene, times, angles, rates)
    rounding = {name: np.zeros_like(values) for name, values in loads.items()}
    numbers, count = np.column_stack([times, angles, rates]), angles.shape[1]
    for column, values in enumerate(numbers.T):
        moved = numbers.copy()
        # The change is negative. A load that jumps at a sample has its value before the jump there,
        # and therefore also at the changed time.
        moved[:, column] -= _DIFFERENCE
        last_digits = np.finfo(float).eps * np.abs(values) / _DIFFERENCE
        moved_times, moved_angles, moved_rates = np.split(moved, [1, 1 + count], axis=1)
        others = sampled_loads(scene, moved_times[:, 0], moved_angles, moved_rates)
        for name, other in others.items():
            rounding[name] += (np.abs(other - loads[name]).T * last_digits).T
    return rounding


def load_conditioning(scene: Scene, times: Array, angles: Array, rates: Array) -> dict[str, Array]:
    """Return the errors of the load quantities that the arithmetic of any engine may cause.

    An engine adds up moments of inertia forces and weights about some point, and rounds each of
    them. These rounding errors, multiplied by the inverse of the mass matrix, are errors of the
    accelerations, which cause errors of the load quantities. If the inertia of a blade about its
    pitch axis is small compared with m |r|^2, these errors are far larger than those of
    `load_rounding`.

    Parameters
    ----------
    scene : the rotor, its loads and gravity.
    times : (n,) s.
    angles, rates : (n, 1 + blades) rad and rad/s.

    Returns
    -------
    dict of ndarray
        The error of each quantity of `named_loads`, in its shape and unit.
    """
    form, moving = rotor_form(scene), scene.moving_coordinates
    applied = load_values(
        list(values_before(scene.load_segments, times)), scene.moving_coordinates[1:]
    )
    with np.errstate(all="ignore"):
        accelerations = closed_form.accelerations(
            list(angles[:, moving].T), list(rates[:, moving].T), form, applied, np.sin, np.cos
        )
        sizes = np.abs(
            np.stack([np.broadcast_to(row, times.shape) for row in accelerations], axis=1)
        )

        # Magnitude of the moments that an engine rounds, (n, moving coordinates). The moment on the
        # rotor is the sum over hub and blades.
        moments = np.zeros(sizes.shape)
        moments[:, 0] = scene.hub_inertia * sizes[:, 0]
        for i, blade in enumerate(scene.blades):
            arm = float(np.linalg.norm(blade.centre_of_mass))
            inertia = blade.mass * arm**2 + float(np.linalg.norm(blade.inertia_tensor))
            column = 1 + i
            turning = sizes[:, 0] + (np.abs(rates[:, 0]) + np.abs(rates[:, column])) ** 2
            if column in moving:
                turning = turning + sizes[:, moving.index(column)]
            moment = inertia * turning + blade.mass * scene.gravity * arm
            moments[:, 0] += moment
            if column in moving:
                moments[:, moving.index(column)] = moment
        inverse = _inverse_mass_matrices(scene, angles)
        # errors of the accelerations, (n, moving coordinates)
        lost = 2.0**-53 * np.einsum("nij,nj->ni", np.abs(inverse), moments)

        # Load quantities are linear in the accelerations. Their derivative by an acceleration is
        # the load quantity of a unit acceleration, at rest and without gravity.
        still, conditioning = np.zeros_like(rates), dict[str, Array]()
        for place, coordinate in enumerate(moving):
            unit = np.zeros_like(rates)
            unit[:, coordinate] = 1.0
            roots, shaft_force, shaft_moment = _reactions(
                scene, angles, still, unit, 0.0, float, np.sin, np.cos
            )
            _add_about_shaft(shaft_moment, scene.hub_inertia * unit[:, 0], scene, float)
            loads = named_loads(roots, shaft_force, shaft_moment, np.zeros_like(angles[:, 1:]))
            for name, values in loads.items():
                part = (np.abs(values).T * lost[:, place]).T
                conditioning[name] = conditioning[name] + part if name in conditioning else part
    return conditioning


def _inverse_mass_matrices(scene: Scene, angles: Array) -> Array:
    """Return the inverse of the mass matrix at each row of angles, by the Schur complement.

    Parameters
    ----------
    scene : the rotor.
    angles : (n, 1 + blades) rad.

    Returns
    -------
    ndarray, shape (n, k, k)
        1/(kg m²), inverse for the k coordinates that move.
    """
    # The inverse of the arrowhead is v vᵀ / S + diag(0, 1/Jzz, ...) with v = (-1, B/Jzz, ...).
    form, moving = rotor_form(scene), scene.moving_coordinates
    schur = np.full(len(angles), form.inertia)
    levers = [np.full(len(angles), -1.0)]  # the components of v
    for blade, column in zip(form.blades, moving[1:], strict=True):
        s, c = np.sin(angles[:, column]), np.cos(angles[:, column])
        schur += blade.schur_ss * (s * s) + blade.schur_cc * (c * c) + blade.schur_sc * (s * c)
        ratio = blade.ratio_s * s + blade.ratio_c * c
        levers.append(ratio + blade.lean.ratio if blade.lean else ratio)
    lever = np.stack(levers, axis=1)
    inverse = lever[:, :, None] * lever[:, None, :] / schur[:, None, None]
    for i, blade in enumerate(form.blades, start=1):
        inverse[:, i, i] += 1.0 / blade.pitch_inertia
    return np.asarray(inverse)


def quad_loads(scene: Scene, times: Array, states: Any) -> dict[str, Array]:
    """Return the load quantities, computed in quad precision and then rounded to doubles.

    Parameters
    ----------
    scene : the rotor, its prescribed loads and gravity.
    times : (n,) s.
    states : (n, 2k) or (n, 2k + 1) quad numbers, see `trajectory`.
    """
    count = len(scene.moving_coordinates)
    states = states.astype(object)
    angles, rates = all_coordinates(scene, states[:, :count], states[:, count : 2 * count])
    return _loads(scene, times, angles, rates, *quad_arithmetic())


def _loads(
    scene: Scene,
    times: Array,
    angles: Numbers,
    rates: Numbers,
    convert: Convert,
    sin: Function,
    cos: Function,
    parts: LoadParts | None = None,
) -> dict[str, Array]:
    """Return the load quantities, (n, ...) each, computed with numbers of any kind.

    At a jump of a prescribed load, the quantities are those before the jump.

    Parameters
    ----------
    scene : the rotor, its prescribed loads and gravity.
    times : (n,) s.
    angles, rates : (n, 1 + blades) rad and rad/s.
    convert, sin, cos : conversion to the kind of number, and its sine and cosine.
    parts : factors of the terms; by default all are 1.
    """
    moving, applied = scene.moving_coordinates, values_before(scene.load_segments, times)
    accelerations = np.zeros_like(angles)
    form, loads = rotor_form(scene, convert), load_values(list(applied), moving[1:])
    of_moving = closed_form.accelerations(
        angles[:, moving].T, rates[:, moving].T, form, loads, sin, cos
    )
    for column, values in zip(moving, of_moving, strict=True):
        accelerations[:, column] = values
    actuators = np.zeros_like(angles[:, 1:])
    for column in moving[1:]:
        stiffness, damping = scene.bearings[column - 1]
        torque, rest = applied[torque_place(column)], applied[rest_place(column)]
        if parts is not None:
            damping, torque = parts.dampers * damping, parts.torques * torque
        actuators[:, column - 1] = (
            torque - stiffness * (angles[:, column] - rest) - damping * rates[:, column]
        )
    gravity = scene.gravity
    if parts is not None:
        gravity, rates = parts.weight * gravity, parts.rates * rates
        accelerations = parts.accelerations * accelerations
        scene = _with_inertia(scene, parts)
    roots, shaft_force, shaft_moment = _reactions(
        scene, angles, rates, accelerations, gravity, convert, sin, cos
    )
    about_shaft = scene.hub_inertia * accelerations[:, 0] - applied[ROTOR_TORQUE]
    _add_about_shaft(shaft_moment, about_shaft, scene, convert)
    if scene.hub_mass:
        shaft_force[:, 2] += scene.hub_mass * gravity
    return named_loads(roots, shaft_force, shaft_moment, actuators)


def _with_inertia(scene: Scene, parts: LoadParts) -> Scene:
    """Return a scene in which the inertia of hub and blades is multiplied by factors.

    Parameters
    ----------
    scene : the scene.
    parts : the factors `hub`, and `inertia` for the blades about their centres of mass.
    """
    blades = []
    for blade in scene.blades:
        xx, yy, zz, xy, xz, yz = (parts.inertia * element for element in blade.inertia)
        blades.append(replace(blade, inertia=(xx, yy, zz, xy, xz, yz)))
    return replace(scene, blades=tuple(blades), hub_inertia=parts.hub * scene.hub_inertia)


def _add_about_shaft(moments: Numbers, sizes: Numbers, scene: Scene, convert: Convert) -> None:
    """Add moments about the shaft's axis to moment vectors in the base frame, in place.

    Parameters
    ----------
    moments : (n, 3) N m, moment vectors to which the moments are added.
    sizes : (n,) N m, moments about the shaft's axis.
    scene : the scene with the tilt of the shaft.
    convert : conversion to the kind of number.
    """
    lean = leans(scene, convert)[0]
    if not lean:
        moments[:, 1] += sizes
        return
    moments[:, 1] += sizes * lean.cos_tilt
    moments[:, 2] += sizes * lean.sin_tilt


def _reactions(
    scene: Scene,
    angles: Numbers,
    rates: Numbers,
    accelerations: Numbers,
    gravity: float,
    convert: Convert,
    sin: Function,
    cos: Function,
) -> tuple[list[tuple[Numbers, Numbers]], Numbers, Numbers]:
    """Return force and moment on each blade at its root, and their sums over the blades.

    Parameters
    ----------
    scene : the rotor.
    angles, rates, accelerations : (n, 1 + blades) rad, rad/s and rad/s².
    gravity : m/s².
    convert, sin, cos : conversion to the kind of number, and its sine and cosine.

    Returns
    -------
    roots : list of tuple of ndarray
        For each blade (n, 3) force and (n, 3) moment about its root, in the blade's frame.
    shaft_force, shaft_moment : ndarray, shape (n, 3)
        Sums over the blades of the forces, and of the moments about the apex, in the base frame.
        Inertia and weight of the hub are not included.
    """
    sin_q, cos_q = sin(angles[:, 0]), cos(angles[:, 0])
    radius = convert(Fraction(scene.hub_radius)) if scene.hub_radius else 0.0
    roots, in_base = [], []
    for i, (blade, lean) in enumerate(zip(scene.blades, leans(scene, convert), strict=True)):
        cos_phase, sin_phase = map(convert, phase_of(i, len(scene.blades)))
        azimuth = sin_q * cos_phase + cos_q * sin_phase, cos_q * cos_phase - sin_q * sin_phase
        pitch = sin(angles[:, 1 + i]), cos(angles[:, 1 + i])
        turning = rates[:, 0], rates[:, 1 + i], accelerations[:, 0], accelerations[:, 1 + i]
        force, moment = root_load(blade, azimuth, pitch, turning, gravity, lean)
        about_apex = moment
        if scene.hub_radius:
            root = np.array([0.0, 0.0, 1.0]) * radius
            moment = about_apex - np.cross(root, force)
        roots.append((force, moment))
        in_base.append(
            [_in_base_frame(vectors, azimuth, pitch, lean) for vectors in (force, about_apex)]
        )
    shaft_force, shaft_moment = (sum(vectors) for vectors in zip(*in_base, strict=True))
    return roots, shaft_force, shaft_moment


def root_load(
    blade: Blade,
    azimuth: tuple[Numbers, Numbers],
    pitch: tuple[Numbers, Numbers],
    turning: tuple[Numbers, Numbers, Numbers, Numbers],
    gravity: float,
    lean: Lean | None,
) -> tuple[Numbers, Numbers]:
    """Return the force, and the moment about the apex, of the hub on a blade.

    Both are (n, 3) in the blade's frame.

    Parameters
    ----------
    blade : the blade, with its mass, centre of mass and inertia.
    azimuth, pitch : sine and cosine of φ and of θ, (n,) each.
    turning : Ω, θ̇, dΩ/dt and dθ̇/dt, (n,) each in rad/s and rad/s².
    gravity : m/s².
    lean : cosines and sines of cone and tilt; None if both are 0.
    """
    (sin_phi, cos_phi), (s, c) = azimuth, pitch
    spin, rate, spin_rate, rate_rate = turning
    if lean is None:
        omega = np.stack([spin * s, spin * c, rate], axis=1)
        alpha = np.stack(
            [spin_rate * s + spin * rate * c, spin_rate * c - spin * rate * s, rate_rate], axis=1
        )
        up = np.stack([-sin_phi * c, sin_phi * s, cos_phi], axis=1)
    else:
        # `..._y` and `..._z` are components along the blade's y and z axes at zero pitch. These
        # axes are turned by the cone.
        spin_y, spin_z = spin * lean.cos_cone, spin * lean.sin_cone
        spin_rate_y, spin_rate_z = spin_rate * lean.cos_cone, spin_rate * lean.sin_cone
        up_x, up_radial = -sin_phi * lean.cos_tilt, cos_phi * lean.cos_tilt
        up_y = lean.sin_tilt * lean.cos_cone - up_radial * lean.sin_cone
        up_z = lean.sin_tilt * lean.sin_cone + up_radial * lean.cos_cone
        omega = np.stack([spin_y * s, spin_y * c, rate + spin_z], axis=1)
        alpha_x = spin_rate_y * s + spin_y * rate * c
        alpha_y = spin_rate_y * c - spin_y * rate * s
        alpha = np.stack([alpha_x, alpha_y, rate_rate + spin_rate_z], axis=1)
        up = np.stack([up_x * c + up_y * s, up_y * c - up_x * s, up_z], axis=1)
    r, inertia = np.array(blade.centre_of_mass), blade.inertia_tensor
    force = blade.mass * (np.cross(alpha, r) + np.cross(omega, np.cross(omega, r)) + gravity * up)
    return force, alpha @ inertia + np.cross(omega, omega @ inertia) + np.cross(r, force)


def _in_base_frame(
    vectors: Numbers,
    azimuth: tuple[Numbers, Numbers],
    pitch: tuple[Numbers, Numbers],
    lean: Lean | None,
) -> Numbers:
    """Return vectors of a blade's frame in the base frame: Rx(τ)·Ry(φ)·Rx(-β)·Rz(θ)·vector.

    Parameters
    ----------
    vectors : (n, 3) in the blade's frame.
    azimuth, pitch : sine and cosine of φ and of θ, (n,) each.
    lean : cosines and sines of cone β and tilt τ; None if both are 0.
    """
    (sin_phi, cos_phi), (s, c), (x, y, z) = azimuth, pitch, vectors.T
    across, along = x * c - y * s, x * s + y * c
    if lean:
        along, z = (
            along * lean.cos_cone + z * lean.sin_cone,
            z * lean.cos_cone - along * lean.sin_cone,
        )
    x, z = cos_phi * across + sin_phi * z, cos_phi * z - sin_phi * across
    if lean:
        along, z = (
            along * lean.cos_tilt - z * lean.sin_tilt,
            along * lean.sin_tilt + z * lean.cos_tilt,
        )
    return np.stack([x, along, z], axis=1)
