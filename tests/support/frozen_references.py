"""Freezes references: of files that `rotor-mbs reference` writes the arrays that are shipped, and
their digests.

python tests/support/frozen_references.py references.h5 reference/paper.h5

Of several files before the last one each adds the scenes that the ones before it have not: new
scenes are added to a frozen file, whose arrays stay, by

python tests/support/frozen_references.py reference/paper.h5 references.h5 new.h5
"""

from __future__ import annotations

import hashlib
import json
import sys
from contextlib import ExitStack
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from rotor_mbs.methods.catalogue import REFERENCE
from rotor_mbs.runs.design import REFERENCE_ARRAYS, RunRequest, runs_table, scene_table
from rotor_mbs.runs.merge import fit_file_to_request
from rotor_mbs.runs.read import StoredRun, open_results
from rotor_mbs.scenario.catalogue import natural_order

_FACTS = ("steps", "time_reached", "setup_time_s", "run_time_s", "output_time_s")


def freeze(*sources: Path, target: Path) -> None:
    """Write the `REFERENCE_ARRAYS` of results files' references into the file `target`, their
    digests beside it."""
    target.unlink(missing_ok=True)
    with ExitStack() as stack:
        chosen: dict[str, tuple[RunRequest, StoredRun]] = {}
        for source in sources:
            results = stack.enter_context(open_results(source))
            today = (
                f"heyoka {results.attributes.get('heyoka', '')}, "
                f"{datetime.now(UTC).date().isoformat()}"
            )
            for name, stored in results.scenes.items():
                if stored.reference is not None and name not in chosen:
                    known = json.loads(stored.reference.known["versions"])
                    versions = {"frozen_with": known.get("frozen_with", today)}
                    chosen[name] = (
                        RunRequest(stored.scene, REFERENCE, versions=versions),
                        stored.reference,
                    )
        references = [chosen[name] for name in natural_order(chosen)]
        tables = [
            scene_table([asked], arrays=[name for name in REFERENCE_ARRAYS if name in run])
            for asked, run in references
        ]
        file = fit_file_to_request(
            target, [runs_table([asked for asked, _ in references]), *tables]
        )
        for asked, run in references:
            place = file.place(asked.label)
            values: dict[str, object] = {"status": run.status, "samples": run.samples}
            values |= {name: run.attributes[name] for name in _FACTS}
            values |= {name: run.array(name) for name in REFERENCE_ARRAYS if name in run}
            place.write(place.encode(values))
    target.with_suffix(".sha256").write_text(digests(target))


def digests(path: Path) -> str:
    """A line for each array of a file of references: SHA-256, scene, name. A number that changed is
    located."""
    with open_results(path, verify=False) as results:
        references = [scene.reference for scene in results.scenes.values()]
        lines = [
            f"{array_digest(run.array(name))}  {run.scene_name} {name}\n"
            for run in references
            for name in run.names
        ]
    return "".join(lines)


def array_digest(values: NDArray[Any]) -> str:
    """SHA-256 over shape and values as little-endian numbers."""
    values = np.ascontiguousarray(values)
    digest = hashlib.sha256(f"{values.dtype.kind}{values.dtype.itemsize}{values.shape}".encode())
    digest.update(values.astype(values.dtype.newbyteorder("<"), copy=False).tobytes())
    return digest.hexdigest()


if __name__ == "__main__":
    *sources, target = map(Path, sys.argv[1:])
    freeze(*sources, target=target)
