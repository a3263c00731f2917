"""Read units in any usual spelling: `rad s^-1`, `radian/second`, `kN·m`, `[deg]`.

A unit is a product of atoms, such as `kN` and `m`, with integer exponents. `unit_factor` returns
the factor to the SI unit if the unit has the dimension of the channel.
"""

from __future__ import annotations

import math
import re
from collections.abc import Mapping

_RADIAN, _DEGREE, _TURN = 1.0, math.pi / 180.0, 2.0 * math.pi
# An atom: its exponents of time, angle, force and length, and its factor to SI units.
_Atom = tuple[tuple[int, int, int, int], float]
_TIME, _ANGLE, _FORCE, _LENGTH = (1, 0, 0, 0), (0, 1, 0, 0), (0, 0, 1, 0), (0, 0, 0, 1)
_PER_TIME, _RATE, _MOMENT = (-1, 0, 0, 0), (-1, 1, 0, 0), (0, 0, 1, 1)


def _spelled(dimension: tuple[int, int, int, int], **names: float) -> dict[str, _Atom]:
    """Return atoms of one dimension by their spellings.

    Parameters
    ----------
    dimension : exponents of time, angle, force and length.
    names : factors to SI units. Each keyword is a list of spellings of one atom, joined by "_".
    """
    atoms = {}
    for spellings, factor in names.items():
        for spelling in spellings.split("_"):
            atoms[spelling] = (dimension, factor)
    return atoms


# Atoms by their spelling in lower case.
_ATOMS: dict[str, _Atom] = {
    **_spelled(_TIME, s_sec_secs_second_seconds_sekunde_sekunden=1.0, min_minute_minutes=60.0),
    **_spelled(_TIME, h_hr_hour_hours=3600.0, ms_msec_millisecond_milliseconds=1e-3),
    **_spelled(_TIME, us_usec_microsecond_microseconds=1e-6),
    **_spelled(_TIME, ns_nanosecond_nanoseconds=1e-9, d_day_days=86400.0),
    **_spelled(_ANGLE, rad_rads_radian_radians=_RADIAN, mrad=1e-3, gon=_TURN / 400.0),
    **_spelled(_ANGLE, deg_degs_degree_degrees=_DEGREE),
    **_spelled(_ANGLE, turn_turns_rev_revs_revolution_revolutions_r_cycle_cycles=_TURN),
    "°": (_ANGLE, _DEGREE),
    "µs": (_TIME, 1e-6),
    "μs": (_TIME, 1e-6),
    **_spelled(_RATE, hz_hertz_rps=_TURN, rpm=math.pi / 30.0, khz=1e3 * _TURN),
    **_spelled(_FORCE, n_newton_newtons=1.0, kn_kilonewton_kilonewtons=1e3),
    **_spelled(_LENGTH, m_meter_meters_metre_metres=1.0, mm=1e-3, cm=1e-2, km=1e3),
    **_spelled(_MOMENT, nm=1.0, knm=1e3),
}
# Atoms whose spellings are case-sensitive.
_EXACT: dict[str, _Atom] = {
    "MN": (_FORCE, 1e6),
    "mN": (_FORCE, 1e-3),
    "MNm": (_MOMENT, 1e6),
    "mNm": (_MOMENT, 1e-3),
}
# The dimensions that a unit may have, for each kind of channels.
_DIMENSIONS = {
    "time": (_TIME,),
    "angle": (_ANGLE,),
    "rate": (_RATE, _PER_TIME),
    "frequency": (_RATE, _PER_TIME),
    "force": (_FORCE,),
    "moment": (_MOMENT,),
}
ALLOWED_UNITS = {
    "time": "s, ms, us, min",
    "angle": "rad, deg, turns",
    "rate": "rad/s, deg/s, turns/s, rpm",
    "frequency": "rad/s, Hz",
    "force": "N, kN",
    "moment": "N m, kN m",
}
BASE_UNITS = {
    "time": "s",
    "angle": "rad",
    "rate": "rad/s",
    "frequency": "rad/s",
    "force": "N",
    "moment": "N m",
}
_NO_UNITS = ("", "-", "1", "none", "n/a", "dimensionless")
_MAX_LENGTH = 60  # largest number of characters of a unit
_SUPERSCRIPTS = str.maketrans("⁰¹²³⁴⁵⁶⁷⁸⁹⁻⁺−º·⋅×", "0123456789-+-°***")
_TERM = re.compile(r"\s*([*./-]?)\s*([^\W\d_]+|°)(?:\^?[({]?([+-]?\d+)[)}]?)?")


def plain_unit(text: str) -> str:
    """Return a unit without its brackets and without "since ..."; "" for texts such as "-".

    >>> plain_unit(" [rad]"), plain_unit("seconds since 2000-01-01"), plain_unit("(-)")
    ('rad', 'seconds', '')
    """
    unit = text.strip().strip("[](){} \"'").partition(" since ")[0].strip()
    return "" if unit.lower() in _NO_UNITS else unit


def unit_factor(unit: str, kind: str) -> float | None:
    """Return the factor from a unit to the SI unit of a kind of channels.

    Parameters
    ----------
    unit : the unit in any usual spelling, with or without brackets.
    kind : kind of the channels, a key of `BASE_UNITS`.

    Returns
    -------
    float or None
        The factor; None if the unit is unknown, or has another dimension than the kind.

    >>> unit_factor("rad s^-1", "rate"), unit_factor("kN·m", "moment"), unit_factor("kg", "force")
    (1.0, 1000.0, None)
    """
    parsed = _parsed(plain_unit(unit))
    if parsed is None or parsed[0] not in _DIMENSIONS[kind]:
        return None
    # "1/s" is read as rad/s. "1/min" is refused, because it may mean turns per minute.
    if parsed[0] == _PER_TIME and parsed[1] != 1.0:
        return None
    return parsed[1]


def is_unit(text: str) -> bool:
    """Return whether a text is a unit of any channel."""
    return any(unit_factor(text, kind) is not None for kind in BASE_UNITS)


def _parsed(unit: str) -> _Atom | None:
    """Return the dimension of a unit and its factor to SI units.

    Parameters
    ----------
    unit : the unit without brackets.

    Returns
    -------
    _Atom or None
        Exponents of time, angle, force and length, and the factor to SI units; None if an atom is
        unknown, an exponent is above 3 or below -3, the text has more than `_MAX_LENGTH`
        characters, or it is no unit.
    """
    if not unit or len(unit) > _MAX_LENGTH:
        return None
    text = unit.translate(_SUPERSCRIPTS).replace("**", "^")
    text = re.sub(r"\s+per\s+", "/", text)
    if text.startswith("1/"):
        text = text[1:]
    exponents, factor = [0, 0, 0, 0], 1.0
    place = 0
    while place < len(text):
        term = _TERM.match(text, place)
        if term is None:
            return None
        divider, name, exponent = term.groups()
        atom = _EXACT.get(name) or _ATOMS.get(name.lower())
        if atom is None:
            return None
        power = int(exponent or 1)
        if abs(power) > 3:
            return None
        if divider == "/":
            power = -power
        for i, dimension in enumerate(atom[0]):
            exponents[i] += power * dimension
        factor *= atom[1] ** power
        place = term.end()
    time, angle, force, length = exponents
    return (time, angle, force, length), factor


def unit_of_attributes(attributes: Mapping[str, object]) -> str:
    """Return the unit in an attribute `units` or `unit` of an array; "" if there is none.

    Parameters
    ----------
    attributes : attributes of the array by name. The unit may be a text, bytes, or a list or array
        with one text or bytes.
    """
    for name in ("units", "unit", "Units", "Unit", "UNITS"):
        value = attributes.get(name)
        # A file may have the text in an array with one element.
        if getattr(value, "size", 0) == 1 and hasattr(value, "ravel"):
            value = value.ravel()[0]
        if isinstance(value, list | tuple) and len(value) == 1:
            value = value[0]
        if isinstance(value, bytes):
            value = value.decode("utf-8", "replace")
        if isinstance(value, str):
            return value.strip("\x00 ")
    return ""
