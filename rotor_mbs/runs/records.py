"""Records beside the runs of a results file: arrays and attributes in a group of their own.

    /bench/<scene>/<method>                  error against run time over `setting`
    /stability/<kind>/<scene>/<method>       step ladders, stability limits and conservation over `row`
    /errata                                  the check of the printed entries over `row`
    /modes/<scene>/<model>/<kind>            modes over speed; its arrays have dimensions of their own
    /claims/shares, /claims/numbers          the paper's claims from many starts, its numbers under other conditions
    /comparison/<scene>/data/trajectory      data of another program and the reference at their times
Writes and reads them; judges nothing.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from rotor_mbs.errors import StoreError
from rotor_mbs.runs import files
from rotor_mbs.runs.digests import DIGESTS
from rotor_mbs.runs.layout import Column, key_of
from rotor_mbs.runs.read import damages_of
from rotor_mbs.solution.status import STATUSES, recode

# The scene's place in a record of how cost scales with blades or duration.
COST_SCALING = "growth"

# By kind.
_FOLDERS = {
    folder.rpartition("/")[2]: folder
    for folder in (
        "bench", "stability/steps", "stability/limits", "stability/conservation", "errata", "modes", "claims",
        "comparison",
    )
}  # fmt: skip
_DIMENSIONS = {"bench": "setting"}  # of the others: row
_SETTING_UNITS = {"step": "s", "tolerance": "1", "blades": "1", "duration": "s"}
_INTEGERS = ("repeats", "steps", "status", "false_success")

# Units and long name of every array over rows or settings that a record, or the summary of the runs, may have.
COLUMNS = {
    "angle_error_max": ("rad", "largest angle error up to the horizon"),
    "angle_error_end": ("rad", "angle error at the last sample"),
    "tip_error_max": ("m", "largest distance of a tip from the reference up to the horizon"),
    "energy_drift_max": ("1", "largest energy error over the run, of the energy scale"),
    "horizon_s": ("s", "last sample before the error growth reaches 1e5, or the end"),
    "time_reached": ("s", "time of the last sample"),
    "run_time_s": ("s", "median run time of the integration alone"),
    "run_time_min_s": ("s", "shortest run time"),
    "run_time_q1_s": ("s", "lower quartile of the run times"),
    "run_time_q3_s": ("s", "upper quartile of the run times"),
    "setup_time_s": ("s", "building the model, everything compiled anew"),
    "setup_again_time_s": ("s", "building the model a second time"),
    "output_time_s": ("s", "reading out and computing the samples"),
    "simulated_s": ("s", "duration of the scene"),
    "repeats": ("1", "timed runs"),
    "steps": ("1", "steps of one run"),
    "status": ("1", "how the run ended, from its state"),
    "false_success": ("1", "1 where the engine reported success and the state says otherwise"),
    "step": ("s", "fixed step"),
    "time": ("s", "time"),
    "energy_drift_rms": ("1", "energy error over perturbed starts, root mean square, of its scale"),
    "difference": ("1", "largest relative difference of a printed entry from the derivative"),
    "agrees": ("1", "1 where the printed entry is the derivative"),
    "duration": ("s", "duration of the runs"),
    "share": ("1", "share of the deciding runs in which the claim holds"),
    "deciding": ("1", "runs that decide, of those from moved starts"),
    "relative_tolerance": ("1", "relative tolerance of ode45"),
    "absolute_tolerance": ("rad", "absolute tolerance of ode45, also in rad/s"),
    "remainder": ("N m", "moment of the weights at the start of Fig. 5, zero but for rounding"),
    "angle": ("rad", "the number where it is an angle, else NaN"),
    "rate": ("rad/s", "the number where it is a rate, else NaN"),
    "reproduced": ("1", "1 where the number has the printed digits"),
}


@dataclass(frozen=True)
class Record:
    """What a study stores beside runs.

    Attributes
    ----------
    kind : "bench", "steps", "limits", "conservation", "errata", "modes", "claims" or "comparison".
    scene : "paper/fig05"; "" where the record belongs to no scene.
    name : "lagrange/taylor"; of a bench with its fixed choices behind, where they are not the default ones.
    attributes : plain values; the key of what decides the numbers among them.
    arrays : (rows,) by name; `status` as codes of `solution.status.STATUSES`.
    columns : what the arrays are, scales first, where they are not the ones of all studies; for writing alone.
    """

    kind: str
    scene: str
    name: str
    attributes: Mapping[str, Any] = field(default_factory=dict)
    arrays: Mapping[str, NDArray[Any]] = field(default_factory=dict)
    columns: Mapping[str, Column] = field(default_factory=dict)

    @property
    def path(self) -> str:
        """The group in a results file."""
        return "/".join(part for part in (_FOLDERS[self.kind], self.scene, self.name) if part)

    @property
    def method(self) -> str:
        return str(self.attributes.get("method", self.name))

    @property
    def key(self) -> str:
        """`Case.key` of what decides the record; "" where it has none."""
        return key_of(self.attributes)

    @property
    def statuses(self) -> list[str]:
        return [STATUSES[int(code)] for code in self.arrays["status"]]

    @property
    def messages(self) -> list[str]:
        """One for each row."""
        return [str(text) for text in self.attributes.get("messages", [""] * len(self.arrays["status"]))]


def write_records(path: Path, records: Sequence[Record]) -> None:
    """A results file with these records alone, atomically. Raises StoreError."""
    with files.new_file(path) as file:
        for record in records:
            _put_record(file, record)


def _put_record(file: Any, record: Record) -> None:
    group = files.new_group(file, record.path)
    files.put_attributes(group, {"record": 1, **record.attributes})
    for name, column in record.columns.items():
        dataset = files.put(group, name, np.asarray(record.arrays[name]), column)
        if f"{name}_labels" in record.attributes:
            files.put_attributes(dataset, {"labels": record.attributes[f"{name}_labels"]})
    if record.columns:
        return
    dimension = _DIMENSIONS.get(record.kind, "row")
    if dimension == "setting":
        kind = str(record.attributes["setting_kind"])
        scale = Column((dimension,), _SETTING_UNITS[kind], kind)
        files.put_attributes(files.put(group, dimension, record.arrays[dimension], scale), {"kind": kind})
    elif record.arrays:
        rows = np.arange(len(next(iter(record.arrays.values()))))
        files.put(group, dimension, rows, Column((dimension,), "1", "number of the row"))
    for name, (units, long_name) in COLUMNS.items():
        if name in record.arrays:
            values = np.asarray(record.arrays[name])
            values = values.astype(np.int64) if name in _INTEGERS else values
            dataset = files.put(group, name, values, Column((dimension,), units, long_name))
            if name == "status":
                files.put_flags(dataset, STATUSES)


def read_records(path: Path, *kinds: str) -> list[Record]:
    """The records of a results file, of these kinds or of all, in the order of the file. Raises StoreError."""
    with files.open_file(path) as file, files.reading(path):
        return [read_record(name, group) for name, group in records_in(file, *kinds)]


def records_in(file: Any, *kinds: str) -> Iterator[tuple[str, Any]]:
    """(path, group) of every record in an open file, of these kinds or of all."""
    for kind in kinds or _FOLDERS:
        folder = _FOLDERS[kind]
        if folder in file:
            yield from _leaves(file[folder], folder)


def _leaves(group: Any, path: str) -> Iterator[tuple[str, Any]]:
    """A record has arrays, or says that it is one; the errata are one record."""
    if "record" in group.attrs or path == "errata" or not all(files.is_group(item) for item in group.values()):
        yield path, group
    else:
        for name, item in files.members(group):
            yield from _leaves(item, f"{path}/{name}")


def read_record(path: str, group: Any) -> Record:
    """The record in a group of an open file, by its path in the file. Raises StoreError where it is damaged."""
    damages = [part for part in damages_of(group) if part != DIGESTS]
    if damages:
        raise StoreError(f"{group.file.filename}: {path}: {', '.join(damages)} changed after they were written")
    kind = next(kind for kind, folder in _FOLDERS.items() if path == folder or path.startswith(f"{folder}/"))
    parts = path.removeprefix(_FOLDERS[kind]).strip("/").split("/")
    arrays = {name: item[()] for name, item in group.items() if name != "row" and not files.is_group(item)}
    if "status" in arrays:
        arrays["status"] = recode(arrays["status"], group["status"].attrs)
    return Record(kind, "/".join(parts[:-2]), "/".join(parts[-2:]), files.attributes_of(group), arrays)
