"""Random scene files, sweep files and damaged stored files: whatever they hold, a command answers in order.

The long forms (10,000 scenes, 2,000 sweeps, 1,000 damaged files): `pytest -m nightly tests/fuzz`.
"""

from __future__ import annotations

from collections import Counter
from contextlib import closing
from pathlib import Path

import pytest
from support.fuzzing import answers, damaged, scene_text, sweep_text, tried, write
from support.scenes import paper

from rotor_mbs.cli import main
from rotor_mbs.errors import InputError
from rotor_mbs.runs.cluster import open_task_pool
from rotor_mbs.runs.results import Asked, extend_file, results_tables
from rotor_mbs.runs.sweeps import StoredSweep
from rotor_mbs.runs.table import MISSING, text_of
from rotor_mbs.scenario.scene import parse_scene, scene_toml
from rotor_mbs.scenario.sweep import load_sweep
from rotor_mbs.solution.status import STATUSES
from rotor_mbs.studies.run import RunTask, able_methods, selected_methods
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
    """Shown, chosen for, and run by one method: nothing but a status, or a refusal with its reason."""
    statuses: Counter[object] = Counter()
    faults: list[str] = []
    for seed in range(first, first + count):
        path = write(tmp_path / "scene.toml", scene_text(seed))
        status, fault = answers(["show", str(path)], (0, 2))
        statuses[f"shown {status}"] += 1
        if status == 0 and not fault:
            fault = _run_fault(parse_scene(path.read_text(), "scene"), METHODS[seed % len(METHODS)], tmp_path, statuses)
        if fault:
            faults.append(f"seed {seed}: {fault}")
    print(tried(statuses, faults))
    assert not faults, tried(statuses, faults)


def _run_fault(scene: object, method: str, folder: Path, statuses: Counter[object]) -> str:
    try:
        selected_methods([scene])
        if able_methods(scene, [method])[0]:
            (folder / "r.h5").unlink(missing_ok=True)
            asked = Asked(scene, method)
            place = extend_file(folder / "r.h5", results_tables([asked])).place(asked.run)
            row = RunTask(label="", method=method, place=place, asked=asked, time_limit_s=_LIMIT_S).perform()
            place.write(row)
            statuses[STATUSES[int(row["status"][0])]] += 1
            message = text_of(row["message"][0])
            if "Error: " in message.partition(" ")[0] + " ":
                return f"{method}: {message}"
    except InputError as exc:
        return f"{method}: {exc}" if not str(exc) else ""
    except Exception as exc:
        import traceback

        return f"{method}: {type(exc).__name__}: {traceback.format_exc()[-700:]}"
    return ""


@pytest.mark.parametrize(
    ("first", "count"), [(0, 30), pytest.param(0, 2_000, marks=pytest.mark.nightly)], ids=["short", "long"]
)
def test_sweeps(tmp_path: Path, first: int, count: int) -> None:
    """Made by a worker process, which is ended where a run never ends; then read, and verified."""
    write(tmp_path / "base.toml", scene_toml(paper("fig11", samples=11, duration=0.1)))
    statuses: Counter[object] = Counter()
    faults: list[str] = []
    with closing(open_task_pool("local", 1)) as pool:
        for seed in range(first, first + count):
            path = write(tmp_path / "sweep.toml", sweep_text(seed, "base.toml"))
            try:
                result = run_sweep(plan_sweep(load_sweep(path), time_limit_s=_LIMIT_S), tmp_path / f"{seed}.h5", pool)
                found = StoredSweep(result.path).column("status")
                statuses.update(STATUSES[code] for code in found.tolist())
                if result.lost or (found == MISSING).any():
                    faults.append(f"seed {seed}: {'; '.join(result.lost)}")
                result.path.unlink()
            except InputError as exc:
                statuses["refused"] += 1
                if not str(exc):
                    faults.append(f"seed {seed}: refused without a reason")
            except Exception as exc:
                faults.append(f"seed {seed}: {type(exc).__name__}: {exc}")
    print(tried(statuses, faults))
    assert not faults, tried(statuses, faults)


@pytest.mark.parametrize(
    ("first", "count"), [(0, 40), pytest.param(0, 1_000, marks=pytest.mark.nightly)], ids=["short", "long"]
)
def test_damaged_files(tmp_path: Path, first: int, count: int) -> None:
    """Checked and reported: a verdict, or one line with the reason; never an exception."""
    scene = write(tmp_path / "a.toml", scene_toml(paper("fig11", samples=11, duration=0.1)))
    whole, study = tmp_path / "whole.h5", tmp_path / "study.h5"
    assert main(["run", str(scene), "-m", "lagrange/dop853", "-o", str(whole), "-j", "1"]) == 0
    axis = '[[axis]]\nkey = "initial.angles[1]"\nvalues = [0.1, 0.2]\n'
    sweep = write(tmp_path / "s.toml", f'title = "s"\nscene = "a.toml"\nmethods = ["lagrange/dop853"]\n{axis}')
    assert main(["sweep", str(sweep), "-o", str(study), "-j", "1"]) == 0
    statuses: Counter[object] = Counter()
    faults: list[str] = []
    broken = tmp_path / "broken.h5"
    for seed in range(first, first + count):
        broken.write_bytes(damaged((whole, study)[seed % 2].read_bytes(), seed))
        command = (["check", str(broken)], ["report", str(broken), "-o", str(tmp_path / "report")])[seed // 2 % 5 == 0]
        status, fault = answers(command)
        statuses[f"{command[0]} {status}"] += 1
        if fault:
            faults.append(f"seed {seed}: {fault}")
    print(tried(statuses, faults))
    assert not faults, tried(statuses, faults)
