"""References in quad precision, recomputed and stored as they are frozen: without what follows from them."""

from __future__ import annotations

from collections.abc import Sequence
from datetime import UTC, datetime
from pathlib import Path

from rotor_mbs.errors import InputError
from rotor_mbs.methods.catalogue import REFERENCE
from rotor_mbs.runs.design import FROZEN, Asked
from rotor_mbs.runs.output_files import locked
from rotor_mbs.runs.read import OpenResults, open_results
from rotor_mbs.runs.runner import OnProgress, ignore_progress
from rotor_mbs.runs.table import extend_file, runs_table, scene_table
from rotor_mbs.scenario.scene import Scene
from rotor_mbs.studies.run import RunReport, run_scenes

_FACTS = ("steps", "time_reached", "setup_time_s", "run_time_s", "output_time_s")


def compute_references(
    scenes: Sequence[Scene],
    output: Path,
    *,
    workers: int,
    timeout_s: float,
    on_progress: OnProgress = ignore_progress,
) -> RunReport:
    """The reference of every scene into the file `output`, which is replaced as a whole.

    Raises InputError where `output` has something else, StoreError where it cannot be read or written.
    """
    full = output.with_name(f"{output.name}.full.h5")
    none: dict[str, Sequence[str]] = {scene.name: () for scene in scenes}
    with locked(output):
        _refuse_other_contents(output, {scene.name for scene in scenes})
        report = run_scenes(
            scenes, none, full, workers=workers, timeout_s=timeout_s, use_frozen=False, on_progress=on_progress
        )
        if not report.not_computed:
            with open_results(full) as results:
                _freeze(scenes, results, output)
            full.unlink()
    return report


def _freeze(scenes: Sequence[Scene], results: OpenResults, target: Path) -> None:
    """The arrays of every reference that are `FROZEN` into the file `target`."""
    target.unlink(missing_ok=True)
    versions = {"frozen_with": f"heyoka {results.attributes['heyoka']}, {datetime.now(UTC).date().isoformat()}"}
    references = []
    for scene in scenes:
        run = results.scenes[scene.name].reference if scene.name in results.scenes else None
        if run is not None:
            references.append((Asked(scene, REFERENCE, versions=versions), run))
    tables = [scene_table([asked], arrays=[name for name in FROZEN if name in run]) for asked, run in references]
    file = extend_file(target, [runs_table([asked for asked, _ in references]), *tables])
    for asked, run in references:
        place = file.place(asked.label)
        values: dict[str, object] = {"status": run.status, "samples": run.samples}
        values |= {name: run.attributes[name] for name in _FACTS}
        values |= {name: run.array(name) for name in FROZEN if name in run}
        place.write(place.rows_of(values))


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
