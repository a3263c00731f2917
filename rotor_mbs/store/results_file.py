"""A results file as the place where records are kept: which keys it has, and new records merged into it."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

from rotor_mbs.execution.environment import machine, versions
from rotor_mbs.store.bench import read_curves
from rotor_mbs.store.merge import merge, refuse_other_kinds
from rotor_mbs.store.read import open_results
from rotor_mbs.store.stability import read_records


@dataclass(frozen=True)
class ResultsFile:
    """The results file at `path`, which need not be there yet."""

    path: Path

    def stored_keys(self) -> set[str]:
        """Keys of all runs, bench curves and stability records. Raises StoreError."""
        refuse_other_kinds(self.path)
        if not self.path.exists():
            return set()
        with open_results(self.path) as results:
            facts = [run.attributes for scene in results.scenes.values() for run in scene.runs.values()]
        facts += [dict(curve.attributes) for curve in read_curves(self.path)]
        facts += [dict(record.attributes) for record in read_records(self.path)]
        return {str(one["run_hash"]) for one in facts if "run_hash" in one}

    def merge(self, parts: Sequence[Path]) -> None:
        """The records of `parts` into the file, atomically. Raises StoreError."""
        sources = [self.path, *parts] if self.path.exists() else parts
        merge(self.path, sources, {**versions(), **machine()})
