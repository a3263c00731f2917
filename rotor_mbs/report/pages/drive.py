"""What drives a scene: torque and power at the shaft; pitches, their commands and the power of their actuators."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from rotor_mbs.analysis.rehydrate import scene_of
from rotor_mbs.report.core.canvas import Panels
from rotor_mbs.report.core.elements import LegendEntry, Picture, Section
from rotor_mbs.report.core.looks import GREY, VERMILLION, Look, coordinate_look
from rotor_mbs.report.core.numbers import prefixed, with_unit
from rotor_mbs.report.core.svg import picture
from rotor_mbs.report.plots.time_histories import Series, lines
from rotor_mbs.runs.read import StoredRun, StoredScene
from rotor_mbs.scenario.scene import Scene
from rotor_mbs.scenario.time_table import Table, value_at
from rotor_mbs.solution.trajectory import Array

_COMMAND, _TAKEN = Look(GREY, ":", ""), Look(VERMILLION, "--", "")


def drive_section(stored: StoredScene, run: StoredRun | None) -> Section:
    """Empty where nothing drives the scene, or the run lacks angles or rates."""
    scene = scene_of(stored)
    if scene is None or run is None or "rates" not in run or "angles" not in run or not len(run.array("time")):
        return Section()
    pictures: list[Picture] = []
    legend: list[LegendEntry] = []
    if scene.has_torque:
        pictures.append(_shaft(scene, run))
        if scene.shaft_damping:
            names = {"torque on the rotor": coordinate_look(0), "taken by the shaft's damper": _TAKEN}
            legend += [LegendEntry(name, look) for name, look in names.items()]
    driven = [i for i in range(len(scene.blades)) if any(scene.pitch_load(i))]
    if driven:
        pictures.append(_pitches(scene, run, driven))
        legend += [LegendEntry(f"pitch {i + 1}", coordinate_look(1 + i)) for i in range(len(scene.blades))]
        if any(scene.bearing_rest):
            legend.append(LegendEntry("command", _COMMAND))
    return Section(pictures, legend)


def _over(time: Array, table: Table) -> Array:
    return np.array([value_at(table, t) for t in time.tolist()])


def _shaft(scene: Scene, run: StoredRun) -> Picture:
    """Torque on the rotor above its power and what the shaft's damper takes."""
    time, spin = run.array("time"), run.array("rates")[:, 0]
    torque = _over(time, scene.rotor_torque)
    power, taken = torque * spin, scene.shaft_damping * spin**2
    work = float(np.trapezoid(power, time)) if len(time) > 1 else 0.0
    caption = f"Rotor torque and its power; work {prefixed(work, 'J')}"
    if scene.shaft_damping:
        caption += f", of which the shaft's damper takes {prefixed(float(np.trapezoid(taken, time)), 'J')}"
    most = [prefixed(float(np.abs(x).max()), unit) for x, unit in ((torque, "N m"), (power, "W"))]
    end = prefixed(float(power[-1]), "W")
    described = f"{caption}: torque up to {most[0]}, power up to {most[1]}, {end} at the end."
    curves = [Series(time, power, coordinate_look(0))]
    if scene.shaft_damping:
        curves.append(Series(time, taken, _TAKEN))
    rows = [("torque (N m)", [Series(time, torque, coordinate_look(0))]), ("power (W)", curves)]
    return picture(_from_zero(rows), "drive", caption, described)


def _pitches(scene: Scene, run: StoredRun, driven: list[int]) -> Picture:
    """Pitches with their commands, above the power of the actuators (torque, spring and damper) on the blades."""
    time, angles, rates = run.array("time"), run.array("angles")[:, 1:], run.array("rates")[:, 1:]
    pitches = [Series(time, x, coordinate_look(1 + i)) for i, x in enumerate(angles.T)]
    powers, ends = [], []
    for i in driven:
        torque, rest = (_over(time, table) for table in scene.pitch_load(i))
        stiffness, damping = scene.bearing(i)
        moment = torque + stiffness * (rest - angles[:, i]) - damping * rates[:, i]
        powers.append(Series(time, moment * rates[:, i], coordinate_look(1 + i)))
        ends.append(f"pitch {i + 1} ends at {with_unit(float(angles[-1, i]), 'rad', 4)}")
        if scene.pitch_load(i)[1]:
            pitches.append(Series(time, rest, _COMMAND))
    most = prefixed(max(float(np.abs(one.values).max()) for one in powers), "W")
    described = f"Pitches and the power of their actuators: {'; '.join(ends)}; power up to {most}."
    rows = [("pitch (rad)", pitches), ("actuators' power (W)", powers)]
    return picture(_from_zero(rows), "pitch-drive", "Pitches, their commands and actuators", described)


def _from_zero(rows: Sequence[tuple[str, Sequence[Series]]]) -> Panels:
    """Panels one above the other, whose vertical axes have the zero."""
    panels = lines(rows, height=1.3)
    for axes in panels.axes:
        low, high = axes.get_ylim()
        axes.set_ylim(min(low, 0.0), max(high, 0.0))
    return panels
