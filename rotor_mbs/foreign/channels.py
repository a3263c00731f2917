"""The channels that data may have: time, and angle and rate of every coordinate; their units, and guesses by name."""

from __future__ import annotations

import math
import re
from collections.abc import Sequence
from dataclasses import dataclass

from rotor_mbs.scenario.scene import Scene

TIME = "time"
# By dimension: factor to s, rad or rad/s.
_ANGLES = {
    **dict.fromkeys(("rad", "radian", "radians"), 1.0),
    **dict.fromkeys(("deg", "degree", "degrees", "°"), math.pi / 180.0),
    **dict.fromkeys(("turn", "turns", "rev", "revolutions"), 2.0 * math.pi),
}
_TIMES = {**dict.fromkeys(("s", "sec", "second", "seconds"), 1.0), "ms": 1e-3, "us": 1e-6, "µs": 1e-6, "min": 60.0}
_RATES = {f"{unit}{per}": factor for unit, factor in _ANGLES.items() for per in ("/s", "/sec", " s-1")}
_RATES |= dict.fromkeys(("rpm", "rev/min", "r/min"), math.pi / 30.0) | {"hz": 2.0 * math.pi}
UNITS = {"time": _TIMES, "angle": _ANGLES, "rate": _RATES}
ALLOWED_UNITS = {"time": "s, ms, us, min", "angle": "rad, deg, turns", "rate": "rad/s, deg/s, turns/s, rpm"}
BASE_UNITS = {"time": "s", "angle": "rad", "rate": "rad/s"}

# Names without digits, blanks and marks; a name of a rate is one of an angle with a word of _RATE_WORDS behind it.
_TIME_NAMES = {"time", "t", "times"}
_ROTOR_NAMES = {"rotor", "rotorangle", "rotorposition", "rot", "azimuth", "rotorazimuth", "azim", "psi", "shaft"}
_PITCH_NAMES = {"pitch", "pitchangle", "bladepitch", "bldpitch", "blpitch", "ptchpmzc", "ptchpmzb", "theta", "beta"}
_ROTOR_RATE_NAMES = {"omega"}
_RATE_WORDS = ("rate", "speed", "velocity", "vel", "dot")
_VECTORS = {
    "angle": {"angles", "angle", "q", "qpos", "coordinates", "positions"},
    "rate": {"rates", "rate", "qd", "dq", "qdot", "qvel", "coordinates_t", "velocities"},
}
_UNIT_ENDING = re.compile(r"_((?:rad|deg|turns|rev)(?:_per_s|/s|_s)?|rpm|s|ms|us|min)$", re.IGNORECASE)


@dataclass(frozen=True)
class Channel:
    """A coordinate's angle or rate, or the time.

    name     "rotor", "pitch 1", "rotor rate", "pitch 1 rate", "time"
    kind     "angle", "rate" or "time"
    column   of the matrix of angles, then rates, (n, 2 (1 + blades)); -1 for the time
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
        fitting = [one for one in known if array in _VECTORS.get(one.kind, ())]
        return fitting[int(entry[2])] if len(fitting) == vector else None
    plain = split_unit(name)[0].lower()
    letters = re.sub(r"[^a-z]", "", plain)
    if letters in _TIME_NAMES:
        return known[0]
    ending = next((word for word in _RATE_WORDS if letters.endswith(word)), "")
    rate = " rate" if ending else ""
    stem = letters.removesuffix(ending)
    digits = re.findall(r"\d+", plain)
    if stem in _PITCH_NAMES:
        only = "1" if len([one for one in known if one.kind == "angle"]) == 2 else ""
        return next((one for one in known if one.name == f"pitch {digits[-1] if digits else only}{rate}"), None)
    if letters in _ROTOR_RATE_NAMES:
        stem, rate = "rotor", " rate"
    return next((one for one in known if one.name == f"rotor{rate}"), None) if stem in _ROTOR_NAMES else None


def split_unit(name: str) -> tuple[str, str]:
    """Name and unit of a column whose name ends in a unit.

    >>> split_unit("pitch_1_rate_deg_s"), split_unit("rotor")
    (('pitch_1_rate', 'deg/s'), ('rotor', ''))
    """
    match = _UNIT_ENDING.search(name)
    if match is None:
        return name, ""
    return name[: match.start()], match[1].lower().replace("_per_s", "/s").replace("_s", "/s")
