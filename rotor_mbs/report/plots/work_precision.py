"""The diagram of error against run time: curves, Pareto front, quartiles, failed runs on a strip at the left.

Error on the horizontal axis, falling to the right, so that accuracy grows to the right; time on the vertical one.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any

import numpy as np

from rotor_mbs.analysis.work_precision import failed, pareto, points, succeeded
from rotor_mbs.report.core import canvas
from rotor_mbs.report.core.canvas import Panels
from rotor_mbs.report.core.looks import GREY, Look, look_of
from rotor_mbs.report.core.numbers import power
from rotor_mbs.store.records import Record

FRONT_COLOUR = "#c8c8c8"
_LOWEST_ERROR, _RAIL_START, _RAIL, _RAIL_END = 1e-16, 3.0, 20.0, 120.0


def diagram(curves: Sequence[Record], *, with_setup: bool = False, height: float = 3.9, small: bool = False) -> Panels:
    """All curves of a scene; `small` for one of many side by side: front and curves alone."""
    picture = canvas.panels((height,), "largest angle error up to the horizon (rad)")
    axes = picture.axes[0]
    drawn = [points(curve, with_setup=with_setup) for curve in curves]
    _front(axes, drawn)
    for curve, (errors, seconds) in zip(curves, drawn, strict=True):
        style = look_of(curve.name)
        shown = np.maximum(errors, _LOWEST_ERROR)
        canvas.curve(axes, shown, seconds, style, 1.0, markersize=3.0 if small else 4.2)
        if not with_setup and not small:
            _whiskers(axes, curve, style)
        _rail(axes, curve, style, with_setup)
    _axes(axes, drawn, curves)
    axes.set_ylabel("set-up, run and read-out (s)" if with_setup else "run time (s)")
    return picture


def has_visible_uncertainty(curves: Sequence[Record]) -> bool:
    """Whether the reference's uncertainty lies within the diagram: in quad precision it is far beyond its edge."""
    return _uncertainty(curves) > _LOWEST_ERROR


def _uncertainty(curves: Sequence[Record]) -> float:
    return max((float(curve.attributes.get("uncertainty_rad", 0.0)) for curve in curves), default=0.0)


def _front(axes: Any, drawn: Sequence[tuple[Any, Any]]) -> None:
    errors, seconds = np.concatenate(drawn, axis=1) if drawn else np.empty((2, 0))
    chosen = pareto(errors, seconds)
    best = np.maximum(errors[chosen], _LOWEST_ERROR)
    axes.plot(best, seconds[chosen], color=FRONT_COLOUR, linewidth=6.0, solid_capstyle="round", zorder=0.5)


def _whiskers(axes: Any, curve: Record, style: Look) -> None:
    chosen = succeeded(curve)
    errors = np.maximum(curve.arrays["angle_error_max"][chosen], _LOWEST_ERROR)
    low, high = curve.arrays["run_time_q1_s"][chosen], curve.arrays["run_time_q3_s"][chosen]
    axes.vlines(errors, low, high, color=style.colour, linewidth=2.2, alpha=0.6)


def _rail(axes: Any, curve: Record, style: Look, with_setup: bool) -> None:
    chosen = failed(curve)
    seconds = curve.arrays["run_time_s"][chosen]
    if with_setup:
        seconds = seconds + np.nan_to_num(curve.arrays["setup_time_s"][chosen])
    axes.plot(np.full(len(seconds), _RAIL), seconds, linestyle="none", marker="x", markersize=4.0, color=style.colour)


def _axes(axes: Any, drawn: Sequence[tuple[Any, Any]], curves: Sequence[Record]) -> None:
    if has_visible_uncertainty(curves):
        axes.axvspan(_LOWEST_ERROR / 10.0, _uncertainty(curves), color=GREY, alpha=0.2, linewidth=0)
    axes.axvspan(_RAIL_START, _RAIL_END, color="#f2e3de", linewidth=0, zorder=0)
    axes.set_xscale("log")
    axes.set_xlim(_RAIL_END, _LOWEST_ERROR / 2.0)
    exponents = range(-3, -17, -3)
    axes.set_xticks([_RAIL, *(10.0**e for e in exponents)], ["failed", *(power(e) for e in exponents)])
    axes.set_xticks([], minor=True)
    times = [*(seconds for _, seconds in drawn), *(curve.arrays["run_time_s"][failed(curve)] for curve in curves)]
    known = np.concatenate([np.ravel(time) for time in times] or [np.empty(0)])
    known = known[np.isfinite(known) & (known > 0.0)]
    low, high = (known.min(), known.max()) if len(known) else (1e-3, 1.0)
    canvas.log_axis(axes, 10.0 ** math.floor(math.log10(low)), high)
