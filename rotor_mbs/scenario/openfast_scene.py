"""Write a scene file for the rotor of an OpenFAST model.

Comments in the file name the sources of its numbers, and what of the model is left out.
"""

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

# Longest duration (s) of the scene. The model's run may take 10 minutes or more. The first turns
# are enough for a rigid rotor, and every method computes them within seconds.
MAX_DURATION = 20.0
SAMPLE_STEP = 0.05  # s, time between samples
# Frequency (Hz), and damping as a share of critical damping, of the springs that hold pitches which
# the model prescribes but which are coordinates of the scene. At this frequency the weight of a
# blade moves the pitch by about 1 mrad only.
HOLDING_FREQUENCY, HOLDING_DAMPING = 5.0, 0.7
_WIDTH = 100  # largest length of a comment line


def scene_from_openfast(path: str | os.PathLike[str]) -> Scene:
    """Return the scene of an OpenFAST model's rotor, as `rotor-mbs new FILE --from MODEL.fst` does.

    The masses are those with which OpenFAST computes. Parts of the model that a scene cannot have,
    such as aerodynamics, are named in comments of the scene file, the attribute `text` of the
    scene.

    Parameters
    ----------
    path : path of the .fst file. Files of FAST v8 and of OpenFAST up to version 5 are read.

    Returns
    -------
    Scene
        The scene, with the name of the .fst file.

    Raises
    ------
    InputError
        If a file or line is missing, a number is not allowed, or no scene can be made from the
        model. The message has the file, the line and its name.
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
    """Return the scene of a rotor that was read from an OpenFAST model.

    Raises InputError if a number of the model is not allowed in a scene.
    """
    name = re.sub(r"[^A-Za-z0-9._-]+", "-", rotor.path.stem).lstrip(".") or "rotor"
    try:
        return parse_scene(scene_text(rotor), name)
    except InputError as error:
        # A scene does not allow all numbers that OpenFAST allows, such as a mass of 1e30 kg.
        shown = shown_path(rotor.path)
        lines = [f"{shown}: of the scene made of it: {line}" for line in error.problems]
        raise InputError(lines) from error


def scene_text(rotor: OpenFastRotor) -> str:
    """Return the text of a scene file, with comments, for a rotor.

    Parameters
    ----------
    rotor : rotor that was read from an OpenFAST model.
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
    """Return comment lines on what of the model is not in the scene, and on a fair comparison."""
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
    """Return the lines of a blade's table except its header, with comments on the sources.

    Parameters
    ----------
    blade : the blade.
    rotor : rotor of the blade, whose hub radius is used.
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
    """Return the lines of the tables [hub], [initial] and [torque].

    Parameters
    ----------
    rotor : rotor that was read from an OpenFAST model.
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
    """Return the lines of the table [bearing]; no lines if no blade has a pitch inertia.

    If the model prescribes the pitch, the lines have an assumed spring and damper.

    Parameters
    ----------
    rotor : rotor that was read from an OpenFAST model.
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
    """Return the text of a mapping file for `rotor-mbs compare --columns`.

    The file describes the output columns of the OpenFAST model.
    """
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
    """Return a text without control characters, with single blanks between words."""
    return " ".join("".join(c if c.isprintable() else " " for c in text).split())


def _comment(text: str, indent: str = "") -> list[str]:
    """Return a text as comment lines; `indent` is put before all lines except the first."""
    return textwrap.wrap(
        _on_one_line(text),
        _WIDTH,
        initial_indent="# ",
        subsequent_indent=f"# {indent}",
    )


def _number(number: float) -> str:
    """Return the TOML text of a number; a negative zero becomes 0.0."""
    return repr(number + 0.0)


def _angle(degrees: float) -> str:
    """Return the TOML text of an angle: "deg(-2.5)" in quotes, or 0.0."""
    return f'"deg({plain_number(degrees)})"' if degrees else "0.0"


def _entry(key: str, number: float, comment: str) -> str:
    """Return a line with a key, a number and a comment."""
    return f"{key} = {_number(number)}   # {comment}"


def _angle_entry(key: str, degrees: float, comment: str) -> str:
    """Return a line with a key, an angle and a comment, which begins with the unit rad."""
    return f"{key} = {_angle(degrees)}   # rad; {comment}"


def _one_or_list(entries: Sequence[str]) -> str:
    """Return the first entry if all entries are equal, otherwise the TOML text of their list."""
    return entries[0] if len(set(entries)) == 1 else f"[{', '.join(entries)}]"
