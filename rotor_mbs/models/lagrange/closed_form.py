"""Evaluate the closed form: accelerations by an arrowhead solve, energies, and paths of points.

The functions are used with NumPy, SciPy and heyoka. Each takes numbers of any kind that has + - * /
(floats, arrays, quad precision, symbolic expressions), and a sine and a cosine for that kind. No
function branches on the value of a number.

Symbols: φ = q2 + 2π(i-1)/N azimuth of blade i, θ its pitch, Ω = q̇2, s = sin θ, c = cos θ; τ tilt,
β cone. The blade's axes in the base frame are Rx(τ) Ry(φ) Rx(-β) Rz(θ), so that its angular
velocity in its own axes is

    ω = (Ω cos β s, Ω cos β c, θ̇ + Ω sin β).

With J the blade's inertia about the apex, a = Jxx s² + Jyy c² + 2 Jxy s c and b = Jxz s + Jyz c,
the kinetic energy T = ½ J_hub Ω² + ½ Σ ω·J ω is

    T = ½ (J_hub + Σ A) Ω² + Σ B Ω θ̇ + ½ Σ Jzz θ̇²,
    A = cos²β a + 2 sin β cos β b + sin²β Jzz,  B = cos β b + sin β Jzz.

With (x, y, z) the centre of mass in the blade's frame, h its height above the apex, k and r the
stiffness and the rest angle of the bearing spring, u = x c - y s and v = x s + y c, the potential
energy is

    V = Σ m g h + ½ k (θ - r)²,
    h = sin τ (v cos β + z sin β) + cos τ (-u sin φ + (z cos β - v sin β) cos φ).

The mass matrix is an arrowhead; eliminating the pitches leaves the Schur complement

    S = J_hub + Σ (A - B²/Jzz) = J_hub + Σ cos²β (a - b²/Jzz).

`BladeForm.lean` has the coefficients of the terms that exist only with tilt or cone. A rotor
without both skips these terms.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from typing import Any

from rotor_mbs.models.lagrange.parameters import BladeForm, Lean, Number, RotorForm
from rotor_mbs.scenario.time_table import ROTOR_TORQUE, rest_place, torque_place

Function = Callable[[Any], Any]
# A function with the parameters and the result of `accelerations`, which replaces it.
Accelerations = Callable[..., list[Number]]


@dataclass(frozen=True, slots=True)
class LoadValues:
    """Hold the loads at one time, or over time as arrays."""

    rotor: Number  # N m on the rotor
    pitches: Sequence[Number] = ()  # (form.blades,) N m between hub and blade; () for none
    # (form.blades,) rad, rest angles: pitch angles at which the bearings' springs are unloaded; ()
    # for 0
    rests: Sequence[Number] = ()


def load_values(values: Sequence[Any], pitches: Sequence[int]) -> LoadValues:
    """Return the loads of the coordinates that move, from the values of all loads of a scene.

    Parameters
    ----------
    values : for each of `Scene.load_tables` a number, or an array over time: torques in N m, rest
        angles in rad.
    pitches : the coordinates of the pitches that move, `Scene.moving_coordinates[1:]`.
    """
    return LoadValues(
        values[ROTOR_TORQUE],
        [values[torque_place(pitch)] for pitch in pitches],
        [values[rest_place(pitch)] for pitch in pitches],
    )


def accelerations(
    angles: Sequence[Number],
    rates: Sequence[Number],
    form: RotorForm,
    loads: LoadValues,
    sin: Function,
    cos: Function,
) -> list[Number]:
    """Compute the accelerations by Lagrange's equations for T - V of the module docstring.

    The equations are singular where S = 0. An example is a massless hub with blades that are point
    masses in the plane y = 0 of their frames, all at pitch angles of ±π/2.

    Parameters
    ----------
    angles, rates : (1 + len(form.blades),) rad and rad/s, of the rotor, then of the pitches that
        move.
    form : the coefficients.
    loads : the loads of the coordinates that move.
    sin, cos : sine and cosine for the kind of number.

    Returns
    -------
    list
        (1 + len(form.blades),) rad/s², of the rotor, then of the pitches that move.
    """
    sin_q, cos_q = sin(angles[0]), cos(angles[0])
    spin = rates[0]
    schur = form.inertia
    moment = loads.rotor - form.shaft_damping * spin
    for weight, cos_phase, sin_phase in form.fixed:
        moment = moment + weight * (sin_q * cos_phase + cos_q * sin_phase)
    # s and c are factored out, because products of two functions of time are expensive for an
    # integrator that works with Taylor series.
    pitched = []
    for blade, theta, rate, torque, rest in pitches(form, angles, rates, loads):
        s, c = sin(theta), cos(theta)
        sin_phi = sin_q * blade.cos_phase + cos_q * blade.sin_phase
        cos_phi = cos_q * blade.cos_phase - sin_q * blade.sin_phase
        s_turn, c_turn = s * (spin * spin), c * (spin * spin)
        ratio = blade.ratio_s * s + blade.ratio_c * c  # B / Jzz, without tilt and cone
        resistance = blade.stiffness * (theta - rest) + blade.damping * rate - torque
        # The moment of ½ ∂A/∂θ Ω² and gravity on the pitch is s·on_s + c·on_c.
        on_s = (
            blade.half_slope_sc * c_turn - blade.half_slope_cs * s_turn - blade.weight_x * sin_phi
        )
        on_c = blade.half_slope_cs * c_turn - blade.weight_y * sin_phi
        # The rotor's moment, after the pitch is eliminated, contains -½ ∂A/∂θ times `drag`. `drag`
        # is the sum of a Coriolis term and of B / Jzz Ω², by which the moment ½ ∂A/∂θ Ω² on the
        # pitch acts on the rotor.
        drag = 2.0 * (spin * rate) + (blade.ratio_s * s_turn + blade.ratio_c * c_turn)
        lean = blade.lean
        if lean:
            up = lean.axial - lean.radial * cos_phi
            on_s = on_s + lean.slope_s * (spin * spin) + lean.weight_y * up
            on_c = on_c + lean.slope_c * (spin * spin) - lean.weight_x * up
            ratio, drag = ratio + lean.ratio, drag + lean.ratio * (spin * spin)
        pitched.append((s, c, on_s, on_c, resistance))
        lever = blade.lever_cc * c + blade.lever_sc * s
        rotor_c = blade.weight_x * cos_phi + sin_phi * lever - blade.coupling_s * (rate * rate)
        rotor_c = rotor_c - blade.half_slope_sc * (s * drag) - blade.half_slope_cs * (c * drag)
        rotor_s = (
            blade.lever_ss * (s * sin_phi)
            - blade.weight_y * cos_phi
            + blade.coupling_c * (rate * rate)
        )
        rotor_s = rotor_s + blade.half_slope_cs * (s * drag)
        if lean:
            rotor_c = rotor_c - lean.slope_c * drag + lean.weight_x * (ratio * up)
            rotor_s = rotor_s - lean.slope_s * drag - lean.weight_y * (ratio * up)
        moment = moment + (c * rotor_c + s * rotor_s) + ratio * resistance
        schur = schur + (
            blade.schur_ss * (s * s) + blade.schur_cc * (c * c) + blade.schur_sc * (s * c)
        )
    rotor = moment / schur
    result = [rotor]
    for blade, (s, c, on_s, on_c, resistance) in zip(form.blades, pitched, strict=True):
        driven = s * (on_s - blade.coupling_s * rotor) + c * (on_c - blade.coupling_c * rotor)
        if blade.lean:
            driven = driven - blade.lean.coupling * rotor
        result.append((driven - resistance) / blade.pitch_inertia)
    return result


def pitches(
    form: RotorForm, angles: Sequence[Number], rates: Sequence[Number], loads: LoadValues
) -> Iterator[tuple[BladeForm, Number, Number, Number, Number]]:
    """Yield blade, angle, rate, torque and rest angle of each pitch that moves.

    Parameters
    ----------
    form, angles, rates, loads : see `accelerations`. Pitch torques or rest angles that are () count
        as zero.
    """
    nothing = (0.0,) * len(form.blades)
    return zip(
        form.blades,
        angles[1:],
        rates[1:],
        loads.pitches or nothing,
        loads.rests or nothing,
        strict=True,
    )


def power(rates: Sequence[Number], form: RotorForm, loads: LoadValues) -> Number:
    """Return the power (W) of torques and rest angles, minus the power that the dampers dissipate.

    A rest angle r counts here as the moment k r on the pitch. The work that is done by moving the
    rest angle, -∫ k (θ - r) dr, is the work of this moment plus the change of `rest_energy`.

    Parameters
    ----------
    rates : (1 + len(form.blades),) rad/s, of the rotor, then of the pitches that move.
    form : the coefficients.
    loads : torques (N m) and rest angles (rad) of the coordinates that move.
    """
    spin = rates[0]
    total = loads.rotor * spin - form.shaft_damping * (spin * spin)
    for blade, rate, _, torque, rest in pitches(form, rates, rates, loads):
        total = total + (torque + blade.stiffness * rest) * rate - blade.damping * (rate * rate)
    return total


def rest_energy(angles: Sequence[Number], form: RotorForm, rests: Sequence[Number]) -> Number:
    """Return the energy Σ ½ k r (r - 2θ) (J) that rest angles r add to that of the springs.

    The springs' energy without rest angles is Σ ½ k θ².

    Parameters
    ----------
    angles : (1 + len(form.blades),) rad, of the rotor, then of the pitches that move.
    form : the coefficients.
    rests : (len(form.blades),) rad.
    """
    return sum(
        0.5 * blade.stiffness * (rest * (rest - 2.0 * theta))
        for blade, theta, rest in zip(form.blades, angles[1:], rests, strict=True)
    )


def energies(
    angles: Sequence[Number],
    rates: Sequence[Number],
    form: RotorForm,
    loads: LoadValues,
    sin: Function,
    cos: Function,
) -> tuple[Number, Number]:
    """Return kinetic and potential energy (J).

    The potential energy is that of gravity, zero at the height of the apex, plus that of the
    bearing springs.

    Parameters
    ----------
    angles, rates, form, loads, sin, cos : see `accelerations`.
    """
    sin_q, cos_q = sin(angles[0]), cos(angles[0])
    spin = rates[0]
    kinetic = 0.5 * form.inertia * (spin * spin)
    potential = 0.0 * sin_q
    for weight, cos_phase, sin_phase in form.fixed:
        potential = potential + weight * (cos_q * cos_phase - sin_q * sin_phase)
    potential = potential + form.fixed_height
    for blade, theta, rate, _, rest in pitches(form, angles, rates, loads):
        s, c = sin(theta), cos(theta)
        inertia = (
            blade.inertia_ss * (s * s) + blade.inertia_cc * (c * c) + blade.inertia_sc * (s * c)
        )
        coupling = blade.coupling_s * s + blade.coupling_c * c
        if blade.lean:
            inertia = inertia + (blade.lean.inertia_s * s + blade.lean.inertia_c * c)
            coupling = coupling + blade.lean.coupling
        of_blade = (
            0.5 * inertia * (spin * spin)
            + coupling * spin * rate
            + 0.5 * blade.pitch_inertia * (rate * rate)
        )
        kinetic = kinetic + of_blade
        sin_phi = sin_q * blade.cos_phase + cos_q * blade.sin_phase
        cos_phi = cos_q * blade.cos_phase - sin_q * blade.sin_phase
        height = cos_phi * blade.weight_z - sin_phi * (blade.weight_x * c - blade.weight_y * s)
        if blade.lean:
            up = blade.lean.axial - blade.lean.radial * cos_phi
            height = (
                height
                + (blade.lean.weight_x * s + blade.lean.weight_y * c) * up
                + blade.lean.height
            )
        potential = potential + height + 0.5 * blade.stiffness * ((theta - rest) * (theta - rest))
    return kinetic, potential


def point_path(
    azimuth: Number,
    pitch: Number,
    point: Sequence[float],
    sin: Function,
    cos: Function,
    lean: Lean | None = None,
) -> tuple[Number, Number, Number]:
    """Return the position of a blade's point in the base frame, (x, y, z) in m.

    The position is Rx(tilt)·Ry(azimuth)·Rx(-cone)·Rz(pitch)·point.

    Parameters
    ----------
    azimuth, pitch : rad.
    point : (3,) m in the blade's frame.
    sin, cos : sine and cosine for the kind of number.
    lean : cosines and sines of cone and tilt; None if both are 0.
    """
    x, y, z = point
    s, c = sin(pitch), cos(pitch)
    across, along = x * c - y * s, x * s + y * c
    if lean:
        along, z = (
            along * lean.cos_cone + z * lean.sin_cone,
            z * lean.cos_cone - along * lean.sin_cone,
        )
    x, z = cos(azimuth) * across + sin(azimuth) * z, cos(azimuth) * z - sin(azimuth) * across
    if lean:
        along, z = (
            along * lean.cos_tilt - z * lean.sin_tilt,
            along * lean.sin_tilt + z * lean.cos_tilt,
        )
    return x, along, z
