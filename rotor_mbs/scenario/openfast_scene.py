"""Write a scene file for an OpenFAST model, with comments on what of the model it holds."""

from __future__ import annotations

import os
import re
import textwrap
from collections.abc import Sequence

from rotor_mbs.errors import InputError
from rotor_mbs.scenario.keys import MAX_TEXT
from rotor_mbs.scenario.openfast import BladeModel, OpenFastRotor, plain_number, read_rotor
from rotor_mbs.scenario.scene import Scene, parse_scene
from rotor_mbs.scenario.toml_file import file_path, shown_path, toml_value

# A model may run for 10 minutes or more; of a rigid rotor the first turns say enough, and every
# method runs them within seconds.
MAX_DURATION = 20.0  # s
SAMPLE_STEP = 0.05  # s
# A pitch that the model prescribes is kept by a spring where it is a coordinate of the scene. The
# spring is this fast, so that the weight of a blade moves the pitch by about 1 mrad.
HOLDING_FREQUENCY, HOLDING_DAMPING = 5.0, 0.7  # Hz, of critical damping
_WIDTH = 100


def scene_from_openfast(path: str | os.PathLike[str]) -> Scene:
    """Return the scene of an OpenFAST model's rotor, as `rotor-mbs new FILE --from MODEL.fst` does.

    Masses are those that OpenFAST computes with. What the model has and a scene has not, such as
    aerodynamics, is in the comments of the scene's `text`, a scene file.

    Parameters
    ----------
    path : of the .fst file. FAST v8 and OpenFAST up to version 5 are read.

    Returns
    -------
    Scene
        Named after the file.

    Raises
    ------
    InputError
        For a file or line that is missing, a number that is not allowed, and a model of which no
        scene can be made; with file, line and name.
    TypeError
        If `path` is neither text nor a path.

    Examples
    --------
    >>> import rotor_mbs as rm
    >>> scene = rm.scene_from_openfast("NREL-5MW.fst")  # doctest: +SKIP
    >>> print(scene.text)                               # doctest: +SKIP
    """
    return scene_of_rotor(read_rotor(file_path(path)))


def scene_of_rotor(rotor: OpenFastRotor) -> Scene:
    """Return the scene of a rotor that was read; as `scene_from_openfast`."""
    name = re.sub(r"[^A-Za-z0-9._-]+", "-", rotor.path.stem).lstrip(".") or "rotor"
    try:
        return parse_scene(scene_text(rotor), name)
    except InputError as error:
        # The reader allows what OpenFAST allows; a scene may allow less, of a mass of 1e30 kg.
        shown = shown_path(rotor.path)
        lines = [f"{shown}: of the scene made of it: {line}" for line in error.problems]
        raise InputError(lines) from error


def scene_text(rotor: OpenFastRotor) -> str:
    """Return a commented scene file of a rotor.

    Parameters
    ----------
    rotor : as it was read from the OpenFAST model.
    """
    duration = min(rotor.duration, MAX_DURATION) or 10.0
    title = _on_one_line(f"{rotor.path.stem}: {rotor.description}")[:MAX_TEXT].rstrip(": ")
    lines = [
        *_comment(f"The rotor of the OpenFAST model {rotor.path.name}."),
        *_comment(
            "SI units, angles in rad; arithmetic in quotes has the model's own numbers. y is along "
            "the shaft, OpenFAST's x (downwind); z up; x is OpenFAST's -y."
        ),
        *_left_out_comments(rotor),
        "",
        f"title = {toml_value(title)}",
        f"blades = {len(rotor.blades)}",
        _entry("gravity", rotor.gravity, "m/s^2"),
        _entry("duration", duration, f"s; TMax of the model: {rotor.duration:g}"),
        f"samples = {max(round(duration / SAMPLE_STEP), 100) + 1}",
        'outputs = ["angles", "rates", "tip", "energy", "loads"]',
        "",
    ]
    are_equal = rotor.has_equal_blades
    for blade in rotor.blades[:1] if are_equal else rotor.blades:
        lines += ["[blade]" if are_equal else "[[blade]]", *_blade_lines(blade, rotor), ""]
    lines += [*_hub_and_start_lines(rotor), *_bearing_lines(rotor)]
    lines += ["[shaft]", _angle_entry("tilt", rotor.tilt, "ShftTilt: the +y end rises"), ""]
    return "\n".join(lines)


def _left_out_comments(rotor: OpenFastRotor) -> list[str]:
    """Return comment lines on what the model has and the scene has not, and how to compare."""
    lines = ["#"]
    if rotor.left_out:
        lines.append("# In the model and not in this scene, the most important first:")
        for note in rotor.left_out:
            lines += _comment(f"- {note}", indent="  ")
    advice = (
        "A fair comparison needs in the model: every degree of freedom False but GenDOF"
        " (and PitchDOF), CompAero, CompInflow and CompServo 0 (without PitchDOF), TStart 0,"
        ' OutFmt "ES20.12E3".'
    )
    return [*lines, *_comment(advice)]


def _blade_lines(blade: BladeModel, rotor: OpenFastRotor) -> list[str]:
    """Return the entries of the table of a blade, with comments on their sources.

    Parameters
    ----------
    blade : the blade.
    rotor : its rotor, for the hub radius.
    """
    x, y, z = blade.centre_of_mass
    tip_x, tip_y, tip_z = blade.tip
    on_axis = not x and not y
    source = (
        f"{blade.source[0].upper()}{blade.source[1:]}: {blade.mass:.3f} kg, first moment "
        f"{blade.first_moment:.3f} kg m, second moment {blade.second_moment:.3f} kg m^2 along the "
        "blade, about its root."
    )
    lines = _comment(source)
    for note in blade.notes:
        lines += _comment(note)
    if on_axis:
        lines += _comment(
            "The mass is on the pitch axis, as ElastoDyn has it: weight and rotation do not pitch "
            "the blade. Good for loads and rotor motion, not for a study of the pitch motion."
        )
    if on_axis and not blade.inertia[2]:
        lines += _comment("Without an inertia about its axis a pitch is no coordinate: it stays.")
    radius = plain_number(rotor.hub_radius)
    centre = [_number(x), _number(y), f'"{radius} + {plain_number(z)}"']
    tip = [_number(tip_x), _number(tip_y), f'"{radius} + {plain_number(tip_z)}"']
    return [
        *lines,
        _entry("mass", blade.mass, "kg"),
        f"centre_of_mass = [{', '.join(centre)}]   # m: HubRad, and from the root",
        "# kg m^2 about the centre of mass: xx yy zz xy xz yz",
        f"inertia = [{', '.join(map(_number, blade.inertia))}]",
        f"tip = [{', '.join(tip)}]   # m",
        _angle_entry("cone", blade.cone, "PreCone: the blade leans towards +y"),
    ]


def _hub_and_start_lines(rotor: OpenFastRotor) -> list[str]:
    """Return the lines of the tables of the hub, the initial state and the torque.

    Parameters
    ----------
    rotor : as it was read from the OpenFAST model.
    """
    azimuth = rotor.azimuth - rotor.azimuth_up
    angles = [_angle(azimuth), *(_angle(-blade.pitch) for blade in rotor.blades)]
    rates = [
        f'"{plain_number(rotor.speed)}*pi/30"' if rotor.speed else "0.0",
        *["0.0"] * len(rotor.blades),
    ]
    inertia = f'inertia = "{rotor.hub_inertia_text}"'
    return [
        "[hub]",
        f"{inertia}   # kg m^2: HubIner + GenIner*GBRatio**2",
        _entry("mass", rotor.hub_mass, "kg, in the shaft's loads alone"),
        _entry("radius", rotor.hub_radius, "m, where root loads are given"),
        "",
        "[initial]",
        f"angles = [{', '.join(angles)}]   # rad: Azimuth - AzimB1Up; -BlPitch",
        f"rates = [{', '.join(rates)}]   # rad/s: RotSpeed",
        "",
        "[torque]",
        "rotor = 0.0   # N m, or rows [[t, torque], ...]: of the wind, less the generator's",
        "",
    ]


def _bearing_lines(rotor: OpenFastRotor) -> list[str]:
    """Return the lines of the table of the pitch bearings; none if no pitch can move.

    Parameters
    ----------
    rotor : as it was read from the OpenFAST model. If it prescribes the pitch, a spring and damper
        are assumed.
    """
    rests = [-blade.pitch for blade in rotor.blades]
    if rotor.bearing:
        stiffness = [_number(bearing[0]) for bearing in rotor.bearing]
        damping = [_number(bearing[1]) for bearing in rotor.bearing]
        rests = [-neutral for _, _, neutral in rotor.bearing]
        comments = ["# of ServoDyn: PitSpr, PitDamp, -PitNeut"]
    else:
        inertias = [_pitch_inertia(blade) for blade in rotor.blades]
        if not any(inertias):
            return []
        rate = f"(2*pi*{HOLDING_FREQUENCY:g})"
        stiffness = [f'"{plain_number(inertia)}*{rate}**2"' for inertia in inertias]
        damping = [
            f'"2*{HOLDING_DAMPING:g}*{plain_number(inertia)}*{rate}"' for inertia in inertias
        ]
        comments = _comment(
            "The model prescribes the pitch. This spring keeps it: it is assumed, a pitch inertia "
            f"at {HOLDING_FREQUENCY:g} Hz with {HOLDING_DAMPING:g} of critical damping. It starts "
            "without load and takes up the blade's weight within a period, "
            f"{1.0 / HOLDING_FREQUENCY:g} s: loads and pitch rates of that time are not the "
            "model's."
        )
    return [
        "[bearing]",
        *comments,
        f"stiffness = {_one_or_list(stiffness)}   # N m/rad",
        f"damping = {_one_or_list(damping)}   # N m s/rad",
        f"rest = {_one_or_list([_angle(rest) for rest in rests])}   # rad",
        "",
    ]


def _pitch_inertia(blade: BladeModel) -> float:
    """Return a blade's inertia about its pitch axis, kg m²."""
    x, y, _ = blade.centre_of_mass
    return blade.inertia[2] + blade.mass * (x * x + y * y)


def mapping_text(rotor: OpenFastRotor) -> str:
    """Return a mapping file for the output of the model, for `rotor-mbs compare --columns`."""
    lines = [
        *_comment(f"Columns of the output of {rotor.path.name} (.out or .outb), for:"),
        "#   rotor-mbs compare OUTPUT --scene SCENE --columns THIS",
        'program = "openfast"   # names, units, signs, frames and points of its channels',
        "",
        "[openfast]",
        _entry("AzimB1Up", rotor.azimuth_up, "deg"),
        _entry("HubCM", rotor.hub_centre_of_mass, "m"),
    ]
    if rotor.undersling:
        lines.append(_entry("UndSling", rotor.undersling, "m"))
    return "\n".join([*lines, ""])


# Text


def _on_one_line(text: str) -> str:
    """Return a text without control characters, each run of blanks as one."""
    return " ".join("".join(c if c.isprintable() else " " for c in text).split())


def _comment(text: str, indent: str = "") -> list[str]:
    """Return a text as comment lines; lines but the first begin with `indent`."""
    return textwrap.wrap(
        _on_one_line(text),
        _WIDTH,
        initial_indent="# ",
        subsequent_indent=f"# {indent}",
    )


def _number(number: float) -> str:
    """Return a number in TOML, without the sign of a zero."""
    return repr(number + 0.0)


def _angle(degrees: float) -> str:
    """Return an angle in TOML, "deg(-2.5)" in quotes."""
    return f'"deg({plain_number(degrees)})"' if degrees else "0.0"


def _entry(key: str, number: float, comment: str) -> str:
    """Return the line of a number."""
    return f"{key} = {_number(number)}   # {comment}"


def _angle_entry(key: str, degrees: float, comment: str) -> str:
    """Return the line of an angle."""
    return f"{key} = {_angle(degrees)}   # rad; {comment}"


def _one_or_list(entries: Sequence[str]) -> str:
    """Return one value where all are equal, else the list of them."""
    return entries[0] if len(set(entries)) == 1 else f"[{', '.join(entries)}]"
