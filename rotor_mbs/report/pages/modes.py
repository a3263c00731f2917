"""The modes of a scene: what `rotor_mbs.modes` returns, its figures, and the page of modes."""

from __future__ import annotations

import math
import os
from collections.abc import Sequence
from dataclasses import dataclass, replace
from html import escape
from pathlib import Path
from typing import Any

import numpy as np

from rotor_mbs.analysis.modes import (
    GROWTH,
    FloquetTable,
    LinearModes,
    SceneModes,
    linear_dataset,
    mode_rows,
    mode_table,
    multiblade,
    to_records,
)
from rotor_mbs.analysis.text_tables import TextTable
from rotor_mbs.errors import InputError, shown_value
from rotor_mbs.report.canvas import SPEED_AXIS, Panels, curve, log_axis, panels
from rotor_mbs.report.elements import PageTable, Picture, Row, Section, TableCell, picture
from rotor_mbs.report.files import write_page
from rotor_mbs.report.looks import BLUE, GREY, VERMILLION, Look, coordinate_look
from rotor_mbs.report.numbers import NOTHING, number
from rotor_mbs.runs.read import write_records
from rotor_mbs.runs.versions import machine, versions
from rotor_mbs.scenario.catalogue import scene_of
from rotor_mbs.scenario.scene import Scene
from rotor_mbs.scenario.toml_file import file_path
from rotor_mbs.solution.trajectory import need_xarray
from rotor_mbs.studies.modes import compute_modes, increasing_speeds

_MARKS = ("o", "s", "^", "D", "v", "P", "x")


def modes(scene: Scene | str | os.PathLike[str], speeds: Sequence[float] = ()) -> Modes:
    """Compute natural frequencies, damping ratios and mode shapes of a scene with every model that can be linearized.

    Modes at rest under gravity, and over `speeds` in steady rotation without gravity (Campbell diagram); Floquet
    multipliers in rotation under gravity. The scene's torque is not included: a drive torque maintains the speed.

    Parameters
    ----------
    scene : a Scene, the name of a shipped scene, or a TOML file.
    speeds : rotor speeds (rad/s), increasing, at least 0.

    Raises
    ------
    InputError
        For speeds that do not increase, or are negative, and for a scene without a steady state.
    TypeError
        If `scene` is neither a scene nor text nor a path, or a speed is no number.

    Examples
    --------
    >>> import rotor_mbs as rm
    >>> study = rm.modes(rm.scene("stiff/nrel-5mw").replace(gravity=0.0), speeds=[0.0, 1.2])
    >>> study.agrees, list(study.rotation)[:2]
    (True, ['lagrange', 'exudyn_tree'])
    >>> study.rotation["lagrange"].names
    ('rotor', 'collective pitch', 'cosine pitch', 'sine pitch')
    """
    return Modes(**vars(compute_modes(scene_of(scene), increasing_speeds(speeds))))


@dataclass(frozen=True)
class Modes(SceneModes):
    """Result of `rotor_mbs.modes`: the modes of a scene.

    Attributes
    ----------
    rest, rotation : modes by model, at rest under gravity, and over speed without gravity; the closed form first.
    floquet : Floquet multipliers under gravity; None if not computed.
    notes : results that could not be computed, with the reason.
    agrees, disagreement : whether the modes of the models agree, and the largest difference of a frequency or a decay
        rate, relative to the frequency.
    plot : `modes.plot()` draws the Campbell diagram; `.damping()`, `.multipliers()`.
    """

    @property
    def plot(self) -> ModePlots:
        return ModePlots(self)

    def table(self) -> TextTable:
        """Table with a row per state, speed and mode of the closed form: rad/s, damping ratio, 1/s."""
        return mode_table(mode_rows(self))

    def to_xarray(self, state: str = "rotation") -> Any:
        """Return the modes of one state, "rotation" or "rest", as an xarray.Dataset; dimension `solver`: the models.

        Raises InputError for another state, and one that was not computed.
        """
        states = {"rotation": self.rotation, "rest": self.rest}
        if state not in states:
            raise InputError(f"no state {shown_value(state)}; allowed: {', '.join(states)}")
        return linear_dataset(states[state], need_xarray())

    def save(self, path: str | os.PathLike[str]) -> Path:
        """Save the modes in a file that `rotor-mbs report` reads.

        A file of modes is replaced. Raises InputError for other files, TypeError if `path` is neither text nor a path.
        """
        target = file_path(path)
        write_records(target, to_records(self))
        return target

    def to_html(self, folder: str | os.PathLike[str]) -> Path:
        """Write the page into a folder. Returns its path."""
        return write_page(file_path(folder), "modes", modes_page([self]), versions() | machine())

    def _repr_html_(self) -> str:
        drawn = self.plot()._repr_svg_() if self.rotation else ""
        return f"<p>{escape(self.scene)}: {escape(self.title)}</p>{self.table()._repr_html_()}{drawn}"


class ModePlots:
    """Plots of the modes of a scene."""

    def __init__(self, modes: SceneModes) -> None:
        self._modes = modes

    def __call__(self) -> Panels:
        """Plot the Campbell diagram: damped frequencies (rad/s) over rotor speed, with multiples of the speed."""
        modes = self._rotation()
        panel = panels((2.9, 1.7), SPEED_AXIS)
        frequencies, speeds = modes.damped_frequencies, modes.speeds
        top = float(np.nanmax(frequencies, initial=0.0)) * 1.08 or 1.0
        apart = float(speeds[-1]) > 0.05 * top  # else the labels would lie on each other
        # Gravity acts once a turn, a tower or a yaw error on each blade in turn.
        harmonics = sorted({1, 2, modes.blades, 2 * modes.blades})
        for k in harmonics:
            panel.axes[0].plot(speeds, k * speeds, color=GREY, linewidth=0.7, linestyle=":")
            if apart or k == harmonics[-1]:
                end = min(float(speeds[-1]), top / k)
                panel.axes[0].text(end, k * end, f"{k}P", color=GREY, ha="right", va="bottom", fontsize=8.0)
        for k, known in enumerate(frequencies.T):
            first = known[np.flatnonzero(np.isfinite(known))[:1]]
            change = np.where(np.nanmax(known) > 1e-6 * top, known - first, np.nan)
            every = (k, frequencies.shape[1] * max(1, len(speeds) // 24))
            for axes, values in zip(panel.axes, (known, change), strict=True):
                curve(axes, speeds, values, mode_look(k, modes.names[k]), markevery=every, markersize=4.0)
        panel.axes[0].set_ylim(0.0, top)
        panel.axes[0].set_ylabel("frequency (rad/s)")
        panel.axes[1].set_ylabel("change (rad/s)")
        return panel

    def damping(self) -> Panels:
        """Plot damping ratios and growth rates (1/s) over rotor speed. Raises InputError without speeds."""
        modes = self._rotation()
        panel = panels((2.0, 2.0), SPEED_AXIS)
        curves = {"damping ratio": modes.damping_ratios, "growth rate (1/s)": modes.growth_rates}
        for axes, (label, numbers) in zip(panel.axes, curves.items(), strict=True):
            for k, values in enumerate(numbers.T):
                curve(axes, modes.speeds, values, replace(mode_look(k, modes.names[k]), marker=""))
            axes.set_ylabel(label)
        return panel

    def multipliers(self) -> Panels:
        """Plot moduli of the Floquet multipliers over rotor speed. Raises InputError if there are none."""
        table = self._modes.floquet
        if table is None:
            raise InputError(f"{self._modes.scene}: no Floquet multipliers; they need gravity and speeds above 0")
        panel = panels((2.6,), SPEED_AXIS)
        axes = panel.axes[0]
        sizes = np.abs(table.multipliers)
        shown = np.where(sizes > 0.0, sizes, np.nan)
        for k, sizes_of_one in enumerate(shown.T):
            look = Look(BLUE, "", "o", "" if k else "each")
            curve(axes, table.speeds, sizes_of_one, look, markersize=2.0, markerfacecolor=BLUE)
        curve(axes, table.speeds, table.largest, Look(VERMILLION, "-", "", "largest"), 1.5)
        axes.axhline(1.0, color=GREY, linewidth=0.8)
        known = sizes[np.isfinite(sizes) & (sizes > 0.0)]
        if len(known) and known.max() / known.min() > 10.0:
            log_axis(axes, float(known.min()), float(known.max()))
        elif len(known) and known.max() / known.min() < 1.0 + 10.0 * GROWTH:
            axes.set_ylim(0.9, 1.1)
        axes.set_ylabel("modulus of the multipliers")
        return panel

    def _rotation(self) -> LinearModes:
        for linear in self._modes.rotation.values():
            return linear
        raise InputError(f"{self._modes.scene}: no modes over speed; allowed: modes computed with speeds")


def mode_look(index: int, name: str) -> Look:
    """Line and marker of a mode: equal frequencies lie on each other, so that each mode has its own marker."""
    return replace(coordinate_look(index, name), marker=_MARKS[index % len(_MARKS)])


def modes_page(modes: Sequence[SceneModes]) -> dict[str, object]:
    """The content of the page: a part for each scene, of which each id is unique on the page."""
    parts = []
    for place, scene in enumerate(modes):
        name, plots = f"scene{place}", ModePlots(scene)
        rest, rotation = (next(iter(kind.values()), None) for kind in (scene.rest, scene.rotation))
        campbell: list[Picture] = []
        fastest: list[PageTable] = []
        if rotation is not None and not np.isnan(rotation.growth_rates).all():
            last = len(rotation.speeds) - 1
            fastest = _tables(rotation, last, f"{scene.scene}, {number(float(rotation.speeds[last]), 4)} rad/s")
            if last > 0:
                caption = "Damped frequencies in the rotor's frame; 1P, 2P: multiples of the rotor speed"
                campbell.append(picture(plots(), f"{name}-campbell", caption))
                if (
                    max(np.nanmax(np.abs(rotation.damping_ratios), initial=0.0), np.nanmax(rotation.growth_rates))
                    > 1e-9
                ):
                    campbell.append(picture(plots.damping(), f"{name}-damping", "Damping ratios and growth rates"))
        turning: list[Picture] = []
        if scene.floquet is not None and len(scene.floquet.speeds) > 1 and np.isfinite(scene.floquet.largest).any():
            caption = "Floquet multipliers in rotation under gravity; above 1 the motion is unstable"
            turning.append(picture(plots.multipliers(), f"{name}-multipliers", caption))
        sources = max((list(kind.values()) for kind in (scene.rest, scene.rotation)), key=len)
        parts.append({
            "id": name,
            "modes": scene,
            "models": [f"{linear.label} ({linear.source})" for linear in sources],
            "notes": scene.notes,
            "rest": Section(tables=[] if rest is None else _tables(rest, 0, f"{scene.scene}, at rest")),
            "campbell": Section(campbell),
            "fastest": Section(tables=fastest),
            "turning": Section(turning, [] if scene.floquet is None else [_multipliers(scene.scene, scene.floquet)]),
        })  # fmt: skip
    return {"scenes": parts}


def _multipliers(scene: str, table: FloquetTable) -> PageTable:
    rows: list[Row] = []
    for i, (speed, largest) in enumerate(zip(table.speeds.tolist(), table.largest.tolist(), strict=True)):
        text = "unknown" if table.stable[i] == -1 else _shown(largest, 7)
        cell = TableCell(text, "bad" if table.stable[i] == 0 else "", note=table.messages[i])
        numbers = ((table.growth_rates, 4), (table.product_error, 2), (table.torque, 4))
        rows.append([number(speed, 4), cell, *(_shown(float(values[i]), digits) for values, digits in numbers)])
    head = ("Speed (rad/s)", "largest multiplier", "growth rate (1/s)", "product minus trace", "torque (N m)")
    return PageTable(f"{scene}: multipliers", head, rows)


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
    head = ("Shape", "rotor", *multiblade(linear.blades)[0])
    shape_caption = f"{state}: shapes, the largest amplitude 1"
    return [PageTable(caption, ("Mode", *columns), frequencies), PageTable(shape_caption, head, shapes)]


def _shown(value: float, digits: int) -> str:
    if not math.isfinite(value):
        return NOTHING
    return number(0.0 if abs(value) < 1e-12 else value, digits)
