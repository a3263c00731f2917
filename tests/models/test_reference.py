"""The frozen references: sure of themselves, and what a computation today gives again."""

from __future__ import annotations

from dataclasses import replace
from fractions import Fraction
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from support.references import reference as frozen_reference
from support.scenes import AXIAL, PAPER_SCENES, make_scene, paper, shipped

from rotor_mbs.methods.solve import solve
from rotor_mbs.models.lagrange import reference as reference_module
from rotor_mbs.models.lagrange.heyoka_adapter import heyoka
from rotor_mbs.models.lagrange.methods import ReferenceSettings
from rotor_mbs.models.lagrange.parameters import changing_loads
from rotor_mbs.models.lagrange.reference import ReferenceSolver, build, reference_at, uncertainty
from rotor_mbs.models.lagrange.samples import sampled_loads
from rotor_mbs.models.lagrange.taylor import Propagation, build_system, set_parameters
from rotor_mbs.scenario.scene import Scene
from rotor_mbs.solution.trajectory import Integration


def _propagated(name: str, tolerance: float) -> Any:
    """(samples, coordinates that move) rad, quad precision."""
    scene = shipped(name)
    run = Propagation(scene, quad=True, tol=tolerance, compact_mode=True)
    run.integrate()
    return run.states[:, : len(scene.moving_coordinates)]


# The closed form with 180 bits at tolerance 1e-42: the true motion, as far as quad precision can
# tell

_BITS = 180
_TOLERANCE = "1e-42"


def moving_angles(scene: Scene) -> Any:
    """(samples, coordinates that move) rad, numbers of 180 bits."""
    (equations, parameters), columns = build_system(scene), scene.moving_coordinates
    count, kind = len(columns), {"fp_type": heyoka().real, "tol": heyoka().real(_TOLERANCE, _BITS)}
    values = [
        *(scene.initial_angles[i] for i in columns),
        *(scene.initial_rates[i] for i in columns),
    ]
    start = _numbers([*values, *[0.0] * (len(equations) - 2 * count)])
    integrator = heyoka().taylor_adaptive(equations, state=start, compact_mode=True, **kind)
    set_parameters(integrator, _numbers(parameters.values))
    times, rows = np.linspace(0.0, scene.duration, scene.samples), [start[None, :]]
    for segment in scene.load_segments:
        if numbers := [number for i in changing_loads(scene) for number in segment.linear_loads[i]]:
            integrator.pars[-len(numbers) :] = _numbers(numbers)
        inside = times[(times > segment.start) & (times <= segment.end)]
        end = [] if len(inside) and inside[-1] == segment.end else [segment.end]
        states = integrator.propagate_grid(_numbers([segment.start, *inside, *end]))[-1]
        rows.append(states[1 : 1 + len(inside)])
    return np.concatenate(rows)[:, :count]


def distance(angles: Any, exact: Any) -> Any:
    """(n,) rad: largest over the coordinates, of doubles or quad numbers from numbers of 180
    bits."""
    real = heyoka().real
    wide = np.array([[real(value, _BITS) for value in row] for row in angles])
    return np.abs((wide - exact).astype(float)).max(axis=1)


def _numbers(values: Any) -> Any:
    real = heyoka().real
    fractions = [Fraction(value) for value in values]
    return np.array(
        [real(str(f.numerator), _BITS) / real(str(f.denominator), _BITS) for f in fractions]
    )


# Of each kind: rest, a pendulum, uniform rotation, constant torque, coordinates at exact zero,
# general rigid blades.
_OF_EACH_KIND = (
    "paper/fig05",
    "paper/fig04b",
    "paper/fig06",
    "paper/fig15-100kNm",
    "paper/fig08",
    "check/general",
)
_OTHERS = [f"paper/{name}" for name in PAPER_SCENES if f"paper/{name}" not in _OF_EACH_KIND]


@pytest.mark.parametrize(
    "name", [*_OF_EACH_KIND, *(pytest.param(name, marks=pytest.mark.nightly) for name in _OTHERS)]
)
def test_uncertainty_bounds_the_true_error_at_every_sample(name: str) -> None:
    """Of the quad run; of the doubles that are stored, together with half a unit in the last
    place."""
    pytest.importorskip("heyoka")
    exact, frozen = moving_angles(shipped(name)), frozen_reference(name)
    rows = min(len(exact), len(frozen.time))
    assert rows == len(frozen.time)
    stored = frozen.angles[:, shipped(name).moving_coordinates]
    uncertainty, rounding = frozen.angle_uncertainty, 0.5 * np.spacing(np.abs(stored)).max(axis=1)
    assert (distance(_propagated(name, 1e-33)[:rows], exact[:rows]) <= uncertainty).all()
    assert (distance(stored, exact[:rows]) <= uncertainty + rounding).all()


def test_the_uncertainty_is_ten_times_difference_and_rounding_and_never_falls() -> None:
    """The rounding of 1 rad at least, and of 4 rad where an angle is that large."""
    angles = np.array([[0.1, 0.2], [0.1, -4.0], [0.1, 0.2]])
    result = uncertainty(np.array([1e-9, 0.0, 3e-9]), angles, 1e-9)
    np.testing.assert_allclose(result, [2e-8, 4e-8, 4e-8], rtol=1e-12)


@pytest.mark.parametrize("failing", ["", "best", "check"])
def test_a_reference_that_fails_says_why_and_how_far_the_better_run_came(failing: str) -> None:
    """`steps` and the time are those of the run that is kept, whichever fails."""
    runs = {
        name: Integration(
            name != failing, f"{name} failed" if name == failing else "", reached, steps
        )
        for name, reached, steps in (("best", 2.0, 20), ("check", 1.0, 10))
    }
    solver_runs: Any = []
    for report in runs.values():
        states = np.zeros((1, 4))
        solver_runs.append(SimpleNamespace(integrate=lambda report=report: report, states=states))
    result = ReferenceSolver(paper("fig03"), solver_runs, 1e-30).integrate()
    assert (result.success, result.time_reached, result.steps) == (not failing, 2.0, 20)
    assert result.message == (f"{failing} failed" if failing else "")


def test_a_reference_has_loads_where_they_are_asked_for() -> None:
    pytest.importorskip("heyoka")
    scene = paper("fig03", duration=0.1, samples=3)
    assert "blade_root_force" not in solve("reference", scene, {}).trajectory.quantities
    result = solve("reference", replace(scene, outputs=("angles", "rates", "loads")), {}).trajectory
    expected = sampled_loads(scene, result.time, result.angles, result.rates)["blade_root_force"]
    np.testing.assert_allclose(result.quantities["blade_root_force"], expected, rtol=1e-12)


def test_loads_of_a_reference_have_the_rounding_of_quad_precision() -> None:
    """A point mass on a massless rod bears no force across it: 1e-13 of the weight in doubles."""
    pytest.importorskip("heyoka")
    mass = replace(AXIAL, inertia=(0.0,) * 6)
    scene = make_scene([1.0, 0.0], [0.5, 0.0], (mass,), duration=0.5, samples=11)
    run = solve("reference", replace(scene, outputs=("angles", "rates", "loads")), {}).trajectory
    across = run.quantities["blade_root_force"][:, 0, 0]
    assert np.abs(across).max() < 1e-25 * mass.mass * scene.gravity


def test_the_growth_of_a_run_of_two_samples_is_that_at_its_end() -> None:
    pytest.importorskip("heyoka")
    ends = []
    for samples in (2, 5):
        scene = paper("fig03", duration=2.0, samples=samples)
        ends.append(solve("reference", scene, {}).trajectory.error_growth[-1])
    assert ends[0] > 1.2
    # The matrix is good to its tolerance however the way to it is divided.
    assert ends[0] == pytest.approx(ends[1], rel=1e-9)


@pytest.mark.parametrize("is_available", [True, False])
@pytest.mark.parametrize(("shorter", "rows"), [(0, 1), (1, 3)])
def test_a_reference_of_which_one_run_ends_early(
    is_available: bool, shorter: int, rows: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    """It ends there, in quad precision and without heyoka: past that nothing bounds the error."""
    pytest.importorskip("heyoka")
    monkeypatch.setattr(reference_module, "is_available", lambda: is_available)
    scene = paper("fig03", duration=0.1, samples=4, outputs=("angles", "rates"))
    solver = build(scene, ReferenceSettings())
    solver.integrate()
    whole = solver.observe()
    run: Any = solver._runs[shorter]
    integrate_whole = run.integrate

    def integrate_part() -> Integration:
        report: Integration = integrate_whole()
        run.states = run.states[:rows]
        return report

    monkeypatch.setattr(run, "integrate", integrate_part)
    solver.integrate()
    result = solver.observe()
    assert result.error_growth is not None
    assert len(result.time) == len(result.error_growth) == len(result.angle_uncertainty) == rows
    assert result.angles.tobytes() == whole.angles[:rows].tobytes()
    assert result.angle_uncertainty.tobytes() == whole.angle_uncertainty[:rows].tobytes()
    # Without heyoka quotients of differences of 1e-9.
    np.testing.assert_allclose(result.error_growth, whole.error_growth[:rows], rtol=1e-6)


def test_quotients_are_known_as_far_as_both_runs_went(monkeypatch: pytest.MonkeyPatch) -> None:
    scene, solver_of = paper("fig03", duration=0.1, samples=4), reference_module._in_doubles

    def ends_early(start: Scene, tolerances: tuple[float, float], times: Any) -> Any:
        run = solver_of(start, tolerances, times)
        run.integrate()
        return SimpleNamespace(
            integrate=lambda: None, states=run.states[: 4 if start == scene else 2]
        )

    monkeypatch.setattr(reference_module, "_in_doubles", ends_early)
    result = reference_module._matrices_by_quotients(scene, np.linspace(0.0, 0.1, 4))
    assert np.isfinite(result[:2]).all()
    assert np.isposinf(result[2:]).all()


@pytest.mark.parametrize(
    ("known", "finite"), [(2, [True, True, False]), (3, [True] * 3), (4, [True] * 3)]
)
def test_growth_is_known_as_far_as_the_variational_equations_went(
    known: int, finite: list[bool], monkeypatch: pytest.MonkeyPatch
) -> None:
    pytest.importorskip("heyoka")
    matrices = np.full((known, 4, 4), 3.0)  # rows of norm 6, columns in units of 1
    monkeypatch.setattr(reference_module, "_transition_matrices", lambda _scene, _times: matrices)
    # of which no pitch is at rest
    scene = paper("fig03", duration=0.1, samples=3, initial_angles=(0.5, 0.1))
    result = reference_at(scene, np.linspace(0.0, 0.1, 3))
    assert result.growth.tolist() == [[6.0 if is_finite else np.inf] * 4 for is_finite in finite]
    assert result.trajectory.error_growth is not None
    assert np.isfinite(result.trajectory.error_growth).tolist() == finite


def test_a_pitch_that_is_fixed_has_no_growth_and_no_unit(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(reference_module, "is_available", lambda: False)
    free = paper("fig03").blades[0]
    blades = (replace(free, centre_of_mass=(0.0, 0.0, 5.0)), free)
    scene = replace(
        paper("fig03"), blades=blades, initial_angles=(0.2, 0.0, 0.1), initial_rates=(0.5, 0.0, 0.2)
    )
    scene = replace(scene, bearing_stiffness=(0.0, 1e8), duration=0.1, samples=3)
    assert list(scene.moving_coordinates) == [0, 2]
    result = reference_at(scene, np.linspace(0.0, 0.1, 3))
    assert (result.growth[:, [1, 4]] == 1.0).all()
    assert (result.growth[1:, [0, 2, 3, 5]] != 1.0).all()
    assert (result.units == 1.0).tolist() == [True] * 5 + [False]


def test_error_growth_of_a_stiff_oscillation_is_one() -> None:
    """An undamped spring of 1000 rad/s turns (angle, rate/ω) in a circle: no error of it grows, in
    either channel."""
    pytest.importorskip("heyoka", reason="quotients of differences have four digits")
    scene = make_scene(
        [0, 0.01], [0, 0], (AXIAL,), gravity=0.0, duration=0.1, samples=6, bearing_stiffness=(7e6,)
    )
    result = reference_at(scene, np.linspace(0.0, 0.1, 6))
    np.testing.assert_allclose(result.units, [1.0, 1.0, 1.0, 1000.0])
    np.testing.assert_allclose(result.growth[:, [1, 3]], 1.0, rtol=1e-9)
    np.testing.assert_allclose(
        result.growth[:, 0], np.hypot(1.0, result.trajectory.time), rtol=1e-9
    )
