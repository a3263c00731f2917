"""The channels that data may have, and the names of columns by which they are known.

Channels are the time, angle and rate of every coordinate, and components of loads; of a table of
modes the speed and frequencies.
"""

from __future__ import annotations

import itertools
import re
from collections.abc import Sequence
from dataclasses import dataclass, replace

from rotor_mbs.comparison.columns import BASE_UNITS
from rotor_mbs.errors import InputError
from rotor_mbs.scenario.scene import Scene
from rotor_mbs.solution.quantities import LOADS

TIME, SPEED = "time", "speed"
# Names without digits, blanks and marks, as listed in docs/compare.md; a name of a rate is one of
# an angle with a word of RATE_WORDS behind it, or d before it.
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
# Names of arrays with a column for each coordinate.
VECTOR_NAMES = {
    "angle": ("angles", "angle", "q", "qpos", "coordinates", "positions"),
    "rate": ("rates", "rate", "qd", "dq", "qdot", "qvel", "coordinates_t", "velocities"),
}
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
# By the frame in which a scene's loads have them, the other frames in which data may have them.
FRAMES = {"blade": ("rotor", "base"), "base": ("rotor",)}
_FRAME_ENDINGS = (["blade", "frame"], ["rotor", "frame"], ["base", "frame"])
# OpenFAST's root loads, of the blade on the hub: x along the shaft, z along the blade, y against
# the rotor's sense; the axes b turn with the pitch, the axes c do not.
_OPENFAST = re.compile(r"root([fm])([xyz])([bc])(\d+)", re.IGNORECASE)
_OPENFAST_AXES = {"x": ("y", -1), "y": ("x", 1), "z": ("z", -1)}
_UNIT_ENDING = re.compile(
    r"_((?:rad|deg|turns|rev)(?:_per_s|/s|_s)?|rpm|hz|s|ms|us|min|(?-i:k?Nm?))$", re.IGNORECASE
)
_BEYOND_INDICES = 10**10


def channel_key(name: str) -> str:
    """Return the key of a channel in mapping files and its variable in records: "pitch_1_rate"."""
    return name.replace(",", "").replace(" ", "_")


@dataclass(frozen=True)
class Channel:
    """What a column of data may be: "rotor", "pitch 1 rate", "shaft force x"; "frequency 1".

    Attributes
    ----------
    name : in words.
    kind : of its unit, a key of `BASE_UNITS`.
    column : of the matrix of angles, then rates, then loads; of the damped, then the undamped
        frequencies; -1 for time and speed.
    frame : of a load, where it is not the scene's.
    sign : of the column's numbers, where its name has a convention.
    """

    name: str
    kind: str
    column: int
    frame: str = ""
    sign: int = 1

    @property
    def key(self) -> str:
        """Its key in a mapping file: "pitch_1_rate"."""
        return channel_key(self.name)

    @property
    def unit(self) -> str:
        return BASE_UNITS[self.kind]

    @property
    def is_load(self) -> bool:
        return self.kind in ("force", "moment")

    def in_frame(self, frame: str) -> Channel:
        """Return the same component in another frame. Raises InputError if it has none there."""
        own = ""
        if self.name.startswith("blade root"):
            own = "blade"
        elif self.name.startswith("shaft"):
            own = "base"
        if frame == own:
            return self
        if not self.is_load or frame not in FRAMES.get(own, ()):
            allowed = f"{own}, {', '.join(FRAMES[own])}" if own else "none"
            raise InputError(f"{self.key}: frame {frame!r}; allowed: {allowed}")
        return replace(self, name=f"{self.name}, {frame} frame", frame=frame)


def channels(scene: Scene) -> list[Channel]:
    """Return the channels that data of a scene may have, the time first."""
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


def channel_from_name(name: str, vector: int, known: Sequence[Channel]) -> Channel | None:
    """Return the channel that a column's name suggests, None where it suggests none.

    Parameters
    ----------
    name : of the column, "rotor_deg", or of an array's column, "q[0]".
    vector : how many columns its array has, 0 where it is none: `q[0]` is the rotor where there is
        one per coordinate.
    known : `channels` or `mode_channels`.
    """
    plain = split_unit(name)[0].lower()
    array, indices = _array_and_indices(name)
    if known[0].name == SPEED:
        return _mode_channel(plain, known, is_entry=bool(indices))
    openfast = _OPENFAST.fullmatch(plain)
    if openfast:
        return _openfast_load(openfast, known)
    if indices:
        return _array_channel(array, indices, vector, known)
    load = _named_load(plain, known)
    if load is not None:
        return load
    letters, numbers = re.sub(r"[^a-z]", "", plain), re.findall(r"\d+", plain)
    if letters in TIME_NAMES:
        return known[0]
    return _angle_or_rate(letters, numbers, known)


def _array_and_indices(name: str) -> tuple[str, list[int]]:
    """Return "q" and [0, 1] of "group/q[0,1]"; "" and [] where the name is no array's column."""
    entry = re.fullmatch(r"(.*)\[([\d,]+)\]", name)
    if entry is None:
        return "", []
    array = entry[1].rpartition("/")[2].strip().lower()
    return array, [_number(digits) for digits in entry[2].split(",")]


def _number(digits: str) -> int:
    """Return digits as a number; one that no index reaches where there are none, or too many."""
    return int(digits) if 0 < len(digits) < 10 else _BEYOND_INDICES


def _named(name: str, known: Sequence[Channel]) -> Channel | None:
    """Return the channel of this name."""
    return next((channel for channel in known if channel.name == name), None)


def _has_one_blade(known: Sequence[Channel]) -> bool:
    """Whether there is a pitch 1 alone, whose number may be left out."""
    return _named("pitch 2", known) is None


def _mode_channel(plain: str, known: Sequence[Channel], *, is_entry: bool) -> Channel | None:
    """Return the speed or a frequency; plain: the name without its unit."""
    letters, numbers = re.sub(r"[^a-z]", "", plain), re.findall(r"\d+", plain)
    if letters in SPEED_NAMES:
        return _named(SPEED, known)
    number = 1
    if numbers:
        number = _number(numbers[-1])
        if is_entry:
            number += 1  # indices begin with 0
    for kind, names in FREQUENCY_NAMES.items():
        if letters in names and plain != "mode":  # a column "mode" alone numbers them
            return _named(f"{kind} {number}", known)
    return None


def _openfast_load(match: re.Match[str], known: Sequence[Channel]) -> Channel | None:
    """Return the root load that OpenFAST's name has."""
    quantity, openfast_axis, frame, blade = match.groups()
    axis, sign = _OPENFAST_AXES[openfast_axis]
    kind = "force" if quantity == "f" else "moment"
    load = _named(f"blade root {kind} {blade} {axis}", known)
    if load is None:
        return None
    return replace(load.in_frame("rotor" if frame == "c" else "blade"), sign=sign)


def _array_channel(
    array: str, indices: Sequence[int], vector: int, known: Sequence[Channel]
) -> Channel | None:
    """Return the channel of an array's column, if the array has as many columns as channels."""
    fitting = [channel for channel in known if array in VECTOR_NAMES.get(channel.kind, ())]
    if not fitting and array:
        fitting = [channel for channel in known if channel.key.startswith(f"{array}_")]
    place = indices[0]
    if len(indices) == 2:
        place = 3 * indices[0] + indices[1]  # blades and axes
    if len(fitting) != vector or place >= vector:
        return None
    return fitting[place]


def _named_load(plain: str, known: Sequence[Channel]) -> Channel | None:
    """Return the component of a load of this name, with the frame that may stand behind it."""
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
    """Return the angle or rate whose name has these letters and numbers.

    Parameters
    ----------
    letters : of the name without its unit, "pitchrate".
    numbers : in the name, the last of which is a blade's.
    known : the channels that there are.
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
    """Return name and unit of a column whose name ends in a unit.

    >>> split_unit("pitch_1_rate_deg_s"), split_unit("rotor")
    (('pitch_1_rate', 'deg/s'), ('rotor', ''))
    """
    match = _UNIT_ENDING.search(name)
    if match is None:
        return name, ""
    return name[: match.start()], re.sub("_(?:per_)?s$", "/s", match[1].lower())
