"""How methods and coordinates are drawn, the same in every figure, and the colours of light and dark pages."""

from __future__ import annotations

import functools
import zlib
from collections import Counter
from dataclasses import dataclass, replace

from rotor_mbs.methods.catalogue import REFERENCE, is_corrected, ladders, method_names
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
INK, PAPER, GREY, GRID = "#000000", "#ffffff", "#666666", "#e4e4e4"
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
_OTHERS = {
    GREY: "#a3adb8",
    PAPER: "#1d2127",
    "#c8c8c8": "#4d5560",
    "#dddddd": "#3a424b",
    "#f2e3de": "#3a2e2a",
    GRID: "#333b44",
}
PALETTE = {**_METHODS, **_COORDINATES, **_OTHERS}
COLOURS, COORDINATES = tuple(_METHODS), tuple(_COORDINATES)
# The variables of the style sheet.
_NAMES = {colour: f"k{place}" for place, colour in enumerate(PALETTE)} | {INK: "ink", PAPER: "sheet", GRID: "grid"}

# Of the printed equations, then of the other models in the order of the catalogue; those of other packages are grey.
_MODEL_COLOURS = ((INK,), (BLUE, LIGHT_BLUE), (VERMILLION, ORANGE), (GREEN,), (PURPLE,))
_LINES = ("-", "--", "-.", ":")
_MARKERS = ("o", "s", "^", "D", "v", "P", "X", "h", "p", "<", ">")


@functools.cache
def _catalogue_looks() -> dict[str, Look]:
    """By the name of each method and of each curve of the bench: within a model lines and markers take turns."""
    models, counts = {"printed": 0}, Counter[str]()
    looks = {REFERENCE: Look(BLUE, "-.", "*")}
    for curve in dict.fromkeys([*method_names(), *ladders()]):
        model = curve.partition("/")[0] if is_corrected(curve) else "printed"
        place, turn = models.setdefault(model, len(models)), counts[model]
        colours = _MODEL_COLOURS[place] if place < len(_MODEL_COLOURS) else (GREY,)
        marker = _MARKERS[(turn + 3 * place) % len(_MARKERS)]
        looks[curve] = Look(colours[turn % len(colours)], _LINES[turn // len(colours) % len(_LINES)], marker)
        counts[model] += 1
    return looks


def look_of(curve: str) -> Look:
    """Return how a method, or a curve of the bench, is drawn; one that is not in the catalogue in grey."""
    look = _catalogue_looks().get(curve)
    if look is None:
        code = zlib.crc32(curve.encode("utf-8", "replace"))
        look = Look(GREY, _LINES[code % 4], _MARKERS[code // 4 % len(_MARKERS)])
    return replace(look, label=label_of(curve))


def name_of_colour(colour: str) -> str:
    """The variable of the style sheet, "k1", that stands for a colour of the palette; "" for another colour."""
    return _NAMES.get(colour, "")


def palette_css() -> str:
    """The palette as variables of a style sheet, light and, where the page is dark, dark."""
    light = ";".join(f"--{name}:{colour}" for colour, name in _NAMES.items())
    dark = ";".join(f"--{name}:{PALETTE[colour]}" for colour, name in _NAMES.items())
    return f":root{{{light}}}\n@media screen and (prefers-color-scheme:dark){{:root{{{dark}}}}}\n"


def with_capital(text: str) -> str:
    """`text` with a capital first letter; the others stay as they are."""
    return text[:1].upper() + text[1:]


def coordinate_look(index: int, label: str = "") -> Look:
    """Line of a coordinate: 0 the rotor, i the pitch (and the tip) of blade i."""
    if not index:
        return Look(COORDINATES[0], "-", "", label or "rotor")
    colour = COORDINATES[1 + (index - 1) % (len(COORDINATES) - 1)]
    return Look(colour, ("-", "--", "-.")[(index - 1) % 3], "", label or f"pitch {index}")
