"""Campbell diagram, damping ratios, Floquet multipliers and stability chart, from plain arrays."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from rotor_mbs.analysis.campbell import FloquetTable, LinearModes, StabilityChart
from rotor_mbs.analysis.modes import GROWTH
from rotor_mbs.report.core.canvas import Panels, curve, growth_map, panels
from rotor_mbs.report.core.looks import BLUE, GREY, VERMILLION, Look, coordinate_look

SPEED_AXIS = "rotor speed (rad/s)"
# Multiples of the rotor speed drawn as lines: gravity acts once a turn, a tower or yaw error on each blade in turn.
_HARMONICS = (1, 2, 3, 6)
_MARKS = ("o", "s", "^", "D", "v", "P", "x")
# Growth over a turn beyond which the colours of the chart end.
_MOST_GROWTH = 1e3


def mode_look(index: int) -> Look:
    """Line and marker of a mode: equal frequencies lie on each other, so that each mode has its own marker."""
    look = coordinate_look(index)
    return Look(look.colour, look.line, _MARKS[index % len(_MARKS)])


def campbell(modes: LinearModes) -> Panels:
    """Damped frequencies (rad/s) over speed above their change since the lowest speed, with multiples of the speed."""
    panel = panels((2.9, 1.7), SPEED_AXIS)
    frequencies = modes.over_speed("damped_frequencies")
    speeds = modes.speeds
    top = float(np.nanmax(frequencies, initial=0.0)) * 1.08 or 1.0
    apart = float(speeds[-1]) > 0.05 * top  # else the labels would lie on each other
    for k in _HARMONICS:
        panel.axes[0].plot(speeds, k * speeds, color=GREY, linewidth=0.7, linestyle=":")
        if not apart and k != _HARMONICS[-1]:
            continue
        end = min(float(speeds[-1]), top / k)
        panel.axes[0].text(end, k * end, f"{k}P", color=GREY, ha="right", va="bottom", fontsize=8.0)
    for k, known in enumerate(frequencies.T):
        change = np.where(np.nanmax(known) > 1e-6 * top, known - known[np.flatnonzero(np.isfinite(known))[:1]], np.nan)
        every = (k, frequencies.shape[1] * max(1, len(speeds) // 24))
        for axes, values in zip(panel.axes, (known, change), strict=True):
            curve(axes, speeds, values, mode_look(k), markevery=every, markersize=4.0)
    panel.axes[0].set_ylim(0.0, top)
    panel.axes[0].set_ylabel("frequency (rad/s)")
    panel.axes[1].set_ylabel("change (rad/s)")
    return panel


def damping(modes: LinearModes) -> Panels:
    """Damping ratio and growth rate (1/s) of each mode over speed."""
    panel = panels((2.0, 2.0), SPEED_AXIS)
    for axes, name, label in (
        (panel.axes[0], "damping_ratios", "damping ratio"),
        (panel.axes[1], "growth_rates", "growth rate (1/s)"),
    ):
        for k, values in enumerate(modes.over_speed(name).T):
            curve(axes, modes.speeds, values, replace(mode_look(k), marker=""))
        axes.set_ylabel(label)
    return panel


def multipliers(table: FloquetTable) -> Panels:
    """Modulus of every multiplier over speed on a log scale, with the largest one marked."""
    panel = panels((2.6,), SPEED_AXIS)
    axes = panel.axes[0]
    sizes = np.abs(table.multipliers)
    shown = np.where(sizes > 0.0, sizes, np.nan)
    curve(axes, table.speeds, shown, Look(BLUE, "", "o"), markersize=2.0, markerfacecolor=BLUE)
    curve(axes, table.speeds, table.largest, Look(VERMILLION, "-", ""), 1.5)
    axes.axhline(1.0, color=GREY, linewidth=0.8)
    known = sizes[np.isfinite(sizes) & (sizes > 0.0)]
    if len(known) and known.max() / known.min() > 10.0:
        axes.set_yscale("log")
    elif len(known) and known.max() / known.min() < 1.0 + 10.0 * GROWTH:
        axes.set_ylim(0.9, 1.1)
    axes.set_ylabel("modulus of the multipliers")
    return panel


def chart(found: StabilityChart) -> Panels:
    """Growth over a turn as colour over speed and stiffness, with the boundary of stability."""
    panel = panels((3.6,), SPEED_AXIS)
    label = "growth over a turn (powers of ten)"
    growth_map(panel, found.speeds, found.stiffnesses, found.largest, _MOST_GROWTH, label, 1.0 + GROWTH)
    panel.axes[0].set_ylabel("bearing stiffness (N m/rad)")
    return panel
