"""The channels that data may have: time, angle and rate of every coordinate, components of loads; of a table of modes:
speed, frequencies. Which column is which, in which unit, sign and zero: from a mapping file (see docs/compare.md), or
guessed from the names. Data of a scene in SI units; refused where they cannot be compared.

A channel is sign * (column + offset), the offset in the column's own unit. What a mapping leaves out is not compared;
the time (or speed) alone is guessed then. All are guessed where it names a group alone.
"""

from __future__ import annotations

import itertools
import math
import os
import re
from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from rotor_mbs.comparison.columns import ALLOWED_UNITS, BASE_UNITS, UNITS, DataTable, shown_names, table_of
from rotor_mbs.comparison.files import read_table
from rotor_mbs.errors import InputError
from rotor_mbs.scenario import keys
from rotor_mbs.scenario.keys import Kind, file_key
from rotor_mbs.scenario.scene import Scene
from rotor_mbs.scenario.toml_file import TableError, read_toml
from rotor_mbs.solution.quantities import LOADS

Array = NDArray[np.float64]

TIME, SPEED = "time", "speed"
_FEW_DIGITS, _ALL_DIGITS = 9, 17
_EXCEPTIONS = 0.05  # of the numbers
_FULL_DIGITS = 8  # as many as single precision has
_FEW_VALUES = 10  # distinct ones: fewer may have been chosen, and say nothing of digits
_SAMPLE = 200  # numbers of a column, at least, where not all are needed
_EQUAL = 1e-6  # of an interval between rows
_FEWEST = 3  # rows: fewer have no motion to be compared
# Names without digits, blanks and marks, as listed in docs/compare.md; a name of a rate is one of an angle with a word
# of _RATE_WORDS behind it, or d before it.
_TIME_NAMES = ("time", "t", "times", "zeit")
_ROTOR_NAMES = (
    "rotor", "rotorangle", "rotorposition", "rot", "azimuth", "rotorazimuth", "azim", "psi", "phi", "shaft",
)  # fmt: skip
_PITCH_NAMES = ("pitch", "pitchangle", "bladepitch", "bldpitch", "blpitch", "ptchpmzc", "ptchpmzb", "theta", "beta")
_ROTOR_RATE_NAMES = ("omega",)
_RATE_WORDS = ("rate", "speed", "velocity", "vel", "dot")
_VECTORS = {
    "angle": ("angles", "angle", "q", "qpos", "coordinates", "positions"),
    "rate": ("rates", "rate", "qd", "dq", "qdot", "qvel", "coordinates_t", "velocities"),
}
# By the frame in which a scene's loads have them, the other frames in which data may have them.
FRAMES = {"blade": ("rotor", "base"), "base": ("rotor",)}
# OpenFAST's root loads, of the blade on the hub: x along the shaft, z along the blade, y against the rotor's sense; the
# axes b turn with the pitch, the axes c do not.
_OPENFAST = re.compile(r"root([fm])([xyz])([bc])(\d+)", re.IGNORECASE)
_OPENFAST_AXES = {"x": ("y", -1), "y": ("x", 1), "z": ("z", -1)}
_SPEED_NAMES = ("speed", "rotorspeed", "rotspeed", "omega")
_FREQUENCIES = {
    "frequency": ("frequency", "freq", "f", "mode", "frequencies", "dampedfrequency", "dampedfrequencies"),
    "undamped frequency": ("undampedfrequency", "undampedfrequencies", "naturalfrequency", "naturalfrequencies"),
}
_LOAD_NAMES = tuple(load.name.replace("_", " ") for load in LOADS)
_UNIT_ENDING = re.compile(r"_((?:rad|deg|turns|rev)(?:_per_s|/s|_s)?|rpm|hz|s|ms|us|min|(?-i:k?Nm?))$", re.IGNORECASE)


@dataclass(frozen=True)
class Channel:
    """A coordinate's angle or rate, the component of a load, the time: "rotor", "pitch 1 rate", "shaft force x"; of a
    table of modes: "speed", "frequency 1".

    kind: of its unit, a key of `BASE_UNITS`. column: of the matrix of angles, then rates, then loads; of the damped,
    then the undamped frequencies; -1 for time and speed. frame: of a load, where it is not the scene's. sign: of the
    column's numbers, where its name has a convention.
    """

    name: str
    kind: str
    column: int
    frame: str = ""
    sign: int = 1

    @property
    def key(self) -> str:
        """Its key in a mapping file: "pitch_1_rate"."""
        return self.name.replace(",", "").replace(" ", "_")

    @property
    def unit(self) -> str:
        return BASE_UNITS[self.kind]

    @property
    def is_load(self) -> bool:
        return self.kind in ("force", "moment")

    def in_frame(self, frame: str) -> Channel:
        """Raises InputError where it has no components there."""
        own = "blade" if self.name.startswith("blade root") else "base" if self.name.startswith("shaft") else ""
        if frame == own:
            return self
        if not self.is_load or frame not in FRAMES.get(own, ()):
            allowed = f"{own}, {', '.join(FRAMES[own])}" if own else "none"
            raise InputError(f"{self.key}: frame {frame!r}; allowed: {allowed}")
        return replace(self, name=f"{self.name}, {frame} frame", frame=frame)


def channels(scene: Scene) -> list[Channel]:
    """Those that data of the scene may have, the time first."""
    labels = scene.coordinate_labels
    known = [Channel(TIME, "time", -1), *(Channel(label, "angle", i) for i, label in enumerate(labels))]
    known += [Channel(f"{label} rate", "rate", len(labels) + i) for i, label in enumerate(labels)]
    for load in LOADS:
        blades = [f" {i + 1}" for i in range(len(scene.blades))] if "blade" in load.dimensions else [""]
        for ending in itertools.product(blades, (" x", " y", " z") if "axis" in load.dimensions else [""]):
            name = load.name.replace("_", " ") + "".join(ending)
            known.append(Channel(name, "force" if load.units == "N" else "moment", len(known) - 1))
    return known


def mode_channels(scene: Scene) -> list[Channel]:
    """Those that a table of modes may have, the speed first."""
    names = [f"{kind} {i + 1}" for kind in _FREQUENCIES for i in range(len(scene.coordinate_labels))]
    return [Channel(SPEED, "rate", -1), *(Channel(name, "frequency", i) for i, name in enumerate(names))]


def guess(name: str, vector: int, known: Sequence[Channel]) -> Channel | None:
    """The channel that a column's name suggests, None where it suggests none.

    vector   how many columns its array has, 0 where it is none: `q[0]` is the rotor where there is one per coordinate
    known    `channels` or `mode_channels`
    """
    entry = re.fullmatch(r"(.*)\[([\d,]+)\]", name)
    array = entry[1].rpartition("/")[2].strip().lower() if entry else ""
    plain = split_unit(name)[0].lower()
    letters, digits = re.sub(r"[^a-z]", "", plain), re.findall(r"\d+", plain)
    by_name, is_one_blade = {channel.name: channel for channel in known}, all(c.name != "pitch 2" for c in known)
    if known[0].name == SPEED:
        number = _number(digits[-1]) + (entry is not None) if digits else 1
        # A column "mode" alone numbers them.
        kinds = [f"{kind} {number}" for kind, names in _FREQUENCIES.items() if letters in names and plain != "mode"]
        return by_name.get(SPEED if letters in _SPEED_NAMES else kinds[0] if kinds else "")
    if openfast := _OPENFAST.fullmatch(plain):
        axis, sign = _OPENFAST_AXES[openfast[2]]
        load = by_name.get(f"blade root {'force' if openfast[1] == 'f' else 'moment'} {openfast[4]} {axis}")
        return load and replace(load.in_frame("rotor" if openfast[3] == "c" else "blade"), sign=sign)
    if entry is not None:
        place = [_number(number) for number in entry[2].split(",")]
        fitting = [channel for channel in known if array in _VECTORS.get(channel.kind, ())]
        fitting = fitting or [channel for channel in known if array and channel.key.startswith(f"{array}_")]
        offset = 3 * place[0] + place[1] if len(place) == 2 else place[0]
        return fitting[offset] if len(fitting) == vector and offset < vector else None
    words = re.findall(r"[a-z]+|\d+", plain)
    frame = words[-2] if words[-2:] in (["blade", "frame"], ["rotor", "frame"], ["base", "frame"]) else ""
    named = " ".join(words[:-2] if frame else words)
    load = by_name.get(named) or by_name.get(f"{named} 1" if is_one_blade else "")
    if load is not None and load.is_load:
        return load.in_frame(frame) if frame else load
    if letters in _TIME_NAMES:
        return known[0]
    ending = next((word for word in _RATE_WORDS if letters.endswith(word)), "")
    stem = letters.removesuffix(ending)
    if letters[:1] == "d" and letters[1:] in (*_PITCH_NAMES, *_ROTOR_NAMES):
        ending, stem = "d", letters[1:]
    rate = " rate" if ending else ""
    if stem in _PITCH_NAMES:
        wanted = f"pitch {digits[-1] if digits else '1' * is_one_blade}{rate}"
    elif letters in _ROTOR_RATE_NAMES:
        wanted = "rotor rate"
    elif stem in _ROTOR_NAMES:
        wanted = f"rotor{rate}"
    else:
        return None
    return by_name.get(wanted)


def _number(digits: str) -> int:
    """Return digits as a number; one that no index reaches where there are none, or too many."""
    return int(digits) if 0 < len(digits) < 10 else 10**10


def split_unit(name: str) -> tuple[str, str]:
    """Name and unit of a column whose name ends in a unit: "pitch_1_rate_deg_s" is "pitch_1_rate" in "deg/s"."""
    match = _UNIT_ENDING.search(name)
    if match is None:
        return name, ""
    return name[: match.start()], re.sub("_(?:per_)?s$", "/s", match[1].lower())


_SIGN = keys.where(keys.whole(-1, 1), bool, "1, -1")


@dataclass(frozen=True)
class Entry:
    """What a mapping file says of a channel: sign * (column + offset) in `unit`.

    wrapped   whether turns are missing, so that jumps of more than half a turn are taken out
    frame     of a load, "" for that of the scene's loads
    """

    column: str = file_key("column", Kind(keys.read_text, "the name of a column"))
    unit: str = file_key("unit", Kind(keys.read_text, "a unit such as deg"), default="")
    sign: int = file_key("sign", _SIGN, default=1)
    offset: float = file_key("offset", keys.NUMBER, note=", in the column's unit", default=0.0)
    wrapped: bool = file_key("wrapped", keys.FLAG, default=False)
    frame: str = file_key("frame", keys.choice(("blade", "rotor", "base")), default="")


def _read_entry(value: object) -> Entry:
    """A column's name stands for a table with this column alone."""
    entry: Entry = keys.table_of(Entry).read({"column": value} if isinstance(value, str) else value)
    return entry


_ENTRY = Kind(_read_entry, "a column's name, or a table with `column`")
_GROUP = Kind(keys.read_text, "the path of a group in the file")


def read_mapping(
    columns: str | os.PathLike[str] | Mapping[str, Any] | None, scene: Scene
) -> tuple[dict[str, Entry], str, tuple[str, ...]]:
    """An entry by the key of a channel, the group of an HDF5 file, and the names of channels that are neither compared
    nor missed: {}, "" and () where no mapping is given.

    columns: a TOML file, or a mapping of the same keys. Raises InputError with every fault, a line each.
    """
    if columns is None:
        return {}, "", ()
    known = [*channels(scene), *mode_channels(scene)]
    declared = {channel.key: file_key(channel.key, _ENTRY, default=None).metadata for channel in known}
    names = {channel.key: channel.name for channel in known if channel.kind != "time"}
    # With all their components, or modes.
    names |= {name.replace(" ", "_"): name for name in (*_LOAD_NAMES, *_FREQUENCIES)}
    omit = keys.list_of(keys.choice(tuple(names)), f"a list of {', '.join(names)}")
    declared["group"] = file_key("group", _GROUP, default="").metadata
    declared["omit"] = file_key("omit", omit, default=()).metadata
    name = "columns"
    if isinstance(columns, Mapping):
        try:
            found = keys.read_keys(declared, columns)
        except TableError as error:
            raise InputError(f"columns: {problem}" for problem in error.problems) from error
    else:
        file, name = read_toml(Path(columns)), str(columns)
        with file.located():
            found = keys.read_keys(declared, file.tables)
    group = found.pop("group")
    omitted = tuple(names[key] for key in found.pop("omit"))
    entries = {key: entry for key, entry in found.items() if entry is not None}
    if entries.keys() in ({TIME}, {SPEED}) or not (entries or group or omitted):
        raise InputError(f"{name}: no channel to compare; allowed: {', '.join(declared)}")
    return entries, group, omitted


def find_channels(
    table: DataTable, scene: Scene, entries: Mapping[str, Entry], omitted: Sequence[str] = ()
) -> tuple[dict[Channel, Entry], tuple[str, ...]]:
    """Where each channel comes from, with its unit, the time first, and a line for each that says so; those of a table
    of modes where there is no time, but a speed and frequencies. Raises InputError."""
    vectors = Counter(name.rpartition("[")[0] for name in table.columns if name.endswith("]"))

    def guesses(known: Sequence[Channel]) -> list[tuple[Channel, str]]:
        guessed = [(guess(name, vectors[name.rpartition("[")[0]], known), name) for name in table.columns]
        return [(channel, name) for channel, name in guessed if channel is not None]

    known, other = channels(scene), mode_channels(scene)
    guessed = guesses(known)
    mapped = [channel.key for channel in other if channel.key in entries]
    if mapped or not (entries or any(channel == known[0] for channel, _ in guessed)):
        modes = guesses(other)
        if mapped or {channel.kind for channel, _ in modes} == {"rate", "frequency"}:
            known, guessed = other, modes
    sources: dict[Channel, Entry] = {}
    for channel in known:
        if entry := entries.get(channel.key):
            sources[channel.in_frame(entry.frame) if entry.frame else channel] = entry
    for channel, name in guessed:
        if (entries and (channel != known[0] or channel in sources)) or _is_omitted(channel, omitted):
            continue
        if twice := [entry.column for other, entry in sources.items() if other.name == channel.name]:
            raise InputError(
                f"{table.source}: both {twice[0]!r} and {name!r} could be {channel.name}; allowed: "
                f"`{channel.key}` in a mapping file says which"
            )
        sources[channel] = Entry(column=name, sign=channel.sign)
    chosen: dict[Channel, Entry] = {}
    lines = []
    for channel in sorted(sources, key=lambda channel: channel.column):
        entry = sources[channel]
        stated = table[entry.column].unit or split_unit(entry.column)[1]
        unit = entry.unit or stated
        if unit and unit.lower() not in UNITS[channel.kind]:
            raise InputError(
                f"{table.source}: column {entry.column!r} for {channel.name} is in {unit!r}; allowed: "
                f"{ALLOWED_UNITS[channel.kind]}"
            )
        chosen[channel] = replace(entry, unit=unit or channel.unit)
        term = f"{entry.column!r} {entry.offset:+g}" if entry.offset else repr(entry.column)
        if entry.sign < 0:
            term = f"-({term})" if entry.offset else f"-{term}"
        line = f"{channel.name} = {term} [{unit or channel.unit}]"
        notes = [note for note, holds in (("unit assumed", not unit), ("wrapped", entry.wrapped)) if holds]
        lines.append(f"{line} ({', '.join(notes)})" if notes else line)
    shown = shown_names(list(table.columns))
    if known[0] not in chosen:
        raise InputError(
            f"{table.source}: no column for the {known[0].name}; available: {shown}; allowed: `{known[0].key}` in a "
            "mapping file"
        )
    if all(channel.is_load or channel == known[0] for channel in chosen):
        what = "a frequency" if known is other else "an angle or a rate"
        raise InputError(
            f"{table.source}: no column for {what}; available: {shown}; allowed: a mapping file (--columns)"
        )
    return chosen, tuple(lines)


def _is_omitted(channel: Channel, omitted: Sequence[str]) -> bool:
    name = channel.name.partition(",")[0]
    is_one_of_many = channel.is_load or channel.kind == "frequency"
    return any(name == other or (is_one_of_many and name.startswith(f"{other} ")) for other in omitted)


@dataclass(frozen=True)
class ForeignData:
    """Samples of another program, or its modes over speed.

    time, values : (n,) s, increasing from 0 or later; (n, channels) in SI units, what `channels` says. Of a table of
        modes the speeds, rad/s, in place of the times.
    read, unused : a line for each channel: column, unit, and what was assumed; names of the other columns.
    rounding, time_rounding : (n, channels), (n,) half a unit in the last digit of each number, as it was written.
    wrapped : for each channel, whether whole turns are missing from it.
    precision : "4 decimals: rounding error 5e-05", or the like of digits; "" of numbers with hardly any rounding.
    omitted : names of channels that are not to be missed.
    is_modes : whether it is a table of modes.
    """

    source: str
    time: Array
    values: Array
    channels: tuple[Channel, ...]
    rounding: Array
    time_rounding: Array
    read: tuple[str, ...] = ()
    unused: tuple[str, ...] = ()
    wrapped: tuple[bool, ...] = ()
    precision: str = ""
    omitted: tuple[str, ...] = ()
    is_modes: bool = False

    def rows(self, chosen: NDArray[np.bool_] | slice) -> ForeignData:
        return replace(
            self, time=self.time[chosen], values=self.values[chosen], rounding=self.rounding[chosen],
            time_rounding=self.time_rounding[chosen],
        )  # fmt: skip

    def only(self, *, loads: bool) -> ForeignData:
        """The channels of loads alone, or all others."""
        chosen = [j for j, channel in enumerate(self.channels) if channel.is_load == loads]
        return replace(
            self, channels=tuple(self.channels[j] for j in chosen), values=self.values[:, chosen],
            rounding=self.rounding[:, chosen], wrapped=tuple(self.wrapped[j] for j in chosen if self.wrapped),
        )  # fmt: skip

    def beside(self, other: ForeignData) -> ForeignData:
        """With the channels of `other`, of the same rows."""
        return replace(
            self, channels=self.channels + other.channels, values=np.hstack([self.values, other.values]),
            rounding=np.hstack([self.rounding, other.rounding]), wrapped=self.wrapped + other.wrapped,
        )  # fmt: skip

    @property
    def columns(self) -> list[int]:
        """Places of the channels in a matrix of all angles, then all rates, then all loads."""
        return [channel.column for channel in self.channels]


def load_data(
    data: str | os.PathLike[str] | Mapping[str, Any],
    scene: Scene,
    columns: str | os.PathLike[str] | Mapping[str, Any] | None = None,
) -> ForeignData:
    """Load data of a scene from a file, or from arrays by name.

    Parameters
    ----------
    data : a file; or arrays by name, an xarray.Dataset, whose coordinates are arrays too, or a pandas.DataFrame.
    scene : the scene of which they are data.
    columns : a mapping file, or a mapping of its keys; by default channels are known by the names of columns.

    Raises
    ------
    InputError, StoreError
        For data that cannot be read, or are not of this scene.
    """
    mapping = read_mapping(columns, scene)
    if isinstance(data, str | os.PathLike):
        table = read_table(data, mapping[1], scene.name)
    elif hasattr(data, "items"):
        table = table_of("data", {**getattr(data, "coords", {}), **dict(data.items())})
    else:
        allowed = 'a file, or arrays by name, such as {"time": run.time, "angles": run.angles}'
        raise InputError(f"data: {type(data).__name__}; allowed: {allowed}")
    return data_of_table(table, scene, *mapping)


@np.errstate(all="ignore")  # data may be of any size
def data_of_table(
    table: DataTable,
    scene: Scene,
    entries: Mapping[str, Entry] | None = None,
    _group: str = "",
    omitted: tuple[str, ...] = (),
) -> ForeignData:
    """Take the channels of a scene from named columns, in SI units; entries, omitted: see `read_mapping`.

    Raises
    ------
    InputError
        For columns that cannot be channels: not finite, of different lengths, times that do not increase.
    """
    entries = entries or {}
    chosen, lines = find_channels(table, scene, entries, omitted)
    lengths = {entry.column: len(table[entry.column].values) for entry in chosen.values()}
    if len(set(lengths.values())) > 1:
        shown = ", ".join(f"{name} has {length} rows" for name, length in lengths.items())
        raise InputError(f"{table.source}: columns of different lengths: {shown}; allowed: a row for every time")
    arrays: list[Array] = []
    for channel, entry in chosen.items():
        values = table[entry.column].values
        si_values: Array = entry.sign * (values + entry.offset) * UNITS[channel.kind][entry.unit.lower()]
        bad = np.flatnonzero(~np.isfinite(si_values))
        if len(bad):
            raise InputError(
                f"{table.source}: column {entry.column!r} is {values[bad[0]]} in row {bad[0] + 1} of "
                f"{len(values)}; allowed: finite numbers"
            )
        arrays.append(np.unwrap(si_values) if entry.wrapped else si_values)
    time, *numbers = (table[entry.column].values for entry in chosen.values())
    kinds = [(channel.kind, entry.unit) for channel, entry in chosen.items()][1:]
    last_digits = [half_last_digits(time)]
    for own, values in zip(kinds, numbers, strict=True):
        alike = [other for kind, other in zip(kinds, numbers, strict=True) if kind == own]
        few = 1 if own[0] == "frequency" else _FEW_VALUES  # frequencies are computed, not chosen
        last_digits.append(half_last_digits(values, [alike, numbers], few))
    precision = _precision(numbers, last_digits[1:])
    for j, (channel, entry) in enumerate(chosen.items()):
        last_digits[j] = last_digits[j] * abs(UNITS[channel.kind][entry.unit.lower()])
    is_modes = next(iter(chosen)).name == SPEED
    if is_modes:
        order = np.argsort(arrays[0], kind="stable")
        arrays, last_digits = ([array[order] for array in columns] for columns in (arrays, last_digits))
        if arrays[0][0] < 0.0 or (np.diff(arrays[0]) == 0.0).any():
            raise InputError(f"{table.source}: a speed below 0, or one that repeats; allowed: a row for each speed")
    else:
        _refuse_wrong_times(table.source, arrays[0])
        intervals = np.diff(arrays[0])
        # Equal intervals are meant as they are written, though the times have few digits.
        if np.ptp(intervals) <= _EQUAL * float(intervals.mean()):
            last_digits[0] = np.abs(arrays[0]) * 2.0**-53
    return ForeignData(
        table.source,
        arrays[0],
        np.stack(arrays[1:], axis=1),
        tuple(chosen)[1:],
        np.stack(last_digits[1:], axis=1),
        last_digits[0],
        lines,
        tuple(name for name in table.columns if name not in lengths),
        tuple(entry.wrapped for entry in chosen.values())[1:],
        precision,
        omitted,
        is_modes,
    )


def half_last_digits(values: Array, others: Sequence[Sequence[Array]] = (), few: int = _FEW_VALUES) -> Array:
    """(n,) half a unit in the last place of numbers as they were written: decimals, digits, single or double precision.

    Of the ways that all of them fit, the coarsest. others: groups of columns; a column of few distinct values is judged
    together with the first group that has enough. few: if these have fewer than that, they are exact.
    """
    sizes, judged = np.abs(values), values
    for group in others:
        if len(np.unique(judged)) < _FEW_VALUES:
            judged = np.concatenate([values, *(other[:: 1 + len(other) // _SAMPLE] for other in group)])
    largest = float(np.abs(judged).max(initial=0.0))
    if len(np.unique(judged)) < few:
        return np.asarray(sizes * 2.0**-53)
    # Numbers of so many decimals may seem to have so many digits, and the other way round: of both the coarser.
    last = np.zeros(len(values))
    for decimals in range(_FEW_DIGITS + 1):
        unit = 10.0**-decimals
        noise = 4.0 * 2.0**-52 * largest  # of the arithmetic; with less than a hundredth of a unit any number fits
        if 100.0 * noise < unit < largest and np.abs(judged - np.round(judged / unit) * unit).max() <= noise:
            last[:] = 0.5 * unit
            break
    digits = _digits(judged)
    if digits <= _FEW_DIGITS:
        exponents = np.floor(np.log10(np.where(sizes > 0.0, sizes, 1.0)))
        last = np.maximum(last, np.where(sizes > 0.0, 0.5 * 10.0 ** (exponents + 1 - digits), 0.0))
    if last.any():
        return last
    with np.errstate(over="ignore"):  # of what is larger than single precision can be
        single = np.asarray(judged, np.float32).astype(float)
    return np.asarray(sizes * (2.0**-24 if np.array_equal(single, judged) else 2.0**-53))


def _precision(columns: Sequence[Array], last_digits: Sequence[Array]) -> str:
    """See `ForeignData`. last_digits: `half_last_digits` of each column."""
    pairs = list(zip(map(np.abs, columns), last_digits, strict=True))
    rounded = [(sizes, last) for sizes, last in pairs if (last > 10.0**-_FEW_DIGITS * sizes).any()]
    digits = max(map(_digits, columns))
    if digits >= _FULL_DIGITS or not rounded:
        return ""
    # Of numbers that are all of one size digits are decimals, too; and 0.100000 might have one digit.
    is_fixed = any(sizes.min() < 0.1 * sizes.max() for sizes, _ in rounded)
    if is_fixed and all((last > 2.0 * last.min()).mean() < _EXCEPTIONS for _, last in rounded):
        decimals = sorted({round(-math.log10(2.0 * last.min())) for _, last in rounded})
        return f"{' or '.join(map(str, decimals))} decimals: rounding error {0.5 * 10.0 ** -decimals[0]:.0e}"
    return f"{digits} digits: relative rounding error {0.5 * 10.0 ** (1 - digits):.0e}"


def _digits(values: Array) -> int:
    """With how many significant digits the numbers may have been written."""
    some = values[values != 0.0]

    def fit(some: Array, digits: int) -> bool:
        unit = 10.0 ** (np.floor(np.log10(np.abs(some))) + 1 - digits)
        with np.errstate(all="ignore"):  # of a number near the smallest there is the unit may be 0: no digits fit
            rounded = np.round(some / unit) * unit
        return np.allclose(some, rounded, rtol=1e-12, atol=0.0)

    fitting = (digits for digits in range(1, _FEW_DIGITS + 1) if fit(some[:_SAMPLE], digits) and fit(some, digits))
    return next(fitting, _ALL_DIGITS)


def _refuse_wrong_times(source: str, time: Array) -> None:
    if len(time) < _FEWEST:
        raise InputError(f"{source}: {len(time)} rows; allowed: {_FEWEST} or more")
    if time[0] < 0.0:
        raise InputError(
            f"{source}: begins at t = {time[0]:g} s; allowed: times from 0, the scene's start (`offset` of the time)"
        )
    wrong = np.flatnonzero(np.diff(time) <= 0.0)
    if len(wrong):
        row = int(wrong[0])
        problem = "repeats" if time[row + 1] == time[row] else "comes before"
        raise InputError(
            f"{source}: the time of row {row + 2}, {time[row + 1]:.9g} s, {problem} that of the row above, "
            f"{time[row]:.9g} s; allowed: times that increase"
        )
