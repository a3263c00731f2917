"""The pictures of a sweep: divergence of nearby initial states, stability map, distribution of a column."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from rotor_mbs.analysis.sweep_numbers import GROWN, Spread, StabilityMap
from rotor_mbs.report.core.canvas import Panels, growth_map, log_axis, panels, svg_text
from rotor_mbs.report.core.numbers import power

_INK, _ACCENT = "#0072b2", "#d55e00"  # Okabe-Ito blue and vermillion
Array = NDArray[np.float64]
_MOST_POINTS = 200  # of a distribution
_MOST_RUNS = 1000  # that have a point
_MOST_GROWTH = 1e4  # the colours end there: the pitch has turned many times


def spread_panels(spread: Spread) -> Panels:
    """Separation over time on a log scale, with the fitted exponential growth."""
    panel = panels((3.6,), "time (s)")
    axes = panel.axes[0]
    seen = spread.low > 0.0
    axes.fill_between(spread.time[seen], spread.low[seen], spread.high[seen], color=_INK, alpha=0.2, lw=0,
                      label=f"10 to 90 % of {spread.pairs} pairs")  # fmt: skip
    axes.plot(spread.time, spread.median, color=_INK, label="median")
    inside = (spread.time >= spread.start) & (spread.time <= spread.end)
    time, growth = spread.time[inside], spread.growth[inside]
    # Through the window's middle, at the slope that was found.
    line = np.exp(np.log(growth).mean() + spread.exponent * (time - time.mean()))
    axes.plot(time, line, color=_ACCENT, ls="--",
              label=f"growth {spread.exponent:.2f} ± {spread.uncertainty:.2f} per s")  # fmt: skip
    log_axis(axes, float(spread.low[seen].min()), float(spread.high.max()))
    axes.set_ylabel("separation of the angles (rad)")
    return panel


def response(parameter: Array, values: Array, x_label: str, y_label: str, *, logarithmic: bool) -> Panels:
    """A number of each run over a parameter that was varied, a point per run."""
    panel = panels((3.0,), x_label)
    axes = panel.axes[0]
    shown = np.linspace(0, len(values) - 1, min(len(values), _MOST_RUNS)).round().astype(int)
    axes.plot(parameter[shown], values[shown], color=_INK, marker="o", markersize=3.5, linestyle="none")
    if logarithmic:
        _decades(axes, float(parameter.min()), float(parameter.max()))
    axes.set_ylabel(y_label)
    return panel


def spread_figure(spread: Spread, title: str) -> str:
    """SVG text of the picture of the spread, with its title and legend."""
    panel = spread_panels(spread)
    panel.axes[0].legend(loc="lower right", frameon=False)
    return _titled(panel, title)


def map_panels(found: StabilityMap, x_label: str = "", y_label: str = "") -> Panels:
    """Growth of the pitches as colour over both axes, with the line where they grew tenfold."""
    panel = panels((3.8,), x_label or f"{found.x_key} ({found.x_unit})")
    axes = panel.axes[0]
    label = "largest pitch, of its start (powers of ten)"
    levels = growth_map(panel, found.x, found.y, found.growth, _MOST_GROWTH, label)
    if found.unstable.any() and not found.unstable.all():
        axes.contour(found.x, found.y, levels, levels=[np.log10(GROWN)], colors=[_ACCENT], linewidths=1.0)
        axes.plot([], [], color=_ACCENT, lw=1.0, label=f"{GROWN:g} times its start")
    axes.ticklabel_format(style="plain")
    axes.set_ylabel(y_label or f"{found.y_key} ({found.y_unit})")
    panel.figure.subplots_adjust(left=0.18)
    return panel


def map_figure(found: StabilityMap, title: str) -> str:
    """SVG text of the map, with its title and legend."""
    panel = map_panels(found)
    if panel.axes[0].get_lines():
        panel.axes[0].legend(loc="upper right")
    return _titled(panel, title)


def distribution(values: Array, label: str, *, logarithmic: bool) -> Panels:
    """How many runs have how large a value: the share of runs up to each value, as a rising curve."""
    panel = panels((1.9,), label)
    axes = panel.axes[0]
    known = np.sort(values[np.isfinite(values) & ((values > 0.0) | (not logarithmic))])
    if len(known) > _MOST_POINTS:
        known = known[np.linspace(0, len(known) - 1, _MOST_POINTS).round().astype(int)]
    axes.plot(known, np.linspace(0.0, 100.0, len(known)), color=_INK)
    if logarithmic:
        _decades(axes, known[0], known[-1])
    axes.set_ylim(0.0, 101.0)
    axes.set_ylabel("share of runs (%)")
    return panel


def _decades(axes: Any, smallest: float, largest: float) -> None:
    """A horizontal log axis with at most seven labels."""
    axes.set_xscale("log")
    low, high = np.floor(np.log10(smallest)), np.ceil(np.log10(largest))
    exponents = np.arange(low, max(high, low + 1) + 1, max(1, np.ceil((high - low) / 6)))
    axes.set_xticks(10.0**exponents, [power(int(e)) for e in exponents])
    axes.set_xticks([], minor=True)


def _titled(panel: Panels, title: str) -> str:
    panel.axes[0].set_title(title, fontsize=9.5)
    panel.figure.subplots_adjust(left=0.18, top=0.92)
    return svg_text(panel.figure)
