"""Both Exudyn models against the closed form: any number of blades, their order, long runs."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from support.other_code import closed_form
from support.runs import run
from support.scenes import SLIM, STOUT, make_scene, paper

from rotor_mbs.analysis.kinematics import exact_rotor_angle
from rotor_mbs.models.exudyn.adapter import linear_solver

SHORT = replace(paper("fig11"), duration=1.0, samples=101)


@pytest.fixture(scope="module")
def short_motion():
    return closed_form(SHORT)


def angle_error(trajectory, motion):
    n = trajectory.angles.shape[1]
    return np.abs(trajectory.angles - motion[: len(trajectory.time), :n]).max()


def unlike_blades(count, duration, samples):
    return make_scene(
        [0.4, *np.linspace(-0.5, 0.6, count)],
        [0.3, *np.linspace(0.2, -0.4, count)],
        tuple((STOUT, SLIM)[i % 2] for i in range(count)),
        duration=duration,
        samples=samples,
        hub_inertia=20.0,
    )


@pytest.mark.parametrize("count", [1, 2, 4, 7])
@pytest.mark.parametrize(
    ("name", "bound"),
    [("exudyn_tree/rk67", 1e-11), ("exudyn_chain/generalized_alpha", 1e-5), ("exudyn_chain/extrapolated", 1e-5),
     ("mujoco/rk4", 1e-10)],
)  # fmt: skip
def test_any_number_of_blades(name, bound, count) -> None:
    scene = unlike_blades(count, duration=0.5, samples=51)
    assert angle_error(run(name, scene), closed_form(scene)) < bound


@pytest.mark.parametrize(
    "name", ["exudyn_tree/generalized_alpha", "exudyn_chain/generalized_alpha"]
)
def test_sixteen_blades_take_another_path_through_the_engine_to_the_same_motion(name) -> None:
    """The chain a sparse factorization, the tree an old Jacobian; a second order error as with few
    blades."""
    scene = unlike_blades(16, duration=0.2, samples=21)
    error = angle_error(run(name, scene, step=5e-4), closed_form(scene))
    finer = angle_error(run(name, scene, step=2.5e-4), closed_form(scene))
    assert error < 1e-5
    assert np.log2(error / finer) == pytest.approx(2.0, abs=0.2)


def test_large_chains_alone_are_solved_by_a_sparse_factorization() -> None:
    """Where it is faster; the scenes of the paper keep their bits."""

    def sizes(blades: int) -> tuple[int, int]:  # Euler parameters and their norms
        return 7 * (1 + blades), (1 + blades) + 5 * (1 + blades)

    assert [linear_solver(*sizes(blades)) for blades in (3, 6, 12, 96)] == [
        *["EigenDense"] * 2,
        *["EigenSparse"] * 2,
    ]
    assert linear_solver(97, 0) == "EigenDense"
    assert linear_solver(200, 0) == "EigenDense"


@pytest.mark.parametrize(
    ("name", "order", "steps"),
    [
        ("exudyn_tree/rk44", 4, [1e-2, 5e-3, 2.5e-3, 1.25e-3]),
        ("exudyn_tree/rk67", 6, [1e-2, 5e-3, 2.5e-3]),
        ("exudyn_tree/generalized_alpha", 2, [2e-3, 1e-3, 5e-4, 2.5e-4]),
        ("exudyn_chain/generalized_alpha", 2, [1e-3, 5e-4, 2.5e-4]),
        ("exudyn_chain/newmark_index2", 2, [1e-3, 5e-4, 2.5e-4]),
    ],
)
def test_order_of_convergence(name, order, steps, short_motion) -> None:
    errors = [angle_error(run(name, SHORT, step=step), short_motion) for step in steps]
    # all above round-off (1e-13); Butcher's sixth order comes with a shrinking seventh-order part
    slope = np.polyfit(np.log(steps), np.log(errors), 1)[0]
    assert slope == pytest.approx(order, abs=0.2 if order != 6 else 0.5)


def test_order_of_dopri5_in_its_tolerance(short_motion) -> None:
    tolerances = [1e-7, 1e-8, 1e-9, 1e-10]
    errors = [
        angle_error(run("exudyn_tree/dopri5", SHORT, absolute_tolerance=t), short_motion)
        for t in tolerances
    ]
    # error per step kept at the tolerance: the global error falls as its power 4/5 to 1
    assert 0.7 < np.polyfit(np.log(tolerances), np.log(errors), 1)[0] < 1.1
    assert errors[-1] < 1e-8


def test_long_runs_lose_no_sample() -> None:
    """Thousands of sample intervals: the engine adds them up, and rounding must not make a row come
    a step too late.

    The sixth-order error of some 50,000 equal steps adds up to less than 1e-6 rad on a pendulum.
    """
    scene = paper("fig03", duration=800.0, samples=8001, outputs=("angles", "rates"))
    result = run("exudyn_tree/rk67", scene, step=1e-2)
    assert len(result.time) == scene.samples
    _, exact = exact_rotor_angle(scene, result.time)
    assert np.abs(result.angles[:, 0] - exact).max() < 1e-6
