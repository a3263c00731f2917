"""The check of the printed entries, stored beside the runs: a subgroup per entry, its facts as attributes."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import Any

from rotor_mbs.store import hdf5
from rotor_mbs.store.read import Results

_GROUP = "errata"


def write_errata(path: Path, checks: Iterable[Mapping[str, object]], fingerprint: str) -> None:
    """A results file with nothing but the checks, in their order, and the fingerprint of the code that made them.

    Each check: equation, entry, printed, right (formulas), difference, agrees, explained_by. Raises StoreError.
    """
    with hdf5.new_file(path) as file:
        group = hdf5.new_group(file, _GROUP)
        hdf5.put_attributes(group, {"fingerprint": fingerprint})
        for number, check in enumerate(checks, start=1):
            hdf5.put_attributes(hdf5.new_group(group, f"{number:03d}"), check)


def errata_fingerprint(results: Results) -> str:
    """Of the code that made the checks in an open file; "" where it has none."""
    return str(results.root[_GROUP].attrs["fingerprint"]) if _GROUP in results.root else ""


def read_errata(results: Results) -> list[dict[str, Any]]:
    """The checks in an open file, in order; none where it has none."""
    if _GROUP not in results.root:
        return []
    return [hdf5.attributes_of(check) for check in results.root[_GROUP].values()]
