"""Define how methods and coordinates are drawn in every figure, and the palette of the pages."""

from __future__ import annotations

import functools
import zlib
from collections import Counter
from dataclasses import dataclass, replace

from rotor_mbs.methods.catalogue import (
    PRINTED,
    REFERENCE,
    errata_methods,
    is_corrected,
    ladders,
    method_names,
)
from rotor_mbs.methods.catalogue import label_of as label_of

# Colours by their name in the style sheet, on a light and on a dark page. Curves have a contrast of
# at least 3 to the card that they are drawn on, texts one of at least 4.5 (a test computes them).
PALETTE = {
    "ink": ("#1b1f24", "#e6e9ed"),
    "card": ("#ffffff", "#1c2025"),
    "grey": ("#666666", "#a3adb8"),
    "grid": ("#e4e4e4", "#2a3037"),
    "ring": ("#c8ccd1", "#4d5560"),
    "heat": ("#0b5a8f", "#4fa8e0"),
    # Models: after Okabe and Ito, distinguishable with colour blindness, darkened where white asks
    # for it.
    "reference": ("#5793c1", "#477ca6"),
    "blue": ("#0072b2", "#5cb3ec"),
    "navy": ("#1f3f8f", "#9db4ff"),
    "vermillion": ("#d55e00", "#ff8a3d"),
    "brown": ("#8f6a1f", "#e0ad4e"),
    "green": ("#00845f", "#2fc498"),
    "purple": ("#a34f96", "#e79cc6"),
    "error-1": ("#b0568c", "#f2a3c8"),
    "error-2": ("#8a6a00", "#e3c04a"),
    "error-3": ("#7a5cc2", "#b6a2f7"),
    # Coordinates: after Tol's muted colours; the rotor, then the blades.
    "rotor": ("#4a5058", "#c9ced4"),
    "blade-1": ("#882255", "#e583b2"),
    "blade-2": ("#2a8a7e", "#62cdbf"),
    "blade-3": ("#5a46b5", "#ab9ff5"),
    "blade-4": ("#8a7a1c", "#d6c75c"),
    "blade-5": ("#b5505f", "#f2a3ae"),
    # A parameter that is varied, from small to large: viridis, its yellow end darkened.
    "step-0": ("#440154", "#c08be0"),
    "step-1": ("#46327e", "#9a86e8"),
    "step-2": ("#365c8d", "#7ba6de"),
    "step-3": ("#277f8e", "#3fa9b8"),
    "step-4": ("#178f78", "#1fa187"),
    "step-5": ("#2f9147", "#4ac16d"),
    "step-6": ("#648a00", "#8fbf28"),
    "step-7": ("#957400", "#c9a400"),
    "step-8": ("#c9591a", "#e8763a"),
}
STEPS = 9
INK, PAPER, GREY, RING, BLUE, VERMILLION = (
    PALETTE[name][0] for name in ("ink", "card", "grey", "ring", "blue", "vermillion")
)
COORDINATES = tuple(
    PALETTE[name][0] for name in PALETTE if name == "rotor" or name.startswith("blade-")
)
# Names of the light colours; matplotlib's black is that of texts.
_NAMES = {light: name for name, (light, _) in PALETTE.items()} | {"#000000": "ink"}
# Colours of each model, in the order of the catalogue, for its methods in turn. Further models are
# grey.
_MODEL_COLOURS = (("blue", "navy"), ("brown", "vermillion"), ("green",), ("purple",))
_ERRATA = (("error-1", "^"), ("error-2", "P"), ("error-3", "h"))  # colour and marker
# matplotlib's line styles, and what the style sheet calls them.
_DASHES = {"-": "solid", "--": "dashed", "-.": "dashdot", ":": "dotted"}
LINES = tuple(_DASHES)
_MARKERS = ("o", "s", "^", "D", "v", "P", "X", "h", "p", "<", ">")


@dataclass(frozen=True)
class Look:
    """A colour, a line and a marker for a curve, in matplotlib's notation.

    colour : such as "#0072b2".
    line : "-", "--", "-.", ":", or "" for none.
    marker : "" for none.
    label : name in a legend; "" for none.
    """

    colour: str
    line: str
    marker: str = ""
    label: str = ""

    @property
    def css(self) -> str:
        """Return the classes of the style sheet that draw the curve on a page: "blue dashed"."""
        name = _NAMES.get(self.colour, "grey")
        if name == "reference":
            return "reference"  # a wide band, on which other curves can be seen
        if name == "ring":
            return "ring front"
        return f"{name} {_DASHES.get(self.line, 'solid')}"


@functools.cache
def _catalogue_looks() -> dict[str, Look]:
    """Return the looks of all methods, and of all curves of the bench, by name.

    A model has its colours, and a line and a marker for each method. Of the corrected models the
    first method's line is solid, that of the printed equations is dashed.
    """
    looks = {REFERENCE: Look(PALETTE["reference"][0], "-", "*"), PRINTED: Look(INK, "--", "o")}
    for (colour, marker), method in zip(_ERRATA, errata_methods().values(), strict=False):
        looks[method] = Look(PALETTE[colour][0], "-", marker)
    models: dict[str, int] = {}
    counts = Counter[str]()
    for curve in dict.fromkeys([*method_names(), *ladders()]):
        if curve in looks:
            continue
        model = curve.partition("/")[0] if is_corrected(curve) else "printed"
        if model == "printed":
            looks[curve] = Look(INK, ":", _MARKERS[counts[model] % len(_MARKERS)])
            counts[model] += 1
            continue
        place, turn = models.setdefault(model, len(models)), counts[model]
        colours = _MODEL_COLOURS[place] if place < len(_MODEL_COLOURS) else ("grey",)
        marker = _MARKERS[(turn + 3 * place) % len(_MARKERS)]
        # A model's colours in turn with one line style, then with the next.
        line = list(_DASHES)[turn // len(colours) % len(_DASHES)]
        looks[curve] = Look(PALETTE[colours[turn % len(colours)]][0], line, marker)
        counts[model] += 1
    return looks


def look_of(curve: str) -> Look:
    """Return how a method, or a curve of the bench, is drawn.

    One that is not in the catalogue is grey; its line and marker follow from its name.
    """
    look = _catalogue_looks().get(curve)
    if look is None:
        # Not by hash(), which differs from process to process.
        code = zlib.crc32(curve.encode("utf-8", "replace"))
        look = Look(GREY, list(_DASHES)[code % 4], _MARKERS[code // 4 % len(_MARKERS)])
    return replace(look, label=label_of(curve))


def coordinate_look(index: int, label: str = "") -> Look:
    """Return the look of a coordinate: 0 the rotor, i the pitch (and the tip) of blade i."""
    if not index:
        return Look(COORDINATES[0], "-", "", label or "rotor")
    colour = COORDINATES[1 + (index - 1) % (len(COORDINATES) - 1)]
    return Look(colour, ("-", "--", "-.")[(index - 1) % 3], "", label or f"pitch {index}")


def step_look(place: int, count: int, label: str) -> Look:
    """Return the look of one of the curves for the values of a varied parameter.

    place : of the value, from 0, in ascending order; count : of the values.
    """
    step = round(place * (STEPS - 1) / max(count - 1, 1)) if count > 1 else 0
    return Look(PALETTE[f"step-{step}"][0], ("-", "--", "-.", ":")[place // STEPS % 4], "", label)


def name_of_colour(colour: str) -> str:
    """Return the name of a colour of the light palette, such as "blade-1"; "" for another."""
    return _NAMES.get(colour, "")


def palette_css() -> str:
    """Return the palette as a style sheet.

    It has a variable for each colour, for light and dark pages, and a class that draws in it.
    """
    light, dark = (
        ";".join(f"--{name}:{pair[shade]}" for name, pair in PALETTE.items()) for shade in (0, 1)
    )
    classes = "".join(f".{name}{{--c:var(--{name})}}" for name in PALETTE)
    return (
        f":root{{{light}}}\n@media screen and "
        f"(prefers-color-scheme:dark){{:root{{{dark}}}}}\n{classes}\n"
    )


def with_capital(text: str) -> str:
    """Return `text` with a capital first letter; the others stay as they are."""
    return text[:1].upper() + text[1:]
