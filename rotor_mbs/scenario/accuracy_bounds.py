"""Read bounds of statuses and of `check`: reference/accuracy.toml, and a user's own file."""

from __future__ import annotations

import functools
import math
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace
from fnmatch import fnmatchcase
from pathlib import Path

from rotor_mbs.errors import InputError
from rotor_mbs.scenario import keys
from rotor_mbs.scenario.catalogue import REFERENCES
from rotor_mbs.scenario.keys import file_key
from rotor_mbs.scenario.toml_file import read_toml

CHECKS = (
    "complete", "status", "metrics", "times", "start", "defect", "defect median", "error", "tip",
    "energies", "energy", "loads", "gap", "exact", "published", "reference", "growth",
    "integrity", "settings", "uncertainty", "frozen",
)  # fmt: skip


_BOUND = keys.within(keys.NUMBER, at_least=0.0, allowed=f"a number from 0 to {keys.MAX_NUMBER:g}")
_PATTERN = keys.Kind(keys.read_text, "a name; * matches any text")
_SENTENCE = keys.Kind(keys.read_text, "a sentence")


@dataclass(frozen=True, slots=True)
class Bound:
    """Bound of a check: the largest value that passes, in the unit of the check.

    Attributes
    ----------
    check, method : names; `*` in the name of a method matches any text.
    value, reason : the bound, and why it has this value.
    fault, known_fault : the value that a known fault causes, and the description of that fault.
    scenes : shipped scenes to which it applies: patterns separated by `|`; `*` for any scene.
    """

    check: str = file_key("check", keys.choice(CHECKS))
    method: str = file_key("method", _PATTERN)
    value: float = file_key("value", _BOUND)
    reason: str = file_key("reason", _SENTENCE)
    fault: float = file_key("fault", _BOUND, default=math.inf)
    known_fault: str = file_key("known_fault", _SENTENCE, default="")
    scenes: str = file_key("scenes", _PATTERN, default="*")


_BOUND_TABLES = keys.list_of(keys.table_of(Bound), "one or more [[bound]] tables")
_FILE = {"bound": file_key("bound", _BOUND_TABLES).metadata}


@dataclass(frozen=True)
class Bounds:
    """Bounds of all checks of a scene: the first entry whose check, method and scene fit counts.

    Attributes
    ----------
    entries : of one file or several, in the order in which they are tried.
    scene : name of the shipped scene that they are for; "" for any other.
    """

    entries: Sequence[Bound]
    scene: str = ""

    def of(self, check: str, method: str) -> Bound:
        """Return the bound of a check of a method.

        Raises InputError where there is none: a check without a bound would pass anything.
        """
        bound = self.find(check, method)
        if bound is None:
            what = f"no bound for check {check!r} of {method}"
            raise InputError(f"{what}; allowed: an entry in a file of bounds")
        return bound

    def find(self, check: str, method: str) -> Bound | None:
        """Return the bound of a check of a method, or None where there is none."""
        for bound in self.entries:
            if bound.check != check or not fnmatchcase(method, bound.method):
                continue
            if any(fnmatchcase(self.scene, pattern) for pattern in bound.scenes.split("|")):
                return bound
        return None

    def with_entries(self, entries: Iterable[Bound]) -> Bounds:
        """Return bounds that try some entries first, then these."""
        return replace(self, entries=[*entries, *self.entries])


@functools.cache
def shipped_bounds() -> Bounds:
    """Return the bounds of reference/accuracy.toml, read once."""
    return Bounds(read_bounds(REFERENCES / "accuracy.toml"))


def read_bounds(path: Path) -> tuple[Bound, ...]:
    """Return the entries of a TOML file of [[bound]] tables.

    Raises InputError with every error of the file.
    """
    file = read_toml(path)
    file.refuse_other_kind("a file of bounds")
    with file.with_line_numbers():
        entries: tuple[Bound, ...] = keys.read_keys(_FILE, file.tables)["bound"]
    return entries
