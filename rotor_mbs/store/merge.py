"""Many results files into one, atomically: the pieces of a batch, and what was stored before. Judges nothing."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

from rotor_mbs.errors import StoreError
from rotor_mbs.scenario.names import RESERVED_GROUPS
from rotor_mbs.store import hdf5
from rotor_mbs.store.bench import GROUP as BENCH
from rotor_mbs.store.bench import leaves
from rotor_mbs.store.read import open_results
from rotor_mbs.store.stability import GROUP as STABILITY

_GROUPS_OF_RECORDS = (BENCH, STABILITY)


def merge(path: Path, sources: Sequence[Path], versions: Mapping[str, str]) -> None:
    """All runs of `sources` into `path`, atomically; `path` may itself be among the sources.

    A later run takes the place of an earlier one of the same scene and method. Runs of a scene whose numbers have
    changed since (another scene_hash than in the last source that has it) belong to another rotor and are left out.
    The same holds for bench curves and stability records; other groups that are not scenes come from the last source
    that has them. Raises StoreError, also where a source is not a batch's.
    """
    for source in sources:
        refuse_other_kinds(source)
    runs, others = _plan(sources)
    with hdf5.new_file(path) as file:
        hdf5.put_attributes(file, {**versions, "created": datetime.now(UTC).isoformat(timespec="seconds")})
        for scene_name in sorted(runs):
            for source, methods in _by_source(runs[scene_name]).items():
                with open_results(source) as results:
                    _copy_scene(file, results.root[scene_name], scene_name, methods)
        for name, source in others.items():
            with open_results(source) as results:
                hdf5.copy_group(results.root[name], hdf5.new_group(file, name))
        for source, names in _by_source(_plan_records(sources)).items():
            with open_results(source) as results:
                for name in names:
                    hdf5.copy_group(results.root[name], hdf5.new_group(file, name))


def refuse_other_kinds(path: Path) -> None:
    """Raises StoreError where `path` holds what a merge would not carry over: a sweep's dataset, which has its arrays
    at the root, where a batch has groups alone."""
    if not path.exists():
        return
    with open_results(path) as results:
        if not all(hdf5.is_group(member) for member in results.root.values()):
            raise StoreError(f"{path}: holds the dataset of a sweep; allowed: another output file")


def _plan(sources: Iterable[Path]) -> tuple[dict[str, dict[str, Path]], dict[str, Path]]:
    """Scene -> method -> the source to take it from; and for groups that are not scenes, name -> source."""
    latest: dict[str, tuple[str, dict[str, Path]]] = {}
    others: dict[str, Path] = {}
    for source in sources:
        with open_results(source) as results:
            others |= {
                name: source for name in RESERVED_GROUPS if name in results.root and name not in _GROUPS_OF_RECORDS
            }
            for scene in results.scenes.values():
                number = scene.attributes["scene_hash"]
                known, runs = latest.get(scene.name, (number, {}))
                kept = runs if known == number else {}
                latest[scene.name] = (number, {**kept, **dict.fromkeys(scene.runs, source)})
    return {name: runs for name, (_, runs) in latest.items()}, others


def _plan_records(sources: Iterable[Path]) -> dict[str, Path]:
    """Path of every curve and stability record in the files -> the source to take it from."""
    latest: dict[str, tuple[str, dict[str, Path]]] = {}
    for source in sources:
        with open_results(source) as results:
            for group in _GROUPS_OF_RECORDS:
                for name, record in leaves(results.root[group], group) if group in results.root else ():
                    scene = name.rsplit("/", 2)[0]
                    number = str(record.attrs.get("scene_hash", ""))
                    known, records = latest.get(scene, (number, {}))
                    latest[scene] = (number, {**(records if known == number else {}), name: source})
    return {name: source for _, records in latest.values() for name, source in records.items()}


def _by_source(runs: Mapping[str, Path]) -> dict[Path, list[str]]:
    grouped: dict[Path, list[str]] = {}
    for method, source in sorted(runs.items()):
        grouped.setdefault(source, []).append(method)
    return grouped


def _copy_scene(file: Any, scene: Any, name: str, methods: Iterable[str]) -> None:
    target = hdf5.new_group(file, name)
    target.attrs.update(scene.attrs)
    for method in methods:
        hdf5.copy_group(scene[method], hdf5.new_group(target, method))
