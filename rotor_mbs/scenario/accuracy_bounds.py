"""The bounds that results are judged by: reference/accuracy.toml, and a user's own file before it.

A run's status and the verdicts of `check` read the same entries. Must not know results.
"""

from __future__ import annotations

import functools
import math
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace
from fnmatch import fnmatchcase
from pathlib import Path
from typing import Any

from rotor_mbs.errors import InputError
from rotor_mbs.scenario.catalogue import reference_folder
from rotor_mbs.scenario.toml_file import read_toml, shown_path

CHECKS = (
    "complete", "status", "times", "start", "agreement", "tip", "energies", "energy", "impulse", "loads", "gap",
    "exact", "published", "reference", "growth", "integrity", "copied", "settings", "steps", "uncertainty", "horizon",
    "frozen",
)  # fmt: skip


@dataclass(frozen=True, slots=True)
class Bound:
    """The largest value that passes, in the check's own unit, for methods that `method` (a pattern with *) fits.

    scenes   the shipped scenes it is for, patterns with | between them; "*" for any scene, a user's own too
    fault, known_fault   the value that a known fault gives, and which one: what the bound must stay below; a user's
                         bound may leave them out (infinity, "")
    """

    check: str
    method: str
    value: float
    reason: str
    fault: float = math.inf
    known_fault: str = ""
    scenes: str = "*"


@dataclass(frozen=True)
class Bounds:
    """Bounds in the order in which they are tried: the first entry whose check, method and scene fit counts.

    scene   the shipped scene that they are for; "" for any
    """

    entries: Sequence[Bound]
    scene: str = ""

    def for_scene(self, scene: str) -> Bounds:
        """The bounds on runs of a shipped scene, which are near to what is seen there."""
        return replace(self, scene=scene)

    def of(self, check: str, method: str) -> Bound:
        """The first that fits. Raises InputError where none does: a check without a bound would pass anything."""
        bound = self.find(check, method)
        if bound is None:
            raise InputError(f"no bound for check {check!r} of {method}; allowed: an entry in a file of bounds")
        return bound

    def find(self, check: str, method: str) -> Bound | None:
        """The first that fits, or None."""
        fitting = (one for one in self.entries if one.check == check and fnmatchcase(method, one.method))
        of_scene = (one for one in fitting if any(fnmatchcase(self.scene, each) for each in one.scenes.split("|")))
        return next(of_scene, None)

    def with_entries(self, entries: Iterable[Bound]) -> Bounds:
        """Bounds that try `entries` first, then these.

        >>> bounds = Bounds([Bound("energy", "*", 1e-6, "default")])
        >>> bounds.with_entries([Bound("energy", "mine/*", 1e-3, "explicit")]).of("energy", "mine/euler").value
        0.001
        """
        return replace(self, entries=[*entries, *self.entries])


@functools.cache
def expected_settings() -> dict[str, dict[str, Any]]:
    """By method, `settings` and `steps` by scene, of reference/settings.toml. Raises InputError where it is no TOML."""
    return read_toml(reference_folder() / "settings.toml")[1]


@functools.cache
def shipped_bounds() -> Bounds:
    """The bounds of reference/accuracy.toml, read once. Raises InputError with every error of the file."""
    return read_bounds(reference_folder() / "accuracy.toml")


def load_bounds(own: Path | None = None) -> Bounds:
    """The bounds of the file `own`, then the shipped ones. Raises InputError with every error of a file."""
    return shipped_bounds().with_entries(read_bounds(own).entries if own else [])


def read_bounds(path: Path) -> Bounds:
    """The bounds of one TOML file of [[bound]] tables. Raises InputError with every error of the file."""
    from rotor_mbs.scenario.schema import BoundsTable  # late, with pydantic: 0.15 s
    from rotor_mbs.scenario.validation import validate_file

    text, tables = read_toml(path)
    file = validate_file(BoundsTable, tables, text, shown_path(path))
    return Bounds([Bound(**entry.model_dump(exclude_none=True)) for entry in file.bound])
