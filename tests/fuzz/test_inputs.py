"""Random scene files: whatever they hold, a command answers in order. The long form, 10,000 scenes: `-m nightly`."""

from __future__ import annotations

from collections.abc import Iterable
from pathlib import Path

import pytest
from support.fuzzing import outcome, outcome_of_call, scene_text, try_all, write

import rotor_mbs as rm
from rotor_mbs.scenario.scene import parse_scene

pytestmark = pytest.mark.full
METHODS = ("lagrange/dop853", "lagrange/radau", "exudyn_tree/rk44", "exudyn_tree/dopri5", "printed/ode45", "mujoco/rk4")
METHODS += ("exudyn_chain/generalized_alpha", "lagrange/ode45")
_LIMIT_S = 0.2


@pytest.mark.parametrize(
    "seeds", [range(40), pytest.param(range(10_000), marks=pytest.mark.nightly)], ids=["short", "long"]
)
def test_scenes(tmp_path: Path, seeds: Iterable[int]) -> None:
    """Shown, and run by one method: nothing but a status, or a refusal with its reason."""

    def show_and_run(seed: int) -> list[str]:
        path = write(tmp_path / "scene.toml", scene_text(seed))
        shown = outcome("show", path, allowed=(0, 2))

        def run() -> str:
            scene = parse_scene(path.read_text(), "scene")
            run = rm.run(scene, METHODS[seed % len(METHODS)], timeout=_LIMIT_S)
            assert "Error: " not in run.message, run.message  # an exception of the code in place of a reason
            return run.status

        return [shown, outcome_of_call(run)]

    try_all(seeds, show_and_run)
