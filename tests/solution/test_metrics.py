"""Metrics of hand-made motions, and of loads: extremes, pitches that leave zero, loads in judgement
and drawings."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from support.defects import made_defects
from support.scenes import make_scene, paper

import rotor_mbs as rm
from rotor_mbs.analysis.judgement import judge
from rotor_mbs.errors import InputError
from rotor_mbs.methods.solve import solve
from rotor_mbs.runs.design import columns_in, metric_columns
from rotor_mbs.scenario.catalogue import find_scenes
from rotor_mbs.scenario.scene import Blade, Scene
from rotor_mbs.solution.metrics import HORIZON_GROWTH, METRICS, energy_drifts, metrics_of
from rotor_mbs.solution.quantities import LOADS, energy_balance
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


def beyond_the_horizon(run: Trajectory) -> Trajectory:
    """As a reference that is of no use from its second half on."""
    half = len(run.time) // 2
    growth = np.where(np.arange(len(run.time)) < half, 1.0, 2.0 * HORIZON_GROWTH)
    return run.replace(error_growth=growth)


def test_a_wrong_load_or_a_gap_beyond_the_horizon_counts(run: Solution) -> None:
    """Neither is compared with the reference: at its own state a load is known, and a joint is
    closed. An angle is compared."""
    exact = run.trajectory
    angles, force = exact.angles.copy(), exact.blade_root_force.copy()
    angles[-1, 0] += 1.0
    force[-1, 0, 0] += 1e3
    gap = np.zeros(len(exact.time))
    gap[-1] = 0.1
    wrong = exact.replace(angles=angles, blade_root_force=force, constraint_error=gap)
    defects = made_defects((0.0,) * (len(exact.time) - 1), time=exact.time, own_loads=exact)
    metrics = metrics_of(LOADED, wrong, beyond_the_horizon(exact), defects)
    largest = np.linalg.norm(force, axis=2).max()
    assert metrics["blade_root_force_error"] == pytest.approx(1e3 / largest, rel=1e-9)
    assert metrics["constraint_error_max"] == 0.1
    assert (metrics["angle_error_max"], metrics["angle_error_whole"]) == (0.0, 1.0)


def test_errors_of_angles_need_a_reference_with_rows_and_a_scene_that_wants_angles() -> None:
    given, none = motion(TIME, TIME), Trajectory(TIME[:0], np.empty((0, 4)), np.empty((0, 4)))
    assert "angle_error_whole" in metrics_of(SCENE, given, given)
    assert "angle_error_whole" not in metrics_of(SCENE, given, none)
    others = replace(SCENE, outputs=("rates",))
    assert "angle_error_whole" not in metrics_of(others, given, given)


# One blade of 10 kg with its centre of mass at 5 m, under 2 m/s²: 100 J; a bearing of 200 N m/rad
# that is 0.5 rad from rest at the start: 25 J.
HEAVY = make_scene(
    (0.0, 0.6),
    (0.0, 0.0),
    blades=(Blade(10.0, (3.0, 0.0, 4.0), (1.0, 1.0, 1.0, 0.0, 0.0, 0.0), (0.0, 0.0, 5.0)),),
    gravity=2.0,
    bearing_stiffness=(200.0,),
    bearing_rest=(((0.0, 0.1), (1.0, 0.4)),),
)


def with_energies(kinetic: list[float], potential: list[float], work: list[float]) -> Trajectory:
    rows = np.zeros((len(kinetic), 2))
    return Trajectory(
        np.linspace(0.0, 1.0, len(kinetic)),
        rows,
        rows,
        kinetic_energy=np.array(kinetic),
        potential_energy=np.array(potential),
        work=np.array(work),
    )


@pytest.mark.parametrize(
    ("scene", "kinetic", "potential", "work", "scale", "drift"),
    [
        (HEAVY, [60.0, 0.0], [0.0, 43.0], [0.0, -15.0], 200.0, 0.01),
        # a gain, where the one above is a loss
        (HEAVY, [60.0, 70.0, 50.0], [0.0] * 3, [0.0, 5.0, -15.0], 200.0, 0.025),
        # in joules, where nothing moves and nothing has weight
        (
            replace(HEAVY, gravity=0.0, bearing_stiffness=(), bearing_rest=()),
            [0.0, 3.0],
            [0.0] * 2,
            [0.0] * 2,
            0.0,
            3.0,
        ),
    ],
    ids=["two samples", "three samples", "no scale"],
)
def test_the_drift_of_the_energy_is_relative_to_all_energies(
    scene: Scene,
    kinetic: list[float],
    potential: list[float],
    work: list[float],
    scale: float,
    drift: float,
) -> None:
    """Of a run, and of many runs side by side."""
    run = with_energies(kinetic, potential, work)
    metrics = metrics_of(scene, run, None)
    assert metrics["energy_scale_J"] == pytest.approx(scale, rel=1e-12)
    assert metrics["energy_drift_max"] == pytest.approx(drift, rel=1e-12)
    energies = [np.array([values]) for values in (kinetic, potential, work)]
    drifts = energy_drifts([scene], energies[0], energies[2], energy_balance(*energies))
    assert drifts == pytest.approx([drift], rel=1e-12)


def test_a_single_sample_has_no_drift() -> None:
    assert "energy_drift_max" not in metrics_of(HEAVY, with_energies([1.0], [0.0], [0.0]), None)


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
