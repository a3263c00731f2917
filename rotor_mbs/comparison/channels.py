"""Define the channels that data may have, and recognize them by the names of columns.

The channels of a trajectory are the time, the angle and rate of every coordinate, and the
components of loads. The channels of a table of modes are the speed and the frequencies.
"""

from __future__ import annotations

import itertools
import re
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import NamedTuple

from rotor_mbs.comparison.columns import split_bracketed_unit
from rotor_mbs.comparison.units import ALLOWED_UNITS, BASE_UNITS
from rotor_mbs.errors import InputError
from rotor_mbs.scenario.scene import Scene
from rotor_mbs.solution.quantities import LOADS

TIME, SPEED = "time", "speed"
# Names of columns in lower case, without digits, blanks and punctuation; `known_names` lists them.
# A rate has the name of its angle, followed by a word of RATE_WORDS or preceded by "d".
TIME_NAMES = ("time", "t", "times", "zeit")
ROTOR_NAMES = (
    "rotor", "rotorangle", "rotorposition", "rot", "azimuth", "rotorazimuth", "azim", "psi", "phi",
    "shaft",
)  # fmt: skip
PITCH_NAMES = (
    "pitch", "pitchangle", "bladepitch", "bldpitch", "blpitch", "ptchpmzc", "ptchpmzb", "theta",
    "beta",
)  # fmt: skip
ROTOR_RATE_NAMES = ("omega",)
RATE_WORDS = ("rate", "speed", "velocity", "vel", "dot")
# Names of arrays that have a column for each coordinate.
VECTOR_NAMES = {
    "angle": ("angles", "angle", "q", "qpos", "coordinates", "positions"),
    "rate": ("rates", "rate", "qd", "dq", "qdot", "qvel", "coordinates_t", "velocities"),
}
_VECTORS = {
    kind: tuple(name.replace("_", "") for name in names) for kind, names in VECTOR_NAMES.items()
}
_RATE_ARRAYS = _VECTORS["rate"]
SPEED_NAMES = ("speed", "rotorspeed", "rotspeed", "omega")
FREQUENCY_NAMES = {
    "frequency": (
        "frequency", "freq", "f", "mode", "frequencies", "dampedfrequency", "dampedfrequencies",
    ),
    "undamped frequency": (
        "undampedfrequency", "undampedfrequencies", "naturalfrequency", "naturalfrequencies",
    ),
}  # fmt: skip
LOAD_NAMES = tuple(load.name.replace("_", " ") for load in LOADS)
# A scene has loads in the frame "blade" or "base". `FRAMES` has, for each of these two frames, the
# other frames in which data may have the same loads.
# The frame "blade" turns with the pitch. The frame "coned" is the frame "blade" at zero pitch. The
# frame "rotor" turns with the rotor: its y axis is along the shaft, and its z axis is normal to the
# shaft. For loads of a blade, this z axis is at the blade's azimuth. The frame "shaft" is the base
# frame turned by the tilt.
FRAMES = {"blade": ("coned", "rotor", "shaft", "base"), "base": ("shaft", "rotor")}
LOAD_FRAMES = ("blade", *FRAMES["blade"])
_FRAME_ENDINGS = [[frame, "frame"] for frame in LOAD_FRAMES]
# `_OPENFAST` matches the names of OpenFAST's root loads. `_OPENFAST_AXES` has, for each axis of
# OpenFAST, the axis of the scene and the sign of the load. In OpenFAST the blade exerts the root
# load on the hub, in the scene the hub exerts it on the blade. OpenFAST's x axis is along the
# shaft, z along the blade, and y against the rotor's sense of rotation. The axes "b" turn with the
# pitch, the axes "c" do not.
_OPENFAST = re.compile(r"root([fm])([xyz])([bc])(\d+)", re.IGNORECASE)
_OPENFAST_AXES = {"x": ("y", -1), "y": ("x", 1), "z": ("z", -1)}
_UNIT_ENDING = re.compile(
    r"_((?:rad|deg|turns|rev)(?:_per_s|/s|_s)?|rpm|hz|s|ms|us|min|(?-i:k?Nm?))$", re.IGNORECASE
)
_BEYOND_INDICES = 10**10  # a number that is larger than any index of a column
_DERIVATIVE = re.compile(r"der\s*\((.*)\)", re.IGNORECASE)  # as in Modelica and FMI
_MODELICA = ((".phi", ""), (".w", " rate"))  # endings of the angle and rate of a joint in Modelica


def channel_key(name: str) -> str:
    """Return the key of a channel in mapping files and in records: "pitch_1_rate"."""
    return name.replace(",", "").replace(" ", "_")


@dataclass(frozen=True)
class Channel:
    """A quantity that a column of data may be: "rotor", "pitch 1 rate", "shaft force x".

    Attributes
    ----------
    name : name of the channel in words.
    kind : kind of the quantity, which determines its unit: a key of `BASE_UNITS`.
    column : index of the channel among all angles, rates and loads, in this order. In a table of
        modes, the index among the damped, then the undamped frequencies. -1 for time and speed.
    frame : frame of a load's component if it is not the frame of the scene's loads; otherwise "".
    sign : -1 if the program that uses the column's name has the opposite sign, as OpenFAST has for
        some loads; otherwise 1.
    """

    name: str
    kind: str
    column: int
    frame: str = ""
    sign: int = 1

    @property
    def key(self) -> str:
        """Return the key of the channel: "pitch_1_rate".

        It is the key in a mapping file, except for a load in another frame than the scene's: its
        key ends with the frame, but keys in mapping files have no frame.
        """
        return channel_key(self.name)

    @property
    def unit(self) -> str:
        """Return the SI unit of the channel's numbers."""
        return BASE_UNITS[self.kind]

    @property
    def is_load(self) -> bool:
        """Return whether the channel is a component of a force or moment."""
        return self.kind in ("force", "moment")

    @property
    def own_frame(self) -> str:
        """Return the frame in which a scene has this load.

        Returns
        -------
        str
            "blade" or "base"; "" for a load without components, and for a channel that is no load.
        """
        if self.name.startswith("blade root"):
            return "blade"
        return "base" if self.name.startswith("shaft") else ""

    def in_frame(self, frame: str) -> Channel:
        """Return the same component in another frame.

        Parameters
        ----------
        frame : one of `LOAD_FRAMES`.

        Raises
        ------
        InputError
            If the load has no components in this frame, or the channel is no load.
        """
        own = self.own_frame
        if frame == own:
            return self
        if not self.is_load or frame not in FRAMES.get(own, ()):
            allowed = f"{own}, {', '.join(FRAMES[own])}" if own else "none"
            raise InputError(f"{self.key}: frame {frame!r}; allowed: {allowed}")
        return replace(self, name=f"{self.name}, {frame} frame", frame=frame)


def channels(scene: Scene) -> list[Channel]:
    """Return the channels that data of a scene may have, the time first.

    Parameters
    ----------
    scene : the scene. Its number of blades determines the channels.
    """
    labels = scene.coordinate_labels
    known = [Channel(TIME, "time", -1)]
    known += [Channel(label, "angle", i) for i, label in enumerate(labels)]
    known += [Channel(f"{label} rate", "rate", len(labels) + i) for i, label in enumerate(labels)]
    for load in LOADS:
        name, kind = load.name.replace("_", " "), "force" if load.units == "N" else "moment"
        blades, axes = [""], [""]
        if "blade" in load.dimensions:
            blades = [f" {i + 1}" for i in range(len(scene.blades))]
        if "axis" in load.dimensions:
            axes = [" x", " y", " z"]
        for blade, axis in itertools.product(blades, axes):
            known.append(Channel(f"{name}{blade}{axis}", kind, len(known) - 1))
    return known


def mode_channels(scene: Scene) -> list[Channel]:
    """Return the channels that a table of modes may have, the speed first."""
    known = [Channel(SPEED, "rate", -1)]
    for kind in FREQUENCY_NAMES:
        for i in range(len(scene.coordinate_labels)):
            known.append(Channel(f"{kind} {i + 1}", "frequency", len(known) - 1))
    return known


def known_names() -> list[tuple[str, ...]]:
    """Return the rows of a table for the user: a quantity, and the names of columns for it."""
    affixes = f"the suffix {', '.join(RATE_WORDS[:-1])} or {RATE_WORDS[-1]}, or the prefix d"
    rows: list[tuple[str, ...]] = [
        ("time", ", ".join(TIME_NAMES)),
        ("rotor", ", ".join(ROTOR_NAMES)),
        ("pitch of a blade, with its number", ", ".join(PITCH_NAMES)),
        ("rotor rate", f"a name of the rotor with {affixes}; {', '.join(ROTOR_RATE_NAMES)}"),
        ("pitch rate", f"a name of a pitch with {affixes}"),
        ("rate of x", "der(x)"),
        ("angle and rate of a joint", "rotor.phi, rotor.w, pitch[1].phi, pitch[1].w"),
        ("array of angles, rotor first", ", ".join(VECTOR_NAMES["angle"])),
        ("array of rates, rotor first", ", ".join(VECTOR_NAMES["rate"])),
        ("column of an array", "q[0], q[1], q(1), q[1,1], q_1: from 0; from 1 if none is 0"),
        ("load, with blade and axis, or an array", ", ".join(load.name for load in LOADS)),
        ("root load of OpenFAST", "RootFxb1, RootMyc2, ..."),
        ("modes: rotor speed, without a time", ", ".join(SPEED_NAMES)),
    ]
    for kind, names in FREQUENCY_NAMES.items():
        of_kind = "damped frequency" if kind == "frequency" else kind
        rows.append((f"modes: {of_kind}, with its number, or an array", ", ".join(names)))
    rows.append(("units", "; ".join(dict.fromkeys(ALLOWED_UNITS.values()))))
    rows.append(("ways to write a unit", "rotor [deg], rotor (deg), rotor in deg, rotor_deg"))
    return rows


class Entry(NamedTuple):
    """The numbers in the name of a numbered column, such as `q[2,1]` or `pitch_2`.

    Attributes
    ----------
    key : the name with a mark in place of the numbers. All columns of an array have the same key.
    numbers : the numbers.
    start, end : positions at which the numbers start and end. They are positions in the name
        without its unit. Square brackets around the numbers are included.
    """

    key: str
    numbers: tuple[int, ...]
    start: int
    end: int


def entry_of(name: str) -> Entry | None:
    """Return the numbers in a column's name, and their position.

    Parameters
    ----------
    name : name of the column. The numbers in its last square brackets are taken. If there are no
        numbers in brackets, the last number in the name is taken.

    Returns
    -------
    Entry or None
        The numbers; None for a name without numbers.
    """
    plain = split_unit(name)[0]
    end = plain.rfind("]")
    start = plain.rfind("[", 0, max(end, 0))
    if 0 <= start < end:
        content = plain[start + 1 : end]
        if content and all(character in "0123456789, " for character in content):
            numbers = tuple(_number(digits.strip()) for digits in content.split(","))
            return Entry(f"{plain[:start]}[]{plain[end + 1 :]}", numbers, start, end + 1)
    groups = list(re.finditer(r"\d+", plain))
    if not groups:
        return None
    start, end = groups[-1].span()
    return Entry(f"{plain[:start]}#{plain[end:]}", (_number(plain[start:end]),), start, end)


class Place(NamedTuple):
    """The place of a column in its array.

    Attributes
    ----------
    columns : number of columns of the array.
    indices : indices of the column in the array, counted from 0.
    """

    columns: int
    indices: tuple[int, ...]


def places_of(names: Sequence[str]) -> dict[str, Place]:
    """Return the places of numbered columns in their arrays, by name of the column.

    Modelica and FMI count from 1, Python from 0. If no column of an array has the number 0 in a
    dimension, this dimension is counted from 1. A dimension of length 1 is left out if another
    dimension is longer, as in `q[1,1]` ... `q[4,1]`.

    Parameters
    ----------
    names : names of all columns of the data. The place of a column depends on the other columns of
        its array.
    """
    arrays: dict[str, dict[str, tuple[int, ...]]] = {}
    for name in names:
        entry = entry_of(name)
        if entry is not None:
            arrays.setdefault(f"{entry.key} {len(entry.numbers)}", {})[name] = entry.numbers
    places = {}
    for columns in arrays.values():
        dimensions = []
        for numbers in zip(*columns.values(), strict=True):
            is_counted = len(set(numbers)) > 1 or len(columns) == 1
            dimensions.append((min(numbers) > 0, is_counted))
        if not any(is_counted for _, is_counted in dimensions):
            dimensions = [(is_from_1, True) for is_from_1, _ in dimensions]
        for name, numbers in columns.items():
            indices = []
            for number, (is_from_1, is_counted) in zip(numbers, dimensions, strict=True):
                if is_counted:
                    indices.append(number - 1 if is_from_1 else number)
            places[name] = Place(len(columns), tuple(indices))
    return places


def channel_from_name(
    name: str, vector: int, known: Sequence[Channel], indices: Sequence[int] | None = None
) -> Channel | None:
    """Return the channel that a column's name suggests, None if it suggests none.

    Parameters
    ----------
    name : name of a column, such as "rotor_deg", "q[0]" in an array, or "der(x)" for the rate of x.
    vector : number of columns of the column's array; 0 if it is in no array. For example, `q[0]` is
        the rotor only if the array has a column for each coordinate.
    known : all channels that the data may have, by `channels` or `mode_channels`.
    indices : indices of the column in its array, see `Place`. By default they are the numbers in
        the name, counted from 0 if they are in square brackets, otherwise from 1.

    Raises
    ------
    InputError
        If the name means a load in a frame in which the load has no components.
    """
    stripped = name.strip().strip("\"'").strip()
    inner = _DERIVATIVE.fullmatch(split_unit(stripped)[0])
    if inner:
        return _rate_of(channel_from_name(inner[1], vector, known, indices), known)
    channel = _channel_of_path(stripped, vector, known, indices)
    folder, _, last = split_unit(stripped)[0].rpartition("/")
    if channel is None and folder and last:
        # In a name such as "run/rates/rotor", the last part is the name of the coordinate. An
        # earlier part may be the name of an array of rates; the column then is a rate.
        channel = _channel_of_path(last, vector, known, indices)
        parts = {_array_name(part) for part in folder.split("/")}
        if channel is not None and parts & set(_RATE_ARRAYS):
            channel = _rate_of(channel, known) or channel
    return channel


def names_a_channel(name: str, known: Sequence[Channel]) -> bool:
    """Return whether a name is the name of a channel, or of an array of channels."""
    if channel_from_name(name, 0, known) is not None:
        return True
    array = _array_name(split_unit(name)[0].rpartition("/")[2])
    for channel in known:
        if array in _VECTORS.get(channel.kind, ()) or array in _load_arrays(channel):
            return True
    return False


def arrays_of_other_length(
    names: Sequence[str], known: Sequence[Channel], kind: str = ""
) -> dict[str, str]:
    """Find arrays of angles or rates whose number of columns is not that of the coordinates.

    Parameters
    ----------
    names : names of all columns of the data.
    known : all channels that the data may have.
    kind : "angle" or "rate" to find only arrays of this kind; by default both kinds are found.

    Returns
    -------
    dict of str
        For each column of such an array, by its name, a text with the number of the array's columns
        and that of the scene's coordinates.
    """
    reasons: dict[str, str] = {}
    if known[0].name == SPEED:
        return reasons
    places = places_of(names)
    for name in names:
        entry, plain, width = entry_of(name), split_unit(name)[0], 1
        array = plain
        if entry is not None:
            if plain[entry.end :].strip("_ .)\"'"):
                continue
            array, width = plain[: entry.start], places[name].columns
        array = array.strip("_ .(\"'")
        for array_kind in (kind,) if kind else tuple(_VECTORS):
            if _array_name(array.rpartition("/")[2]) not in _VECTORS[array_kind]:
                continue
            count = sum(channel.kind == array_kind for channel in known)
            if width != count:
                columns = "1 column" if width == 1 else f"{width} columns"
                reasons[name] = f"`{array}` has {columns}, the scene has {count} coordinates"
    return reasons


def _load_arrays(channel: Channel) -> tuple[str, ...]:
    """Return the names of the two arrays that may have a load's component as a column.

    The first name is that of an array with the load of all blades. The second name is that of an
    array with the load of one blade.
    """
    if not channel.is_load:
        return ()
    of_one = channel.name.rstrip("xyz ")
    return _array_name(of_one.rstrip("0123456789 ")), _array_name(of_one)


def _rate_of(channel: Channel | None, known: Sequence[Channel]) -> Channel | None:
    """Return the channel of an angle's rate; None if the given channel is no angle."""
    if channel is None or channel.kind != "angle":
        return None
    return _named(f"{channel.name} rate", known)


def _array_name(name: str) -> str:
    """Return an array's name in lower case without blanks, "_" and ".": "qdot" for "Q_dot"."""
    return re.sub(r"[\s_.]", "", name).lower()


def _channel_of_path(
    name: str, vector: int, known: Sequence[Channel], indices: Sequence[int] | None
) -> Channel | None:
    """Return the channel that a whole name suggests, None if it suggests none.

    A path such as "run/rates/rotor" is read as one name; `channel_from_name` tries its last part.

    Parameters
    ----------
    name, vector, known, indices : see `channel_from_name`.
    """
    plain = split_unit(name)[0].lower()
    entry = entry_of(plain)
    is_bracketed = entry is not None and plain[entry.start : entry.start + 1] == "["
    if known[0].name == SPEED:
        return _mode_channel(plain, known, is_entry=is_bracketed, indices=indices)
    openfast = _OPENFAST.fullmatch(plain)
    if openfast:
        return _openfast_load(openfast, known)
    if entry is not None:
        if indices is None:
            indices = entry.numbers
            if not is_bracketed:
                indices = [number - 1 for number in entry.numbers]
        ends = plain[: entry.start].strip("_ .("), plain[entry.end :].strip("_ .)")
        if is_bracketed or not ends[1]:
            found = _array_channel(_array_name(ends[0] + ends[1]), indices, vector, known)
            if found is not None:
                return found
        if len(indices) != 1:
            return None
        # The column is in no array of a known name, so its number is taken as that of a blade.
        # Blades are counted from 1.
        plain = f"{plain[: entry.start]} {indices[0] + 1} {plain[entry.end :]}"
    load = _named_load(plain, known)
    if load is not None:
        return load
    for ending, replacement in _MODELICA:
        if plain.endswith(ending) and plain != ending:
            plain = plain.removesuffix(ending) + replacement
            break
    letters, numbers = re.sub(r"[^a-z]", "", plain.removesuffix("(t)")), re.findall(r"\d+", plain)
    if letters in TIME_NAMES:
        return known[0] if not numbers else None
    channel = _angle_or_rate(letters, numbers, known)
    if channel is None or entry is None:
        return channel
    # Two kinds of arrays are not identified: an array of several rotor angles, because its columns
    # are the azimuths of the blades; and an array with more pitches than there are blades, because
    # its first column may be the rotor. A pitch whose number has no brackets, as in
    # "pitch_2", is identified in any case: the number is the blade's.
    blades = sum(other.kind == "angle" for other in known) - 1
    allowed = 1 if channel.name.startswith("rotor") else blades
    return (
        channel
        if vector <= allowed or (not is_bracketed and channel.name.startswith("pitch"))
        else None
    )


def _number(digits: str) -> int:
    """Return digits as a number; `_BEYOND_INDICES` if there are no digits or too many."""
    return int(digits) if 0 < len(digits) < 10 else _BEYOND_INDICES


def _named(name: str, known: Sequence[Channel]) -> Channel | None:
    """Return the channel with a name, None if there is none."""
    return next((channel for channel in known if channel.name == name), None)


def _has_one_blade(known: Sequence[Channel]) -> bool:
    """Return whether the rotor has one blade; names may then lack the blade's number."""
    return _named("pitch 2", known) is None


def _mode_channel(
    plain: str, known: Sequence[Channel], *, is_entry: bool, indices: Sequence[int] | None
) -> Channel | None:
    """Return the channel of a table of modes that a name suggests, None if it suggests none.

    Parameters
    ----------
    plain : name of the column without its unit, in lower case.
    known : `mode_channels`.
    is_entry : whether the number in the name is in square brackets, and so is counted from 0.
    indices : indices of the column in its array, see `Place`; None to take the number in the name.
    """
    letters, numbers = re.sub(r"[^a-z]", "", plain), re.findall(r"\d+", plain)
    if letters in SPEED_NAMES:
        return _named(SPEED, known)
    number = 1
    if numbers:
        number = _number(numbers[-1])
        if indices is not None:
            number = 1 + (indices[0] if len(indices) == 1 else _BEYOND_INDICES)
        elif is_entry:
            number += 1  # the number of a mode is counted from 1
    for kind, names in FREQUENCY_NAMES.items():
        if letters in names and plain != "mode":  # a column "mode" has numbers of modes
            return _named(f"{kind} {number}", known)
    return None


def _openfast_load(match: re.Match[str], known: Sequence[Channel]) -> Channel | None:
    """Return the root load that a name of OpenFAST means, None if there is no such blade.

    Parameters
    ----------
    match : match of the name with `_OPENFAST`.
    known : `channels`.
    """
    quantity, openfast_axis, frame, blade = match.groups()
    axis, sign = _OPENFAST_AXES[openfast_axis]
    kind = "force" if quantity == "f" else "moment"
    load = _named(f"blade root {kind} {blade} {axis}", known)
    if load is None:
        return None
    return replace(load.in_frame("coned" if frame == "c" else "blade"), sign=sign)


def _array_channel(
    array: str, indices: Sequence[int], vector: int, known: Sequence[Channel]
) -> Channel | None:
    """Return the channel of an array's column.

    The result is None if no array of channels has this name, or if the array should have another
    number of columns.

    Parameters
    ----------
    array : name of the array, see `_array_name`.
    indices : indices of the column, counted from 0. There is one index, or for a load there may be
        two: blade and axis.
    vector : number of columns of the array, which has to equal the number of its channels.
    known : all channels that the data may have.
    """
    fitting = [channel for channel in known if array in _VECTORS.get(channel.kind, ())]
    if fitting and len(indices) != 1:
        return None
    if not fitting and array:
        fitting = [channel for channel in known if array in _load_arrays(channel)]
    place = indices[0]
    if len(indices) == 2:
        place = 3 * indices[0] + indices[1]  # blade and axis
    if len(fitting) != vector or not 0 <= place < vector or max(indices) >= vector:
        return None
    return fitting[place]


def _named_load(plain: str, known: Sequence[Channel]) -> Channel | None:
    """Return the load's component that a name means, None if the name is unknown.

    Parameters
    ----------
    plain : name of the column without its unit; it may end in a frame, "... coned frame".
    known : all channels that the data may have.
    """
    words = re.findall(r"[a-z]+|\d+", plain)
    frame = ""
    if words[-2:] in _FRAME_ENDINGS:
        frame, words = words[-2], words[:-2]
    name = " ".join(words)
    load = _named(name, known)
    if load is None and _has_one_blade(known):
        load = _named(f"{name} 1", known)
    if load is None or not load.is_load:
        return None
    return load.in_frame(frame) if frame else load


def _angle_or_rate(
    letters: str, numbers: Sequence[str], known: Sequence[Channel]
) -> Channel | None:
    """Return the angle or rate that the letters and numbers of a name mean, None if unknown.

    Parameters
    ----------
    letters : the letters of the name without its unit, "pitchrate".
    numbers : the numbers in the name. For a pitch, the last one is the number of the blade.
    known : all channels that the data may have.
    """
    ending = next((word for word in RATE_WORDS if letters.endswith(word)), "")
    stem = letters.removesuffix(ending)
    if letters[:1] == "d" and letters[1:] in (*PITCH_NAMES, *ROTOR_NAMES):
        ending, stem = "d", letters[1:]
    rate = " rate" if ending else ""
    if stem in PITCH_NAMES:
        number = numbers[-1] if numbers else ""
        if not number and _has_one_blade(known):
            number = "1"
        return _named(f"pitch {number}{rate}", known)
    if letters in ROTOR_RATE_NAMES:
        return _named("rotor rate", known)
    if stem in ROTOR_NAMES:
        return _named(f"rotor{rate}", known)
    return None


def split_unit(name: str) -> tuple[str, str]:
    """Split a column's name into name and unit; the unit is "" if there is none.

    In addition to the forms of `split_bracketed_unit`, endings such as "_deg_s" are recognized.

    >>> split_unit("pitch_1_rate_deg_s"), split_unit("rotor in rad"), split_unit("rotor")
    (('pitch_1_rate', 'deg/s'), ('rotor', 'rad'), ('rotor', ''))
    """
    stem, unit = split_bracketed_unit(name)
    if unit:
        return stem, unit
    match = _UNIT_ENDING.search(name[-40:])
    if match is None:
        return name, ""
    stem = name[: len(name) - len(match[0])]
    return stem, re.sub("_(?:per_)?s$", "/s", match[1].lower())
