"""Linearized models: exact derivatives, exact cases, and closed form, tree, chain and MuJoCo beside
each other."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest
from support.other_code import acceleration
from support.scenes import AXIAL, general, make_scene, shipped

from rotor_mbs.analysis.modes import modes_of
from rotor_mbs.methods.catalogue import find_method
from rotor_mbs.models.exudyn import linearization as engine
from rotor_mbs.models.lagrange import linearization as closed
from rotor_mbs.scenario.scene import Scene

DAMPED = general(bearing_damping=(30.0, 20.0, 10.0), shaft_damping=50.0)


def without_gravity(scene: Scene, speed: float) -> Scene:
    return replace(scene, gravity=0.0) if speed else scene


def state(scene: Scene, speed: float) -> np.ndarray:
    return closed.steady_rotation(scene, speed) if speed else closed.equilibrium(scene)


def linear(scene: Scene, speed: float):
    """The closed form about the scene's steady state: without gravity where it turns."""
    rates = [speed] + [0.0] * len(scene.blades)
    return closed.linearize(
        without_gravity(scene, speed),
        state(scene, speed),
        rates,
        closed.holding_torque(scene, speed),
    )


def frequencies(linearization, scene: Scene, speed: float) -> np.ndarray:
    is_cyclic = scene.gravity == 0.0 or speed > 0.0
    return modes_of(
        linearization.stiffness, linearization.damping, is_cyclic=is_cyclic
    ).undamped_frequencies


def test_derivatives_of_the_closed_form_are_those_of_the_equations_written_once_more():
    angles, rates = np.array([0.4, 0.7, -1.1, 2.0]), np.array([1.3, -0.4, 0.9, 0.2])
    result = closed.linearize(DAMPED, angles, rates, 0.0)
    start = np.concatenate([angles, rates])
    for k in range(8):
        step = np.zeros(8)
        step[k] = 1e-3
        # Of the sixth order: weights 45, -9, 1 over 60.
        change = sum(
            w
            * (
                acceleration(DAMPED, 0.0, start + j * step)
                - acceleration(DAMPED, 0.0, start - j * step)
            )
            for j, w in ((1, 45.0), (2, -9.0), (3, 1.0))
        )
        column = -change[4:] / (60.0 * 1e-3)
        ours = (result.stiffness if k < 4 else result.damping)[:, k % 4]
        np.testing.assert_allclose(ours, column, rtol=1e-9, atol=1e-9)


def test_pendulum():
    blade, J = AXIAL, AXIAL.inertia[1] + AXIAL.mass * 9.0
    hanging = make_scene(
        [2.5, 0.1], [0, 0], (blade,), gravity=9.81, hub_inertia=20.0, bearing_stiffness=(70.0,)
    )
    assert closed.equilibrium(hanging) == pytest.approx([math.pi, 0.0], abs=1e-12)
    expected = [math.sqrt(blade.mass * 9.81 * 3.0 / (J + 20.0)), math.sqrt(10.0)]
    assert frequencies(linear(hanging, 0.0), hanging, 0.0) == pytest.approx(
        sorted(expected), rel=1e-13
    )
    upright = replace(hanging, initial_angles=(0.0, 0.0))
    assert closed.equilibrium(upright) == pytest.approx([0.0, 0.0], abs=0.0)
    rates = modes_of(linear(upright, 0.0).stiffness, np.zeros((2, 2)), is_cyclic=False).growth_rates
    assert max(rates) == pytest.approx(expected[0], rel=1e-13)


DRIVEN = replace(
    DAMPED,
    pitch_torque=(((0.0, 300.0),), (), ((0.0, -200.0),)),
    bearing_rest=((), ((0.0, 0.2),), ((0.0, -0.1),)),
)
SOURCES = [
    (DRIVEN, 0.0),
    (DRIVEN, 1.2),
    (DAMPED, 8.0),
    (replace(DAMPED, gravity=0.0), 0.0),
    (shipped("stiff/nrel-5mw"), 0.0),
    (shipped("stiff/nrel-5mw"), 1.267),
    (shipped("paper/fig05"), 1.0),
    (shipped("check/held"), 0.0),
    (shipped("stiff/bearing-1e12-damping-0.7"), 0.0),
]


@pytest.mark.parametrize(
    ("scene", "speed"), SOURCES, ids=lambda value: getattr(value, "name", value)
)
def test_closed_form_tree_chain_and_mujoco_have_the_same_frequencies(scene, speed):
    ours, angles, at = linear(scene, speed), state(scene, speed), without_gravity(scene, speed)
    others = [engine.linearize_tree(at, angles, speed, closed.holding_torque(scene, speed))]
    if not speed:
        others.append(engine.linearize_chain(at, angles, 0.0, 0.0))
    third = find_method("mujoco/rk4")
    if third.is_installed:
        others.append(third.linearize(at, angles, speed, closed.holding_torque(scene, speed)))
    expected = frequencies(ours, scene, speed)
    significant = expected > 1e-6 * np.nanmax(expected)
    size = max(np.abs(ours.stiffness).max(), 1e-3)
    for other in others:
        np.testing.assert_allclose(
            frequencies(other, scene, speed)[significant], expected[significant], rtol=1e-8
        )
        np.testing.assert_allclose(other.stiffness, ours.stiffness, atol=1e-8 * size)
        np.testing.assert_allclose(
            other.damping, ours.damping, atol=1e-8 * max(1.0, np.abs(ours.damping).max())
        )
        assert np.abs(other.residual).max() < 1e-8 * size
