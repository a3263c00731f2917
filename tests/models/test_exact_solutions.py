"""Every model against exact solutions: pendulum, rotation, torque, dampers, springs, many turns; and its symmetries."""

from __future__ import annotations

from dataclasses import replace
from math import hypot, pi

import numpy as np
import pytest
from support.exudyn_runs import CHAIN, EXPLICIT, METHODS, energy_error
from support.exudyn_runs import run as solved
from support.rotors import AXIAL, MIXED, PAPER, SLIM, STOUT, C, D, make_scene, pendulum
from support.symmetries import relabelled, relabelling_error

from rotor_mbs.methods.catalogue import find_method

# Explicit schemes resolve these slow motions to round-off; order 2 at 2.5e-4 to 5e-4 s leaves h² times the fourth
# derivative, some 1e-8, and the constraints of the chain their Newton tolerance.
FINE = ["lagrange/taylor", "lagrange/dop853", "mujoco/rk4", *EXPLICIT]
NAMES = [*FINE, *(name for name in METHODS if name not in EXPLICIT)]
BOUND = {name: 1e-10 if name in FINE else 2e-7 for name in NAMES}
INERTIA = 3 * 15000 * (C**2 + D**2)  # of the paper's rotor at zero pitch, kg m²

every_method = pytest.mark.parametrize("name", NAMES)


def run(name, scene, **settings):
    if not find_method(name).is_installed:
        pytest.skip(f"{name} is not installed")
    return solved(name, scene, **settings)


@every_method
def test_one_blade_is_an_elliptic_pendulum(name) -> None:
    """At zero pitch the mass point lies in the plane of rotation, turned from the blade's axis by atan(c / d)."""
    got = run(name, make_scene([11 * pi / 12, 0], [0, 0], duration=2.5, samples=251))
    exact = pendulum(11 * pi / 12, hypot(C, D), np.arctan2(C, D), 9.8, got.time)
    assert np.abs(got.angles[:, 0] - exact).max() < BOUND[name]
    if name not in CHAIN:  # an exact zero has nothing to grow from, though the equilibrium is unstable
        assert not got.angles[:, 1].any()
        assert not got.rates[:, 1].any()


@every_method
def test_a_pitch_without_inertia_leaves_a_pendulum(name) -> None:
    blade = replace(PAPER, centre_of_mass=(0.0, 0.0, D))
    got = run(name, make_scene([11 * pi / 12, 0.25], [0, 0.0], (blade,), duration=2.0))
    assert np.abs(got.angles[:, 0] - pendulum(11 * pi / 12, D, 0.0, 9.8, got.time)).max() < BOUND[name]
    assert np.array_equal(got.angles[:, 1], np.full(101, 0.25))
    assert not got.rates[:, 1].any()
    assert energy_error(got) < BOUND[name] * 15000 * 9.8 * D


@every_method
def test_three_equal_blades_at_zero_pitch_turn_uniformly_or_rest(name) -> None:
    got = run(name, make_scene([pi / 6, 0, 0, 0], [pi / 10, 0, 0, 0]))
    assert np.abs(got.angles[:, 0] - (pi / 6 + pi / 10 * got.time)).max() < BOUND[name]
    if name not in CHAIN:
        assert not got.angles[:, 1:].any()
        got = run(name, make_scene([pi / 6, 0, 0, 0], [0] * 4))
        # the three weights cancel but for round-off in cos(q + phase): 1e-16 g/d t²
        assert np.abs(got.angles - [pi / 6, 0, 0, 0]).max() < 1e-14


RAMP = ((0.1234, 0.0), (0.5, 4e6), (0.5, -2e6), (0.777, -2e6))


def ramp_motion(t):
    """Angle and rate under RAMP, from rest: the torque integrated twice, piece by piece."""
    start, jump = 0.1234, 0.5
    slope = 4e6 / (jump - start)
    rising, after = np.clip(t, start, jump) - start, np.maximum(t - jump, 0.0)
    rate = slope * rising**2 / 2 - 2e6 * after
    at_jump = slope * (jump - start) ** 2 / 2
    angle = slope * rising**3 / 6 + at_jump * after - 2e6 * after**2 / 2
    return angle / INERTIA, rate / INERTIA


@every_method
def test_torque_over_time_gives_exact_polynomials_across_kinks_and_jumps(name) -> None:
    scene = make_scene([0] * 4, [0] * 4, gravity=0.0, duration=1.0, samples=34, rotor_torque=RAMP)
    got = run(name, scene)
    angle, rate = ramp_motion(got.time)
    assert np.abs(got.angles[:, 0] - angle).max() < BOUND[name]
    assert np.abs(got.rates[:, 0] - rate).max() < BOUND[name]
    # the work is integrated from rates alone, and must meet the kinetic energy to the scheme's accuracy
    assert energy_error(got) < 10 * BOUND[name] * np.max(got.kinetic_energy)


@every_method
def test_shaft_damping_slows_the_rotor_exponentially(name) -> None:
    scene = make_scene([0.2, 0, 0, 0], [2, 0, 0, 0], gravity=0.0, shaft_damping=1.5 * INERTIA)
    got = run(name, scene)
    # order 2 leaves λ³h²t/12, 1e-7; Newton's relative tolerance of 1e-8 on positions is 1e-8/h, some 1e-5, on rates
    bound = 2e-5 if name in CHAIN else BOUND[name]
    assert np.abs(got.rates[:, 0] - 2 * np.exp(-1.5 * got.time)).max() < bound
    assert np.abs(got.angles[:, 0] - (0.2 + 2 / 1.5 * (1 - np.exp(-1.5 * got.time)))).max() < bound
    assert energy_error(got) < bound * got.kinetic_energy[0]


@pytest.mark.parametrize("start", [0.7, -9.0, 3 * pi + 0.3])
@every_method
def test_a_balanced_blade_is_a_damped_torsion_oscillator(name, start) -> None:
    # com on the pitch axis and Jxx = Jyy: the rotor does not feel the pitch, nor the pitch the rotor
    k, d, J = 40.0, 3.0, 7.0
    scene = make_scene([0.1, start], [1.0, 0.5], (AXIAL,), gravity=0.0, bearing_stiffness=(k,), bearing_damping=(d,))
    got = run(name, scene)
    decay, w = d / (2 * J), np.sqrt(k / J - (d / (2 * J)) ** 2)
    a, b = start, (0.5 + decay * start) / w
    exact = np.exp(-decay * got.time) * (a * np.cos(w * got.time) + b * np.sin(w * got.time))
    # Euler parameters turn too little by h²θ'³/12 a second: 1.7e-4 rad/s at 20 rad/s and 5e-4 s
    bound = BOUND[name] if name in FINE else 2e-4
    assert np.abs(got.angles[:, 1] - exact).max() < bound
    assert np.abs(got.angles[:, 0] - (0.1 + got.time)).max() < bound
    assert energy_error(got) < 10 * bound * (got.kinetic_energy + got.potential_energy)[0]


@pytest.mark.parametrize("name", METHODS)
def test_a_thousand_radians_a_second_are_counted_turn_by_turn(name) -> None:
    scene = make_scene([0.0, -50.0], [0.0, 1000.0], (AXIAL,), gravity=0.0, duration=1.0)
    # the rotation vector turns uniformly without error, and 5 rad a step; a turn missed would show as 6.28 rad
    settings, bound = {}, 1e-6
    if name == "exudyn_chain/extrapolated":
        settings, bound = {"tolerance": 1e-9}, 1e-5  # of a hundred intervals, of 10 rad each
    elif name in CHAIN:
        settings = {"node": "rotation_vector", "step": 5e-3}
    got = run(name, scene, **settings)
    assert np.abs(got.angles[:, 1] - (-50.0 + 1000.0 * got.time)).max() < bound
    assert np.abs(got.rates[:, 1] - 1000.0).max() < bound


@every_method
def test_turning_the_rotor_by_a_third_and_renaming_blades_changes_nothing(name) -> None:
    scene = make_scene([0.2, 0.3, -0.6, 0.9], [0.5, 0.1, 0.2, -0.3], (STOUT, SLIM, PAPER), duration=0.3, samples=31)
    error = relabelling_error(run(name, scene).angles, run(name, relabelled(scene)).angles)
    assert error < (1e-6 if name in CHAIN else 1e-11)  # round-off, for the chain Newton's tolerance


@every_method
def test_repeats_are_bit_identical(name) -> None:
    method = find_method(name)
    if not method.is_installed:
        pytest.skip(f"{name} is not installed")
    scene = replace(MIXED, duration=0.2, samples=21, rotor_torque=((0.0, 0.0), (0.0737, 500.0), (0.1, 100.0)))
    solver = method.build(scene, method.settings())
    first_report, first = solver.integrate(), solver.observe()
    second_report, second = solver.integrate(), solver.observe()
    assert first_report == second_report
    for quantity in ("angles", "rates", "tip", "kinetic_energy", "potential_energy", "work"):
        assert np.array_equal(first.get(quantity), second.get(quantity)), quantity
