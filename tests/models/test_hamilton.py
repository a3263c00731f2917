"""Hamilton's equations are Lagrange's: exactly, in rational arithmetic, and along a run."""

from __future__ import annotations

import random
from fractions import Fraction
from typing import Any

import pytest
from support.references import scene
from support.scenes import general, paper

from rotor_mbs.models.lagrange import hamilton
from rotor_mbs.models.lagrange.closed_form import LoadValues, accelerations
from rotor_mbs.models.lagrange.parameters import RotorForm, rotor_form
from rotor_mbs.scenario.scene import Scene


class Exact(Fraction):
    """A rational number that takes floats for what they are."""


def _operation(name: str) -> Any:
    return lambda self, other: Exact(getattr(Fraction, name)(self, Fraction(other)))


for _name in ("__add__", "__radd__", "__sub__", "__rsub__", "__mul__", "__rmul__", "__truediv__"):
    setattr(Exact, _name, _operation(_name))


def sin(half_tangent: Exact) -> Exact:
    """Of the angle whose half has this tangent: rational. An angle's own value enters the springs alone."""
    return Exact(2 * half_tangent / (1 + half_tangent * half_tangent))


def cos(half_tangent: Exact) -> Exact:
    square = half_tangent * half_tangent
    return Exact((1 - square) / (1 + square))


def derivatives_of_momenta(
    angles: list[Exact], rates: list[Exact], second: list[Exact], form: RotorForm
) -> list[Exact]:
    """d(M q̇)/dt from accelerations: M q̈ + (dM/dt) q̇."""
    spin, turned = rates[0], second[0]
    total, out = form.inertia * turned, []
    for blade, theta, rate, acceleration in zip(form.blades, angles[1:], rates[1:], second[1:], strict=True):
        s, c = sin(theta), cos(theta)
        a = blade.inertia_ss * (s * s) + blade.inertia_cc * (c * c) + blade.inertia_sc * (s * c)
        slope = (blade.inertia_ss - blade.inertia_cc) * (2 * (s * c)) + blade.inertia_sc * (c * c - s * s)
        b, b_slope = blade.coupling_s * s + blade.coupling_c * c, blade.coupling_s * c - blade.coupling_c * s
        total = total + a * turned + slope * rate * spin + b * acceleration + b_slope * (rate * rate)
        out.append(b * turned + b_slope * rate * spin + blade.pitch_inertia * acceleration)
    return [total, *out]


@pytest.mark.parametrize(
    "given", [general(), scene("check/general"), paper("fig11"), paper("fig03")], ids=lambda s: s.name
)
def test_both_forms_are_the_same_equations_exactly(given: Scene) -> None:
    """Every term, at random rational states: no rounding, so that one wrong coefficient cannot hide in it."""
    form, numbers = rotor_form(given, Exact), random.Random(5)

    def some(count: int) -> list[Exact]:
        return [Exact(Fraction(numbers.randint(-99, 99), numbers.randint(1, 50))) for _ in range(count)]

    count = len(form.blades)
    for _ in range(3):
        angles, rates = some(1 + count), some(1 + count)
        loads = LoadValues(some(1)[0], some(count), some(count))
        p = hamilton.momenta(angles, rates, form, sin, cos)
        rates_again = hamilton.rates(angles, p, form, sin, cos)
        forces = hamilton.forces(angles, rates, form, loads, sin, cos)
        expected = derivatives_of_momenta(angles, rates, accelerations(angles, rates, form, loads, sin, cos), form)
        assert rates_again == rates
        assert forces == expected
