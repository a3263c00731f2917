"""Results files read back: scenes and runs by name, arrays when asked for. Needs no engine."""

from __future__ import annotations

import functools
import json
from collections.abc import Callable, Iterator
from contextlib import AbstractContextManager, contextmanager, suppress
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

from numpy.typing import NDArray

from rotor_mbs.errors import StoreError
from rotor_mbs.methods.catalogue import REFERENCE
from rotor_mbs.runs import digests, files
from rotor_mbs.runs.layout import SWEEP_IDENTITY, key_of
from rotor_mbs.scenario.catalogue import RESERVED_GROUPS, natural_order


@dataclass(frozen=True)
class StoredRun:
    """A run (or the reference) in an open file; what is asked for is read when it is asked for, attributes once.

    scene, method    "paper/fig05", "lagrange/taylor" (or "reference")
    """

    scene: str
    method: str
    _group: Any
    _verify: bool = True
    _kept: dict[str, NDArray[Any]] | None = None  # arrays that were read, where they stay in memory

    @functools.cached_property
    def attributes(self) -> dict[str, Any]:
        """Status, message, metrics, times ... as plain values. Raises StoreError where they are damaged."""
        with self._reading("attributes"):
            found = files.attributes_of(self._group)
            self._prove(digests.ATTRIBUTES, lambda: digests.attributes_digest(found))
            return found

    @property
    def status(self) -> str:
        return str(self.attributes.get("status", ""))

    @property
    def key(self) -> str:
        """The content hash of what decides it, read alone and not verified; "" where it has none."""
        with self._reading("key"):
            return key_of(self._group.attrs)

    @property
    def settings(self) -> dict[str, Any]:
        with self._reading("settings"):
            return dict(json.loads(self.attributes.get("settings", "{}")))

    @property
    def labels(self) -> list[str]:
        """Names of the coordinates: rotor, pitch 1, ...; none where neither angles nor rates are stored."""
        if "coordinate" not in self._group:
            return []
        with self._reading("coordinate"):
            return [str(label) for label in files.attributes_of(files.member(self._group, "coordinate"))["labels"]]

    @property
    def names(self) -> list[str]:
        """The datasets it has, scales included."""
        return list(self._group)

    def __contains__(self, name: str) -> bool:
        with self._reading(name):
            return name in self._group

    def array(self, name: str) -> NDArray[Any]:
        """A dataset, whole. Raises StoreError where the run has none of that name, or it is not what was written."""
        if self._kept and name in self._kept:
            return self._kept[name]
        if name not in self:
            raise StoreError(f"{self._group.file.filename}: {self._group.name} has no readable {name}")
        with self._reading(name):
            dataset = files.member(self._group, name)
            values = files.values_of(dataset)
            self._prove(name, lambda: digests.dataset_digest(values, dataset.attrs))
        if self._kept is not None:
            self._kept[name] = values
        return values

    def get(self, name: str) -> NDArray[Any] | None:
        """A dataset, whole; None where the run has none of that name."""
        return self.array(name) if name in self else None

    @functools.cached_property
    def _digests(self) -> dict[str, str]:
        return digests.stored_digests(self._group.attrs)

    def _reading(self, part: str) -> AbstractContextManager[None]:
        return files.reading(self._group.file.filename, f"{self._group.name}: {part}")

    def _prove(self, part: str, found: Callable[[], str]) -> None:
        """Files of earlier versions, and shipped references, have no digests here."""
        if self._verify and self._digests and self._digests.get(part) != found():
            raise StoreError(f"{self._group.file.filename}: {self._group.name}: {part} changed after it was written")


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
def open_results(path: Path, *, verify: bool = True) -> Iterator[OpenResults]:
    """An open results file. What is read of it is compared with its digests, but for verify=False.

    Raises StoreError where `path` is not a results file of this program, or is damaged.
    """
    with files.open_file(path) as file:
        with files.reading(path):
            scenes = {scene.name: scene for scene in _scenes(file, "", verify, {files.address(file)})}
            attributes = files.attributes_of(file)
        yield OpenResults(path, attributes, scenes, file)


def in_memory(opened: OpenResults) -> OpenResults:
    """An open file with its scenes in order, and with arrays that are read once: pages ask for each some six times."""
    scenes = (opened.scenes[name] for name in natural_order(opened.scenes))
    kept = {one.name: {name: replace(run, _kept={}) for name, run in one.runs.items()} for one in scenes}
    return replace(opened, scenes={name: replace(opened.scenes[name], runs=runs) for name, runs in kept.items()})


def is_sweep(path: Path) -> bool:
    """Whether a file of this program is the dataset of a sweep. Raises StoreError where it cannot be read."""
    with files.open_file(path) as file, files.reading(path):
        return SWEEP_IDENTITY in file.attrs


def _scenes(group: Any, name: str, verify: bool, seen: set[int]) -> Iterator[StoredScene]:
    """`seen`: addresses of the groups above and before: each is looked into once."""
    for key, item in files.members(group):
        if not files.is_group(item) or (not name and key in RESERVED_GROUPS) or files.address(item) in seen:
            continue
        seen.add(files.address(item))
        path = f"{name}/{key}" if name else key
        if "scene_hash" in item.attrs:
            known, attributes = digests.stored_digests(item.attrs) if verify else {}, files.attributes_of(item)
            if known and known.get(digests.ATTRIBUTES) != digests.attributes_digest(attributes):
                raise StoreError(f"{item.file.filename}: {item.name}: attributes changed after they were written")
            runs = {run.method: run for run in _runs(item, path, verify)}
            yield StoredScene(path, attributes, runs)
        else:
            yield from _scenes(item, path, verify, seen)


def _runs(group: Any, scene: str, verify: bool) -> Iterator[StoredRun]:
    for model, item in files.members(group):
        if model == REFERENCE:
            yield StoredRun(scene, model, item, verify)
        elif files.is_group(item):
            for integrator, run in files.members(item):
                yield StoredRun(scene, f"{model}/{integrator}", run, verify)


def damages_of(group: Any) -> list[str]:
    """The parts of a group, "attributes" or names of datasets, that are not what was written, are new or are gone.

    "digests" where it has none. Links, and arrays that cannot be read, count too.
    """
    try:
        known = digests.stored_digests(group.attrs)
    except ValueError:
        known = {}
    if not known:
        return [digests.DIGESTS]
    unfilled = digests.unfilled_in(known)
    found = {digests.ATTRIBUTES: _digest(group, attributes_alone=True)}
    for name in group:
        item, is_unfilled = _member(group, name), name in unfilled
        if not files.is_group(item):
            found[digests.unfilled(name) if is_unfilled else name] = _digest(item, attributes_alone=is_unfilled)
    return [name for name in {**known, **found} if known.get(name) != found.get(name)]


def _member(group: Any, name: str) -> Any:
    """None where it is a link, or cannot be read."""
    with suppress(StoreError), files.reading(""):
        return files.member(group, name)
    return None


def _digest(item: Any, *, attributes_alone: bool) -> str:
    """ "" where there is none, or its content cannot be read."""
    with suppress(StoreError), files.reading(""):
        if attributes_alone:
            return digests.attributes_digest(item.attrs)
        return digests.dataset_digest(files.values_of(item), item.attrs)
    return ""


def all_damages(group: Any, seen: set[int] | None = None) -> Iterator[tuple[str, str]]:
    """(path, part) of whatever is damaged in a group and the groups below it; at most once each."""
    seen = set() if seen is None else seen
    if files.address(group) in seen:
        return
    seen.add(files.address(group))
    yield from ((str(group.name).strip("/"), part) for part in damages_of(group))
    for name in group:
        item = _member(group, name)
        if files.is_group(item):
            yield from all_damages(item, seen)
