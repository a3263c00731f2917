"""Make the page, and the figures, of a comparison of another program's data with a scene."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
from markupsafe import Markup

from rotor_mbs.comparison.channels import channel_key
from rotor_mbs.comparison.verdict import (
    ChannelErrors,
    DataVerdict,
    axis_unit,
    channel_table,
    unused_lines,
    verdict_of,
)
from rotor_mbs.errors import InputError
from rotor_mbs.report import canvas, plots
from rotor_mbs.report.canvas import Panels
from rotor_mbs.report.elements import (
    Curve,
    Element,
    Fact,
    Fold,
    Grid,
    Horizontal,
    Legend,
    Listing,
    Mark,
    Note,
    PageContent,
    PageTable,
    Plot,
    Row,
    Section,
    TableCell,
)
from rotor_mbs.report.looks import GREY, INK, PALETTE, Look, coordinate_look, with_capital
from rotor_mbs.report.numbers import (
    SPACE,
    seconds,
    shortest,
    typeset,
    typeset_title,
    up_to,
    with_unit,
)
from rotor_mbs.report.pages import scene_plots as draw
from rotor_mbs.report.plots import Series
from rotor_mbs.runs.read import Record
from rotor_mbs.scenario.keys import counted
from rotor_mbs.solution.defects import FLOOR_SAFETY

_REFERENCE = Look(PALETTE["reference"][0], "-", "", "reference")
# Smallest visible difference, as a share of the range of a plot: about the line width of the
# reference.
_SEEN = 0.02
_CHANNELS_SHOWN = 8  # number of plots of channels that are shown; further plots are folded


def comparison_page(record: Record) -> PageContent:
    """Return the content of the page of a comparison.

    It has the verdict, the onset of a fault, plots, a table of channels, and how the data were
    read.

    Parameters
    ----------
    record : the stored comparison.
    """
    verdict = verdict_of(record)
    is_time = verdict.axis == "time"
    onset = onset_of(record, verdict)
    marks = _marks(record, verdict, onset)
    sections = [_table_section(record, verdict), _reading_section(verdict)]
    if len(record.arrays[verdict.axis]) > 1:  # a curve needs two points
        shown = [
            _channel_section(record, verdict, marks),
            _error_section(record, verdict, marks),
        ]
        if onset is not None and not _is_seen(record, verdict):
            shown.reverse()
        sections = [*shown, *sections]
    rows = counted(verdict.rows, "row")
    about = f"{typeset_title(record.attributes['title'])} · {rows}"
    facts = [
        Fact(
            "Verdict",
            "✓ agrees" if verdict.agrees else f"✗ {verdict.status}",
            tone="good" if verdict.agrees else "bad",
        )
    ]
    if onset is not None:
        name = "First outside the tolerance" if is_time else "First speed outside the tolerance"
        facts.append(Fact(name, _place(onset[0], verdict), onset[1]))
    largest = max(verdict.channels, key=lambda channel: channel.error_max, default=None)
    # A single row of a motion is its initial state, whose error says nothing of the equations.
    if largest is not None and (verdict.rows > 1 or not is_time):
        facts.append(
            Fact("Largest error", with_unit(largest.error_max, largest.unit), largest.name)
        )
    compared = rows
    if verdict.horizon_s is not None and verdict.horizon_s < verdict.compared_until:
        compared += f"; errors checked up to the horizon at {seconds(verdict.horizon_s)}"
    facts.append(Fact("Compared up to", _place(verdict.compared_until, verdict), compared))
    title = (
        f"{Path(verdict.source).name} against {record.attributes.get('scene_label', verdict.scene)}"
    )
    return PageContent(title, about, comparison_answer(verdict, onset), facts, sections)


def comparison_answer(verdict: DataVerdict, onset: tuple[float, str] | None) -> list[Markup]:
    """Return sentences on whether the data agree, the onset of a difference, and probable causes.

    Parameters
    ----------
    verdict : the verdict of the comparison.
    onset : see `onset_of`.
    """
    if verdict.agrees:
        defects = [channel.defect for channel in verdict.channels if channel.defect is not None]
        text = Markup("The data <b>agree</b> with {}").format(verdict.scene)
        if defects and not any(defects):
            text += " to the rounding of their own digits"
        elif defects:
            text += Markup(
                ": beyond rounding no channel differs by more than <b>{}</b>, allowed {}"
            ).format(up_to(max(defects)), shortest(verdict.tolerance))
        sentences = [text + "."]
    elif onset is not None:
        text = Markup(
            '<span class="bad">The data differ from {}</span> from <b>{}</b> on, first in {}.'
        )
        sentences = [text.format(verdict.scene, _place(onset[0], verdict), onset[1])]
    else:
        sentences = [Markup('<span class="bad">The data are {}</span>.').format(verdict.status)]
    good = [channel.name for channel in verdict.channels if _tone(channel, verdict) == "good"]
    if not verdict.agrees and good and len(good) < len(verdict.channels):
        sentences.append(
            Markup("{} within the tolerance: {}.").format(
                "Channel" if len(good) == 1 else "Channels", ", ".join(good)
            )
        )
    if verdict.message:
        sentences.append(Markup("{}.").format(with_capital(typeset(verdict.message.rstrip(".")))))
    for cause in verdict.likely[:2]:
        sentences.append(Markup("Probable cause: <b>{}</b>.").format(typeset(cause)))
    return sentences


def _is_outside(channel: ChannelErrors, verdict: DataVerdict) -> bool:
    """Return whether a channel is outside the tolerance by an error of its own.

    The defect of such a channel is beyond the tolerance. A wrong value in one coordinate also
    causes defects in coordinates that follow the reference. If some channel departs from the
    reference, a channel that follows it is therefore not outside. A channel that cannot be judged
    is not outside.

    Parameters
    ----------
    channel : the channel to be judged, one of `verdict.channels`.
    verdict : the verdict of the comparison, with the tolerance and the errors of all channels.
    """

    def is_beyond(size: float | None) -> bool:
        return size is not None and not size <= verdict.tolerance

    is_explained = any(
        is_beyond(other.defect) and is_beyond(other.error_whole) for other in verdict.channels
    )
    return is_beyond(channel.defect) and (is_beyond(channel.error_whole) or not is_explained)


def _tone(channel: ChannelErrors, verdict: DataVerdict) -> str:
    """Return "good" for a channel within the tolerance, "bad" for a channel that is outside.

    Return "" if a defect follows from another channel's error, or no defect is known.

    Parameters
    ----------
    channel, verdict : see `_is_outside`.
    """
    if _is_outside(channel, verdict):
        return "bad"
    is_within = channel.defect is not None and channel.defect <= verdict.tolerance
    return "good" if is_within else ""


def _is_seen(record: Record, verdict: DataVerdict) -> bool:
    """Return whether data and reference visibly differ in the plot of some channel.

    Parameters
    ----------
    record : the stored comparison, with the data and the errors of each row.
    verdict : the verdict of the comparison; channels within the tolerance do not count.
    """
    for channel in verdict.channels:
        name = channel_key(channel.name)
        if not _is_outside(channel, verdict) or f"{name}_error" not in record.arrays:
            continue
        data = np.asarray(record.arrays[name], float)
        errors = np.abs(record.arrays[f"{name}_error"])
        known = data[np.isfinite(data)]
        if np.nanmax(errors, initial=0.0) > _SEEN * np.ptp(known if len(known) else np.zeros(1)):
            return True
    return False


def onset_of(record: Record, verdict: DataVerdict) -> tuple[float, str] | None:
    """Return the first time, or speed, at which a channel is outside the tolerance, and its name.

    For an angle or a rate, the time is the beginning of the first interval with a defect beyond
    tolerance and rounding. For a load or a frequency, it is the first row with such an error, or
    the first speed. The result is None if no channel is outside.

    Parameters
    ----------
    record : the stored comparison, with the defects and errors of each row.
    verdict : the verdict of the comparison.
    """
    rows = record.arrays[verdict.axis]
    found: list[tuple[float, str]] = []
    for channel in verdict.channels:
        if not _is_outside(channel, verdict):
            continue
        allowed = verdict.tolerance + FLOOR_SAFETY * (channel.floor or 0.0)
        name = channel_key(channel.name)
        if f"{name}_defect" in record.arrays:
            sizes = np.abs(record.arrays[f"{name}_defect"])
        elif f"{name}_error" in record.arrays:
            reference = np.abs(record.arrays.get(f"{name}_reference", np.ones(1)))
            largest = float(reference[np.isfinite(reference)].max(initial=0.0)) or 1.0
            scale = 1.0 if channel.defect_unit == channel.unit else largest
            sizes = np.abs(record.arrays[f"{name}_error"]) / scale
        else:
            continue
        outside = np.flatnonzero(~(sizes <= allowed) & ~np.isnan(sizes))
        if len(outside):
            # A defect belongs to the interval that ends in its row.
            first = int(outside[0])
            if f"{name}_defect" in record.arrays:
                first = max(first - 1, 0)
            found.append((float(rows[first]), channel.name))
    return min(found) if found else None


def _place(value: float, verdict: DataVerdict) -> str:
    """Return a time, or a speed, as text with at most four digits and its unit."""
    return f"{shortest(float(f'{value:.4g}'))}{SPACE}{axis_unit(verdict)}"


def _axis_of(record: Record, verdict: DataVerdict) -> Horizontal:
    rows = record.arrays[verdict.axis]
    first, last = (float(rows[0]), float(rows[-1])) if len(rows) else (0.0, 1.0)
    last = max(last, first + 1e-12)
    if verdict.axis == "time":
        return Horizontal("time", "s", "t", first, last)
    return Horizontal("rotor speed", "rad/s", "speed", first, last)


def _marks(record: Record, verdict: DataVerdict, onset: tuple[float, str] | None) -> list[Mark]:
    """Return marks of the onset, if there is one, and of the horizon if it is within the data."""
    marks = [] if onset is None else [Mark("first outside", onset[0])]
    horizon, axis = verdict.horizon_s, _axis_of(record, verdict)
    if horizon is not None and axis.first < horizon < axis.last:
        marks.append(Mark("horizon", horizon))
    return marks


def _channel_section(record: Record, verdict: DataVerdict, marks: Sequence[Mark]) -> Section:
    """Return the section with the plots of each channel's data over the reference.

    Channels outside the tolerance come first.

    Parameters
    ----------
    record : the stored comparison, with the rows of the data.
    verdict : the verdict of the comparison.
    marks : marks of onset and horizon; only the first plot has their texts.
    """
    rows, axis = record.arrays[verdict.axis], _axis_of(record, verdict)
    plots: list[Plot] = []
    channels = sorted(verdict.channels, key=lambda channel: not _is_outside(channel, verdict))
    for channel in channels:
        name = channel_key(channel.name)
        curves = []
        if f"{name}_reference" in record.arrays:
            reference = record.arrays[f"{name}_reference"]
            curves.append(Curve("reference", _REFERENCE, rows, np.asarray(reference, float)))
        data = np.asarray(record.arrays[name], float)
        curves.append(Curve("data", Look(INK, "-", "", "data"), rows, data))
        clip = None
        if len(curves) == 2:
            # Data that run away are cut off, so that the reference can be seen.
            clip = draw.range_of(curves[0].y, data)
        if clip is None and verdict.axis == "time":
            clip = draw.settled_range(rows, [curve.y for curve in curves])
        state = " · outside the tolerance" if _is_outside(channel, verdict) else ""
        plots.append(
            Plot(
                with_capital(channel.name),
                f"{channel.unit}{state}",
                axis,
                curves,
                170,
                clip=clip,
                # only the first plot has the texts of the marks
                marks=marks if not plots else [Mark("", mark.x) for mark in marks],
                still=len(plots) < 2,
            )
        )
    drawn = {curve.key: curve.look for plot in plots for curve in plot.curves}
    legend = Legend(list(drawn.items()))
    first, others = plots[:_CHANNELS_SHOWN], plots[_CHANNELS_SHOWN:]
    elements: list[Grid | Fold | Element] = [legend, Grid(2, [[plot] for plot in first])]
    if others:
        elements.append(
            Fold("Other channels", str(len(others)), [Grid(2, [[plot] for plot in others])])
        )
    heading = (
        "Data and reference"
        if verdict.axis == "time"
        else "Frequencies of the data and of the reference"
    )
    say = "" if verdict.axis == "time" else "Horizontally: rotor speed (rad/s)."
    return Section("channels", heading, elements if plots else [], say)


def _error_section(record: Record, verdict: DataVerdict, marks: Sequence[Mark]) -> Section:
    """Return the section with the plots of errors and of interval defects with the tolerance.

    Parameters
    ----------
    record : the stored comparison, with the errors and defects of each row.
    verdict : the verdict of the comparison.
    marks : marks of onset and horizon.
    """
    rows, axis = record.arrays[verdict.axis], _axis_of(record, verdict)
    channels = _drawn(verdict)
    errors: list[Curve] = []
    defects: list[Curve] = []
    for channel in channels:
        look = replace(_look(channel), label=channel.name)
        for ending, curves in (("_error", errors), ("_defect", defects)):
            if f"{channel_key(channel.name)}{ending}" not in record.arrays:
                continue
            sizes = draw.positive(_array(record, channel, ending))
            known = np.isfinite(sizes)
            if known.any():
                # A line needs two adjacent samples: single samples are drawn as dots.
                dots = "" if (known[1:] & known[:-1]).any() else "only"
                curves.append(Curve(channel.name, look, rows, sizes, dots=dots))
    plots: list[list[Element]] = []
    if errors:
        plots.append([Plot("Error", channels[0].unit, axis, errors, 240, log=True, marks=marks)])
    if defects:
        allowed = [
            *marks,
            Mark(f"tolerance {shortest(verdict.tolerance)} rad", y=verdict.tolerance),
        ]
        note = "including the rounding of the data"
        plots.append(
            [Plot("Interval defect", "rad", axis, defects, 240, note, log=True, marks=allowed)]
        )
    drawn = {curve.key: curve.look for curve in (*errors, *defects)}
    elements: list[Grid | Element] = [Legend(list(drawn.items())), Grid(len(plots), plots)]
    if not plots:
        elements = []
    if channels and all(channel.error_whole == 0.0 for channel in channels):
        elements.append(Note(f"Error: 0 {channels[0].unit} in all rows."))
    say = (
        (
            "The defect of an interval tells where in time the data depart from the equations of "
            "motion."
        )
        if defects
        else ""
    )
    return Section("errors", "Errors", elements, say)


def _table_section(record: Record, verdict: DataVerdict) -> Section:
    """Return the section with the table of channels, one row per channel.

    Parameters
    ----------
    record : the stored comparison; its loads are the channels without interval defects.
    verdict : the verdict of the comparison.
    """
    table = channel_table(verdict)
    rows: list[Row] = []
    for channel, (name, error, defect, *others) in zip(verdict.channels, table.rows, strict=True):
        tone = _tone(channel, verdict)
        sign = {"good": "✓ ", "bad": "✗ "}.get(tone, "")
        rows.append([name, error, TableCell(f"{sign}{typeset(defect)}", tone), *others])
    heading = "Channels up to the horizon" if verdict.axis == "time" else "Channels"
    head = tuple(with_capital(text) for text in table.head)
    elements: list[Element] = [PageTable("Channels", head, rows, wide=(3, 5))]
    has_loads = any(
        f"{channel_key(channel.name)}_defect" not in record.arrays for channel in verdict.channels
    )
    if verdict.axis == "time" and has_loads:
        elements.append(Note("Loads: compared in all rows with those at the states of the data."))
    return Section("table", heading, elements)


def _reading_section(verdict: DataVerdict) -> Section:
    """Return the section on how the data were read: columns used and not used, and notes.

    Parameters
    ----------
    verdict : the verdict of the comparison; its third and further probable causes are notes here.
    """
    read = Listing([(place, line) for place, line in enumerate_lines(verdict.read)])
    folds: list[Fold | Grid | Element] = [
        Fold("Columns", f"{len(verdict.read)} that were read", [read])
    ]
    if verdict.unused:
        folds.append(
            Fold(
                "Columns not used",
                str(len(verdict.unused)),
                [Note(line) for line in unused_lines(verdict, 1000)],
            )
        )
    others = [*(f"Probable cause: {cause}" for cause in verdict.likely[2:]), *verdict.notes]
    if others:
        folds.append(Fold("Notes", str(len(others)), [Note(text) for text in others], is_open=True))
    return Section("columns", "How the data were read", folds)


def enumerate_lines(lines: Sequence[str]) -> list[tuple[str, str]]:
    """Split lines "what = column" into pairs; a line without " = " becomes ("", line)."""
    pairs = []
    for line in lines:
        what, _, column = line.partition(" = ")
        pairs.append((what, column) if column else ("", line))
    return pairs


def error_panels(record: Record) -> Panels:
    """Plot the error of each channel over time or rotor speed, on a logarithmic axis.

    Parameters
    ----------
    record : the stored comparison.

    Raises
    ------
    InputError
        If no channel was compared.
    """
    verdict = verdict_of(record)
    channels = _drawn(verdict)
    if not channels:
        raise InputError(f"{verdict.source}: no channel was compared; nothing to plot")
    rows = record.arrays[verdict.axis]
    series = [
        Series(rows, np.abs(_array(record, channel, "_error")), _look(channel))
        for channel in channels
    ]
    panels = plots.errors(series, f"error ({channels[0].unit})", verdict.horizon_s)
    # If no error is above zero, nothing is drawn, and the axis has no range: it is set here.
    if len(rows) and rows[-1] > rows[0]:
        panels.axes[-1].set_xlim(rows[0], rows[-1])
    if verdict.axis == "speed":
        panels.axes[-1].set_xlabel(canvas.SPEED_AXIS)
    return panels


def defect_panels(record: Record) -> Panels | None:
    """Plot the defects over time with the tolerance; return None if no channel has defects.

    Parameters
    ----------
    record : the stored comparison.
    """
    verdict = verdict_of(record)
    time = record.arrays[verdict.axis][1:]
    series = []
    for channel in _drawn(verdict):
        if channel.defect is not None and channel.defect_unit == "rad":
            series.append(
                Series(time, np.nan_to_num(_array(record, channel, "_defect")[1:]), _look(channel))
            )
    if not series:
        return None
    series.append(
        Series(time, np.full(len(time), verdict.tolerance), Look(GREY, ":", "", "tolerance"))
    )
    return plots.errors(series, "defect of an interval (rad)")


def _array(record: Record, channel: ChannelErrors, ending: str = "") -> Any:
    return record.arrays[channel_key(channel.name) + ending]


def _drawn(verdict: DataVerdict) -> Sequence[ChannelErrors]:
    """Return the channels of one plot: the angles, or all with the unit of the first channel."""
    units = [channel.unit for channel in verdict.channels]
    if not units:
        return []
    unit = "rad" if "rad" in units else units[0]
    return [channel for channel in verdict.channels if channel.unit == unit]


def _look(channel: ChannelErrors) -> Look:
    """Return the look of a channel's coordinate: the number in its name, or 0 for the rotor."""
    digits = "".join(filter(str.isdigit, channel.name))
    return coordinate_look(int(digits or 0))
