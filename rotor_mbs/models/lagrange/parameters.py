"""Compute the coefficients of the closed form from a scene.

They are computed in exact rational arithmetic and rounded once, in the last step. For a point mass
some coefficients are exactly zero. Near a pitch of ±π/2 a rounding error in their place would act
as inertia.
"""

from __future__ import annotations

import functools
import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from fractions import Fraction
from typing import Any

import numpy as np

from rotor_mbs.scenario.scene import Blade, Scene
from rotor_mbs.scenario.time_table import is_constant
from rotor_mbs.solution.trajectory import Array

# A number of the kind in which the equations are evaluated: float, quad precision, or symbolic
# parameter.
Number = Any
Convert = Callable[[Fraction], Number]  # function that rounds a Fraction to a Number

PI = Fraction(
    "3.14159265358979323846264338327950288419716939937510582097494459230781640628620899862803"
)


@dataclass(frozen=True, slots=True)
class BladeForm:
    """Hold the coefficients of one blade; s, c are sine and cosine of its pitch θ."""

    cos_phase: Number  # cosine and sine of the blade's mounting angle about the shaft
    sin_phase: Number
    # kg m², the blade's part of S is schur_ss·s² + schur_cc·c² + schur_sc·s c
    schur_ss: Number
    schur_cc: Number
    schur_sc: Number
    # kg m², ½ ∂a/∂θ = half_slope_sc·s c + half_slope_cs·(c² - s²), a as below
    half_slope_sc: Number
    half_slope_cs: Number
    # kg m², b = coupling_s·s + coupling_c·c, the rotor-pitch entry of the mass matrix
    coupling_s: Number
    coupling_c: Number
    ratio_s: Number  # b / Jzz
    ratio_c: Number
    pitch_inertia: Number  # kg m², Jzz
    # N m, m g cos τ times (x, y, z cos β) of the centre of mass
    weight_x: Number
    weight_y: Number
    weight_z: Number
    # N m, the moment of gravity on the rotor, after the pitch is eliminated, contains sin φ times
    # lever_ss·s² + lever_cc·c² + lever_sc·s c
    lever_ss: Number
    lever_cc: Number
    lever_sc: Number
    stiffness: Number  # N m/rad
    damping: Number  # N m s/rad
    inertia_ss: Number  # kg m², a = inertia_ss·s² + inertia_cc·c² + inertia_sc·s c
    inertia_cc: Number
    inertia_sc: Number
    lean: LeanForm | None = None  # None where neither the shaft is tilted nor any blade coned


@dataclass(frozen=True, slots=True)
class LeanForm:
    """Hold what tilt τ and cone β of one blade add to its `BladeForm`.

    The coefficients of the `BladeForm` contain the cosines of both.
    """

    ratio: Number  # sin β, added to b / Jzz
    coupling: Number  # kg m², Jzz sin β, added to b
    slope_s: Number  # kg m², ½ ∂A/∂θ has slope_s·s + slope_c·c beside its quadratic form
    slope_c: Number
    inertia_s: Number  # kg m², A has inertia_s·s + inertia_c·c beside its quadratic form
    inertia_c: Number
    weight_x: Number  # N m, m g (x, y) of the centre of mass, without the cosine of the tilt
    weight_y: Number
    axial: Number  # sin τ cos β; axial - radial·cos φ is the upward component of the coned y axis
    radial: Number  # cos τ sin β
    height: Number  # N m, potential energy m g z sin τ sin β


@dataclass(frozen=True, slots=True)
class Lean:
    """Hold cosine and sine of a blade's cone and of the shaft's tilt."""

    cos_cone: Number
    sin_cone: Number
    cos_tilt: Number
    sin_tilt: Number


@dataclass(frozen=True, slots=True)
class RotorForm:
    """Hold the coefficients of the whole rotor."""

    blades: tuple[BladeForm, ...]  # the blades whose pitch moves, in order
    # (weight_z, cos_phase, sin_phase) of each blade without pitch inertia, a part of the rotor
    fixed: tuple[tuple[Number, Number, Number], ...]
    inertia: Number  # kg m², hub and the blades that are fixed
    shaft_damping: Number  # N m s/rad
    fixed_height: Number = 0.0  # N m, constant potential energy of the blades that are fixed


def rotor_form(
    scene: Scene,
    convert: Convert = float,
    phases: Sequence[tuple[Fraction, Fraction]] | None = None,
) -> RotorForm:
    """Return the coefficients of a scene, whose doubles are taken as exact.

    Parameters
    ----------
    scene : the rotor.
    convert : rounds each coefficient once, to the kind of number to compute with.
    phases : (blades,) cosines and sines of the mounting angles; by default those of equally spaced
        blades.
    """
    if convert is float and phases is None:
        return _form_in_doubles(scene)
    return _form(scene, convert, phases)


# Many functions that check a run need its coefficients in doubles. Other conversions are not
# cached, because a conversion may have side effects: `Parameters` counts its calls.
@functools.lru_cache(maxsize=16)
def _form_in_doubles(scene: Scene) -> RotorForm:
    return _form(scene, float, None)


def _form(
    scene: Scene, convert: Convert, phases: Sequence[tuple[Fraction, Fraction]] | None
) -> RotorForm:
    """Compute the coefficients of a scene in rational numbers, then convert each once.

    Parameters
    ----------
    scene, convert, phases : see `rotor_form`.
    """
    gravity = Fraction(scene.gravity)
    count = len(scene.blades)
    forms: list[BladeForm] = []
    fixed: list[tuple[Number, Number, Number]] = []
    inertia, fixed_height = Fraction(scene.hub_inertia), Fraction(0)
    for i, blade in enumerate(scene.blades):
        phase = phases[i] if phases else phase_of(i, count)
        if blade.has_pitch_inertia:
            bearing = (Fraction(value) for value in scene.bearings[i])
            values = [
                *phase,
                *_coefficients(blade, gravity, scene.shaft_tilt),
                *bearing,
                *_rotor_inertia(blade),
            ]
            form = BladeForm(*(convert(value) for value in values))
            if scene.has_tilt_or_cone:
                of_lean = _lean_coefficients(blade, gravity, scene.shaft_tilt)
                form = replace(form, lean=LeanForm(*(convert(value) for value in of_lean)))
            forms.append(form)
        else:
            lean = _lean(blade.cone, scene.shaft_tilt)
            inertia += _rotor_inertia(blade)[1]
            weight = Fraction(blade.mass) * gravity * Fraction(blade.centre_of_mass[2])
            fixed_height += weight * lean.sin_tilt * lean.sin_cone
            weight *= lean.cos_tilt * lean.cos_cone
            fixed.append((convert(weight), convert(phase[0]), convert(phase[1])))
    damping = Fraction(scene.shaft_damping)
    return RotorForm(
        tuple(forms), tuple(fixed), convert(inertia), convert(damping), convert(fixed_height)
    )


def leans(scene: Scene, convert: Convert = float) -> list[Lean | None]:
    """Return cosines and sines of cone and tilt of each blade, rounded once.

    Parameters
    ----------
    scene : the rotor.
    convert : rounds each of them to the kind of number to compute with.

    Returns
    -------
    list
        (blades,) Lean; None for each where the scene has neither tilt nor cone.
    """
    if not scene.has_tilt_or_cone:
        return [None] * len(scene.blades)
    converted: list[Lean | None] = []
    for blade in scene.blades:
        lean = _lean(blade.cone, scene.shaft_tilt)
        converted.append(Lean(*(convert(getattr(lean, name)) for name in Lean.__slots__)))
    return converted


@functools.lru_cache(maxsize=256)
def _lean(cone: float, tilt: float) -> Lean:
    """Return cosines and sines of cone and tilt (rad) to 50 digits; the angles count as exact."""
    return Lean(*(value for angle in (cone, tilt) for value in _cosine_and_sine(Fraction(angle))))


def phase_of(blade: int, count: int) -> tuple[Fraction, Fraction]:
    """Return cosine and sine of the mounting angle of a blade, counted from 0, of `count`."""
    return _cosine_of_turn(Fraction(blade, count)), _cosine_of_turn(
        Fraction(blade, count) - Fraction(1, 4)
    )


def _inertia_about_hub(
    blade: Blade,
) -> tuple[Fraction, Fraction, Fraction, Fraction, Fraction, Fraction]:
    """Return the inertia J = J_com + m (r·r I - r rᵀ) about the hub centre: xx yy zz xy xz yz.

    Parameters
    ----------
    blade : the blade, with its mass (kg), centre of mass r (m) and inertia about r (kg m²).
    """
    m = Fraction(blade.mass)
    x, y, z = (Fraction(value) for value in blade.centre_of_mass)
    xx, yy, zz, xy, xz, yz = (Fraction(value) for value in blade.inertia)
    return (
        xx + m * (y * y + z * z),
        yy + m * (x * x + z * z),
        zz + m * (x * x + y * y),
        xy - m * x * y,
        xz - m * x * z,
        yz - m * y * z,
    )


@functools.lru_cache(maxsize=256)
def _rotor_inertia(blade: Blade) -> tuple[Fraction, Fraction, Fraction]:
    """Return the coefficients ss, cc, sc (kg m²) of a blade's inertia A about the shaft.

    A = inertia_ss s² + inertia_cc c² + inertia_sc s c, where s and c are sine and cosine of the
    pitch. The terms of A that are linear in s and c are in `LeanForm`.
    """
    xx, yy, zz, xy, _, _ = _inertia_about_hub(blade)
    lean = _lean(blade.cone, 0.0)
    cone_cc, cone_ss = lean.cos_cone**2, lean.sin_cone**2
    # The pitch axis's share about the shaft, Jzz sin²β, is added to both s² and c²: s² + c² = 1.
    return cone_cc * xx + cone_ss * zz, cone_cc * yy + cone_ss * zz, 2 * cone_cc * xy


# The blades of a rotor are often equal, and so are those of the rotors of a sweep.
@functools.lru_cache(maxsize=256)
def _coefficients(blade: Blade, gravity: Fraction, tilt: float) -> list[Fraction]:
    """Return the coefficients schur_ss ... lever_sc of `BladeForm`, in its order.

    Parameters
    ----------
    blade : the blade, with its mass, centre of mass, inertia and cone.
    gravity : m/s².
    tilt : rad, tilt of the shaft.
    """
    xx, yy, zz, xy, xz, yz = _inertia_about_hub(blade)
    x, y, z = (Fraction(value) for value in blade.centre_of_mass)
    lean = _lean(blade.cone, tilt)
    cos_cone, squared = lean.cos_cone, lean.cos_cone**2
    weight = Fraction(blade.mass) * gravity * lean.cos_tilt
    schur = [xx - xz * xz / zz, yy - yz * yz / zz, 2 * (xy - xz * yz / zz)]
    lever = [
        weight * (z + xz * x / zz),
        weight * (z + yz * y / zz),
        weight * (xz * y + yz * x) / zz,
    ]
    return [
        *(squared * value for value in (*schur, xx - yy, xy)),
        *(cos_cone * value for value in (xz, yz, xz / zz, yz / zz)),
        zz,
        weight * x,
        weight * y,
        cos_cone * weight * z,
        *(cos_cone * value for value in lever),
    ]


@functools.lru_cache(maxsize=256)
def _lean_coefficients(blade: Blade, gravity: Fraction, tilt: float) -> list[Fraction]:
    """Return the coefficients of `LeanForm`, in its order.

    Parameters
    ----------
    blade, gravity, tilt : see `_coefficients`.
    """
    _, _, zz, _, xz, yz = _inertia_about_hub(blade)
    x, y, z = (Fraction(value) for value in blade.centre_of_mass)
    weight, lean = Fraction(blade.mass) * gravity, _lean(blade.cone, tilt)
    mixed = lean.sin_cone * lean.cos_cone
    return [
        lean.sin_cone,
        lean.sin_cone * zz,
        -mixed * yz,
        mixed * xz,
        2 * mixed * xz,
        2 * mixed * yz,
        weight * x,
        weight * y,
        lean.sin_tilt * lean.cos_cone,
        lean.cos_tilt * lean.sin_cone,
        weight * z * lean.sin_tilt * lean.sin_cone,
    ]


_FIXED_POINT = 10**60  # a fraction is represented by the whole number that is this many times it


@functools.lru_cache(maxsize=4096)
def _cosine_of_turn(turn: Fraction) -> Fraction:
    """Return cos(2π·turn) to 50 digits.

    With so many digits, a third of a turn gives exactly -1/2 after rounding to double or quad
    precision.
    """
    angle = 2 * PI * ((turn + Fraction(1, 2)) % 1 - Fraction(1, 2))
    return _power_series(angle * angle, 1)


def _cosine_and_sine(angle: Fraction) -> tuple[Fraction, Fraction]:
    """Return cosine and sine of an angle of at most a few rad to 50 digits."""
    square = angle * angle
    return _power_series(square, 1), angle * _power_series(square, 2)


def _power_series(square: Fraction, first: int) -> Fraction:
    """Return Σ (-square)^n / (first (first + 1) ... (first + 2n - 1)) to 50 digits.

    For an angle x with the given square it is cos(x) if `first` is 1, and sin(x) / x if it is 2.

    Parameters
    ----------
    square : rad², the square of an angle of a few rad.
    first : 1 or 2.
    """
    fixed = int(square * _FIXED_POINT)
    term = total = _FIXED_POINT
    k, sign = first - 1, 1
    while term:
        k, sign = k + 2, -sign
        term = term * fixed // (k * (k - 1) * _FIXED_POINT)
        total += sign * term
    return Fraction(total, _FIXED_POINT).limit_denominator(10**50)


def changing_loads(scene: Scene) -> tuple[int, ...]:
    """Return the indices in `Scene.load_tables` of the loads that change over time."""
    return tuple(i for i, table in enumerate(scene.load_tables) if not is_constant(table))


def changing_rests(scene: Scene) -> tuple[bool, ...]:
    """Return for each pitch that moves whether the rest angle of its spring changes over time."""
    rests = [scene.pitch_loads[coordinate - 1][1] for coordinate in scene.moving_coordinates[1:]]
    return tuple(not is_constant(rest) for rest in rests)


# A coordinate whose natural frequency (rad/s) is at most this has the rate unit 1 rad/s. The
# paper's blades have 10.7 rad/s.
_UNIT_FREQUENCY = 100.0


def pitch_weight(blade: BladeForm) -> float:
    """Return the largest moment (N m) that the blade's weight can have about its pitch axis."""
    weights = blade.lean or blade
    return math.hypot(weights.weight_x, weights.weight_y)


def rate_units(scene: Scene) -> Array:
    """Return the unit of each rate, in which a rate error counts like an angle error in rad.

    The unit is 1 rad/s, or the natural frequency of the coordinate at the start (by spring, gravity
    and rotation) if that is above 100 rad/s. An oscillation turns an error of an angle into an
    error of its rate within a quarter period. In rad/s this would count as growth of the error:
    1e5-fold on a bearing of 1e12 N m/rad.

    Parameters
    ----------
    scene : the rotor, its gravity and initial rotor rate.

    Returns
    -------
    ndarray, shape (1 + moving blades,)
        rad/s.
    """
    form = rotor_form(scene)
    spin = abs(scene.initial_rates[0])
    frequencies = [0.0]
    for blade in form.blades:
        moment = blade.stiffness + pitch_weight(blade)
        frequencies.append(max(math.sqrt(moment / blade.pitch_inertia), spin))
    return np.array(
        [frequency if frequency > _UNIT_FREQUENCY else 1.0 for frequency in frequencies]
    )
