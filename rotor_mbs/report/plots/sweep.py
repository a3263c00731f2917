"""The pictures of a sweep as SVG text: divergence of nearby initial states, stability map."""

from __future__ import annotations

import numpy as np

from rotor_mbs.analysis.sweep_numbers import GROWN, Spread, StabilityMap
from rotor_mbs.report.core.canvas import growth_map, log_axis, panels, svg_text

_INK, _ACCENT = "#0072b2", "#d55e00"  # Okabe-Ito blue and vermillion
_MOST_GROWTH = 1e4  # the colours end there: the pitch has turned many times


def spread_figure(spread: Spread, title: str) -> str:
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
    axes.legend(loc="lower right", frameon=False)
    axes.set_title(title, fontsize=9.5)
    panel.figure.subplots_adjust(left=0.18, top=0.92)
    return svg_text(panel.figure)


def map_figure(found: StabilityMap, title: str) -> str:
    """Growth of the pitches as colour over both axes, with the line where they grew tenfold."""
    panel = panels((3.8,), f"{found.x_key} ({found.x_unit})")
    axes = panel.axes[0]
    label = "largest pitch, of its start (powers of ten)"
    levels = growth_map(panel, found.x, found.y, found.growth, _MOST_GROWTH, label)
    if found.unstable.any() and not found.unstable.all():
        axes.contour(found.x, found.y, levels, levels=[np.log10(GROWN)], colors=[_ACCENT], linewidths=1.0)
        axes.plot([], [], color=_ACCENT, lw=1.0, label=f"{GROWN:g} times its start")
        axes.legend(loc="upper right")
    axes.ticklabel_format(style="plain")
    axes.set_ylabel(f"{found.y_key} ({found.y_unit})")
    axes.set_title(title, fontsize=9.5)
    panel.figure.subplots_adjust(left=0.18, top=0.92)
    return svg_text(panel.figure)
