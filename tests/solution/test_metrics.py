"""Metrics of hand-made motions: the rotor's extremes, and pitches that leave zero."""

from __future__ import annotations

import numpy as np
import pytest
from support.scenes import paper

from rotor_mbs.methods.solve import solve
from rotor_mbs.solution.metrics import metrics_of
from rotor_mbs.solution.trajectory import Array, Trajectory

SCENE = paper("fig08", duration=2.0, samples=201, outputs=("angles",))
TIME = np.linspace(0.0, 2.0, 201)


def motion(rotor: Array, pitch: Array) -> Trajectory:
    angles = np.zeros((len(rotor), 4))
    angles[:, 0], angles[:, 1] = rotor, pitch
    rates = np.zeros_like(angles)
    rates[:, 0] = -2.0 * rotor
    return Trajectory(TIME, angles, rates)


def test_extremes_of_the_rotor_have_their_sign_and_the_rate_has_none() -> None:
    metrics = metrics_of(SCENE, motion(-1.0 - np.sin(TIME), TIME), None)
    assert metrics["rotor_angle_min"] == (-1.0 - np.sin(TIME)).min()
    assert metrics["rotor_angle_max"] == -1.0
    assert metrics["rotor_rate_max"] == -2.0 * metrics["rotor_angle_min"]


def test_extremes_are_those_of_the_integrators_own_points_where_there_are_some() -> None:
    """Figure 5's numbers, 0.5127, 0.5273 and 0.0458, are read off these."""
    run = solve("printed/ode45", paper("fig05", duration=12.0, samples=13), {}).trajectory
    metrics = metrics_of(paper("fig05"), run, None)
    numbers = [round(metrics[f"rotor_{name}"], 4) for name in ("angle_min", "angle_max", "rate_max")]
    assert numbers == [0.5127, 0.5273, 0.0458]
    assert metrics["rotor_angle_max"] > run.angles[:, 0].max()


@pytest.mark.parametrize(
    ("pitch", "rate"),
    [
        (1e-11 * np.exp(8.0 * TIME), 8.0),
        (1e-11 * np.exp(15.0 * TIME), 15.0),  # large long before the end
        (np.full(201, 1.0), None),  # never small: nothing of it is exponential growth
        (np.where(TIME > 1.0, 1e-10 * np.exp(10.0 * (TIME - 1.0)), 1.0), None),  # large first, small later
    ],
)
def test_a_pitch_that_leaves_zero(pitch: Array, rate: float | None) -> None:
    metrics = metrics_of(SCENE, motion(TIME, pitch), motion(TIME, np.zeros(201)))
    assert metrics["zero_pitch_max"] == pitch.max()
    assert metrics["zero_pitch_left_s"] == TIME[np.argmax(pitch > 1e-9)]
    assert metrics.get("zero_pitch_growth_per_s") == (None if rate is None else pytest.approx(rate, rel=1e-9))
