"""Labels and looks of methods, and looks of coordinates, the same in every figure and table."""

from __future__ import annotations

from rotor_mbs.methods.catalogue import label_of, look_of
from rotor_mbs.methods.ladders import Look

__all__ = ["COLOURS", "GREY", "Look", "coordinate_look", "label_of", "look_of", "with_capital"]

# Okabe & Ito's colours, distinguishable with colour blindness; without the yellow, which does not show on white.
COLOURS = ("#000000", "#0072b2", "#d55e00", "#009e73", "#cc79a7", "#e69f00", "#56b4e9")
GREY = "#666666"


def with_capital(text: str) -> str:
    """`text` with a capital first letter; the others stay as they are."""
    return text[:1].upper() + text[1:]


def coordinate_look(index: int) -> Look:
    """Line of a coordinate: 0 the rotor, i the pitch (and the tip) of blade i."""
    return Look(COLOURS[index % len(COLOURS)], "-" if index == 0 else ("-", "--", "-.")[(index - 1) % 3], "")
