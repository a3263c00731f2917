"""A results file as the place where records are kept: which keys it has, and new records merged into it."""

from __future__ import annotations

from collections.abc import Collection, Sequence
from dataclasses import dataclass
from pathlib import Path

from rotor_mbs.execution.environment import machine, versions
from rotor_mbs.store.merge import merge, refuse_other_kinds, stored_keys


@dataclass(frozen=True)
class ResultsFile:
    """The results file at `path`, which need not be there yet."""

    path: Path

    def stored_keys(self) -> set[str]:
        """Content hashes of all runs and records in the file. Raises StoreError."""
        refuse_other_kinds(self.path)
        return stored_keys(self.path)

    def merge(self, parts: Sequence[Path], without: Collection[str] = frozenset()) -> None:
        """The records of `parts` into the file, atomically, and those of these keys out of it. Raises StoreError."""
        sources = [self.path, *parts] if self.path.exists() else parts
        merge(self.path, sources, {**versions(), **machine()}, without)
