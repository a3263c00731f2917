"""A sweep's files read back, run by run across all of them. Needs no engine."""

from __future__ import annotations

import json
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from rotor_mbs.errors import StoreError
from rotor_mbs.store.hdf5 import attributes_of
from rotor_mbs.store.read import open_results


class StoredSweep:
    """The files of one sweep, in the order of their runs. Raises StoreError where one is missing or no sweep."""

    def __init__(self, files: Sequence[Path]) -> None:
        self._files = files
        with open_results(files[0]) as results:
            if "parameters" not in results.root:
                raise StoreError(f"{files[0]}: no sweep's dataset; allowed: a file that `rotor-mbs sweep` wrote")
            self.attributes = results.attributes
            told = attributes_of(results.root["parameters"])
        self.keys: list[str] = told["labels"]
        self.units: list[str] = told["label_units"]

    @property
    def shape(self) -> tuple[int, ...]:
        """Values along every axis of its grid, slowest first."""
        return tuple(json.loads(self.attributes["shape"]))

    def scale(self, name: str) -> NDArray[np.float64]:
        """What all runs share, such as `time`. Raises StoreError."""
        with open_results(self._files[0]) as results:
            return self._array(results.root, name)

    def column(self, name: str) -> NDArray[Any]:
        """(runs, ...) a dataset whole: for metrics and parameters. Raises StoreError."""
        return np.concatenate(list(self.pieces(name, 1 << 20)))

    def pieces(self, name: str, runs: int) -> Iterator[NDArray[Any]]:
        """The same in pieces of at most `runs` runs: for trajectories."""
        for path in self._files:
            with open_results(path) as results:
                dataset = self._dataset(results.root, name)
                for first in range(0, len(dataset), runs):
                    yield dataset[first : first + runs]

    def _array(self, root: Any, name: str) -> NDArray[Any]:
        values: NDArray[Any] = self._dataset(root, name)[()]
        return values

    def _dataset(self, root: Any, name: str) -> Any:
        if name not in root:
            raise StoreError(f"{self._files[0]}: does not hold {name}; allowed: a sweep whose outputs have it")
        return root[name]
