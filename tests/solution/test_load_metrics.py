"""Loads among a run's numbers, in its judgement, in its dataset and in its file."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

import rotor_mbs as rm
from rotor_mbs.analysis.judgement import judge
from rotor_mbs.errors import InputError
from rotor_mbs.methods.solve import solve
from rotor_mbs.scenario.catalogue import find_scenes
from rotor_mbs.solution.metrics import metrics_of
from rotor_mbs.solution.quantities import LOADS
from rotor_mbs.solution.solution import Solution

SCENE = replace(find_scenes(["check/loads"])[0], duration=0.2, samples=41)


@pytest.fixture(scope="module")
def run() -> Solution:
    return solve("lagrange/dop853", SCENE, {})


def test_the_largest_loads_with_their_times_and_blades(run: Solution) -> None:
    metrics = metrics_of(SCENE, run.trajectory, None)
    forces = np.linalg.norm(run.blade_root_force, axis=2)
    sample, blade = np.argwhere(forces == forces.max())[0]
    assert metrics["blade_root_force_max"] == forces.max()
    assert metrics["blade_root_force_max_time_s"] == run.time[sample]
    assert metrics["blade_root_force_max_blade"] == blade + 1
    assert metrics["shaft_moment_max"] == np.linalg.norm(run.shaft_moment, axis=1).max()
    assert "shaft_moment_max_blade" not in metrics
    assert metrics["pitch_actuator_moment_max"] == np.abs(run.pitch_actuator_moment).max()


@pytest.mark.parametrize("load", [load.name for load in LOADS])
def test_a_load_that_is_off_is_inaccurate(run: Solution, load: str) -> None:
    """By a millionth of the largest force (at the arm): a hundred thousand times the bound, not yet another motion."""
    exact, metric = run.trajectory, f"{load}_error"
    result = judge(SCENE, run, exact)
    assert (result.status, result.metrics[metric]) == ("ok", 0.0)
    force = np.linalg.norm(exact.blade_root_force, axis=2).max() * (1.0 if load.endswith("force") else 6.0)
    for share, is_false in ((1e-6, False), (0.1, True)):
        wrong = exact.get(load).copy()
        wrong[20].flat[0] += share * force
        result = judge(SCENE, replace(run, trajectory=exact.replace(**{load: wrong})), exact)
        assert result.status == "inaccurate"
        assert load.replace("_", " ") in result.message
        assert result.metrics[metric] == pytest.approx(share, rel=0.1)
        assert result.false_success is is_false


def test_loads_are_drawn_from_python() -> None:
    """A panel per axis with a line per blade, in the unit of its label; of the shaft a line per axis."""
    run = rm.run(SCENE, "lagrange/dop853")
    roots, shaft = run.plot.loads(), run.plot.loads("shaft_moment")
    assert [len(axes.lines) for axes in roots.axes] == [4, 4, 4]
    assert "kN" in roots.axes[1].get_ylabel()
    assert roots.axes[1].lines[3].get_ydata() == pytest.approx(1e-3 * run.blade_root_force[:, 3, 1], rel=1e-15)
    assert [len(axes.lines) for axes in shaft.axes] == [3]
    with pytest.raises(InputError, match="no load 'angles'"):
        run.plot.loads("angles")
