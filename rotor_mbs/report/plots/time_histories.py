"""Curves over time from plain arrays: motion, energies, and errors on a logarithmic axis."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from rotor_mbs.report.core import canvas
from rotor_mbs.report.core.canvas import Panels
from rotor_mbs.report.core.looks import GREY, Look, coordinate_look
from rotor_mbs.report.core.numbers import power

Array = NDArray[Any]

TIME_AXIS, ANGLE_AXIS, RATE_AXIS = "time (s)", "angle (rad)", "rate (rad/s)"
# Smallest value that is drawn on a logarithmic axis: a hundredth of the rounding error of a double of order one.
LOWEST = 1e-18
_HIGHEST = 1e4
# Values larger than this many times the 90 % quantile are cut off.
_RUNAWAY = 8.0
_STILL = 10.0  # times what it is in the last samples, at most, where it has not passed
# A range (rad, rad/s; of energies, of their scale) that is rounding error.
_ROUNDING = 1e-9
_BINS = 130  # intervals of a curve that is drawn: one in some four pixels of a page
ENERGY_LOOKS = (
    ("kinetic", Look("#d55e00", "-", ""), 1.2),
    ("potential", Look("#0072b2", "--", ""), 1.2),
    ("total less work", Look("#000000", "-", ""), 2.6),
)


class Motion(NamedTuple):
    """A run: time (n,) s; angles (rad) and rates (rad/s) (n, coordinates), either may be missing."""

    time: Array
    angles: Array | None
    rates: Array | None


class Series(NamedTuple):
    """A curve over time with its look."""

    time: Array
    values: Array
    look: Look


def motion(run: Motion, horizon: float | None = None) -> Panels:
    """Angles, then rates; the rotor has axes of its own: beside pitches of many turns it is a flat line."""
    drawn: list[tuple[str, Array, int]] = []
    for name, values in (("angle (rad)", run.angles), ("rate (rad/s)", run.rates)):
        if values is not None:
            drawn.append((f"rotor {name}", values[:, :1], 0))
            if values.shape[1] > 1:
                drawn.append((f"pitch {name}", values[:, 1:], 1))
    panels = canvas.panels(tuple(1.45 if first else 1.1 for _, _, first in drawn), TIME_AXIS)
    for axes, (label, values, first) in zip(panels.axes, drawn, strict=True):
        draw_coordinates(axes, run.time, values, label, first)
        mark_time(axes, float(run.time[-1]), horizon)
    return panels


def draw_coordinates(axes: Any, time: Array, values: Array, label: str, first: int = 0) -> None:
    """A line per coordinate of `values` (n, coordinates), which begin with the coordinate number `first`."""
    draw_lines(axes, [Series(time, x, coordinate_look(first + i)) for i, x in enumerate(values.T)], label)
    set_range(axes, values)


def draw_lines(axes: Any, series: Sequence[Series], label: str) -> None:
    """The curves over one vertical axis."""
    for one in series:
        axes.plot(*thin(one.time, one.values), color=one.look.colour, linestyle=one.look.line)
    axes.set_ylabel(label)


def set_range(axes: Any, values: Array) -> None:
    """The vertical range for `values` (n, curves): leaves out a divergence, does not magnify rounding errors."""
    if is_cut(values):
        usual = float(np.quantile(np.abs(values).max(axis=1), 0.9))
        axes.set_ylim(-2.0 * usual, 2.0 * usual)
    elif values.max() - values.min() < _ROUNDING:
        middle = 0.5 * float(values.max() + values.min())
        axes.set_ylim(middle - 0.1, middle + 0.1)


def lines(series: Sequence[Series], label: str, horizon: float | None) -> Panels:
    """The curves on one axis."""
    panels = canvas.panels((2.3,), TIME_AXIS)
    draw_lines(panels.axes[0], series, label)
    mark_time(panels.axes[0], max(float(one.time[-1]) for one in series), horizon)
    return panels


def errors(series: Sequence[Series], label: str, horizon: float | None = None, lowest: float = 1.0) -> Panels:
    """Non-negative curves on a logarithmic axis; the axis begins at `lowest` or at the smallest value drawn."""
    panels = canvas.panels((2.9,), TIME_AXIS)
    axes = panels.axes[0]
    drawn = [(*_peaks(one.time, one.values), one.look) for one in series]
    for time, values, look in drawn:
        axes.plot(
            time, values, color=look.colour, linestyle=look.line, linewidth=1.0 if look.marker else 1.8,
            marker=look.marker or None, markersize=4.2, markerfacecolor="white",
            markevery=(len(time) // 30, max(1, len(time) // 8)),
        )  # fmt: skip
    known = np.concatenate([values for _, values, _ in drawn] or [np.empty(0)])
    known = known[np.isfinite(known)]
    low, high = (float(known.min()), float(known.max())) if len(known) else (LOWEST, 1e-9)
    canvas.log_axis(axes, max(min(low, lowest), LOWEST), min(high, _HIGHEST))
    axes.set_ylabel(label)
    if series:
        mark_time(axes, float(series[0].time[-1]), horizon)
    return panels


def energies(time: Array, curves: Sequence[Array], scale: float) -> Panels:
    """Kinetic and potential energy and their sum less the work, in J; values beyond 3 `scale` are cut off."""
    panels = canvas.panels((2.3,), TIME_AXIS)
    axes = panels.axes[0]
    largest = max(float(np.abs(curve).max()) for curve in curves)
    top = min(largest, 3.0 * scale) if scale > 0.0 else largest
    factor, prefix = next(((f, p) for f, p in ((1e6, "M"), (1e3, "k")) if top >= f), (1.0, ""))
    for curve, (_, look, width) in zip(curves, ENERGY_LOOKS, strict=True):
        # The total is drawn below the others, and wide: where they are small it would cover the kinetic energy.
        axes.plot(
            *thin(time, curve / factor), color=look.colour, linestyle=look.line, linewidth=width,
            zorder=3.0 - 0.1 * width,
        )  # fmt: skip
    if largest < _ROUNDING * scale:
        axes.set_ylim(-1e-3 * scale, 1e-3 * scale)
    if largest > 3.0 * scale > 0.0:
        axes.set_ylim(-2.0 * scale / factor, 3.0 * scale / factor)
    axes.set_ylabel(f"energy ({prefix}J)")
    return panels


def error_over_step(series: Sequence[tuple[Array, Array, Look]], target: float) -> Panels:
    """Error (rad) over the fixed step (s), both axes logarithmic, with a line at `target`."""
    panels = canvas.panels((2.8,), "step (s)")
    axes, known = panels.axes[0], [1e-8, 1e-6]
    for steps, values, look in series:
        shown = np.clip(values, LOWEST, _HIGHEST)
        known += [float(np.nanmin(shown)), float(np.nanmax(shown))]
        axes.plot(
            steps, shown, color=look.colour, linestyle=look.line, marker=look.marker, markersize=4.2,
            markerfacecolor="white",
        )  # fmt: skip
    every_step = np.concatenate([steps for steps, _, _ in series])
    low, high = math.floor(math.log10(every_step.min())), math.ceil(math.log10(every_step.max()))
    decades = range(low, max(high, low + 1) + 1)
    axes.set_xscale("log")
    axes.set_xticks([10.0**e for e in decades], [power(e) for e in decades])
    axes.set_xticks([], minor=True)
    canvas.log_axis(axes, min(known), max(known))
    axes.axhline(target, color=GREY, linewidth=0.8, linestyle=":")
    axes.set_ylabel("largest angle error (rad)")
    return panels


def thin(time: Array, values: Array) -> tuple[Array, Array]:
    """The ends, and the smallest and the largest sample of each of some equal intervals: no peak is lost."""
    if len(time) <= 2 * _BINS:
        return time, values
    found = [0, len(time) - 1]
    for interval in np.array_split(np.arange(len(time)), _BINS):
        found += [interval[values[interval].argmin()], interval[values[interval].argmax()]]
    index = np.unique(found)
    return time[index], values[index]


def is_cut(values: Array) -> bool:
    """Whether the largest of these values (n, curves) are left out: of a divergence, not of a jolt that passes."""
    largest = np.abs(values).max(axis=1)
    usual = float(np.quantile(largest, 0.9))
    return bool(min(largest.max(), _STILL * largest[-5:].max()) > _RUNAWAY * usual > 0.0)


def _peaks(time: Array, values: Array) -> tuple[Array, Array]:
    """The largest sample of each interval; NaN, a gap in the curve, where a logarithmic axis cannot show it."""
    if len(time) > 2 * _BINS:
        index = [one[values[one].argmax()] for one in np.array_split(np.arange(len(time)), _BINS)]
        time, values = time[index], values[index]
    return time, np.where(values > LOWEST, np.minimum(values, _HIGHEST), np.nan)


def mark_time(axes: Any, end: float, horizon: float | None) -> None:
    """A vertical line where the horizon lies before the end (s) of what is drawn."""
    if horizon is not None and horizon < end:
        axes.axvline(horizon, color=GREY, linestyle="--", linewidth=1.3)
