"""Recognize the columns of OpenFAST's output as channels, with their sign, frame and zero.

OpenFAST's axes x (downwind), y, z are the axes y, -x, z of a scene. OpenFAST's pitch is positive
towards feather, which is a rotation about the negative pitch axis. OpenFAST's loads are exerted by
a blade on the hub, and by the rotor on the shaft; a scene's loads are the opposite.
"""

from __future__ import annotations

import math
import re
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from typing import NamedTuple

from rotor_mbs.comparison.channels import FRAMES, TIME, Channel, channel_from_name
from rotor_mbs.comparison.columns import DataTable
from rotor_mbs.comparison.units import plain_unit, unit_factor
from rotor_mbs.scenario import keys
from rotor_mbs.scenario.keys import file_key
from rotor_mbs.scenario.scene import Scene

PROGRAM = "openfast"
# Units that are taken if the table states none, as may be the case after a conversion of the file.
# The rotor's rate is in rpm instead.
_UNITS = {"time": "s", "angle": "deg", "rate": "deg/s", "force": "kN", "moment": "kN m"}
_AZIMUTH = ("azimuth", "lsstipp", "lsstippxa", "lsstippxs")
_SPEED = ("rotspeed", "lsstipv", "lsstipvxa", "lsstipvxs")
_PITCH = re.compile(r"(?:bldpitch|blpitch|ptchpmzc|ptchpmzb)(\d+)")
_PITCH_RATE = re.compile(r"bldprate(\d+)")
# Other names of moments at the blade roots: in-plane, out-of-plane, edgewise and flapwise, and the
# standard names for them.
_ROOT_MOMENT = re.compile(r"rootm(ip|oop|edg|flp)(\d+)")
_ROOT_AXES = {"ip": "rootmxc", "oop": "rootmyc", "edg": "rootmxb", "flp": "rootmyb"}
# Loads that rotor and hub exert on the shaft. The name has OpenFAST's axis, then "a" if the axes
# turn with the shaft, or "s" if they do not. The axis along the shaft is the same for both.
_SHAFT = re.compile(r"(?P<load>lsshftf|lsstipm)(?P<axis>[xyz])(?P<frame>[as])")
_SHAFT_AXES = {"x": ("y", -1), "y": ("x", 1), "z": ("z", -1)}
# Names of columns that are not compared, and the reasons.
_REASONS = (
    (
        re.compile(r"rottorq|lsshfttq|lsshftmx[as]|lsstipmx[as]|rotpwr"),
        "of the torque into the drive train, which is no load of a scene: see torque.rotor",
    ),
    (
        re.compile(r"lssgagm[yz][as]"),
        "at the shaft's strain gages; a scene has the moment at the apex, LSSTipMys and LSSTipMzs",
    ),
)


@dataclass(frozen=True)
class OpenFastSettings:
    """Numbers of an OpenFAST model that are needed to read its output.

    Attributes
    ----------
    azimuth_up : azimuth at which blade 1 points up, deg.
    hub_centre : distance of the hub's centre of mass from the apex, m, positive downwind.
    undersling : distance of the apex from the teeter pin, m.
    """

    azimuth_up: float = file_key("AzimB1Up", keys.NUMBER, "deg", default=0.0)
    hub_centre: float = file_key("HubCM", keys.NUMBER, "m", default=0.0)
    undersling: float = file_key("UndSling", keys.NUMBER, "m", default=0.0)


class Suggestion(NamedTuple):
    """A channel and its column: channel = sign * (column + offset).

    Attributes
    ----------
    channel : the channel.
    column : name of the column.
    sign : 1 or -1.
    offset : number that is added to the column, in the column's unit.
    unit : unit of the column; "" for the unit that the file states.
    wrapped : whether whole turns are missing from the angle.
    """

    channel: Channel
    column: str
    sign: int = 1
    offset: float = 0.0
    unit: str = ""
    wrapped: bool = False


def describe(settings: OpenFastSettings, *, is_guessed: bool) -> str:
    """Return a line for the user that says how the columns of OpenFAST's output are read.

    Parameters
    ----------
    settings : numbers of the model.
    is_guessed : True if the head of the file says that OpenFAST wrote it; False if a mapping does.
    """
    source = "by its head" if is_guessed else "by the mapping"
    zero = f" less AzimB1Up = {settings.azimuth_up:g} deg" if settings.azimuth_up else ""
    return (
        f"OpenFAST's output, {source}: pitch with opposite sign, azimuth{zero} without wrapping,"
        " loads with opposite sign, at hub.radius, with the weight of hub.mass"
    )


def suggested(
    table: DataTable,
    known: Sequence[Channel],
    scene: Scene,
    settings: OpenFastSettings,
) -> tuple[list[Suggestion], dict[str, str]]:
    """Find the channels that the columns of OpenFAST's output are.

    Parameters
    ----------
    table : the columns.
    known : `channels` of the scene.
    scene : the rotor. Its hub, tilt and number of blades matter for the loads of the shaft.
    settings : numbers of the model.

    Returns
    -------
    list of Suggestion, dict
        A suggestion for each channel that is found, with the first column for this channel; the
        reasons, by name of the column, why other columns with known names are not compared.
    """
    found: dict[str, Suggestion] = {}
    reasons: dict[str, str] = {}
    for name in table.columns:
        plain = name.strip().strip("_").lower()
        reason = next((text for pattern, text in _REASONS if pattern.fullmatch(plain)), "")
        suggestion = None if reason else _suggestion(name, plain, known, settings)
        if suggestion is None:
            if reason:
                reasons[name] = reason
            continue
        channel = suggestion.channel
        if _is_about_pin(channel, scene, settings):
            reasons[name] = "about the teeter pin, and the apex is not there (UndSling)"
            continue
        stated = table.columns[name].unit
        unit = plain_unit(stated) if stated else suggestion.unit or _UNITS[channel.kind]
        hub = _hub_offset(channel, scene, settings)
        if math.isnan(hub):
            reasons[name] = "turns with the moment of the hub's weight (HubCM); LSSTipMys is read"
            continue
        factor = unit_factor(unit, channel.kind)
        if hub and factor:
            suggestion = suggestion._replace(offset=hub / factor)
        if channel.name in found:
            reasons[name] = f"{channel.name} is read from {found[channel.name].column!r}"
            continue
        found[channel.name] = suggestion._replace(unit="" if stated else unit)
    return list(found.values()), reasons


def _suggestion(
    name: str,
    plain: str,
    known: Sequence[Channel],
    settings: OpenFastSettings,
) -> Suggestion | None:
    """Return the channel that a column's name means, None for an unknown name.

    Parameters
    ----------
    name, plain : name of the column as in the file, and in lower case without "_" at its ends.
    known : `channels` of the scene.
    settings : numbers of the model. Only the zero of the azimuth is used.
    """
    by_name = {channel.name: channel for channel in known}
    if plain in _AZIMUTH:
        rotor = by_name["rotor"]
        return Suggestion(rotor, name, offset=-settings.azimuth_up, wrapped=True)
    if plain in _SPEED:
        return Suggestion(by_name["rotor rate"], name, unit="rpm")
    for pattern, ending in ((_PITCH, ""), (_PITCH_RATE, " rate")):
        match = pattern.fullmatch(plain)
        if match:
            channel = by_name.get(f"pitch {match[1]}{ending}")
            return None if channel is None else Suggestion(channel, name, sign=-1)
    shaft = _SHAFT.fullmatch("lsshftfxa" if plain == "rotthrust" else plain)
    if shaft:
        return _shaft_load(name, shaft, by_name)
    root = _ROOT_MOMENT.fullmatch(plain)
    standard = f"{_ROOT_AXES[root[1]]}{root[2]}" if root else plain
    if standard.startswith("root"):
        channel = channel_from_name(standard, 0, known)
        if channel is None or not channel.is_load:
            return None
        if standard.rstrip("0123456789").endswith("c"):
            # The axes "c" do not turn with the pitch; their frame is "coned".
            own = by_name[channel.name.partition(",")[0]]
            sign = channel.sign
            return Suggestion(_in_frame(own, ("coned", "rotor")), name, sign)
        return Suggestion(channel, name, channel.sign)
    return Suggestion(by_name[TIME], name) if plain == "time" else None


def _shaft_load(name: str, match: re.Match[str], by_name: Mapping[str, Channel]) -> Suggestion:
    """Return the load of the shaft that a column's name means.

    Parameters
    ----------
    name : name of the column.
    match : match of the name with `_SHAFT`.
    by_name : `channels` of the scene by name.
    """
    axis, sign = _SHAFT_AXES[match["axis"]]
    kind = "force" if match["load"] == "lsshftf" else "moment"
    frames = ("rotor",) if match["frame"] == "a" and axis != "y" else ("shaft", "base")
    return Suggestion(_in_frame(by_name[f"shaft {kind} {axis}"], frames), name, sign)


def _in_frame(channel: Channel, frames: Iterable[str]) -> Channel:
    """Return a load's component in the first of some frames that are possible for the load.

    Parameters
    ----------
    channel : the component in the frame of the scene's loads; returned if no frame is possible.
    frames : the frames, the preferred one first.
    """
    own = channel.own_frame
    for frame in frames:
        if frame == own or frame in FRAMES.get(own, ()):
            return channel.in_frame(frame)
    return channel


def _is_about_pin(channel: Channel, scene: Scene, settings: OpenFastSettings) -> bool:
    """Return whether a channel is a shaft moment about a teeter pin that is not at the apex."""
    is_shaft_moment = channel.name.startswith("shaft moment")
    return is_shaft_moment and len(scene.blades) == 2 and settings.undersling != 0.0


def _hub_offset(channel: Channel, scene: Scene, settings: OpenFastSettings) -> float:
    """Return the correction of a shaft moment, N m, for the position of the hub's weight.

    The weight of the hub acts at HubCM in OpenFAST, and at the apex in a scene.

    Parameters
    ----------
    channel : the channel. The correction is 0 unless it is a moment of the shaft.
    scene : the rotor, with mass of the hub, gravity and tilt.
    settings : numbers of the model.

    Returns
    -------
    float
        The number to be added to the column. NaN in axes that turn with the rotor, in which the
        correction changes with the azimuth.
    """
    if not channel.name.startswith("shaft moment") or not settings.hub_centre * scene.hub_mass:
        return 0.0
    if channel.frame == "rotor":
        return math.nan
    weight = scene.hub_mass * scene.gravity * math.cos(scene.shaft_tilt)
    is_about_x = channel.name.startswith("shaft moment x")
    return -settings.hub_centre * weight if is_about_x else 0.0
