"""Draw still pictures as SVG, with the classes of the style sheet.

There are two kinds: plots for browsers without scripts, as the page's script draws them, and paths
of the blade tips.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from html import escape

import numpy as np
from markupsafe import Markup

from rotor_mbs.report.curves import extremes
from rotor_mbs.report.elements import Curve, Plot
from rotor_mbs.report.looks import name_of_colour
from rotor_mbs.report.numbers import minus, power, typeset
from rotor_mbs.report.tip_paths import Line, picture_of
from rotor_mbs.solution.quantities import Array

_WIDTH = 340  # px, width of a picture, which fits a telephone
_TOP, _RIGHT, _BOTTOM = 6, 12, 24  # px, margins around the curves
_LETTER = 7.3  # px, width of a digit
_FAR = 1e4  # px, largest coordinate of a point; points beyond it are moved there
_MAX_POINTS = 200  # approximate largest number of points of a curve: more than one for two pixels
_LARGEST = 1e300  # largest magnitude of a drawn value; with larger ones a range might overflow


def still(plot: Plot) -> Markup:
    """Return a still picture of a plot, an `svg` element.

    Parameters
    ----------
    plot : the plot. If the values of a curve are a table of several runs, its first row is drawn.
    """
    first, last = plot.x.first, plot.x.last
    low, high = _range(plot)
    bottom, right = plot.height - _BOTTOM, _WIDTH - _RIGHT
    labels = _ticks(low, high, 5 if plot.log else max(2, plot.height // 38), is_log=plot.log)
    left = max(34.0, 13.0 + _LETTER * max((len(label) for _, label in labels), default=0))
    to_x = _scale(first, last, left, right, is_log=plot.x.log)
    to_y = _scale(low, high, bottom, _TOP, is_log=plot.log)
    parts = []
    for value, label in labels:
        y = float(to_y(value))
        parts.append(f'<path class="grid" d="M{left:.1f} {y:.1f}H{right}"/>')
        parts.append(f'<text x="{left - 6:.1f}" y="{y + 4:.1f}" text-anchor="end">{label}</text>')
    for value, label in _ticks(first, last, max(2, int((_WIDTH - left) / 50)), is_log=plot.x.log):
        x = float(to_x(value))
        middle = min(x, _WIDTH - _LETTER * len(label) / 2)
        parts.append(f'<path class="grid" d="M{x:.1f} {_TOP}V{bottom}"/>')
        parts.append(
            f'<text x="{middle:.1f}" y="{plot.height - 7}" text-anchor="middle">{label}</text>'
        )
    # An inner svg element of the frame's size cuts off the parts of curves outside the frame.
    width, height = right - left, bottom - _TOP
    parts.append(
        f'<svg x="{left:.1f}" y="{_TOP}" width="{width:.1f}" height="{height}" '
        f'viewBox="{left:.1f} {_TOP} {width:.1f} {height}">'
    )
    for mark in plot.marks:
        if mark.y is not None:
            line = f"M{left:.1f} {float(to_y(mark.y)):.1f}H{right}"
        elif mark.x is not None and first <= mark.x <= last:
            line = f"M{float(to_x(mark.x)):.1f} {_TOP}V{bottom}"
        else:
            continue
        parts.append(f'<path class="mark" d="{line}"/>')
    for curve in plot.curves:
        parts += _drawn(curve, to_x, to_y, is_log=plot.log)
    parts.append(f'</svg><path class="axis" d="M{left:.1f} {_TOP}V{bottom}H{right}"/>')
    return Markup(
        f'<svg viewBox="0 0 {_WIDTH} {plot.height}" role="img" aria-label="{escape(plot.name)}">'
        f"{''.join(parts)}</svg>"
    )


def _values(curve: Curve, *, is_log: bool) -> Array:
    """Return the values of a curve, (n,), with NaN for those that cannot be drawn."""
    values = np.asarray(curve.y if curve.y.ndim == 1 else curve.y[0], dtype=float)
    can_be_drawn = np.isfinite(values) & ((values > 0.0) | (not is_log))
    return np.where(can_be_drawn, np.clip(values, -_LARGEST, _LARGEST), np.nan)


def _range(plot: Plot) -> tuple[float, float]:
    """Return the range of the vertical axis of a plot."""
    low, high = math.inf, -math.inf
    for curve in plot.curves:
        values = _values(curve, is_log=plot.log)
        low = min(low, float(np.fmin.reduce(values, initial=math.inf)))
        high = max(high, float(np.fmax.reduce(values, initial=-math.inf)))
    if plot.clip is not None:
        low, high = max(low, plot.clip[0]), min(high, plot.clip[1])
    if low > high:
        return (1e-12, 1.0) if plot.log else (0.0, 1.0)
    marks = [mark.y for mark in plot.marks if mark.y is not None]
    low, high = min(low, *marks, high), max(high, *marks, low)
    if plot.log:
        decade = math.floor(math.log10(low) + 1e-9)
        return 10.0**decade, 10.0 ** max(math.ceil(math.log10(high) - 1e-9), decade + 1)
    # A constant is not magnified, nor is a range that is rounding error.
    size = max(abs(low), abs(high))
    least = max(plot.least, 1e-6 * size)
    if high - low > least:
        room = 0.06 * (high - low)
    elif size > least:
        room = 0.1 * size
    else:
        room = 1.0
    return low - room, high + room


def _scale(
    first: float, last: float, start: float, end: float, *, is_log: bool
) -> Callable[[Array | float], Array]:
    """Return a function that converts values on an axis to pixels.

    Parameters
    ----------
    first, last : values at the ends of the axis.
    start, end : positions of the ends, px.
    is_log : whether the axis is logarithmic.
    """
    of_value: Callable[..., Array] = np.log10 if is_log else np.asarray
    origin = of_value(first)
    factor = (end - start) / ((of_value(last) - origin) or 1.0)

    def to_pixel(value: Array | float) -> Array:
        return np.clip(start + factor * (of_value(value) - origin), -_FAR, _FAR)

    return to_pixel


def _ticks(first: float, last: float, most: int, *, is_log: bool) -> list[tuple[float, str]]:
    """Return the ticks of an axis, at round numbers: value and text of each.

    A logarithmic axis with fewer than two powers of ten has the ticks of a linear axis.

    Parameters
    ----------
    first, last : values at the ends of the axis.
    most : approximate largest number of ticks.
    is_log : whether the axis is logarithmic.
    """
    if is_log:
        low, high = math.log10(first), math.log10(last)
        apart = max(1, math.ceil((high - low) / most))
        exponents = range(math.ceil(low - 1e-9), math.floor(high + 1e-9) + 1, apart)
        if len(exponents) > 1:
            is_plain = all(-3 < exponent < 4 for exponent in exponents)
            return [(10.0**e, f"{10.0**e:g}" if is_plain else power(e)) for e in exponents]
    if not last > first:
        return []
    rough = (last - first) / most
    unit = 10.0 ** math.floor(math.log10(rough))
    factor = next(factor for factor in (1, 2, 5, 10) if factor * unit >= rough * (1 - 1e-9))
    step = factor * unit
    multiples = range(math.ceil(first / step - 1e-9), math.floor(last / step + 1e-9) + 1)
    places = [float(f"{multiple * step:.9g}") for multiple in multiples]
    shown = [place for place in places if place > 0.0 or not is_log]
    texts = [f"{place:.9g}" for place in shown]
    if not any("e" in text for text in texts):
        # All texts have as many decimals as the longest one, such as 1.270 beside 1.268. Only the
        # text of zero has none.
        decimals = max((len(text.partition(".")[2]) for text in texts), default=0)
        texts = [f"{place:.{decimals}f}" if place else "0" for place in shown]
    return [(place, minus(typeset(text))) for place, text in zip(shown, texts, strict=True)]


def _drawn(
    curve: Curve,
    to_x: Callable[[Array], Array],
    to_y: Callable[[Array], Array],
    *,
    is_log: bool,
) -> list[str]:
    """Return the SVG elements of a curve: its line, and its points if they are marked.

    The line is interrupted at NaN and before the samples in `curve.breaks`.

    Parameters
    ----------
    curve : the curve.
    to_x, to_y : functions that convert values to pixels.
    is_log : whether the vertical axis is logarithmic.
    """
    values = _values(curve, is_log=is_log)
    index = extremes(values, _MAX_POINTS)
    x, y = to_x(curve.x[index]), to_y(values[index])
    jumps = set(np.searchsorted(index, curve.breaks).tolist())
    line, points, pen = [], [], "M"
    for place, (across, up) in enumerate(zip(x.tolist(), y.tolist(), strict=True)):
        if place in jumps:
            pen = "M"
        if math.isnan(up) or math.isnan(across):
            pen = "M"
            continue
        line.append(f"{pen}{across:.1f} {up:.1f}")
        pen = " "  # more points of the same line
        if curve.dots:
            points.append(
                f'<circle class="{curve.look.css}" cx="{across:.1f}" cy="{up:.1f}" r="3"/>'
            )
    only = " only" if curve.dots == "only" else ""
    return [f'<path class="curve {curve.look.css}{only}" d="{"".join(line)}"/>', *points]


# ---- Paths of the tips

_REACH = 165.0  # px, length in the picture of the radius that contains all paths
# px, distance along a path from one drawn point to the next. The points in between are left out. A
# chord of this length is at most 0.01 px from the arc of the largest circle.
_APART = 3.0


def path_picture(tip: Array, caption: str) -> Markup:
    """Return a picture of the paths of the tips, a `figure` element with a caption.

    Parameters
    ----------
    tip : (n, blades, 3) positions of the tips, m, base frame.
    caption : text above the picture.
    """
    reach, lines, texts = picture_of(tip)
    middle, pixels = np.array([0.95, 1.02]) * _REACH, np.array([1.0, -1.0]) * _REACH / reach
    parts = [_line_of_path(line, middle + pixels * line.points) for line in lines]
    for place, text in texts:
        x, y = middle + pixels * place
        anchor = "start" if text == texts[-1][1] else "middle"
        parts.append(f'<text x="{x:.1f}" y="{y + 5:.1f}" text-anchor="{anchor}">{text}</text>')
    width, height = (2.0 * middle).tolist()
    return Markup(
        f'<figure class="paths"><figcaption>{escape(caption)}</figcaption>'
        f'<svg viewBox="0 0 {width:g} {height:g}" role="img" '
        f'aria-label="{escape(caption)}: paths of the tips">{"".join(parts)}</svg></figure>'
    )


def _line_of_path(line: Line, points: Array) -> str:
    """Return the SVG elements of a line and of the mark at its end, as text.

    Parameters
    ----------
    line : the line, with its colour, width, dashes and mark.
    points : (n, 2) points of the line, px.
    """
    length = np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(points, axis=0), axis=1))])
    _, kept = np.unique(length // _APART, return_index=True)
    drawn = points[[*kept, len(points) - 1]].tolist()
    path = " ".join(f"{x:.1f} {y:.1f}" for x, y in drawn)
    colour, dashes = name_of_colour(line.colour), " dashed" if line.dashed else ""
    text = f'<path class="curve {colour}{dashes}" style="stroke-width:{line.width:g}" d="M{path}"/>'
    if line.end:
        x, y = drawn[-1]
        text += f'<circle class="{colour} {line.end}" cx="{x:.1f}" cy="{y:.1f}" r="3"/>'
    return text
