"""References in quad precision, computed anew and stored as they are frozen: without what follows from them."""

from __future__ import annotations

from collections.abc import Sequence
from datetime import UTC, datetime
from pathlib import Path

from rotor_mbs.errors import InputError
from rotor_mbs.runs.freeze import freeze
from rotor_mbs.runs.lock import writing
from rotor_mbs.runs.read import open_results
from rotor_mbs.runs.results_file import refuse_other_kinds
from rotor_mbs.runs.runner import OnProgress, ignore_progress
from rotor_mbs.scenario.scene import Scene
from rotor_mbs.studies.run import RunReport, run_scenes


def compute_references(
    scenes: Sequence[Scene],
    output: Path,
    *,
    workers: int,
    timeout_s: float,
    on_progress: OnProgress = ignore_progress,
) -> RunReport:
    """The reference of every scene into the file `output`, which is replaced as a whole, and its digests beside it.

    Raises InputError where `output` has something else, StoreError.
    """
    full = output.with_name(f"{output.name}.full.h5")
    none: dict[str, Sequence[str]] = {scene.name: () for scene in scenes}
    with writing(output):
        _refuse_other_contents(output, {scene.name for scene in scenes})
        report = run_scenes(
            scenes, none, full, workers=workers, timeout_s=timeout_s, use_frozen=False, on_progress=on_progress
        )
        if not report.not_computed:
            freeze(full, output, datetime.now(UTC).date().isoformat())
            full.unlink()
    return report


def _refuse_other_contents(path: Path, wanted: set[str]) -> None:
    refuse_other_kinds(path)
    if not path.exists():
        return
    with open_results(path) as results:
        kept = [scene.name for scene in results.scenes.values() if scene.methods or scene.name not in wanted]
    if kept:
        raise InputError(
            f"{path}: has {', '.join(kept)}, which would be dropped; allowed: another output file, or a file of "
            "references of these scenes alone"
        )
