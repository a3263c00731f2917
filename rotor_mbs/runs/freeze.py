"""Frozen references, the files under `reference/`: what cannot be computed again cheaply, with digests of its arrays.

The digests stand in a text file beside each file of references: a changed number is found and located.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from rotor_mbs.errors import StoreError
from rotor_mbs.runs.digests import array_digest
from rotor_mbs.runs.files import replace_file
from rotor_mbs.runs.read import OpenResults, open_results
from rotor_mbs.runs.results import Asked, extend_file, repeat, runs_table, scene_table
from rotor_mbs.runs.table import blank_rows
from rotor_mbs.solution.quantities import LOADS
from rotor_mbs.solution.status import code_of

# What cannot be computed again from angles and rates as precisely.
KEPT = ("angles", "rates", "work", *(load.name for load in LOADS), "angle_uncertainty", "error_growth")
_FACTS = ("steps", "time_reached", "setup_time_s", "run_time_s", "output_time_s")


def write_references(
    target: Path, references: Sequence[tuple[Asked, Mapping[str, Any], Mapping[str, np.ndarray[Any, Any]]]]
) -> None:
    """A file of references, and the digests beside it.

    Parameters
    ----------
    references : of each what it is, its facts (status, steps, times), and its arrays over time, those of `KEPT`.

    Raises
    ------
    StoreError
        Where they cannot be written.
    """
    target.unlink(missing_ok=True)
    tables = [scene_table([asked], arrays=arrays.keys() & set(KEPT)) for asked, _, arrays in references]
    file = extend_file(target, [runs_table([asked for asked, _, _ in references]), *tables])
    for asked, facts, arrays in references:
        place = file.place(asked.run)
        row = blank_rows(1, place.row)
        row["status"][0], row["samples"][0] = code_of(str(facts["status"])), len(arrays["angles"])
        for name in _FACTS:
            row[name][0] = facts[name]
        for name, values in arrays.items():
            if name in row:
                row[name][0, : len(values)] = values
        repeat(row)
        place.write(place.first, row)
    write_digests(target)


def write_digests(references: Path) -> None:
    """`paper.sha256` beside `paper.h5`, atomically: a line "digest  scene channel" for every array of every reference.

    Raises StoreError.
    """
    with open_results(references) as results:
        lines = [f"{digest}  {scene} {name}\n" for (scene, name), digest in _digests(results).items()]
    replace_file(references.with_suffix(".sha256"), "".join(lines).encode())


def changed_arrays(results: OpenResults) -> dict[str, list[str]]:
    """By scene, the arrays of its reference that are not what was frozen, are new or are gone; [] where all is well.

    Raises
    ------
    StoreError
        Where there is no digest file.
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
