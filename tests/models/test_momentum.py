"""Momentum against the impulses of what acts on a rotor, by a sum that shares nothing with the models' equations.

About the shaft L(t) - L(0) = ∫ (torque + moment of the weights - damping) dt; in space p(t) - p(0) = ∫ (force of the
bearing + weights) dt.
"""

from __future__ import annotations

import itertools
from dataclasses import replace

import numpy as np
import pytest
from scipy.interpolate import make_interp_spline
from support.references import scene as shipped
from support.rotors import angular_momentum, blade_points
from support.scenes import general, paper

from rotor_mbs.methods.solve import solve
from rotor_mbs.scenario.scene import Scene
from rotor_mbs.solution.trajectory import Array, Trajectory

OUTPUTS = ("angles", "rates", "energy", "loads")
TORQUE = ((0.0, 0.0), (0.5, 20000.0), (0.75, 30000.0), (0.75, -15000.0), (2.0, 10000.0))
SCENES = {
    "chaotic": paper("fig11", outputs=OUTPUTS, duration=2.0, samples=2001),
    "torque with a jump": general(
        outputs=OUTPUTS, duration=2.0, samples=801, shaft_damping=4000.0, bearing_damping=(200.0, 100.0, 300.0),
        rotor_torque=TORQUE,
    ),
    "stiff bearings": replace(shipped("stiff/nrel-5mw-damped"), outputs=OUTPUTS, duration=1.0, samples=4001),
}  # fmt: skip
# Largest error allowed, of the largest momentum and the largest impulse: rounding, and the tolerance of the chain.
METHODS = {"lagrange/dop853": 1e-9, "exudyn_tree/rk67": 1e-9, "exudyn_chain/extrapolated": 1e-5}


def integral(time: Array, values: Array, ends: list[float]) -> Array:
    """(n, ...) from the first of (n,) times to each, by splines of order 7 between `ends`, where slopes may jump."""
    total = np.zeros_like(values)
    for begin, end in itertools.pairwise(ends):
        part = (time > begin - 1e-9) & (time < end + 1e-9)
        primitive = make_interp_spline(time[part], values[part], k=7).antiderivative()
        total[part] = total[part][0] + primitive(time[part])
    return total


def momentum_errors(scene: Scene, run: Trajectory) -> dict[str, float]:
    """About the shaft, and in space where no force jumps: relative to the largest momentum."""
    time, states, shaft = run.time, np.hstack([run.angles, run.rates]), np.array([0.0, 1.0, 0.0])
    pitch_axis = np.array([0.0, 0.0, 1.0])  # of every blade, in its frame
    ends = sorted({0.0, scene.duration, *(t for t, _ in scene.rotor_torque)})
    weights, moment, linear = np.zeros(3), np.zeros(len(time)), np.zeros((len(time), 3))
    for i, blade in enumerate(scene.blades):
        centre = blade_points(scene, states, i, blade.centre_of_mass)
        omega = run.rates[:, :1] * shaft + run.rates[:, 1 + i, None] * blade_points(scene, states, i, pitch_axis)
        linear += blade.mass * np.cross(omega, centre)
        moment += blade.mass * scene.gravity * centre[:, 0]
        weights[2] += blade.mass * scene.gravity
    impulse = integral(time, moment, ends) - scene.shaft_damping * (run.angles[:, 0] - run.angles[0, 0])
    for (begin, first), (end, last) in itertools.pairwise(scene.rotor_torque):
        into = np.clip(time - begin, 0.0, end - begin)
        if end > begin:
            impulse += first * into + 0.5 * (last - first) / (end - begin) * into**2
    angular = angular_momentum(scene, run.angles, run.rates)
    pairs = {"about the shaft": (angular, impulse)}
    if len(ends) == 2:
        pairs["in space"] = linear, integral(time, run.shaft_force - weights, ends)
    return {
        name: float(np.abs(values - values[0] - change).max() / np.abs(values).max())
        for name, (values, change) in pairs.items()
    }


@pytest.mark.parametrize("method", METHODS)
@pytest.mark.parametrize("name", SCENES)
def test_momentum_changes_by_the_impulses(name: str, method: str) -> None:
    """And an error of 1e-4 in the bearing's force, or in the hub's inertia, is seen."""
    scene = SCENES[name]
    run = solve(method, scene, {"tolerance": 1e-10} if "chain" in method else {}).trajectory
    errors = momentum_errors(scene, run)
    assert ("in space" in errors) == (name != "torque with a jump")
    assert max(errors.values()) < METHODS[method], errors
    if name != "stiff bearings":  # whose rotor turns steadily
        heavier = replace(scene, hub_inertia=1.0001 * scene.hub_inertia + 1e3)
        assert momentum_errors(heavier, run)["about the shaft"] > METHODS[method]
    if "in space" in errors:
        assert momentum_errors(scene, run.replace(shaft_force=1.0001 * run.shaft_force))["in space"] > METHODS[method]
