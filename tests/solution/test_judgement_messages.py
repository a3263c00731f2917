"""Messages: where a run broke off and what its engine reported, and the items that the tree is listed with."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from support.rotors import FIG08
from support.scenes import paper

from rotor_mbs.analysis.judgement import judge
from rotor_mbs.models.exudyn import tree
from rotor_mbs.models.exudyn.moments import Loads
from rotor_mbs.scenario.scene import Scene
from rotor_mbs.solution.solution import Solution
from rotor_mbs.solution.trajectory import Integration, Trajectory

AT_REST = paper("fig05", duration=1.0, samples=11)


@pytest.mark.parametrize(
    ("rows", "success", "reported", "expected"),
    [
        (5, True, "", ("at t = 0.4 s of 1 s", "the engine reported success")),
        (5, False, "", ("at t = 0.4 s of 1 s", "no reason given")),
        (5, False, "step too small", ("at t = 0.4 s of 1 s", "step too small")),
        (0, False, "no start", ("at the start", "no start")),
    ],
)
def test_a_run_that_broke_off_names_time_and_reason(
    rows: int, success: bool, reported: str, expected: tuple[str, ...]
) -> None:
    time = np.linspace(0.0, 1.0, 11)[:rows]
    angles = np.tile(AT_REST.initial_angles, (rows, 1))
    trajectory = Trajectory(time, angles, np.zeros_like(angles))
    run = Solution(AT_REST, "lagrange/dop853", trajectory, Integration(success, reported))
    message = judge(AT_REST, run, None).message
    assert all(text in message for text in expected), message


BARE = replace(FIG08, gravity=0.0)


@pytest.mark.parametrize(
    ("scene", "words"),
    [
        (BARE, "4 links"),
        (FIG08, "4 links, gravity"),
        (replace(BARE, bearing_stiffness=(1.0, 0.0, 0.0)), "4 links, bearing stiffness"),
        (replace(BARE, shaft_damping=1.0), "4 links, damping"),
    ],
)
def test_the_tree_is_listed_with_what_it_has(scene: Scene, words: str) -> None:
    parts = tree.parts(scene, Loads(scene))
    assert next(part.detail for part in parts if part.type == "ObjectKinematicTree") == words
