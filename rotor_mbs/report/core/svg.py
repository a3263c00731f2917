"""A figure as SVG inside a page: what its axes hold, written without a renderer; colours as classes of the style sheet.

A renderer of matplotlib makes and measures every tick mark as an object, which takes most of the time of a report. Here
ticks are numbers from the axes' own locators. Coordinates are points from the upper left corner of the figure.
"""

from __future__ import annotations

import re
from collections.abc import Iterator, Sequence
from html import escape
from typing import Any

import markupsafe
import numpy as np
from markupsafe import Markup

from rotor_mbs.report.core.canvas import TIME_AXIS, Panels, QuadMesh, hex_colour, style
from rotor_mbs.report.core.elements import Picture
from rotor_mbs.report.core.looks import INK, PAPER, class_of
from rotor_mbs.report.core.numbers import SPACE, power
from rotor_mbs.solution.trajectory import Array

Box = tuple[float, float, float, float]  # left, top, right, bottom
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
_DASHES = {"--": (3.7, 1.6), "-.": (6.4, 1.6, 1.0, 1.6), ":": (1.0, 1.65)}
_ANCHORS = {"left": "start", "right": "end", "center": "middle"}
_DROPS = {"center": 3.4, "center_baseline": 3.4, "top": 11.0, "bottom": -2.0}  # of a text below its place
_EDGE = 3.0  # points around the axes in which markers and wide lines may stand out
_FONT = 9.5
_LETTER = 5.3  # points, the mean width of a letter
_SHADES = 16  # of a map


def picture(panels: Panels, name: str, caption: str, notes: Sequence[str] = ()) -> Picture:
    """The figure for a page, an `svg` element whose alternative text is the caption; `name` is unique on the page. Its
    legend has the labels of what is drawn."""
    page = _Page(panels.figure)
    with style():
        body = "".join(part for axes in panels.figure.axes for part in page.axes(axes))
    text = (
        f'<svg viewBox="0 0 {_short(page.width)} {_short(page.height)}" role="img" aria-labelledby="{name}-t">'
        f'<title id="{name}-t">{escape(caption)}</title>{body}{page.cursor(panels.axes)}</svg>'
    )
    items = []
    for label, artist in panels.labelled().items():
        swatch = "".join(_swatch(artist))
        items.append(f'<li><svg viewBox="0 0 24 8" width="34" height="12" aria-hidden="true">{swatch}</svg> ')
        items.append(f"{markupsafe.escape(label)}</li>")
    legend = f'<ul class="legend">{"".join(items)}</ul>' if items else ""
    return Picture(Markup(text), caption, notes, Markup(legend))


class _Page:
    """The places on a figure."""

    def __init__(self, figure: Any) -> None:
        self.width, self.height = (72.0 * float(size) for size in figure.get_size_inches())
        self._points = 72.0 / figure.dpi

    def axes(self, axes: Any) -> Iterator[str]:
        """Grid, ticks and labels, then what is drawn, from the lowest to the highest."""
        axes.apply_aspect()
        axes.get_xlim(), axes.get_ylim()  # autoscale where nobody has set them
        left, top, right, bottom = box = self._box(axes)
        if axes.axison:
            yield from self._frame(axes, box)
        width, height = right - left + 2.0 * _EDGE, bottom - top + 2.0 * _EDGE
        seen = tuple(map(_short, (left - _EDGE, top - _EDGE, width, height)))
        yield '<svg x="{0}" y="{1}" width="{2}" height="{3}" viewBox="{0} {1} {2} {3}">'.format(*seen)
        artists = [artist for artist in (*axes.patches, *axes.collections, *axes.lines) if artist.get_visible()]
        for artist in sorted(artists, key=lambda artist: artist.get_zorder()):
            if isinstance(artist, QuadMesh):
                yield from self._map(artist)
            elif hasattr(artist, "get_xydata"):
                yield from self._line(artist)
            else:
                yield from self._areas(artist)
        yield "</svg>"
        for text in axes.texts:
            x, y = self._placed(text.get_transform().transform(np.atleast_2d(text.get_position())))[0]
            size, colour = float(text.get_fontsize()), hex_colour(text.get_color())
            yield _words(x, y + _DROPS.get(text.get_va(), 0.0), text.get_text(), _ANCHORS[text.get_ha()], size, colour)

    def cursor(self, panels: Sequence[Any]) -> str:
        """A line over panels above a time axis, which the viewer moves: where 0 s is, points per second, the end."""
        if panels[-1].get_xlabel() != TIME_AXIS:
            return ""
        left, _, right, bottom = self._box(panels[-1])
        first, last = panels[-1].get_xlim()
        scale = (right - left) / (last - first)
        ends = f"M0 {_short(self._box(panels[0])[1])}V{_short(bottom)}"
        return f'<path class="now" data-time="{left - first * scale:.2f} {scale:.6g} {last:.6g}" d="{ends}"/>'

    def _box(self, axes: Any) -> Box:
        left, bottom, right, top = axes.get_position().extents
        return left * self.width, (1.0 - top) * self.height, right * self.width, (1.0 - bottom) * self.height

    def _placed(self, pixels: Any) -> Array:
        """Display coordinates, in pixels from below, as points from above."""
        points: Array = np.asarray(pixels) * (self._points, -self._points) + (0.0, self.height)
        return points

    def _frame(self, axes: Any, box: Box) -> Iterator[str]:
        """Grid, spines, tick labels and axis labels; of a colour scale the labels alone, on its right."""
        left, top, right, bottom = box
        is_scale = axes.get_label() == "<colorbar>"
        has_x = not is_scale and bool(axes.xaxis.get_tick_params().get("labelbottom", True))
        middle, grid = 0.5 * (left + right), []
        for axis, is_x in ((axes.yaxis, False), *(() if is_scale else ((axes.xaxis, True),))):
            places, labels = _ticks(axis)
            data = np.zeros((len(places), 2))
            data[:, 0 if is_x else 1] = places
            transform = axes.get_xaxis_transform() if is_x else axes.get_yaxis_transform()
            for (x, y), label in zip(self._placed(transform.transform(data)), labels, strict=True):
                ends = (x, bottom, x, top) if is_x else (left, y, right, y)
                grid.append("M{} {}L{} {}".format(*map(_short, ends)))
                if label and is_x and has_x:
                    yield _words(x, bottom + 12.0, label, "middle")
                elif label and not is_x:
                    yield _words(
                        right + 4.0 if is_scale else left - 4.0, y + 3.4, label, "start" if is_scale else "end"
                    )
        if not is_scale and axes.xaxis.get_tick_params().get("gridOn", True):
            yield f'<path class="grid" d="{"".join(grid)}"/>'
        if not is_scale:
            yield f'<path class="axis" d="M{_short(left)} {_short(top)}V{_short(bottom)}H{_short(right)}"/>'
        if has_x and (label := _label(axes.xaxis)):
            yield _words(middle, bottom + 26.0, label, "middle")
        if label := _label(axes.yaxis):
            name, bracket, unit = label.partition(" (")
            # In two lines where the panel is not as high as the label is long.
            lines = [name, f"({unit}"] if bracket and _LETTER * len(label) > bottom - top else [label]
            for i, line in enumerate(lines):
                x = right + 30.0 if is_scale else left - 46.0 + 5.0 * (2 * i + 1 - len(lines))
                turned = f'transform="translate({_short(x)} {_short(0.5 * (top + bottom))})rotate(-90)"'
                yield f'<text {turned} text-anchor="middle">{escape(line)}</text>'
        if title := axes.get_title(loc="left"):
            yield _words(left, top - 6.0, title, "start")

    def _line(self, line: Any) -> Iterator[str]:
        first, step = line.get_markevery() or (0, 1)
        data = np.asarray(line.get_xydata(), float)[first::step]
        data = data[np.isfinite(data).all(axis=1)]
        places = self._placed(line.get_transform().transform(data)) if len(data) else data
        yield from _curve(line, self._path(line.get_path(), line.get_transform()), places)

    def _map(self, mesh: Any) -> Iterator[str]:
        """Cells as colour, in shades; neighbours in a row that have the same shade are one rectangle."""
        corners = np.asarray(mesh.get_coordinates(), float)
        rows, columns = corners.shape[0] - 1, corners.shape[1] - 1
        edges = self._placed(mesh.axes.transData.transform(corners.reshape(-1, 2))).reshape(corners.shape)
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

    def _areas(self, artist: Any) -> Iterator[str]:
        """A patch, or a collection of areas or of lines: those have no face."""
        is_patch = not hasattr(artist, "get_paths")
        paths = [artist.get_path()] if is_patch else artist.get_paths()
        texts = [self._path(path, artist.get_transform()) for path in paths]
        faces = np.atleast_2d(artist.get_facecolor())
        if faces.size:
            ink, alpha = _ink(hex_colour(faces[0]), " filled"), _opacity(float(faces[0][3]))
            yield f'<path{ink}{alpha} stroke="none" d="{"Z".join(texts)}Z"/>'
        else:
            width, ink = float(np.atleast_1d(artist.get_linewidth())[0]), _ink(hex_colour(artist.get_edgecolor()[0]))
            yield f'<path{ink}{_opacity(artist.get_alpha())} stroke-width="{width:.3g}" d="{"".join(texts)}"/>'

    def _path(self, path: Any, transform: Any) -> str:
        """Path data with relative steps of a tenth of a point, which are shorter than places."""
        parts, whole = [], transform.transform_path(path).cleaned(remove_nans=True, simplify=True)
        for points in whole.to_polygons(closed_only=False):
            tenths = np.round(10.0 * np.clip(self._placed(points), -1e4, 1e4))
            steps = np.diff(tenths, axis=0)
            numbers = [_short(0.1 * step) for step in steps[steps.any(axis=1)].ravel()]
            if numbers:
                x, y = 0.1 * tenths[0]
                parts.append(f"M{_short(x)} {_short(y)}l{' '.join(numbers).replace(' -', '-')}")
        return "".join(parts)


def _curve(line: Any, path: str, places: Array) -> Iterator[str]:
    """A line along a path, then its markers: one path, from the place of each in relative steps."""
    width, pattern = float(line.get_linewidth()), line.get_linestyle()
    if pattern in ("-", *_DASHES) and width > 0.0 and path:
        dashes = " ".join(_short(width * dash) for dash in _DASHES.get(pattern, ()))
        more = _opacity(line.get_alpha()) + (f' stroke-dasharray="{dashes}"' if dashes else "")
        yield f'<path{_ink(line.get_color())}{more} stroke-width="{width:.3g}" d="{path}"/>'
    marker = MARKS.get(str(line.get_marker()), "")
    if marker and len(places):
        scale = float(line.get_markersize()) / 6.0
        shape = re.sub(r"\d*\.?\d+", lambda digits: _short(float(digits[0]) * scale), marker)
        face = hex_colour(line.get_markerfacecolor()) if line.get_markerfacecolor() != "none" else ""
        ink = _ink(line.get_markeredgecolor(), {"": "", PAPER: " open"}.get(face, " filled"))
        text = "".join(f"M{_short(x)} {_short(y)}{shape}" for x, y in places)
        yield f'<path{ink} stroke-width="{float(line.get_markeredgewidth()):.2g}" d="{text}"/>'


def _swatch(artist: Any) -> Iterator[str]:
    """A piece of a curve with its marker, or of an area, for a legend."""
    if hasattr(artist, "get_xydata"):
        yield from _curve(artist, "M0 4H24", np.array([[12.0, 4.0]]))
    else:
        *_, alpha = face = np.atleast_2d(artist.get_facecolor())[0]
        yield f'<path{_ink(hex_colour(face))}{_opacity(float(alpha))} stroke-width="6" d="M0 4H24"/>'


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
    parts = re.fullmatch(r"(?:1e(-?\d+))?([-+].+)?", offset)
    if not offset or parts is None:
        return f"{label} {offset}".strip()
    exponent, shift = parts.groups()
    name, _, unit = label.partition(" (")
    if shift:
        name += f" {'−' if float(shift) > 0.0 else '+'} {abs(float(shift)):g}"
    unit = unit.rstrip(")")
    if exponent:
        unit = SPACE.join(filter(None, [power(int(exponent)), unit]))
    return f"{name} ({unit})" if unit else name


def _words(x: float, y: float, words: str, anchor: str, size: float = _FONT, colour: str = INK) -> str:
    attributes = "" if anchor == "start" else f' text-anchor="{anchor}"'
    attributes += "" if size == _FONT else f' font-size="{size:.3g}"'
    attributes += "" if colour == INK else f' class="{class_of(colour) or "k0"}"'
    return f'<text x="{_short(x)}" y="{_short(y)}"{attributes}>{escape(words)}</text>'


def _ink(colour: str, more: str = "") -> str:
    """The class of a colour of the palette; other colours are written as they are."""
    name = class_of(hex_colour(colour))
    return f' class="{name}{more}"' if name else f' class="{more.strip()}" style="color:{hex_colour(colour)}"'


def _opacity(alpha: float | None) -> str:
    return "" if alpha is None or alpha == 1.0 else f' opacity="{alpha:.2g}"'


def _short(value: float) -> str:
    return f"{value:.1f}".removesuffix(".0").replace("-0.", "-.").removeprefix("0") or "0"
