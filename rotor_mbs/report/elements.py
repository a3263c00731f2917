"""Define what pages are made of: sentences, facts, plots, tables, sections.

These elements are plain data. Templates turn them into HTML.
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
    """A cell of a table with more than a text: a link, a note, a colour or a drawing.

    text : main text of the cell.
    tone : "good" or "bad" for the colour of a verdict; "" for no colour.
    href : address to which the text is linked; "" for no link.
    note : small text below the main text.
    note_language : language code of the note; "" for English.
    mark : CSS classes of the whole cell.
    title : text that appears under the pointer and that a screen reader reads.
    order : number by which a click on the column's heading sorts the row; None: the text is used.
    picture : HTML of a drawing above the text.
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

# Texts that stand in a column of numbers in place of a number.
_NO_NUMBER = ("never", "exact", "runs away", "not measured", "not reached")


@dataclass(frozen=True)
class PageTable:
    """A table. The first cell of each row is the heading of the row.

    A column without content, except the first, is left out.

    caption : text that a screen reader reads.
    head : headings of the columns.
    rows : rows of the table; a row has one cell for each heading.
    wide : indices of the columns that a narrow page does not show.
    sortable : whether a click on a heading sorts the rows.
    """

    caption: str
    head: Row
    rows: Sequence[Row]
    wide: Sequence[int] = ()
    sortable: bool = False
    kind: str = field(default="table", init=False)

    def columns(self) -> list[tuple[int, TableCell | str, str]]:
        """Return the index, the heading and the CSS classes of each column that is shown.

        A column is shown if it is the first one, or if some cell of it is neither empty nor a
        dash. The class "wide" hides a column on a narrow page. The class "n" aligns numbers on the
        right. A column has this class if more than half of its texts begin with a digit; words
        that replace a number do not count. The first column never has it.
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
    """The horizontal axis of a plot.

    Plots whose axes have the same name are zoomed together, and their values are read together.

    name, unit : name and unit of the quantity on the axis, such as "time" and "s".
    symbol : symbol of the quantity, such as "t", that the page shows before a value of it.
    first, last : values at the ends of the axis.
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

    key : key by which a legend switches the curve on and off. Curves of several plots in a section
        may have the same key.
    look : colour and line of the curve. Its label is the name of the curve.
    x : (n,) ascending.
    y : (n,); or (runs, n), a table of which the page shows one row.
    breaks : indices of the samples before which the line is interrupted. Each is the first sample
        after a jump.
    dots : "" for a line without marked points, "line" for a line with them, "only" for points that
        no line joins.
    beside : text in the plot at the end of the curve; "" for none.
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

    name, unit : name and unit of the quantity on the vertical axis.
    x : the horizontal axis.
    curves : the curves. Later ones are drawn over earlier ones.
    height : height of the drawing, px.
    note : addition to name and unit, in small letters.
    log : whether the vertical axis is logarithmic. Values that are not positive are then gaps.
    clip : range of the vertical axis. Curves are cut off beyond it until the reader asks for the
        full range. None: no curve is cut off.
    marks : lines across the plot.
    least : smallest range of values that fills the plot. A smaller range is rounding error and is
        not magnified.
    still : whether the page also has a still picture of the plot, for browsers without scripts.
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
        """Return the plot as a dict for JSON, which the page's script draws.

        The numbers of the curves are added to the store. The dict only says where they are.

        Parameters
        ----------
        store : store of the page's numbers. If it stores only every n-th sample of a curve, the
            indices of breaks are divided by n.
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
    """The legend of the curves in a section.

    items : (key, look) of each curve. An item with a key is a button that switches the curves with
        this key. An item with the key "" is text without a button.
    """

    items: Sequence[tuple[str, Look]]
    kind: str = field(default="legend", init=False)


@dataclass(frozen=True)
class Note:
    """A paragraph in small letters."""

    text: str | Markup
    kind: str = field(default="note", init=False)


@dataclass(frozen=True)
class Viewer:
    """The animation of the rotor.

    data : result of `pages.viewer.viewer`, which the script draws.
    title : title of the scene.
    """

    data: Mapping[str, Any]
    title: str
    kind: str = field(default="viewer", init=False)


@dataclass(frozen=True)
class SourceText:
    """The text of a file."""

    text: str
    kind: str = field(default="source", init=False)


@dataclass(frozen=True)
class Listing:
    """A list of terms and their texts: (term, text) each."""

    items: Sequence[tuple[str, str | Markup]]
    kind: str = field(default="listing", init=False)


@dataclass(frozen=True)
class Matrix:
    """A matrix of formulas with a text above it.

    rows : entries by row, each a pair (entry as printed, correct entry). The correct entry is None
        if the printed entry is correct.
    """

    text: str
    rows: Sequence[Sequence[tuple[Markup, Markup | None]]]
    kind: str = field(default="matrix", init=False)


@dataclass(frozen=True)
class HeatMap:
    """A map of runs over two parameters.

    The map has a cell for each pair of values of the parameters. All cells have the same size. The
    page's script writes a quantity of the run into its cell.

    label : text that a screen reader reads.
    quantities : names of the quantities from which the reader chooses.
    columns, rows : values of the two parameters as text, from left to right and from top to bottom.
    cells : for each of `rows` the cells of its row, each a pair (index of the run, CSS class); None
        if there is no run with these values.
    note : text below the map.
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
    """A menu from which the reader chooses the run whose curves are shown.

    runs : (index, text) of each run.
    """

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
    """Cards side by side.

    columns : number of cards in a row on a wide page.
    cards : for each card its elements, which are placed one below the other.
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
    """A part of a page. A section without elements is left out.

    id : name of the section in addresses.
    heading : heading of the section.
    elements : content of the section. A legend switches only curves of its own section.
    say : text below the heading.
    """

    id: str
    heading: str
    elements: Sequence[Grid | Fold | Element]
    say: str | Markup = ""


@dataclass(frozen=True)
class Fact:
    """A result at the top of a page.

    name : name of the result.
    value : the result as text, usually a number.
    note : explanation below the value.
    tone : "good" or "bad" for the colour of the value; "" for no colour.
    """

    name: str
    value: str
    note: str | Markup = ""
    tone: str = ""


@dataclass(frozen=True)
class PageContent:
    """The content of a page.

    title : heading of the page.
    about : small line below the heading.
    answer : sentences on the results, with numbers from the file.
    facts : the main results, which stand at the top of the page; at most four.
    sections : the parts of the page, in order.
    previous, following : file and name of the page before and of the page after this one; None if
        there is no such page.
    data : data for a script that only this page has, by the id of the HTML element that holds them.
    """

    title: str
    about: str | Markup
    answer: Sequence[Markup]
    facts: Sequence[Fact]
    sections: Sequence[Section]
    previous: tuple[str, str] | None = None
    following: tuple[str, str] | None = None
    data: Mapping[str, object] = field(default_factory=dict)
