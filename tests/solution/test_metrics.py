"""Metrics of hand-made motions, and of loads: extremes, pitches that leave zero, loads in judgement
and drawings."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from support.scenes import paper

import rotor_mbs as rm
from rotor_mbs.analysis.judgement import judge
from rotor_mbs.errors import InputError
from rotor_mbs.methods.solve import solve
from rotor_mbs.runs.design import columns_in, metric_columns
from rotor_mbs.scenario.catalogue import find_scenes
from rotor_mbs.solution.metrics import METRICS, metrics_of
from rotor_mbs.solution.quantities import LOADS
from rotor_mbs.solution.trajectory import Array, Solution, Trajectory

SCENE = paper("fig08", duration=2.0, samples=201, outputs=("angles",))
TIME = np.linspace(0.0, 2.0, 201)


def motion(rotor: Array, pitch: Array) -> Trajectory:
    angles = np.zeros((len(rotor), 4))
    angles[:, 0], angles[:, 1] = rotor, pitch
    rates = np.zeros_like(angles)
    rates[:, 0] = -2.0 * rotor
    return Trajectory(TIME, angles, rates)


def test_a_metric_is_declared_where_it_is_computed_and_nowhere_else() -> None:
    """Every number of a judged run is declared, for /runs or with its quantity."""
    scene = paper("fig08", duration=0.2, samples=21)
    reference = solve("lagrange/dop853", scene, {})
    metrics = judge(scene, solve("lagrange/ode45", scene, {}), reference.trajectory).metrics
    columns = metric_columns(scene.outputs)
    assert {"angle_error_max", "defect_judged", "tip_error_max"} <= metrics.keys() <= columns.keys()
    of_runs = [name for name, value in METRICS.items() if "runs" in value.tables.split()]
    assert [
        name for name in columns if name in METRICS and name not in {"tip_error_max"}
    ] == of_runs


def test_a_declared_metric_is_a_column_of_its_tables() -> None:
    for name, value in METRICS.items():
        for table in ("runs", "bench", "stability", "sweep"):
            assert (name in columns_in(table)) == (table in value.tables.split())


def test_extremes_of_the_rotor_have_their_sign_and_the_rate_has_none() -> None:
    metrics = metrics_of(SCENE, motion(-1.0 - np.sin(TIME), TIME), None)
    assert metrics["rotor_angle_min"] == (-1.0 - np.sin(TIME)).min()
    assert metrics["rotor_angle_max"] == -1.0
    assert metrics["rotor_rate_max"] == -2.0 * metrics["rotor_angle_min"]


@pytest.mark.parametrize(
    ("pitch", "rate"),
    [
        (1e-11 * np.exp(8.0 * TIME), 8.0),
        (np.where(TIME < 0.5, 1e-13, 1e-11 * np.exp(8.0 * (TIME - 0.5))), 8.0),  # round-off first
        (1e-11 * np.exp(230.0 * TIME), 230.0),  # ten samples: enough for a slope
        (1e-11 * np.exp(240.0 * TIME), None),  # nine
        (np.full(201, 1.0), None),  # never small: nothing of it is exponential growth
        # large first, small later
        (np.where(TIME > 1.0, 1e-10 * np.exp(10.0 * (TIME - 1.0)), 1.0), None),
    ],
)
def test_a_pitch_that_leaves_zero(pitch: Array, rate: float | None) -> None:
    metrics = metrics_of(SCENE, motion(TIME, pitch), motion(TIME, np.zeros(201)))
    assert metrics["zero_pitch_max"] == pitch.max()
    assert metrics["zero_pitch_left_s"] == TIME[np.argmax(pitch > 1e-9)]
    assert metrics.get("zero_pitch_growth_per_s") == (
        None if rate is None else pytest.approx(rate, rel=1e-9)
    )


LOADED = replace(find_scenes(["check/loads"])[0], duration=0.2, samples=41)


@pytest.fixture(scope="module")
def run() -> Solution:
    return solve("lagrange/dop853", LOADED, {})


def test_the_largest_loads_with_their_times_and_blades(run: Solution) -> None:
    metrics = metrics_of(LOADED, run.trajectory, None)
    forces = np.linalg.norm(run.blade_root_force, axis=2)
    sample, blade = np.argwhere(forces == forces.max())[0]
    assert metrics["blade_root_force_max"] == forces.max()
    assert metrics["blade_root_force_max_time_s"] == run.time[sample]
    assert metrics["blade_root_force_max_blade"] == blade + 1
    assert metrics["shaft_moment_max"] == np.linalg.norm(run.shaft_moment, axis=1).max()
    assert "shaft_moment_max_blade" not in metrics
    assert metrics["pitch_actuator_moment_max"] == np.abs(run.pitch_actuator_moment).max()


@pytest.mark.parametrize("load", [load.name for load in LOADS])
def test_a_load_that_is_off_is_inaccurate(run: Solution, load: str) -> None:
    """By a millionth of the largest force (at the arm): a hundred thousand times the bound, not yet
    another motion."""
    exact, metric = run.trajectory, f"{load}_error"
    result = judge(LOADED, run, exact)
    assert (result.status, result.metrics[metric]) == ("ok", 0.0)
    force = np.linalg.norm(exact.blade_root_force, axis=2).max() * (
        1.0 if load.endswith("force") else 6.0
    )
    for share, is_false in ((1e-6, False), (0.1, True)):
        wrong = exact.get(load).copy()
        wrong[20].flat[0] += share * force
        result = judge(LOADED, replace(run, trajectory=exact.replace(**{load: wrong})), exact)
        assert result.status == "inaccurate"
        assert load.replace("_", " ") in result.message
        assert result.metrics[metric] == pytest.approx(share, rel=0.1)
        assert result.false_success is is_false


def test_loads_are_drawn_from_python() -> None:
    """A panel per axis with a line per blade, in the unit of its label; of the shaft a line per
    axis."""
    run = rm.run(LOADED, "lagrange/dop853")
    roots, shaft = run.plot.loads(), run.plot.loads("shaft_moment")
    assert [len(axes.lines) for axes in roots.axes] == [4, 4, 4]
    assert "kN" in roots.axes[1].get_ylabel()
    assert roots.axes[1].lines[3].get_ydata() == pytest.approx(
        1e-3 * run.blade_root_force[:, 3, 1], rel=1e-15
    )
    assert [len(axes.lines) for axes in shaft.axes] == [3]
    with pytest.raises(InputError, match="no load 'angles'"):
        run.plot.loads("angles")
