"""Torques on pitches and commands of rest angles: exact solutions, their work, and all models on one scene."""

from __future__ import annotations

import functools
from math import sqrt

import numpy as np
import pytest
from support.rotors import ALL, AXIAL, MIXED, PAPER, blade_points, closed_form, energies, make_scene

from rotor_mbs.analysis import kinematics
from rotor_mbs.methods.catalogue import REFERENCE, find_method
from rotor_mbs.methods.solve import solve
from rotor_mbs.models.printed import literal
from rotor_mbs.models.printed.methods import METHODS as PRINTED
from rotor_mbs.scenario.scene import Scene
from rotor_mbs.scenario.time_table import value_at
from rotor_mbs.solution.trajectory import Trajectory

# Settings at which a method has the exact solutions below to 1e-10 rad.
TO_ROUND_OFF: dict[str, dict[str, object]] = {
    "lagrange/taylor": {},
    "lagrange/ode45": {"relative_tolerance": 1e-13, "absolute_tolerance": 1e-13},
    "lagrange/dop853": {},
    "lagrange/radau": {"relative_tolerance": 1e-12, "absolute_tolerance": 1e-14},
    REFERENCE: {},
    "exudyn_tree/rk44": {},
    "exudyn_tree/rk67": {},
    "exudyn_tree/dopri5": {},
    "exudyn_chain/extrapolated": {"tolerance": 1e-12},
    "mujoco/rk4": {},
}
STEP_S = 0.43  # s: half way between two samples
STIFFNESS, DAMPING, INERTIA, STEP = 40.0, 3.0, 7.0, 0.3
ROTOR_INERTIA = 12.0 + 50.0 * 9.0
# The centre of mass on the pitch axis and Jxx = Jyy: rotor and pitch do not feel each other.
CONSTANT = make_scene(
    [0.1, 0.2], [1.0, -0.5], (AXIAL,), gravity=0.0, duration=1.0, samples=51, rotor_torque=((0.0, 5.0),),
    pitch_torque=(((0.0, 12.0),),), bearing_stiffness=(STIFFNESS,), bearing_rest=(((0.0, 0.7),),),
)  # fmt: skip
COMMAND = make_scene(
    [0.1, 0.0], [1.0, 0.0], (AXIAL,), gravity=0.0, duration=2.0, samples=101, bearing_stiffness=(STIFFNESS,),
    bearing_damping=(DAMPING,), bearing_rest=(((STEP_S, 0.0), (STEP_S, STEP)),),
)  # fmt: skip


def run(method: str, scene: Scene, **settings: object) -> Trajectory:
    if not find_method(method).is_installed:
        pytest.skip(f"{method} is not installed")
    solution = solve(method, scene, settings)
    assert solution.integration.success
    return solution.trajectory


DECAY = DAMPING / (2.0 * INERTIA)
FREQUENCY = sqrt(STIFFNESS / INERTIA - DECAY**2)
RATE = STEP * (FREQUENCY + DECAY**2 / FREQUENCY)  # rad/s: the response's rate is this much times e^(-a s) sin(w s)


def step_response(time):
    """Pitch and its rate of J θ'' + d θ' + k (θ - r) = 0 from rest, r stepping up at STEP_S."""
    a, w, s = DECAY, FREQUENCY, np.maximum(time - STEP_S, 0.0)
    angle = STEP * (1.0 - np.exp(-a * s) * (np.cos(w * s) + a / w * np.sin(w * s)))
    return angle, RATE * np.exp(-a * s) * np.sin(w * s)


def damper_work(time):
    """∫ d θ'² dt of the step response, integrated by parts: ∫ e^(-2 a s) sin²(w s) ds."""
    a, w, s = DECAY, FREQUENCY, np.maximum(time - STEP_S, 0.0)
    oscillating = (a - np.exp(-2 * a * s) * (a * np.cos(2 * w * s) - w * np.sin(2 * w * s))) / (2 * (a**2 + w**2))
    return DAMPING * RATE**2 * 0.5 * ((1.0 - np.exp(-2 * a * s)) / (2 * a) - oscillating)


@pytest.mark.parametrize("method", TO_ROUND_OFF)
def test_work_and_energy_of_a_step_of_the_command(method: str) -> None:
    """And its motion. The jump puts ½ k r² into the spring while the pitch is at 0; then only the damper does work."""
    result = run(method, COMMAND, **TO_ROUND_OFF[method])
    angle, rate = step_response(result.time)
    assert np.abs(result.angles[:, 1] - angle).max() < 1e-10
    assert np.abs(result.rates[:, 1] - rate).max() < 1e-9
    assert np.abs(result.angles[:, 0] - (0.1 + result.time)).max() < 1e-10  # the rotor does not feel it
    stored = 0.5 * STIFFNESS * STEP**2
    work = np.where(result.time < STEP_S, 0.0, stored) - damper_work(result.time)
    assert np.abs(result.work - work).max() < 1e-9 * stored
    rest = np.where(result.time < STEP_S, 0.0, STEP)
    kinetic = 0.5 * INERTIA * rate**2 + 0.5 * ROTOR_INERTIA
    potential = 0.5 * STIFFNESS * (angle - rest) ** 2
    assert np.abs(result.kinetic_energy - kinetic).max() < 1e-9 * kinetic[0]
    assert np.abs(result.potential_energy - potential).max() < 1e-9 * stored
    assert np.abs(result.kinetic_energy + result.potential_energy - result.work - kinetic[0]).max() < 1e-9 * kinetic[0]


@pytest.mark.parametrize("method", TO_ROUND_OFF)
def test_work_of_a_constant_torque_and_of_a_constant_rest_angle(method: str) -> None:
    """And the motion: the pitch swings about 0.7 + 12/k from 0.2, the rotor's torque of 5 N m accelerates it."""
    result, w = run(method, CONSTANT, **TO_ROUND_OFF[method]), sqrt(STIFFNESS / INERTIA)
    middle, swing = 0.7 + 12.0 / STIFFNESS, w * result.time
    pitch = middle + (0.2 - middle) * np.cos(swing) - 0.5 / w * np.sin(swing)
    assert np.abs(result.angles[:, 1] - pitch).max() < 1e-10
    assert np.abs(result.angles[:, 0] - (0.1 + result.time + 2.5 * result.time**2 / ROTOR_INERTIA)).max() < 1e-10
    work = 5.0 * (result.angles[:, 0] - 0.1) + 12.0 * (result.angles[:, 1] - 0.2)
    assert np.abs(result.work - work).max() < 1e-12 * np.abs(result.work).max()
    spring = 0.5 * STIFFNESS * (result.angles[:, 1] - 0.7) ** 2
    assert np.abs(result.potential_energy - spring).max() < 1e-12 * spring.max()
    energy = result.kinetic_energy + result.potential_energy - result.work
    assert np.abs(energy - energy[0]).max() < 1e-9 * energy[0]


@functools.cache
def mixed_motion() -> np.ndarray:
    return closed_form(MIXED)


# rad
BOUND = {
    "lagrange/dop853": 1e-10, "lagrange/taylor": 1e-10, REFERENCE: 1e-10, "exudyn_tree/rk67": 1e-10,
    "exudyn_tree/rk44": 1e-9, "exudyn_tree/dopri5": 1e-9, "mujoco/rk4": 1e-9, "exudyn_chain/extrapolated": 1e-9,
    "exudyn_tree/generalized_alpha": 5e-5, "exudyn_chain/generalized_alpha": 5e-5, "exudyn_chain/newmark_index2": 5e-5,
}  # fmt: skip
SLOW = ("lagrange/taylor", REFERENCE, "exudyn_chain/newmark_index2")


@pytest.mark.parametrize(
    "method", [pytest.param(name, marks=pytest.mark.full) if name in SLOW else name for name in BOUND]
)
def test_every_load_at_once_follows_the_equations_written_anew(method: str) -> None:
    """Angles, tips, energies and work; those of low order to what their steps leave."""
    result, exact = run(method, MIXED), mixed_motion()
    bound = BOUND[method]
    assert np.abs(result.angles - exact[:, :4]).max() < bound
    for i, blade in enumerate(MIXED.blades):
        assert np.abs(result.tip[:, i] - blade_points(MIXED, exact, i, blade.tip)).max() < 10 * bound
    kinetic, potential = energies(MIXED, exact)
    scale = np.abs(kinetic).max()
    assert np.abs(result.kinetic_energy - kinetic).max() < 10 * bound * scale
    assert np.abs(result.potential_energy - potential).max() < 10 * bound * scale
    balance = result.kinetic_energy + result.potential_energy - result.work
    assert np.abs(balance - balance[0]).max() < 10 * bound * scale
    own = kinematics.potential_energy(MIXED, result.time, result.angles)
    gap = 1e-7 if method.startswith("exudyn_chain") else 1e-12  # its bodies leave the joints by some 1e-9 m
    assert np.abs(result.potential_energy - own).max() < gap * scale


@pytest.mark.parametrize("pitches", [1, 3])
def test_the_printed_equations_take_the_torques_of_the_pitches(pitches: int) -> None:
    """τ3 to τ5 in rows 2 to 4: from rest without gravity, a short motion starts with the printed accelerations."""
    tables = (((0.0, 400.0),), ((0.0, -100.0), (1.0, 0.0)), ((0.0, 250.0),))[:pitches]
    start = [0.3, 0.4, -0.2, 0.7][: 1 + pitches]
    scene = make_scene(
        start, [0.0] * len(start), gravity=0.0, duration=1e-2, samples=3, pitch_torque=tables,
        rotor_torque=((0.0, 1e5),), outputs=ALL,
    )  # fmt: skip
    result = run("printed/ode45", scene, relative_tolerance=1e-12, absolute_tolerance=1e-15)
    text = literal.one_blade_accelerations if pitches == 1 else literal.three_blade_accelerations
    x, _, z = PAPER.centre_of_mass
    torques = [1e5, *(table[0][1] for table in tables)]
    expected = text(PAPER.mass, x, z, 0.0, torques, [*start, *[0.0] * len(start)])
    np.testing.assert_allclose(2.0 * (result.angles[-1] - start) / 1e-4, expected, rtol=2e-2)
    mean = [0.5 * (value_at(table, 0.0) + value_at(table, 1e-2)) for table in tables]
    assert result.work[-1] == pytest.approx(np.dot([1e5, *mean], result.angles[-1] - result.angles[0]), rel=1e-3)
    assert "pitch torque" in [item.name for item in PRINTED[0].items(scene)]
