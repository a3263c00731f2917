"""Find the column, unit, sign and offset of each channel from a mapping file or names of columns.

The numbers of a channel are sign * (column + offset), with the offset in the unit of the column.
If a channel is not in the mapping, its column is recognized by the name of the column. See
docs/compare.md.
"""

from __future__ import annotations

import os
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

from rotor_mbs.comparison import openfast
from rotor_mbs.comparison.channels import (
    FREQUENCY_NAMES,
    LOAD_FRAMES,
    LOAD_NAMES,
    SPEED,
    TIME,
    Channel,
    arrays_of_other_length,
    channel_from_name,
    channels,
    mode_channels,
    names_a_channel,
    places_of,
    split_unit,
)
from rotor_mbs.comparison.columns import DataTable, shown_names
from rotor_mbs.comparison.openfast import OpenFastSettings
from rotor_mbs.comparison.units import ALLOWED_UNITS, plain_unit, unit_factor
from rotor_mbs.errors import InputError
from rotor_mbs.scenario import keys
from rotor_mbs.scenario.keys import Kind, file_key
from rotor_mbs.scenario.scene import Scene
from rotor_mbs.scenario.toml_file import TableError, read_toml

_UNKNOWN = "no channel has this name"
_SIGN = keys.restricted(keys.whole(-1, 1), bool, "1, -1")


@dataclass(frozen=True)
class ColumnMapping:
    """The source of a channel: sign * (column + offset), in the unit of the column.

    Attributes
    ----------
    column : name of the column.
    unit : unit of the column. If it is "", the unit that the file states is used, or else the
        channel's SI unit.
    sign : 1 or -1.
    offset : number that is added to the column, in the column's unit.
    wrapped : whether whole turns are missing from the angle. Jumps of more than half a turn are
        then removed.
    frame : frame of a load's components; "" for the frame of the scene's loads.
    """

    column: str = file_key("column", Kind(keys.read_text, "the name of a column"))
    unit: str = file_key("unit", Kind(keys.read_text, "a unit such as deg"), default="")
    sign: int = file_key("sign", _SIGN, default=1)
    offset: float = file_key("offset", keys.NUMBER, note=", in the column's unit", default=0.0)
    wrapped: bool = file_key("wrapped", keys.FLAG, default=False)
    frame: str = file_key("frame", keys.choice(LOAD_FRAMES), default="")


@dataclass(frozen=True)
class DataMapping:
    """Content of a mapping file, or of a dict with the same keys.

    Attributes
    ----------
    columns : the sources of channels, by the key of the channel. Other channels are recognized by
        the names of columns.
    group : group of an HDF5 file that is read, see `runs.arrays.read_arrays`.
    omitted : names of channels, loads and kinds of frequencies that are not compared, and need not
        be in the data.
    only : names of the channels, loads and kinds of frequencies to which the comparison is
        restricted, besides the time or speed; empty if it is not restricted.
    program : "openfast" if the columns have the names, units, signs and frames of OpenFAST's
        output, otherwise "".
    openfast : numbers of the OpenFAST model that are needed to read its output.
    """

    columns: Mapping[str, ColumnMapping] = field(default_factory=dict)
    group: str = ""
    omitted: tuple[str, ...] = ()
    only: tuple[str, ...] = ()
    program: str = ""
    openfast: OpenFastSettings = field(default_factory=OpenFastSettings)


def _read_column_mapping(value: object) -> ColumnMapping:
    """Read the source of a channel from a table, or from the name of its column alone."""
    table = {"column": value} if isinstance(value, str) else value
    mapping: ColumnMapping = keys.table_of(ColumnMapping).read(table)
    return mapping


_COLUMN_MAPPING = Kind(_read_column_mapping, "a column's name, or a table with `column`")
_PROGRAM = keys.choice((openfast.PROGRAM,))
_OPENFAST = keys.table_of(OpenFastSettings, "a table with AzimB1Up, HubCM, UndSling of the model")
_GROUP = Kind(keys.read_text, "the path of a group in the file")


def read_mapping(
    columns: str | os.PathLike[str] | Mapping[str, Any] | None, scene: Scene
) -> DataMapping:
    """Read a mapping of columns to the channels of a scene.

    Parameters
    ----------
    columns : path of a TOML file, or a dict with the same keys; None for an empty mapping.
    scene : the scene whose channels are keys of the mapping.

    Raises
    ------
    InputError
        If the file cannot be read; if keys are unknown or values wrong, with a line for each; if
        the mapping is empty, or maps a channel that is not in its `only`.
    """
    if columns is None:
        return DataMapping()
    known = [*channels(scene), *mode_channels(scene)]
    declared = {}
    for channel in known:
        declared[channel.key] = file_key(channel.key, _COLUMN_MAPPING, default=None).metadata
    # In `omit` and `only`, the name of a load stands for all its components, and the name of a kind
    # of frequency for the frequencies of all modes.
    names = {channel.key: channel.name for channel in known if channel.kind != "time"}
    names |= {name.replace(" ", "_"): name for name in (*LOAD_NAMES, *FREQUENCY_NAMES)}
    omit = keys.list_of(keys.choice(tuple(names)), f"a list of {', '.join(names)}")
    declared["group"] = file_key("group", _GROUP, default="").metadata
    declared["omit"] = file_key("omit", omit, default=()).metadata
    declared["only"] = file_key("only", omit, default=()).metadata
    declared["program"] = file_key("program", _PROGRAM, default="").metadata
    declared["openfast"] = file_key("openfast", _OPENFAST, default=None).metadata
    source = "columns"
    if isinstance(columns, Mapping):
        try:
            values = keys.read_keys(declared, columns)
        except TableError as error:
            raise InputError(f"columns: {problem}" for problem in error.problems) from error
    else:
        file, source = read_toml(Path(columns)), str(columns)
        file.refuse_other_kind("a mapping of columns")
        with file.with_line_numbers():
            values = keys.read_keys(declared, file.tables)
    group = values.pop("group")
    omitted = tuple(names[key] for key in values.pop("omit"))
    only = tuple(names[key] for key in values.pop("only"))
    program = values.pop("program")
    settings = values.pop("openfast")
    mapped = {key: mapping for key, mapping in values.items() if mapping is not None}
    if not (mapped or group or omitted or only or program or settings):
        allowed = ", ".join(declared)
        raise InputError(f"{source}: says nothing; allowed: {allowed}")
    for channel in known:
        is_mapped = channel.key in mapped and channel.name not in (TIME, SPEED)
        if only and is_mapped and not _is_one_of(channel, only):
            allowed = f'"{channel.key}" in `only`, or no column for it'
            raise InputError(f"{source}: {channel.key}: is not in `only`; allowed: {allowed}")
    settings = settings or OpenFastSettings()
    return DataMapping(mapped, group, omitted, only, program, settings)


@dataclass(frozen=True)
class FoundChannels:
    """The sources of the channels of data, and the columns that are no source.

    Attributes
    ----------
    sources : the source of each channel, with its unit; the time or speed is first.
    lines : one line for each channel; the line states the source of the channel. For OpenFAST's
        output, an additional first line says how its columns are read.
    unused : for every other column or part of a file, by its name, the reason why it is not
        compared.
    loads_left_out : names of loads that are not compared, although columns with their names exist
        and the mapping does not omit them. They are missing in the mapping's `only`.
    """

    sources: Mapping[Channel, ColumnMapping]
    lines: tuple[str, ...]
    unused: Mapping[str, str]
    loads_left_out: tuple[str, ...]


def find_channels(table: DataTable, scene: Scene, mapping: DataMapping) -> FoundChannels:
    """Find the source of each channel of data, and its unit.

    Parameters
    ----------
    table : the columns of a trajectory, or of a table of modes, see `_known_channels`.
    scene : the scene whose channels the columns may be.
    mapping : content of the mapping file.

    Raises
    ------
    InputError
        If two columns could be one channel, a unit does not fit its channel, or the values of a
        column with a channel's name are no numbers; if a trajectory has no time, or neither angle
        nor rate; if a table of modes has no speed, or no frequency.
    """
    lines: list[str] = []
    other_reasons: dict[str, str] = {}
    if openfast.PROGRAM in (mapping.program, table.program):
        known = channels(scene)
        suggestions, other_reasons = openfast.suggested(table, known, scene, mapping.openfast)
        by_name = [_of_suggestion(suggestion) for suggestion in suggestions]
        lines.append(openfast.describe(mapping.openfast, is_guessed=not mapping.program))
    else:
        known, names = _known_channels(table, scene, mapping)
        by_name = [(channel, ColumnMapping(name, sign=channel.sign)) for channel, name in names]
        other_reasons = arrays_of_other_length(list(table.columns), known)
    sources, reasons, loads_left_out = _sources(table, known, by_name, mapping)
    reasons = {**other_reasons, **reasons}
    chosen: dict[Channel, ColumnMapping] = {}
    for channel in sorted(sources, key=lambda channel: channel.column):
        source = sources[channel]
        stated = plain_unit(source.unit or _stated_unit(table, source.column))
        if stated and unit_factor(stated, channel.kind) is None:
            column = f"column {source.column!r} for {channel.name} is in {stated!r}"
            allowed = ALLOWED_UNITS[channel.kind]
            raise InputError(f"{table.source}: {column}; allowed: {allowed}")
        chosen[channel] = replace(source, unit=stated or channel.unit)
        lines.append(_line(channel, chosen[channel], is_assumed=not stated))
    unused = {}
    used = {source.column for source in chosen.values()}
    for name in table.columns:
        if name not in used:
            unused[name] = reasons.get(name, _UNKNOWN)
    for name, left_out in table.left_out.items():
        meant = channel_from_name(name, 0, known)
        is_chosen = any(meant is not None and meant.name == other.name for other in chosen)
        is_wanted = meant is None or not _is_unwanted(meant, mapping)
        if left_out.is_column and names_a_channel(name, known) and is_wanted and not is_chosen:
            raise table.refusal(name)
        unused[name] = left_out.reason
    suggested = [channel for channel, _ in by_name]
    _refuse_missing(table, known, chosen, suggested, mapping)
    return FoundChannels(chosen, tuple(lines), unused, loads_left_out)


def _of_suggestion(suggestion: openfast.Suggestion) -> tuple[Channel, ColumnMapping]:
    """Return a channel that a column of OpenFAST's output suggests, and its source."""
    source = ColumnMapping(
        column=suggestion.column,
        unit=suggestion.unit,
        sign=suggestion.sign,
        offset=suggestion.offset,
        wrapped=suggestion.wrapped,
    )
    return suggestion.channel, source


def _stated_unit(table: DataTable, name: str) -> str:
    """Return the unit that a file states for a column, "" if it states none."""
    stated = table[name].unit or split_unit(name)[1]
    inner = name.strip()
    if stated or not inner.lower().startswith("der("):
        return stated
    # The column is the rate of an angle whose name has a unit: "der(phi_deg)" is in deg/s.
    of_angle = split_unit(inner[4:].rstrip(")"))[1]
    return f"{of_angle}/s" if of_angle else ""


def _known_channels(
    table: DataTable, scene: Scene, mapping: DataMapping
) -> tuple[list[Channel], list[tuple[Channel, str]]]:
    """Decide whether the data are a trajectory or a table of modes, and return the channels.

    The data are a table of modes if the mapping has a channel of modes. Without a mapping of
    columns, they are a table of modes if the names of columns suggest a speed and frequencies, but
    no time.

    Parameters
    ----------
    table : the columns.
    scene : the scene whose channels the columns may be.
    mapping : content of the mapping file.

    Returns
    -------
    list of Channel, list of (Channel, str)
        All channels that such data may have; the channels that the names of columns suggest, each
        with the name of its column.
    """
    motion, modes = channels(scene), mode_channels(scene)
    motion_by_name, modes_by_name = _suggested(table, motion), _suggested(table, modes)
    motion_keys = {channel.key for channel in motion}
    # If the mapping has a channel of modes or of a trajectory, it decides; the names of columns are
    # used only if it has none.
    if any(channel.key in mapping.columns for channel in modes):
        return modes, modes_by_name
    if not motion_keys.isdisjoint(mapping.columns):
        return motion, motion_by_name
    has_time = any(channel == motion[0] for channel, _ in motion_by_name)
    has_modes = {channel.kind for channel, _ in modes_by_name} == {"rate", "frequency"}
    if has_modes and not has_time:
        return modes, modes_by_name
    return motion, motion_by_name


def _suggested(table: DataTable, known: Sequence[Channel]) -> list[tuple[Channel, str]]:
    """Return the channels that the names of columns suggest, each with the name of its column.

    Parameters
    ----------
    table : the columns.
    known : all channels that the data may have.

    Raises
    ------
    InputError
        If a name means a load in a frame in which the load has no components.
    """
    # To recognize a name such as "q[2]", the number of columns of its array "q" must be known: an
    # array of angles has one column for each coordinate.
    places = places_of(list(table.columns))
    suggested = []
    for name in table.columns:
        place = places.get(name)
        columns, indices = (place.columns, place.indices) if place else (0, None)
        try:
            channel = channel_from_name(name, columns, known, indices)
        except InputError as exc:  # a load in a frame that it does not have
            raise InputError(f"{table.source}: column {name!r}: {exc}") from None
        if channel is not None:
            suggested.append((channel, name))
    return suggested


def _sources(
    table: DataTable,
    known: Sequence[Channel],
    by_name: Sequence[tuple[Channel, ColumnMapping]],
    mapping: DataMapping,
) -> tuple[dict[Channel, ColumnMapping], dict[str, str], tuple[str, ...]]:
    """Return the source of each channel from the mapping, or else from the names of columns.

    Parameters
    ----------
    table : the columns.
    known : all channels that the data may have, the time or speed first.
    by_name : the channels that names of columns suggest, and their sources.
    mapping : content of the mapping file.

    Returns
    -------
    dict, dict, tuple of str
        The sources by channel; the reasons, by name of the column, why recognized columns are not
        compared; the names of loads that are left out only because they are not in the mapping's
        `only`.

    Raises
    ------
    InputError
        If the names of two columns suggest one channel, or the mapping gives a load a frame in
        which the load has no components.
    """
    sources: dict[Channel, ColumnMapping] = {}
    for channel in known:
        mapped = mapping.columns.get(channel.key)
        if mapped is not None:
            if mapped.frame:
                try:
                    channel = channel.in_frame(mapped.frame)
                except InputError as exc:
                    raise InputError(f"{table.source}: column {mapped.column!r}: {exc}") from None
            sources[channel] = mapped
    mapped_columns = {mapped.column for mapped in sources.values()}
    reasons: dict[str, str] = {}
    loads_left_out: list[str] = []
    for channel, suggested in by_name:
        name = suggested.column
        if name in mapped_columns:
            continue
        mapped = mapping.columns.get(_without_frame(channel).key)
        if mapped is not None:
            reasons[name] = f"{channel.name} is mapped to {mapped.column!r}"
            continue
        if channel != known[0] and _is_unwanted(channel, mapping):
            is_omitted = _is_one_of(channel, mapping.omitted)
            reasons[name] = f"{channel.name} is {'omitted' if is_omitted else 'not in `only`'}"
            if channel.is_load and not is_omitted:
                loads_left_out.append(channel.name)
            continue
        for other, source in sources.items():
            if other.name == channel.name:
                both = f"both {source.column!r} and {name!r} could be {channel.name}"
                allowed = f"`{channel.key}` in a mapping file says which"
                header = table.headers.get(name, name)
                if header == table.headers.get(source.column, source.column):
                    units = {table[column].unit for column in (source.column, name)}
                    unit = units.pop() if len(units) == 1 else ""
                    shown = f"{header} [{unit}]" if unit else header
                    both = f"two columns {shown!r} could be {channel.name}"
                    allowed = (
                        f"other names, or `{channel.key} = {source.column!r}` (the first), "
                        f"`{channel.key} = {name!r}` (the second) in a mapping file"
                    )
                raise InputError(f"{table.source}: {both}; allowed: {allowed}")
        sources[channel] = suggested
    return sources, reasons, tuple(loads_left_out)


def _without_frame(channel: Channel) -> Channel:
    """Return a channel without the frame in its name, so that its `key` is a key of mappings."""
    return replace(channel, name=channel.name.partition(",")[0])


def _is_unwanted(channel: Channel, mapping: DataMapping) -> bool:
    """Return whether a mapping omits a channel, or has an `only` without this channel."""
    if _is_one_of(channel, mapping.omitted):
        return True
    return bool(mapping.only) and not _is_one_of(channel, mapping.only)


def _line(channel: Channel, source: ColumnMapping, *, is_assumed: bool) -> str:
    """Return a line that states the source of a channel: "rotor = -('a' +90) [deg]"."""
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
    table: DataTable,
    known: Sequence[Channel],
    chosen: Mapping[Channel, ColumnMapping],
    suggested: Sequence[Channel],
    mapping: DataMapping,
) -> None:
    """Raise InputError if there is no time or speed, or no angle, rate or frequency.

    Parameters
    ----------
    table : the columns.
    known : all channels that the data may have, the time or speed first.
    chosen : the channels that are compared, and their sources.
    suggested : the channels that names of columns suggest, including those that the mapping omits.
    mapping : content of the mapping file.
    """
    first = known[0]
    has_motion_or_mode = any(_is_motion_or_mode(channel, first) for channel in chosen)
    if first in chosen and has_motion_or_mode:
        return
    compared = ["frequency"] if first.name == SPEED else ["angle", "rate"]
    if mapping.program and table.program != mapping.program:
        # With `program`, only the names of that program's output are recognized. If the missing
        # channel has one of the usual names, the message advises to leave `program` out.
        plain = [channel for channel, _ in _suggested(table, known)]
        if first in chosen:
            is_there = any(_is_motion_or_mode(channel, first) for channel in plain)
        else:
            is_there = first in plain
        if is_there:
            problem = f'program = "{mapping.program}" reads the names of OpenFAST\'s output alone'
            raise InputError(f"{table.source}: {problem}; allowed: leave `program` out")
    available = shown_names(list(table.columns))
    if first not in chosen:
        allowed = f"`{first.key}` in a mapping file"
        problem = f"no column for the {first.name}; available: {available}"
        raise InputError(f"{table.source}: {problem}; allowed: {allowed}")
    unwanted = [channel for channel in suggested if _is_motion_or_mode(channel, first)]
    if unwanted:
        lists = []
        if any(_is_one_of(channel, mapping.omitted) for channel in unwanted):
            lists.append("`omit`")
        if mapping.only:
            lists.append("`only`")
        verb = "leave" if len(lists) > 1 else "leaves"
        problem = f"{' and '.join(lists)} {verb} no {' or '.join(compared)}"
        keys_of_unwanted = shown_names([channel.key for channel in unwanted])
        raise InputError(f"{table.source}: {problem}; allowed: one of {keys_of_unwanted}")
    for kind in ("angle", "rate"):
        other_lengths = arrays_of_other_length(list(table.columns), known, kind)
        for reason in other_lengths.values():
            raise InputError(f"{table.source}: {reason}; allowed: as many, rotor first")
    problem = f"no column for a{'n' * (first.name != SPEED)} {' or a '.join(compared)}"
    key = next(channel.key for channel in known if _is_motion_or_mode(channel, first))
    allowed = f"a mapping file (--columns) with `{key}` or others"
    raise InputError(f"{table.source}: {problem}; available: {available}; allowed: {allowed}")


def _is_motion_or_mode(channel: Channel, first: Channel) -> bool:
    """Return whether a channel is an angle, rate or frequency.

    Parameters
    ----------
    channel : the channel.
    first : the channel of the time or speed, which is none of these.
    """
    return not channel.is_load and channel != first


def _is_one_of(channel: Channel, names: Sequence[str]) -> bool:
    """Return whether a list of names contains a channel, its load, or its kind of frequency.

    Parameters
    ----------
    channel : the channel.
    names : names of channels ("shaft force x"), loads ("shaft force"), or kinds of frequencies.
    """
    name = channel.name.partition(",")[0]
    is_one_of_many = channel.is_load or channel.kind == "frequency"
    if name in names:
        return True
    return is_one_of_many and any(name.startswith(f"{other} ") for other in names)
