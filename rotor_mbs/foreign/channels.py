"""The channels that data may have: time, and angle and rate of every coordinate; which column is which, in which unit,
sign and zero: from a mapping file (see docs/compare.md), or guessed from the names. Data of a scene in s, rad, rad/s;
refused where they cannot be compared.

A channel is sign * (column + offset), the offset in the column's own unit. What a mapping leaves out is not compared;
the time alone is guessed then. All are guessed where it names a group alone.
"""

from __future__ import annotations

import os
import re
from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from rotor_mbs.errors import InputError
from rotor_mbs.foreign.files import ALLOWED_UNITS, BASE_UNITS, UNITS, DataTable, read_table, shown_names, table_of
from rotor_mbs.scenario import keys
from rotor_mbs.scenario.keys import Kind, file_key, wrong
from rotor_mbs.scenario.scene import Scene
from rotor_mbs.scenario.toml_file import TableError, read_toml

Array = NDArray[np.float64]

TIME = "time"
_FEW_DIGITS, _ALL_DIGITS = 9, 17
_FEW_VALUES = 10
_EQUAL = 1e-6  # of an interval between rows
_FEWEST = 3  # rows: fewer have no motion to be compared
# Names without digits, blanks and marks; a name of a rate is one of an angle with a word of _RATE_WORDS behind it, or
# d before it.
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
# What is understood, in words.
KNOWN_NAMES = (
    ("time", ", ".join(_TIME_NAMES)),
    ("rotor", ", ".join(_ROTOR_NAMES)),
    ("pitch of blade i, its number behind", ", ".join(_PITCH_NAMES)),
    ("rate of the rotor", f"these with {', '.join(_RATE_WORDS)} behind, or d before; {', '.join(_ROTOR_RATE_NAMES)}"),
    ("rate of a pitch", f"these with {', '.join(_RATE_WORDS)} behind, or d before"),
    ("array of angles, rotor first", ", ".join(_VECTORS["angle"])),
    ("array of rates, rotor first", ", ".join(_VECTORS["rate"])),
)
_UNIT_ENDING = re.compile(r"_((?:rad|deg|turns|rev)(?:_per_s|/s|_s)?|rpm|s|ms|us|min)$", re.IGNORECASE)


@dataclass(frozen=True)
class Channel:
    """A coordinate's angle or rate, or the time: "rotor", "pitch 1", "rotor rate", "pitch 1 rate", "time".

    kind: "angle", "rate" or "time". column: of the matrix of angles, then rates; -1 for the time.
    """

    name: str
    kind: str
    column: int

    @property
    def key(self) -> str:
        """Its key in a mapping file: "pitch_1_rate"."""
        return self.name.replace(" ", "_")

    @property
    def unit(self) -> str:
        return BASE_UNITS[self.kind]


def channels(scene: Scene) -> list[Channel]:
    """Those that data of the scene may have, the time first."""
    labels = scene.coordinate_labels
    angles = [Channel(label, "angle", i) for i, label in enumerate(labels)]
    rates = [Channel(f"{label} rate", "rate", len(labels) + i) for i, label in enumerate(labels)]
    return [Channel(TIME, "time", -1), *angles, *rates]


def guess(name: str, vector: int, known: Sequence[Channel]) -> Channel | None:
    """The channel that a column's name suggests, None where it suggests none.

    vector   how many columns its array has, 0 where it is none: `q[0]` is the rotor where there is one per coordinate
    """
    entry = re.fullmatch(r"(.*)\[(\d+)\]", name)
    if entry is not None:
        array = entry[1].rpartition("/")[2].strip().lower()
        fitting = [channel for channel in known if array in _VECTORS.get(channel.kind, ())]
        return fitting[int(entry[2])] if len(fitting) == vector else None
    plain = split_unit(name)[0].lower()
    letters = re.sub(r"[^a-z]", "", plain)
    if letters in _TIME_NAMES:
        return known[0]
    ending = next((word for word in _RATE_WORDS if letters.endswith(word)), "")
    stem = letters.removesuffix(ending)
    if letters[:1] == "d" and letters[1:] in (*_PITCH_NAMES, *_ROTOR_NAMES):
        ending, stem = "d", letters[1:]
    rate = " rate" if ending else ""
    digits = re.findall(r"\d+", plain)
    if stem in _PITCH_NAMES:
        only = "1" if len([channel for channel in known if channel.kind == "angle"]) == 2 else ""
        wanted = f"pitch {digits[-1] if digits else only}{rate}"
    elif letters in _ROTOR_RATE_NAMES:
        wanted = "rotor rate"
    elif stem in _ROTOR_NAMES:
        wanted = f"rotor{rate}"
    else:
        return None
    return next((channel for channel in known if channel.name == wanted), None)


def split_unit(name: str) -> tuple[str, str]:
    """Name and unit of a column whose name ends in a unit: "pitch_1_rate_deg_s" is "pitch_1_rate" in "deg/s"."""
    match = _UNIT_ENDING.search(name)
    if match is None:
        return name, ""
    return name[: match.start()], match[1].lower().replace("_per_s", "/s").replace("_s", "/s")


def _read_sign(value: object) -> int:
    if isinstance(value, bool) or not isinstance(value, int) or abs(value) != 1:
        raise wrong(f"{keys.shown(value)} is not one of them")
    return value


@dataclass(frozen=True)
class Entry:
    """What a mapping file says of a channel: sign * (column + offset) in `unit`.

    wrapped   whether turns are missing, so that jumps of more than half a turn are taken out
    """

    column: str = file_key("column", Kind(keys.read_text, "the name of a column"))
    unit: str = file_key("unit", Kind(keys.read_text, "a unit such as deg"), default="")
    sign: int = file_key("sign", Kind(_read_sign, "1, -1"), default=1)
    offset: float = file_key("offset", keys.NUMBER, note=", in the column's unit", default=0.0)
    wrapped: bool = file_key("wrapped", keys.FLAG, default=False)


def _read_entry(value: object) -> Entry:
    """A column's name stands for a table with this column alone."""
    entry: Entry = keys.table_of(Entry).read({"column": value} if isinstance(value, str) else value)
    return entry


_ENTRY = Kind(_read_entry, "a column's name, or a table with `column`")
_GROUP = Kind(keys.read_text, "the path of a group in the file")


def read_mapping(
    columns: str | os.PathLike[str] | Mapping[str, Any] | None, scene: Scene
) -> tuple[dict[str, Entry], str, tuple[str, ...]]:
    """An entry by the key of a channel, the group of an HDF5 file, and the names of channels that are not to be missed:
    {}, "" and () where no mapping is given.

    columns: a TOML file, or a mapping of the same keys. Raises InputError with every fault, a line each.
    """
    if columns is None:
        return {}, "", ()
    declared = {channel.key: file_key(channel.key, _ENTRY, default=None).metadata for channel in channels(scene)}
    names = {channel.key: channel.name for channel in channels(scene) if channel.kind == "angle"}
    omit = keys.list_of(keys.choice(tuple(names)), f"a list of {', '.join(names)}")
    declared["group"] = file_key("group", _GROUP, default="").metadata
    declared["omit"] = file_key("omit", omit, default=()).metadata
    text: str | None = None
    name, tables = "columns", columns
    if not isinstance(columns, Mapping):
        name, (text, tables) = str(columns), read_toml(Path(columns))
    assert isinstance(tables, Mapping)
    found, problems = keys.read_keys(declared, tables)
    if problems and text is not None:
        raise TableError(problems).in_file(text, name)
    if problems:
        raise InputError(f"columns: {problem.message}" for problem in problems)
    group = found.pop("group")
    omitted = tuple(names[key] for key in found.pop("omit"))
    entries = {key: entry for key, entry in found.items() if entry is not None}
    if entries.keys() == {TIME} or not (entries or group or omitted):
        raise InputError(f"{name}: no channel to compare; allowed: {', '.join(declared)}")
    return entries, group, omitted


def find_channels(
    table: DataTable, scene: Scene, entries: Mapping[str, Entry]
) -> tuple[dict[Channel, Entry], tuple[str, ...]]:
    """Where each channel comes from, with its unit, the time first, and a line for each that says so. Raises
    InputError."""
    known = channels(scene)
    vectors = Counter(name.rpartition("[")[0] for name in table.columns if name.endswith("]"))
    guessed: dict[str, str] = {}
    for name in table.columns:
        channel = guess(name, vectors[name.rpartition("[")[0]], known)
        if channel is None or (entries and channel.name != TIME):
            continue
        if channel.name in guessed:
            raise InputError(
                f"{table.source}: both {guessed[channel.name]!r} and {name!r} could be {channel.name}; allowed: "
                f"`{channel.key}` in a mapping file says which"
            )
        guessed[channel.name] = name
    chosen: dict[Channel, Entry] = {}
    lines = []
    for channel in known:
        if channel.key not in entries and channel.name not in guessed:
            continue
        entry = entries.get(channel.key) or Entry(column=guessed[channel.name])
        stated = table[entry.column].unit or split_unit(entry.column)[1]
        unit = entry.unit or stated
        if unit and unit.lower() not in UNITS[channel.kind]:
            raise InputError(
                f"{table.source}: column {entry.column!r} for {channel.name} is in {unit!r}; allowed: "
                f"{ALLOWED_UNITS[channel.kind]}"
            )
        chosen[channel] = replace(entry, unit=unit or channel.unit)
        line = f"{channel.name} = {'-' if entry.sign < 0 else ''}{entry.column!r}"
        if entry.offset:
            line += f" {entry.offset:+g}"
        line += f" [{unit or channel.unit}]"
        notes = [note for note, holds in (("unit assumed", not unit), ("wrapped", entry.wrapped)) if holds]
        lines.append(f"{line} ({', '.join(notes)})" if notes else line)
    shown = shown_names(list(table.columns))
    if known[0] not in chosen:
        raise InputError(f"{table.source}: no column for the time; it has: {shown}; allowed: `time` in a mapping file")
    if len(chosen) == 1:
        raise InputError(
            f"{table.source}: no column for an angle or a rate; it has: {shown}; allowed: a mapping file (columns)"
        )
    return chosen, tuple(lines)


@dataclass(frozen=True)
class ForeignData:
    """Samples of another program.

    time, values : (n,) s, increasing from 0 or later; (n, channels) rad or rad/s, what `channels` says.
    read, unused : a line for each channel: column, unit, and what was assumed; names of the other columns.
    rounding, time_rounding : (n, channels), (n,) half a unit in the last digit of each number, as it was written.
    wrapped : for each channel, whether whole turns are missing from it.
    digits : how many significant digits the numbers have, at most; 17 where they have all.
    omitted : names of channels that are not to be missed.
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
    digits: int = _ALL_DIGITS
    omitted: tuple[str, ...] = ()

    def rows(self, chosen: NDArray[np.bool_] | slice) -> ForeignData:
        return replace(
            self, time=self.time[chosen], values=self.values[chosen], rounding=self.rounding[chosen],
            time_rounding=self.time_rounding[chosen],
        )  # fmt: skip

    @property
    def columns(self) -> list[int]:
        """Places of the channels in a matrix of all angles, then all rates."""
        return [channel.column for channel in self.channels]


def load_data(
    data: str | os.PathLike[str] | Mapping[str, Any],
    scene: Scene,
    columns: str | os.PathLike[str] | Mapping[str, Any] | None = None,
) -> ForeignData:
    """Data from a file or from arrays by name, by a mapping or by guesses. Raises InputError, StoreError."""
    entries, group, omitted = read_mapping(columns, scene)
    table = table_of("data", data) if isinstance(data, Mapping) else read_table(data, group, scene.name)
    chosen, lines = find_channels(table, scene, entries)
    lengths = {entry.column: len(table[entry.column].values) for entry in chosen.values()}
    if len(set(lengths.values())) > 1:
        shown = ", ".join(f"{name} has {length} rows" for name, length in lengths.items())
        raise InputError(f"{table.source}: columns of different lengths: {shown}; allowed: a row for every time")
    arrays: list[Array] = []
    last_digits: list[Array] = []
    for channel, entry in chosen.items():
        values = table[entry.column].values
        bad = np.flatnonzero(~np.isfinite(values))
        if len(bad):
            raise InputError(
                f"{table.source}: column {entry.column!r} is {values[bad[0]]} in row {bad[0] + 1} of "
                f"{len(values)}; allowed: finite numbers"
            )
        factor = UNITS[channel.kind][entry.unit.lower()]
        last_digits.append(half_last_digits(values) * abs(factor))
        si_values: Array = entry.sign * (values + entry.offset) * factor
        arrays.append(np.unwrap(si_values) if entry.wrapped else si_values)
    _refuse_wrong_times(table.source, arrays[0])
    return ForeignData(
        table.source,
        arrays[0],
        np.stack(arrays[1:], axis=1),
        tuple(chosen)[1:],
        np.stack(last_digits[1:], axis=1),
        _time_rounding(arrays[0], last_digits[0]),
        lines,
        tuple(name for name in table.columns if name not in lengths),
        tuple(entry.wrapped for entry in chosen.values())[1:],
        max(_digits(table[entry.column].values) for channel, entry in chosen.items() if channel.name != TIME),
        omitted,
    )


def _time_rounding(time: Array, last_digits: Array) -> Array:
    """(n,) s: equal intervals are meant as they are written, though the times have few digits."""
    intervals = np.diff(time)
    if np.ptp(intervals) <= _EQUAL * float(intervals.mean()):
        return np.asarray(np.abs(time) * 2.0**-53)
    return last_digits


def half_last_digits(values: Array) -> Array:
    """(n,) half a unit in the last place of numbers as they were written: decimals, digits, single or double precision.

    Of the ways that all of them fit, the coarsest.
    """
    sizes = np.abs(values)
    largest = float(sizes.max(initial=0.0))
    if len(np.unique(values)) < _FEW_VALUES:  # which say nothing of digits
        return np.asarray(sizes * 2.0**-53)
    # Numbers of so many decimals may seem to have so many digits, and the other way round: of both the coarser.
    last = np.zeros(len(values))
    for decimals in range(_FEW_DIGITS + 1):
        unit = 10.0**-decimals
        noise = 4.0 * 2.0**-52 * largest  # of the arithmetic; with less than a hundredth of a unit any number fits
        if 100.0 * noise < unit < largest and np.abs(values - np.round(values / unit) * unit).max() <= noise:
            last[:] = 0.5 * unit
            break
    digits = _digits(values)
    if digits <= _FEW_DIGITS:
        exponents = np.floor(np.log10(np.where(sizes > 0.0, sizes, 1.0)))
        last = np.maximum(last, np.where(sizes > 0.0, 0.5 * 10.0 ** (exponents + 1 - digits), 0.0))
    if last.any():
        return last
    with np.errstate(over="ignore"):  # of what is larger than single precision can be
        single = np.asarray(values, np.float32).astype(float)
    return np.asarray(sizes * (2.0**-24 if np.array_equal(single, values) else 2.0**-53))


def _digits(values: Array) -> int:
    """With how many significant digits the numbers may have been written."""
    some = values[values != 0.0][:200]
    sizes = 10.0 ** np.floor(np.log10(np.abs(some)))
    for digits in range(1, _FEW_DIGITS + 1):
        unit = sizes * 10.0 ** (1 - digits)
        if np.allclose(some, np.round(some / unit) * unit, rtol=1e-12, atol=0.0):
            return digits
    return _ALL_DIGITS


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
