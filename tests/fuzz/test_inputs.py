"""Random scene files and sweep files: whatever they hold, a command answers in order.

The long forms (10,000 scenes, 2,000 sweeps): `pytest -m nightly tests/fuzz`.
"""

from __future__ import annotations

import traceback
from collections import Counter
from contextlib import closing
from pathlib import Path

import pytest
from support.fuzzing import answers, scene_text, sweep_text, tried, write
from support.scenes import paper

import rotor_mbs as rm
from rotor_mbs.errors import InputError, MethodRefusal
from rotor_mbs.runs.cluster import open_task_pool
from rotor_mbs.runs.sweeps import StoredSweep
from rotor_mbs.runs.table import MISSING
from rotor_mbs.scenario.scene import parse_scene, scene_toml
from rotor_mbs.scenario.sweep import load_sweep
from rotor_mbs.solution.status import STATUSES
from rotor_mbs.studies.sweep import plan_sweep, run_sweep

pytestmark = pytest.mark.full
METHODS = ("lagrange/dop853", "lagrange/radau", "exudyn_tree/rk44", "exudyn_tree/dopri5", "printed/ode45", "mujoco/rk4")
METHODS += ("exudyn_chain/generalized_alpha", "lagrange/ode45")
_LIMIT_S = 0.2


@pytest.mark.parametrize(
    ("first", "count"),
    [(0, 40), (9119, 1), pytest.param(0, 10_000, marks=pytest.mark.nightly)],
    ids=["short", "a speed beyond double precision", "long"],
)
def test_scenes(tmp_path: Path, first: int, count: int) -> None:
    """Shown, and run by one method: nothing but a status, or a refusal with its reason."""
    outcomes: Counter[object] = Counter()
    faults: list[str] = []
    for seed in range(first, first + count):
        path, method = write(tmp_path / "scene.toml", scene_text(seed)), METHODS[seed % len(METHODS)]
        status, fault = answers(["show", str(path)], (0, 2))
        outcomes[f"shown {status}"] += 1
        try:
            if status == 0 and not fault:
                run = rm.run(parse_scene(path.read_text(), "scene"), method, timeout=_LIMIT_S)
                outcomes[run.status] += 1
                if "Error: " in run.message:  # an exception of the code in place of a reason
                    fault = f"{method}: {run.message}"
        except (InputError, MethodRefusal) as exc:
            fault = "" if str(exc) else f"{method}: refused without a reason"
        except Exception:
            fault = f"{method}: {traceback.format_exc()[-700:]}"
        if fault:
            faults.append(f"seed {seed}: {fault}")
    print(tried(outcomes, faults))
    assert not faults, tried(outcomes, faults)


@pytest.mark.parametrize(
    ("first", "count"), [(0, 30), pytest.param(0, 2_000, marks=pytest.mark.nightly)], ids=["short", "long"]
)
def test_sweeps(tmp_path: Path, first: int, count: int) -> None:
    """Made by a worker process, which is ended where a run never ends; then read, and verified."""
    write(tmp_path / "base.toml", scene_toml(paper("fig11", samples=11, duration=0.1)))
    outcomes: Counter[object] = Counter()
    faults: list[str] = []
    with closing(open_task_pool("local", 1)) as pool:
        for seed in range(first, first + count):
            path = write(tmp_path / "sweep.toml", sweep_text(seed, "base.toml"))
            try:
                result = run_sweep(plan_sweep(load_sweep(path), time_limit_s=_LIMIT_S), tmp_path / f"{seed}.h5", pool)
                statuses = StoredSweep(result.path).column("status")
                outcomes.update(STATUSES[code] for code in statuses.tolist())
                if result.lost or (statuses == MISSING).any():
                    faults.append(f"seed {seed}: {'; '.join(result.lost)}")
                result.path.unlink()
            except InputError as exc:
                outcomes["refused"] += 1
                if not str(exc):
                    faults.append(f"seed {seed}: refused without a reason")
            except Exception as exc:
                faults.append(f"seed {seed}: {type(exc).__name__}: {exc}")
    print(tried(outcomes, faults))
    assert not faults, tried(outcomes, faults)
