"""Interval defects: round-off for a right run, a known pattern for every known fault, and a sum
that is the error."""

from __future__ import annotations

import functools
import re
from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from support.defects import made_defects
from support.references import reference
from support.scenes import AXIAL, PAPER_SCENES, general, make_scene, paper, shipped

from rotor_mbs.analysis.judgement import judge
from rotor_mbs.errors import InputError
from rotor_mbs.methods.catalogue import find_method
from rotor_mbs.methods.solve import solve
from rotor_mbs.models.lagrange import closed_form
from rotor_mbs.models.lagrange import defects as defects_module
from rotor_mbs.models.lagrange.defects import (
    FIT_ROWS,
    explicit_steps,
    fitted_rates,
    interval_defects,
    interval_ends,
    quick_ends,
    rates_of_change,
    runge_kutta_step,
)
from rotor_mbs.models.lagrange.hamilton import resting_pitches
from rotor_mbs.models.lagrange.heyoka_adapter import is_available
from rotor_mbs.models.lagrange.parameters import rate_units
from rotor_mbs.scenario.scene import Scene
from rotor_mbs.solution import defects as solution_defects
from rotor_mbs.solution.defects import FLOOR_SAFETY, OK_ERROR, Defects
from rotor_mbs.solution.metrics import defect_metrics, horizon_samples, running_growth
from rotor_mbs.solution.trajectory import Array, Solution, Trajectory

TAYLOR, DOP853 = "lagrange/taylor", "lagrange/dop853"
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
    "a torque that jumps inside an interval": paper(
        "fig03", duration=2.0, samples=201, rotor_torque=JUMPS
    ),
    "chaos": paper("fig11", duration=2.0, samples=201),
    "a stiff bearing": shipped("stiff/bearing-1e8"),
    "a damped turbine": shipped("stiff/nrel-5mw-damped"),
}


@pytest.mark.parametrize(
    "name",
    [
        pytest.param(name, marks=pytest.mark.full if name == "a damped turbine" else ())
        for name in RIGHT
    ],
)
def test_a_right_run_has_round_off_alone(name: str) -> None:
    """That of its own numbers and of the arithmetic of an interval."""
    pytest.importorskip("heyoka")
    defects = defects_of(RIGHT[name], solve(TAYLOR, RIGHT[name], {}).trajectory)
    assert (defects.sizes <= FLOOR_SAFETY * defects.floor).all()
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
        without.rates / without.rate_units,
        with_heyoka.rates / without.rate_units,
        rtol=0,
        atol=1e-12,
    )


# ---- Wrong numbers of a model are seen in test_planted_faults.py; a wrong load, a wrong row and
# others in comparison/test_planted_mistakes.py.


def test_a_wrong_start_has_no_defect_but_is_in_the_predicted_error() -> None:
    """The measure is blind to it: the first row is judged apart."""
    angles = (FIG11.initial_angles[0] + 1e-6, *FIG11.initial_angles[1:])
    run = solve(DOP853, replace(FIG11, initial_angles=angles), {}).trajectory
    defects = defects_of(FIG11, run)
    assert defects.sizes.max() < 1e-12  # what dop853 leaves in an interval
    np.testing.assert_allclose(
        defects.predicted, run.angles - fig11_run().angles, rtol=0, atol=1e-9
    )


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
    """Of the largest so far, up to the horizon, between ten times what round-off becomes and 0.1
    rad."""
    exact, scene = reference(f"paper/{name}"), paper(name)
    rows = horizon_samples(exact)
    scene = replace(
        scene, duration=float(exact.time[rows - 1]), samples=rows, outputs=("angles", "rates")
    )
    run = solve(method, scene, COARSE.get(method, {})).trajectory
    defects = defects_of(scene, run)
    true = run.angles - exact.angles[:rows]
    largest = np.maximum.accumulate(np.abs(true).max(axis=1))
    floor = defects.floor.max() * running_growth(exact)[:rows]
    judged = (largest > 10.0 * floor) & (largest < 0.1)
    assert judged.sum() > 10
    off = np.abs(defects.predicted - true).max(axis=1)
    assert (off[judged] <= 0.2 * largest[judged]).all()


def change_by_start(scene: Scene, step: float) -> Array:
    """(n, 2c, 2c) of the c moving angles and their rates: how each row changes with those of the
    start."""
    moving = scene.moving_coordinates

    def states(changed: Array) -> Array:
        angles, rates = np.array(scene.initial_angles), np.array(scene.initial_rates)
        angles[moving] += changed[: len(moving)]
        rates[moving] += changed[len(moving) :]
        moved = replace(
            scene, initial_angles=tuple(angles.tolist()), initial_rates=tuple(rates.tolist())
        )
        run = solve(TAYLOR if is_available() else DOP853, moved, {}).trajectory
        return np.hstack([run.angles[:, moving], run.rates[:, moving]])

    steps = step * np.eye(2 * len(moving))
    return np.stack([(states(one) - states(-one)) / (2.0 * step) for one in steps], axis=2)


@pytest.mark.parametrize(
    ("name", "changes"),
    [
        ("fig03", {}),
        ("fig09", {}),
        # Rates that change within an interval.
        ("fig11", {"samples": 11, "initial_rates": (np.pi / 10.0, 30.0, 0.0, 0.0)}),
        # So much, from rest, that as many explicit steps as the rates at the start ask for would
        # leave 2e-3.
        ("fig11", {"samples": 3, "pitch_torque": (((0.0, 3300.0),), (), ())}),
    ],
)
def test_the_transition_matrices_are_those_of_the_variational_equations(
    name: str, changes: dict[str, Any]
) -> None:
    """Each carries their product on by one interval, to 1e-4 of its size, angles in rad and rates
    in their units.

    Their product: what becomes of small differences of the start, by central differences, good to
    1e-8 of it.
    """
    scene = replace(paper(name, duration=1.0, samples=101, outputs=("angles", "rates")), **changes)
    exact = change_by_start(scene, 1e-6)
    transitions = defects_of(scene, solve(DOP853, scene, {}).trajectory).transitions
    units = np.concatenate([np.ones(len(scene.moving_coordinates)), rate_units(scene)])
    exact, transitions = (matrices * units / units[:, None] for matrices in (exact, transitions))
    off = np.abs(transitions @ exact[:-1] - exact[1:]).max(axis=(1, 2))
    assert (off <= 1e-4 * np.abs(exact[1:]).max(axis=(1, 2))).all()


@pytest.mark.parametrize("name", PAPER_SCENES)
def test_pitches_at_rest_by_symmetry_are_those_that_stay_exactly_zero(name: str) -> None:
    scene, exact = paper(name), reference(f"paper/{name}")
    zero = [
        i
        for i in scene.moving_coordinates[1:]
        if not exact.angles[:, i].any() and not exact.rates[:, i].any()
    ]
    assert list(resting_pitches(scene)) == zero


# ---- What cannot be judged

SIZES = (1e-9, 3e-9, 2e-9)


def test_numbers_of_defects() -> None:
    metrics = defect_metrics(made_defects(SIZES), None)  # rad, of intervals of 0.01 s
    assert (metrics["defect_max"], metrics["defect_median"], metrics["defect_time"]) == (
        3e-9,
        2e-9,
        0.02,
    )
    assert (metrics["defect_mean"], metrics["angle_error_predicted"]) == pytest.approx((2e-9, 6e-9))
    assert metrics["defects_not_judged"] == 0
    of_others = defect_metrics(made_defects(SIZES), None, is_corrected=False)
    assert of_others.keys() == {"defect_max", "defect_median", "defect_time", "defect_mean"}


def judged(sizes: Sequence[float], **changes: Any) -> list[float]:
    return list(made_defects(sizes, **changes).judged_sizes)


def test_a_bound_is_multiplied_by_the_length_of_an_interval_and_by_the_growth_over_it() -> None:
    """Ten times as much is allowed in ten times as long, and as many times as errors grow; rounding
    in addition."""
    assert judged(SIZES) == pytest.approx(SIZES)
    assert judged(SIZES, time=0.1 * np.arange(4.0)) == pytest.approx(
        [size / 10.0 for size in SIZES]
    )
    assert judged(SIZES, time=1e-3 * np.arange(4.0)) == pytest.approx(SIZES)
    transitions = np.tile(np.eye(2), (3, 1, 1))
    transitions[1] *= 4.0
    assert judged(SIZES, transitions=transitions) == pytest.approx([1e-9, 0.75e-9, 2e-9])
    transitions[1] *= 0.1
    assert judged(SIZES, transitions=transitions) == pytest.approx(SIZES)
    assert judged((1e-9, np.nan, 2e-9))[1] == np.inf


def test_the_drift_is_what_defects_of_one_sign_add_up_to_in_a_hundred_rows() -> None:
    """The last fifty rows of this run add up to half."""
    assert made_defects([1e-9] * 250).drift == pytest.approx(1e-7)


def test_a_pitch_that_is_fixed_has_the_defect_by_which_it_moves() -> None:
    """It keeps its angle, and its rate of zero."""
    scene = paper("fig04b", duration=1.0, samples=11, outputs=("angles", "rates"))
    scene = replace(scene, initial_angles=(scene.initial_angles[0], 0.3))
    run = solve(DOP853, scene, {}).trajectory
    assert not defects_of(scene, run).angles[:, 1].any()
    angles, rates = run.angles.copy(), run.rates.copy()
    angles[5, 1] += 1e-3
    rates[5, 1] += 2e-3
    defects = defects_of(scene, run.replace(angles=angles, rates=rates))
    assert defects.angles[4:6, 1] == pytest.approx([-1e-3, 1e-3], abs=1e-15)
    assert defects.rates[4:6, 1] == pytest.approx([-2e-3, 2e-3], abs=1e-15)


def test_of_a_sum_over_rows_the_rows_at_its_ends_are_rounded() -> None:
    """That at the start is carried on, twice as large; those in between cancel."""
    rounding = np.zeros((7, 2))
    rounding[:, 0] = [1e-10, 1.0, 1.0, 2e-10, 1.0, 1.0, 4e-10]
    transitions = np.tile(np.eye(2), (6, 1, 1))
    transitions[1, 0, 0] = 2.0
    defects = made_defects([0.0] * 6, rounding=rounding, transitions=transitions)
    assert defects.over_rows(3)[1][:, 0] == pytest.approx([4e-10, 6e-10])


def test_each_interval_and_each_coordinate_has_its_own_floor() -> None:
    """Three times: of the row before, carried on, and the row after; a row that is rough excuses no
    other."""
    rounding = np.zeros((4, 2))
    rounding[2:, 0] = 1e-10
    transitions = np.tile(np.eye(2), (3, 1, 1))
    transitions[2, 0, 0] = 2.0
    defects = made_defects(SIZES, rounding=rounding, transitions=transitions)
    assert defects.floors[:, 0] == pytest.approx([0.0, 1e-10, 3e-10], abs=1e-17)
    assert defects.floors[:, 1] == pytest.approx([0.0, 0.0, 0.0], abs=1e-17)
    assert defects.excess == pytest.approx([1e-9, 3e-9 - 3e-10, 2e-9 - 9e-10])


def test_near_a_singular_pitch_the_arithmetic_of_an_interval_loses_more() -> None:
    """Two unit roundoffs of the largest number, magnified."""
    states, conditioning = np.full((4, 2), 5.0), np.array([1.0, 1e6, 1.0])
    floors = made_defects(SIZES, states=states, conditioning=conditioning).floors
    assert floors[:, 0] == pytest.approx(2.0**-52 * 5.0 * conditioning, rel=1e-3)


@pytest.mark.parametrize(("share", "not_judged"), [(0.9, 0), (1.1, 1)])
def test_an_interval_is_not_judged_where_rounding_may_be_a_hundredth_of_a_radian(
    share: float, not_judged: int
) -> None:
    """But one without an end, which fails whatever rounding there is."""
    rounding = np.zeros((4, 2))
    rounding[2, 0] = share * OK_ERROR / (3.0 * 1.0)
    metrics = defect_metrics(made_defects((0.0, 0.0, 0.0), rounding=rounding), None)
    # of the row that ends one interval and begins the next
    assert metrics["defects_not_judged"] == 2 * not_judged
    endless = defect_metrics(made_defects((0.0, np.nan, 0.0), rounding=rounding), None)
    assert (endless["defect_max"], endless["defect_judged"]) == (np.inf, np.inf)


def test_a_defect_that_is_allowed_and_could_be_seen_in_a_plot_is_counted() -> None:
    """Rows so far apart that 0.02 rad are allowed: what is above 0.01 rad is not judged."""
    time = 1e4 * np.arange(4.0)
    for size, count in ((0.009, 0), (0.011, 1)):
        metrics = defect_metrics(made_defects((0.0, size, 0.0), time=time), None)
        assert metrics["defects_not_judged"] == count
        assert metrics["defect_excess"] == pytest.approx(size)
        assert metrics["defect_judged"] == pytest.approx(1e-6 * size)


# A rotor that moves and a pitch that is fixed, in four intervals: the largest defect is of its angle,
# of the pitch, of its rate (2 rad/s are a radian), and of the rate of the pitch (4 rad/s are one).
# The angle of the rotor is rounded by 1e-10 rad in each row, which three times makes 6e-10 in an
# interval.
FOUR = (1e-9, 2e-9, 3e-9, 5e-9)


def four_intervals(**changes: Any) -> Defects:
    rounding = np.zeros((5, 2))
    rounding[:, 0] = 1e-10
    fields: dict[str, Any] = {
        "angles": np.array([[1e-9, 0.0], [0.0, -2e-9], [0.0, 0.0], [0.0, 0.0]]),
        "rates": np.array([[0.0, 0.0], [0.0, 0.0], [-6e-9, 0.0], [0.0, 20e-9]]),
        "rate_units": np.array([2.0, 4.0]),
        "rounding": rounding,
    }
    return made_defects(FOUR, **(fields | changes))


def test_a_fixed_pitch_and_the_rates_in_their_units_count_like_the_moving_angles() -> None:
    defects = four_intervals()
    assert defects.sizes == pytest.approx(FOUR, rel=1e-12, abs=0.0)
    expected = [[4e-10, 0.0], [0.0, 0.0], [0.0, 3e-9], [0.0, 0.0]]
    np.testing.assert_allclose(defects.channel_excess, expected, rtol=1e-7, atol=1e-17)
    assert defects.excess == pytest.approx([4e-10, 14e-10, 3e-9, 44e-10], rel=1e-7, abs=0.0)
    assert defects.mean == pytest.approx(5e-9 / 4.0, rel=1e-12, abs=0.0)
    # of a fixed pitch, too, a defect that is not finite is one
    rates = defects.rates.copy()
    rates[0, 1] = np.nan
    assert list(four_intervals(rates=rates).excess[:1]) == [np.inf]


def test_defects_of_every_coordinate_are_divided_by_the_factor_of_their_interval() -> None:
    defects = four_intervals(time=np.array([0.0, 0.01, 0.21, 0.22, 0.32]))
    excess = 1e-9 * np.array([[1.0, 2.0], [3.0, 4.0], [5.0, 6.0], [7.0, 8.0]])
    by_unit = defects.in_bound_units(excess)
    np.testing.assert_allclose(
        by_unit, excess / np.array([[1.0], [20.0], [1.0], [10.0]]), rtol=1e-9
    )


def test_the_error_growth_begins_with_one_and_is_that_of_the_product() -> None:
    defects = made_defects((0.0,) * 3, transitions=np.tile(np.diag([3.0, 0.5]), (3, 1, 1)))
    assert list(defects.error_growth) == pytest.approx([1.0, 3.0, 9.0, 27.0], rel=1e-12)
    assert [defects.horizon_samples(limit) for limit in (2.0, 10.0, 30.0)] == [1, 3, 4]


# Nine radians at 100 rad/s are nine steps, of independent errors: three units of 500 rad.
FAST = {"time": 0.09 * np.arange(5.0), "states": np.tile([500.0, 100.0], (5, 1))}


def test_the_arithmetic_of_an_interval_adds_up_as_the_root_of_its_radians() -> None:
    floors = made_defects((0.0,) * 4, **FAST).floors
    np.testing.assert_allclose(floors, 3.0 * 500.0 * 2.0**-52, rtol=1e-5)


@pytest.mark.parametrize(("growth", "factor"), [(0.5, 1.0), (1.2, 1.2**4), (1.0, 1.0)])
def test_the_arithmetic_over_rows_adds_up_as_their_root_and_grows(
    growth: float, factor: float
) -> None:
    """And by how much it grows counts, but not by how much it shrinks."""
    transitions = np.tile(np.diag([growth, growth]), (4, 1, 1))
    _, floors = made_defects((0.0,) * 4, transitions=transitions, **FAST).over_rows(4)
    expected = 2.0 * factor * 3.0 * 500.0 * 2.0**-52
    np.testing.assert_allclose(floors, [[expected, expected]], rtol=1e-5)


def test_a_coordinate_that_is_not_rounded_feels_the_square_of_what_others_are() -> None:
    rounding = np.zeros((3, 2))
    rounding[:, 0] = 1e-3
    floors = made_defects((0.0, 0.0), rounding=rounding).floors
    np.testing.assert_allclose(floors, [[2e-3 + 4e-6, 4e-6]] * 2, rtol=1e-9)


def test_the_error_of_a_pitch_that_rests_at_zero_is_the_pitch_itself() -> None:
    """Whatever the rotor's error is: it moves the rotor on, and no error moves the pitch."""
    matrices = np.tile(np.eye(4), (2, 1, 1))
    matrices[:, 1, 0] = 5.0  # of the pitch by the rotor
    matrices[:, 0, 1] = 2.0  # of the rotor by the pitch
    states = np.zeros((3, 4))
    states[:, 1] = [0.0, 1e-9, 4e-9]
    defects = made_defects(
        (0.0, 0.0),
        angles=np.array([[-1e-9, 7.0], [-1e-9, 7.0]]),
        rates=np.zeros((2, 2)),
        rate_units=np.ones(2),
        moving=(0, 1),
        resting=(1,),
        states=states,
        rounding=np.zeros((3, 4)),
        start=np.zeros(4),
        growth_units=np.ones(4),
        transitions=matrices,
    )
    np.testing.assert_allclose(
        defects.predicted, [[0.0, 0.0], [1e-9, 1e-9], [4e-9, 4e-9]], rtol=1e-12
    )


def test_the_matrices_of_a_long_run_are_not_kept(monkeypatch: pytest.MonkeyPatch) -> None:
    """Asked for a few rows at a time; those of a short one are asked for once."""
    monkeypatch.setattr(solution_defects, "BLOCK_ROWS", 2)
    for kept_rows, expected in ((4, {4}), (3, {2})):
        monkeypatch.setattr(solution_defects, "KEPT_ROWS", kept_rows)
        asked: list[int] = []

        def find(rows: slice, asked: list[int] = asked) -> Array:
            asked.append(rows.stop - rows.start)
            return np.tile(np.eye(2), (asked[-1], 1, 1))

        defects = replace(made_defects((0.0,) * 4), find_transitions=find)
        assert (defects.excess == 0.0).all()
        assert (defects.error_growth == 1.0).all()
        assert {*asked} == expected
        assert len(asked) == (1 if kept_rows == 4 else 4)


def test_the_floor_of_a_run_is_its_largest_that_is_known() -> None:
    rounding = np.zeros((4, 2))
    rounding[1, 0] = 1e-10
    for last, floor in ((2e-10, 2e-10), (np.inf, 1e-10)):
        rounding[3, 0] = last
        metrics = defect_metrics(made_defects((0.0,) * 3, rounding=rounding), None)
        assert metrics["defect_floor"] == pytest.approx(floor, rel=1e-7, abs=0.0)


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


# Of DOP853 in an interval; of the paper's scenes none takes more than ten.
MAX_STEPS, MIN_STEPS = 10_000, 50
RATES = [1e6, 1e12, 1e100, 1e150, 1e153, 1e160, 1e200, 1.7e308]


@pytest.mark.parametrize(
    "rows", [slice(40, 41), pytest.param(slice(None), marks=pytest.mark.full)], ids=["one", "all"]
)
@pytest.mark.parametrize("rate", RATES)
def test_samples_that_are_no_motion_are_assessed_in_bounded_work(
    rate: float, rows: slice, evaluations: list[int]
) -> None:
    """One interval's steps, those of the next ones, which are halved, and the fewest of each; of
    twelve evaluations.

    Three times that, since a step may be tried again and is looked at after some have been made.
    """
    solution = wild(rate, rows)
    evaluations[0] = 0
    with np.errstate(all="ignore"):
        judgement = judge(FIG11, solution, None)
    assert judgement.status != "ok"
    if rows != slice(None):
        assert judgement.status == "inaccurate"
    assert evaluations[0] <= 3 * 12 * (2 * MAX_STEPS + len(solution.time) * MIN_STEPS)


@pytest.mark.parametrize("method", [DOP853, "lagrange/radau"])
@pytest.mark.parametrize("rate", [rate for rate in RATES if 1e6 < rate < 1e300])
def test_a_start_far_from_any_motion_ends_by_itself(method: str, rate: float) -> None:
    """Without a time limit: a million turns a second are many steps, which is seen from the first
    ones."""
    with np.errstate(all="ignore"):
        run = solve(method, FIG11.replace(**{"initial.rates[2]": rate}), {})
    assert not run.integration.success
    assert run.integration.message.startswith("SciPy: ")


@pytest.mark.parametrize(
    "method",
    [
        TAYLOR,
        "exudyn_tree/rk67",
        pytest.param("exudyn_chain/generalized_alpha", marks=pytest.mark.full),
    ],
)
@pytest.mark.parametrize("samples", [101, 11])
def test_how_far_apart_samples_are_decides_no_status(method: str, samples: int) -> None:
    """Over a second errors grow up to 200 times, and a method's own ones add up: the run is the
    same."""
    if not find_method(method).is_installed:
        pytest.skip(f"{method} is not installed")
    scene = replace(paper("fig11"), samples=samples, outputs=("angles", "rates"))
    judgement = judge(scene, solve(method, scene, {}), None)
    assert (judgement.status, judgement.message) == ("ok", "")


def test_a_run_that_left_the_symmetry_is_compared_to_the_horizon_of_its_scene() -> None:
    """Rounding moves a pitch that is zero; without a reference the defects say the same, to the
    run's own horizon."""
    pytest.importorskip("heyoka")
    pytest.importorskip("mujoco")
    scene = replace(paper("fig08"), samples=101, outputs=("angles", "rates", "tip"))
    run = solve("mujoco/rk4", scene, {})
    compared = judge(scene, run, solve("lagrange/taylor", scene, {}).trajectory)
    alone = judge(scene, run, None)
    assert compared.metrics["horizon_s"] == scene.duration
    # It turns over, where the motion has pitches of at most 0.8 rad.
    assert compared.metrics["angle_error_max"] > 2.0 * np.pi
    assert alone.metrics["angle_error_predicted"] > 1.0
    for verdict in (compared, alone):
        assert verdict.status == "inaccurate"
        assert re.match(
            r"pitch [23] leaves zero at t = 1\.[89]\d* s, where symmetry keeps it", verdict.message
        )
        assert "in which the pitch stays zero" in verdict.advice


# ---- Rates from angles; sums over rows


@pytest.mark.parametrize(
    ("name", "duration", "samples"),
    [
        ("fig03", 1.0, 101),
        ("fig04b", 1.0, 101),
        ("fig11", 1.0, 101),
        ("fig09", 10.0, 51),
        ("fig14a", 10.0, 101),
    ],
)
def test_rates_are_found_from_the_angles(name: str, duration: float, samples: int) -> None:
    """To the rounding of five angles."""
    scene = paper(name, duration=duration, samples=samples, outputs=("angles", "rates"))
    run = solve(DOP853, scene, {}).trajectory
    np.testing.assert_allclose(
        fitted_rates(scene, run.time, run.angles).rates, run.rates, rtol=0, atol=1e-10
    )
    if duration == 1.0:  # rows so near that a wrong one takes nothing from the others
        wrong = run.angles.copy()
        wrong[50, 0] += 0.1
        rates = fitted_rates(scene, run.time, wrong).rates
        np.testing.assert_allclose(
            np.delete(rates - run.rates, np.s_[44:57], axis=0), 0.0, rtol=0, atol=1e-8
        )


def test_defects_over_rows_are_those_of_every_tenth_row() -> None:
    """A wrong gravity: ten defects, each carried on, are what the closed form finds from row to
    tenth row."""
    run = solve(DOP853, replace(FIG11, gravity=1.001 * FIG11.gravity), {}).trajectory
    every = slice(None, None, 10)
    whole = defects_of(FIG11, run)
    sizes, floors = whole.over_rows(10)
    strides = interval_defects(FIG11, run.time[every], run.angles[every], run.rates[every])
    half = len(FIG11.moving_coordinates)
    raw = np.abs(np.hstack([strides.angles, strides.rates]))
    units = np.concatenate([np.ones(half), whole.rate_units])
    np.testing.assert_allclose(sizes * units, raw, rtol=2e-2, atol=1e-3 * raw.max())
    assert sizes.shape == floors.shape == (10, 2 * half)
    assert (sizes.max(axis=1) > 5.0 * whole.channel_sizes.max()).any()  # a drift adds up


def test_roundings_of_rows_in_between_and_of_their_times_cancel_in_a_sum() -> None:
    """Rows and times in single precision: ten intervals leave what the two ends do, not ten times
    as much."""
    run = fig11_run()
    time, angles, rates = (
        values.astype(np.float32).astype(float) for values in (run.time, run.angles, run.rates)
    )
    rounding = 2.0**-24 * np.abs(np.hstack([angles, rates]))
    defects = interval_defects(FIG11, time, angles, rates, rounding, 2.0**-24 * time)
    assert (defects.channel_sizes <= FLOOR_SAFETY * defects.floors).all()
    sums, floors = defects.over_rows(10)
    assert (sums <= FLOOR_SAFETY * floors).all()
    assert np.median(floors) < 2.0 * np.median(defects.floors)


@pytest.mark.parametrize("kept_rows", [1000, 0])
def test_what_is_worked_on_block_by_block_is_as_of_all_at_once(
    monkeypatch: pytest.MonkeyPatch, kept_rows: int
) -> None:
    """A run of a million samples would take gigabytes; what is left over in the last block counts,
    too. The matrices of a longer run are not kept, but computed again."""
    run = solve("lagrange/ode45", FIG11, {}).trajectory
    whole = defects_of(FIG11, run)
    monkeypatch.setattr(defects_module, "BLOCK_ROWS", 30)
    monkeypatch.setattr(solution_defects, "BLOCK_ROWS", 30)
    monkeypatch.setattr(solution_defects, "DRIFT_ROWS", 10)
    monkeypatch.setattr(solution_defects, "KEPT_ROWS", kept_rows)
    parts = defects_of(FIG11, run)
    for name in ("transitions", "floors", "growth", "error_growth"):
        np.testing.assert_allclose(
            getattr(parts, name), getattr(whole, name), rtol=1e-9, err_msg=name
        )
    for limit in np.geomspace(2.0, 1e9, 30):
        beyond = np.flatnonzero(whole.error_growth >= limit)
        assert parts.horizon_samples(limit) == (beyond[0] if len(beyond) else len(whole.time))
    np.testing.assert_allclose(parts.predicted, whole.predicted, rtol=1e-9, atol=1e-15)
    for rows in (7, 40):  # fewer and more than a block has
        np.testing.assert_allclose(parts.over_rows(rows), whole.over_rows(rows), rtol=1e-9)
    for defects in (parts, whole):
        sums, _ = defects.over_rows(10)
        assert defects.drift >= sums.max() * (1.0 - 1e-9)
    assert parts.mean == whole.mean
    assert np.array_equal(parts.excess, whole.excess)
    assert np.array_equal(parts.sizes, whole.sizes)


# ---- Rounding, units and rates of data

# Without gravity, on a shaft about which nothing but a torque turns.
INERTIA = 3.0 * AXIAL.inertia_about_apex()[1]


def balanced(table: tuple[tuple[float, float], ...] = (), **changes: Any) -> Scene:
    scene = make_scene(
        [1.0, 0, 0, 0], [4.0, 0, 0, 0], (AXIAL,) * 3, gravity=0.0, duration=8.0, **changes
    )
    return replace(scene, rotor_torque=table)


def test_a_row_is_rounded_in_its_numbers_and_in_its_time() -> None:
    """Half a unit in the last place of each, of time by the rate of change at the row: the rotor
    turns at 4 rad/s under 600 N m."""
    scene = balanced(((0.0, 600.0),))
    time = np.array([0.5, 0.75, 1.25])
    angles, rates = np.tile([1.0, 0, 0, 0], (3, 1)), np.tile([4.0, 0, 0, 0], (3, 1))
    unit = 2.0**-53
    defects = interval_defects(scene, time, angles, rates)
    assert defects.rounding[:, 0] == pytest.approx(unit * (1.0 + 4.0 * time), rel=1e-12, abs=0.0)
    at_rates = unit * (4.0 + 600.0 / INERTIA * time)
    assert defects.rounding[:, 4] == pytest.approx(at_rates, rel=1e-12, abs=0.0)
    given, of_times = np.full((3, 8), 1e-4), np.array([1e-5, 2e-5, 3e-5])
    defects = interval_defects(scene, time, angles, rates, given, of_times)
    assert defects.rounding[:, 0] == pytest.approx(1e-4 + 4.0 * of_times, rel=1e-12, abs=0.0)
    assert defects.rounding[:, 1] == pytest.approx(1e-4, rel=1e-12, abs=0.0)


def test_at_a_jump_of_a_load_the_larger_rate_of_change_counts() -> None:
    time, states = np.array([1.0, 2.0, 3.0]), np.tile([1.0, 0, 0, 0, 4.0, 0, 0, 0], (3, 1))
    scene = balanced(((1.0, 0.0), (1.0, 600.0), (2.0, 600.0), (2.0, 0.0)))
    changes = rates_of_change(scene, time, states)
    assert changes[:, 0] == pytest.approx(4.0, rel=1e-12)
    assert changes[:, 4] == pytest.approx([600.0 / INERTIA, 600.0 / INERTIA, 0.0], rel=1e-12)


@pytest.mark.parametrize(("rows", "interval"), [(2, 1e-3), (3, 1e-3), (3, 2.0)])
def test_rates_count_in_units_of_at_least_the_inverse_of_an_interval(
    rows: int, interval: float
) -> None:
    """A fixed pitch in 1 rad/s, as the moving coordinates of a rotor that turns slowly."""
    fixed = replace(AXIAL, inertia=(0.0,) * 6)
    scene = replace(balanced(), blades=(fixed, AXIAL, AXIAL))
    time = interval * np.arange(rows)
    angles, rates = np.tile([1.0, 0, 0, 0], (rows, 1)), np.tile([0.1, 0, 0, 0], (rows, 1))
    defects = interval_defects(scene, time, angles, rates)
    expected = np.maximum([1.0] * 4, 1.0 / interval)
    assert defects.rate_units == pytest.approx(expected, rel=1e-12)
    assert defects.precision == (2.0**-52 if is_available() else 2.3e-14)


def test_the_conditioning_of_an_interval_is_that_of_its_more_singular_end() -> None:
    """1/√(share of the rotor's inertia that is left): a single blade, J = A - B²/Jzz of A."""
    blade = replace(AXIAL, centre_of_mass=(0.0, 1.0, 3.0))
    scene = make_scene([0.0, 0.5], [0.0, 0.0], (blade,), hub_inertia=10.0)
    angles = np.array([[0.0, 0.5], [0.0, 0.7], [0.0, 0.9]])
    defects = interval_defects(scene, np.array([0.0, 0.1, 0.2]), angles, np.zeros((3, 2)))
    xx, yy, zz, _, xz, yz = blade.inertia_about_apex()
    shares = []
    for pitch in angles[:, 1]:
        s, c = np.sin(pitch), np.cos(pitch)
        about_shaft = 10.0 + xx * s * s + yy * c * c
        shares.append(1.0 - (xz * s + yz * c) ** 2 / (zz * about_shaft))
    assert shares == sorted(shares)  # so the first end of each interval is the more singular one
    assert defects.conditioning == pytest.approx(1.0 / np.sqrt(shares[:-1]), rel=1e-12)


def test_a_fitted_rate_changes_with_an_angle_as_its_sensitivity_says() -> None:
    run, half = fig11_run(), len(FIG11.moving_coordinates)
    rows, size = slice(0, 21), 1e-7
    time, angles = run.time[rows], run.angles[rows]
    fitted = fitted_rates(FIG11, time, angles)
    for place in range(FIT_ROWS):
        moved = angles.copy()
        moved[fitted.windows[10] + place, 0] += size
        change = fitted_rates(FIG11, time, moved).rates[10] - fitted.rates[10]
        expected = size * fitted.sensitivity[10, :, place * half]
        np.testing.assert_allclose(change[FIG11.moving_coordinates], expected, rtol=1e-3, atol=1e-9)


@pytest.mark.parametrize(("name", "samples"), [("fig11", 26), ("fig14a", 26)])
def test_rows_too_far_apart_for_a_motion_give_no_rates(name: str, samples: int) -> None:
    """0.4 s between rows of a pitch that turns several times a second."""
    scene = paper(name, duration=10.0, samples=samples, outputs=("angles", "rates"))
    run = solve(DOP853, scene, {}).trajectory
    with pytest.raises(InputError, match="the rows are too far apart for this motion"):
        fitted_rates(scene, run.time, run.angles)


def test_an_interval_over_many_jumps_of_a_torque_has_each() -> None:
    """1 s of each torque in turn, in one interval; and further intervals behind it."""
    torques = [300.0, -600.0, 900.0, 100.0, -200.0]
    table = [
        (float(second + end), torque) for second, torque in enumerate(torques) for end in (0, 1)
    ]
    scene = replace(balanced(tuple(table)), duration=5.0)
    rate, angle = 4.0, 1.0
    for torque in torques[:4]:
        angle += rate + 0.5 * torque / INERTIA
        rate += torque / INERTIA
    state = np.array([[1.0, 0, 0, 0, 4.0, 0, 0, 0], [angle, 0, 0, 0, rate, 0, 0, 0]])
    ends = interval_ends(scene, np.array([0.0, 4.0]), np.array([4.0, 5.0]), state)
    assert ends[0] == pytest.approx(state[1], rel=1e-12, abs=1e-12)
    last = rate + torques[4] / INERTIA
    assert ends[1, 4] == pytest.approx(last, rel=1e-12)
    (over_all,) = interval_ends(scene, np.zeros(1), np.array([5.0]), state[:1])
    assert over_all[4] == pytest.approx(last, rel=1e-12)


def test_a_runge_kutta_step_is_of_order_four() -> None:
    """The step of y' = -y is the series of exp(-h) up to h⁴; that of y' = 4 t³ is exact, as
    Simpson's rule is. Each interval has a step of its own."""
    time, h = np.array([0.5, 2.0]), np.array([0.25, 0.5])
    decayed = runge_kutta_step(lambda _t, y: -y, time, np.array([1.0, 3.0]), h)
    series = 1.0 - h + h**2 / 2.0 - h**3 / 6.0 + h**4 / 24.0
    assert decayed == pytest.approx([1.0, 3.0] * series, rel=1e-14)
    power = runge_kutta_step(lambda t, _y: 4.0 * t**3, time, time**4, h)
    assert power == pytest.approx((time + h) ** 4, rel=1e-14)


def test_quick_ends_are_of_order_four_under_a_load_that_grows_and_jumps() -> None:
    """Of intervals that begin and end at a jump, and are nowhere near the time zero; the values of
    the torque inside the intervals count."""
    scene = general(
        duration=6.0, rotor_torque=((3.0, 9e6), (3.0, 0.0), (4.0, 4e5), (4.0, -9e6), (6.0, -9e6))
    )
    begins, ends = np.array([3.0, 3.5]), np.array([3.5, 4.0])
    count = len(scene.moving_coordinates)
    state = np.array([*scene.initial_angles, *scene.initial_rates])
    states = np.tile(state, (2, 1))
    exact = interval_ends(scene, begins, ends, states)
    errors = []
    for steps in (64, 128):
        quick = quick_ends(scene, begins, ends, states.T, steps).T
        errors.append(np.abs(quick - exact).max(axis=1))
    assert count == 4
    assert (errors[1] < 1e-6).all()
    assert errors[0] / errors[1] == pytest.approx([16.0, 16.0], rel=0.2)


def test_explicit_steps_turn_at_most_a_quarter_of_a_radian() -> None:
    """Of the fastest rate, the pitch frequency by spring and weight, and the decay by dampers."""
    states, intervals = np.array([[0.0] * 4 + [2.0, -3.0, 0.0, np.inf]]), np.array([0.5, 1.0])

    def steps(scene: Scene, most: int = 100) -> int | None:
        return explicit_steps(scene, intervals, states, most)

    scene, inertia = balanced(), AXIAL.pitch_inertia
    assert steps(scene) == 12  # 3 rad/s over 1 s
    assert explicit_steps(scene, intervals, 0.01 * np.ones((1, 8)), 100) == 1
    sprung = replace(scene, bearing_stiffness=(0.0, inertia * 5.0**2, 0.0))
    assert steps(sprung) == 20
    offset = replace(AXIAL, centre_of_mass=(0.0, 1.0, 3.0))
    weight = offset.mass * 9.8 / offset.pitch_inertia
    heavy = replace(
        scene,
        blades=(offset,) * 3,
        gravity=9.8,
        bearing_stiffness=(offset.pitch_inertia * (7.95**2 - weight), 0.0, 0.0),
    )
    assert steps(heavy) == 32  # 7.95 rad/s by both together
    damped = replace(scene, bearing_damping=(0.0, 0.0, inertia * 10.0))
    assert steps(damped) == 40
    assert steps(damped, most=40) == 40
    assert steps(damped, most=39) is None


# ---- Transition matrices


@pytest.mark.parametrize(
    "name",
    [
        "stiff/bearing-1e8-damping-100",
        pytest.param("stiff/shaft-damping", marks=pytest.mark.full),
        pytest.param("stiff/bearing-1e12", marks=pytest.mark.full),
        "extreme/light-1e-4",
    ],
)
def test_where_explicit_steps_are_too_long_the_matrices_are_known_all_the_same(name: str) -> None:
    """They carry a small change of the state from row to row: to a share of 1e-3 of the largest
    entry."""
    scene = replace(shipped(name), outputs=("angles", "rates"))
    scene = replace(scene, duration=scene.duration / (scene.samples - 1) * 10, samples=11)
    run = solve(TAYLOR if is_available() else DOP853, scene, {}).trajectory
    defects = defects_of(scene, run)
    assert np.isfinite(defects.growth).all()
    units = np.concatenate([np.ones(len(scene.moving_coordinates)), rate_units(scene)])
    matrices = defects.transitions * units / units[:, None]
    change = 1e-5 * np.random.default_rng(39).uniform(-1.0, 1.0, matrices.shape[1]) * units
    moved = interval_ends(scene, run.time[:-1], run.time[1:], defects.states[:-1] + change)
    ends = interval_ends(scene, run.time[:-1], run.time[1:], defects.states[:-1])
    expected = (moved - ends) / units
    carried = np.einsum("kij,j->ki", matrices, change / units)
    size = np.abs(matrices).max(axis=(1, 2)) * 1e-5
    assert (np.abs(carried - expected).max(axis=1) <= 1e-3 * size).all()
