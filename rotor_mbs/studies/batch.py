"""A batch: which runs are wanted, which are there already, the rest in parallel, all merged into one results file."""

from __future__ import annotations

import functools
import hashlib
import json
import shutil
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

from rotor_mbs.errors import InputError, MethodRefusal, RotorError, StoreError
from rotor_mbs.execution.environment import machine, numerics_fingerprint, versions
from rotor_mbs.execution.pool import Finished, run_tasks
from rotor_mbs.execution.progress import Progress
from rotor_mbs.methods.catalogue import REFERENCE, find_method
from rotor_mbs.scenario.resources import reference_folder
from rotor_mbs.scenario.scene import Scene, scene_hash
from rotor_mbs.solution.judgement import is_held
from rotor_mbs.store.merge import merge, refuse_other_kinds
from rotor_mbs.store.read import open_results
from rotor_mbs.studies.work import Summary, Task, perform, record_failure

_SLOW_MODELS = ("exudyn_chain", "printed", "exudyn_tree")


@dataclass(frozen=True)
class Batch:
    """What to run and where to put it.

    methods        by scene name
    use_frozen     whether a shipped reference may stand for a computed one
    also           writes a results file with what belongs into the output beside the runs
    """

    scenes: Sequence[Scene]
    methods: Mapping[str, Sequence[str]]
    output: Path
    workers: int
    timeout_s: float
    use_frozen: bool = True
    also: Callable[[Path], None] | None = None


@dataclass(frozen=True)
class Report:
    """How a batch went: every run made, and how many were there already."""

    made: list[tuple[Task, Summary]]
    kept: int

    @property
    def failures(self) -> list[tuple[Task, Summary]]:
        """Runs that should have succeeded and did not. How far the printed model gets is data, not a failure."""
        return [(task, summary) for task, summary in self.made if summary.status != "ok" and is_held(task.method)]

    @property
    def broken_off(self) -> list[tuple[Task, Summary]]:
        """Runs of the printed model that did not reach the end."""
        return [(task, summary) for task, summary in self.made if summary.status != "ok" and not is_held(task.method)]


def execute(batch: Batch) -> Report:
    """Runs what is missing and merges it into `batch.output`. Raises InputError, StoreError, KeyboardInterrupt.

    Every finished run is a file of its own in `<output>.parts` until the merge, so that an interrupted batch goes on
    where it stopped; the merged file replaces the old one in one step.
    """
    refuse_other_kinds(batch.output)
    parts = batch.output.with_name(batch.output.name + ".parts")
    _make_folder(parts)
    there = _hashes(batch.output) if batch.output.exists() else {}
    references = [_reference_task(batch, scene, parts) for scene in batch.scenes]
    runs = [
        _task(batch, scene, method, parts, reference, there)
        for scene, reference in zip(batch.scenes, references, strict=True)
        for method in batch.methods[scene.name]
    ]
    _refuse_losses(batch, [*references, *runs])
    made: list[tuple[Task, Summary]] = []
    missing = [
        sorted((task for task in wave if not _is_there(task, there)), key=_slowest_first) for wave in (references, runs)
    ]
    progress = Progress(sum(map(len, missing)))
    for wave in missing:
        for finished in run_tasks(perform, wave, batch.workers, _hard_limit(batch.timeout_s)):
            summary = _settle(finished)
            made.append((finished.task, summary))
            progress.tell(_line(finished.task, summary), keep=summary.status != "ok")
    progress.close()
    if batch.also is not None:
        batch.also(parts / "also.h5")
    if made or not batch.output.exists() or any(parts.iterdir()):
        sources = [batch.output] if batch.output.exists() else []
        merge(batch.output, [*sources, *sorted(parts.glob("*.h5"))], {**versions(), **machine()})
    shutil.rmtree(parts)
    return Report(made, len(references) + len(runs) - len(made))


def _slowest_first(task: Task) -> int:
    """So that no long run starts last and keeps one process busy while the others wait."""
    return _SLOW_MODELS.index(model) if (model := task.method.split("/")[0]) in _SLOW_MODELS else len(_SLOW_MODELS)


def _hard_limit(timeout_s: float) -> float:
    """When a process is ended from outside: what ends itself at its time limit needs a moment to write what it has."""
    return 1.2 * timeout_s + 10.0


def default_methods(scene: Scene, names: Iterable[str]) -> tuple[list[str], list[str]]:
    """Those of `names` that can represent the scene, and a line for each that cannot."""
    able, refused = [], []
    for name in names:
        try:
            find_method(name).items(scene)
            able.append(name)
        except MethodRefusal as exc:
            refused.append(f"{scene.name}: {name} left out: {exc}")
    return able, refused


def _settle(finished: Finished[Task, Summary]) -> Summary:
    if finished.value is not None:
        return finished.value
    if isinstance(finished.error, StoreError):
        raise finished.error
    status = "timed_out" if finished.failure == "timed_out" else "solver_failed"
    message = str(finished.error) if isinstance(finished.error, RotorError) else finished.message
    return record_failure(finished.task, status, message)


def _line(task: Task, summary: Summary) -> str:
    reason = f": {summary.message}" if summary.message else ""
    return f"{task.label} {summary.status} {summary.run_time_s:.3f} s{reason}"


def _make_folder(folder: Path) -> None:
    try:
        folder.mkdir(parents=True, exist_ok=True)
    except OSError as exc:
        raise StoreError(f"{folder.parent}: cannot be written: {exc.strerror}") from exc


def _hashes(path: Path) -> dict[tuple[str, str], str]:
    """run_hash of every run in a results file, by scene and method."""
    with open_results(path) as results:
        return {
            (scene.name, run.method): str(run.attributes.get("run_hash", ""))
            for scene in results.scenes.values()
            for run in scene.runs.values()
        }


def _is_there(task: Task, there: Mapping[tuple[str, str], str]) -> bool:
    """In the results file, or as a piece that an interrupted batch left (its name holds its hash)."""
    return there.get((task.scene.name, task.method)) == task.run_hash or task.piece.exists()


def _reference_task(batch: Batch, scene: Scene, parts: Path) -> Task:
    number = scene_hash(scene)
    frozen, stamp = _frozen_references().get(number, (None, "")) if batch.use_frozen else (None, "")
    run_hash = _run_hash(number, REFERENCE, stamp)
    piece = _piece(parts, scene, REFERENCE, run_hash)
    return Task(scene, number, REFERENCE, run_hash, piece, time_limit_s=batch.timeout_s, frozen=frozen)


def _task(
    batch: Batch, scene: Scene, method: str, parts: Path, reference: Task, there: Mapping[tuple[str, str], str]
) -> Task:
    run_hash = _run_hash(reference.scene_hash, method, reference.run_hash)
    merged = there.get((scene.name, REFERENCE)) == reference.run_hash
    source = batch.output if merged else reference.piece
    piece = _piece(parts, scene, method, run_hash)
    return Task(scene, reference.scene_hash, method, run_hash, piece, reference=source, time_limit_s=batch.timeout_s)


def _piece(parts: Path, scene: Scene, method: str, run_hash: str) -> Path:
    return parts / f"{scene.name}.{method}.{run_hash[:16]}.h5".replace("/", "-")


def _run_hash(number: str, method: str, reference: str) -> str:
    settings = {key: str(value) for key, value in find_method(method).DEFAULTS.items()}
    content = [number, method, settings, reference, versions(), numerics_fingerprint()]
    return hashlib.sha256(json.dumps(content, sort_keys=True).encode()).hexdigest()


@functools.cache
def _frozen_references() -> dict[str, tuple[Path, str]]:
    """scene_hash -> the shipped file that has its reference, and that file's digest."""
    found: dict[str, tuple[Path, str]] = {}
    for path in sorted(reference_folder().glob("*.h5")):
        digest = hashlib.sha256(path.read_bytes()).hexdigest()
        with open_results(path) as results:
            found |= {scene.attributes["scene_hash"]: (path, digest) for scene in results.scenes.values()}
    return found


def _refuse_losses(batch: Batch, tasks: Sequence[Task]) -> None:
    """Runs in the file of a scene whose numbers have changed would be dropped: only if this batch makes them anew."""
    if not batch.output.exists():
        return
    wanted = {(task.scene.name, task.method): task.scene_hash for task in tasks}
    numbers = {task.scene.name: task.scene_hash for task in tasks}
    with open_results(batch.output) as results:
        lost = [
            f"{batch.output}: {scene.name}: holds {run.method} of a scene of that name with other numbers, which this "
            "batch would drop; allowed: another output file, or a batch that has this method too"
            for scene in results.scenes.values()
            if numbers.get(scene.name, scene.attributes["scene_hash"]) != scene.attributes["scene_hash"]
            for run in scene.runs.values()
            if (scene.name, run.method) not in wanted
        ]
    if lost:
        raise InputError(lost)
