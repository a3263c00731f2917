"""The check of the printed entries, stored beside the runs as one record: a row for each entry."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from rotor_mbs.store import hdf5
from rotor_mbs.store.read import Results
from rotor_mbs.store.records import Record, read_record, write_records

_GROUP = "errata"
_TEXTS = ("equation", "entry", "printed", "right", "explained_by")
_NUMBERS = {"difference": np.float64, "agrees": np.int8}


def write_errata(path: Path, checks: Sequence[Mapping[str, Any]], fingerprint: str) -> None:
    """A results file with nothing but the checks, in their order, and the fingerprint of the code that made them.

    Each check: equation, entry, printed, right (formulas), difference, agrees, explained_by. Raises StoreError.
    """
    texts = {name: [str(check[name]) for check in checks] for name in _TEXTS}
    numbers = {name: np.array([check[name] for check in checks], dtype=kind) for name, kind in _NUMBERS.items()}
    write_records(path, [Record(_GROUP, "", "", {"fingerprint": fingerprint, **texts}, numbers)])


def errata_fingerprint(results: Results) -> str:
    """Of the code that made the checks in an open file; "" where it has none."""
    return str(results.root[_GROUP].attrs["fingerprint"]) if _GROUP in results.root else ""


def read_errata(results: Results) -> list[dict[str, Any]]:
    """The checks in an open file, in order; none where it has none."""
    if _GROUP not in results.root:
        return []
    record = read_record(_GROUP, results.root[_GROUP])
    if not record.arrays:  # of an earlier version, which had a group for each entry
        return [hdf5.attributes_of(check) for check in results.root[_GROUP].values()]
    columns = {name: record.attributes[name] for name in _TEXTS} | {
        name: record.arrays[name].tolist() for name in _NUMBERS
    }
    return [dict(zip(columns, row, strict=True)) for row in zip(*columns.values(), strict=True)]
