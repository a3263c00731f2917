"""The chain by extrapolation within sample intervals: orders, chosen columns and parts, what it
keeps, loads."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from support.other_code import closed_form
from support.random_scenes import random_scene
from support.references import reference
from support.scenes import paper, shipped

from rotor_mbs.methods.catalogue import find_method
from rotor_mbs.methods.solve import solve
from rotor_mbs.models.exudyn.solvers import ExtrapolatedSolver
from rotor_mbs.scenario.scene import Scene

METHOD = "exudyn_chain/extrapolated"
SHORT = replace(paper("fig11"), duration=1.0, samples=101)


def beginning(name: str, samples: int) -> Scene:
    return replace(
        shipped(name), duration=float(reference(name).time[samples - 1]), samples=samples
    )


def exact_angles(given: Scene) -> np.ndarray:
    return np.asarray(closed_form(given)[:, : 1 + len(given.blades)])


def integrated(given: Scene, **settings: float) -> ExtrapolatedSolver:
    method = find_method(METHOD)
    solver = method.build(given, method.settings.of(METHOD, settings))
    assert isinstance(solver, ExtrapolatedSolver)
    assert solver.integrate().success
    return solver


@pytest.mark.parametrize(("columns", "coarse"), [(2, 80), (4, 40)])
def test_with_every_column_the_order_rises_by_two(
    columns: int, coarse: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Of 2 columns fourth order, of 4 eighth; over 0.4 s, in which no error has grown yet. Eighth
    order leaves rounding with 160 intervals."""

    def is_met(*_: object) -> bool:
        accepted[0] += 1
        return accepted[0] % (columns - 1) == 0

    monkeypatch.setattr(ExtrapolatedSolver, "_is_met", is_met)
    found = []
    for intervals in (coarse, 2 * coarse):
        accepted = [0]
        given = replace(paper("fig11"), duration=0.4, samples=1 + intervals)
        solver = integrated(given, tolerance=1e-12)
        assert set(solver.columns) == {columns}
        found.append(np.abs(solver.observe().angles - exact_angles(given)).max())
    assert np.log2(found[0] / found[1]) == pytest.approx(2 * columns, abs=0.6)


def test_steps_are_those_of_all_columns() -> None:
    solver = integrated(SHORT)
    assert len(solver.columns) == 100  # none was halved
    again = solver.integrate()
    assert again.steps == sum(k * (k + 1) for k in solver.columns)  # 2 + 4 + ... + 2k
    # each at least once in Newton's method, and at its end
    assert again.rhs_evaluations >= 2 * again.steps
    assert not again.out_of_time
    smooth = integrated(beginning("paper/fig03", 101))
    assert set(smooth.columns) == {2}
    assert min(solver.columns) > 2


def test_an_interval_too_long_is_halved_and_the_next_begins_with_its_parts() -> None:
    """Samples 0.1 s apart: no table of five columns is enough, and the accuracy is that of samples
    0.01 s apart."""
    sparse = replace(SHORT, samples=11)
    solver = integrated(sparse)
    parts = np.diff([kept.time for kept in solver.kept])
    assert parts.max() < 0.1
    assert np.isclose(np.log2(0.1 / parts), np.round(np.log2(0.1 / parts))).all()
    assert np.abs(solver.observe().angles - exact_angles(sparse)).max() < 100 * 3e-8
    # An interval begins with parts as small as the last ones: fewer tables are thrown away than
    # kept.
    assert solver.integrate().steps < 2 * sum(k * (k + 1) for k in solver.columns)


def test_pitches_at_rest_stay_at_zero() -> None:
    """Blade 2 of fig14b hangs still beside one that swings by 36 degrees; generalized-alpha leaves
    zero at 0.76 s."""
    given = beginning("paper/fig14b", 151)
    assert not solve(METHOD, given, {}).angles[:, 2].any()
    assert solve("exudyn_chain/generalized_alpha", given, {}).angles[:, 2].any()


def test_loads_at_every_sample_from_the_first_on() -> None:
    """The first multipliers are exact but for rounding; later ones keep what Newton's method
    leaves: a tenth of the tolerance, of forces, over the smallest substep."""
    name = "check/loads"
    result, exact = solve(METHOD, shipped(name), {}), reference(name)
    for load in (
        "blade_root_force",
        "blade_root_moment",
        "shaft_force",
        "shaft_moment",
        "pitch_actuator_moment",
    ):
        off = np.abs(result[load] - exact.get(load)) / np.abs(exact.get(load)).max()
        assert off[0].max() < 1e-12
        assert off.max() < 1e-5


def test_loads_of_a_damped_rotor_are_as_right_late_as_early() -> None:
    """Nothing but the equations holds accelerations and multipliers of a chain whose constraints
    are at velocity level: carried from part to part, their errors grew tenfold in 4 s here, to
    forty thousand times the loads at the end. Newton's tolerance is 3e-9 of the forces."""
    given = random_scene(142)
    result, exact = solve(METHOD, given, {}), solve("lagrange/dop853", given, {})
    for load in ("blade_root_moment", "shaft_force"):
        off = np.abs(result[load] - exact[load]).max() / np.abs(exact[load]).max()
        assert off < 1e-6


@pytest.mark.full
def test_a_damped_rotor_without_loads_reaches_its_end() -> None:
    """There the motion felt the multipliers after 45 s, and broke off."""
    given = random_scene(142)
    twice = replace(
        given,
        duration=2.0 * given.duration,
        samples=2 * given.samples - 1,
        outputs=("angles", "energy"),
    )
    result, exact = solve(METHOD, twice, {}), solve("lagrange/dop853", twice, {})
    assert np.abs(result.angles - exact.angles).max() < 1e-6


@pytest.mark.parametrize("method", [METHOD, "exudyn_tree/dopri5", "exudyn_tree/rk67"])
def test_the_work_of_loads_and_dampers_along_the_substeps(method: str) -> None:
    """Springs that swing by 3.8 rad between samples: the energy keeps to 1e-6 of the largest
    kinetic one, where a power interpolated through the samples loses 2e-3 and more."""
    given = replace(
        shipped("turbine/pitch-step"), duration=1.2, samples=61, outputs=("angles", "energy")
    )
    result = solve(method, given, {})
    total = result["kinetic_energy"] + result["potential_energy"] - result["work"]
    assert np.abs(total - total[0]).max() < 1e-6 * result["kinetic_energy"].max()
    assert result["work"][0] == 0.0


def test_the_work_between_two_kinks_a_step_apart() -> None:
    """Through two rows the power is a straight line, and the work of second order in the step:
    here 6e-9 of the largest kinetic energy was lost between 0.5 s and 0.5006 s."""
    kinks = ((0.0, 0.0), (0.5, 0.0), (0.5006, 1e6), (1.0, 1e6))
    given = replace(
        paper("fig11"),
        duration=1.0,
        samples=101,
        rotor_torque=kinks,
        bearing_damping=(2000.0,) * 3,
        outputs=("angles", "energy"),
    )
    result = solve("exudyn_tree/rk67", given, {})
    total = result["kinetic_energy"] + result["potential_energy"] - result["work"]
    assert np.abs(total - total[0]).max() < 1e-10 * result["kinetic_energy"].max()
