"""Read the bounds of checks from reference/accuracy.toml and from a user's own file.

Statuses of runs and the command `check` use these bounds.
"""

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
    """Declare the bound of a check: the largest value that passes, in the unit of the check.

    Attributes
    ----------
    check, method : names of the check and of the method; `*` in the name of a method matches any
        text.
    value, reason : the bound, and the reason why it has this value.
    fault, known_fault : a value of the check that a known fault causes, and a description of this
        fault.
    scenes : names of the shipped scenes to which the bound applies, as patterns separated by `|`;
        `*` for any scene.
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
    """Hold the bounds of all checks of a scene.

    The first entry whose check, method and scene fit is used.

    Attributes
    ----------
    entries : bounds from one source or several, in the order in which they are tried.
    scene : name of the shipped scene for which bounds are looked up; "" for any other scene.
    """

    entries: Sequence[Bound]
    scene: str = ""

    def of(self, check: str, method: str) -> Bound:
        """Return the bound of a check for a method.

        Raises
        ------
        InputError
            If there is no bound, because a check without a bound would pass any value.
        """
        bound = self.find(check, method)
        if bound is None:
            what = f"no bound for check {check!r} of {method}"
            raise InputError(f"{what}; allowed: an entry in a file of bounds")
        return bound

    def find(self, check: str, method: str) -> Bound | None:
        """Return the bound of a check for a method, or None if there is no bound."""
        for bound in self.entries:
            if bound.check != check or not fnmatchcase(method, bound.method):
                continue
            if any(fnmatchcase(self.scene, pattern) for pattern in bound.scenes.split("|")):
                return bound
        return None

    def with_entries(self, entries: Iterable[Bound]) -> Bounds:
        """Return bounds in which the given entries are tried before those of this object."""
        return replace(self, entries=[*entries, *self.entries])


@functools.cache
def shipped_bounds() -> Bounds:
    """Return the bounds of reference/accuracy.toml, which is read only once."""
    return Bounds(read_bounds(REFERENCES / "accuracy.toml"))


def read_bounds(path: Path) -> tuple[Bound, ...]:
    """Return the bounds of a TOML file, which has a table [[bound]] for each of them.

    Raises
    ------
    InputError
        If the file is not valid; the message has all errors of the file.
    """
    file = read_toml(path)
    file.refuse_other_kind("a file of bounds")
    with file.with_line_numbers():
        entries: tuple[Bound, ...] = keys.read_keys(_FILE, file.tables)["bound"]
    return entries
