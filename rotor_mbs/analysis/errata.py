"""The errata of the printed equations: the check of each printed entry, and what each erratum alone does to a scene."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, fields
from typing import Any

import numpy as np

from rotor_mbs.methods.catalogue import errata_methods
from rotor_mbs.models.printed.errata import CheckedEntry
from rotor_mbs.store import hdf5
from rotor_mbs.store.read import OpenResults, StoredScene
from rotor_mbs.store.records import Record, read_record

ERRATA = "errata"
_NUMBERS = {"difference": np.float64, "agrees": np.int8}
_TEXTS = tuple(one.name for one in fields(CheckedEntry) if one.name not in _NUMBERS)


@dataclass(frozen=True)
class Effect:
    """What one erratum does: largest angle change (rad) up to the horizon and over the whole run, energy gain (J)."""

    status: str
    angle_horizon: float | None
    angle_whole: float | None
    energy_gain: float | None


def errata_record(checks: Sequence[CheckedEntry], facts: Mapping[str, object]) -> Record:
    """The checks as the one record of a results file that belongs to no scene; facts: further attributes."""
    texts = {name: [getattr(check, name) for check in checks] for name in _TEXTS}
    numbers = {name: np.array([getattr(check, name) for check in checks], kind) for name, kind in _NUMBERS.items()}
    return Record(ERRATA, "", "", {**facts, **texts}, numbers)


def entries(results: OpenResults) -> list[CheckedEntry]:
    """The checks in an open file, in order; none where it has none."""
    if ERRATA not in results.root:
        return []
    record = read_record(ERRATA, results.root[ERRATA])
    if not record.arrays:  # of an earlier version, which had a group for each entry
        return [_entry(hdf5.attributes_of(check)) for check in results.root[ERRATA].values()]
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
