"""What pages are made of: tables, pictures, sections. A picture is matplotlib's SVG, in which variables of the style
sheet stand for the palette's colours."""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import dataclass
from html import escape
from typing import Any

import markupsafe
from markupsafe import Markup

from rotor_mbs.report.canvas import TIME_AXIS, Panels, encoded, swatch
from rotor_mbs.report.looks import name_of_colour
from rotor_mbs.report.numbers import NOTHING, SPACE, power


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


_LETTER = 5.3  # points, the mean width of a letter
# What an SVG file has and a part of a page does not need: metadata, comments, names of groups, what is the default,
# spaces between elements.
_SUPERFLUOUS = re.compile(
    r"<metadata>.*?</metadata>|<defs>\s*<style.*?</style>\s*</defs>|<!--.*?-->|(?<=>)\s+(?=<)"
    r'| id="[a-zA-Z0-9.]+_\d+"| transform="rotate\(-0 [^"]*"|font-size: 9.5px; |font-family: [^;"]*(; )?',
    re.DOTALL,
)
_EMPTY = re.compile(r"<g>(<g/>)*</g>|<g/>")
_NAME = re.compile(r'(id="|="#|\(#)(?=[a-zA-Z]+[0-9a-f]{10})')  # of a marker or an area that is referred to
_PLACES = re.compile(r' (?:d|x|y)="[^"]*"')
_COLOUR = re.compile(r"#[0-9a-f]{6}\b")


def picture(panels: Panels, name: str, caption: str, notes: Sequence[str] = ()) -> Picture:
    """The figure for a page, an `svg` element whose alternative text is the caption; `name` is unique on the page. Its
    legend has the labels of what is drawn."""
    panels.figure.patch.set_visible(False)
    for axes in panels.figure.axes:
        axes.patch.set_visible(False)
        axes.set_xlabel(_with_factor(axes.xaxis))
        axes.set_ylabel(_with_factor(axes.yaxis))
        if _LETTER * len(axes.get_ylabel()) > 72.0 * axes.bbox.height / panels.figure.dpi:
            axes.set_ylabel(axes.get_ylabel().replace(" (", "\n(", 1))
    width, height = (72.0 * size for size in panels.figure.get_size_inches())
    drawn = _inside(encoded(panels.figure, "svg", for_print=False), name)
    svg = (
        f'<svg viewBox="0 0 {width:g} {height:g}" role="img" aria-labelledby="{name}-t">'
        f'<title id="{name}-t">{escape(caption)}</title>{drawn}{_cursor(panels)}</svg>'
    )
    items = []
    for label, artist in panels.labelled().items():
        shown = _with_variables(swatch(artist))
        items.append(f'<li><svg viewBox="0 0 24 8" width="34" height="12" aria-hidden="true">{shown}</svg> ')
        items.append(f"{markupsafe.escape(label)}</li>")
    legend = f'<ul class="legend">{"".join(items)}</ul>' if items else ""
    return Picture(Markup(svg), caption, notes, Markup(legend))


def _inside(file: bytes, name: str) -> str:
    """What is inside the `svg` element of a file, with names of its own, and places to a tenth of a point."""
    _, _, text = file.decode().partition("<svg")
    _, _, text = text.partition(">")
    text = _SUPERFLUOUS.sub("", text.rpartition("</svg>")[0])
    text = _EMPTY.sub("", text).replace("\n", "")
    text = _PLACES.sub(lambda places: re.sub(r"\.(\d)\d+", r".\1", places[0]), text)
    return _NAME.sub(rf"\g<1>{name}", _with_variables(text))


def _with_variables(drawing: str) -> str:
    """The drawing with variables of the style sheet in place of the palette's colours."""

    def variable(colour: re.Match[str]) -> str:
        name = name_of_colour(colour[0])
        return f"var(--{name})" if name else colour[0]

    return _COLOUR.sub(variable, drawing)


def _cursor(panels: Panels) -> str:
    """A line over panels above a time axis, which the viewer moves: where 0 s is, points per second, the end."""
    last = panels.axes[-1]
    if last.get_xlabel() != TIME_AXIS:
        return ""
    width, height = (72.0 * size for size in panels.figure.get_size_inches())
    box, (start, end) = last.get_position(), last.get_xlim()
    scale = width * box.width / (end - start)
    zero = width * box.x0 - start * scale
    ends = f"M0 {height * (1.0 - panels.axes[0].get_position().y1):.1f}V{height * (1.0 - box.y0):.1f}"
    return f'<path class="now" data-time="{zero:.2f} {scale:.6g} {end:.6g}" d="{ends}"/>'


def _with_factor(axis: Any) -> str:
    """The axis' label, with the power of ten that its tick labels leave out: "rate (10⁻³ rad/s)"."""
    label, formatter = str(axis.get_label_text()), axis.get_major_formatter()
    formatter.format_ticks(axis.get_majorticklocs())
    factor = re.fullmatch(r"1e(-?\d+)", str(formatter.get_offset()).replace("−", "-"))
    if factor is None:
        return label
    axis.offsetText.set_visible(False)
    name, _, unit = label.partition(" (")
    unit = SPACE.join(filter(None, [power(int(factor[1])), unit.rstrip(")")]))
    return f"{name} ({unit})"
