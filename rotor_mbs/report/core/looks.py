"""Labels and looks of methods, and looks of coordinates, the same in every figure and table."""

from __future__ import annotations

from rotor_mbs.report.names import COLOURS, GREY, LOOKS, NAMES, Look

__all__ = ["COLOURS", "GREY", "Look", "coordinate_look", "label_of", "look_of", "with_capital"]


def label_of(method: str) -> str:
    """The method's label, such as "closed form, Taylor"; its name where the method is not in the catalogue."""
    return NAMES.get(method, method)


def with_capital(text: str) -> str:
    """`text` with a capital first letter; the others stay as they are."""
    return text[:1].upper() + text[1:]


def look_of(curve: str) -> Look:
    """Look of a method, or of a curve of a bench (a method with fixed settings); grey where it is not known."""
    return LOOKS.get(curve, Look(GREY, ":", "D"))


def coordinate_look(index: int) -> Look:
    """Line of a coordinate: 0 the rotor, i the pitch (and the tip) of blade i."""
    return Look(COLOURS[index % len(COLOURS)], "-" if index == 0 else ("-", "--", "-.")[(index - 1) % 3], "")
