"""What is called ok, and what is not: false successes of engines, runs that nothing was compared
with, time limits."""

from __future__ import annotations

import time
from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
from support.references import reference
from support.scenes import paper, shipped

from rotor_mbs.analysis import judgement as judgement_module
from rotor_mbs.analysis.judgement import Judgement, judge
from rotor_mbs.methods.catalogue import find_method, method_names
from rotor_mbs.methods.solve import solve
from rotor_mbs.methods.time_limit import OutOfTimeError, is_over, samples_kept_at_limit, time_limit
from rotor_mbs.models.exudyn import chain, sensor_samples
from rotor_mbs.models.exudyn.loads import Loads
from rotor_mbs.models.exudyn.schemes import Scheme
from rotor_mbs.models.exudyn.solvers import MultibodySolver
from rotor_mbs.models.lagrange.heyoka_adapter import is_available
from rotor_mbs.scenario.accuracy_bounds import Bound
from rotor_mbs.scenario.scene import Blade, Scene
from rotor_mbs.solution.trajectory import Integration, Solution, Trajectory


def caught(chosen: Scene, result: Solution, exact: Trajectory | None = None) -> Judgement:
    """The engine reports success; the judgement must not."""
    assert result.integration.success
    verdict = judge(chosen, result, exact)
    assert verdict.status != "ok"
    assert verdict.false_success
    return verdict


RK44, ALPHA = "exudyn_tree/rk44", "exudyn_tree/generalized_alpha"
CLAIMS = {
    "a bearing of 1e12": (shipped("stiff/bearing-1e12"), RK44, {}),
    "an angle that is no number": (
        replace(paper("fig05"), initial_angles=(np.nan, 0.0, 0.0, 0.0)),
        RK44,
        {},
    ),
    "the singular pitch": (shipped("extreme/singular-one-blade"), RK44, {}),
    "an implicit step of ten seconds": (paper("fig11", samples=2), ALPHA, {"step": 10.0}),
    # Its error scale, absolute + relative · rate, vanishes at -1: whatever the step makes of the
    # motion is accepted.
    "dopri5 with equal tolerances at rates of minus one": (
        replace(shipped("extreme/rates-minus-one"), samples=4),
        "exudyn_tree/dopri5",
        {"absolute_tolerance": 1e-10, "relative_tolerance": 1e-10},
    ),
}


@pytest.mark.parametrize("name", CLAIMS)
def test_an_engines_claim_of_success_that_is_false(name: str) -> None:
    given, method, settings = CLAIMS[name]
    exact = reference(given.name) if name == "the singular pitch" else None
    caught(given, solve(method, given, settings), exact)


NEAR_BOUND = {"defect_max": 1.0, "defect_excess": 1.0, "defect_judged": 1.0, "defect_time": 0.5}


@pytest.mark.parametrize(
    ("numbers", "message"),
    [
        (NEAR_BOUND, "defect 1.0e+00 rad in the interval up to t = 0.5 s, allowed 2.0e-12"),
        (
            NEAR_BOUND | {"defect_excess": 30.0},
            "defect 3.0e+01 rad in the interval up to t = 0.5 s, allowed 6.0e-11 (2e-12 rad per "
            "0.01 s, times length and error growth)",
        ),
        (
            NEAR_BOUND | {"defect_excess": 1.2},
            "defect 1.2e+00 rad in the interval up to t = 0.5 s, allowed 2.4e-12 (2e-12 rad per "
            "0.01 s, times length and error growth)",
        ),
        (
            NEAR_BOUND | {"angle_error_predicted": 0.02},
            "defect 1.0e+00 rad in the interval up to t = 0.5 s, allowed 2.0e-12; predicted angle "
            "error 2.0e-02 rad up to 0.2 s",
        ),
        (
            {"angle_error_max": 0.02, "defect_max": 3e-6},
            "angle error 2.0e-02 rad up to the horizon at 0.2 s of 0.2 s; allowed 0.01 rad",
        ),
        (
            {"angle_error_max": 0.02, "defect_max": 1e-6},
            "angle error 2.0e-02 rad up to the horizon at 0.2 s of 0.2 s, because the motion "
            "amplifies small errors; allowed 0.01 rad",
        ),
        (
            {"angle_error_predicted": 0.02, "defect_max": 3e-6},
            (
                "predicted angle error 2.0e-02 rad up to the horizon at 0.2 s of 0.2 s; allowed "
                "0.01 rad"
            ),
        ),
    ],
)
def test_an_inaccurate_run_says_by_how_much(
    numbers: dict[str, float], message: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    run = solve(METHOD, paper("fig11", duration=0.2, samples=21), {})
    metrics = judge(run.scene, run, None).metrics | {
        "defect_max": 0.0,
        "defect_judged": 0.0,
        "defect_median": 0.0,
    }
    metrics = {name: value for name, value in metrics.items() if not name.startswith("angle_error")}
    monkeypatch.setattr(judgement_module, "metrics_of", lambda *_, **__: metrics | numbers)
    verdict = judge(run.scene, run, None)
    assert (verdict.status, verdict.message, verdict.advice) == ("inaccurate", message, "")


def test_a_body_that_falls_free_of_its_joints() -> None:
    """An explicit integration of the chain, set not to eliminate the constraints, drops them and
    returns True.

    One body, so that its mass matrix is regular without joints: hub and blade fall by g t²/2 and
    keep their energy.
    """
    rod = Blade(15000.0, (0.0, 0.0, 15.42), (1e5, 1e5, 0.0, 0.0, 0.0, 0.0), (0.0, 0.0, 33.38))
    chosen = paper("fig03", duration=1.0, samples=11, blades=(rod,), hub_inertia=1e3)
    loads = Loads(chosen)
    scheme = Scheme("RK44", 4, {"explicit.eliminateConstraints": False}, step=1e-3)
    parts = chain.parts(chosen, loads, "rotation_vector")
    solver = MultibodySolver(
        chosen, parts, loads, scheme, sensor_samples.chain_trajectory, rows_between=True
    )
    integration = solver.integrate()
    result = Solution(chosen, "exudyn_chain/newmark_index2", solver.observe(), integration)
    verdict = caught(chosen, result)
    assert verdict.metrics["energy_drift_max"] <= 1e-12  # it is the open joint alone that tells
    assert verdict.metrics["constraint_error_max"] == pytest.approx(0.5 * chosen.gravity, rel=1e-9)


@pytest.mark.parametrize(
    ("name", "whose", "limit_s"),
    [("extreme/singular-one-blade", "", 20.0), ("extreme/rate-1e200", "lagrange/", 1.0)],
)
def test_nobody_gets_through_a_singularity_or_an_overflow(
    name: str, whose: str, limit_s: float
) -> None:
    """One blade without hub inertia, or rates whose squares overflow: whatever a method makes of
    it, it is not ok; the implicit ones step over it. Nothing is written to the terminal: warnings
    are errors here."""
    chosen = shipped(name)
    exact = reference(name) if "singular" in name else None
    assert exact is None or len(exact.time) < chosen.samples
    methods = [method for method in method_names(is_corrected=True) if method.startswith(whose)]
    for method in methods:
        # that one does not end: below
        if method != "exudyn_tree/dopri5" and find_method(method).is_installed:
            result = solve(method, chosen, {}, time_limit_s=limit_s)
            assert judge(chosen, result, exact).status not in ("ok", "inaccurate"), method


def test_a_run_that_hangs_is_ended_with_what_it_reached() -> None:
    """DOPRI5 at the singular pitch repeats its smallest step for ever, if nobody counts."""
    chosen = shipped("extreme/singular-one-blade")
    result = solve("exudyn_tree/dopri5", chosen, {"trial_steps": 10**9}, time_limit_s=1.0)
    assert result.integration.out_of_time
    verdict = judge(chosen, result, reference(chosen.name))
    assert verdict.status == "timed_out"
    assert 1 < len(result.trajectory.time) < chosen.samples


@pytest.mark.parametrize(
    "method",
    [
        "lagrange/taylor",
        "lagrange/dop853",
        "exudyn_tree/rk67",
        "exudyn_chain/extrapolated",
        "mujoco/rk4",
    ],
)
def test_a_long_run_keeps_its_samples_when_ended(method: str) -> None:
    if not find_method(method).is_installed:
        pytest.skip(f"{method} is not installed")
    chosen, built = (
        replace(shipped("extreme/pendulum-million"), duration=5e5, samples=200_001),
        find_method(method),
    )
    solver = built.build(chosen, built.settings())
    with time_limit(0.3):
        integration = solver.integrate()
    assert integration.out_of_time
    assert not integration.success
    trajectory = solver.observe()
    assert 1 < len(trajectory.time) < chosen.samples
    assert np.isfinite(trajectory.angles).all()


def test_the_limit_reaches_plain_python() -> None:
    with pytest.raises(OutOfTimeError), time_limit(0.05):
        time.sleep(5.0)


def test_a_run_that_was_ended_is_not_repeated() -> None:
    """Short runs are repeated: the second would not be stopped, and its status would be that of a
    run without limit."""
    ended = Integration(False, "ended", out_of_time=True)
    solver = SimpleNamespace(integrate=lambda: ended, observe=lambda: reference("paper/fig05"))
    method = replace(find_method("lagrange/taylor"), build=lambda *_: solver)
    result = solve(method, shipped("paper/fig05"), {}, repeats=5)
    assert result.integration.out_of_time
    assert len(result.run_times_s) == 1


def test_who_knows_that_time_is_up_is_not_interrupted_and_the_next_run_starts_afresh() -> None:
    """The signal may come a moment after the clock was read: samples on their way out must not be
    lost to it."""
    with time_limit(0.05):
        with samples_kept_at_limit():
            while not is_over():
                pass
        time.sleep(0.1)  # here the signal arrives, outside `samples_kept_at_limit`
    assert not is_over()


METHOD = "lagrange/dop853"


def turned(scene: Scene, turns: float) -> Scene:
    """The same motion: the rotor starts whole turns further on."""
    return scene.replace(**{"initial.angles[0]": scene.initial_angles[0] + 2.0 * np.pi * turns})


@pytest.mark.parametrize(
    ("outputs", "status"),
    [(("angles",), "unchecked"), (("rates",), "unchecked"), (("angles", "rates"), "inaccurate")],
)
def test_a_wrong_motion_is_unchecked_where_nothing_can_tell(
    outputs: tuple[str, ...], status: str
) -> None:
    """A motion of 1e-3 rad in place of a fall: angles and rates together have defects."""
    scene = paper("fig08", duration=1.0, samples=11, outputs=outputs)
    time = np.linspace(0.0, 1.0, 11)
    angles = scene.initial_angles + np.full((11, 4), 1e-3) * np.sin(time)[:, None]
    run = Solution(scene, METHOD, Trajectory(time, angles, np.zeros((11, 4))), Integration(True))
    verdict = judge(scene, run, None)
    assert verdict.status == status
    assert ("without energies" in verdict.message) == (status == "unchecked")
    assert ("defect_allowed" in verdict.metrics) == (status == "inaccurate")
    if "angles" in outputs:
        exact = Trajectory(time, angles + 0.1, np.zeros((11, 4)), error_growth=np.ones(11))
        assert judge(scene, run, exact).status == "inaccurate"


@pytest.mark.parametrize("turns", [0, 1e5])
def test_a_start_turns_away_excuses_no_error(turns: float) -> None:
    """Errors are relative to how far the rotor turns and to the pitches, not to where the rotor's
    angle starts."""
    if turns and not is_available():
        pytest.skip("the rounding of such an angle keeps DOP853 at its tightest from going on")
    scene = turned(paper("fig11", duration=2.0, samples=21, outputs=("angles", "rates")), turns)
    exact = solve("reference", scene, {}).trajectory
    for column in (0, 2):
        angles = exact.angles.copy()
        angles[5:, column] += 1e-5
        wrong = Solution(scene, METHOD, exact.replace(angles=angles), Integration(True))
        assert judge(scene, wrong, exact).status == "inaccurate"
    best = solve("lagrange/taylor" if is_available() else "lagrange/dop853", scene, {})
    assert judge(scene, best, exact).status == "ok"


@pytest.mark.parametrize("share", [0.9, 1.1])
def test_a_start_turns_away_leaves_ten_units_in_its_last_place_open(
    share: float, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Of what is beyond the first turn: the one thing that a method whose own bounds are zero may
    be off by."""
    scene = turned(paper("fig05", duration=1.0, samples=11), 2.0)
    slack = share * 10.0 * np.finfo(float).eps * (scene.initial_angles[0] - 2.0 * np.pi)
    exact = Trajectory(
        np.linspace(0.0, 1.0, 11), np.tile(scene.initial_angles, (11, 1)), np.zeros((11, 4))
    )
    weights = sum(
        blade.mass * scene.gravity * np.hypot(*blade.centre_of_mass[::2]) for blade in scene.blades
    )
    potential = np.zeros(11)
    potential[5] = slack * weights
    wrong = exact.replace(
        kinetic_energy=np.zeros(11), potential_energy=potential, work=np.zeros(11)
    )
    method = replace(find_method(METHOD), bounds=(Bound("energy", METHOD, 0.0, "none"),))
    monkeypatch.setattr(judgement_module, "find_method_or_none", lambda _: method)
    run = Solution(scene, METHOD, wrong, Integration(True))
    assert judge(scene, run, exact).status == ("ok" if share < 1.0 else "inaccurate")


@pytest.mark.parametrize(
    ("success", "reported", "expected"),
    [
        (True, "", ("after t = 0.4 s of 1 s", "the engine reported success")),
        (False, "", ("at t = 0.4 s of 1 s", "no reason given")),
        (False, "step too small", ("at t = 0.4 s of 1 s", "step too small")),
    ],
)
def test_a_run_that_broke_off_names_time_and_reason(
    success: bool, reported: str, expected: tuple[str, ...]
) -> None:
    scene = paper("fig05", duration=1.0, samples=11)
    motion = Trajectory(
        np.linspace(0.0, 0.4, 5), np.tile(scene.initial_angles, (5, 1)), np.zeros((5, 4))
    )
    message = judge(
        scene, Solution(scene, METHOD, motion, Integration(success, reported)), None
    ).message
    assert all(text in message for text in expected), message
