"""The closed form in Hamilton's variables, angles and momenta p = ∂T/∂q̇: for sweeps; fewer and cheaper steps.

Symbols as in `closed_form`:
p_0 = (J_hub + Σ a) Ω + Σ b θ̇,  p_i = b Ω + Jzz θ̇,
ṗ_0 = τ - ∂V/∂q2,  ṗ_i = ½ ∂a/∂θ Ω² + ∂b/∂θ Ω θ̇ - ∂V/∂θ, and what dampers and torques do.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

from rotor_mbs.models.lagrange.closed_form import Function, LoadValues, pitches
from rotor_mbs.models.lagrange.parameters import RotorForm

Numbers = Sequence[Any]


def momenta(angles: Numbers, rates: Numbers, form: RotorForm, sin: Function, cos: Function) -> list[Any]:
    """Return the momenta, (1 + blades) kg m²/s; angles and rates as of `closed_form.accelerations`."""
    spin, total, of_pitches = rates[0], form.inertia * rates[0], []
    for blade, theta, rate in zip(form.blades, angles[1:], rates[1:], strict=True):
        s, c = sin(theta), cos(theta)
        b = blade.coupling_s * s + blade.coupling_c * c
        total = total + (blade.inertia_ss * (s * s) + blade.inertia_cc * (c * c) + blade.inertia_sc * (s * c)) * spin
        total = total + b * rate
        of_pitches.append(b * spin + blade.pitch_inertia * rate)
    return [total, *of_pitches]


def rates(angles: Numbers, momenta: Numbers, form: RotorForm, sin: Function, cos: Function) -> list[Any]:
    """Return the rates, (1 + blades) rad/s: the inverse of `momenta`.

    By the Schur complement; singular where that is 0.
    """
    schur, rest = form.inertia, momenta[0]
    ratios = []
    for blade, theta, p in zip(form.blades, angles[1:], momenta[1:], strict=True):
        s, c = sin(theta), cos(theta)
        schur = schur + (blade.schur_ss * (s * s) + blade.schur_cc * (c * c) + blade.schur_sc * (s * c))
        ratios.append(blade.ratio_s * s + blade.ratio_c * c)
        rest = rest - ratios[-1] * p
    spin = rest / schur
    pitching = zip(form.blades, momenta[1:], ratios, strict=True)
    return [spin, *(p / blade.pitch_inertia - ratio * spin for blade, p, ratio in pitching)]


def forces(
    angles: Numbers, rates: Numbers, form: RotorForm, loads: LoadValues, sin: Function, cos: Function
) -> list[Any]:
    """Return the time derivatives of the momenta, (1 + blades) N m.

    Parameters are those of `closed_form.accelerations`: angles, rates, form, loads, sin, cos.
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
        moment = moment + blade.weight_z * sin_phi + cos_phi * (blade.weight_x * c - blade.weight_y * s)
        half_slope = blade.half_slope_sc * (s * c) + blade.half_slope_cs * (c * c - s * s)
        force = spin * (half_slope * spin + (blade.coupling_s * c - blade.coupling_c * s) * rate)
        force = force - sin_phi * (blade.weight_x * s + blade.weight_y * c)
        of_pitches.append(force - blade.stiffness * (theta - rest) - blade.damping * rate + torque)
    return [moment, *of_pitches]
