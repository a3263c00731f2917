"""The page of data of another program against a scene's reference."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from rotor_mbs.analysis.data_verdict import LEVELS, DataVerdict
from rotor_mbs.report.core import canvas
from rotor_mbs.report.core.canvas import Panels
from rotor_mbs.report.core.elements import LegendEntry, PageTable, Picture, Row, Section, TableCell, line_entry
from rotor_mbs.report.core.files import INDEX, render, write_pages
from rotor_mbs.report.core.looks import GREY, Look, coordinate_look
from rotor_mbs.report.core.numbers import number, with_unit
from rotor_mbs.report.core.svg import picture
from rotor_mbs.report.plots import time_histories
from rotor_mbs.report.plots.time_histories import Series
from rotor_mbs.studies.compare_data import DataStudy

_ALLOWED = Look(GREY, ":", "")


def write_comparison_page(study: DataStudy, output: Path) -> Path:
    """The page into a folder; its path. Raises StoreError where it cannot be written."""
    write_pages(output, {INDEX: render("data_comparison", comparison_page(study))})
    return output / INDEX


def comparison_page(study: DataStudy) -> dict[str, object]:
    """What the template has: verdict, pictures, tables."""
    verdict = study.verdict
    return {
        "scene": verdict.scene,
        "title": study.scene.title,
        "source": Path(verdict.source).name,
        "agrees": verdict.agrees,
        "status": verdict.status,
        "lead": _lead(verdict),
        "errors": Section([*_motion(study), *_errors(study)], _legend(study)),
        "channels": Section(tables=[_table(verdict)]),
        "read": verdict.read,
        "unused": verdict.unused,
        "notes": verdict.notes,
    }


def _lead(verdict: DataVerdict) -> list[str]:
    reach = f"{verdict.rows} rows until {number(verdict.compared_until, 4)} s; judged up to the horizon at "
    reach += (
        f"{with_unit(verdict.horizon_s, 's', 4)}, tolerance {number(verdict.tolerance)} rad per unit of error growth."
    )
    sentences = [reach]
    if verdict.message:
        sentences.append(f"{verdict.message[:1].upper()}{verdict.message[1:]}.")
    if verdict.energy_drift is not None:
        sentences.append(f"Energy balance of the data: {number(verdict.energy_drift)} of the energy scale.")
    return sentences + [f"The difference looks like: {cause}." for cause in verdict.likely]


def error_panels(study: DataStudy, *, per_growth: bool = False) -> Panels:
    """The error of each channel over time, on a logarithmic axis: in rad, or per unit of growth with the tolerance.

    Angles, or rates where the data have no angles.
    """
    time, chosen = study.reference.time, _drawn(study)
    expected = np.hstack([study.reference.angles, study.reference.rates])[:, study.data.columns]
    errors = np.abs(study.data.values[: len(time)] - expected)
    if per_growth:
        errors = errors / study.carried
    series = [Series(time, errors[:, j], _look(study, j)) for j in chosen]
    if not per_growth:
        return time_histories.errors(series, f"error ({study.data.channels[chosen[0]].unit})", study.verdict.horizon_s)
    series.append(Series(time, np.full(len(time), study.verdict.tolerance), _ALLOWED))
    return time_histories.errors(series, "error per unit of growth", study.verdict.horizon_s)


def _drawn(study: DataStudy) -> list[int]:
    """Places of the channels that are drawn: the angles, else the rates."""
    angles = [j for j, channel in enumerate(study.data.channels) if channel.kind == "angle"]
    return angles or list(range(len(study.data.channels)))


def _look(study: DataStudy, j: int) -> Look:
    """Of a channel: that of its coordinate."""
    return coordinate_look(study.data.columns[j] % (1 + len(study.scene.blades)))


def _legend(study: DataStudy) -> list[LegendEntry]:
    entries = [LegendEntry(study.data.channels[j].name, _look(study, j)) for j in _drawn(study)]
    return [*entries, line_entry("tolerance", GREY, ":")]


def _errors(study: DataStudy) -> list[Picture]:
    worst = max(study.verdict.channels, key=lambda one: one.error_per_growth)
    captions = (
        "Error against the reference at the times of the data; vertical line: horizon",
        "Error per unit of error growth, up to the horizon to be below the tolerance",
    )
    texts = (
        f"Largest error up to the horizon of {worst.name}: {with_unit(worst.error_max, worst.unit)}.",
        f"The largest is {number(worst.error_per_growth)}, {worst.name}.",
    )
    return [
        picture(error_panels(study, per_growth=bool(i)), f"errors-{i}", caption, texts[i])
        for i, caption in enumerate(captions)
    ]


def _motion(study: DataStudy) -> list[Picture]:
    """Angles of the reference as lines, those of the data as marks."""
    count, data, time = 1 + len(study.scene.blades), study.data, study.reference.time
    chosen = [j for j, column in enumerate(data.columns) if column < count]
    if not chosen:
        return []
    panels = canvas.panels((2.9,), time_histories.TIME_AXIS)
    axes = panels.axes[0]
    every = max(1, len(time) // 40)
    for j in chosen:
        column = data.columns[j]
        look = coordinate_look(column)
        axes.plot(*time_histories.thin(time, study.reference.angles[:, column]), color=look.colour, linestyle=look.line)
        axes.plot(
            time[::every], data.values[: len(time) : every, j], linestyle="none", marker="o", markersize=3.6,
            markerfacecolor="none", markeredgecolor=look.colour,
        )  # fmt: skip
    time_histories.set_range(axes, np.hstack([study.reference.angles, data.values[: len(time), chosen]]))
    axes.set_ylabel(time_histories.ANGLE_AXIS)
    caption = "Angles: reference as lines, data as circles"
    return [picture(panels, "motion", caption, f"{caption}; {study.scene.title}.")]


def _table(verdict: DataVerdict) -> PageTable:
    head = (
        "Channel",
        "largest error",
        "per unit of growth",
        *(f"agrees to {number(level, 1)} until" for level in LEVELS),
    )
    rows: list[Row] = []
    for one in verdict.channels:
        good = one.error_per_growth <= verdict.tolerance
        until = [number(None) if np.isnan(time) else with_unit(time, "s", 3) for time in one.agrees_until]
        rows.append(
            [
                one.name, with_unit(one.error_max, one.unit),
                TableCell(number(one.error_per_growth), "good" if good else "bad"), *until,
                with_unit(one.lag_s, "s"), number(one.scale - 1.0), with_unit(one.offset, one.unit),
            ]
        )  # fmt: skip
    return PageTable("", (*head, "constant lag", "scale less 1", "offset"), rows, tuple(range(1, 9)))
