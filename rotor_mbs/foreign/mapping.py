"""Which column is which channel, in which unit, sign and zero: from a mapping file, or guessed from the names.

    time = { column = "Time", unit = "ms" }
    rotor = { column = "Azimuth", unit = "deg", sign = -1, offset = 90.0, wrapped = true }
    pitch_1 = "BldPitch1"                   # in the unit that the file states, else rad, rad/s or s
    pitch_1_rate = "theta_dot_1"
    group = "paper/fig08/lagrange/taylor"   # of an HDF5 file, where it has several

A channel is sign * (column + offset), the offset in the column's own unit. What a mapping leaves out is not compared;
the time alone is guessed then.
"""

from __future__ import annotations

import difflib
import math
from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from rotor_mbs.errors import InputError
from rotor_mbs.foreign.channels import ALLOWED_UNITS, BASE_UNITS, TIME, UNITS, Channel, channels, guess, split_unit
from rotor_mbs.foreign.table import DataTable, shown_names
from rotor_mbs.scenario.scene import Scene
from rotor_mbs.scenario.toml_file import read_toml

_KEYS = ("column", "unit", "sign", "offset", "wrapped")


@dataclass(frozen=True)
class Source:
    """Where a channel comes from: sign * (column + offset) in `unit`.

    wrapped   whether turns are missing, so that jumps of more than half a turn are taken out
    assumed   whether nobody said which unit it is
    """

    channel: Channel
    column: str
    unit: str
    sign: float = 1.0
    offset: float = 0.0
    wrapped: bool = False
    assumed: bool = False

    @property
    def factor(self) -> float:
        return UNITS[self.channel.kind][self.unit.lower()]

    def __str__(self) -> str:
        """A line of the list of what was read."""
        shift = f" {self.offset:+g}" if self.offset else ""
        notes = ["unit assumed"] * self.assumed + ["wrapped"] * self.wrapped
        sign = "-" if self.sign < 0.0 else ""
        return f"{self.channel.name} = {sign}{self.column!r}{shift} [{self.unit}]" + (
            f" ({', '.join(notes)})" if notes else ""
        )


@dataclass(frozen=True)
class ColumnMapping:
    """What a mapping file says; `entries` by the key of a channel. `group`: of an HDF5 file."""

    name: str
    entries: Mapping[str, Mapping[str, Any]]
    group: str = ""


def read_mapping(columns: str | Path | Mapping[str, Any] | None, scene: Scene) -> ColumnMapping | None:
    """From a TOML file or a mapping of the same keys. Raises InputError with every fault, a line each."""
    if columns is None:
        return None
    name, tables = ("columns", columns) if isinstance(columns, Mapping) else (str(columns), read_toml(Path(columns))[1])
    keys = [channel.key for channel in channels(scene)]
    problems, entries = [], {}
    for key, value in tables.items():
        if key == "group":
            continue
        entry = {"column": value} if isinstance(value, str) else value
        if key not in keys:
            near = difflib.get_close_matches(key, keys, n=1)
            problems.append(f"{name}: {key}: no such channel; allowed: {near[0] if near else ', '.join(keys)}")
        elif not isinstance(entry, Mapping) or not isinstance(entry.get("column"), str):
            problems.append(f"{name}: {key}: names no column; allowed: a column's name, or a table with `column`")
        else:
            problems += [f"{name}: {key}.{fault}" for fault in _faults(entry)]
            entries[key] = entry
    group = tables.get("group", "")
    if not isinstance(group, str):
        problems.append(f"{name}: group: {group!r}; allowed: the path of a group in the file")
    if not problems and set(entries) <= {TIME}:
        problems.append(f"{name}: no channel to compare; allowed: {', '.join(keys[1:])}")
    if problems:
        raise InputError(problems)
    return ColumnMapping(name, entries, group)


def _faults(entry: Mapping[str, Any]) -> list[str]:
    faults = [f"{key}: no such key; allowed: {', '.join(_KEYS)}" for key in entry if key not in _KEYS]
    if not isinstance(entry.get("unit", ""), str):
        faults.append("unit: no text; allowed: a unit such as deg")
    if entry.get("sign", 1) not in (1, -1):
        faults.append(f"sign: {entry['sign']!r}; allowed: 1, -1")
    offset = entry.get("offset", 0.0)
    if isinstance(offset, bool) or not isinstance(offset, int | float) or not math.isfinite(offset):
        faults.append(f"offset: {offset!r}; allowed: a number, in the column's unit")
    if not isinstance(entry.get("wrapped", False), bool):
        faults.append(f"wrapped: {entry['wrapped']!r}; allowed: true, false")
    return faults


def sources(table: DataTable, scene: Scene, mapping: ColumnMapping | None) -> list[Source]:
    """Where each channel comes from, the time first. Raises InputError where there is no time or nothing else."""
    known = channels(scene)
    guessed = _guesses(table, known, {TIME} if mapping else {one.name for one in known})
    entries = mapping.entries if mapping else {}
    found = []
    for channel in known:
        entry = entries.get(channel.key) or ({"column": guessed[channel.name]} if channel.name in guessed else None)
        if entry is not None:
            found.append(_source(table, channel, entry))
    shown = shown_names(list(table.columns))
    if not found or found[0].channel.name != TIME:
        raise InputError(f"{table.source}: no column for the time; it has: {shown}; allowed: `time` in a mapping file")
    if len(found) == 1:
        raise InputError(
            f"{table.source}: no column for an angle or a rate; it has: {shown}; allowed: a mapping file (columns)"
        )
    return found


def _guesses(table: DataTable, known: Sequence[Channel], wanted: set[str]) -> dict[str, str]:
    """Column by the name of a channel. Raises InputError where two columns could be one channel."""
    vectors = Counter(name.rpartition("[")[0] for name in table.columns if name.endswith("]"))
    found: dict[str, str] = {}
    for name in table.columns:
        channel = guess(name, vectors[name.rpartition("[")[0]], known)
        if channel is None or channel.name not in wanted:
            continue
        if channel.name in found:
            raise InputError(
                f"{table.source}: both {found[channel.name]!r} and {name!r} could be {channel.name}; allowed: "
                f"`{channel.key}` in a mapping file says which"
            )
        found[channel.name] = name
    return found


def _source(table: DataTable, channel: Channel, entry: Mapping[str, Any]) -> Source:
    """Raises InputError for a column that is not there, and a unit that is none of the channel."""
    column = entry["column"]
    stated = table[column].unit or split_unit(column)[1]
    unit = entry.get("unit") or stated
    if unit and unit.lower() not in UNITS[channel.kind]:
        raise InputError(
            f"{table.source}: column {column!r} for {channel.name} is in {unit!r}; allowed: "
            f"{ALLOWED_UNITS[channel.kind]}"
        )
    return Source(
        channel, column, unit or BASE_UNITS[channel.kind], float(entry.get("sign", 1)), float(entry.get("offset", 0.0)),
        entry.get("wrapped", False), assumed=not unit,
    )  # fmt: skip
