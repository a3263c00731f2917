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


def comparison_page(record: Record) -> dict[str, object]:
    """The content of the page: verdict, pictures, tables."""
    verdict = verdict_of(record)
    legend = [LegendEntry(channel.name, _look(channel)) for channel in _drawn(verdict)]
    legend.append(line_entry("tolerance", GREY, ":"))
    return {
        "verdict": verdict,
        "title": record.attributes["title"],
        "source": Path(verdict.source).name,
        "facts": _facts(verdict),
        "errors": Section(_pictures(record, verdict), legend),
        "channels": Section(tables=[_table(verdict)]),
    }


def verdict_of(record: Record) -> DataVerdict:
    """Return the verdict that a stored comparison has."""
    return from_dictionary(json.loads(record.attributes["verdict"]))


def _facts(verdict: DataVerdict) -> list[tuple[str, str]]:
    """(what, value) that is not of one channel."""
    facts = [
        ("Rows", f"{verdict.rows}, until {with_unit(verdict.compared_until, 's', 4)}"),
        ("Judged up to the horizon", with_unit(verdict.horizon_s, "s", 4)),
        ("Tolerance", f"{number(verdict.tolerance)} rad per unit of error growth"),
    ]
    if verdict.message:
        facts.append(("Reason", verdict.message))
    if verdict.energy_drift is not None:
        facts.append(("Energy balance of the data", f"{number(verdict.energy_drift)} of the energy scale"))
    return facts + [("The difference looks like", cause) for cause in verdict.likely]


def error_panels(record: Record, *, per_growth: bool = False) -> Panels:
    """The error of each channel over time, on a logarithmic axis: in rad, or per unit of growth with the tolerance.

    Angles, or rates where the data have no angles.
    """
    verdict, time = verdict_of(record), record.arrays["time"]
    channels = _drawn(verdict)
    series = []
    for channel in channels:
        errors = np.abs(_array(record, channel, "_error"))
        scale = _array(record, channel, "_growth") if per_growth else 1.0
        series.append(Series(time, errors / scale, _look(channel)))
    if not per_growth:
        return time_histories.errors(series, f"error ({channels[0].unit})", verdict.horizon_s)
    series.append(Series(time, np.full(len(time), verdict.tolerance), Look(GREY, ":", "")))
    return time_histories.errors(series, "error per unit of growth", verdict.horizon_s)


def _array(record: Record, channel: ChannelErrors, ending: str = "") -> Any:
    return record.arrays[channel.name.replace(" ", "_") + ending]


def _drawn(verdict: DataVerdict) -> Sequence[ChannelErrors]:
    """The channels that are drawn: the angles, else the rates."""
    return [channel for channel in verdict.channels if channel.unit == "rad"] or verdict.channels


def _look(channel: ChannelErrors) -> Look:
    """The look of the channel's coordinate: 0 the rotor, 1 the pitch of blade 1, ..."""
    digits = "".join(filter(str.isdigit, channel.name))
    return coordinate_look(int(digits) if digits else 0)


def _pictures(record: Record, verdict: DataVerdict) -> list[Picture]:
    """Angles of the reference as lines, those of the data as marks; errors; errors per unit of growth."""
    pictures = []
    channels, time = [channel for channel in verdict.channels if channel.unit == "rad"], record.arrays["time"]
    if channels:
        panels = canvas.panels((2.9,), canvas.TIME_AXIS)
        axes = panels.axes[0]
        every = max(1, len(time) // 40)
        drawn = []
        for channel in channels:
            look = _look(channel)
            data, reference = _array(record, channel), _array(record, channel, "_reference")
            drawn += [data, reference]
            canvas.curve(axes, *time_histories.thin(time, reference), look, 1.5)
            marks = Look(look.colour, "", "o")
            canvas.curve(axes, time[::every], data[::every], marks, markersize=3.6, markerfacecolor="none")
        time_histories.set_range(axes, np.stack(drawn, axis=1))
        axes.set_ylabel(time_histories.ANGLE_AXIS)
        pictures.append(picture(panels, "motion", "Angles: reference as lines, data as circles"))
    caption = "Error against the reference at the times of the data; vertical line: horizon"
    pictures.append(picture(error_panels(record), "errors-0", caption))
    caption = "Error per unit of error growth, up to the horizon to be below the tolerance"
    pictures.append(picture(error_panels(record, per_growth=True), "errors-1", caption))
    return pictures


def _table(verdict: DataVerdict) -> PageTable:
    until = (f"agrees to {power(round(math.log10(level)))} until" for level in LEVELS)
    head = ("Channel", "largest error", "per unit of growth", *until, "constant lag", "scale less 1", "offset")
    rows: list[Row] = []
    for channel in verdict.channels:
        tone = "good" if channel.error_per_growth <= verdict.tolerance else "bad"
        times = [number(None) if np.isnan(time) else with_unit(time, "s", 3) for time in channel.agrees_until]
        rows.append([
            channel.name,
            with_unit(channel.error_max, channel.unit),
            TableCell(number(channel.error_per_growth), tone),
            *times,
            with_unit(channel.lag_s, "s"),
            number(channel.scale - 1.0),
            with_unit(channel.offset, channel.unit),
        ])  # fmt: skip
    return PageTable("", head, rows, tuple(range(1, len(head))))
