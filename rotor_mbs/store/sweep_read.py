"""A sweep's dataset read back, column by column. Needs no engine."""

from __future__ import annotations

import json
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from rotor_mbs.errors import StoreError
from rotor_mbs.store.hdf5 import attributes_of, open_file
from rotor_mbs.store.sweep_layout import parameter_name


class StoredSweep:
    """A dataset that `rotor-mbs sweep` wrote, complete or not. Raises StoreError where it is none.

    keys, units   of the varied parameters
    attributes    of the file
    """

    def __init__(self, path: Path) -> None:
        self._path = path
        with open_file(path) as file:
            self.attributes = attributes_of(file)
            if "sweep_identity" not in self.attributes:
                raise StoreError(f"{path}: no sweep's dataset; allowed: a file that `rotor-mbs sweep` wrote")
            self.keys: list[str] = self.attributes["parameter_keys"]
            self.units = [str(attributes_of(file[parameter_name(key)])["units"]) for key in self.keys]

    @property
    def shape(self) -> tuple[int, ...]:
        """Values along every axis of its grid, slowest first."""
        return tuple(json.loads(self.attributes["shape"]))

    def parameter(self, key: str) -> NDArray[np.float64]:
        """(runs,) the values of a varied parameter. Raises StoreError."""
        return self.column(parameter_name(key))

    def column(self, name: str) -> NDArray[Any]:
        """A dataset whole, such as `status` or `time`. Raises StoreError where there is none of that name."""
        with open_file(self._path) as file:
            values: NDArray[Any] = self._dataset(file, name)[()]
            return values

    def pieces(self, name: str, runs: int) -> Iterator[NDArray[Any]]:
        """The same in pieces of at most `runs` runs: for trajectories."""
        with open_file(self._path) as file:
            dataset = self._dataset(file, name)
            for first in range(0, len(dataset), runs):
                yield dataset[first : first + runs]

    def message(self, run: int) -> str:
        """Why the run (counted in this file) did not end well; "" where it did."""
        with open_file(self._path) as file:
            return bytes(file["message"][run]).rstrip(b"\0").decode(errors="replace")

    def _dataset(self, file: Any, name: str) -> Any:
        if name not in file:
            raise StoreError(f"{self._path}: does not hold {name}; allowed: a sweep whose outputs have it")
        return file[name]
