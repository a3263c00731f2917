"""Results files read back: scenes and runs by name, rows when they are asked for. Needs no engine."""

from __future__ import annotations

import functools
import json
import os
from collections.abc import Collection, Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import IO, Any

import numpy as np
from numpy.typing import NDArray

from rotor_mbs.errors import StoreError
from rotor_mbs.methods.catalogue import REFERENCE
from rotor_mbs.runs import files
from rotor_mbs.runs.results import OF_METHODS, REPEATED, RUNS, TableFile
from rotor_mbs.runs.table import MISSING, Place, Rows, checksums, text_of
from rotor_mbs.scenario.catalogue import natural_order
from rotor_mbs.solution.status import STATUSES

_TEXTS = ("message", "engine_message")
_OWN_NAMES = {name: quantity for quantity, name in OF_METHODS.items()}
_ATTEMPTS = 3  # to open a file that is being replaced


@dataclass(frozen=True, eq=False)
class StoredRun:
    """A run (or the reference) in an open file; its row is read, and verified, when something of it is asked for.

    known: what the design says of it: settings, versions, ... scales: time, coordinate, blade, axis, as far as there
    are.
    """

    scene: str
    method: str
    known: Mapping[str, Any]
    scales: Mapping[str, NDArray[Any]]
    _labels: tuple[str, ...]
    _place: Place
    _file: IO[bytes]
    _verify: bool = True

    @functools.cached_property
    def _stored(self) -> Rows:
        """The columns of its row as they are in the file."""
        with files.reading(self._name):
            return self._place.read(file=self._file)

    @functools.cached_property
    def is_damaged(self) -> bool:
        """Whether its row is not what was written."""
        row = self._stored
        return bool((checksums(self._place.first, row, self._place.row) != row["crc32"]).any())

    @functools.cached_property
    def _row(self) -> Rows:
        """The columns by the names of their quantities. Raises StoreError where they are not what was written."""
        if self._verify and self.is_damaged:
            raise StoreError(f"{self._name} changed after it was written")
        return {_OWN_NAMES.get(name, name): values[0] for name, values in self._stored.items()}

    @property
    def _name(self) -> str:
        return f"{self._place.path}: {self.scene}/{self.method}"

    @functools.cached_property
    def attributes(self) -> dict[str, Any]:
        """Status, message, metrics, times ... as plain values; those that the run does not have are left out."""
        facts: dict[str, Any] = {"status": self.status, "settings": self.known["settings"]}
        facts |= {name: text_of(self._row[name]) for name in _TEXTS}
        for name, value in self._row.items():
            if name in ("status", "crc32", *REPEATED.values(), *_TEXTS) or np.ndim(value):
                continue
            number = value.item()
            if (isinstance(number, int) and number >= 0) or (isinstance(number, float) and number == number):
                facts[name] = number
        versions = json.loads(self.known["versions"])
        if "frozen_with" in versions:
            facts["frozen_with"] = versions["frozen_with"]
        return facts

    @property
    def status(self) -> str:
        code = int(self._row["status"])
        return STATUSES[code] if 0 <= code < len(STATUSES) else ""

    @property
    def settings(self) -> dict[str, Any]:
        return dict(json.loads(self.known["settings"]))

    @property
    def labels(self) -> list[str]:
        """Names of the coordinates: rotor, pitch 1, ...; none where neither angles nor rates are stored."""
        return list(self._labels) if "angles" in self or "rates" in self else []

    @property
    def samples(self) -> int:
        return int(self._row["samples"])

    @functools.cached_property
    def _arrays(self) -> dict[str, NDArray[Any]]:
        """By name, scales included. One that its method or its scene's outputs do not have is NaN from the first sample
        on, and left out."""
        count = self.samples
        scales = {name: values[:count] if name == "time" else values for name, values in self.scales.items()}
        own = {name: values[:count] for name, values in self._row.items() if np.ndim(values) and name not in _TEXTS}
        return scales | {name: values for name, values in own.items() if count == 0 or not np.isnan(values[0]).all()}

    @property
    def names(self) -> list[str]:
        """The arrays that it has, scales included."""
        return list(self._arrays)

    def __contains__(self, name: str) -> bool:
        return name in self._arrays

    def array(self, name: str) -> NDArray[Any]:
        """(samples, ...) An array, or a scale. Raises StoreError where the run has none of that name."""
        if name not in self:
            raise StoreError(f"{self._name} has no {name}")
        return self._arrays[name]

    def get(self, name: str) -> NDArray[Any] | None:
        return self._arrays.get(name)


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
    """An open results file: its attributes (versions, platform, created) and its scenes by name, in natural order."""

    path: Path
    attributes: dict[str, Any]
    scenes: dict[str, StoredScene]


@contextmanager
def open_results(path: Path, *, verify: bool = True, only: Collection[str] | None = None) -> Iterator[OpenResults]:
    """An open results file; of a file that replaces it meanwhile nothing is seen. A run is compared with its checksum
    when it is read, but for verify=False; only: names of scenes, by default all. Raises StoreError."""
    with files.open_file(path) as h5, files.reading(path):
        attributes = files.attributes_of(h5)
    for _ in range(_ATTEMPTS):
        with path.open("rb") as file:
            stored = TableFile(path)
            if stored.groups and stored.table(stored.groups[0]).inode != os.fstat(file.fileno()).st_ino:
                continue
            with files.reading(path):
                scenes = {scene.name: scene for scene in _scenes(stored, file, verify, only)}
            yield OpenResults(path, attributes, {name: scenes[name] for name in natural_order(scenes)})
            return
    raise StoreError(f"{path}: is being replaced by another process")


def run_arrays(path: Path, group: str = "", scene: str = "") -> dict[str, NDArray[Any]]:
    """The arrays of one run of a results file; group, scene: as for `files.read_arrays`, the run "scene/method"."""
    with open_results(path) as results:
        runs = {f"{name}/{run.method}": run for name, known in results.scenes.items() for run in known.runs.values()}
        run = runs[files.chosen_group(path, list(runs), group.strip("/"), scene)]
        return {name: run.array(name) for name in run.names if run.array(name).ndim <= 3}


def is_sweep(path: Path) -> bool:
    """Whether a file of this program is the dataset of a sweep. Raises StoreError where it cannot be read."""
    with files.open_file(path) as file, files.reading(path):
        return "run" in file


def _scenes(stored: TableFile, file: IO[bytes], verify: bool, only: Collection[str] | None) -> Iterator[StoredScene]:
    if RUNS not in stored.groups:
        return
    runs = stored.table(RUNS)
    file.seek(runs.computed["status"].offset)
    statuses = np.frombuffer(file.read(len(runs.runs)), np.int8)
    by_scene: dict[str, list[StoredRun]] = {str(scene): [] for scene in runs.known["scene"]}
    for i, run in enumerate(runs.runs.tolist()):
        if statuses[i] == MISSING:
            continue
        known = stored.known(RUNS, i)
        scene = str(known["scene"])
        if only is not None and scene not in only:
            continue
        arrays = stored.table(scene)
        scales = arrays.known
        labels = tuple(map(str, arrays.labels.get("coordinate", ())))
        by_scene[scene].append(
            StoredRun(scene, str(known["method_name"]), known, scales, labels, stored.place(run), file, verify)
        )
    for scene, found in by_scene.items():
        if found:
            yield StoredScene(scene, dict(stored.table(scene).attributes), {run.method: run for run in found})
