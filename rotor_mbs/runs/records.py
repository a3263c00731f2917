"""What studies store beside runs: tables of points, and groups of arrays with dimensions of their own.

/bench                          a row per point of a curve: a method at one setting on a scene
/stability                      a row per step of a ladder: a fixed-step method on a scene
/modes/<scene>/<model>/<kind>   modes over speed, in a file of modes
/comparison/<scene>/data/trajectory   data of another program and the reference at their times; modes: over speed
"""

from __future__ import annotations

import json
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from rotor_mbs.errors import StoreError
from rotor_mbs.runs import files
from rotor_mbs.runs.files import Column
from rotor_mbs.runs.results import TableFile
from rotor_mbs.runs.table import (
    COLUMNS,
    MISSING,
    Table,
    known_columns,
    text_of,
)
from rotor_mbs.runs.versions import machine, versions
from rotor_mbs.solution.status import STATUSES, code_of

_MESSAGE_LENGTH = 300


# The computed columns of each table of points.
POINT_COLUMNS: Mapping[str, Mapping[str, Column]] = {
    table: {name: COLUMNS[name] for name in names.split()}
    for table, names in {
        "bench": "status message angle_error_max angle_error_end tip_error_max energy_drift_max defect_max "
        "defect_median zero_pitch_max run_time_s run_time_min_s run_time_q1_s run_time_q3_s setup_time_s "
        "setup_again_time_s output_time_s repeats steps "
        "false_success left_out horizon_s uncertainty_rad samples load_before pinned_core repeatable order crc32",
        "stability": "status message angle_error_max energy_drift_max false_success step_for_target_s crc32",
    }.items()
}
_NUMBERS = ("step", "tolerance", "order_expected")  # that the design says of a point


@dataclass(frozen=True)
class Record:
    """A curve of a bench, a ladder of steps, or another group of arrays that belong together.

    kind: a key of `POINT_COLUMNS`, "modes" or "comparison". name: the method, "lagrange/taylor"; of a bench with its
    fixed choices behind, where they are not the default ones. arrays: (rows,) by name; `status` as codes of
    `solution.status.STATUSES`. columns: what the arrays are, scales first; of groups of arrays alone.
    """

    kind: str
    scene: str
    name: str
    attributes: Mapping[str, Any] = field(default_factory=dict)
    arrays: Mapping[str, NDArray[Any]] = field(default_factory=dict)
    columns: Mapping[str, Column] = field(default_factory=dict)

    @property
    def method(self) -> str:
        return str(self.attributes.get("method", self.name))

    @property
    def statuses(self) -> list[str]:
        return [STATUSES[int(code)] for code in self.arrays["status"]]

    @property
    def messages(self) -> list[str]:
        """One for each row."""
        return [str(text) for text in self.attributes.get("messages", [""] * len(self.arrays["status"]))]


# Tables of points


def points_table(group: str, points: Sequence[Mapping[str, object]]) -> Table:
    """The table `group` of these points: of each the known columns by name."""
    runs = [str(point["run"]) for point in points]
    return Table(group, runs, known_columns(points), POINT_COLUMNS[group], characters=_MESSAGE_LENGTH)


def read_records(path: Path, *kinds: str) -> list[Record]:
    """The records of these kinds, in the order of the file; no curve of which a point is missing. Raises StoreError."""
    with files.open_file(path) as file, files.reading(path):
        there = [kind for kind in kinds if kind in file]
        tables = [kind for kind in there if kind in POINT_COLUMNS]
        groups = [record for kind in there if kind not in tables for record in _group_records(file, kind)]
        has_points = {kind for kind in tables if "run" in file[kind]}
    if not has_points:
        return groups
    stored = TableFile(path)
    return [record for kind in kinds if kind in has_points for record in _point_records(stored, kind)] + groups


def _point_records(file: TableFile, kind: str) -> Iterator[Record]:
    """The rows of a table that belong to one curve or one ladder."""
    stored = file.table(kind)
    statuses = stored.statuses()
    columns = stored.place().read(len(stored.runs)) | {
        name: stored.known[name] for name in _NUMBERS if name in stored.known
    }
    names = stored.known.get("curve", stored.known["method_name"])
    owners = list(zip(stored.known["scene"], names, strict=True))
    for scene, name in dict.fromkeys(owners):
        own = [i for i, owner in enumerate(owners) if owner == (scene, name)]
        if (statuses[own] == MISSING).any():
            continue
        known = file.known(kind, own[0])
        arrays = {column: values[own] for column, values in columns.items()}
        setting_kind = str(known.get("setting_kind", "step"))
        arrays["setting"] = arrays[setting_kind]
        facts: dict[str, Any] = {
            column: value
            for column, values in arrays.items()
            if column not in ("status", "message", "setting") and (value := values[0].item()) == value
        }
        messages = [text_of(text) for text in arrays.pop("message")]
        if kind == "stability":  # without steps that were not needed
            used = arrays["status"] != code_of("left_out")
            arrays = {column: array[used] for column, array in arrays.items()}
        facts |= {"messages": messages, "method": known["method_name"], "setting_kind": setting_kind}
        facts |= {column: known[column] for column in ("scene_hash", "versions") if column in known}
        yield Record(kind, scene, name, facts | json.loads(known.get("options", "{}")), arrays)


# Groups of arrays


def write_records(path: Path, records: Sequence[Record]) -> None:
    """A file with these records alone, atomically. Raises StoreError."""
    with files.new_file(path) as file:
        files.put_attributes(file, {**versions(), **machine()})
        for record in records:
            group = files.new_group(file, "/".join((record.kind, record.scene, record.name)))
            files.put_attributes(group, {"record": 1, **record.attributes})
            for name, column in record.columns.items():
                dataset = files.put(group, name, np.asarray(record.arrays[name]), column)
                if f"{name}_labels" in record.attributes:
                    files.put_attributes(dataset, {"labels": record.attributes[f"{name}_labels"]})
        files.seal_all(file)


def _group_records(file: Any, kind: str) -> Iterator[Record]:
    for group in files.groups_in(file[kind]):
        if "record" not in group.attrs:
            continue
        damages = [part for part in files.damages_of(group) if part != files.DIGESTS]
        path = str(group.name).strip("/")
        if damages:
            raise StoreError(f"{file.filename}: {path}: {', '.join(damages)} changed after they were written")
        parts = path.removeprefix(f"{kind}/").split("/")
        columns = files.columns_of(group)
        arrays = {name: files.values_of(group[name]) for name in columns}
        scales_first = dict(sorted(columns.items(), key=lambda column: column[1].dimensions != (column[0],)))
        scene, name = "/".join(parts[:-2]), "/".join(parts[-2:])
        yield Record(kind, scene, name, files.attributes_of(group), arrays, scales_first)
