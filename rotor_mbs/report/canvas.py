"""The only module that imports matplotlib: panels, the styles of pages and manuscripts, reproducible output."""

from __future__ import annotations

import io
import logging
import math
import os
import sys
from collections.abc import Iterator, Mapping
from contextlib import AbstractContextManager, contextmanager, suppress
from dataclasses import dataclass
from os import PathLike
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from rotor_mbs.errors import InputError
from rotor_mbs.report.looks import PAPER, Look
from rotor_mbs.report.numbers import power
from rotor_mbs.runs.output_files import replace_file
from rotor_mbs.scenario.toml_file import file_path


@contextmanager
def _unaffected_by_environment() -> Iterator[None]:
    """Import matplotlib in the block whatever the environment says of backends and folders.

    No backend is needed here, and an unknown one in MPLBACKEND would be an error. A home that cannot be written is told
    once in every process, though a temporary folder serves as well.
    """
    backend = os.environ.pop("MPLBACKEND", None)
    logger = logging.getLogger("matplotlib")
    level = logger.level
    logger.setLevel(logging.ERROR)
    try:
        yield
    finally:
        logger.setLevel(level)
        if backend is not None:
            os.environ["MPLBACKEND"] = backend


_is_imported_here = "matplotlib" not in sys.modules
with _unaffected_by_environment():
    import matplotlib
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.colors import to_hex
    from matplotlib.figure import Figure
    from matplotlib.lines import Line2D
    from matplotlib.markers import MarkerStyle
    from matplotlib.ticker import FixedLocator, FuncFormatter, NullLocator
if _is_imported_here and os.environ.get("MPLBACKEND"):  # for what else is drawn in this process
    with suppress(ValueError):
        matplotlib.rcParams["backend"] = os.environ["MPLBACKEND"]

WIDTH = 5.2  # in; on a telephone's 360 px a text of 9.5 points is then 9 px high
TIME_AXIS, SPEED_AXIS = "time (s)", "rotor speed (rad/s)"
WIDE = 11.0  # in; a picture as wide as a page
PRINT_WIDTH = 174.0 / 25.4  # in; two columns of a journal
MARK = b"rotor_mbs pictures"  # in the metadata of every picture that is a file
KINDS = ("pdf", "svg", "png")
_DASHES = {  # matplotlib's patterns, in widths of the line
    "--": matplotlib.rcParamsDefault["lines.dashed_pattern"],
    "-.": matplotlib.rcParamsDefault["lines.dashdot_pattern"],
    ":": matplotlib.rcParamsDefault["lines.dotted_pattern"],
}
_PAGE_STYLE, _PRINT_STYLE = (  # without matplotlib's defaults
    matplotlib.rc_params_from_file(Path(__file__).with_name(f"{name}.mplstyle"), use_default_template=False)
    for name in ("page", "print")
)


@dataclass(frozen=True)
class Panels:
    """A matplotlib figure and its axes, from top to bottom. Shown by a notebook."""

    figure: Figure
    axes: list[Any]

    def _repr_svg_(self) -> str:
        return encoded(self.figure, "svg", for_print=False).decode()

    def labelled(self) -> dict[str, Any]:
        """Return the first artist of each label, in drawing order."""
        artists: dict[str, Any] = {}
        for axes in self.figure.axes:
            for artist, label in zip(*axes.get_legend_handles_labels(), strict=True):
                artists.setdefault(label, artist)
        return artists

    def with_legend(self) -> Panels:
        """Add a legend above the axes. Returns the same object."""
        artists = self.labelled()
        with style():
            self.axes[0].legend(
                artists.values(), artists, loc="lower left", bbox_to_anchor=(0.0, 1.0), ncols=2, frameon=False,
                fontsize=8.0,
            )  # fmt: skip
        self.figure.subplots_adjust(top=0.95 - 0.07 * math.ceil(len(artists) / 2))
        return self

    def save(self, path: str | PathLike[str]) -> None:
        """Save as PDF, SVG or PNG, by the ending of `path`.

        Raises InputError for another one, StoreError, and TypeError if `path` is neither text nor a path.
        """
        target = file_path(path)
        kind = target.suffix.removeprefix(".")
        if kind not in KINDS:
            allowed = f"a name that ends in .{', .'.join(KINDS)}"
            raise InputError(f"{target}: unknown format; allowed: {allowed}")
        replace_file(target, encoded(self.figure, kind), MARK)


def panels(heights: tuple[float, ...], x_label: str) -> Panels:
    """Panels one below the other; heights in inches, that of the top one first. x_label: of the last one."""
    figure = Figure(figsize=(WIDTH, sum(heights) + 0.6), facecolor="white")
    with style():
        axes = figure.subplots(len(heights), squeeze=False, sharex=True, height_ratios=heights)[:, 0].tolist()
        axes[-1].set_xlabel(x_label)
    # Fixed margins: the layout does not depend on the fonts.
    height = float(figure.get_figheight())
    figure.subplots_adjust(left=0.16, right=0.965, bottom=0.45 / height, top=1.0 - 0.15 / height, hspace=0.09)
    return Panels(figure, axes)


def grid(rows: int, columns: int, height: float, *, for_print: bool) -> Panels:
    """Axes row by row, `height` inches each: in the style for manuscripts at a journal's page width, or for a page."""
    width, margin = (PRINT_WIDTH, 0.75) if for_print else (WIDE, 0.45)
    with style(for_print=for_print):
        whole = rows * height + margin + 0.5
        figure = Figure(figsize=(width, whole), facecolor="white")
        made = figure.subplots(rows, columns, squeeze=False)
        figure.subplots_adjust(
            left=0.8 / width, right=1.0 - 0.12 / width, bottom=margin / whole, top=1.0 - 0.5 / whole,
            hspace=0.26 / height, wspace=0.34,
        )  # fmt: skip
    return Panels(figure, list(made.flat))


def squares(count: int) -> Panels:
    """Axes with equal scales and without a frame side by side, 420 pixels each, below room for two lines of text."""
    with style():
        figure = Figure(figsize=(4.2 * count, 4.6), dpi=100, facecolor="white")
        axes = [figure.add_axes((i / count, 0.0, 1.0 / count, 4.2 / 4.6), aspect="equal") for i in range(count)]
    for square in axes:
        square.set_axis_off()
    return Panels(figure, [*axes])


def pixels(figure: Figure) -> NDArray[np.uint8]:
    """(height, width, 3) The figure as it is now, in red, green and blue."""
    canvas: Any = FigureCanvasAgg(figure)
    canvas.draw()
    return np.asarray(canvas.buffer_rgba())[..., :3]


def style(*, for_print: bool = False) -> AbstractContextManager[None]:
    """A context in which figures are drawn in the style of the pages, or in that of manuscripts."""
    return matplotlib.rc_context(_PRINT_STYLE if for_print else _PAGE_STYLE)


def encoded(figure: Figure, kind: str, *, for_print: bool = True) -> bytes:
    """The figure as a file of one of KINDS; the same bytes every time."""
    metadata: dict[str, Any] = {"pdf": {"CreationDate": None}, "svg": {"Date": None}, "png": {"Software": None}}[kind]
    if for_print:
        metadata["Software" if kind == "png" else "Creator"] = MARK.decode()
    with style(for_print=for_print), np.errstate(over="ignore", invalid="ignore"):  # numbers of a runaway
        stream = io.BytesIO()
        figure.savefig(stream, format=kind, metadata=metadata)
    return stream.getvalue()


def swatch(artist: Any) -> str:
    """A piece of a curve with its marker, or of an area, for a legend: what is inside an `svg` of 24 by 8 points."""
    if not isinstance(artist, Line2D):
        rgba: list[float] = np.ravel(artist.get_facecolor()).tolist()
        area, opacity = to_hex((rgba[0], rgba[1], rgba[2])), rgba[3]
        return f'<path d="M0 1H24V7H0z" style="fill: {area}; fill-opacity: {opacity:g}"/>'
    colour, line, marker = str(artist.get_color()), str(artist.get_linestyle()), str(artist.get_marker())
    drawn = ""
    if line not in ("", "None"):
        width, opacity = artist.get_linewidth(), artist.get_alpha() or 1.0
        style_of_line = f"stroke: {colour}; stroke-width: {width:g}; stroke-opacity: {opacity:g}"
        if line in _DASHES:
            style_of_line += f"; stroke-dasharray: {' '.join(f'{width * dash:.2f}' for dash in _DASHES[line])}"
        drawn += f'<path d="M0 4H24" style="{style_of_line}"/>'
    if marker not in ("", "None"):
        form, size = MarkerStyle(marker), artist.get_markersize()
        outline = ""
        polygons: list[Any] = form.get_path().transformed(form.get_transform()).to_polygons(closed_only=False)
        for polygon in polygons:
            outline += "M" + "L".join(f"{12.0 + size * x:.1f} {4.0 - size * y:.1f}" for x, y in polygon)
        drawn += f'<path d="{outline}" style="stroke: {colour}; fill: {artist.get_markerfacecolor()}"/>'
    return drawn


def log_axis(axes: Any, lowest: float, highest: float, which: str = "y") -> None:
    """A log axis over whole decades, labelled 10⁻¹²; at most eight labels."""
    low, high = math.floor(math.log10(lowest)), math.ceil(math.log10(highest))
    high = max(high, low + 1)
    # The limits first: a range found by the axes themselves may overflow.
    axes.set(**{f"{which}lim": (10.0**low, 10.0**high), f"{which}scale": "log"})
    exponents = range(low, high + 1, max(1, math.ceil((high - low) / 7)))
    ticks(getattr(axes, f"{which}axis"), {10.0**e: power(e) for e in exponents})


def ticks(axis: Any, labels: Mapping[float, str]) -> None:
    """Labels at these places and no others; without the tick objects that `set_ticks` makes at once."""
    axis.set_major_locator(FixedLocator([*labels]))
    axis.set_major_formatter(FuncFormatter(lambda value, _: labels.get(value, "")))
    axis.set_minor_locator(NullLocator())


def curve(axes: Any, x: Any, y: Any, look: Look, width: float = 1.2, **more: Any) -> None:
    """A line with markers that are white inside, as far as the look has them; its label stands in the legend."""
    axes.plot(
        x, y, color=look.colour, linestyle=look.line, linewidth=width, marker=look.marker, label=look.label or "_",
        **{"markersize": 4.2, "markerfacecolor": PAPER} | more,
    )  # fmt: skip
