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

# Colours by their name in the style sheet, each for light and for dark pages. The contrast of
# curves to the card on which they are drawn is at least 3, that of texts at least 4.5. A test
# computes these contrasts.
PALETTE = {
    "ink": ("#1b1f24", "#e6e9ed"),
    "card": ("#ffffff", "#1c2025"),
    "grey": ("#666666", "#a3adb8"),
    "grid": ("#e4e4e4", "#2a3037"),
    "ring": ("#c8ccd1", "#4d5560"),
    "heat": ("#0b5a8f", "#4fa8e0"),
    # Colours of models: those of Okabe and Ito, which people with colour blindness can distinguish.
    # Some are darkened, because their contrast to white is too small.
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
    # Colours of coordinates, first the rotor, then the blades: derived from Tol's muted colours.
    "rotor": ("#4a5058", "#c9ced4"),
    "blade-1": ("#882255", "#e583b2"),
    "blade-2": ("#2a8a7e", "#62cdbf"),
    "blade-3": ("#5a46b5", "#ab9ff5"),
    "blade-4": ("#8a7a1c", "#d6c75c"),
    "blade-5": ("#b5505f", "#f2a3ae"),
    # Colours for the values of a varied parameter, from small to large: viridis with a darkened
    # yellow end.
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
# Names of the light colours. The black of matplotlib's texts counts as "ink".
_NAMES = {light: name for name, (light, _) in PALETTE.items()} | {"#000000": "ink"}
# Colours of the models in the order of the catalogue. The methods of a model get its colours in
# turn. Further models are grey.
_MODEL_COLOURS = (("blue", "navy"), ("brown", "vermillion"), ("green",), ("purple",))
# Colour and marker of each method with a single erratum.
_ERRATA = (("error-1", "^"), ("error-2", "P"), ("error-3", "h"))
# Names in the style sheet for matplotlib's line styles.
_DASHES = {"-": "solid", "--": "dashed", "-.": "dashdot", ":": "dotted"}
LINES = tuple(_DASHES)
_MARKERS = ("o", "s", "^", "D", "v", "P", "X", "h", "p", "<", ">")


@dataclass(frozen=True)
class Look:
    """The look of a curve, in matplotlib's notation.

    colour : colour such as "#0072b2".
    line : line style: "-", "--", "-.", ":", or "" for no line.
    marker : marker such as "o"; "" for no marker.
    label : name of the curve in a legend; "" for no entry.
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
    """Return the look of each method in the catalogue, and of each curve of the bench, by name.

    A model has one colour or two. Its methods differ in colour, line style or marker. The line of a
    corrected model's first method is solid. The line of `printed/ode45` is dashed; other methods
    with the printed equations have dotted lines.
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
        # All colours of a model are used with one line style before the next style is used.
        line = list(_DASHES)[turn // len(colours) % len(_DASHES)]
        looks[curve] = Look(PALETTE[colours[turn % len(colours)]][0], line, marker)
        counts[model] += 1
    return looks


def look_of(curve: str) -> Look:
    """Return the look of a method, or of a curve of the bench.

    If the name is not in the catalogue, the colour is grey, and the line and the marker are derived
    from the name.
    """
    look = _catalogue_looks().get(curve)
    if look is None:
        # `hash` is not used, because its result differs from process to process.
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
    """Return the look of the curve for one value of a varied parameter.

    Parameters
    ----------
    place : index of the value in ascending order, from 0.
    count : number of values.
    label : label of the curve.
    """
    step = round(place * (STEPS - 1) / max(count - 1, 1)) if count > 1 else 0
    return Look(PALETTE[f"step-{step}"][0], ("-", "--", "-.", ":")[place // STEPS % 4], "", label)


def name_of_colour(colour: str) -> str:
    """Return the name of a colour of the light palette, such as "blade-1"; "" for other colours."""
    return _NAMES.get(colour, "")


def palette_css() -> str:
    """Return the palette as a style sheet.

    The style sheet has a variable for each colour, with values for light and for dark pages, and a
    class for each colour that draws in it.
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
    """Return `text` with a capital first letter; other letters are not changed."""
    return text[:1].upper() + text[1:]
