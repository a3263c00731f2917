"""The pictures of a sweep: divergence of nearby initial states, stability map, response, distribution of a column."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from rotor_mbs.analysis.sweep_numbers import GROWN, Spread, StabilityMap
from rotor_mbs.report.core.canvas import TIME_AXIS, Panels, curve, growth_map, log_axis, panels
from rotor_mbs.report.core.looks import BLUE, VERMILLION, Look

Array = NDArray[np.float64]
_MOST_POINTS = 200  # of a distribution
_MOST_RUNS = 1000  # that have a point
_MOST_GROWTH = 1e4  # the colours end there: the pitch has turned many times
MEDIAN, GROWTH, BOUNDARY = Look(BLUE, "-", ""), Look(VERMILLION, "--", ""), Look(VERMILLION, "-", "")


def spread_panels(spread: Spread) -> Panels:
    """Separation over time on a log scale, with the fitted exponential growth."""
    panel = panels((3.6,), TIME_AXIS)
    axes = panel.axes[0]
    seen = spread.low > 0.0
    axes.fill_between(spread.time[seen], spread.low[seen], spread.high[seen], color=BLUE, alpha=0.2, lw=0)
    curve(axes, spread.time, spread.median, MEDIAN)
    inside = (spread.time >= spread.start) & (spread.time <= spread.end)
    time, growth = spread.time[inside], spread.growth[inside]
    # Through the window's middle, at the slope that was found.
    curve(axes, time, np.exp(np.log(growth).mean() + spread.exponent * (time - time.mean())), GROWTH)
    log_axis(axes, float(spread.low[seen].min()), float(spread.high.max()))
    axes.set_ylabel("separation of the angles (rad)")
    return panel


def map_panels(found: StabilityMap, x_label: str, y_label: str) -> tuple[Panels, bool]:
    """Growth of the pitches as colour over both axes, and whether there is the line where they grew tenfold."""
    panel = panels((3.8,), x_label)
    axes = panel.axes[0]
    label = "largest pitch, of its start (powers of ten)"
    has_line = growth_map(panel, found.x, found.y, found.growth, _MOST_GROWTH, label, GROWN)
    axes.ticklabel_format(style="plain")
    axes.set_ylabel(y_label)
    panel.figure.subplots_adjust(left=0.18)
    return panel, has_line


def response(parameter: Array, values: Array, x_label: str, y_label: str, *, logarithmic: bool) -> Panels:
    """A number of each run over a parameter that was varied, a point per run."""
    panel = panels((3.0,), x_label)
    shown = np.linspace(0, len(values) - 1, min(len(values), _MOST_RUNS)).round().astype(int)
    curve(panel.axes[0], parameter[shown], values[shown], Look(BLUE, "", "o"), markersize=3.5, markerfacecolor=BLUE)
    if logarithmic:
        log_axis(panel.axes[0], float(parameter.min()), float(parameter.max()), "x")
    panel.axes[0].set_ylabel(y_label)
    return panel


def distribution(values: Array, label: str, *, logarithmic: bool) -> Panels:
    """How many runs have how large a value: the share of runs up to each value, as a rising curve."""
    panel = panels((1.9,), label)
    known = np.sort(values[np.isfinite(values) & ((values > 0.0) | (not logarithmic))])
    if len(known) > _MOST_POINTS:
        known = known[np.linspace(0, len(known) - 1, _MOST_POINTS).round().astype(int)]
    curve(panel.axes[0], known, np.linspace(0.0, 100.0, len(known)), MEDIAN)
    if logarithmic:
        log_axis(panel.axes[0], known[0], known[-1], "x")
    panel.axes[0].set(ylim=(0.0, 101.0), ylabel="share of runs (%)")
    return panel
