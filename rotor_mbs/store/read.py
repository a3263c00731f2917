"""Results files read back: scenes and runs by name, arrays when asked for. Needs no engine."""

from __future__ import annotations

import functools
import json
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from numpy.typing import NDArray

from rotor_mbs.errors import StoreError
from rotor_mbs.methods.catalogue import REFERENCE
from rotor_mbs.scenario.catalogue import RESERVED_GROUPS
from rotor_mbs.store import hdf5


@dataclass(frozen=True)
class StoredRun:
    """A run (or the reference) in an open file; what is asked for is read when it is asked for, attributes once.

    scene, method    "paper/fig05", "lagrange/taylor" (or "reference")
    """

    scene: str
    method: str
    _group: Any

    @functools.cached_property
    def attributes(self) -> dict[str, Any]:
        """Status, message, metrics, times ... as plain values. Raises StoreError where they are damaged."""
        try:
            return hdf5.attributes_of(self._group)
        except (KeyError, OSError, RuntimeError) as exc:
            raise StoreError(f"{self._group.file.filename}: {self._group.name}: damaged attributes ({exc})") from exc

    @property
    def status(self) -> str:
        return str(self.attributes.get("status", ""))

    @property
    def settings(self) -> dict[str, Any]:
        found: dict[str, Any] = json.loads(self.attributes.get("settings", "{}"))
        return found

    @property
    def labels(self) -> list[str]:
        """Names of the coordinates: rotor, pitch 1, ...; none where neither angles nor rates are stored."""
        if "coordinate" not in self._group:
            return []
        return [str(label) for label in hdf5.attributes_of(self._group["coordinate"])["labels"]]

    @property
    def names(self) -> list[str]:
        """The datasets it has, scales included."""
        return list(self._group)

    def __contains__(self, name: str) -> bool:
        return name in self._group

    def array(self, name: str) -> NDArray[Any]:
        """A dataset, whole. Raises StoreError where the run has none of that name."""
        try:
            values: NDArray[Any] = self._group[name][()]
        except (KeyError, OSError) as exc:
            raise StoreError(f"{self._group.file.filename}: {self._group.name} has no readable {name}") from exc
        return values


@dataclass(frozen=True)
class StoredScene:
    """A scene in an open file: name, attributes (title, figures, blades, scene_toml, scene_hash) and its runs."""

    name: str
    attributes: dict[str, Any]
    runs: dict[str, StoredRun]

    @property
    def title(self) -> str:
        return str(self.attributes["title"])

    @property
    def reference(self) -> StoredRun | None:
        return self.runs.get(REFERENCE)

    @property
    def methods(self) -> dict[str, StoredRun]:
        """The runs but the reference, in the order of the file."""
        return {name: run for name, run in self.runs.items() if name != REFERENCE}


@dataclass(frozen=True)
class OpenResults:
    """An open results file: its attributes (versions, platform, created) and its scenes by name, in file order."""

    path: Path
    attributes: dict[str, Any]
    scenes: dict[str, StoredScene]
    root: Any


@contextmanager
def open_results(path: Path) -> Iterator[OpenResults]:
    """Raises StoreError where `path` is not a results file of this program."""
    with hdf5.open_file(path) as file:
        try:
            scenes = {scene.name: scene for scene in _scenes(file, "")}
            attributes = hdf5.attributes_of(file)
        except (KeyError, OSError, RuntimeError) as exc:
            raise StoreError(f"{path}: damaged or incomplete ({exc})") from exc
        yield OpenResults(path, attributes, scenes, file)


def _scenes(group: Any, name: str) -> Iterator[StoredScene]:
    for key, item in group.items():
        if not hdf5.is_group(item) or (not name and key in RESERVED_GROUPS):
            continue
        path = f"{name}/{key}" if name else key
        if "scene_hash" in item.attrs:
            runs = {run.method: run for run in _runs(item, path)}
            yield StoredScene(path, hdf5.attributes_of(item), runs)
        else:
            yield from _scenes(item, path)


def _runs(group: Any, scene: str) -> Iterator[StoredRun]:
    for model, item in group.items():
        if model == REFERENCE:
            yield StoredRun(scene, model, item)
        elif hdf5.is_group(item):
            for integrator, run in item.items():
                yield StoredRun(scene, f"{model}/{integrator}", run)
