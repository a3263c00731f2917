"""Evaluate the closed form in Hamilton's variables, angles and momenta p = ∂T/∂q̇.

Sweeps are integrated in these variables, because the steps are fewer and cheaper. With the symbols
of `closed_form`, momenta and forces are

    p_0 = (J_hub + Σ A) Ω + Σ B θ̇,  p_i = B Ω + Jzz θ̇,
    ṗ_0 = Q_0 - ∂V/∂q2,  ṗ_i = Q_i + ½ ∂A/∂θ Ω² + ∂B/∂θ Ω θ̇ - ∂V/∂θ,

where Q has the moments of torques and dampers.
"""

from __future__ import annotations

import functools
from collections.abc import Sequence
from dataclasses import replace
from fractions import Fraction
from typing import Any

from rotor_mbs.models.lagrange.closed_form import Function, LoadValues, pitches
from rotor_mbs.models.lagrange.parameters import BladeForm, RotorForm, rotor_form
from rotor_mbs.scenario.scene import Scene

Numbers = Sequence[Any]


def momenta(
    angles: Numbers, rates: Numbers, form: RotorForm, sin: Function, cos: Function
) -> list[Any]:
    """Return the momenta (kg m²/s) of the rotor, then of the pitches that move.

    Parameters
    ----------
    angles, rates, form, sin, cos : see `closed_form.accelerations`.
    """
    spin, total, of_pitches = rates[0], form.inertia * rates[0], []
    for blade, theta, rate in zip(form.blades, angles[1:], rates[1:], strict=True):
        s, c = sin(theta), cos(theta)
        b = blade.coupling_s * s + blade.coupling_c * c
        total = (
            total
            + (blade.inertia_ss * (s * s) + blade.inertia_cc * (c * c) + blade.inertia_sc * (s * c))
            * spin
        )
        if blade.lean:
            b = b + blade.lean.coupling
            total = total + (blade.lean.inertia_s * s + blade.lean.inertia_c * c) * spin
        total = total + b * rate
        of_pitches.append(b * spin + blade.pitch_inertia * rate)
    return [total, *of_pitches]


def rates(
    angles: Numbers, momenta: Numbers, form: RotorForm, sin: Function, cos: Function
) -> list[Any]:
    """Return the rates (rad/s) that belong to momenta, the inverse of the function `momenta`.

    The rates are computed by the Schur complement S. They are singular where S = 0.

    Parameters
    ----------
    angles : (1 + len(form.blades),) rad, of the rotor, then of the pitches that move.
    momenta : (1 + len(form.blades),) kg m²/s, in the same order.
    form, sin, cos : see `closed_form.accelerations`.
    """
    schur, rest = form.inertia, momenta[0]
    ratios = []
    for blade, theta, p in zip(form.blades, angles[1:], momenta[1:], strict=True):
        s, c = sin(theta), cos(theta)
        schur = schur + (
            blade.schur_ss * (s * s) + blade.schur_cc * (c * c) + blade.schur_sc * (s * c)
        )
        ratio = blade.ratio_s * s + blade.ratio_c * c
        ratios.append(ratio + blade.lean.ratio if blade.lean else ratio)
        rest = rest - ratios[-1] * p
    spin = rest / schur
    pitching = zip(form.blades, momenta[1:], ratios, strict=True)
    return [spin, *(p / blade.pitch_inertia - ratio * spin for blade, p, ratio in pitching)]


def forces(
    angles: Numbers,
    rates: Numbers,
    form: RotorForm,
    loads: LoadValues,
    sin: Function,
    cos: Function,
) -> list[Any]:
    """Return the time derivatives of the momenta (N m) of the rotor, then of the pitches that move.

    Parameters
    ----------
    angles, rates, form, loads, sin, cos : see `closed_form.accelerations`.
    """
    sine, cosine = sin(angles[0]), cos(angles[0])
    spin, of_pitches = rates[0], []
    moment = loads.rotor - form.shaft_damping * spin
    for weight, cos_phase, sin_phase in form.fixed:
        moment = moment + weight * (sine * cos_phase + cosine * sin_phase)
    for blade, theta, rate, torque, rest in pitches(form, angles, rates, loads):
        s, c = sin(theta), cos(theta)
        sin_phi = sine * blade.cos_phase + cosine * blade.sin_phase
        cos_phi = cosine * blade.cos_phase - sine * blade.sin_phase
        moment = (
            moment + blade.weight_z * sin_phi + cos_phi * (blade.weight_x * c - blade.weight_y * s)
        )
        half_slope = blade.half_slope_sc * (s * c) + blade.half_slope_cs * (c * c - s * s)
        force = spin * (half_slope * spin + (blade.coupling_s * c - blade.coupling_c * s) * rate)
        force = force - sin_phi * (blade.weight_x * s + blade.weight_y * c)
        if lean := blade.lean:
            force = force + spin * spin * (lean.slope_s * s + lean.slope_c * c)
            force = force - (lean.axial - lean.radial * cos_phi) * (
                lean.weight_x * c - lean.weight_y * s
            )
            moment = moment - lean.radial * (lean.weight_x * s + lean.weight_y * c) * sin_phi
        of_pitches.append(force - blade.stiffness * (theta - rest) - blade.damping * rate + torque)
    return [moment, *of_pitches]


@functools.lru_cache(maxsize=16)
def resting_pitches(scene: Scene) -> tuple[int, ...]:
    """Return the coordinates of the pitches that stay at zero during the whole run.

    Such a pitch starts at zero and at rest, no load acts on it, and neither gravity nor any motion
    of the rotor moves it.

    Parameters
    ----------
    scene : the rotor, its initial state and its loads.
    """
    form = rotor_form(scene, Fraction)
    resting = []
    for column, blade in zip(scene.moving_coordinates[1:], form.blades, strict=True):
        torque, rest = scene.pitch_loads[column - 1]
        loads = [value for _, value in torque]
        if blade.stiffness:
            loads += [value for _, value in rest]
        start = scene.initial_angles[column], scene.initial_rates[column]
        if not any([*start, *loads]) and _stays_at_zero(
            replace(blade, cos_phase=Fraction(1), sin_phase=Fraction(0))
        ):
            resting.append(column)
    return tuple(resting)


# Four states of the rotor: cosine and sine of the azimuth φ, and rate Ω. A force
# α Ω² + β sin φ + γ cos φ + δ that is zero in these four states is zero in all states.
_ROTOR_STATES = ((1, 0, 1), (0, 1, 2), (-1, 0, 3), (0, -1, 5))


@functools.lru_cache(maxsize=256)
def _stays_at_zero(blade: BladeForm) -> bool:
    """Return whether a pitch without a load, at zero and at rest, stays there.

    It stays there if its momentum and the force on it vanish at every azimuth and rotor rate.

    Parameters
    ----------
    blade : the blade's coefficients as Fractions, so that the result is exact.
    """
    form = RotorForm((blade,), (), Fraction(0), Fraction(0))
    for cos_q, sin_q, spin in _ROTOR_STATES:
        # The angles are replaced by keys, "rotor" for the rotor angle and 0 for the pitch, by which
        # `momenta` and `forces` look up exact sines and cosines.
        sines, cosines = (
            {"rotor": Fraction(sin_q), 0: Fraction(0)},
            {"rotor": Fraction(cos_q), 0: Fraction(1)},
        )
        state = ["rotor", 0], [Fraction(spin), Fraction(0)], form
        of_pitch = momenta(*state, sines.__getitem__, cosines.__getitem__)[1]
        force = forces(*state, LoadValues(Fraction(0)), sines.__getitem__, cosines.__getitem__)[1]
        if of_pitch or force:
            return False
    return True
