"""How methods and coordinates are drawn, the same in every figure, and the colours of light and dark pages."""

from __future__ import annotations

import re
import zlib
from dataclasses import dataclass, replace

from rotor_mbs.methods.catalogue import label_of as label_of


@dataclass(frozen=True)
class Look:
    """How a curve is drawn, in matplotlib's notation: colour ("#0072b2"), line ("-", "--", "-.", ":") and marker.

    label: what it is called in a legend; "" where it stands in none.
    """

    colour: str
    line: str
    marker: str
    label: str = ""


# Every colour of a picture, and what stands for it on a dark page. A picture has colours of methods or of coordinates,
# never of both.
INK, PAPER, GREY = "#000000", "#ffffff", "#666666"
BLUE, VERMILLION, GREEN, PURPLE = "#0072b2", "#d55e00", "#009e73", "#cc79a7"
ORANGE, LIGHT_BLUE = "#e69f00", "#56b4e9"
_METHODS = {  # Okabe & Ito's, distinguishable with colour blindness; without the yellow, which does not show on white
    INK: "#e6e9ed", BLUE: "#4fa8e0", VERMILLION: "#ff8a3d", GREEN: "#2fc498", PURPLE: "#e79cc6",
    ORANGE: "#f7bd45", LIGHT_BLUE: "#9bd6f8",
}  # fmt: skip
_COORDINATES = {  # Tol's muted ones: the rotor, then a blade each
    "#4a5058": "#c9ced4", "#882255": "#e583b2", "#2a8a7e": "#62cdbf", "#5a46b5": "#ab9ff5", "#8a7a1c": "#d6c75c",
    "#b5505f": "#f2a3ae",
}  # fmt: skip
_OTHERS = {GREY: "#a3adb8", PAPER: "#1d2127", "#c8c8c8": "#4d5560", "#dddddd": "#3a424b", "#f2e3de": "#3a2e2a"}
PALETTE = {**_METHODS, **_COORDINATES, **_OTHERS}
COLOURS, COORDINATES = tuple(_METHODS), tuple(_COORDINATES)
_CLASSES = {colour: f"k{place}" for place, colour in enumerate(PALETTE)}
_CLASS_RULES = "".join(f".{name}{{color:var(--{name})}}" for name in _CLASSES.values())
# Of the style sheet, by name: the light and the dark colour.
_VARIABLES = {name: (colour, PALETTE[colour]) for colour, name in _CLASSES.items()} | {
    "sheet": (PAPER, PALETTE[PAPER]),
    "grid": ("#e4e4e4", "#333b44"),
}

# By the name of a method, or of a curve of the bench: the method's name and its variant.
_LOOKS = {
    "reference": Look(BLUE, "-.", "*"),
    "printed/ode45": Look(INK, "-", "x"),
    "printed_e1/ode45": Look(INK, "--", "<"),
    "printed_e2/ode45": Look(INK, "-.", ">"),
    "printed_e3/ode45": Look(INK, ":", "p"),
    "lagrange/taylor": Look(BLUE, "-", "o"),
    "lagrange/ode45": Look(LIGHT_BLUE, "-", "v"),
    "lagrange/dop853": Look(BLUE, "--", "D"),
    "lagrange/radau": Look(LIGHT_BLUE, "--", "*"),
    "exudyn_tree/rk44": Look(ORANGE, "-.", "P"),
    "exudyn_tree/rk67": Look(VERMILLION, "--", "s"),
    "exudyn_tree/dopri5": Look(VERMILLION, "-", "<"),
    "exudyn_tree/generalized_alpha": Look(ORANGE, "-", "^"),
    "exudyn_tree/generalized_alpha_rho0.7": Look(ORANGE, "--", "^"),
    "exudyn_tree/generalized_alpha_rho1.0": Look(ORANGE, ":", "^"),
    "exudyn_chain/extrapolated": Look(GREEN, "-.", "^"),
    "exudyn_chain/generalized_alpha": Look(GREEN, "-", "s"),
    "exudyn_chain/generalized_alpha_rho0.7": Look(GREEN, "--", "^"),
    "exudyn_chain/generalized_alpha_rho1.0": Look(GREEN, ":", "^"),
    "exudyn_chain/generalized_alpha_rotation_vector": Look(GREEN, "-.", ">"),
    "exudyn_chain/generalized_alpha_rho0.7_rotation_vector": Look(GREEN, "--", ">"),
    "exudyn_chain/generalized_alpha_rho1.0_rotation_vector": Look(GREEN, ":", ">"),
    "exudyn_chain/newmark_index2": Look(PURPLE, "-", "D"),
    "exudyn_chain/newmark_index2_rotation_vector": Look(PURPLE, ":", "p"),
    "mujoco/rk4": Look(PURPLE, "--", "X"),
    "mujoco/implicitfast": Look(PURPLE, "-.", "h"),
    "mujoco/implicit": Look(PURPLE, ":", "h"),
}
_OTHER_LINES = (":", "-.", "--", "-")
_OTHER_MARKERS = ("D", "o", "s", "^", "v", "P", "X", "h", "p", "<", ">")


def look_of(curve: str) -> Look:
    """Return how a method, or a curve of the bench, is drawn; one that is not in the table in grey."""
    if curve in _LOOKS:
        return replace(_LOOKS[curve], label=label_of(curve))
    code = zlib.crc32(curve.encode("utf-8", "replace"))
    line = _OTHER_LINES[code % len(_OTHER_LINES)]
    marker = _OTHER_MARKERS[code // len(_OTHER_LINES) % len(_OTHER_MARKERS)]
    return Look(GREY, line, marker, label_of(curve))


def class_of(colour: str) -> str:
    """The class of a colour of the palette in the style sheet; "" for another colour."""
    return _CLASSES.get(colour, "")


def palette_css() -> str:
    """The palette as variables of a style sheet, light and, where the page is dark, dark; and a class per colour."""
    light, dark = (";".join(f"--{name}:{pair[i]}" for name, pair in _VARIABLES.items()) for i in (0, 1))
    night = "@media screen and (prefers-color-scheme:dark)"
    return f":root{{{light}}}\n{night}{{:root{{{dark}}}}}\n{_CLASS_RULES}\n"


def with_light_palette(css: str) -> str:
    """`css` of pictures and the classes of the palette, with light colours in place of variables."""
    return re.sub(r"var\(--(\w+)\)", lambda variable: _VARIABLES[variable[1]][0], _CLASS_RULES + css)


def with_capital(text: str) -> str:
    """`text` with a capital first letter; the others stay as they are."""
    return text[:1].upper() + text[1:]


def coordinate_look(index: int, label: str = "") -> Look:
    """Line of a coordinate: 0 the rotor, i the pitch (and the tip) of blade i."""
    if not index:
        return Look(COORDINATES[0], "-", "", label or "rotor")
    colour = COORDINATES[1 + (index - 1) % (len(COORDINATES) - 1)]
    return Look(colour, ("-", "--", "-.")[(index - 1) % 3], "", label or f"pitch {index}")
