"""Random scene files and sweep files: whatever they hold, a command answers in order.

The long forms (10,000 scenes, 2,000 sweeps): `pytest -m nightly tests/fuzz`.
"""

from __future__ import annotations

from collections.abc import Iterable
from contextlib import closing
from pathlib import Path

import pytest
from support.fuzzing import outcome, outcome_of_call, scene_text, sweep_text, try_all, write
from support.scenes import paper

import rotor_mbs as rm
from rotor_mbs.runs.cluster import open_task_pool
from rotor_mbs.runs.design import MISSING
from rotor_mbs.runs.sweeps import StoredSweep
from rotor_mbs.scenario.scene import parse_scene, scene_toml
from rotor_mbs.scenario.sweep import load_sweep
from rotor_mbs.solution.status import STATUSES
from rotor_mbs.studies.sweep import plan_sweep, run_sweep

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


@pytest.mark.parametrize(
    "seeds", [range(30), pytest.param(range(2_000), marks=pytest.mark.nightly)], ids=["short", "long"]
)
def test_sweeps(tmp_path: Path, seeds: Iterable[int]) -> None:
    """Made by a worker process, which is ended where a run never ends; then read, and verified."""
    write(tmp_path / "base.toml", scene_toml(paper("fig11", samples=11, duration=0.1)))

    def sweep(seed: int) -> list[str]:
        path = write(tmp_path / "sweep.toml", sweep_text(seed, "base.toml"))

        def run() -> str:
            result = run_sweep(plan_sweep(load_sweep(path), time_limit_s=_LIMIT_S), tmp_path / f"{seed}.h5", pool)
            statuses = StoredSweep(result.path).column("status")
            assert not result.lost
            assert not (statuses == MISSING).any()
            result.path.unlink()
            return " ".join(sorted({STATUSES[code] for code in statuses.tolist()}))

        return [outcome_of_call(run)]

    with closing(open_task_pool("local", 1)) as pool:
        try_all(seeds, sweep)
