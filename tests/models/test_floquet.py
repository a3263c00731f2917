"""Periodic motion of a turning rotor under gravity, and its multipliers: Mathieu's equation,
Liouville's rule."""

from __future__ import annotations

import math
from dataclasses import replace
from itertools import pairwise

import numpy as np
import pytest
from scipy.integrate import solve_ivp
from support.other_code import acceleration
from support.scenes import general, make_scene

from rotor_mbs.analysis.modes import floquet
from rotor_mbs.models.lagrange.floquet import Turn, periodic_turn
from rotor_mbs.models.lagrange.linearization import linearize
from rotor_mbs.scenario.scene import Blade, Scene

pytest.importorskip("heyoka")

# Its centre of mass off the pitch axis, in the plane of rotation: gravity on it is a stiffness that
# comes and goes.
BLADE = Blade(120.0, (0.5, 0.0, 6.0), (900.0, 880.0, 40.0, 0.0, 3.0 * 120.0, 0.0), (0.5, 0.0, 9.0))
PITCH_INERTIA = 40.0 + 120.0 * 0.25
DAMPED = general(bearing_damping=(30.0, 20.0, 10.0), shaft_damping=50.0)


def slow_blade(speed: float, stiffness: float) -> Scene:
    """One blade on a hub so heavy that nothing changes its speed."""
    return make_scene(
        [0.3, 0.0],
        [speed, 0.0],
        (BLADE,),
        gravity=9.81,
        hub_inertia=1e15,
        bearing_stiffness=(stiffness,),
    )


def others(scene: Scene, speed: float):
    turn = periodic_turn(scene, speed)
    assert not turn.message
    return floquet(turn.transition, turn.flow, turn.gradient, speed)[1]


def mathieu_numbers(speed: float, stiffness: float) -> tuple[float, float]:
    """(a, q) of θ'' + (a - 2q cos 2s) θ = 0, a turn being s = π: Jzz θ̈ + (k + (Jyy - Jxx) Ω² + m g
    x sin φ) θ = 0."""
    unit = PITCH_INERTIA * speed**2 / 4.0
    centrifugal = (880.0 + 120.0 * 0.25 - 900.0) * speed**2
    return (stiffness + centrifugal) / unit, 120.0 * 9.81 * 0.5 / (2.0 * unit)


def mathieu_trace(a: float, q: float) -> float:
    """Trace of the transition matrix over s = π by Hill's determinant: 2 - 4 Δ(0) sin²(π √a /
    2)."""
    before, determinant = 1.0, 1.0
    ratios = q / ((2.0 * np.arange(-4000, 4001)) ** 2 - a)
    for given, other in pairwise(ratios.tolist()):
        before, determinant = determinant, determinant - given * other * before
    return 2.0 - 4.0 * determinant * math.sin(0.5 * math.pi * math.sqrt(a)) ** 2


@pytest.mark.parametrize(("speed", "stiffness"), [(2.0, 1000.0), (0.5, 900.0), (3.0, 650.0)])
def test_a_blade_turning_slowly_under_gravity_obeys_mathieus_equation(speed, stiffness):
    multipliers = others(slow_blade(speed, stiffness), speed)
    assert len(multipliers) == 2
    trace = mathieu_trace(*mathieu_numbers(speed, stiffness))
    assert multipliers.sum() == pytest.approx(trace, rel=1e-8, abs=1e-8)
    assert np.prod(multipliers) == pytest.approx(1.0, rel=1e-8)


def oracle(scene: Scene, turn: Turn):
    """The same turn by SciPy from equations written once more: dense solution."""
    driven = replace(scene, rotor_torque=((0.0, turn.torque),))
    span = (0.0, 2.0 * math.pi / turn.speed)
    return solve_ivp(
        lambda t, y: acceleration(driven, t, y),
        span,
        turn.start,
        "DOP853",
        rtol=1e-12,
        atol=1e-13,
        dense_output=True,
    )


LOADED = replace(
    DAMPED,
    pitch_torque=(((0.0, 300.0),), (), ((0.0, -200.0),)),
    bearing_rest=((), ((0.0, 0.2),), ((0.0, -0.1),)),
)


@pytest.mark.parametrize(
    "scene",
    [DAMPED, LOADED],
    ids=["damped", "pitch torques and rest angles"],
)
@pytest.mark.full
def test_the_motion_repeats_itself_after_a_turn_also_by_other_equations(scene: Scene) -> None:
    turn = periodic_turn(scene, 1.2)
    end = oracle(scene, turn).y[:, -1]
    np.testing.assert_allclose(end - turn.start, [2.0 * math.pi, *[0.0] * 7], atol=1e-9)
    # Liouville: the multipliers' product is what the dampers take in a turn.
    sizes = np.abs(floquet(turn.transition, turn.flow, turn.gradient, 1.2)[0])
    assert np.log(sizes).sum() == pytest.approx(turn.trace_integral, rel=1e-8)
    if scene is DAMPED:
        assert turn.torque == pytest.approx(50.0 * 1.2, rel=0.05)


def test_without_gravity_the_multipliers_are_those_of_the_eigenvalues():
    scene = replace(DAMPED, gravity=0.0)
    turn = periodic_turn(scene, 2.0)
    result, _ = floquet(turn.transition, turn.flow, turn.gradient, 2.0)
    angles = [0.3, *turn.start[1:4]]
    linear = linearize(scene, angles, [2.0, 0, 0, 0], turn.torque)
    n = len(linear.stiffness)
    values = np.linalg.eigvals(
        np.block([[np.zeros((n, n)), np.eye(n)], [-linear.stiffness, -linear.damping]])
    )
    expected = np.exp(values * math.pi)
    for multiplier in expected:
        assert np.abs(result - multiplier).min() < 1e-7


def test_where_no_motion_is_found_the_reason_is_given():
    # One blade whose weight stops it: at so low a mean speed it would have to rest near the top.
    heavy = replace(slow_blade(0.1, 1000.0), hub_inertia=0.0)
    turn = periodic_turn(heavy, 0.1)
    assert turn.message
    assert np.isnan(turn.transition).all()
