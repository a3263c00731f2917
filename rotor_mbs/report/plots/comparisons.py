"""Pictures that set the printed equations beside the corrected ones: motion, tips, energy of all scenes. Plain arrays.

Colours are those of methods, but in the picture of offsets over azimuth, which has a colour per blade.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import NamedTuple

import numpy as np

from rotor_mbs.report.core import canvas
from rotor_mbs.report.core.canvas import TIME_AXIS, Panels
from rotor_mbs.report.core.looks import GREY, Look, coordinate_look
from rotor_mbs.report.core.numbers import power
from rotor_mbs.report.plots.time_histories import Array, Series, mark_time, set_range, thin

VISIBLE = 0.05  # rad: what one can see in a figure of the paper's size
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
            canvas.curve(axes, *thin(one.time, one.values), one.look, 2.4 if one.look.line == "-" else 1.3)
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
                text = f"{VISIBLE:g} rad apart at {parted:.2g} s"
                axes.text(parted + 0.01 * end, axes.get_ylim()[1], text, color=GREY, va="top", fontsize=8.5)
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
        canvas.curve(axes, azimuth, np.where(gap, np.nan, offset), look, 0.9)
    axes.set(xlim=(0.0, 360.0), ylabel="tip out of plane (mm)")
    canvas.ticks(axes.xaxis, {angle: str(angle) for angle in range(0, 361, 60)})
    return picture


def energy_of_scenes(rows: Mapping[str, Sequence[tuple[float, Look]]]) -> Panels:
    """A row per scene, a mark per model: its energy made from nothing, of the scene's energy scale, logarithmic."""
    picture = canvas.panels((0.19 * len(rows) + 0.25,), "energy made from nothing / energy scale of the scene")
    axes = picture.axes[0]
    for row, marks in enumerate(rows.values()):
        for value, look in marks:
            shown = min(max(value, _LOWEST), 1e3)
            canvas.curve(axes, [shown], [row], Look(look.colour, "", look.marker), markersize=5.5)
    axes.set(xscale="log", xlim=(_LOWEST / 3.0, 3e3), ylim=(len(rows) - 0.4, -0.6))
    canvas.ticks(axes.xaxis, {10.0**e: power(e) for e in range(round(math.log10(_LOWEST)), 4, 3)})
    canvas.ticks(axes.yaxis, dict(enumerate(rows)))
    picture.figure.subplots_adjust(left=0.25)
    return picture
