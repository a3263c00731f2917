"""What the suite finds beside its runs: which records are wanted, which are there already, the rest as they come.

Every finished record is a file of its own in `<output>.records` until all are merged, so that an interrupted suite goes
on where it stopped.
"""

from __future__ import annotations

import hashlib
import json
import shutil
from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path

from rotor_mbs.analysis.stability import Cell
from rotor_mbs.execution.environment import fingerprint, machine, versions
from rotor_mbs.execution.pool import run_tasks
from rotor_mbs.methods.catalogue import find_method
from rotor_mbs.scenario.scene import Scene, scene_hash
from rotor_mbs.store.merge import merge
from rotor_mbs.store.read import open_results
from rotor_mbs.store.records import Record, read_records, write_records
from rotor_mbs.studies.conservation import ConservationTask, perform_conservation
from rotor_mbs.studies.step_limits import StepTask, has_limit, perform_steps

Task = StepTask | ConservationTask

# A ladder takes a few times its longest run; what is over this is stuck.
_TASK_LIMIT_S = 60.0
# Scenes on which conservation is looked at: one without gravity, one regular with it.
_SYMMETRY_SCENES = ("extreme/zero-gravity", "extreme/light-1e-2")
_DRIFT = ("extreme/zero-gravity", "lagrange/taylor")
_KINDS = ("steps", "limits", "conservation")
# Whose text decides a record, besides what decides a run.
_NUMERICS = ("scenario", "solution", "methods", "models", "analysis", "studies")


def complete_records(
    scenes: Sequence[Scene], methods: Mapping[str, Sequence[str]], found: Sequence[Cell], output: Path, jobs: int
) -> None:
    """Makes the records that `output` lacks for these scenes and runs, and merges them into it.

    Those of other scenes stay; those of these scenes that were made from other numbers or by other code go. A task that
    hangs or dies costs its own record alone. Raises StoreError, KeyboardInterrupt.
    """
    tasks: list[Task] = [*_step_tasks(scenes, found, output), *_conservation_tasks(scenes, methods)]
    folder = output.with_name(f"{output.name}.records")
    references = _reference_hashes(output)
    pieces = {_key(task, references): task for task in tasks}
    stored = read_records(output, *_KINDS)
    names = {scene.name for scene in scenes}
    kept = [record for record in stored if record.scene not in names or record.key in pieces]
    there = {record.key for record in kept}
    missing: list[Task] = [
        replace(task, piece=folder / f"{key}.h5")
        for key, task in pieces.items()
        if key not in there and not (folder / f"{key}.h5").exists()
    ]
    for _ in run_tasks(perform, missing, jobs, _TASK_LIMIT_S):
        pass
    made = [record for key in pieces for record in _piece_records(folder / f"{key}.h5")]
    if made or len(kept) < len(stored):
        write_records(folder / "all.h5", made)
        stale = {record.key for record in stored} - there
        merge(output, [output, folder / "all.h5"], {**versions(), **machine()}, stale)
    shutil.rmtree(folder, ignore_errors=True)


def perform(task: Task) -> None:
    """Makes a task's record and stores it as its piece, atomically, in a worker process."""
    record = perform_steps(task) if isinstance(task, StepTask) else perform_conservation(task)
    assert task.piece is not None  # its maker names it
    write_records(task.piece, [replace(record, attributes={**record.attributes, "run_hash": task.piece.stem})])


def _step_tasks(scenes: Sequence[Scene], found: Sequence[Cell], results: Path) -> list[StepTask]:
    """Ladders where a fixed step may matter: the stiff and light scenes, and whatever did not hold at its default."""
    by_name = {scene.name: scene for scene in scenes}
    tasks = []
    for cell in found:
        scene = by_name.get(cell.scene)
        if scene is None or not find_method(cell.method).fixed_step or not cell.has_reference:
            continue
        if cell.is_stiff_or_light or cell.status in ("inaccurate", "diverged", "solver_failed"):
            tasks.append(StepTask("steps", scene, cell.method, results))
        if has_limit(scene, cell.method):
            tasks.append(StepTask("limits", scene, cell.method, results))
    return tasks


def _conservation_tasks(scenes: Sequence[Scene], methods: Mapping[str, Sequence[str]]) -> list[ConservationTask]:
    return [
        ConservationTask("drift" if (scene.name, method) == _DRIFT else "symmetry", scene, method)
        for scene in scenes
        if scene.name in _SYMMETRY_SCENES
        for method in methods[scene.name]
    ]


def _key(task: Task, references: Mapping[str, str]) -> str:
    settings = {name: str(value) for name, value in find_method(task.method).defaults.items()}
    number, reference = scene_hash(task.scene), references.get(task.scene.name, "")
    content = [task.kind, number, task.method, settings, reference, versions(), fingerprint(*_NUMERICS)]
    return hashlib.sha256(json.dumps(content, sort_keys=True).encode()).hexdigest()[:32]


def _reference_hashes(output: Path) -> dict[str, str]:
    with open_results(output) as results:
        runs = [scene.reference for scene in results.scenes.values()]
        return {run.scene: str(run.attributes.get("run_hash", "")) for run in runs if run is not None}


def _piece_records(piece: Path) -> list[Record]:
    return read_records(piece) if piece.exists() else []
