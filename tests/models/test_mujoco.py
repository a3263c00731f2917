"""The MuJoCo model against the quad reference, a closed form written anew, exact solutions, and its
own order."""

from __future__ import annotations

import re
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from support import references
from support.other_code import closed_form
from support.runs import run
from support.scenes import MIXED, STOUT, make_scene, paper, shipped

from rotor_mbs.analysis.judgement import judge
from rotor_mbs.errors import InputError
from rotor_mbs.methods.catalogue import find_method
from rotor_mbs.methods.solve import solve
from rotor_mbs.models.lagrange.defects import interval_defects

pytest.importorskip("mujoco")

from rotor_mbs.models.mujoco import mjcf
from rotor_mbs.models.mujoco.solver import MujocoSolver

RK4_STEP = 2.5e-4


@pytest.mark.parametrize(
    ("method", "order", "steps"),
    [
        ("mujoco/rk4", 4, [2e-3, 1e-3, 5e-4]),
        ("mujoco/implicitfast", 1, [1e-3, 5e-4, 2.5e-4]),
        pytest.param("mujoco/implicit", 1, [1e-3, 5e-4, 2.5e-4], marks=pytest.mark.full),
    ],
)
def test_order_of_convergence(method: str, order: int, steps: list[float]) -> None:
    """With loads over time and jumps between samples: no step runs over a kink or with a frozen
    load."""
    motion = closed_form(MIXED)
    errors = [np.abs(run(method, MIXED, step=step).angles - motion[:, :4]).max() for step in steps]
    assert np.polyfit(np.log(steps), np.log(errors), 1)[0] == pytest.approx(order, abs=0.2)


def test_the_work_of_loads_and_dampers_is_of_fourth_order() -> None:
    """Energy balance at two steps; without the dampers' part of the slopes it is of second
    order."""
    scene = replace(shipped("check/general"), outputs=("angles", "energy"))
    drifts = []
    for step in (1e-3, 5e-4):
        result = run("mujoco/rk4", scene, step=step)
        total = result.kinetic_energy + result.potential_energy - result.work
        drifts.append(np.abs(total - total[0]).max() / result.kinetic_energy.max())
    assert np.log2(drifts[0] / drifts[1]) == pytest.approx(4.0, abs=0.3)


def test_point_masses_have_no_inertia_that_the_scene_does_not_give() -> None:
    """The toy of 1 g: MuJoCo's least inertia would be a defect of 8.6e-6 rad at any step; what the
    step itself leaves is divided by 16 where it is halved."""
    solver = MujocoSolver(paper("fig11"), "rk4", RK4_STEP)
    assert not solver.engine.moments.any()
    assert solver.engine.masses.tolist() == [0.0, 15000.0, 15000.0, 15000.0]
    scene = shipped("extreme/toy")
    coarse, fine = (
        interval_defects(scene, result.time, result.angles, result.rates).sizes.max()
        for result in (run("mujoco/rk4", scene, step=1e-4), run("mujoco/rk4", scene, step=5e-5))
    )
    assert coarse / fine == pytest.approx(16.0, rel=0.2)
    assert fine < 1e-8


def test_an_inertia_at_the_limit_of_the_triangle_inequality() -> None:
    """Flat and thin bodies, one with the rounding of its ten digits: MuJoCo itself would refuse the
    last."""
    for moments, bound in (
        ((10.0, 30.0, 40.0), 1e-11),
        ((30.0, 30.0, 0.0), 1e-11),
        ((10.0, 30.0, 40.0 * (1 + 1e-10)), 1e-9),
    ):
        blade = replace(STOUT, inertia=(*moments, 0.0, 0.0, 0.0))
        scene = make_scene([0.4, 0.3], [1.0, 0.5], (blade,), duration=0.5, samples=51)
        assert np.abs(run("mujoco/rk4", scene).angles - closed_form(scene)[:, :2]).max() < bound


@pytest.mark.parametrize(
    "method",
    [
        "mujoco/rk4",
        *(pytest.param(f"mujoco/implicit{name}", marks=pytest.mark.full) for name in ("", "fast")),
    ],
)
def test_runs_are_within_their_bounds_and_an_impossible_step_is_refused(method: str) -> None:
    scene = shipped("check/held")
    assert judge(scene, solve(method, scene, {}), references.reference(scene.name)).status == "ok"
    with pytest.raises(InputError, match="steps"):
        find_method(method).chosen(paper("fig03"), {"step": 1e-12})


def test_steps_and_evaluations_are_counted() -> None:
    scene = make_scene([0.1, 0, 0, 0], [0.2, 0, 0, 0], duration=0.5, samples=51)
    for integrator, stages in (("rk4", 4), ("implicitfast", 1)):
        report = MujocoSolver(scene, integrator, 1.1e-3).integrate()
        assert (report.steps, report.rhs_evaluations, report.time_reached) == (
            500,
            500 * stages,
            0.5,
        )


def test_an_overflow_ends_the_run_and_leaves_no_file(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    solver = MujocoSolver(make_scene([0.3, 0.1], [1e100, 0.0]), "rk4", RK4_STEP)
    integration = solver.integrate()
    assert not integration.success
    assert re.match(r"MuJoCo: Nan, Inf or huge value in Q\w+ at DOF 0", integration.message)
    assert len(solver.observe().time) == 1
    assert not list(tmp_path.iterdir())


def test_only_what_the_scene_asks_for_is_built() -> None:
    kinds = [item.kind for item in mjcf.items(MIXED)]
    assert {kind: kinds.count(kind) for kind in kinds} == {
        "object": 4,
        "node": 4,
        "marker": 3,
        "load": 5,
    }
    less = replace(
        MIXED, outputs=("angles", "rates"), rotor_torque=(), pitch_torque=(), bearing_rest=()
    )
    assert {item.kind for item in mjcf.items(less)} == {"object", "node"}
    result = run("mujoco/rk4", less)
    assert result.tip is None
    assert result.work is None
