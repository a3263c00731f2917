"""Draw with matplotlib: panels, styles, and files that are the same every time.

No other module imports matplotlib.
"""

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
    """Make the import of matplotlib in the block independent of the environment.

    The block removes MPLBACKEND, because an unknown backend in it would be an error, and no backend
    is needed here. It also suppresses a warning: if the home folder cannot be written, matplotlib
    uses a temporary folder, but warns about it in every process.
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
    from matplotlib.figure import Figure
    from matplotlib.ticker import FixedLocator, FuncFormatter, NullLocator
# Other code of this process that draws with matplotlib still gets the backend of MPLBACKEND.
if _is_imported_here and os.environ.get("MPLBACKEND"):
    with suppress(ValueError):
        matplotlib.rcParams["backend"] = os.environ["MPLBACKEND"]

WIDTH = 5.2  # in; a text of 9.5 points is then 9 px high on a telephone with 360 px
TIME_AXIS, SPEED_AXIS, RPM_AXIS = "time (s)", "rotor speed (rad/s)", "rotor speed (rpm)"
PRINT_WIDTH = 174.0 / 25.4  # in; width of a journal's page with two columns
_LEGEND_COLUMNS = 2
MARK = b"rotor_mbs pictures"  # text in the metadata of each picture, which identifies it
KINDS = ("pdf", "svg", "png")
_PAGE_STYLE, _PRINT_STYLE = (  # the files' own settings, without matplotlib's defaults
    matplotlib.rc_params_from_file(
        Path(__file__).with_name(f"{name}.mplstyle"), use_default_template=False
    )
    for name in ("page", "print")
)


@dataclass(frozen=True)
class Panels:
    """A matplotlib figure, which a notebook shows as SVG.

    figure : the figure.
    axes : axes of the figure, from top to bottom; in a grid, row by row.
    """

    figure: Figure
    axes: list[Any]

    def _repr_svg_(self) -> str:
        return encoded(self.figure, "svg", for_print=False).decode()

    def labelled(self) -> dict[str, Any]:
        """Return the first artist of each label by the label, in the order of drawing."""
        artists: dict[str, Any] = {}
        for axes in self.figure.axes:
            for artist, label in zip(*axes.get_legend_handles_labels(), strict=True):
                artists.setdefault(label, artist)
        return artists

    def with_legend(self) -> Panels:
        """Add a legend of all labels above the axes, and return the same object."""
        artists = self.labelled()
        with style():
            self.axes[0].legend(
                artists.values(),
                artists,
                loc="lower left",
                bbox_to_anchor=(0.0, 1.0),
                ncols=_LEGEND_COLUMNS,
                frameon=False,
                fontsize=8.0,
            )
        rows = math.ceil(len(artists) / _LEGEND_COLUMNS)
        height = float(self.figure.get_figheight())
        # The margin is a number of inches, because the legend has the same height in every figure.
        self.figure.subplots_adjust(top=1.0 - (0.2 + 0.19 * rows) / height)
        return self

    def save(self, path: str | PathLike[str]) -> None:
        """Save the figure as PDF, SVG or PNG, as the suffix of `path` requires.

        Raises
        ------
        InputError
            If the suffix is another one, or `path` is an existing file that is not a picture of
            this program.
        StoreError
            If the file cannot be written.
        TypeError
            If `path` is neither text nor a path.
        """
        target = file_path(path)
        kind = target.suffix.removeprefix(".")
        if kind not in KINDS:
            allowed = f"a name that ends in .{', .'.join(KINDS)}"
            raise InputError(f"{target}: unknown format; allowed: {allowed}")
        replace_file(target, encoded(self.figure, kind), MARK)


def panels(heights: tuple[float, ...], x_label: str) -> Panels:
    """Build panels one below the other with a common horizontal axis.

    Parameters
    ----------
    heights : heights of the panels from top to bottom, in.
    x_label : label of the horizontal axis, below the last panel.
    """
    figure = Figure(figsize=(WIDTH, sum(heights) + 0.6), facecolor="white")
    with style():
        axes = figure.subplots(len(heights), squeeze=False, sharex=True, height_ratios=heights)[
            :, 0
        ].tolist()
        axes[-1].set_xlabel(x_label)
    # The margins are fixed, so that the layout does not depend on the fonts.
    height = float(figure.get_figheight())
    figure.subplots_adjust(
        left=0.16, right=0.965, bottom=0.45 / height, top=1.0 - 0.15 / height, hspace=0.09
    )
    return Panels(figure, axes)


def grid(rows: int, columns: int, height: float) -> Panels:
    """Build a grid of axes for a manuscript. The figure is as wide as a journal's page.

    Parameters
    ----------
    rows, columns : number of rows and of columns.
    height : height of each row, in.
    """
    with style(for_print=True):
        whole = rows * height + 1.25
        figure = Figure(figsize=(PRINT_WIDTH, whole), facecolor="white")
        made = figure.subplots(rows, columns, squeeze=False)
        figure.subplots_adjust(
            left=0.8 / PRINT_WIDTH, right=1.0 - 0.12 / PRINT_WIDTH, bottom=0.75 / whole,
            top=1.0 - 0.5 / whole, hspace=0.26 / height, wspace=0.34,
        )  # fmt: skip
    return Panels(figure, list(made.flat))


def squares(count: int) -> Panels:
    """Build `count` axes side by side with equal scales and no frame.

    Each has 420 by 420 pixels. There is room for two lines of text above them.
    """
    with style():
        figure = Figure(figsize=(4.2 * count, 4.6), dpi=100, facecolor="white")
        axes = [
            figure.add_axes((i / count, 0.0, 1.0 / count, 4.2 / 4.6), aspect="equal")
            for i in range(count)
        ]
    for square in axes:
        square.set_axis_off()
    return Panels(figure, [*axes])


def pixels(figure: Figure) -> NDArray[np.uint8]:
    """Return an image of the figure, (height, width, 3), with values of red, green and blue."""
    canvas: Any = FigureCanvasAgg(figure)
    canvas.draw()
    return np.asarray(canvas.buffer_rgba())[..., :3]


def style(*, for_print: bool = False) -> AbstractContextManager[None]:
    """Return a context in which matplotlib draws in the style of pages, or of manuscripts."""
    return matplotlib.rc_context(_PRINT_STYLE if for_print else _PAGE_STYLE)


def encoded(
    figure: Figure, kind: str, *, for_print: bool = True, title: str = "", description: str = ""
) -> bytes:
    """Return the content of a file with the figure, which has the same bytes every time.

    Parameters
    ----------
    figure : the figure.
    kind : format, one of KINDS.
    for_print : whether the file has the style of manuscripts, and MARK in its metadata.
    title, description : texts for the metadata; "" for none.
    """
    metadata: dict[str, Any] = {
        "pdf": {"CreationDate": None},
        "svg": {"Date": None},
        "png": {"Software": None},
    }[kind]
    if for_print:
        metadata["Software" if kind == "png" else "Creator"] = MARK.decode()
    if title:
        metadata["Title"] = title
    if description:
        metadata["Subject" if kind == "pdf" else "Description"] = description
    with (
        style(for_print=for_print),
        np.errstate(over="ignore", invalid="ignore"),
    ):  # the numbers of a divergence may overflow
        stream = io.BytesIO()
        figure.savefig(stream, format=kind, metadata=metadata)
    return stream.getvalue()


def log_axis(axes: Any, lowest: float, highest: float) -> None:
    """Make the vertical axis logarithmic over whole decades, with at most eight labels.

    Parameters
    ----------
    axes : axes of matplotlib.
    lowest, highest : positive values that the axis includes.
    """
    low, high = math.floor(math.log10(lowest)), math.ceil(math.log10(highest))
    high = max(high, low + 1)
    # The limits are set together with the scale, because limits that matplotlib finds may overflow.
    axes.set(ylim=(10.0**low, 10.0**high), yscale="log")
    exponents = range(low, high + 1, max(1, math.ceil((high - low) / 7)))
    ticks(axes.yaxis, {10.0**e: power(e) for e in exponents})


def ticks(axis: Any, labels: Mapping[float, str]) -> None:
    """Set the ticks of an axis to the values of `labels`, with their texts.

    `set_ticks` is not used, because it is slow: it makes the objects of all ticks at once.
    """
    axis.set_major_locator(FixedLocator([*labels]))
    axis.set_major_formatter(FuncFormatter(lambda value, _: labels.get(value, "")))
    axis.set_minor_locator(NullLocator())


def curve(axes: Any, x: Any, y: Any, look: Look, width: float = 1.2, **more: Any) -> None:
    """Draw a curve. Its markers, if it has any, are white inside.

    Parameters
    ----------
    axes : axes of matplotlib.
    x, y : (n,) coordinates of the points.
    look : colour, line, marker and label of the curve. A curve with the label "" is not in the
        legend.
    width : width of the line, points.
    more : further options of matplotlib's `plot`.
    """
    axes.plot(
        x,
        y,
        color=look.colour,
        linestyle=look.line,
        linewidth=width,
        marker=look.marker,
        label=look.label or "_",
        **{"markersize": 4.2, "markerfacecolor": PAPER} | more,
    )
