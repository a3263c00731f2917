"""The errata of the printed equations: the check of each printed entry as a record of a results file, and back."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import fields
from typing import Any

import numpy as np

from rotor_mbs.models.printed.errata import CheckedEntry
from rotor_mbs.runs import files
from rotor_mbs.runs.read import OpenResults
from rotor_mbs.runs.records import Record, read_record

ERRATA = "errata"
_NUMBERS = {"difference": np.float64, "agrees": np.int8}
_TEXTS = tuple(one.name for one in fields(CheckedEntry) if one.name not in _NUMBERS)


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
        return [_entry(files.attributes_of(check)) for check in results.root[ERRATA].values()]
    columns = {**{name: record.attributes[name] for name in _TEXTS}, **record.arrays}
    return [_entry(dict(zip(columns, row, strict=True))) for row in zip(*columns.values(), strict=True)]


def _entry(values: Mapping[str, Any]) -> CheckedEntry:
    texts = {name: str(values[name]) for name in _TEXTS}
    return CheckedEntry(**texts, difference=float(values["difference"]), agrees=bool(values["agrees"]))
