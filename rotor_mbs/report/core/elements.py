"""What pages are made of: tables, pictures, legends, sections. Plain data for the templates."""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import dataclass
from typing import NamedTuple

from markupsafe import Markup

from rotor_mbs.report.core.looks import GREY, Look
from rotor_mbs.report.core.numbers import NOTHING

# A number as pages show it, also a range of two, with a unit of two words at most.
_NUMBER = re.compile(r"[−-]?\d[\d.]*(e[+-]\d+)?(×?10)?[⁻⁰¹²³⁴-⁹]*( (to|of) −?\d[\d.]*)?(\s[^\s\d]\S*){0,2}")

DASHES = {"--": "6 3", "-.": "7 2 2 2", ":": "2 2"}
# Paths of markers around a point, in relative steps: several can stand in one path.
MARKS = {
    "o": "m3 0c0 4-6 4-6 0c0-4 6-4 6 0z",
    "s": "m-3-3h6v6h-6z",
    "^": "m0-3.5l3.5 6.5h-7z",
    "v": "m0 3.5l3.5-6.5h-7z",
    "x": "m-3-3l6 6m0-6l-6 6",
    "D": "m0-4l4 4l-4 4l-4-4z",
    "P": "m-1-3h2v2h2v2h-2v2h-2v-2h-2v-2h2z",
    "X": "m-3-1.8l1.2-1.2 1.8 1.8 1.8-1.8 1.2 1.2-1.8 1.8 1.8 1.8-1.2 1.2-1.8-1.8-1.8 1.8-1.2-1.2 1.8-1.8z",
    "h": "m0-3.2l2.8 1.6v3.2l-2.8 1.6-2.8-1.6v-3.2z",
    "*": "m0-4l1 3h3l-2 2l1 3l-3-2l-3 2l1-3l-2-2h3z",
    "<": "m-3.5 0l6.5-3.5v7z",
    ">": "m3.5 0l-6.5-3.5v7z",
    "p": "m0-4l3.8 2.8l-1.5 4.4h-4.6l-1.5-4.4z",
}


@dataclass(frozen=True)
class TableCell:
    """A cell of a table that is more than a text."""

    text: str
    tone: str = ""  # "good" or "bad": the colour of a verdict
    href: str = ""
    note: str = ""  # small text below
    note_language: str = ""  # where it is not English


Row = Sequence[TableCell | str]


class ShownColumn(NamedTuple):
    """A column that is shown: its place in the rows, its heading, whether it has numbers, aligned to the right."""

    place: int
    heading: str
    is_numeric: bool


@dataclass(frozen=True)
class PageTable:
    """A table. The first cell of a row is its heading; a column in which no row has anything is left out."""

    caption: str
    head: Sequence[str]
    rows: Sequence[Row]

    def columns(self) -> list[ShownColumn]:
        shown = []
        for place, heading in enumerate(self.head):
            texts = [cell if isinstance(cell, str) else cell.text for cell in (row[place] for row in self.rows)]
            known = [text for text in texts if text not in ("", NOTHING)]
            count = sum(_NUMBER.fullmatch(text) is not None for text in known)
            if known or not place:
                shown.append(ShownColumn(place, heading, place > 0 and 2 * count > len(known)))
        return shown


@dataclass(frozen=True)
class LegendEntry:
    """A label with a piece of the curve, with its marker, or with the marker alone (line "")."""

    label: str
    look: Look
    width: float = 2.0


@dataclass(frozen=True)
class Picture:
    """A figure as SVG for the inside of a page, its caption, notes below the caption, and its own legend."""

    svg: Markup
    caption: str
    notes: Sequence[str] = ()
    legend: Sequence[LegendEntry] = ()


@dataclass(frozen=True)
class Section:
    """Pictures side by side with one legend, then tables and notes. A section without picture and row is left out."""

    pictures: Sequence[Picture] = ()
    legend: Sequence[LegendEntry] = ()
    tables: Sequence[PageTable] = ()
    notes: Sequence[str] = ()


def line_entry(label: str, colour: str = GREY, line: str = "-", width: float = 2.0) -> LegendEntry:
    """An entry for a line without a marker."""
    return LegendEntry(label, Look(colour, line, ""), width)
