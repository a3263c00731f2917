"""References in quad precision, recomputed and stored as they are frozen: without what follows from them."""

from __future__ import annotations

from collections.abc import Sequence
from datetime import UTC, datetime
from pathlib import Path

from rotor_mbs.errors import InputError
from rotor_mbs.methods.catalogue import REFERENCE
from rotor_mbs.runs.freeze import KEPT, write_references
from rotor_mbs.runs.lock import writing
from rotor_mbs.runs.read import open_results
from rotor_mbs.runs.results import Asked
from rotor_mbs.scenario.scene import Scene
from rotor_mbs.studies.run import OnProgress, RunReport, ignore_progress, run_scenes


def compute_references(
    scenes: Sequence[Scene],
    output: Path,
    *,
    workers: int,
    timeout_s: float,
    on_progress: OnProgress = ignore_progress,
) -> RunReport:
    """The reference of every scene into the file `output`, which is replaced as a whole, and its digests beside it.

    Raises
    ------
    InputError
        Where `output` has something else.
    StoreError
        Where it cannot be read or written.
    """
    full = output.with_name(f"{output.name}.full.h5")
    none: dict[str, Sequence[str]] = {scene.name: () for scene in scenes}
    with writing(output):
        _refuse_other_contents(output, {scene.name for scene in scenes})
        report = run_scenes(
            scenes, none, full, workers=workers, timeout_s=timeout_s, use_frozen=False, on_progress=on_progress
        )
        if not report.not_computed:
            _freeze(scenes, full, output)
            full.unlink()
    return report


def _freeze(scenes: Sequence[Scene], source: Path, target: Path) -> None:
    """The kept arrays of every reference in `source` into `target`."""
    date = datetime.now(UTC).date().isoformat()
    references = []
    with open_results(source) as results:
        made_with = {"frozen_with": f"heyoka {results.attributes['heyoka']}, {date}"}
        for scene in scenes:
            run = results.scenes[scene.name].reference if scene.name in results.scenes else None
            if run is not None:
                arrays = {name: run.array(name) for name in KEPT if name in run}
                references.append((Asked(scene, REFERENCE, versions=made_with), run.attributes, arrays))
        write_references(target, references)


def _refuse_other_contents(path: Path, wanted: set[str]) -> None:
    if not path.exists():
        return
    with open_results(path) as results:
        kept = [scene.name for scene in results.scenes.values() if scene.methods or scene.name not in wanted]
        is_empty = not results.scenes
    if kept or is_empty:
        raise InputError(
            f"{path}: has {', '.join(kept) or 'no references'}, which would be dropped; allowed: another output file, "
            "or a file of references of these scenes alone"
        )
