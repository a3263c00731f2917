"""Integrators over the segments of the loads: what is counted, where a run ends, the unit that its
work counts in."""

from __future__ import annotations

import math
from dataclasses import replace
from fractions import Fraction
from typing import Any

import numpy as np
import pytest
from scipy.integrate import solve_ivp
from support.scenes import ARM, MASS, OFFSET, paper

from rotor_mbs.methods.catalogue import find_method
from rotor_mbs.methods.solve import solve
from rotor_mbs.models.lagrange import ode_solvers
from rotor_mbs.models.lagrange.closed_form import load_values
from rotor_mbs.models.lagrange.heyoka_adapter import array_of
from rotor_mbs.models.lagrange.ode_solvers import (
    OdeSolver,
    ode45_integrator,
    scipy_integrator,
    work_unit,
)
from rotor_mbs.models.lagrange.samples import at_constant_rests
from rotor_mbs.models.lagrange.taylor import Propagation


@pytest.mark.parametrize("method", ["lagrange/dop853", "lagrange/taylor"])
def test_a_run_counts_all_its_segments_and_ends_in_the_one_that_fails(method: str) -> None:
    """One more of 0.1 s after a second; a blade that runs into its singularity in the second of
    three."""
    if not find_method(method).is_installed:
        pytest.skip(f"{method} is not installed")
    one = paper(
        "fig03", duration=1.0, samples=11, rotor_torque=((0.0, 0.0), (1.0, 10.0), (2.0, 0.0))
    )
    reports = [
        solve(method, scene, {}).integration
        for scene in (one, replace(one, duration=1.1, samples=12))
    ]
    assert [report.time_reached for report in reports] == [1.0, 1.1]
    end = solve(method, one, {})
    rest = replace(
        one, duration=0.1, samples=2, rotor_torque=((0.0, 10.0), (1.0, 0.0)),
        initial_angles=tuple(end.angles[-1].tolist()), initial_rates=tuple(end.rates[-1].tolist()),
    )  # fmt: skip
    reports.append(solve(method, rest, {}).integration)
    assert all(isinstance(report.steps, int) for report in reports)
    assert reports[1].steps == reports[0].steps + reports[2].steps
    if reports[0].rhs_evaluations is not None:
        assert isinstance(reports[0].rhs_evaluations, int)
        assert reports[1].rhs_evaluations == reports[0].rhs_evaluations + reports[2].rhs_evaluations
    failing = replace(
        one,
        gravity=0.0,
        initial_angles=(1.0, 1.2),
        initial_rates=(0.0, 1.0),
        duration=3.0,
        samples=301,
    )
    failed = solve(
        method, replace(failing, rotor_torque=((0.0, 0.0), (0.05, 10.0), (2.0, 0.0))), {}
    ).integration
    assert not failed.success
    assert failed.message
    assert not failed.out_of_time
    assert 0.05 < failed.time_reached < 2.0


INTEGRATORS = {
    "DOP853": scipy_integrator("DOP853", 1e-9, 1e-12),
    "Radau": scipy_integrator("Radau", 1e-6, 1e-9),
    "ode45": ode45_integrator(1e-9, 1e-12),
}


@pytest.mark.parametrize("name", INTEGRATORS)
def test_every_evaluation_is_counted(name: str) -> None:
    calls = []

    def decay(time: float, state: Any) -> list[float]:
        calls.append(time)
        return [-state[0]]

    result = INTEGRATORS[name](decay, 1.0, 3.0, np.ones(1), np.array([1.5, 2.0, 3.0]))
    # Radau's differences of the right-hand side for its Jacobian are no steps of it; SciPy does not
    # count them.
    assert result.evaluations == len(calls) or (name == "Radau" and result.evaluations < len(calls))
    assert result.states[:, 0] == pytest.approx(np.exp(-np.array([0.5, 1.0, 2.0])), rel=1e-5)
    assert result.end[0] == pytest.approx(math.exp(-2.0), rel=1e-5)
    assert not result.message
    if name != "ode45":
        tolerances = {"DOP853": (1e-9, 1e-12), "Radau": (1e-6, 1e-9)}[name]
        alone = solve_ivp(
            decay, (1.0, 3.0), np.ones(1), name, rtol=tolerances[0], atol=tolerances[1]
        )
        assert result.steps == len(alone.t) - 1


def test_steps_that_end_at_samples_are_more_accurate_there_than_the_interpolant() -> None:
    """Of cos and -sin over 10 rad in some 40 steps at a tolerance of 2e-14; also where the last
    sample is before the end, or at it. Without heyoka references are computed so."""
    for last in (9.9, 10.0):
        times = np.linspace(0.1, last, 99)
        exact = np.stack([np.cos(times), -np.sin(times)], axis=1)
        errors = []
        for ends_at_samples in (False, True):
            integrator = scipy_integrator("DOP853", 2.3e-14, 1e-16, ends_at_samples=ends_at_samples)
            part = integrator(
                lambda _, state: [state[1], -state[0]], 0.0, 10.0, np.array([1.0, 0.0]), times
            )
            assert part.states.shape == exact.shape
            assert part.end == pytest.approx([np.cos(10.0), -np.sin(10.0)], abs=1e-13)
            errors.append(np.abs(np.diff(part.states - exact, axis=0)).max())
        assert errors[1] < 1e-15 < errors[0] / 10.0


def test_a_state_that_has_diverged_has_no_derivative() -> None:
    scene = paper("fig03", duration=1.0, samples=2)
    solver = OdeSolver(scene, INTEGRATORS["DOP853"], np.array([0.0, 1.0]))
    (segment,) = scene.load_segments
    values = solver.right_hand_side(segment)(0.0, [math.inf, 0.0, 1.0, 0.0])
    assert len(values) == 4
    assert np.isnan(values).all()


def test_a_derivative_that_is_not_finite_ends_a_run_at_its_start_alone() -> None:
    """A trial step may go where there is none: the solver shortens it."""
    at_start = INTEGRATORS["DOP853"](
        lambda _t, _y: [math.nan], 0.0, 1.0, np.ones(1), np.array([0.5])
    )
    assert at_start.message == "SciPy: the derivative of the state is not finite"
    assert (at_start.steps, at_start.evaluations, len(at_start.states)) == (0, 0, 0)
    assert at_start.end.tolist() == [1.0]
    # The slope is not defined beyond 0.001; the second evaluation, before the first step, is at
    # 0.01 of the state over its slope.
    tried = []

    def bounded(time: float, _state: Any) -> list[float]:
        tried.append(time)
        return [1.0 if time <= 0.001 else math.nan]

    later = INTEGRATORS["DOP853"](bounded, 0.0, 100.0, np.ones(1), np.array([0.0005]))
    assert tried[:2] == [0.0, 0.01]
    assert "step size" in later.message
    assert later.end[0] == pytest.approx(1.001, abs=1e-6)
    assert later.states[:, 0] == pytest.approx([1.0005], abs=1e-9)


def test_one_step_may_not_evaluate_without_end(monkeypatch: pytest.MonkeyPatch) -> None:
    """Evaluations of a step are counted anew in each."""
    calls = []

    def oscillation(time: float, state: Any) -> list[float]:
        calls.append(time)
        return [state[1], -state[0]]

    start = np.array([1.0, 0.0])
    # DOP853: two evaluations before the first step, some twelve in each that is taken at once.
    monkeypatch.setattr(ode_solvers, "MAX_STEP_EVALUATIONS", 12)
    ended = INTEGRATORS["DOP853"](oscillation, 0.0, 0.1, start, np.empty(0))
    assert not ended.message
    assert len(calls) > 12
    calls.clear()
    monkeypatch.setattr(ode_solvers, "MAX_STEP_EVALUATIONS", 10)
    ended = INTEGRATORS["DOP853"](oscillation, 0.0, 0.1, start, np.empty(0))
    assert ended.message == "SciPy: no step is small enough"
    assert len(calls) == 2 + 10


@pytest.mark.parametrize(("times_as_many", "steps"), [(9.0, 5000), (11.0, 2000)])
def test_a_run_ends_as_soon_as_it_would_take_ten_times_the_steps_that_are_allowed(
    times_as_many: float, steps: int
) -> None:
    """It is estimated after 2,000 steps, of equal length for an oscillation; else it ends at the
    number that is allowed."""

    def oscillation(_time: float, state: Any) -> list[float]:
        return [state[1], -state[0]]

    start, nothing = np.array([1.0, 0.0]), np.empty(0)
    alone = solve_ivp(oscillation, (0.0, 100.0), start, "RK23", rtol=1e-3, atol=1e-6)
    step = 100.0 / (len(alone.t) - 1)
    limited = scipy_integrator("RK23", 1e-3, 1e-6, max_steps=5000)
    # The estimate is of the share of the interval that is crossed, wherever it begins.
    begin = 10.0 * 5000 * step
    ended = limited(oscillation, begin, begin + times_as_many * 5000 * step, start, nothing)
    assert ended.message == "SciPy: more than 5000 steps"
    assert ended.steps == steps
    enough = limited(oscillation, begin, begin + 500 * step, start, nothing)
    assert not enough.message


@pytest.mark.parametrize("name", INTEGRATORS)
def test_a_motion_that_ends_is_a_run_that_says_why(name: str) -> None:
    """1 / (1 - t) at t = 1."""
    result = INTEGRATORS[name](
        lambda _, y: [y[0] * y[0]], 0.0, 2.0, np.ones(1), np.array([0.5, 1.5])
    )
    assert len(result.states) == 1
    assert "step size" in result.message


@pytest.mark.parametrize("engine", ["scipy", "heyoka"])
def test_a_solver_at_chosen_times_has_those(engine: str) -> None:
    """A rotor that turns uniformly."""
    pytest.importorskip(engine)
    times = np.array([0.0, 0.3, 1.7])
    scene = paper("fig06", gravity=0.0, initial_rates=(0.5, 0.0, 0.0, 0.0))
    solver: Any = OdeSolver(scene, INTEGRATORS["DOP853"], times)
    if engine == "heyoka":
        solver = Propagation(scene, times=times, tol=1e-15, compact_mode=True)
    assert solver.integrate().success
    result = solver.observe()
    assert result.time.tolist() == times.tolist()
    assert result.angles[:, 0] == pytest.approx(scene.initial_angles[0] + 0.5 * times, abs=1e-9)


@pytest.mark.parametrize("settings", [{}, {"tolerance": 1e-9}])
def test_the_order_of_taylors_series_is_that_of_its_tolerance(settings: dict[str, float]) -> None:
    """⌈1 - ln(tol) / 2⌉: A. Jorba, M. Zou, Exp. Math. 14 (2005). At round-off neither errors nor
    steps show it."""
    pytest.importorskip("heyoka")
    method = find_method("lagrange/taylor")
    solver: Any = method.build(paper("fig03"), method.settings.of(method.name, settings))
    tolerance = settings.get("tolerance", np.finfo(float).eps)
    assert solver.integrator.order == math.ceil(1.0 - 0.5 * math.log(tolerance))


def test_a_load_over_time_is_in_quad_precision_in_a_quad_run() -> None:
    """A torque that grows by a third of 1000 N m a second, which no double is, on a balanced rotor:
    s t³ / 6 I."""
    pytest.importorskip("heyoka")
    scene = paper(
        "fig06",
        gravity=0.0,
        initial_angles=(0.0,) * 4,
        initial_rates=(0.0,) * 4,
        duration=3.0,
        samples=2,
    )
    scene = replace(scene, rotor_torque=((0.0, 0.0), (3.0, 1000.0)))
    run = Propagation(scene, quad=True, tol=1e-32, compact_mode=True)
    assert run.integrate().success
    x, _, z = map(Fraction, scene.blades[0].centre_of_mass)
    inertia = 3 * Fraction(scene.blades[0].mass) * (x * x + z * z) + Fraction(scene.hub_inertia)
    (exact,) = array_of([Fraction(1000, 3) * 27 / (6 * inertia)], quad=True)
    assert abs(float((run.states[-1, 0] - exact) / exact)) < 1e-30


def test_constant_rest_angles_do_no_work() -> None:
    """After the rotor's torque a torque and a rest angle for each of four pitches, of which the
    third is fixed."""
    loads = load_values([0.0, 1.0, 0.1, 2.0, 0.2, 3.0, 0.3, 4.0, 0.4], (1, 2, 4))
    assert (loads.pitches, loads.rests) == ([1.0, 2.0, 4.0], [0.1, 0.2, 0.4])
    assert at_constant_rests((False, True, False), loads).rests == [0.0, 0.2, 0.0]


@pytest.mark.parametrize(
    ("weight", "kinetic", "torque", "unit"),
    [
        (1.5e6, 0.0, 0.0, 2.0**20),
        (0.0, 1.5e6, 0.0, 2.0**20),
        (9e5, 9e5, 9e5, 2.0**21),
        (0.0, 0.0, 1.5, 1.0),
        (0.0, 0.0, 2.5, 2.0),
        (0.0, 0.0, 0.0, 1.0),
    ],
)
def test_the_unit_of_work_is_the_power_of_two_below_the_energies(
    weight: float, kinetic: float, torque: float, unit: float
) -> None:
    """Of a scene with these energies (J) and torque (N m); 1 where there is none that counts."""
    arm = math.hypot(OFFSET, ARM)
    rates = (math.sqrt(2.0 * kinetic / MASS) / arm, 0.0)
    scene = paper("fig03", gravity=weight / (MASS * arm), initial_rates=rates)
    table = ((0.0, 0.0), (1.0, torque), (2.0, 0.0)) if torque else ()
    assert work_unit(replace(scene, rotor_torque=table)) == unit
