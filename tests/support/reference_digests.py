"""Digests of the arrays of the shipped references, beside their files: a number that changed is found and located.

python tests/support/reference_digests.py writes them again, after references were computed anew.
"""

from __future__ import annotations

from pathlib import Path

from rotor_mbs.runs.read import open_results
from rotor_mbs.runs.table import array_digest
from rotor_mbs.studies.stored_references import shipped_files


def digests(path: Path) -> str:
    """A line for each array of a file of references: SHA-256, scene, name."""
    with open_results(path, verify=False) as results:
        references = [scene.reference for scene in results.scenes.values()]
        lines = [f"{array_digest(run.array(name))}  {run.scene} {name}\n" for run in references for name in run.names]
    return "".join(lines)


if __name__ == "__main__":
    for path in shipped_files():
        path.with_suffix(".sha256").write_text(digests(path))
