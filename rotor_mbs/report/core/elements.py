"""What pages are made of: cells, tables, pictures, legends. Plain data for the templates; knows no run."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field

from markupsafe import Markup

from rotor_mbs.report.names import GREY, Look
from rotor_mbs.report.pages.viewer import Viewer

_DASHES = {"--": "6 3", "-.": "7 2 2 2", ":": "2 2"}
_MARKS = {
    "o": "M3 0a3 3 0 1 1-6 0a3 3 0 1 1 6 0z",
    "s": "M-3-3h6v6h-6z",
    "^": "M0-3.5l3.5 6.5h-7z",
    "v": "M0 3.5l3.5-6.5h-7z",
    "x": "M-3-3l6 6m0-6l-6 6",
    "D": "M0-4l4 4l-4 4l-4-4z",
    "P": "M-1-3h2v2h2v2h-2v2h-2v-2h-2v-2h2z",
    "*": "M0-4l1 3h3l-2 2l1 3l-3-2l-3 2l1-3l-2-2h3z",
    "<": "M-3.5 0l6.5-3.5v7z",
    ">": "M3.5 0l-6.5-3.5v7z",
    "p": "M0-4l3.8 2.8l-1.5 4.4h-4.6l-1.5-4.4z",
}


@dataclass(frozen=True)
class Cell:
    """Text of a cell; `tone` good, bad or "" for the colour of a verdict; href a page of this report."""

    text: str
    tone: str = ""
    href: str = ""
    note: str = ""
    language: str = ""


@dataclass(frozen=True)
class Table:
    """Columns with a heading; numeric ones stand to the right. Rows begin with their own heading."""

    caption: str
    head: Sequence[str]
    rows: Sequence[Sequence[Cell]]
    numeric: Sequence[int] = ()


@dataclass(frozen=True)
class Sample:
    """A line of a legend: a piece of the curve, or of its mark, and what it is."""

    label: str
    colour: str
    dashes: str = ""
    width: float = 2.0
    mark: str = ""
    has_line: bool = True


@dataclass(frozen=True)
class Picture:
    """A drawn figure as SVG inside the page, with what stands below it."""

    svg: Markup
    caption: str
    notes: Sequence[str] = ()


@dataclass(frozen=True)
class Section:
    """A part of a page: pictures side by side with a common legend, then tables. Left out where it has neither.

    viewer: what moves above the pictures.
    """

    id: str
    heading: str
    pictures: Sequence[Picture] = ()
    legend: Sequence[Sample] = ()
    tables: Sequence[Table] = ()
    notes: Sequence[str] = field(default_factory=tuple)
    viewer: Viewer | None = None

    @property
    def tables_beside(self) -> bool:
        """Whether the tables fill the free place beside the last picture."""
        return bool(self.tables) and len(self.pictures) % 2 == 1

    @property
    def is_single(self) -> bool:
        """Whether a picture stands alone: the legend fills the free place beside it."""
        return len(self.pictures) == 1 and not self.tables

    @property
    def has_content(self) -> bool:
        return bool(self.pictures or any(table.rows for table in self.tables))


def line_sample(label: str, colour: str, line: object, width: float = 2.0) -> Sample:
    """`line`: a style of lines, or dashes as (offset, lengths)."""
    if isinstance(line, tuple):
        return Sample(label, colour, " ".join(f"{2 * length:g}" for length in line[1]), width)
    return Sample(label, colour, _DASHES.get(str(line), ""), width)


def run_sample(label: str, look: Look) -> Sample:
    return Sample(label, look.colour, _DASHES.get(look.line, ""), 2.0, _MARKS[look.marker])


def mark_sample(label: str, look: Look) -> Sample:
    return Sample(label, GREY, "", 2.0, _MARKS[look.marker], has_line=False)


def without_empty_columns(table: Table) -> Table:
    """Columns in which no row says anything are left out."""
    kept = [i for i in range(len(table.head)) if i == 0 or any(row[i].text not in ("", "–") for row in table.rows)]
    return Table(
        table.caption,
        [table.head[i] for i in kept],
        [[row[i] for i in kept] for row in table.rows],
        [place for place, i in enumerate(kept) if i in table.numeric],
    )
