"""The page of data of another program against a scene's reference."""

from __future__ import annotations

import json
import math
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np

from rotor_mbs.analysis.data_verdict import LEVELS, ChannelErrors, DataVerdict, from_dictionary
from rotor_mbs.report.core import canvas
from rotor_mbs.report.core.canvas import Panels
from rotor_mbs.report.core.elements import LegendEntry, PageTable, Picture, Row, Section, TableCell, line_entry
from rotor_mbs.report.core.looks import GREY, Look, coordinate_look
from rotor_mbs.report.core.numbers import number, power, with_unit
from rotor_mbs.report.core.svg import picture
from rotor_mbs.report.plots import time_histories
from rotor_mbs.report.plots.time_histories import Series
from rotor_mbs.runs.records import Record

_ALLOWED = Look(GREY, ":", "")


def comparison_page(record: Record) -> dict[str, object]:
    """What the template has: verdict, pictures, tables."""
    verdict = verdict_of(record)
    legend = [*(LegendEntry(one.name, _look(one)) for one in _drawn(verdict)), line_entry("tolerance", GREY, ":")]
    return {
        "verdict": verdict,
        "title": record.attributes["title"],
        "source": Path(verdict.source).name,
        "lead": _lead(verdict),
        "errors": Section([*_motion(record, verdict), *_errors(record, verdict)], legend),
        "channels": Section(tables=[_table(verdict)]),
    }


def verdict_of(record: Record) -> DataVerdict:
    return from_dictionary(json.loads(record.attributes["verdict"]))


def _lead(verdict: DataVerdict) -> list[str]:
    sentences = [
        f"{verdict.rows} rows until {number(verdict.compared_until, 4)} s; judged up to the horizon at "
        f"{with_unit(verdict.horizon_s, 's', 4)}, tolerance {number(verdict.tolerance)} rad per unit of error growth."
    ]
    if verdict.message:
        sentences.append(f"{verdict.message[:1].upper()}{verdict.message[1:]}.")
    if verdict.energy_drift is not None:
        sentences.append(f"Energy balance of the data: {number(verdict.energy_drift)} of the energy scale.")
    return sentences + [f"The difference looks like: {cause}." for cause in verdict.likely]


def error_panels(record: Record, *, per_growth: bool = False) -> Panels:
    """The error of each channel over time, on a logarithmic axis: in rad, or per unit of growth with the tolerance.

    Angles, or rates where the data have no angles.
    """
    verdict, time = verdict_of(record), record.arrays["time"]
    drawn = _drawn(verdict)
    series = []
    for one in drawn:
        errors = np.abs(_array(record, one, "_error"))
        scale = _array(record, one, "_growth") if per_growth else 1.0
        series.append(Series(time, errors / scale, _look(one)))
    if not per_growth:
        return time_histories.errors(series, f"error ({drawn[0].unit})", verdict.horizon_s)
    series.append(Series(time, np.full(len(time), verdict.tolerance), _ALLOWED))
    return time_histories.errors(series, "error per unit of growth", verdict.horizon_s)


def _array(record: Record, channel: ChannelErrors, ending: str = "") -> Any:
    return record.arrays[channel.name.replace(" ", "_") + ending]


def _drawn(verdict: DataVerdict) -> Sequence[ChannelErrors]:
    """The channels that are drawn: the angles, else the rates."""
    return [one for one in verdict.channels if one.unit == "rad"] or verdict.channels


def _look(channel: ChannelErrors) -> Look:
    """The look of the channel's coordinate: 0 the rotor, 1 the pitch of blade 1, ..."""
    return coordinate_look(int("".join(filter(str.isdigit, channel.name)) or 0))


def _errors(record: Record, verdict: DataVerdict) -> list[Picture]:
    worst = max(verdict.channels, key=lambda one: one.error_per_growth)
    largest = f"Largest error up to the horizon of {worst.name}: {with_unit(worst.error_max, worst.unit)}."
    caption = "Error against the reference at the times of the data; vertical line: horizon"
    absolute = picture(error_panels(record), "errors-0", caption, largest)
    largest = f"The largest is {number(worst.error_per_growth)}, {worst.name}."
    caption = "Error per unit of error growth, up to the horizon to be below the tolerance"
    return [absolute, picture(error_panels(record, per_growth=True), "errors-1", caption, largest)]


def _motion(record: Record, verdict: DataVerdict) -> list[Picture]:
    """Angles of the reference as lines, those of the data as marks."""
    chosen, time = [one for one in verdict.channels if one.unit == "rad"], record.arrays["time"]
    if not chosen:
        return []
    panels = canvas.panels((2.9,), canvas.TIME_AXIS)
    axes = panels.axes[0]
    every = max(1, len(time) // 40)
    for one in chosen:
        look = _look(one)
        canvas.curve(axes, *time_histories.thin(time, _array(record, one, "_reference")), look, 1.5)
        marks = Look(look.colour, "", "o")
        canvas.curve(axes, time[::every], _array(record, one)[::every], marks, markersize=3.6, markerfacecolor="none")
    drawn = [_array(record, one, ending) for one in chosen for ending in ("", "_reference")]
    time_histories.set_range(axes, np.stack(drawn, axis=1))
    axes.set_ylabel(time_histories.ANGLE_AXIS)
    caption = "Angles: reference as lines, data as circles"
    return [picture(panels, "motion", caption, f"{caption}; {record.attributes['title']}.")]


def _table(verdict: DataVerdict) -> PageTable:
    until = (f"agrees to {power(round(math.log10(level)))} until" for level in LEVELS)
    head = ("Channel", "largest error", "per unit of growth", *until, "constant lag", "scale less 1", "offset")
    rows: list[Row] = []
    for one in verdict.channels:
        good = one.error_per_growth <= verdict.tolerance
        times = [number(None) if np.isnan(time) else with_unit(time, "s", 3) for time in one.agrees_until]
        rows.append(
            [
                one.name, with_unit(one.error_max, one.unit),
                TableCell(number(one.error_per_growth), "good" if good else "bad"), *times,
                with_unit(one.lag_s, "s"), number(one.scale - 1.0), with_unit(one.offset, one.unit),
            ]
        )  # fmt: skip
    return PageTable("", head, rows, tuple(range(1, len(head))))
