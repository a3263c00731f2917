"""A results file as the place where records are kept: which keys it has, and new records merged in. Judges nothing."""

from __future__ import annotations

import math
from collections.abc import Collection, Iterator, Mapping, Sequence
from dataclasses import dataclass
from datetime import UTC, datetime
from functools import lru_cache
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from rotor_mbs.errors import StoreError
from rotor_mbs.runs import files
from rotor_mbs.runs.digests import DIGESTS
from rotor_mbs.runs.layout import KEYWORDS, LIMIT, TOGETHER, Column, key_of
from rotor_mbs.runs.lock import writing
from rotor_mbs.runs.read import OpenResults, StoredRun, all_damages, is_sweep, open_results
from rotor_mbs.runs.records import COLUMNS, records_in
from rotor_mbs.runs.versions import machine, versions
from rotor_mbs.scenario.catalogue import RESERVED_GROUPS
from rotor_mbs.solution.status import STATUSES, code_of

# Attributes of a run, as columns of the summary; NaN where a run has none.
_NUMBERS = (
    "angle_error_max", "angle_error_end", "tip_error_max", "energy_drift_max", "horizon_s", "time_reached",
    "setup_time_s", "run_time_s", "output_time_s", "steps",
)  # fmt: skip


@dataclass(frozen=True)
class ResultsStore:
    """The results file at `path`, which need not be there yet.

    time_limit_s   runs that were ended by a shorter one do not count as stored
    """

    path: Path
    time_limit_s: float = 0.0

    def stored_keys(self) -> set[str]:
        """Keys of all runs and records in the file that are what was written. Raises StoreError."""
        refuse_other_kinds(self.path)
        if not self.path.exists():
            return set()
        state = self.path.stat()
        limits = _verified_keys(self.path, (state.st_ino, state.st_mtime_ns, state.st_size))
        return {key for key, limit in limits.items() if limit >= self.time_limit_s}

    def merge(self, parts: Sequence[Path], without: Collection[str] = frozenset()) -> None:
        """The records of `parts` into the file, atomically, and those of these keys out of it. Raises StoreError."""
        with writing(self.path):
            sources = [self.path, *parts] if self.path.exists() else parts
            merge(self.path, sources, {**versions(), **machine()}, without)


@lru_cache(maxsize=8)
def _verified_keys(path: Path, _state: tuple[int, int, int]) -> dict[str, float]:
    """The time limit (s) that ended it, or infinity, by the key of every run and record that is what was written.

    Of the file in this state (inode, time of change, size): read and verified once, and not again for each job.
    """
    with open_results(path, verify=False) as results, files.reading(path):
        damaged = {place for place, part in all_damages(results.root) if part != DIGESTS}
        runs = {f"{scene.name}/{run.method}": run for scene in results.scenes.values() for run in scene.runs.values()}
        return {
            key: _ended_by(runs[name]) if name in runs else math.inf
            for above, _, name, key in _members(results)
            if key and not damaged & {above, name}
        }


def _ended_by(run: StoredRun) -> float:
    is_over = run.status == "timed_out" and "frozen_with" not in run.attributes
    return float(run.attributes.get(LIMIT, 0.0)) if is_over else math.inf


def merge(
    path: Path, sources: Sequence[Path], versions: Mapping[str, str], without: Collection[str] = frozenset()
) -> None:
    """All runs and records of `sources` into `path`, atomically; `path` may itself be among the sources.

    A later run or record takes the place of an earlier one of the same name. Those of a scene whose numbers have
    changed since (another scene_hash than in the last source that has it) belong to another rotor and are left out;
    so are older ones of records that are replaced together (`layout.TOGETHER`).

    Parameters
    ----------
    versions : attributes of the new file, beside the time of its creation.
    without : keys of what is left out.

    Raises
    ------
    StoreError
        Where a file cannot be read or written, or `path` is the dataset of a sweep.
    """
    refuse_other_kinds(path)
    plan = _plan(sources, without)
    with files.new_file(path) as file:
        created = datetime.now(UTC).isoformat(timespec="seconds")
        files.put_attributes(file, {**_description(plan), **versions, "created": created, "date_created": created})
        for owner in sorted(plan, key=lambda name: (name.split("/")[0] in RESERVED_GROUPS, name)):
            for source, names in _by_source(plan[owner]).items():
                with files.open_file(source) as root, files.reading(source):
                    for name in names:
                        files.copy_group(root[name], file, name)
                    attributes = dict(root[owner].attrs)
            files.new_group(file, owner).attrs.update(attributes)
        _put_summary(file, [(owner, name.removeprefix(f"{owner}/")) for owner, name in _runs_in(plan)])


def refuse_other_kinds(path: Path) -> None:
    """Raises StoreError where `path` has what a merge would not carry over: a sweep's dataset."""
    if path.exists() and is_sweep(path):
        raise StoreError(f"{path}: holds the dataset of a sweep; allowed: another output file")


def _members(results: OpenResults) -> Iterator[tuple[str, str, str, str]]:
    """(group above, what it belongs to, group, key) of every run and record in an open file."""
    for scene in results.scenes.values():
        for method, run in scene.runs.items():
            owner = str(scene.attributes["scene_hash"])
            yield scene.name, owner, f"{scene.name}/{method}", run.key
    for name, group in records_in(results.root):
        above = "/".join(name.split("/")[:-2]) or name
        owner = group.attrs.get(TOGETHER, group.attrs.get("scene_hash", ""))
        yield above, str(owner), name, key_of(group.attrs)


def _plan(sources: Sequence[Path], without: Collection[str]) -> dict[str, dict[str, Path]]:
    """Group above -> group -> the source to take it from."""
    latest: dict[str, tuple[str, dict[str, Path]]] = {}
    for source in sources:
        with open_results(source, verify=False) as results, files.reading(source):
            for above, owner, name, key in _members(results):
                if key not in without or not key:
                    known, groups = latest.get(above, (owner, {}))
                    latest[above] = (owner, {**(groups if known == owner else {}), name: source})
    return {above: groups for above, (_, groups) in latest.items()}


def _description(plan: Mapping[str, Mapping[str, Path]]) -> dict[str, object]:
    """Title, summary and keywords as the ACDD conventions ask for them."""
    runs = list(_runs_in(plan))
    scenes = len({scene for scene, _ in runs})
    summary = f"{len(runs)} runs of {scenes} scenes: trajectories, energies, status and errors of each"
    records = sorted({owner.split("/")[0] for owner in plan} & set(RESERVED_GROUPS))
    if records:
        summary += f"; records of {', '.join(records)}"
    return {"title": "Rotor models compared", "summary": summary, "keywords": KEYWORDS}


def _runs_in(plan: Mapping[str, Mapping[str, Path]]) -> Iterator[tuple[str, str]]:
    """(scene, group) of every run, in the order of the file."""
    for owner in sorted(plan):
        if owner.split("/")[0] not in RESERVED_GROUPS:
            yield from ((owner, name) for names in _by_source(plan[owner]).values() for name in names)


def _by_source(groups: Mapping[str, Path]) -> dict[Path, list[str]]:
    found: dict[Path, list[str]] = {}
    for name, source in sorted(groups.items()):
        found.setdefault(source, []).append(name)
    return found


def _put_summary(file: Any, runs: Sequence[tuple[str, str]]) -> None:
    """The table `summary`, a row for each run (scene, method) of an open, new file; none where it holds no run.

    So that a reader need not walk through the groups.
    """
    if not runs:
        return
    group = files.new_group(file, "summary")
    files.put_attributes(group, {"title": "all runs of this file"})
    files.put(group, "row", np.arange(len(runs)), Column(("row",), "1", "number of the row"))
    for column, what, names in zip(("scene", "solver"), ("scene", "method"), zip(*runs, strict=True), strict=True):
        labels = list(dict.fromkeys(names))
        codes = np.array([labels.index(name) for name in names], np.int32)
        described = Column(("row",), "1", f"{what}, as a number of its attribute labels")
        files.put_attributes(files.put(group, column, codes, described), {"labels": labels})
    facts = [file[f"{scene}/{method}"].attrs for scene, method in runs]
    statuses = (str(one.get("status")) for one in facts)
    codes = np.array([code_of(status) if status in STATUSES else -1 for status in statuses], np.int8)
    files.put_flags(files.put(group, "status", codes, Column(("row",), *COLUMNS["status"])), STATUSES)
    for name in _NUMBERS:
        files.put(group, name, _numbers([one.get(name) for one in facts]), Column(("row",), *COLUMNS[name]))


def _numbers(values: Sequence[object]) -> NDArray[np.float64]:
    return np.array([float(value) if isinstance(value, (int, float, np.number)) else np.nan for value in values])
