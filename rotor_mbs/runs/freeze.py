"""Frozen references, the files under `reference/`: what cannot be computed again cheaply, with digests of its arrays.

The digests stand in a text file beside each file of references: a changed number is found and located.
"""

from __future__ import annotations

from pathlib import Path

from rotor_mbs.errors import StoreError
from rotor_mbs.methods.catalogue import REFERENCE
from rotor_mbs.runs import files
from rotor_mbs.runs.digests import array_digest
from rotor_mbs.runs.read import OpenResults, open_results
from rotor_mbs.runs.write import put_datasets
from rotor_mbs.solution.quantities import BUILT_IN, LOADS

# What cannot be computed again from angles and rates as precisely, and the scales.
_SCALES = ("time", "coordinate", "blade", "axis")
KEPT = (*_SCALES, "angles", "rates", "work", *(load.name for load in LOADS), "angle_uncertainty", "error_growth")
_ATTRIBUTES = ("settings", "steps", "time_reached", "setup_time_s", "run_time_s", "output_time_s", "status")


def freeze(source: Path, target: Path, date: str) -> None:
    """Angles, rates, loads, uncertainty and growth of every reference in `source` into `target`; digests too.

    Tip and energies follow from angles and rates. The work is kept only where it does not. Raises StoreError.
    """
    with open_results(source) as results, files.new_file(target) as file:
        for scene in results.scenes.values():
            reference = scene.reference
            if reference is None:
                continue
            files.put_attributes(files.new_group(file, scene.name), scene.attributes)
            group = files.new_group(file, f"{scene.name}/{REFERENCE}")
            arrays = {name: reference.array(name) for name in KEPT if name in reference}
            put_datasets(group, arrays, BUILT_IN, reference.labels)
            facts = {name: reference.attributes[name] for name in _ATTRIBUTES}
            made = f"heyoka {results.attributes['heyoka']}, {date}"
            files.put_attributes(group, {**facts, "frozen_with": made})
    write_digests(target)


def write_digests(references: Path) -> None:
    """`paper.sha256` beside `paper.h5`, atomically: a line "digest  scene channel" for every array of every reference.

    Raises StoreError.
    """
    with open_results(references) as results:
        lines = [f"{digest}  {scene} {name}\n" for (scene, name), digest in _digests(results).items()]
    files.replace_file(references.with_suffix(".sha256"), "".join(lines).encode())


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
    found = _digests(results)
    scenes: dict[str, list[str]] = {}
    for scene, name in {**found, **frozen}:
        changed = scenes.setdefault(scene, [])
        if frozen.get((scene, name)) != found.get((scene, name)):
            changed.append(name)
    return scenes


def _digests(results: OpenResults) -> dict[tuple[str, str], str]:
    references = [scene.reference for scene in results.scenes.values()]
    return {
        (run.scene, name): array_digest(run.array(name)) for run in references if run is not None for name in run.names
    }
