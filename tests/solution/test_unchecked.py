"""No run is ok that nothing was compared with, and none because of where its angles start."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from support.scenes import paper

from rotor_mbs.analysis.judgement import judge
from rotor_mbs.methods.solve import solve
from rotor_mbs.scenario.accuracy_bounds import Bound
from rotor_mbs.scenario.scene import Scene
from rotor_mbs.solution.metrics import ANGLE_LIMIT
from rotor_mbs.solution.solution import Solution
from rotor_mbs.solution.trajectory import Integration, Trajectory
from rotor_mbs.studies.run import solve_judged

METHOD = "lagrange/dop853"


def turned(scene: Scene, turns: float) -> Scene:
    """The same motion: the rotor starts whole turns further on."""
    return scene.replace(**{"initial.angles[0]": scene.initial_angles[0] + 2.0 * np.pi * turns})


@pytest.mark.parametrize(
    ("outputs", "status"), [(("angles",), "unchecked"), (("rates",), "unchecked"), (("angles", "rates"), "inaccurate")]
)
def test_a_wrong_motion_is_unchecked_where_nothing_can_tell(outputs: tuple[str, ...], status: str) -> None:
    """Errors of 2e-3 rad in a motion of 1e-3 rad: angles and rates together have defects."""
    scene = paper("fig08", duration=1.0, samples=11, outputs=outputs)
    time = np.linspace(0.0, 1.0, 11)
    angles = np.full((11, 4), 1e-3) * np.sin(time)[:, None]
    run = Solution(scene, METHOD, Trajectory(time, angles + 2e-3, np.zeros((11, 4))), Integration(True))
    verdict = judge(scene, run, None)
    assert verdict.status == status
    assert ("not angles and rates" in verdict.message) == (status == "unchecked")
    if "angles" in outputs:
        exact = Trajectory(time, angles + 0.1, np.zeros((11, 4)), error_growth=np.ones(11))
        assert judge(scene, run, exact).status == "inaccurate"


@pytest.mark.full
def test_two_samples_a_minute_apart_without_energy_are_unchecked() -> None:
    """Past the horizon at the second sample; with energies the balance decides."""
    scene = paper("fig11", duration=60.0, samples=2, outputs=("angles", "rates"))
    run = solve(METHOD, scene, {})
    assert judge(scene, run, run.trajectory.replace(error_growth=np.array([1.0, 1e9]))).status == "unchecked"
    assert solve_judged(scene.replace(outputs=("angles", "rates", "energy")), METHOD)[0].status == "ok"


@pytest.mark.parametrize("turns", [0, 1e5])
def test_a_start_turns_away_excuses_no_error(turns: float) -> None:
    """Errors are relative to how far the rotor turns and to the pitches, not to where the rotor's angle starts."""
    scene = turned(paper("fig11", duration=2.0, samples=21, outputs=("angles", "rates")), turns)
    exact = solve("reference", scene, {}).trajectory
    for column in (0, 2):
        angles = exact.angles.copy()
        angles[5:, column] += 1e-5
        wrong = Solution(scene, METHOD, exact.replace(angles=angles), Integration(True))
        assert judge(scene, wrong, exact).status == "inaccurate"
    assert judge(scene, solve("lagrange/taylor", scene, {}), exact).status == "ok"


@pytest.mark.parametrize("share", [0.9, 1.1])
def test_a_start_turns_away_leaves_ten_units_in_its_last_place_open(share: float) -> None:
    """Of what is beyond the first turn: the one thing that a method whose own bounds are zero may be off by."""
    scene = turned(paper("fig05", duration=1.0, samples=11), 2.0)
    slack = share * 10.0 * np.finfo(float).eps * (scene.initial_angles[0] - 2.0 * np.pi)
    exact = Trajectory(np.linspace(0.0, 1.0, 11), np.tile(scene.initial_angles, (11, 1)), np.zeros((11, 4)))
    weights = sum(blade.mass * scene.gravity * np.hypot(*blade.centre_of_mass[::2]) for blade in scene.blades)
    potential = np.zeros(11)
    potential[5] = slack * weights
    wrong = exact.replace(kinetic_energy=np.zeros(11), potential_energy=potential, work=np.zeros(11))
    bounds = (Bound("energy", METHOD, 0.0, "none"),)
    run = Solution(scene, METHOD, wrong, Integration(True), bounds=bounds)
    assert judge(scene, run, exact).status == ("ok" if share < 1.0 else "inaccurate")


def test_angles_without_digits_are_unchecked() -> None:
    """At 1e100 rad not even the reference has a sine that means anything."""
    scene = paper("fig03", duration=1.0, samples=11)
    far = replace(scene, initial_angles=(1e100, *scene.initial_angles[1:]))
    exact = solve("reference", far, {})
    verdict = judge(far, exact, exact.trajectory)
    assert verdict.status == "unchecked"
    assert f"up to {ANGLE_LIMIT:.0e} rad" in verdict.message
    assert judge(far, solve("exudyn_tree/rk67", far, {}), exact.trajectory).status != "ok"
