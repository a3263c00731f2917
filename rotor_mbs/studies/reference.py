"""References in quad precision, recomputed and stored as they are frozen: without what follows from them.

The digests of their arrays stand in a text file beside each file of references: a changed number is found and located.
"""

from __future__ import annotations

from collections.abc import Sequence
from datetime import UTC, datetime
from pathlib import Path

from rotor_mbs.errors import InputError, StoreError
from rotor_mbs.methods.catalogue import REFERENCE
from rotor_mbs.runs.design import FROZEN, Asked
from rotor_mbs.runs.output_files import locked, replace_file
from rotor_mbs.runs.read import OpenResults, open_results
from rotor_mbs.runs.runner import OnProgress, ignore_progress
from rotor_mbs.runs.table import array_digest, extend_file, runs_table, scene_table
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
    """The reference of every scene into the file `output`, which is replaced as a whole, and its digests beside it.

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
    """The arrays of every reference that are `FROZEN` into the file `target`, and the digests beside it."""
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
    with open_results(target) as frozen:
        lines = [f"{digest}  {scene} {name}\n" for (scene, name), digest in _digests(frozen).items()]
    replace_file(target.with_suffix(".sha256"), "".join(lines).encode(), rb"\A[0-9a-f]{64}  \S+ \w+\n")


def changed_arrays(results: OpenResults) -> dict[str, list[str]]:
    """By scene, the arrays of its reference that are not what was frozen, are new or are gone; [] where all is well.

    Raises StoreError where there is no digest file.
    """
    path = results.path.with_suffix(".sha256")
    try:
        rows = [line.split() for line in path.read_text().splitlines()]
    except (OSError, UnicodeDecodeError) as exc:
        raise StoreError(f"{path}: cannot be read ({exc}); `rotor-mbs reference` writes it") from exc
    frozen = {(row[1], row[2]): row[0] for row in rows if len(row) == 3}
    present = _digests(results)
    scenes: dict[str, list[str]] = {}
    for scene, name in {**present, **frozen}:
        changed = scenes.setdefault(scene, [])
        if frozen.get((scene, name)) != present.get((scene, name)):
            changed.append(name)
    return scenes


def _digests(results: OpenResults) -> dict[tuple[str, str], str]:
    references = [scene.reference for scene in results.scenes.values()]
    return {
        (run.scene, name): array_digest(run.array(name)) for run in references if run is not None for name in run.names
    }


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
