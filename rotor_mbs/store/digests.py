"""Digests of frozen arrays, in a text file beside each file of references: a changed number is found and located."""

from __future__ import annotations

import hashlib
from pathlib import Path

import numpy as np

from rotor_mbs.errors import StoreError
from rotor_mbs.store import hdf5
from rotor_mbs.store.read import Results, StoredRun, open_results


def digest_file(references: Path) -> Path:
    """`paper.sha256` beside `paper.h5`."""
    return references.with_suffix(".sha256")


def write_digests(references: Path) -> None:
    """A line "digest  scene channel" for every array of every reference, atomically. Raises StoreError."""
    with open_results(references) as results:
        lines = [f"{digest}  {scene} {name}\n" for (scene, name), digest in _digests(results).items()]
    hdf5.replace_file(digest_file(references), "".join(lines).encode())


def changed_arrays(results: Results) -> dict[str, list[str]]:
    """By scene, the arrays of its reference that are not what was frozen, are new or are gone; [] where all is well.

    Raises StoreError where there is no digest file.
    """
    path = digest_file(results.path)
    try:
        rows = [line.split() for line in path.read_text().splitlines()]
    except (OSError, UnicodeDecodeError) as exc:
        raise StoreError(f"{path}: cannot be read ({exc}); `rotor-mbs reference` writes it") from exc
    frozen = {(row[1], row[2]): row[0] for row in rows if len(row) == 3}
    found = _digests(results)
    scenes: dict[str, list[str]] = {scene: [] for scene, _ in [*found, *frozen]}
    for key in {**frozen, **found}:
        if frozen.get(key) != found.get(key):
            scenes[key[0]].append(key[1])
    return scenes


def _digests(results: Results) -> dict[tuple[str, str], str]:
    references = [scene.reference for scene in results.scenes.values()]
    return {(run.scene, name): _digest(run, name) for run in references if run is not None for name in run.names}


def _digest(run: StoredRun, name: str) -> str:
    """Over shape and values as little-endian numbers: the same on every machine and for every HDF5 layout."""
    values = np.ascontiguousarray(run.array(name))
    digest = hashlib.sha256(f"{values.dtype.kind}{values.dtype.itemsize}{values.shape}".encode())
    digest.update(values.astype(values.dtype.newbyteorder("<")).tobytes())
    return digest.hexdigest()
