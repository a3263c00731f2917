"""The status rules on constructed runs whose status is known: each rule from both sides of its
limit."""

from __future__ import annotations

import itertools
import math
from collections.abc import Iterator
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from support.defects import made_defects
from support.random_scenes import leaning_scene

from rotor_mbs.analysis import judgement as judgement_module
from rotor_mbs.analysis import kinematics, run_checks
from rotor_mbs.analysis.judgement import OK_ERROR, clearly_ok, judge
from rotor_mbs.methods.catalogue import find_method, method_names
from rotor_mbs.models.lagrange.singularity import rotor_inertia_shares
from rotor_mbs.scenario.accuracy_bounds import Bound, shipped_bounds
from rotor_mbs.scenario.catalogue import find_scenes
from rotor_mbs.scenario.scene import Blade, Scene
from rotor_mbs.solution.metrics import ANGLE_LIMIT, defect_metrics, metrics_of, running_growth
from rotor_mbs.solution.trajectory import Integration, Solution, Trajectory

Array = Any
DONE, FAILED = Integration(True), Integration(False, "gave up")
OUT_OF_TIME = Integration(False, "ended", 0.5, out_of_time=True)
METHOD, PRINTED = "lagrange/taylor", "printed/ode45"
BOUNDS = shipped_bounds()
LONG = Blade(1000.0, (0.1, 0.0, 10.0), (0.0,) * 6, (0.1, 0.0, 20.0))
SHORT = Blade(1000.0, (0.1, 0.0, 5.0), (0.0,) * 6, (0.1, 0.0, 20.0))
SCENE = Scene(
    "rules",
    "three point masses in uniform rotation",
    (),
    0.5,
    1.0,
    11,
    ("angles", "rates", "energy"),
    (SHORT, LONG, LONG),
    0.0,
    (0.0, 0.5, 0.0, 0.0),
    (0.5, 0.0, 0.0, 0.0),
    bearing_stiffness=(2e4, 0.0, 0.0),
    bearing_rest=(((0.0, -0.5),), (), ()),
)
WORK_J = 3000.0
KINETIC_J = 0.5 * 1000.0 * (3 * 0.1**2 + 2 * 10.0**2 + 5.0**2) * 0.5**2
# What an energy error is relative to: kinetic energy, work, the spring's, the weights'.
ENERGY_J = (
    KINETIC_J
    + WORK_J
    + 0.5 * 2e4 * 1.0**2
    + 1000.0 * 0.5 * (2.0 * math.hypot(0.1, 10.0) + math.hypot(0.1, 5.0))
)
JUST = 1e-2  # how far on either side of a bound, relatively: far above round-off of a state
SIDES = ((1.0 - JUST, "ok"), (1.0 + JUST, "inaccurate"))
QUARTER = 0.5 * math.pi


@pytest.fixture(autouse=True)
def _without_defects(monkeypatch: pytest.MonkeyPatch) -> None:
    """The motions made here are none that the scene could have: what is tested are the other
    rules."""
    monkeypatch.setattr(judgement_module, "defects_of", lambda *_, **__: None)
    for name in ("_checks_of_rows", "_checks_of_outputs"):
        monkeypatch.setattr(run_checks, name, lambda *_: iter(()))
    monkeypatch.setattr(kinematics, "exact_rotor_angle", lambda *_: None)


def status(
    run: Trajectory,
    engine: Integration = DONE,
    reference: Trajectory | None = None,
    method: str = METHOD,
) -> Any:
    """(status, whether the engine's claim of success is false)."""
    solution = Solution(SCENE, method, run, engine)
    with np.errstate(all="ignore"):
        judgement = judge(SCENE, solution, reference)
    return judgement.status, judgement.false_success


def moving(pitch: float = 0.0, growth: float | None = None) -> Trajectory:
    """Uniform rotation, every pitch at `pitch` rad; energies that change into each other without
    loss.

    growth   of errors: one until sample 3, then this
    """
    time = np.linspace(0.0, 1.0, 11)
    angles, rates = np.full((11, 4), pitch), np.zeros((11, 4))
    angles[:, 0], rates[:, 0] = 0.5 * time, 0.5
    work = WORK_J * time
    energies = {
        "kinetic_energy": KINETIC_J + 3.0 * work,
        "potential_energy": 7.0 - 2.0 * work,
        "work": work,
    }
    trajectory = Trajectory(time, angles, rates, **energies)
    if growth is not None:
        trajectory.quantities["error_growth"] = np.where(np.arange(11) < 4, 1.0, growth)
    return trajectory


def cut(run: Trajectory, rows: int) -> Trajectory:
    parts = ("time", "angles", "rates", "kinetic_energy", "potential_energy", "work")
    return Trajectory(**{part: getattr(run, part)[:rows] for part in parts})


def with_drift(run: Trajectory, share: float) -> Trajectory:
    """An energy error of `share` of the scale in the middle of the run."""
    energy = run.kinetic_energy.copy()
    energy[5] += share * ENERGY_J
    return run.replace(kinetic_energy=energy)


def with_error(run: Trajectory, error: float, row: int = 5, column: int = 0) -> Trajectory:
    angles = run.angles.copy()
    angles[row, column] += error
    return run.replace(angles=angles)


def with_gap(run: Trajectory, share: float) -> Trajectory:
    """Joints that open by `share` of the longest arm."""
    return run.replace(constraint_error=np.full(11, share * math.hypot(0.1, 10.0)))


def without_energies(run: Trajectory) -> Trajectory:
    return run.replace(kinetic_energy=None, potential_energy=None, work=None)


@pytest.mark.parametrize("method", method_names(is_corrected=True))
def test_energy_angles_and_gap_have_a_bound_each(method: str) -> None:
    exact = moving()
    energy = BOUNDS.of("energy", method).value
    for side, expected in (*SIDES, (math.nan, "inaccurate")):
        assert status(with_drift(exact, side * energy), method=method)[0] == expected
        assert (
            status(with_error(exact, side * OK_ERROR), reference=exact, method=method)[0]
            == expected
        )
        if BOUNDS.find("gap", method):
            gap = side * BOUNDS.of("gap", method).value
            assert status(with_gap(exact, gap), method=method)[0] == expected
    if not BOUNDS.find("gap", method):
        assert status(with_gap(exact, 1e-16), method=method)[0] == "inaccurate"


def test_the_bound_of_the_energy_grows_with_the_rows_as_that_of_defects(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """An interval of 0.04 s may change the energy as much as four of 0.01 s do; at most by 0.01."""
    method = "exudyn_tree/rk67"
    bound = BOUNDS.of("energy", method).value
    for factor, share in ((1.0, 1.0), (4.0, 4.0), (1e300, OK_ERROR / bound)):
        defects = made_defects((0.0, 0.0))
        # A cached property is what its instance's dictionary says.
        defects.__dict__["bound_factors"] = np.full(2, factor)
        monkeypatch.setattr(
            judgement_module, "defects_of", lambda *_, defects=defects, **__: defects
        )
        for side, expected in SIDES:
            drifting = with_drift(moving(), side * share * bound)
            assert status(drifting, method=method)[0] == expected


@pytest.mark.parametrize("method", method_names(is_corrected=True))
def test_the_largest_defect_has_a_bound(method: str, monkeypatch: pytest.MonkeyPatch) -> None:
    bound = min(BOUNDS.of("defect", method).value, OK_ERROR)
    for side, expected in (*SIDES, (math.nan, "inaccurate")):
        # The second undoes the first: they add up to no more than one.
        defects = made_defects((side * bound, -side * bound))
        monkeypatch.setattr(
            judgement_module, "defects_of", lambda *_, defects=defects, **__: defects
        )
        assert status(moving(), method=method)[0] == expected


def test_the_median_of_the_defects_has_the_bound_of_a_methods_own(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """A tenth of that of the largest defect; without defects nothing is asked."""
    own = Bound("defect median", METHOD, 0.1 * BOUNDS.of("defect", METHOD).value, "none")
    monkeypatch.setattr(
        judgement_module,
        "find_method_or_none",
        lambda _: replace(find_method(METHOD), bounds=(own,)),
    )
    run = Solution(SCENE, METHOD, moving(), DONE)
    assert judge(SCENE, run, None).status == "ok"
    for side, expected in SIDES:
        defects = made_defects([side * own.value] * 3)
        monkeypatch.setattr(
            judgement_module, "defects_of", lambda *_, defects=defects, **__: defects
        )
        assert judge(SCENE, run, None).status == expected


@pytest.mark.parametrize(("side", "expected"), [(1.0 - JUST, "ok"), (1.0 + JUST, "unchecked")])
@pytest.mark.parametrize("cause", ["rounding", "a defect that is allowed"])
def test_a_defect_of_a_hundredth_of_a_radian_is_never_within_an_ok(
    cause: str, side: float, expected: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Rounding alone may be as large, or rows are so far apart, or errors grow so much, that a
    bound allows as much."""
    size = side * OK_ERROR
    if cause == "rounding":
        rounding = np.zeros((3, 2))
        rounding[0, 0] = size / 3.0
        defects = made_defects((0.0, 0.0), rounding=rounding)
    else:  # the second interval undoes the first
        defects = made_defects((size, -size), time=1e12 * np.arange(3.0))
    monkeypatch.setattr(judgement_module, "defects_of", lambda *_, **__: defects)
    judgement = judge(SCENE, Solution(SCENE, METHOD, moving(), DONE), None)
    if cause == "rounding" or side < 1.0:
        assert judgement.status == expected
    else:  # the energy decides nothing of a sum that is predicted
        assert judgement.status == "inaccurate"
        assert "predicted" in judgement.message
        metrics = dict(judgement.metrics) | {"angle_error_predicted": 0.0}
        monkeypatch.setattr(judgement_module, "metrics_of", lambda *_, **__: metrics)
        judgement = judge(SCENE, Solution(SCENE, METHOD, moving(), DONE), None)
        assert judgement.status == expected
    if expected == "unchecked":
        assert "would not be seen; set a larger number of `samples`" in judgement.message
    metrics = (
        {"energy_drift_max": 0.0} | defect_metrics(defects, None) | {"angle_error_predicted": 0.0}
    )
    (is_ok,) = clearly_ok([SCENE], METHOD, [DONE], [SCENE.samples], [metrics], np.ones(1))
    assert is_ok == (expected == "ok")


@pytest.mark.parametrize(
    ("engine", "samples", "expected"),
    [
        (DONE, SCENE.samples, True),
        (DONE, SCENE.samples - 1, False),
        (FAILED, SCENE.samples, False),
    ],
)
def test_a_run_that_failed_or_is_not_complete_is_not_clearly_ok(
    engine: Integration, samples: int, expected: bool
) -> None:
    metrics = {"energy_drift_max": 0.0}
    (is_ok,) = clearly_ok([SCENE], METHOD, [engine], [samples], [metrics], np.ones(1))
    assert is_ok == expected


def test_singular_starts_of_several_rotors_are_not_clearly_ok() -> None:
    """Point masses without a hub are singular at pitches of π/2, and with a hub they are not."""
    quarter = 0.5 * math.pi
    singular = SCENE.replace(**{"initial.angles": [0.0, quarter, quarter, quarter]})
    scenes = [SCENE, singular, singular.replace(**{"hub.inertia": 1e5}), SCENE, singular]
    metrics = [{"energy_drift_max": 0.0}] * 5
    engines, samples = [DONE] * 5, [SCENE.samples] * 5
    found = clearly_ok(scenes, METHOD, engines, samples, metrics, np.ones(5))
    assert list(found) == [True, False, True, True, False]


def test_a_bound_of_more_than_a_hundredth_of_a_radian_counts_as_that(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    own = Bound("defect", METHOD, 1.0, "none")
    monkeypatch.setattr(
        judgement_module,
        "find_method_or_none",
        lambda _: replace(find_method(METHOD), bounds=(own,)),
    )
    for side, expected in SIDES:
        defects = made_defects((side * OK_ERROR, -side * OK_ERROR))
        monkeypatch.setattr(
            judgement_module, "defects_of", lambda *_, defects=defects, **__: defects
        )
        judgement = judge(SCENE, Solution(SCENE, METHOD, moving(), DONE), None)
        assert judgement.status == expected
        assert judgement.metrics["defect_allowed"] == pytest.approx(OK_ERROR)


NOTHING = Trajectory(np.empty(0), np.empty((0, 4)), np.empty((0, 4)))
# of the rotor's inertia left
NEAR, FAR = (moving(math.acos(math.sqrt(share))) for share in (0.8e-3, 1.2e-3))
PAST = moving(growth=2e5)  # the horizon is sample 3
# the start alone is before its horizon
AT_ONCE = PAST.replace(error_growth=np.where(np.arange(11) < 1, 1.0, 2e5))
DESIGN_COLUMNS = {
    "complete": (moving(), DONE, None, "ok", False),
    "nothing to judge it by": (without_energies(moving()), DONE, None, "unchecked", False),
    "judged by its angles alone": (without_energies(moving()), DONE, moving(), "ok", False),
    "without energies, past the horizon at once": (
        without_energies(moving()),
        DONE,
        AT_ONCE,
        "unchecked",
        False,
    ),
    "complete, a failure": (moving(), FAILED, None, "solver_failed", False),
    "a sample short, success": (cut(moving(), 10), DONE, None, "diverged", True),
    "a sample short, a failure": (cut(moving(), 10), FAILED, None, "solver_failed", False),
    "out of time": (cut(moving(), 5), OUT_OF_TIME, None, "timed_out", False),
    "no sample, success": (NOTHING, DONE, None, "diverged", True),
    "no sample, a failure": (NOTHING, FAILED, None, "solver_failed", False),
    "broken off near the singularity": (cut(NEAR, 5), FAILED, None, "singular", False),
    "broken off away from it": (cut(FAR, 5), FAILED, None, "solver_failed", False),
    "singular start": (moving(QUARTER), DONE, None, "singular", True),
    # Four and five doubles below π/2: shares of 9.0e-31 and 1.4e-30.
    "last singular start": (moving(QUARTER - 4 * math.ulp(1.0)), DONE, None, "singular", True),
    "first regular start": (moving(QUARTER - 5 * math.ulp(1.0)), DONE, None, "ok", False),
    "past the end of the motion": (moving(), DONE, cut(NEAR, 5), "singular", True),
    "past the end of a motion that ends at its start": (
        moving(),
        DONE,
        cut(NEAR, 1),
        "singular",
        True,
    ),
    "past the end of a reference that merely stops": (FAR, DONE, cut(FAR, 5), "ok", False),
    # A hundredth of the scale, or a radian, parts a coarse run from one that is another motion.
    "coarse by its energy": (
        with_drift(moving(), (1.0 - JUST) * 1e-2),
        DONE,
        None,
        "inaccurate",
        False,
    ),
    "another motion by its energy": (
        with_drift(moving(), (1.0 + JUST) * 1e-2),
        DONE,
        None,
        "inaccurate",
        True,
    ),
    "coarse by its angles": (with_error(moving(), 1.0 - JUST), DONE, moving(), "inaccurate", False),
    "coarse by its gap": (with_gap(moving(), (1.0 - JUST) * 1e-2), DONE, None, "inaccurate", False),
    "another motion by its gap": (
        with_gap(moving(), (1.0 + JUST) * 1e-2),
        DONE,
        None,
        "inaccurate",
        True,
    ),
    "another motion by its angles": (
        with_error(moving(), 1.0 + JUST),
        DONE,
        moving(),
        "inaccurate",
        True,
    ),
}


@pytest.mark.parametrize("name", DESIGN_COLUMNS)
def test_a_known_run_is_called_what_it_is(name: str) -> None:
    run, engine, reference, *expected = DESIGN_COLUMNS[name]
    assert status(run, engine, reference) == tuple(expected)


@pytest.mark.parametrize(("side", "expected"), [(1.0 - JUST, "ok"), (1.0 + JUST, "unchecked")])
def test_an_angle_beyond_the_limit_has_no_digits(side: float, expected: str) -> None:
    far = moving()
    far.angles[5, 0] = -side * ANGLE_LIMIT
    assert status(far)[0] == expected


@pytest.mark.parametrize(("beyond", "expected"), [(0.001, "singular"), (-0.001, "solver_failed")])
def test_a_run_that_would_have_been_singular_within_a_sample_is(
    beyond: float, expected: str
) -> None:
    on_the_way = cut(moving(math.acos(math.sqrt(1e-3)) - 0.1 + beyond), 5)
    on_the_way.rates[-1, 1:] = 1.0
    assert status(on_the_way, FAILED)[0] == expected


def passing(quarter: float, step: float, others: float | None = None) -> Trajectory:
    """Pitches past quarter·π in the middle between samples 5 and 6, the fastest `step` rad at once;
    `others` stay.

    At different rates: they are at quarter·π together at that instant alone.
    """
    run = moving()
    way = np.where(np.arange(11) <= 5, -0.5, 0.5) * step
    run.angles[:, 1:] = quarter * math.pi + way[:, None] * [1.0, 0.8, 0.6]
    if others is not None:
        run.angles[:, 2:] = others
    return run


def one_by_one() -> Trajectory:
    """Two pitches through π/2 between the same two samples, at different instants; the third stays
    there."""
    run = moving(QUARTER)
    late = np.where(np.arange(11) <= 5, -1.0, 0.0)
    run.angles[:, 1] = QUARTER + late + 0.2
    run.angles[:, 2] = QUARTER + late + 0.8
    return run


@pytest.mark.parametrize(
    ("run", "drift", "expected"),
    [
        (one_by_one(), 2.0, "inaccurate"),
        *((passing(sign * 0.5, 1.5), 1e3, "ok") for sign in (1.0, -1.0)),
        (passing(0.5, 0.7, others=QUARTER), 1e3, "ok"),  # a pitch that passes where the others stay
        *((passing(sign * 0.5, 0.1, others=0.5), 2.0, "inaccurate") for sign in (1.0, -1.0)),
        *((passing(sign * 0.5, 1.65), 2.0, "inaccurate") for sign in (1.0, -1.0)),  # in leaps
    ],
)
def test_energy_is_lost_where_all_pitches_pass_a_quarter_turn_together(
    run: Trajectory, drift: float, expected: str
) -> None:
    assert status(with_drift(run, drift * BOUNDS.of("energy", METHOD).value))[0] == expected


@pytest.mark.parametrize(("side", "expected"), SIDES)
def test_near_a_quarter_turn_the_energy_magnifies_round_off(side: float, expected: str) -> None:
    """1e-14 of it, by √(1e-3/share): 1e5-fold, 1e-9 more than without."""
    drift = BOUNDS.of("energy", METHOD).value + side * (1e5 - 1.0) * 1e-14
    assert status(with_drift(moving(math.acos(math.sqrt(1e-13))), drift))[0] == expected


def test_what_defects_add_up_to_is_the_error_where_there_is_no_reference(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """Ten of a tenth of what is called ok, each within the bound of newmark_index2."""
    for side, expected in SIDES:
        defects = made_defects([side * 0.1 * OK_ERROR] * 10)
        monkeypatch.setattr(
            judgement_module, "defects_of", lambda *_, defects=defects, **__: defects
        )
        assert status(moving(), method="exudyn_chain/newmark_index2")[0] == expected
        assert status(moving(), reference=moving(), method="exudyn_chain/newmark_index2")[0] == "ok"


def test_the_growth_so_far_is_at_least_one() -> None:
    damped = moving().replace(error_growth=np.array([0.2, 0.1, 3.0, 2.0]))
    assert running_growth(damped).tolist() == [1.0, 1.0, 3.0, 3.0]


def test_past_the_horizon_no_error_counts(monkeypatch: pytest.MonkeyPatch) -> None:
    """Though no pitch at rest leaves zero."""
    monkeypatch.setattr(judgement_module, "defects_of", lambda *_, **__: made_defects([0.0] * 10))
    for growth, expected in ((0.9e5, "inaccurate"), (1.1e5, "ok")):
        exact = moving(growth=growth)
        assert status(with_error(exact, 0.1, 8), reference=exact)[0] == expected


def test_a_method_that_keeps_zeros_is_advised_where_a_pitch_left_zero(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """Where that is the error, and nowhere else."""
    resting = made_defects([0.0] * 10, resting=(1,))
    monkeypatch.setattr(judgement_module, "defects_of", lambda *_, **__: resting)
    exact = moving()
    for run, message, advice in (
        (with_error(exact, 0.1, 8, 1), "pitch 1 leaves zero at t = 0.8 s", "lagrange/*"),
        (with_error(exact, 0.1, 8, 0), "angle error 1.0e-01 rad", ""),
        (with_drift(with_error(exact, 0.1, 8, 1), 1.0), "energy drift", ""),
    ):
        judgement = judge(SCENE, Solution(SCENE, METHOD, run, DONE), exact)
        assert judgement.status == "inaccurate"
        assert judgement.message.startswith(message)
        assert (advice in judgement.advice) if advice else (judgement.advice == "")


def test_of_intervals_that_are_not_judged_that_of_the_largest_growth_is_named(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """Errors grow more in the first interval, which is judged."""
    rounding = np.zeros((4, 2))
    rounding[2, 0] = OK_ERROR  # of the row that ends the second interval and begins the third
    growth = np.array([5.0, 2.0, 3.0])
    defects = made_defects(
        [0.0] * 3,
        time=np.array([0.0, 1.0, 3.0, 7.0]),
        rounding=rounding,
        transitions=growth[:, None, None] * np.eye(2),
    )
    monkeypatch.setattr(judgement_module, "defects_of", lambda *_, **__: defects)
    judgement = judge(SCENE, Solution(SCENE, METHOD, moving(), DONE), None)
    assert judgement.status == "unchecked"
    assert judgement.message.startswith(
        "rows 4 s apart, between which errors grow 3.0e+00-fold: in 2 intervals a defect"
    )


@pytest.mark.parametrize("side", [1.0 - JUST, 1.0 + JUST])
def test_an_error_of_loads_is_a_share_of_the_largest(
    side: float, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Above its bound it is inaccurate, above a hundredth it is another motion."""
    scene = replace(SCENE, outputs=(*SCENE.outputs, "loads"))
    for limit in (BOUNDS.of("loads", METHOD).value, 1e-2):
        metrics = {"energy_drift_max": 0.0, "blade_root_force_error": side * limit}
        monkeypatch.setattr(judgement_module, "metrics_of", lambda *_, m=metrics, **__: dict(m))
        judgement = judge(scene, Solution(scene, METHOD, moving(), DONE), None)
        assert (judgement.status == "ok") == (side < 1.0 and limit < 1e-2)
        assert judgement.false_success == (side > 1.0 and limit == 1e-2)


def test_the_printed_equations_must_reach_the_end_no_more() -> None:
    exact = moving()
    assert status(with_drift(with_error(exact, 1.0), 1.0), reference=exact, method=PRINTED) == (
        "completed",
        False,
    )
    assert status(cut(exact, 5), FAILED, method=PRINTED)[0] == "solver_failed"
    assert status(exact, reference=cut(moving(1.5707), 5), method=PRINTED) == ("completed", False)


def test_metrics_of_a_run_that_is_off_by_known_amounts() -> None:
    exact = PAST.replace(tip=np.zeros((11, 3, 3)))
    wrong = with_error(with_error(moving(), 0.1, 2), 0.3, 10).replace(tip=np.zeros((11, 3, 3)))
    wrong.tip[1, 2] = (3.0, 0.0, 4.0)
    wrong.tip[8, 1] = (30.0, 0.0, 40.0)
    whole = metrics_of(SCENE, wrong, exact)
    expected = {
        "horizon_s": 0.3,
        "angle_error_max": 0.1,
        "angle_error_whole": 0.3,
        "angle_error_end": 0.3,
        "tip_error_max": 5.0,
    }
    assert {name: whole[name] for name in expected} == pytest.approx(expected, rel=1e-12)


ERRORS = {"angle_error_max", "tip_error_max"}


@pytest.mark.parametrize(
    ("rows", "reference", "names"),
    [
        (2, PAST, ERRORS | {"angle_error_whole"}),
        (11, cut(PAST, 5), ERRORS - {"tip_error_max"} | {"angle_error_whole"}),
        (1, PAST, set()),
        (11, AT_ONCE, {"angle_error_whole", "angle_error_end"}),
    ],
    ids=["stopped early", "past its reference", "stopped at the start", "past the horizon at once"],
)
def test_errors_are_stored_as_far_as_they_are_known(
    rows: int, reference: Trajectory, names: set[str]
) -> None:
    tips = np.zeros((11, 3, 3))
    run = cut(moving(), rows).replace(tip=tips[:rows])
    reference = reference if len(reference.time) < 11 else reference.replace(tip=tips)
    given = metrics_of(SCENE, run, reference).keys() & (
        ERRORS | {"angle_error_whole", "angle_error_end"}
    )
    assert given == names


@pytest.mark.parametrize(
    "scene", [*find_scenes(["check"]), leaning_scene(1)], ids=lambda scene: scene.name
)
def test_the_rotors_share_of_inertia_is_that_of_its_mass_matrix(scene: Scene) -> None:
    """At random angles; T is ½ q̇·M q̇, so that M follows by polarisation from the kinetic
    energy."""
    count = 1 + len(scene.blades)

    def shares() -> Iterator[tuple[float, float]]:
        for angles in np.random.default_rng(2020).uniform(-math.pi, math.pi, (5, 1, count)):
            mass = np.zeros((count, count))
            for i, j in itertools.product(range(count), repeat=2):
                rates = [np.eye(count)[i] + sign * np.eye(count)[j] for sign in (1.0, -1.0)]
                plus, minus = (
                    kinematics.kinetic_energy(scene, angles, rate[None])[0] for rate in rates
                )
                mass[i, j] = 0.5 * (plus - minus)
            free = scene.moving_coordinates[1:]
            eliminated = sum(mass[0, i] ** 2 / mass[i, i] for i in free) / mass[0, 0]
            yield float(rotor_inertia_shares(scene, angles)[0]), 1.0 - eliminated

    for own, expected in shares():
        assert own == pytest.approx(expected, abs=1e-12)
