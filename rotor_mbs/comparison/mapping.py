"""Which column is which channel, in which unit, sign and zero: from a mapping file, or by names.

A channel is sign * (column + offset), the offset in the column's own unit. What a mapping leaves
out is not compared; the time (or speed) alone is known by its name then. All are known by their
names where a mapping has a group alone. See docs/compare.md.
"""

from __future__ import annotations

import os
from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

from rotor_mbs.comparison.channels import (
    FREQUENCY_NAMES,
    LOAD_NAMES,
    SPEED,
    TIME,
    Channel,
    channel_from_name,
    channels,
    mode_channels,
    split_unit,
)
from rotor_mbs.comparison.columns import ALLOWED_UNITS, UNITS, DataTable, shown_names
from rotor_mbs.errors import InputError
from rotor_mbs.scenario import keys
from rotor_mbs.scenario.keys import Kind, file_key
from rotor_mbs.scenario.scene import Scene
from rotor_mbs.scenario.toml_file import TableError, read_toml

_SIGN = keys.restricted(keys.whole(-1, 1), bool, "1, -1")


@dataclass(frozen=True)
class ColumnMapping:
    """Where a channel comes from: sign * (column + offset) in `unit`.

    Attributes
    ----------
    wrapped : whether turns are missing, so that jumps of more than half a turn are taken out.
    frame : of a load, "" for that of the scene's loads.
    """

    column: str = file_key("column", Kind(keys.read_text, "the name of a column"))
    unit: str = file_key("unit", Kind(keys.read_text, "a unit such as deg"), default="")
    sign: int = file_key("sign", _SIGN, default=1)
    offset: float = file_key("offset", keys.NUMBER, note=", in the column's unit", default=0.0)
    wrapped: bool = file_key("wrapped", keys.FLAG, default=False)
    frame: str = file_key("frame", keys.choice(("blade", "rotor", "base")), default="")


@dataclass(frozen=True)
class DataMapping:
    """What is said of the columns of data.

    Attributes
    ----------
    columns : by the key of a channel; empty where channels are known by the names of columns.
    group : of an HDF5 file.
    omitted : names of channels that are neither compared nor missed.
    """

    columns: Mapping[str, ColumnMapping] = field(default_factory=dict)
    group: str = ""
    omitted: tuple[str, ...] = ()


def _read_column_mapping(value: object) -> ColumnMapping:
    """Read a table; a column's name stands for a table with this column alone."""
    table = {"column": value} if isinstance(value, str) else value
    mapping: ColumnMapping = keys.table_of(ColumnMapping).read(table)
    return mapping


_COLUMN_MAPPING = Kind(_read_column_mapping, "a column's name, or a table with `column`")
_GROUP = Kind(keys.read_text, "the path of a group in the file")


def read_mapping(
    columns: str | os.PathLike[str] | Mapping[str, Any] | None, scene: Scene
) -> DataMapping:
    """Read what is said of the columns of data.

    Parameters
    ----------
    columns : a TOML file, or a mapping of the same keys; None where nothing is said.
    scene : whose channels are the keys.

    Raises
    ------
    InputError
        With every fault, a line each.
    """
    if columns is None:
        return DataMapping()
    known = [*channels(scene), *mode_channels(scene)]
    declared = {}
    for channel in known:
        declared[channel.key] = file_key(channel.key, _COLUMN_MAPPING, default=None).metadata
    # Loads and modes also with all their components.
    names = {channel.key: channel.name for channel in known if channel.kind != "time"}
    names |= {name.replace(" ", "_"): name for name in (*LOAD_NAMES, *FREQUENCY_NAMES)}
    omit = keys.list_of(keys.choice(tuple(names)), f"a list of {', '.join(names)}")
    declared["group"] = file_key("group", _GROUP, default="").metadata
    declared["omit"] = file_key("omit", omit, default=()).metadata
    source = "columns"
    if isinstance(columns, Mapping):
        try:
            values = keys.read_keys(declared, columns)
        except TableError as error:
            raise InputError(f"columns: {problem}" for problem in error.problems) from error
    else:
        file, source = read_toml(Path(columns)), str(columns)
        with file.with_line_numbers():
            values = keys.read_keys(declared, file.tables)
    group = values.pop("group")
    omitted = tuple(names[key] for key in values.pop("omit"))
    mapped = {key: mapping for key, mapping in values.items() if mapping is not None}
    if mapped.keys() in ({TIME}, {SPEED}) or not (mapped or group or omitted):
        allowed = ", ".join(declared)
        raise InputError(f"{source}: no channel to compare; allowed: {allowed}")
    return DataMapping(mapped, group, omitted)


def find_channels(
    table: DataTable, scene: Scene, mapping: DataMapping
) -> tuple[dict[Channel, ColumnMapping], tuple[str, ...]]:
    """Find where each channel comes from, with its unit.

    Parameters
    ----------
    table : the columns.
    scene : whose channels they may be; those of a table of modes where there is no time, but a
        speed and frequencies.
    mapping : what is said of the columns.

    Returns
    -------
    dict, tuple of str
        By channel, the time or speed first; a line for each that says so.

    Raises
    ------
    InputError
        For a name that could be two channels, a wrong unit, or without a time and an angle or rate.
    """
    known, by_name = _known_channels(table, scene, mapping)
    sources = _sources(table, known, by_name, mapping)
    chosen: dict[Channel, ColumnMapping] = {}
    lines = []
    for channel in sorted(sources, key=lambda channel: channel.column):
        source = sources[channel]
        stated = table[source.column].unit or split_unit(source.column)[1]
        unit = source.unit or stated
        if unit and unit.lower() not in UNITS[channel.kind]:
            column = f"column {source.column!r} for {channel.name} is in {unit!r}"
            allowed = ALLOWED_UNITS[channel.kind]
            raise InputError(f"{table.source}: {column}; allowed: {allowed}")
        chosen[channel] = replace(source, unit=unit or channel.unit)
        lines.append(_line(channel, chosen[channel], is_assumed=not unit))
    _refuse_missing(table, known[0], chosen)
    return chosen, tuple(lines)


def _known_channels(
    table: DataTable, scene: Scene, mapping: DataMapping
) -> tuple[list[Channel], list[tuple[Channel, str]]]:
    """Decide whether a table is of a trajectory or of modes.

    Parameters
    ----------
    table : the columns.
    scene : whose channels they may be.
    mapping : what is said of the columns.

    Returns
    -------
    list of Channel, list of (Channel, str)
        The channels that it may have; those that names of its columns suggest.
    """
    motion, modes = channels(scene), mode_channels(scene)
    motion_by_name, modes_by_name = _suggested(table, motion), _suggested(table, modes)
    is_mapped = any(channel.key in mapping.columns for channel in modes)
    if is_mapped:
        return modes, modes_by_name
    has_time = any(channel == motion[0] for channel, _ in motion_by_name)
    has_modes = {channel.kind for channel, _ in modes_by_name} == {"rate", "frequency"}
    if has_modes and not has_time and not mapping.columns:
        return modes, modes_by_name
    return motion, motion_by_name


def _suggested(table: DataTable, known: Sequence[Channel]) -> list[tuple[Channel, str]]:
    """Return the channels that names suggest, and the names."""
    # How many columns an array has says what it may be: angles are one per coordinate.
    entries = [name for name in table.columns if name.endswith("]")]
    widths = Counter(name.rpartition("[")[0] for name in entries)
    suggested = []
    for name in table.columns:
        channel = channel_from_name(name, widths[name.rpartition("[")[0]], known)
        if channel is not None:
            suggested.append((channel, name))
    return suggested


def _sources(
    table: DataTable,
    known: Sequence[Channel],
    by_name: Sequence[tuple[Channel, str]],
    mapping: DataMapping,
) -> dict[Channel, ColumnMapping]:
    """Return where each channel comes from: what is mapped, and what names suggest.

    Parameters
    ----------
    table : the columns.
    known : the channels that there may be, the time or speed first.
    by_name : those that names of columns suggest, and the names.
    mapping : what is said of the columns.

    Raises
    ------
    InputError
        For two columns whose names suggest one channel.
    """
    sources: dict[Channel, ColumnMapping] = {}
    for channel in known:
        mapped = mapping.columns.get(channel.key)
        if mapped is not None:
            sources[channel.in_frame(mapped.frame) if mapped.frame else channel] = mapped
    for channel, name in by_name:
        # Beside a mapping the time alone is known by its name.
        is_left_out = mapping.columns and (channel != known[0] or channel in sources)
        if is_left_out or _is_omitted(channel, mapping.omitted):
            continue
        for other, source in sources.items():
            if other.name == channel.name:
                both = f"both {source.column!r} and {name!r} could be {channel.name}"
                allowed = f"`{channel.key}` in a mapping file says which"
                raise InputError(f"{table.source}: {both}; allowed: {allowed}")
        sources[channel] = ColumnMapping(column=name, sign=channel.sign)
    return sources


def _line(channel: Channel, source: ColumnMapping, *, is_assumed: bool) -> str:
    """Say where a channel comes from: "rotor = -('a' +90) [deg]"."""
    term = repr(source.column)
    if source.offset:
        term = f"{term} {source.offset:+g}"
    if source.sign < 0:
        term = f"-({term})" if source.offset else f"-{term}"
    notes = []
    if is_assumed:
        notes.append("unit assumed")
    if source.wrapped:
        notes.append("wrapped")
    line = f"{channel.name} = {term} [{source.unit}]"
    return f"{line} ({', '.join(notes)})" if notes else line


def _refuse_missing(
    table: DataTable, first: Channel, chosen: Mapping[Channel, ColumnMapping]
) -> None:
    """Raise InputError without the first channel, time or speed, or without what is compared."""
    available = shown_names(list(table.columns))
    if first not in chosen:
        allowed = f"`{first.key}` in a mapping file"
        problem = f"no column for the {first.name}; available: {available}"
        raise InputError(f"{table.source}: {problem}; allowed: {allowed}")
    if all(channel.is_load or channel == first for channel in chosen):
        compared = "a frequency" if first.name == SPEED else "an angle or a rate"
        problem = f"no column for {compared}; available: {available}"
        raise InputError(f"{table.source}: {problem}; allowed: a mapping file (--columns)")


def _is_omitted(channel: Channel, omitted: Sequence[str]) -> bool:
    """Whether a channel, or the load or the modes that it is one of, is omitted."""
    name = channel.name.partition(",")[0]
    is_one_of_many = channel.is_load or channel.kind == "frequency"
    for other in omitted:
        if name == other or (is_one_of_many and name.startswith(f"{other} ")):
            return True
    return False
