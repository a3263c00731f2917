"""Momentum of the runs of every model against the impulses of what acts on them: a proof without
their equations of motion, from the samples alone."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from support.momentum_balances import angular_balance, linear_balance
from support.scenes import general, paper

from rotor_mbs.methods.catalogue import find_method
from rotor_mbs.methods.solve import solve
from rotor_mbs.scenario.catalogue import find_scenes
from rotor_mbs.scenario.scene import Scene
from rotor_mbs.solution.trajectory import Trajectory

WITH_LOADS = ("angles", "rates", "energy", "loads")
JUMPS = ((0.0, 0.0), (0.5, 20000.0), (0.7525, 30000.0), (0.7525, -15000.0), (1.2, 10000.0))
SCENES = {
    "fig11": paper("fig11", outputs=WITH_LOADS),
    "jumps": general(
        outputs=WITH_LOADS, duration=2.0, samples=401, shaft_damping=4000.0, rotor_torque=JUMPS
    ),
    "NREL": replace(find_scenes(["stiff/nrel-5mw-damped"])[0], outputs=WITH_LOADS, samples=1001),
}


METHODS = ("exudyn_tree/rk67", "mujoco/rk4", "lagrange/taylor", "lagrange/dop853")
_QUICK = {("fig11", method) for method in METHODS} | {("jumps", METHODS[0]), ("NREL", METHODS[3])}


@pytest.mark.parametrize(
    ("name", "method"),
    [
        pytest.param(name, method, marks=() if (name, method) in _QUICK else pytest.mark.full)
        for name in SCENES
        for method in METHODS
    ],
)
def test_momentum_is_the_impulse_of_torque_weights_and_bearing(name: str, method: str) -> None:
    """About the shaft, and in space where no torque jumps. Seen: 3e-11 after jumps, else 1e-13;
    MuJoCo 1e-7."""
    if not find_method(method).is_installed:
        pytest.skip(f"{method} is not installed")
    scene = SCENES[name]
    run = solve(method, scene, {}).trajectory
    bound = 1e-6 if method == "mujoco/rk4" else 1e-9
    angular, linear = angular_balance(scene, run), linear_balance(scene, run)
    assert angular is not None
    assert angular.largest < bound
    assert (linear is None) == (name == "jumps")
    if linear is not None:
        assert linear.largest < bound


def _turning(scene: Scene, angle) -> Trajectory:
    """The rotor at `angle` (n,) rad of the samples' times; pitches stay at zero."""
    time = np.linspace(0.0, scene.duration, scene.samples)
    angles, rates = np.zeros((2, len(time), 1 + len(scene.blades)))
    angles[:, 0], rates[:, 0] = angle(time), np.gradient(angle(time), time, edge_order=2)
    return Trajectory(time, angles, rates)


def test_torque_tables_are_integrated_exactly() -> None:
    """A ramp from 0 to 60 N m with a jump back between samples, under which the rotor turns at
    constant speed.

    Nothing may act on it: what is left at the end is the area of the table.
    """
    table = ((0.0, 0.0), (1.03, 60.0), (1.03, 0.0), (2.0, 20.0))
    scene = paper("fig15-1kNm", gravity=0.0, duration=2.0, samples=21, rotor_torque=table)
    balance = angular_balance(scene, _turning(scene, lambda t: 0.3 * t))
    assert balance is not None
    assert balance.error[-1] == pytest.approx(0.5 * 1.03 * 60.0 + 0.5 * 0.97 * 20.0, rel=1e-9)


def test_samples_that_do_not_resolve_the_motion_give_no_balance() -> None:
    scene = paper("fig15-1kNm", gravity=0.0, duration=2.0, samples=21)
    assert angular_balance(scene, _turning(scene, lambda t: 9.0 * t)) is not None
    assert angular_balance(scene, _turning(scene, lambda t: 11.0 * t)) is None


def test_a_bearing_faster_than_the_samples_gives_no_linear_balance() -> None:
    """189 rad/s against samples 10 ms apart: the force swings in between, which no polynomial
    through them knows."""
    scene = replace(SCENES["NREL"], samples=101)
    run = solve("lagrange/dop853", scene, {}).trajectory
    angular = angular_balance(scene, run)
    assert angular is not None
    assert angular.largest < 1e-9
    assert linear_balance(scene, run) is None


def test_a_wrong_force_of_the_bearing_is_noticed() -> None:
    scene = general(
        outputs=WITH_LOADS, duration=2.0, samples=401, bearing_damping=(200.0, 100.0, 300.0)
    )
    run = solve("lagrange/dop853", scene, {}).trajectory
    force = run.shaft_force
    right, wrong = (
        linear_balance(scene, run.replace(shaft_force=force * factor))
        for factor in (1.0, 1.0 + 1e-6)
    )
    assert right is not None
    assert wrong is not None
    assert right.largest < 1e-9 < wrong.largest
