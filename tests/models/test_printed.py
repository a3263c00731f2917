"""The printed model: its literal text, the paper's derivation, and the right equations made here
from T and V alone."""

from __future__ import annotations

import math

import numpy as np
import pytest
from support.gravity_rows import GRAVITY_ROWS, SUMMED, moment

from rotor_mbs.models.lagrange import closed_form
from rotor_mbs.models.lagrange.closed_form import LoadValues
from rotor_mbs.models.lagrange.parameters import rotor_form
from rotor_mbs.models.printed import literal
from rotor_mbs.models.printed.derivation import AS_PRINTED, CORRECTED, DerivedRotor, Errata
from rotor_mbs.scenario.scene import Blade, Scene

M, C, D, G = 15000.0, math.hypot(0.08, 0.03), 15.42, 9.8  # Table 1


def phases(blades):
    return tuple(2.0 * math.pi * i / blades for i in range(blades))


def random_motion(rng, blades):
    return rng.uniform(-np.pi, np.pi, 1 + blades).tolist(), rng.uniform(
        -2.0, 2.0, 1 + blades
    ).tolist()


def constants(rng):
    """m, c, d, g of order one: every term then weighs in the sum."""
    return rng.uniform(0.5, 2.0, 4).tolist()


def mass_matrix(rotor, angles):
    blades = rotor.blades(angles)
    matrix = np.diag([sum(terms.d_22 for terms in blades), *(terms.d_33 for terms in blades)])
    matrix[0, 1:] = matrix[1:, 0] = [terms.d_23 for terms in blades]
    return matrix


@pytest.mark.parametrize("blades", [1, 3])
def test_literal_text_is_the_derivation_with_all_errata(blades):
    rng = np.random.default_rng(1)
    text = {1: literal.one_blade_accelerations, 3: literal.three_blade_accelerations}[blades]
    for _ in range(50):
        angles, rates = random_motion(rng, blades)
        m, c, d, g = constants(rng)
        torques = rng.uniform(-1.0, 1.0, 1 + blades).tolist()
        rotor = DerivedRotor(m, c, d, g, phases(blades), AS_PRINTED)
        derived = np.array(rotor.accelerations(torques, angles, rates))
        # Rounding, some 1e-15, times the condition of the mass matrix, which is singular at a pitch
        # of ±π/2.
        bound = 1e-14 * np.linalg.cond(mass_matrix(rotor, angles)) * max(1.0, np.abs(derived).max())
        assert bound < 1e-2 * max(1.0, np.abs(derived).max())
        np.testing.assert_allclose(
            text(m, c, d, g, torques, angles + rates), derived, rtol=0.0, atol=bound
        )


@pytest.mark.parametrize("name", GRAVITY_ROWS)
def test_every_way_of_writing_the_first_row_of_56_is_equal_but_for_rounding(name):
    rng = np.random.default_rng(5)
    for _ in range(20):
        q2, q3, q4, q5 = rng.uniform(-np.pi, np.pi, 4)
        sines = [f(q) for q in (q2, q3, q4, q5) for f in (math.sin, math.cos)]
        printed = literal.gravity_three(M, C, G, *sines)[0]
        # Of 1.3e4 N m, some units of 1.8e-12; of three weights m g d = 2.3e6 N m, some units of
        # 4.7e-10.
        allowed = 2e-11 if name != SUMMED else 1e-8
        written = moment(name, M, C, D, G, q2, math.cos(q3), math.cos(q4), math.cos(q5))
        assert written == pytest.approx(printed, rel=0.0, abs=allowed)


def test_figure_5_starts_in_an_equilibrium_that_only_rounding_leaves():
    angle = math.pi / 6.0
    sines = math.sin(angle), math.cos(angle)
    assert literal.gravity_three(M, C, G, *sines, *[0.0, 1.0] * 3) == (0.0, 0.0, 0.0, 0.0)
    assert 0.0 < abs(literal.rotor_gravity(M, C, G, *sines, 1.0, 1.0, 1.0)) < 1e-12


def closed_form_accelerations(m, c, d, g, torques, angles, rates, blades):
    blade = Blade(m, (c, 0.0, d), (0.0,) * 6, (c, 0.0, d))
    zero = (0.0,) * (1 + blades)
    form = rotor_form(
        Scene("random", "", (), g, 1.0, 2, ("angles",), (blade,) * blades, 0.0, zero, zero)
    )
    return closed_form.accelerations(
        angles, rates, form, LoadValues(torques[0], torques[1:]), math.sin, math.cos
    )


@pytest.mark.parametrize("blades", [1, 2, 3, 5])
@pytest.mark.parametrize("errata", [CORRECTED, Errata(e1=False, e2=False, e3=True)])
def test_the_corrected_derivation_is_the_closed_form(blades, errata):
    """E3 changes nothing where E2 is corrected. That the closed form is Lagrange's is shown in
    test_lagrange.py."""
    rng = np.random.default_rng(6)
    for _ in range(5):
        angles, rates = random_motion(rng, blades)
        chosen, torques = constants(rng), rng.uniform(-1.0, 1.0, 1 + blades).tolist()
        derived = DerivedRotor(*chosen, phases(blades), errata).accelerations(
            torques, angles, rates
        )
        exact = np.array(closed_form_accelerations(*chosen, torques, angles, rates, blades))
        np.testing.assert_allclose(
            derived, exact, rtol=0.0, atol=3e-13 * max(1.0, np.abs(exact).max())
        )
