"""Interval defects: round-off for a right run, a known pattern for every known fault, and a sum that is the error."""

from __future__ import annotations

import functools
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from support.defects import made_defects
from support.references import reference
from support.references import scene as shipped
from support.scenes import PAPER, paper

from rotor_mbs.analysis.judgement import judge
from rotor_mbs.methods.catalogue import find_method
from rotor_mbs.methods.solve import solve
from rotor_mbs.models.lagrange import closed_form
from rotor_mbs.models.lagrange import defects as defects_module
from rotor_mbs.models.lagrange.defects import fitted_rates, interval_defects
from rotor_mbs.models.lagrange.parameters import rate_units, resting_pitches
from rotor_mbs.models.lagrange.reference import _variational_matrices
from rotor_mbs.scenario.scene import Scene
from rotor_mbs.solution.defects import FLOOR_SAFETY, MAX_INTERVAL_GROWTH, Defects
from rotor_mbs.solution.metrics import defect_metrics, horizon_samples, running_growth
from rotor_mbs.solution.trajectory import Solution, Trajectory

TAYLOR, DOP853 = "lagrange/taylor", "lagrange/dop853"
ULP = float(np.finfo(float).eps)
FIG11 = paper("fig11", duration=1.0, samples=101, outputs=("angles", "rates"))


def defects_of(scene: Scene, run: Trajectory) -> Defects:
    return interval_defects(scene, run.time, run.angles, run.rates)


@functools.cache
def fig11_run() -> Trajectory:
    return solve(DOP853, FIG11, {}).trajectory


# ---- Of a right run

JUMPS = ((0.0, 0.0), (0.5, 2e6), (0.7525, 3e6), (0.7525, -2e6), (1.2, 1e6))
RIGHT = {
    "one blade": paper("fig03", duration=2.0, samples=201),
    "a torque that jumps inside an interval": paper("fig03", duration=2.0, samples=201, rotor_torque=JUMPS),
    "chaos": paper("fig11", duration=2.0, samples=201),
    "a stiff bearing": shipped("stiff/bearing-1e8"),
    "a damped turbine": shipped("stiff/nrel-5mw-damped"),
}


@pytest.mark.parametrize("name", RIGHT)
def test_a_right_run_has_round_off_alone(name: str) -> None:
    """That of its own numbers, and four units in the last place of a radian for the arithmetic of an interval."""
    pytest.importorskip("heyoka")
    defects = defects_of(RIGHT[name], solve(TAYLOR, RIGHT[name], {}).trajectory)
    assert (defects.sizes <= FLOOR_SAFETY * defects.floor + 4.0 * ULP).all()
    assert (defects.floor > 0.0).all()


def test_without_heyoka_the_defects_are_the_same(monkeypatch: pytest.MonkeyPatch) -> None:
    """To the tolerance of dop853, on a run that has defects of 1e-6."""
    pytest.importorskip("heyoka")
    run = solve("lagrange/ode45", FIG11, {}).trajectory
    with_heyoka = defects_of(FIG11, run)
    monkeypatch.setattr(defects_module, "is_available", lambda: False)
    without = defects_of(FIG11, run)
    np.testing.assert_allclose(without.angles, with_heyoka.angles, rtol=0, atol=1e-12)
    np.testing.assert_allclose(
        without.rates / without.rate_units, with_heyoka.rates / without.rate_units, rtol=0, atol=1e-12
    )


# ---- Wrong numbers of a model are seen in test_planted_faults.py; a wrong load, a wrong row and others in
# comparison/test_planted_mistakes.py.


def test_a_wrong_start_has_no_defect_but_is_in_the_predicted_error() -> None:
    """The measure is blind to it: the first row is judged apart."""
    angles = (FIG11.initial_angles[0] + 1e-6, *FIG11.initial_angles[1:])
    run = solve(DOP853, replace(FIG11, initial_angles=angles), {}).trajectory
    defects = defects_of(FIG11, run)
    assert defects.sizes.max() < 1e-12  # what dop853 leaves in an interval
    assert defects.predicted is not None
    np.testing.assert_allclose(defects.predicted, run.angles - fig11_run().angles, rtol=0, atol=1e-9)


# ---- The sum of the defects is the error

QUICK = {("fig11", "exudyn_tree/rk67"), ("fig09", "lagrange/ode45")}
# At its default step the tree's error is next to round-off.
COARSE: dict[str, dict[str, float]] = {"exudyn_tree/rk67": {"step": 5e-3}}


@pytest.mark.parametrize(
    ("name", "method"),
    [
        pytest.param(name, method, marks=() if (name, method) in QUICK else pytest.mark.full)
        for name in ("fig09", "fig11", "fig14a")
        for method in ("exudyn_tree/rk67", "lagrange/ode45", "exudyn_chain/generalized_alpha")
    ],
)
def test_the_predicted_error_is_the_true_one_within_a_fifth(name: str, method: str) -> None:
    """Of the largest so far, up to the horizon, between ten times what round-off becomes and 0.1 rad."""
    exact, scene = reference(f"paper/{name}"), paper(name)
    rows = horizon_samples(exact)
    scene = replace(scene, duration=float(exact.time[rows - 1]), samples=rows, outputs=("angles", "rates"))
    run = solve(method, scene, COARSE.get(method, {})).trajectory
    defects = defects_of(scene, run)
    assert defects.predicted is not None
    true = run.angles - exact.angles[:rows]
    largest = np.maximum.accumulate(np.abs(true).max(axis=1))
    floor = defects.floor.max() * running_growth(exact)[:rows]
    judged = (largest > 10.0 * floor) & (largest < 0.1)
    assert judged.sum() > 10
    off = np.abs(defects.predicted - true).max(axis=1)
    assert (off[judged] <= 0.2 * largest[judged]).all()


@pytest.mark.parametrize(
    ("name", "changes"),
    [
        ("fig03", {}),
        ("fig09", {}),
        # Rates that change within an interval.
        ("fig11", {"samples": 11, "initial_rates": (np.pi / 10.0, 30.0, 0.0, 0.0)}),
    ],
)
def test_the_transition_matrices_are_those_of_the_variational_equations(name: str, changes: dict[str, Any]) -> None:
    """Each carries their product on by one interval, to 1e-4 of its size, angles in rad and rates in their units."""
    pytest.importorskip("heyoka")
    scene = replace(paper(name, duration=1.0, samples=101, outputs=("angles", "rates")), **changes)
    exact = _variational_matrices(scene)
    transitions = defects_of(scene, solve(DOP853, scene, {}).trajectory).transitions
    assert transitions is not None
    units = np.concatenate([np.ones(len(scene.moving_coordinates)), rate_units(scene)])
    exact, transitions = (matrices * units / units[:, None] for matrices in (exact, transitions))
    off = np.abs(transitions @ exact[:-1] - exact[1:]).max(axis=(1, 2))
    assert (off <= 1e-4 * np.abs(exact[1:]).max(axis=(1, 2))).all()


@pytest.mark.parametrize("name", PAPER)
def test_pitches_at_rest_by_symmetry_are_those_that_stay_exactly_zero(name: str) -> None:
    scene, exact = paper(name), reference(f"paper/{name}")
    zero = [i for i in scene.moving_coordinates[1:] if not exact.angles[:, i].any() and not exact.rates[:, i].any()]
    assert list(resting_pitches(scene)) == zero


# ---- What cannot be judged

SIZES = (1e-9, 3e-9, 2e-9)


def test_numbers_of_defects() -> None:
    metrics = defect_metrics(made_defects(SIZES), None)  # rad, of intervals of 0.01 s
    assert (metrics["defect_max"], metrics["defect_median"], metrics["defect_time"]) == (3e-9, 2e-9, 0.02)
    assert (metrics["defect_mean"], metrics["angle_error_predicted"]) == pytest.approx((2e-9, 6e-9))
    assert metrics["defects_not_judged"] == 0


def test_the_bound_is_for_a_hundredth_of_a_second_without_growth() -> None:
    """Ten times as much in ten times as long, twice as much where errors grow tenfold; rounding beside it."""
    assert made_defects(SIZES).judged_size == 3e-9
    assert made_defects(SIZES, time=0.1 * np.arange(4.0)).judged_size == pytest.approx(3e-10)
    assert made_defects(SIZES, time=1e-3 * np.arange(4.0)).judged_size == 3e-9
    transitions = np.tile(10.0 * np.eye(2), (3, 1, 1))
    assert made_defects(SIZES, transitions=transitions).judged_size == pytest.approx(1.5e-9)
    rounded = made_defects(SIZES, rounding=np.full((4, 2), 1e-10))
    assert rounded.judged_size == pytest.approx(3e-9 - 3.0 * 2e-10)
    assert made_defects((1e-9, np.nan, 2e-9)).judged_size == np.inf
    runaway = made_defects(SIZES, rounding=np.full((4, 2), np.nan))
    assert defect_metrics(runaway, None)["defect_judged"] == np.inf


@pytest.mark.parametrize(("growth", "left_out"), [(0.9 * MAX_INTERVAL_GROWTH, 0), (1.1 * MAX_INTERVAL_GROWTH, 1)])
def test_an_interval_of_huge_growth_is_counted_and_not_judged(growth: float, left_out: int) -> None:
    """But for one without an end, which fails however much grows there."""
    transitions = np.tile(np.eye(2), (3, 1, 1))
    transitions[1, 0, 1] = growth
    metrics = defect_metrics(made_defects(SIZES, transitions=transitions), None)
    assert metrics["defects_not_judged"] == left_out
    assert metrics["defect_max"] == (2e-9 if left_out else 3e-9)
    transitions[1, 0, 1] = 1.0 if left_out == 0 else np.inf
    endless = made_defects((1e-9, np.nan, 2e-9), transitions=transitions)
    assert defect_metrics(endless, None)["defect_max"] == np.inf


def wild(rate: float, rows: slice) -> Solution:
    """A run with rates that no motion of the scene has."""
    solution = solve(DOP853, FIG11, {})
    rates = solution.trajectory.rates.copy()
    rates[rows, 2] = rate
    return replace(solution, trajectory=solution.trajectory.replace(rates=rates))


@pytest.mark.parametrize("rate", [1e200, 1e4])
def test_a_row_that_is_no_motion_is_inaccurate(rate: float) -> None:
    """Where the closed form has no end, and where it has one somewhere else."""
    with np.errstate(all="ignore"):
        judgement = judge(FIG11, wild(rate, slice(40, 41)), None)
    assert judgement.status == "inaccurate"
    assert not judgement.metrics["defect_max"] < 1.0


@pytest.fixture
def evaluations(monkeypatch: pytest.MonkeyPatch) -> list[int]:
    """Without heyoka: one number, how often the closed form has been evaluated."""
    monkeypatch.setattr(defects_module, "is_available", lambda: False)
    count, accelerations = [0], closed_form.accelerations

    def counted(*arguments: Any) -> Any:
        count[0] += 1
        assert count[0] < 10_000_000, "no end"
        return accelerations(*arguments)

    monkeypatch.setattr(closed_form, "accelerations", counted)
    return count


RATES = [1e6, 1e12, 1e100, 1e150, 1e153, 1e160, 1e200, 1.7e308]


@pytest.mark.parametrize("rows", [slice(40, 41), pytest.param(slice(None), marks=pytest.mark.full)], ids=["one", "all"])
@pytest.mark.parametrize("rate", RATES)
def test_samples_that_are_no_motion_are_assessed_in_bounded_work(
    rate: float, rows: slice, evaluations: list[int]
) -> None:
    """One interval's steps, those of the next ones, which are halved, and the fewest of each; of twelve evaluations.

    Three times that, since a step may be tried again and is looked at after some have been made.
    """
    solution = wild(rate, rows)
    evaluations[0] = 0
    with np.errstate(all="ignore"):
        judgement = judge(FIG11, solution, None)
    assert judgement.status != "ok"
    if rows != slice(None):
        assert judgement.status == "inaccurate"
    steps = 2 * defects_module._MAX_STEPS_DOP853 + len(solution.time) * defects_module._FEWEST_STEPS
    assert evaluations[0] <= 3 * 12 * steps


@pytest.mark.parametrize("method", [DOP853, "lagrange/radau"])
@pytest.mark.parametrize("rate", [rate for rate in RATES if 1e6 < rate < 1e300])
def test_a_start_far_from_any_motion_ends_by_itself(method: str, rate: float) -> None:
    """Without a time limit: a million turns a second are many steps, which is seen from the first ones."""
    with np.errstate(all="ignore"):
        run = solve(method, FIG11.replace(**{"initial.rates[2]": rate}), {})
    assert not run.integration.success
    assert run.integration.message.startswith("SciPy: ")


@pytest.mark.parametrize(
    "method", [TAYLOR, "exudyn_tree/rk67", pytest.param("exudyn_chain/generalized_alpha", marks=pytest.mark.full)]
)
@pytest.mark.parametrize("samples", [101, 11])
def test_how_far_apart_samples_are_decides_no_status(method: str, samples: int) -> None:
    """Over a second errors grow up to 200 times, and a method's own ones add up: the run is the same."""
    if not find_method(method).is_installed:
        pytest.skip(f"{method} is not installed")
    scene = replace(paper("fig11"), samples=samples, outputs=("angles", "rates"))
    judgement = judge(scene, solve(method, scene, {}), None)
    assert (judgement.status, judgement.message) == ("ok", "")


def test_a_run_that_left_the_symmetry_has_one_horizon_with_and_without_a_reference() -> None:
    pytest.importorskip("heyoka")
    pytest.importorskip("mujoco")
    scene = replace(paper("fig08"), samples=101, outputs=("angles", "rates", "tip"))
    run = solve("mujoco/rk4", scene, {})
    alone, compared = (
        judge(scene, run, exact).metrics for exact in (None, solve("lagrange/taylor", scene, {}).trajectory)
    )
    assert alone["horizon_s"] == compared["horizon_s"] < 0.5 * scene.duration
    # Of all errors.
    length = np.linalg.norm(scene.blades[0].tip)
    assert compared["tip_error_max"] <= 2.0 * length * compared["angle_error_max"] < 1e-2


# ---- Rates from angles; sums over rows


@pytest.mark.parametrize(
    ("name", "duration", "samples"),
    [("fig03", 1.0, 101), ("fig04b", 1.0, 101), ("fig11", 1.0, 101), ("fig09", 10.0, 51), ("fig14a", 10.0, 101)],
)
def test_rates_are_found_from_the_angles(name: str, duration: float, samples: int) -> None:
    """To the rounding of five angles."""
    scene = paper(name, duration=duration, samples=samples, outputs=("angles", "rates"))
    run = solve(DOP853, scene, {}).trajectory
    np.testing.assert_allclose(fitted_rates(scene, run.time, run.angles), run.rates, rtol=0, atol=1e-10)
    if duration == 1.0:  # rows so near that a wrong one takes nothing from the others
        wrong = run.angles.copy()
        wrong[50, 0] += 0.1
        rates = fitted_rates(scene, run.time, wrong)
        np.testing.assert_allclose(np.delete(rates - run.rates, np.s_[44:57], axis=0), 0.0, rtol=0, atol=1e-8)


def test_defects_over_rows_are_those_of_every_tenth_row() -> None:
    """A wrong gravity: ten defects, each carried on, are what the closed form finds from row to tenth row."""
    run = solve(DOP853, replace(FIG11, gravity=1.001 * FIG11.gravity), {}).trajectory
    every = slice(None, None, 10)
    sizes, floors = defects_of(FIG11, run).over_rows(10)
    strides = interval_defects(FIG11, run.time[every], run.angles[every], run.rates[every])
    half = len(FIG11.moving_coordinates)
    raw = np.abs(np.hstack([strides.angles, strides.rates]))
    units = np.concatenate([np.ones(half), defects_of(FIG11, run).rate_units])
    np.testing.assert_allclose(sizes * units, raw, rtol=2e-2, atol=1e-3 * raw.max())
    assert sizes.shape == floors.shape == (10, 2 * half)
    assert (sizes.max(axis=1) > 5.0 * defects_of(FIG11, run).channel_sizes.max()).any()  # a drift adds up
