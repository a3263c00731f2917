"""Pictures that set the printed equations beside the corrected ones: motion, energy, tips, all scenes. Plain arrays.

Colours are those of methods, but in the picture of offsets over azimuth, which has a colour per blade.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import NamedTuple

import numpy as np

from rotor_mbs.report.core import canvas
from rotor_mbs.report.core.canvas import Panels
from rotor_mbs.report.core.looks import GREY, Look, coordinate_look
from rotor_mbs.report.core.numbers import power
from rotor_mbs.report.plots.time_histories import TIME_AXIS, Array, Series, mark_time, set_range, thin

_DECADES = 6  # of a symmetric logarithmic axis, on each side
_LOWEST = 1e-16  # relative energy at which a mark below it is drawn


class Mark(NamedTuple):
    """A published value (rad, rad/s) on one of the panels, with the text beside it."""

    panel: int
    value: float
    text: str


def departure(
    panels_of: Sequence[tuple[str, Sequence[Series]]], marks: Sequence[Mark] = (), horizon: float | None = None,
    parted: float | None = None,
) -> Panels:  # fmt: skip
    """A panel per (axis label, curves), one below the other, with published values and the time of parting (s)."""
    picture = canvas.panels((1.75,) * len(panels_of), TIME_AXIS)
    for place, (axes, (label, series)) in enumerate(zip(picture.axes, panels_of, strict=True)):
        for one in series:
            axes.plot(*thin(one.time, one.values), color=one.look.colour, linestyle=one.look.line,
                      linewidth=2.4 if one.look.line == "-" else 1.3)  # fmt: skip
        longest = min(len(one.values) for one in series)
        set_range(axes, np.stack([one.values[:longest] for one in series], axis=1))
        axes.set_ylabel(label)
        end = max(float(one.time[-1]) for one in series)
        for mark in marks:
            if mark.panel == place:
                low, high = axes.get_ylim()
                axes.set_ylim(min(low, mark.value), max(high, mark.value + 0.12 * (high - low)))
                axes.axhline(mark.value, color=GREY, linewidth=1.0, linestyle=":")
                beside = parted if parted is not None and parted < 0.1 * end else 0.0  # not across its line
                axes.text(beside + 0.01 * end, mark.value, mark.text, color=GREY, ha="left", va="bottom", fontsize=8.5)
        mark_time(axes, end, horizon)
        if parted is not None and 0.0 < parted < end:
            axes.axvline(parted, color=GREY, linewidth=1.0, linestyle="-")
            if not place:
                text = f" they part at {parted:.2g} s"
                axes.text(parted, axes.get_ylim()[1], text, color=GREY, ha="left", va="top", fontsize=8.5)
    return picture


def energy_from_start(series: Sequence[Series], horizon: float | None = None) -> Panels:
    """Total energy less work, minus its start (J), a curve per run; symmetric-logarithmic where sizes differ widely."""
    picture = canvas.panels((3.0,), TIME_AXIS)
    axes = picture.axes[0]
    for one in series:
        line_width = 1.8 if not one.look.marker or one.look.marker == "x" else 1.1
        axes.plot(*thin(one.time, one.values), color=one.look.colour, linestyle=one.look.line, linewidth=line_width,
                  marker=one.look.marker or None, markersize=4.2, markerfacecolor="white",
                  markevery=(0, max(1, min(len(one.time), 260) // 7)))  # fmt: skip
    sizes = [float(np.abs(one.values).max(initial=0.0)) for one in series]
    known = [size for size in sizes if 0.0 < size < math.inf]
    if known and max(known) > 100.0 * min(known):
        first = math.ceil(math.log10(max(max(known) * 10.0**-_DECADES, min(known))))
        largest, least = (max(float((sign * one.values).max()) for one in series) for sign in (1.0, -1.0))
        above, below = (math.ceil(math.log10(max(size, 10.0**first))) for size in (largest, least))
        canvas.symmetric_log_axis(axes, first, below if least > 0.0 else None, above)
    axes.set_ylabel("energy less work, from its start (J)")
    end = max((float(one.time[-1]) for one in series), default=0.0)
    mark_time(axes, end, horizon)
    return picture


def offsets_over_azimuth(angles: Array, tip: Array, phases: Sequence[float]) -> Panels:
    """How far each tip (n, blades, 3) m is out of the plane of rotation, in mm, over where its blade points."""
    picture = canvas.panels((2.3,), "azimuth of the blade (°), 0 above the hub")
    axes = picture.axes[0]
    for blade, phase in enumerate(phases):
        azimuth = np.degrees(np.remainder(angles[:, 0] + phase, 2.0 * np.pi))
        offset = 1e3 * tip[:, blade, 1]
        gap = np.abs(np.diff(azimuth, prepend=azimuth[:1])) > 180.0
        look = coordinate_look(blade + 1)
        axes.plot(azimuth, np.where(gap, np.nan, offset), color=look.colour, linestyle=look.line, linewidth=0.9)
    axes.set_xlim(0.0, 360.0)
    axes.set_xticks(range(0, 361, 60))
    axes.set_ylabel("tip out of plane (mm)")
    return picture


def tip_difference(time: Array, printed: Array, corrected: Array, horizon: float | None = None) -> Panels:
    """Distance (m) of each printed tip from the corrected one, on a logarithmic axis; both (n, blades, 3) m."""
    picture = canvas.panels((2.3,), TIME_AXIS)
    axes = picture.axes[0]
    gaps = np.linalg.norm(printed - corrected, axis=2)
    seen = gaps[gaps > 0.0]
    for blade in range(gaps.shape[1]):
        look = coordinate_look(blade + 1)
        shown = np.where(gaps[:, blade] > 1e-6, gaps[:, blade], np.nan)
        axes.plot(*thin(time, np.nan_to_num(shown, nan=1e-6)), color=look.colour, linestyle=look.line)
    canvas.log_axis(axes, max(float(seen.min(initial=1e-3)), 1e-6), max(float(seen.max(initial=1e-3)), 1e-5))
    axes.set_ylabel("printed − corrected (m)")
    mark_time(axes, float(time[-1]), horizon)
    return picture


def energy_of_scenes(rows: Mapping[str, Sequence[tuple[float, Look]]]) -> Panels:
    """A row per scene, a mark per model: its energy made from nothing, of the scene's energy scale, logarithmic."""
    picture = canvas.panels((0.19 * len(rows) + 0.25,), "energy made from nothing / energy scale of the scene")
    axes = picture.axes[0]
    for row, marks in enumerate(rows.values()):
        for value, look in marks:
            axes.plot([min(max(value, _LOWEST), 1e3)], [row], marker=look.marker, color=look.colour, markersize=5.5,
                      markerfacecolor="none", linestyle="none")  # fmt: skip
    axes.set_xscale("log")
    axes.set_xlim(_LOWEST / 3.0, 3e3)
    exponents = range(round(math.log10(_LOWEST)), 4, 3)
    axes.set_xticks([10.0**e for e in exponents], [power(e) for e in exponents])
    axes.set_xticks([], minor=True)
    axes.set_yticks(range(len(rows)), list(rows))
    axes.set_ylim(len(rows) - 0.4, -0.6)
    picture.figure.subplots_adjust(left=0.25)
    return picture


def stacked(rows: Sequence[tuple[str, Sequence[Series]]]) -> Panels:
    """Panels one above the other, (label with a unit, curves) each; large numbers in k or M of the unit."""
    picture = canvas.panels((1.3,) * len(rows), TIME_AXIS)
    for axes, (label, curves) in zip(picture.axes, rows, strict=True):
        largest = max(float(np.abs(one.values).max()) for one in curves)
        factor, prefix = next(((f, p) for f, p in ((1e6, "M"), (1e3, "k")) if largest >= f), (1.0, ""))
        for one in curves:
            axes.plot(*thin(one.time, one.values / factor), color=one.look.colour, linestyle=one.look.line)
        axes.set_ylabel(label.replace("(", f"({prefix}", 1))
        low, high = axes.get_ylim()
        axes.set_ylim(min(low, 0.0), max(high, 0.0))
    return picture
