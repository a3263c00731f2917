"""Which column is which channel, in which unit, sign and zero: from a mapping file, or guessed from the names.

    time = { column = "Time", unit = "ms" }
    rotor = { column = "Azimuth", unit = "deg", sign = -1, offset = 90.0, wrapped = true }
    pitch_1 = "BldPitch1"                   # in the unit that the file states, else rad, rad/s or s
    pitch_1_rate = "theta_dot_1"
    group = "paper/fig08/lagrange/taylor"   # of an HDF5 file, where it has several

A channel is sign * (column + offset), the offset in the column's own unit. What a mapping leaves out is not compared;
the time alone is guessed then. All are guessed where it names a group alone.
"""

from __future__ import annotations

import os
from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Any, Literal

from pydantic import BeforeValidator, Field, create_model

from rotor_mbs.errors import InputError
from rotor_mbs.foreign.channels import ALLOWED_UNITS, BASE_UNITS, TIME, UNITS, Channel, channels, guess, split_unit
from rotor_mbs.foreign.table import DataTable, shown_names
from rotor_mbs.scenario.scene import Scene
from rotor_mbs.scenario.toml_file import TableError, read_toml
from rotor_mbs.scenario.validation import Number, Table, validate, validate_file


class Entry(Table):
    """What a mapping file says of a channel: sign * (column + offset) in `unit`.

    wrapped   whether turns are missing, so that jumps of more than half a turn are taken out
    """

    column: str = Field(description="the name of a column")
    unit: str = Field(default="", description="a unit such as deg")
    sign: Literal[1, -1] = Field(default=1, description="1, -1")
    offset: Number = Field(default=0.0, description="a number, in the column's unit")
    wrapped: bool = Field(default=False, description="true, false")


_OfName = BeforeValidator(lambda value: {"column": value} if isinstance(value, str) else value)


@dataclass(frozen=True)
class Source:
    """Where a channel comes from, in which unit, and whether nobody said so."""

    channel: Channel
    entry: Entry
    unit: str
    assumed: bool

    @property
    def factor(self) -> float:
        return UNITS[self.channel.kind][self.unit.lower()]

    def __str__(self) -> str:
        """A line of the list of what was read."""
        shift = f" {self.entry.offset:+g}" if self.entry.offset else ""
        notes = ", ".join(["unit assumed"] * self.assumed + ["wrapped"] * self.entry.wrapped)
        sign = "-" if self.entry.sign < 0 else ""
        return f"{self.channel.name} = {sign}{self.entry.column!r}{shift} [{self.unit}]" + (notes and f" ({notes})")


def read_mapping(
    columns: str | os.PathLike[str] | Mapping[str, Any] | None, scene: Scene
) -> tuple[dict[str, Entry], str]:
    """An entry by the key of a channel, and the group of an HDF5 file: {} and "" where no mapping is given.

    columns: a TOML file, or a mapping of the same keys. Raises InputError with every fault, a line each.
    """
    if columns is None:
        return {}, ""
    described = Field(None, description="a column's name, or a table with `column`")
    keys: dict[str, Any] = {channel.key: (Annotated[Entry | None, _OfName], described) for channel in channels(scene)}
    keys["group"] = (str, Field("", description="the path of a group in the file"))
    model = create_model("MappingTable", __base__=Table, **keys)
    try:
        if isinstance(columns, Mapping):
            name, found = "columns", dict(validate(model, columns))
        else:
            name, (text, tables) = str(columns), read_toml(Path(columns))
            found = dict(validate_file(model, tables, text, name))
    except TableError as error:
        raise InputError(f"columns: {problem.message}" for problem in error.problems) from error
    group = found.pop("group")
    entries = {key: entry for key, entry in found.items() if entry is not None}
    if entries.keys() == {TIME} or not (entries or group):
        raise InputError(f"{name}: no channel to compare; allowed: {', '.join(found)}")
    return entries, group


def sources(table: DataTable, scene: Scene, entries: Mapping[str, Entry]) -> list[Source]:
    """Where each channel comes from, the time first. Raises InputError where there is no time or nothing else."""
    known = channels(scene)
    guessed = _guesses(table, known, {TIME} if entries else {one.name for one in known})
    found = []
    for channel in known:
        if channel.key in entries or channel.name in guessed:
            entry = entries.get(channel.key) or Entry(column=guessed[channel.name])
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


def _source(table: DataTable, channel: Channel, entry: Entry) -> Source:
    """Raises InputError for a column that is not there, and a unit that is none of the channel."""
    stated = table[entry.column].unit or split_unit(entry.column)[1]
    unit = entry.unit or stated
    if unit and unit.lower() not in UNITS[channel.kind]:
        raise InputError(
            f"{table.source}: column {entry.column!r} for {channel.name} is in {unit!r}; allowed: "
            f"{ALLOWED_UNITS[channel.kind]}"
        )
    return Source(channel, entry, unit or BASE_UNITS[channel.kind], assumed=not unit)
