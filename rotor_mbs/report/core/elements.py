"""What pages are made of: tables, pictures, sections. Plain data for the templates."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from markupsafe import Markup

from rotor_mbs.report.core.numbers import NOTHING


@dataclass(frozen=True)
class TableCell:
    """A cell of a table that is more than a text."""

    text: str
    tone: str = ""  # "good" or "bad": the colour of a verdict
    href: str = ""
    note: str = ""  # small text below
    note_language: str = ""  # where it is not English
    shade: str = ""  # classes of the whole cell, in a map of scenes and methods
    title: str = ""  # what a pointer on it, or a screen reader, is told


Row = Sequence[TableCell | str]


@dataclass(frozen=True)
class PageTable:
    """A table. The first cell of a row is its heading; a column in which no row has anything is left out."""

    caption: str
    head: Row
    rows: Sequence[Row]

    def columns(self) -> list[tuple[int, TableCell | str, bool]]:
        """Place, heading, and whether most cells are numbers (on the right), of each column that is shown."""
        shown = []
        for place, heading in enumerate(self.head):
            texts = [cell if isinstance(cell, str) else cell.text for cell in (row[place] for row in self.rows)]
            known = [text for text in texts if text not in ("", NOTHING)]
            count = sum(text.lstrip("−-")[:1].isdigit() for text in known)
            if known or not place:
                shown.append((place, heading, place > 0 and 2 * count > len(known)))
        return shown


@dataclass(frozen=True)
class Picture:
    """A figure as SVG for the inside of a page, its caption, notes below the caption, and its legend as HTML."""

    svg: Markup
    caption: str
    notes: Sequence[str]
    legend: Markup


@dataclass(frozen=True)
class Section:
    """Pictures side by side, then tables and notes. A section without picture and row is left out."""

    pictures: Sequence[Picture] = ()
    tables: Sequence[PageTable] = ()
    notes: Sequence[str] = ()
