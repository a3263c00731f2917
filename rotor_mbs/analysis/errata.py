"""The errata of the printed equations: the check of each printed entry, and what each erratum alone does to a scene."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, fields
from pathlib import Path
from typing import Any

import numpy as np

from rotor_mbs.methods.catalogue import errata_methods
from rotor_mbs.store import hdf5
from rotor_mbs.store.read import OpenResults, StoredScene
from rotor_mbs.store.records import Record, read_record, write_records


@dataclass(frozen=True)
class CheckedEntry:
    """A printed entry against its derivative. difference: largest relative; explained_by: "E1, E2" or ""."""

    equation: str
    entry: str
    printed: str
    right: str
    difference: float
    agrees: bool
    explained_by: str


@dataclass(frozen=True)
class Effect:
    """What one erratum does: largest angle change (rad) up to the horizon and over the whole run, energy gain (J)."""

    status: str
    angle_horizon: float | None
    angle_whole: float | None
    energy_gain: float | None


_GROUP = "errata"
_NUMBERS = {"difference": np.float64, "agrees": np.int8}
_TEXTS = tuple(one.name for one in fields(CheckedEntry) if one.name not in _NUMBERS)


def write_errata(path: Path, checks: Sequence[CheckedEntry], fingerprint: str) -> None:
    """A results file with nothing but one record of the checks, and the fingerprint of the code that made them.

    Raises StoreError.
    """
    texts = {name: [getattr(check, name) for check in checks] for name in _TEXTS}
    numbers = {name: np.array([getattr(check, name) for check in checks], kind) for name, kind in _NUMBERS.items()}
    write_records(path, [Record(_GROUP, "", "", {"fingerprint": fingerprint, **texts}, numbers)])


def errata_fingerprint(results: OpenResults) -> str:
    """Fingerprint of the code that made the checks in an open file; "" where it has none."""
    return str(results.root[_GROUP].attrs["fingerprint"]) if _GROUP in results.root else ""


def entries(results: OpenResults) -> list[CheckedEntry]:
    """The checks in an open file, in order; none where it has none."""
    if _GROUP not in results.root:
        return []
    record = read_record(_GROUP, results.root[_GROUP])
    if not record.arrays:  # of an earlier version, which had a group for each entry
        return [_entry(hdf5.attributes_of(check)) for check in results.root[_GROUP].values()]
    columns = {**{name: record.attributes[name] for name in _TEXTS}, **record.arrays}
    return [_entry(dict(zip(columns, row, strict=True))) for row in zip(*columns.values(), strict=True)]


def _entry(values: Mapping[str, Any]) -> CheckedEntry:
    texts = {name: str(values[name]) for name in _TEXTS}
    return CheckedEntry(**texts, difference=float(values["difference"]), agrees=bool(values["agrees"]))


def effects(scene: StoredScene) -> dict[str, Effect]:
    """By erratum, for those whose run the file has."""
    runs = {erratum: scene.methods.get(name) for erratum, name in errata_methods().items()}
    names = ("angle_error_max", "angle_error_whole", "energy_gain_J")
    return {
        erratum: Effect(run.status, *(run.attributes.get(name) for name in names))
        for erratum, run in runs.items()
        if run is not None
    }
