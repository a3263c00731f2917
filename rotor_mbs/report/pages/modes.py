"""The page of modes: Campbell diagram, shapes in multiblade coordinates, agreement of the models, multipliers."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from rotor_mbs.analysis.campbell import FloquetTable, LinearModes, SceneModes, StabilityChart, floquet_sentence
from rotor_mbs.analysis.modes import GROWTH, multiblade
from rotor_mbs.report.core.canvas import Panels, curve, growth_map, log_axis, panels
from rotor_mbs.report.core.elements import LegendEntry, PageTable, Picture, Row, Section, TableCell
from rotor_mbs.report.core.looks import BLUE, GREY, VERMILLION, Look, coordinate_look, with_capital
from rotor_mbs.report.core.numbers import NOTHING, number
from rotor_mbs.report.core.svg import picture

SPEED_AXIS = "rotor speed (rad/s)"
# Multiples of the rotor speed drawn as lines: gravity acts once a turn, a tower or yaw error on each blade in turn.
_HARMONICS = (1, 2, 3, 6)
_MARKS = ("o", "s", "^", "D", "v", "P", "x")
# Growth over a turn beyond which the colours of the chart end.
MAX_GROWTH = 1e3


def modes_page(modes: Sequence[SceneModes]) -> dict[str, object]:
    """The content of the page: a part for each scene, of which each id is unique on the page."""
    return {"scenes": [_scene_part(scene_modes, f"scene{i}") for i, scene_modes in enumerate(modes)]}


def _scene_part(modes: SceneModes, name: str) -> dict[str, object]:
    sources = max((list(kind.values()) for kind in (modes.rest, modes.rotation)), key=len)
    rest = next(iter(modes.rest.values()), None)
    rotation = next(iter(modes.rotation.values()), None)
    pictures: list[Picture] = []
    legend: list[LegendEntry] = []
    fastest = Section()
    if rotation is not None and not np.isnan(rotation.growth_rates).all():
        last = len(rotation.speeds) - 1
        state = f"{modes.scene}, {number(float(rotation.speeds[last]), 4)} rad/s"
        fastest = Section(tables=_tables(rotation, last, state))
        if last > 0:
            caption = "Damped frequencies in the rotor's frame, and multiples of the rotor speed (1P, 2P, ...)"
            pictures.append(picture(campbell(rotation), f"{name}-campbell", caption))
            legend += [LegendEntry(label, mode_look(k)) for k, label in enumerate(rotation.names)]
            if max(np.nanmax(np.abs(rotation.damping_ratios), initial=0.0), np.nanmax(rotation.growth_rates)) > 1e-9:
                caption = "Damping ratios and growth rates"
                pictures.append(picture(damping(rotation), f"{name}-damping", caption))
    return {
        "id": name,
        "name": modes.scene,
        "title": modes.title,
        "models": [f"{linear.label} ({linear.source})" for linear in sources],
        "agrees": modes.agrees,
        "difference": modes.disagreement,
        "notes": ([with_capital(floquet_sentence(modes.floquet))] if modes.floquet is not None else [])
        + list(modes.notes),
        "rest": Section(tables=[] if rest is None else _tables(rest, 0, f"{modes.scene}, at rest")),
        "campbell": Section(pictures, legend),
        "fastest": fastest,
        "turning": _turning(modes, name),
    }


def _tables(linear: LinearModes, i: int, state: str) -> list[PageTable]:
    """Frequencies and shapes at the i-th speed; state: the beginning of captions, which differ on the whole page."""
    columns = {
        "undamped (Hz)": linear.undamped_frequencies / (2.0 * math.pi),
        "undamped (rad/s)": linear.undamped_frequencies,
        "damped (rad/s)": linear.damped_frequencies,
        "damping ratio": linear.damping_ratios,
        "growth rate (1/s)": linear.growth_rates,
        "backward whirl (rad/s)": linear.whirl[0],
        "forward whirl (rad/s)": linear.whirl[1],
    }
    frequencies, shapes = [], []
    for k, name in enumerate(linear.names):
        frequencies.append([name, *(_shown(float(values[i, k]), 7) for values in columns.values())])
        amplitudes = np.abs(linear.multiblade_shapes[i][k])
        largest = max(float(amplitudes.max()), 1e-300)
        shapes.append([name, *(_shown(float(amplitude) / largest, 3) for amplitude in amplitudes)])
    caption = f"{state}: modes by the {linear.label} ({linear.source})"
    table = PageTable(caption, ("Mode", *columns), frequencies, range(1, 1 + len(columns))).without_empty_columns()
    head = ("Shape", "rotor", *multiblade(linear.blades)[0])
    return [table, PageTable(f"{state}: shapes, the largest amplitude 1", head, shapes, range(1, len(head)))]


def _shown(value: float, digits: int) -> str:
    if not math.isfinite(value):
        return NOTHING
    return number(0.0 if abs(value) < 1e-12 else value, digits)


def _turning(modes: SceneModes, name: str) -> Section:
    table = modes.floquet
    if table is None:
        return Section()
    drawn: list[Picture] = []
    if len(table.speeds) > 1 and np.isfinite(table.largest).any():
        caption = "Floquet multipliers of a turn under gravity: each as a dot, the largest as a line; above 1 it grows"
        drawn.append(picture(multipliers(table), f"{name}-multipliers", caption))
    if modes.chart is not None:
        caption = "Stability chart: growth over a turn under gravity; a line bounds what is stable"
        drawn.append(picture(chart(modes.chart), f"{name}-chart", caption))
    rows: list[Row] = []
    for i, (speed, largest) in enumerate(zip(table.speeds.tolist(), table.largest.tolist(), strict=True)):
        cell = TableCell(_shown(largest, 7), "bad" if table.stable[i] == 0 else "", note=table.messages[i])
        numbers = ((table.growth_rates, 4), (table.product_error, 2), (table.torque, 4))
        rows.append([number(speed, 4), cell, *(_shown(float(values[i]), digits) for values, digits in numbers)])
    head = ("Speed (rad/s)", "largest multiplier", "growth rate (1/s)", "product less trace", "torque (N m)")
    return Section(drawn, (), [PageTable(f"{modes.scene}: multipliers", head, rows, (0, 1, 2, 3, 4))])


def mode_look(index: int) -> Look:
    """Line and marker of a mode: equal frequencies lie on each other, so that each mode has its own marker."""
    look = coordinate_look(index)
    return Look(look.colour, look.line, _MARKS[index % len(_MARKS)])


def campbell(modes: LinearModes) -> Panels:
    """Damped frequencies (rad/s) over speed above their change since the lowest speed, with multiples of the speed."""
    panel = panels((2.9, 1.7), SPEED_AXIS)
    frequencies, speeds = modes.damped_frequencies, modes.speeds
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
    curves = {"damping ratio": modes.damping_ratios, "growth rate (1/s)": modes.growth_rates}
    for axes, (label, numbers) in zip(panel.axes, curves.items(), strict=True):
        for k, values in enumerate(numbers.T):
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
        log_axis(axes, float(known.min()), float(known.max()))
    elif len(known) and known.max() / known.min() < 1.0 + 10.0 * GROWTH:
        axes.set_ylim(0.9, 1.1)
    axes.set_ylabel("modulus of the multipliers")
    return panel


def chart(table: StabilityChart) -> Panels:
    """Growth over a turn as colour over speed and stiffness, with the boundary of stability."""
    panel = panels((3.6,), SPEED_AXIS)
    label = "growth over a turn (powers of ten)"
    growth_map(panel, table.speeds, table.stiffnesses, table.largest, MAX_GROWTH, label, 1.0 + GROWTH)
    panel.axes[0].set_ylabel("bearing stiffness (N m/rad)")
    return panel
