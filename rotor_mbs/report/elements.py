"""Define what pages are made of: sentences, facts, plots, tables, sections.

All are plain data; templates turn them into HTML.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from markupsafe import Markup
from numpy.typing import NDArray

from rotor_mbs.report.curves import CurveStore
from rotor_mbs.report.looks import Look
from rotor_mbs.report.numbers import NOTHING

Array = NDArray[np.float64]

# ---- Tables


@dataclass(frozen=True)
class TableCell:
    """A cell of a table that is more than a text.

    tone : "good" or "bad", the colour of a verdict.
    href : address of a link.
    note, note_language : small text below, and its language where it is not English.
    mark : classes of the whole cell.
    title : text that appears under the pointer and that a screen reader reads.
    order : the number by which the column is sorted; None: by the text.
    picture : a drawing above the text.
    """

    text: str
    tone: str = ""
    href: str = ""
    note: str = ""
    note_language: str = ""
    mark: str = ""
    title: str = ""
    order: float | None = None
    picture: str = ""


Row = Sequence[TableCell | str]

# What stands in a column of numbers where there is none.
_NO_NUMBER = ("never", "exact", "runs away", "not measured", "not reached")


@dataclass(frozen=True)
class PageTable:
    """A table. The first cell of a row is its heading; an empty column is left out.

    caption : for a screen reader.
    head : headings of the columns.
    rows : as many cells each as there are headings.
    wide : places of the columns that a narrow page does not show.
    sortable : whether a click on a heading sorts the rows.
    """

    caption: str
    head: Row
    rows: Sequence[Row]
    wide: Sequence[int] = ()
    sortable: bool = False
    kind: str = field(default="table", init=False)

    def columns(self) -> list[tuple[int, TableCell | str, str]]:
        """Return place, heading and classes of each column that is shown.

        The class "n" aligns numbers on the right; it is that of a column, but for the first, of
        which more than half of the texts begin with a digit, words in place of a number aside. The
        class "wide" hides a column on a narrow page.
        """
        shown = []
        for place, heading in enumerate(self.head):
            texts = []
            for row in self.rows:
                cell = row[place]
                if isinstance(cell, str):
                    texts.append(cell)
                else:
                    texts.append(cell.text or cell.note or str(cell.picture))
            known = [text for text in texts if text not in ("", NOTHING)]
            plain = [text.lstrip("−-≤≥×✓✗ ") for text in known]
            digits = [text[:1].isdigit() for text in plain if text not in _NO_NUMBER]
            classes = []
            if place > 0 and 2 * sum(digits) > len(digits):
                classes.append("n")
            if place in self.wide:
                classes.append("wide")
            if known or not place:
                shown.append((place, heading, " ".join(classes)))
        return shown


# ---- Plots


@dataclass(frozen=True)
class Horizontal:
    """The horizontal axis of plots. Plots whose axes have one name are zoomed and read together.

    name, unit : such as "time" and "s".
    symbol : what stands before a value that is read, "t".
    first, last : the range.
    log : whether the axis is logarithmic.
    """

    name: str
    unit: str
    symbol: str
    first: float
    last: float
    log: bool = False


@dataclass(frozen=True)
class Curve:
    """A curve of a plot.

    key : by which a legend switches it, the same in all plots of a section.
    look : colour and line; its label is the name of the curve.
    x : (n,) ascending.
    y : (n,), or (runs, n) of which one row is shown.
    breaks : samples before which the line is interrupted: the first one after a jump.
    dots : "" for a line alone; any other text marks the points; "only": no line joins them.
    beside : text at the curve's end in the plot; "" for none.
    """

    key: str
    look: Look
    x: Array
    y: Array
    breaks: Sequence[int] = ()
    dots: str = ""
    beside: str = ""


@dataclass(frozen=True)
class Mark:
    """A line across a plot, vertical at x or horizontal at y, with a text."""

    text: str = ""
    x: float | None = None
    y: float | None = None


@dataclass(frozen=True)
class Plot:
    """A plot that the page's script draws.

    name, unit : of the quantity on the vertical axis.
    x : the horizontal axis.
    height : of the drawing, px.
    note : more of the vertical axis, in small letters.
    log : whether the vertical axis is logarithmic; values that are not positive are gaps.
    clip : range beyond which curves are cut off, until the reader asks for it; None: there is none.
    marks : lines across the plot.
    least : a smaller range of the values is rounding error and not magnified.
    still : whether there is a picture of it for a page without scripts.
    """

    name: str
    unit: str
    x: Horizontal
    curves: Sequence[Curve]
    height: int = 160
    note: str = ""
    log: bool = False
    clip: tuple[float, float] | None = None
    marks: Sequence[Mark] = ()
    least: float = 0.0
    still: bool = False
    kind: str = field(default="plot", init=False)

    def described(self, store: CurveStore) -> dict[str, Any]:
        """Return what the script needs, ready for JSON; the numbers go to the store.

        Parameters
        ----------
        store : takes the columns of all curves; its step also divides the places of breaks.
        """
        x = self.x
        plot: dict[str, Any] = {
            "name": self.name,
            "height": self.height,
            "x": {"name": x.name, "unit": x.unit, "symbol": x.symbol, "range": [x.first, x.last]},
            "curves": [],
        }
        if x.log:
            plot["x"]["log"] = True
        for curve in self.curves:
            described: dict[str, Any] = {
                "key": curve.key,
                "name": curve.look.label,
                "style": curve.look.css,
            }
            described["x"] = store.add(curve.x)
            described["y"] = store.add(curve.y)
            if len(curve.breaks):
                step = store.step(curve.y)
                described["breaks"] = [-(-int(place) // step) for place in curve.breaks]
            if curve.dots:
                described["dots"] = curve.dots
            if curve.beside:
                described["beside"] = curve.beside
            plot["curves"].append(described)
        marks = []
        for mark in self.marks:
            place = {"x": mark.x} if mark.y is None else {"y": mark.y}
            marks.append({"text": mark.text, **place})
        optional = {"log": self.log, "clip": self.clip, "marks": marks, "least": self.least}
        return plot | {name: value for name, value in optional.items() if value}


# ---- Sections


@dataclass(frozen=True)
class Legend:
    """The curves of a section: (key, look) each.

    Buttons switch the curves; a legend whose keys are empty is a mere list.
    """

    items: Sequence[tuple[str, Look]]
    kind: str = field(default="legend", init=False)


@dataclass(frozen=True)
class Note:
    """A small text."""

    text: str | Markup
    kind: str = field(default="note", init=False)


@dataclass(frozen=True)
class Viewer:
    """The moving rotor: what `pages.viewer` makes for the script, and the title of the scene."""

    data: Mapping[str, Any]
    title: str
    kind: str = field(default="viewer", init=False)


@dataclass(frozen=True)
class SourceText:
    """A file's text."""

    text: str
    kind: str = field(default="source", init=False)


@dataclass(frozen=True)
class Listing:
    """A list of (what, text)."""

    items: Sequence[tuple[str, str | Markup]]
    kind: str = field(default="listing", init=False)


@dataclass(frozen=True)
class Matrix:
    """A matrix of formulas, with a text above.

    rows : (entry as printed, the correct one) each; None where the printed one is correct.
    """

    text: str
    rows: Sequence[Sequence[tuple[Markup, Markup | None]]]
    kind: str = field(default="matrix", init=False)


@dataclass(frozen=True)
class HeatMap:
    """A map of runs over two parameters.

    It has a cell of equal size for each pair of values, in which the script writes a quantity of
    the run.

    quantities : names of what may be shown.
    columns, rows : values of the parameters as text, from left to right, from top to bottom.
    cells : a row of (number of the run, class) for each of `rows`; None where there is no run.
    """

    label: str
    quantities: Sequence[str]
    columns: Sequence[str]
    rows: Sequence[str]
    cells: Sequence[Sequence[tuple[int, str] | None]]
    note: str
    kind: str = field(default="map", init=False)


@dataclass(frozen=True)
class RunChoice:
    """A list of runs (number, text), one of which is shown."""

    runs: Sequence[tuple[int, str]]
    kind: str = field(default="choice", init=False)


Element = (
    PageTable
    | Plot
    | Legend
    | Note
    | Viewer
    | SourceText
    | Listing
    | Matrix
    | HeatMap
    | RunChoice
    | Markup
)


@dataclass(frozen=True)
class Grid:
    """Cards side by side, `columns` in a row on a wide page.

    The elements of a card are placed one below the other.
    """

    columns: int
    cards: Sequence[Sequence[Element]]
    kind: str = field(default="grid", init=False)


@dataclass(frozen=True)
class Fold:
    """A part that a click unfolds: a heading with a hint, and the elements below."""

    heading: str
    hint: str
    elements: Sequence[Grid | Element]
    is_open: bool = False
    kind: str = field(default="fold", init=False)


@dataclass(frozen=True)
class Section:
    """A part of a page. One without elements is left out.

    id : name in addresses.
    heading, say : the heading, and a line below it.
    elements : a legend among them switches the curves of this section alone.
    """

    id: str
    heading: str
    elements: Sequence[Grid | Fold | Element]
    say: str | Markup = ""


@dataclass(frozen=True)
class Fact:
    """One of the numbers at the top of a page.

    name, value : what it is, and the number as text.
    note : what else is to be known of it.
    tone : "good" or "bad", the colour of the value.
    """

    name: str
    value: str
    note: str | Markup = ""
    tone: str = ""


@dataclass(frozen=True)
class PageContent:
    """The content of a page.

    title, about : the heading and the small line below it.
    answer : sentences of what was found, from the file's numbers.
    facts : at most four of these numbers.
    sections : the parts of the page, in order.
    previous, following : file and name of the pages before and after this one; None: there is none.
    data : for a script of this page alone, by the id of its element.
    """

    title: str
    about: str | Markup
    answer: Sequence[Markup]
    facts: Sequence[Fact]
    sections: Sequence[Section]
    previous: tuple[str, str] | None = None  # file and name of the page before
    following: tuple[str, str] | None = None
    data: Mapping[str, object] = field(default_factory=dict)
