"""What results are held to: reference/accuracy.toml, and a user's own file before it. Knows no results.

It stands this low because a run's status and the verdicts of `check` read the same entries: one bound, one place.
"""

from __future__ import annotations

import functools
import math
from collections.abc import Sequence
from dataclasses import dataclass
from fnmatch import fnmatchcase
from pathlib import Path
from typing import Any

from rotor_mbs.errors import InputError
from rotor_mbs.scenario.reading import read_toml
from rotor_mbs.scenario.resources import reference_folder

CHECKS = (
    "complete", "status", "times", "start", "agreement", "tip", "energies", "energy", "gap", "exact", "published",
    "reference", "growth", "frozen", "symmetry", "order", "printed", "rules", "speed",
)  # fmt: skip


@dataclass(frozen=True, slots=True)
class Bound:
    """The largest value that passes, in the check's own unit, for methods that `method` (a pattern with *) fits.

    fault, known_fault   the value that a known fault gives, and which one: what the bound must stay below; a user's
                         bound may leave them out (infinity, "")
    """

    check: str
    method: str
    value: float
    reason: str
    fault: float = math.inf
    known_fault: str = ""


@dataclass(frozen=True)
class Bounds:
    """All bounds, the ones that count first in front."""

    entries: Sequence[Bound]

    def of(self, check: str, method: str) -> Bound:
        """The first that fits. Raises InputError where none does: a check without a bound would pass anything."""
        bound = self.find(check, method)
        if bound is None:
            raise InputError(f"no bound for check {check!r} of {method}; allowed: an entry in a --bounds file")
        return bound

    def find(self, check: str, method: str) -> Bound | None:
        """The first that fits, or None."""
        fitting = (one for one in self.entries if one.check == check and fnmatchcase(method, one.method))
        return next(fitting, None)


def shipped_file() -> Path:
    """The bounds that count where a user's say nothing."""
    return reference_folder() / "accuracy.toml"


@functools.cache
def shipped_bounds() -> Bounds:
    """Those of reference/accuracy.toml, read once. Raises InputError with every fault of the file."""
    return Bounds(_read(shipped_file(), frozenset({"fault", "known_fault"})))


def load_bounds(own: Path | None = None) -> Bounds:
    """The user's bounds, then the shipped ones. Raises InputError with every fault of a file."""
    users = _read(own, frozenset()) if own else []
    return Bounds([*users, *shipped_bounds().entries])


def _read(path: Path, also: frozenset[str]) -> list[Bound]:
    """also: optional keys that are required of this file."""
    _, tables = read_toml(path)
    entries = tables.get("bound")
    unknown = sorted(set(tables) - {"bound"})
    if unknown or not isinstance(entries, list) or not all(isinstance(entry, dict) for entry in entries):
        raise InputError(f"{path}: {', '.join(unknown) or 'bound'}: allowed: [[bound]] tables and nothing else")
    required = _REQUIRED | also
    problems = [line for i, entry in enumerate(entries, 1) for line in _faults(f"{path}: bound {i}", entry, required)]
    if problems:
        raise InputError(problems)
    return [_bound(**entry) for entry in entries]


def _bound(check: str, method: str, value: float, reason: str, fault: float = math.inf, known_fault: str = "") -> Bound:
    return Bound(check, method, float(value), reason, float(fault), known_fault)


def _faults(where: str, entry: dict[str, Any], required: frozenset[str]) -> list[str]:
    faults = [f"{where}: {key}: unknown key; allowed: {', '.join(_ALLOWED)}" for key in entry if key not in _ALLOWED]
    for key, allowed in _ALLOWED.items():
        if key not in entry:
            faults += [f"{where}: {key}: missing; allowed: {allowed}"] if key in required else []
        elif not _is_of_type(key, entry[key]):
            faults.append(f"{where}: {key}: {_short(entry[key])}; allowed: {allowed}")
    return faults


def _is_of_type(key: str, value: object) -> bool:
    if key in _NUMBERS:
        return isinstance(value, (int, float)) and not isinstance(value, bool) and 0 <= value <= 1e300
    if key == "check":
        return value in CHECKS
    return isinstance(value, str) and bool(value.strip())


def _short(value: object) -> str:
    text = ascii(value)
    return text if len(text) <= 60 else text[:57] + "..."


_NUMBERS = frozenset({"value", "fault"})
_REQUIRED = frozenset({"check", "method", "value", "reason"})
_ALLOWED = {
    "check": f"one of {', '.join(CHECKS)}",
    "method": "a method or a pattern with *",
    "value": "a number from 0 to 1e300",
    "reason": "a sentence",
    "fault": "a number from 0 to 1e300",
    "known_fault": "a sentence",
}
