"""A figure as SVG inside a page: what its axes hold, written without a renderer; colours as classes of the style sheet.

A renderer of matplotlib makes and measures every tick mark as an object of its own, which takes most of the time of a
report. Here ticks are numbers from the axes' own locators, and the rest are the data of lines, areas and texts. Nested
`svg` elements clip. Colours of `looks.PALETTE` become classes, so that the page's style sheet can change
them for a dark page.
"""

from __future__ import annotations

import re
from collections.abc import Iterable, Iterator, Sequence
from html import escape
from typing import Any

import numpy as np
from markupsafe import Markup
from numpy.typing import NDArray

from rotor_mbs.report.core.canvas import Panels, hex_colour, is_map, style
from rotor_mbs.report.core.elements import MARKS, LegendEntry, Picture
from rotor_mbs.report.core.looks import INK, PAPER, class_of
from rotor_mbs.report.core.numbers import SPACE, power

Array = NDArray[np.float64]
_DASHES = {"--": (3.7, 1.6), "-.": (6.4, 1.6, 1.0, 1.6), ":": (1.0, 1.65)}
_ANCHORS = {"left": "start", "right": "end", "center": "middle"}
_EDGE = 3.0  # points around the axes in which markers and wide lines may stand out
_FONT = 9.5
_LETTER = 5.3  # points, the mean width of a letter
_SHADES = 16  # of a map


def picture(
    panels: Panels, name: str, caption: str, description: str, notes: Iterable[str] = (),
    legend: Sequence[LegendEntry] = (),
) -> Picture:  # fmt: skip
    """The figure for a page. `name` is unique on the page; `description` says what the figure shows."""
    text = drawing(panels, name, caption, description)
    return Picture(Markup(text), caption, [note for note in notes if note], legend)


def drawing(panels: Panels, name: str, title: str, description: str) -> str:
    """The figure as an `svg` element, with title and description as its alternative text."""
    page = _Page(panels.figure)
    size = f"0 0 {_short(page.width)} {_short(page.height)}"
    with style():
        body = "".join(part for axes in panels.figure.axes for part in page.axes(axes))
    return (
        f'<svg viewBox="{size}" role="img" aria-labelledby="{name}-t {name}-d">'
        f'<title id="{name}-t">{escape(title)}</title><desc id="{name}-d">{escape(description)}</desc>{body}</svg>'
    )


class _Page:
    """Coordinates in points from the upper left corner of a figure."""

    def __init__(self, figure: Any) -> None:
        self.width, self.height = (72.0 * float(size) for size in figure.get_size_inches())
        self._points = 72.0 / figure.dpi

    def axes(self, axes: Any) -> Iterator[str]:
        """Grid, ticks and labels, then what is drawn, from the lowest to the highest."""
        axes.apply_aspect()
        axes.get_xlim(), axes.get_ylim()  # autoscale where nobody has set them
        left, bottom, right, top = axes.get_position().extents
        box = (left * self.width, (1.0 - top) * self.height, right * self.width, (1.0 - bottom) * self.height)
        if axes.get_label() == "<colorbar>":
            yield from self._scale(axes, box)
        elif axes.axison:
            yield from self._frame(axes, box)
        x, y = box[0] - _EDGE, box[1] - _EDGE
        width, height = box[2] - box[0] + 2.0 * _EDGE, box[3] - box[1] + 2.0 * _EDGE
        yield f'<svg x="{_short(x)}" y="{_short(y)}" width="{_short(width)}" height="{_short(height)}">'
        drawn = [*axes.patches, *axes.collections, *axes.lines]
        for artist in sorted((one for one in drawn if one.get_visible()), key=lambda one: one.get_zorder()):
            if is_map(artist):
                yield from self._map(artist, (x, y))
            elif hasattr(artist, "get_xydata"):
                yield from self._line(artist, (x, y))
            elif hasattr(artist, "get_paths"):
                yield from self._collection(artist, (x, y))
            else:
                yield self._area(artist.get_path(), artist.get_transform(), artist.get_facecolor(), (x, y))
        yield "</svg>"
        for text in axes.texts:
            place = self._placed(text.get_transform().transform(np.atleast_2d(text.get_position())))[0]
            yield _text(place, text.get_text(), text)

    def _placed(self, pixels: Array) -> Array:
        """Display coordinates, in pixels from below, as points from above."""
        found: Array = np.asarray(pixels) * self._points
        found[:, 1] = self.height - found[:, 1]
        return found

    def _frame(self, axes: Any, box: tuple[float, float, float, float]) -> Iterator[str]:
        """Grid, spines, tick labels and axis labels."""
        left, top, right, bottom = box
        lines = []
        x_shown = bool(axes.xaxis.get_tick_params().get("labelbottom", True))
        for axis, is_x in ((axes.xaxis, True), (axes.yaxis, False)):
            places, labels = _ticks(axis)
            data = np.stack([places, np.zeros(len(places))] if is_x else [np.zeros(len(places)), places], axis=1)
            transform = axes.get_xaxis_transform() if is_x else axes.get_yaxis_transform()
            points = self._placed(transform.transform(data)) if len(places) else np.empty((0, 2))
            if axis.get_tick_params().get("gridOn", True):
                for x, y in points:
                    ends = (x, bottom, x, top) if is_x else (left, y, right, y)
                    lines.append("M{} {}L{} {}".format(*map(_short, ends)))
            for (x, y), label in zip(points, labels, strict=True):
                if label and (x_shown or not is_x):
                    yield _words(
                        (x, bottom + 12.0) if is_x else (left - 4.0, y + 3.4), label, "middle" if is_x else "end"
                    )
        if lines:
            yield f'<path class="grid" d="{"".join(lines)}"/>'
        yield f'<path class="axis" d="M{_short(left)} {_short(top)}V{_short(bottom)}H{_short(right)}"/>'
        if x_shown and (label := _label(axes.xaxis)):
            yield _words((0.5 * (left + right), bottom + 26.0), label, "middle")
        if label := _label(axes.yaxis):
            name, bracket, unit = label.partition(" (")
            # In two lines where the panel is not as high as the label is long.
            lines = [name, f"({unit}"] if bracket and _LETTER * len(label) > bottom - top else [label]
            for i, line in enumerate(lines):
                x, y = left - 46.0 + 5.0 * (2 * i + 1 - len(lines)), 0.5 * (top + bottom)
                turned = f'transform="translate({_short(x)} {_short(y)})rotate(-90)" text-anchor="middle"'
                yield f"<text {turned}>{escape(line)}</text>"
        for place, x in (("left", left), ("center", 0.5 * (left + right))):
            if axes.get_title(loc=place):
                yield _words((x, top - 6.0), axes.get_title(loc=place), _ANCHORS[place])

    def _scale(self, axes: Any, box: tuple[float, float, float, float]) -> Iterator[str]:
        """Ticks and label of a colour scale, on its right."""
        _, top, right, bottom = box
        places, labels = _ticks(axes.yaxis)
        points = self._placed(axes.get_yaxis_transform().transform(np.stack([np.zeros(len(places)), places], axis=1)))
        for (_, y), label in zip(points, labels, strict=True):
            yield _words((right + 4.0, y + 3.4), label, "start")
        turned = f'transform="translate({_short(right + 30.0)} {_short(0.5 * (top + bottom))})rotate(-90)"'
        yield f'<text {turned} text-anchor="middle">{escape(axes.get_ylabel())}</text>'

    def _line(self, line: Any, corner: tuple[float, float]) -> Iterator[str]:
        """A curve, then its markers."""
        colour, width = line.get_color(), float(line.get_linewidth())
        pattern = line.get_linestyle()
        if pattern in ("-", *_DASHES) and width > 0.0:
            path = line.get_transform().transform_path(line.get_path()).cleaned(remove_nans=True, simplify=True)
            text = self._path(path, corner)
            if text:
                attributes = _ink(colour) + _opacity(line.get_alpha())
                if pattern in _DASHES:
                    attributes += f' stroke-dasharray="{" ".join(_short(width * d) for d in _DASHES[pattern])}"'
                yield f'<path{attributes} stroke-width="{width:.3g}" d="{text}"/>'
        marker = MARKS.get(str(line.get_marker()))
        if marker:
            yield from self._markers(line, marker, corner)

    def _markers(self, line: Any, marker: str, corner: tuple[float, float]) -> Iterator[str]:
        """All markers of a line as one path: each begins at its place and goes on in relative steps."""
        data = np.asarray(line.get_xydata(), float)
        data = data[_marked(line.get_markevery(), len(data))]
        data = data[np.isfinite(data).all(axis=1)]
        if not len(data):
            return
        points = self._placed(line.get_transform().transform(data)) - corner
        scale = float(line.get_markersize()) / 6.0
        shape = re.sub(r"\d*\.?\d+", lambda found: _short(float(found[0]) * scale), marker)
        text = "".join(f"M{_short(x)} {_short(y)}{shape}" for x, y in points)
        face = hex_colour(line.get_markerfacecolor()) if line.get_markerfacecolor() != "none" else ""
        fill = " filled" if face and face != PAPER else " open" if face else ""
        colour = line.get_markeredgecolor()
        yield f'<path{_ink(colour, fill)} stroke-width="{float(line.get_markeredgewidth()):.2g}" d="{text}"/>'

    def _map(self, mesh: Any, corner: tuple[float, float]) -> Iterator[str]:
        """Cells as colour, in shades; neighbours in a row that have the same shade are one rectangle."""
        corners = np.asarray(mesh.get_coordinates(), float)
        rows, columns = corners.shape[0] - 1, corners.shape[1] - 1
        edges = self._placed(mesh.axes.transData.transform(corners.reshape(-1, 2))).reshape(corners.shape) - corner
        levels: Array = np.ma.filled(np.ma.asarray(mesh.get_array(), float), np.nan).reshape(rows, columns)
        low, high = mesh.get_clim()
        shades = np.floor((levels - low) / (high - low) * _SHADES)
        shades = np.where(np.isfinite(shades), np.clip(shades, 0, _SHADES - 1), -1).astype(int)
        parts: dict[int, list[str]] = {}
        for row in range(rows):
            ends = np.flatnonzero(np.diff(shades[row], append=-2)) + 1
            for first, end in zip([0, *ends[:-1]], ends, strict=True):
                (x, y), (far, deep) = edges[row, first], edges[row + 1, end]
                box = f"M{_short(x)} {_short(y)}H{_short(far)}V{_short(deep)}H{_short(x)}z"
                parts.setdefault(int(shades[row, first]), []).append(box)
        for shade, boxes in sorted(parts.items()):
            if shade >= 0:
                colour = hex_colour(mesh.cmap((shade + 0.5) / _SHADES))
                yield f'<path class="filled" style="color:{colour}" stroke-width=".3" d="{"".join(boxes)}"/>'

    def _collection(self, collection: Any, corner: tuple[float, float]) -> Iterator[str]:
        """Areas, or bundles of lines: those have no face."""
        faces, edges = collection.get_facecolor(), collection.get_edgecolor()
        transform = collection.get_transform()
        if not len(faces):
            paths = [self._path(one.transformed(transform), corner) for one in collection.get_paths()]
            width = float(np.atleast_1d(collection.get_linewidth())[0])
            alpha = _opacity(collection.get_alpha())
            yield f'<path{_ink(hex_colour(edges[0]))}{alpha} stroke-width="{width:.3g}" d="{"".join(paths)}"/>'
            return
        for k, one in enumerate(collection.get_paths()):
            yield self._area(one, transform, faces[k % len(faces)], corner)

    def _area(self, path: Any, transform: Any, face: Any, corner: tuple[float, float]) -> str:
        text = self._path(transform.transform_path(path), corner)
        return f'<path{_ink(hex_colour(face), " filled")}{_opacity(float(face[3]))} stroke="none" d="{text}Z"/>'

    def _path(self, path: Any, corner: tuple[float, float]) -> str:
        """Path data with relative steps of a tenth of a point, which are shorter than places."""
        codes = path.codes if path.codes is not None else np.r_[1, np.full(len(path.vertices) - 1, 2)]
        kept = (codes == 1) | (codes == 2)
        vertices = self._placed(path.vertices[kept]) - corner
        starts = np.flatnonzero(codes[kept] == 1)
        tenths = np.round(10.0 * np.clip(vertices, -1e4, 1e4)).astype(int)
        parts = []
        for begin, end in zip(starts, [*starts[1:], len(tenths)], strict=True):
            steps = np.diff(tenths[begin:end], axis=0)
            steps = steps[steps.any(axis=1)]
            first = f"M{_tenth(tenths[begin, 0])} {_tenth(tenths[begin, 1])}"
            if len(steps):
                parts.append(
                    first + "l" + "".join(f"{_after(_tenth(u))}{_after(_tenth(v))}" for u, v in steps).lstrip()
                )
        return "".join(parts)


def _ticks(axis: Any) -> tuple[Array, Sequence[str]]:
    """Places and labels of the major ticks within the axis."""
    places, scale = np.asarray(axis.get_majorticklocs(), float), axis.get_transform()
    low, high = sorted(scale.transform(axis.get_view_interval()))
    at, margin = scale.transform(places), 1e-6 * (high - low)
    places = places[(at >= low - margin) & (at <= high + margin)]
    return places, axis.get_major_formatter().format_ticks(places) if len(places) else []


def _label(axis: Any) -> str:
    """The axis' label, with what its tick labels leave out: "rate − 0.3 (10⁻³ rad/s)" for 0.3 and times 1e-3."""
    label, offset = str(axis.get_label_text()), str(axis.get_major_formatter().get_offset()).replace("−", "-")
    found = re.fullmatch(r"(?:1e(-?\d+))?([-+].+)?", offset)
    if found is None or "(" not in label:
        return f"{label} {offset}".strip()
    name, unit = label.split("(", 1)
    shift = f"{'−' if float(found[2]) > 0.0 else '+'} {abs(float(found[2])):g} " if found[2] else ""
    return f"{name}{shift}({power(int(found[1])) + SPACE if found[1] else ''}{unit}"


def _text(place: Array, words: str, text: Any) -> str:
    drop = {"center": 3.4, "top": 11.0, "center_baseline": 3.4}.get(
        text.get_va(), -2.0 if text.get_va() == "bottom" else 0.0
    )
    size = float(text.get_fontsize())
    return _words(
        (float(place[0]), float(place[1]) + drop), words, _ANCHORS[text.get_ha()], size, hex_colour(text.get_color())
    )


def _words(place: Sequence[float], words: str, anchor: str, size: float = _FONT, colour: str = INK) -> str:
    attributes = "" if anchor == "start" else f' text-anchor="{anchor}"'
    attributes += "" if size == _FONT else f' font-size="{size:.3g}"'
    attributes += "" if colour == INK else f' class="{class_of(colour) or "k0"}"'
    return f'<text x="{_short(place[0])}" y="{_short(place[1])}"{attributes}>{escape(words)}</text>'


def _marked(every: Any, count: int) -> slice:
    """The samples that have a marker, of matplotlib's `markevery`."""
    if isinstance(every, slice):
        return every
    start, step = every if isinstance(every, tuple) else (0, every or 1)
    return slice(int(start), count, int(step))


def _ink(colour: str, more: str = "") -> str:
    """The class of a colour of the palette; other colours are written as they are."""
    name = class_of(hex_colour(colour))
    return f' class="{name}{more}"' if name else f' class="{more.strip()}" style="color:{hex_colour(colour)}"'


def _opacity(alpha: float | None) -> str:
    return "" if alpha is None or alpha == 1.0 else f' opacity="{alpha:.2g}"'


def _short(value: float) -> str:
    return f"{value:.1f}".removesuffix(".0").replace("-0.", "-.").removeprefix("0") or "0"


def _tenth(value: int) -> str:
    return _short(0.1 * float(value))


def _after(number: str) -> str:
    """With the space that a number needs after another one: none before a minus sign."""
    return number if number.startswith("-") else f" {number}"
