"""`stability`: every method on the stiff and extreme scenes, step limits, conservation, and the map of it all."""

from __future__ import annotations

import argparse
import sys
import time
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import TypeVar

from rotor_mbs.analysis.stability import Cell, cells, summary_lines, unreached
from rotor_mbs.cli.batch import Batch, default_methods, execute
from rotor_mbs.cli.conservation import ConservationTask, perform_conservation
from rotor_mbs.cli.step_limits import FIXED_STEP, StepTask, has_limit, perform_steps
from rotor_mbs.models.registry import METHOD_NAMES
from rotor_mbs.runner.environment import machine, versions
from rotor_mbs.runner.pool import run_tasks
from rotor_mbs.runner.progress import Progress
from rotor_mbs.scenario.catalogue import find_scenes
from rotor_mbs.scenario.scene import Scene
from rotor_mbs.store.merge import merge
from rotor_mbs.store.stability import Record, read_records, write_records
from rotor_mbs.trajectory.outcome import is_held

SUITE = ("stiff", "extreme")

# A ladder takes a few times its longest run; what is over this is stuck.
_TASK_LIMIT_S = 60.0
# Scenes on which conservation is looked at: one without gravity, one regular with it.
_SYMMETRY_SCENES = ("extreme/zero-gravity", "extreme/light-1e-2")
_DRIFT_SCENE, _DRIFT_METHOD = "extreme/zero-gravity", "lagrange/taylor"

T = TypeVar("T")


def stability(arguments: argparse.Namespace) -> int:
    """The suite into one file, then its report. 1 where a claim of the suite fails: see `unreached`."""
    start = time.monotonic()
    scenes = find_scenes(arguments.scenes or SUITE)
    names = [name for name in METHOD_NAMES if is_held(name)]
    methods = {scene.name: default_methods(scene, names)[0] for scene in scenes}
    output: Path = arguments.output
    batch = execute(Batch(scenes, methods, output, arguments.jobs, arguments.timeout))
    found = cells(output)
    if batch.made or not read_records(output):
        records = _steps(scenes, found, output, arguments.jobs) + _conservation(scenes, methods, arguments.jobs)
        _store(output, records)
        found = cells(output)
    _tell(found)
    print(f"{output}: {len(scenes)} scenes, {len(found)} runs, {time.monotonic() - start:.0f} s in all")
    print(f"report: {_report(output, arguments)}")
    missing = unreached(found)
    for scene in missing:
        print(f"{scene}: no method reaches 1e-6 rad", file=sys.stderr)
    return 1 if missing else 0


def _steps(scenes: Sequence[Scene], found: Sequence[Cell], results: Path, jobs: int) -> list[Record]:
    """Ladders where a fixed step may matter: the stiff and light scenes, and whatever did not hold at its default."""
    by_name = {scene.name: scene for scene in scenes}
    tasks = []
    for cell in found:
        scene = by_name.get(cell.scene)
        if scene is None or cell.method not in FIXED_STEP or not cell.has_reference:
            continue
        if cell.is_stiff_or_light or cell.status in ("inaccurate", "diverged", "solver_failed"):
            tasks.append(StepTask("steps", scene, cell.method, results))
        if has_limit(scene, cell.method):
            tasks.append(StepTask("limits", scene, cell.method, results))
    return _collect(perform_steps, tasks, jobs)


def _conservation(scenes: Sequence[Scene], methods: Mapping[str, Sequence[str]], jobs: int) -> list[Record]:
    tasks = [
        ConservationTask("symmetry", scene, method)
        for scene in scenes
        if scene.name in _SYMMETRY_SCENES
        for method in methods[scene.name]
    ]
    records = _collect(perform_conservation, tasks, jobs)
    drift = [
        ConservationTask("drift", scene, _DRIFT_METHOD)
        for scene in scenes
        if scene.name == _DRIFT_SCENE and _DRIFT_METHOD in methods[scene.name]
    ]
    by_name = {record.name: record for record in records}
    for record in _collect(perform_conservation, drift, jobs):
        before = by_name.get(record.name)
        attributes = {**(before.attributes if before else {}), **record.attributes}
        by_name[record.name] = Record(record.kind, record.name, attributes, record.arrays)
    return list(by_name.values())


def _collect(work: Callable[[T], Record], tasks: Sequence[T], jobs: int) -> list[Record]:
    """The records of all tasks that end; one that hangs or dies costs its own record alone."""
    progress = Progress(len(tasks))
    records = []
    for finished in run_tasks(work, tasks, jobs, _TASK_LIMIT_S):
        what = f"{finished.task.scene.name} {finished.task.method} {finished.task.kind}"  # type: ignore[attr-defined]
        progress.tell(f"{what} {finished.failure} {finished.message}".strip(), keep=bool(finished.failure))
        if finished.value is not None:
            records.append(finished.value)
    progress.close()
    return sorted(records, key=lambda record: (record.kind, record.name))


def _store(output: Path, records: Sequence[Record]) -> None:
    """Into the results file; records of scenes that this call did not run stay."""
    made = {(record.kind, record.name) for record in records}
    kept = [record for record in read_records(output) if (record.kind, record.name) not in made]
    piece = output.with_name(f"{output.name}.stability")
    write_records(piece, [*kept, *records])
    merge(output, [output, piece], {**versions(), **machine()})
    piece.unlink()


def _tell(found: Sequence[Cell]) -> None:
    for line in summary_lines(found):
        print(line)


def _report(output: Path, arguments: argparse.Namespace) -> Path:
    from rotor_mbs.report.stability_page import write_stability_report

    folder = arguments.report or output.with_name(f"{output.stem}-report")
    return write_stability_report(output, folder)
