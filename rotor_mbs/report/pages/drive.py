"""What drives a scene: torque and power at the shaft; pitches, their commands and the power of their actuators."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from rotor_mbs.analysis.rehydrate import scene_of
from rotor_mbs.report.core.canvas import Panels
from rotor_mbs.report.core.elements import LegendEntry, PageTable, Picture, Section
from rotor_mbs.report.core.looks import GREY, VERMILLION, Look, coordinate_look
from rotor_mbs.report.core.numbers import prefixed, with_unit
from rotor_mbs.report.core.svg import picture
from rotor_mbs.report.plots.time_histories import Series, lines
from rotor_mbs.runs.read import StoredRun, StoredScene
from rotor_mbs.scenario.time_table import Table, value_at
from rotor_mbs.solution.trajectory import Array

_COMMAND, _TAKEN = Look(GREY, ":", ""), Look(VERMILLION, "--", "")


def drive_section(stored: StoredScene, run: StoredRun | None) -> Section:
    """Empty where nothing drives the scene, or the run lacks angles or rates."""
    scene = scene_of(stored)
    if scene is None or run is None or "rates" not in run or "angles" not in run or not len(run.array("time")):
        return Section()
    time, angles, rates = run.array("time"), run.array("angles"), run.array("rates")
    pictures: list[Picture] = []
    legend: list[LegendEntry] = []
    rows: list[list[str]] = []
    if scene.has_torque:
        torque = _over(time, scene.rotor_torque)
        powers = [Series(time, torque * rates[:, 0], coordinate_look(0))]
        rows.append(["Torque on the rotor", *_numbers(torque, "N m"), ""])
        rows.append(["Its power", *_numbers(powers[0].values, "W"), _work(powers[0])])
        if scene.shaft_damping:
            powers.append(Series(time, scene.shaft_damping * rates[:, 0] ** 2, _TAKEN))
            rows.append(["Taken by the shaft's damper", *_numbers(powers[1].values, "W"), _work(powers[1])])
            legend.append(LegendEntry("torque on the rotor", coordinate_look(0)))
            legend.append(LegendEntry("taken by the shaft's damper", _TAKEN))
        panels = _from_zero([("torque (N m)", [Series(time, torque, coordinate_look(0))]), ("power (W)", powers)])
        pictures.append(picture(panels, "drive", "Rotor torque and its power"))
    driven = [i for i in range(len(scene.blades)) if any(scene.pitch_load(i))]
    if driven:
        pitches = [Series(time, pitch, coordinate_look(1 + i)) for i, pitch in enumerate(angles.T[1:])]
        powers = []
        for i in driven:
            torque, rest = (_over(time, table) for table in scene.pitch_load(i))
            stiffness, damping = scene.bearing(i)
            moment = torque + stiffness * (rest - angles[:, 1 + i]) - damping * rates[:, 1 + i]
            power = Series(time, moment * rates[:, 1 + i], coordinate_look(1 + i))
            powers.append(power)
            if scene.pitch_load(i)[1]:
                pitches.append(Series(time, rest, _COMMAND))
            ends = (float(np.abs(angles[:, 1 + i]).max()), float(angles[-1, 1 + i]))
            rows.append([f"Pitch {i + 1}", *(with_unit(angle, "rad", 4) for angle in ends), ""])
            rows.append([f"Actuator {i + 1}, power", *_numbers(power.values, "W"), _work(power)])
        panels = _from_zero([("pitch (rad)", pitches), ("actuators' power (W)", powers)])
        pictures.append(picture(panels, "pitch-drive", "Pitches, their commands and actuators"))
        legend += [LegendEntry(f"pitch {i + 1}", coordinate_look(1 + i)) for i in range(len(scene.blades))]
        if any(scene.bearing_rest):
            legend.append(LegendEntry("command", _COMMAND))
    table = PageTable("", ("Quantity", "Largest", "At the end", "Work"), rows, numeric=(1, 2, 3))
    return Section(pictures, legend, [table] if rows else [])


def _over(time: Array, table: Table) -> Array:
    return np.array([value_at(table, t) for t in time.tolist()])


def _numbers(values: Array, unit: str) -> list[str]:
    return [prefixed(float(np.abs(values).max()), unit), prefixed(float(values[-1]), unit)]


def _work(power: Series) -> str:
    return prefixed(float(np.trapezoid(power.values, power.time)), "J")


def _from_zero(rows: Sequence[tuple[str, Sequence[Series]]]) -> Panels:
    """Panels one above the other, whose vertical axes have the zero."""
    panels = lines(rows, height=1.3)
    for axes in panels.axes:
        low, high = axes.get_ylim()
        axes.set_ylim(min(low, 0.0), max(high, 0.0))
    return panels
