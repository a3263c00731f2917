"""Data of another program against a scene's reference: what `rotor_mbs.compare` returns, its figures and its page."""

from __future__ import annotations

import json
import os
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from html import escape
from pathlib import Path
from typing import Any

import numpy as np

from rotor_mbs.analysis.text_tables import TextTable
from rotor_mbs.comparison.data import load_data
from rotor_mbs.comparison.modes import compare_modes
from rotor_mbs.comparison.trajectory import compare_with_reference
from rotor_mbs.comparison.verdict import DEFAULT_TOLERANCE, LEVELS, ChannelErrors, DataVerdict, from_dictionary
from rotor_mbs.methods.time_limit import valid_seconds
from rotor_mbs.report import canvas, plots
from rotor_mbs.report.canvas import Panels
from rotor_mbs.report.elements import PageTable, Picture, Row, Section, TableCell, picture
from rotor_mbs.report.files import write_page
from rotor_mbs.report.looks import GREY, Look, coordinate_look
from rotor_mbs.report.numbers import number, typeset, with_unit
from rotor_mbs.report.plots import Series
from rotor_mbs.runs.read import Record, write_records
from rotor_mbs.runs.versions import machine, versions
from rotor_mbs.scenario.catalogue import scene_of
from rotor_mbs.scenario.keys import as_float, positive
from rotor_mbs.scenario.scene import Scene
from rotor_mbs.scenario.toml_file import file_path
from rotor_mbs.solution.trajectory import need_xarray


def compare(
    data: str | os.PathLike[str] | Mapping[str, Any],
    scene: Scene | str | os.PathLike[str],
    *,
    columns: str | os.PathLike[str] | Mapping[str, Any] | None = None,
    tolerance: float = DEFAULT_TOLERANCE,
    timeout: float = 600.0,
) -> DataComparison:
    """Compare a trajectory, loads or modes of another program with a scene.

    A trajectory is compared with the reference at the times of the data, loads with those of the closed form at the
    states of the data, and a table of modes with the frequencies of the closed form.

    Parameters
    ----------
    data : a file, or arrays by name: `time` (n,) s, `angles` and `rates` (n, 1 + blades) rad and rad/s, or single
        columns such as `rotor`, `pitch_1_deg`; angles or rates may be missing. Loads by name (N, N m), see
        docs/compare.md. For modes: `speed` (m,) rad/s, `frequencies` (m, modes) rad/s. Also an `xarray.Dataset` or a
        `pandas.DataFrame` with these names.
    scene : a Scene, the name of a shipped scene, or a TOML file.
    columns : a mapping file, or a mapping with the same keys: column, unit, sign, offset of each channel, and whether
        it is wrapped. By default columns are identified by name, see `verdict.read`.
    tolerance : bound on interval defects beyond rounding of the data (rad); relative bound on loads and frequencies.
    timeout : time limit for the reference, the defects and the search for causes (s).

    Raises
    ------
    InputError
        For data that cannot be read or compared, in one line with file, column or row, and what is allowed; or if the
        reference takes longer than the time limit.
    TypeError
        If `data` or `columns` is neither a mapping nor text nor a path, `scene` neither a scene nor text nor a path, or
        a limit or a tolerance no number.

    Examples
    --------
    >>> import numpy as np
    >>> import rotor_mbs as rm
    >>> scene = rm.scene("paper/fig03")
    >>> run = rm.run(scene, "lagrange/dop853")
    >>> data = {"t": run.time, "rotor_deg": np.degrees(run.angles[:, 0])}
    >>> comparison = rm.compare(data, scene, columns={"omit": ["pitch_1"]})
    >>> comparison.status, comparison.verdict.read[1]
    ('ok', "rotor = 'rotor_deg' [deg]")
    >>> rm.compare({"t": run.time, "rotor": np.degrees(run.angles[:, 0])}, scene).likely
    ('rotor: degrees taken as rad',)
    """
    scene, timeout = scene_of(scene), valid_seconds(timeout)
    tolerance = positive("tolerance", as_float(tolerance))
    if not hasattr(data, "items"):
        data = file_path(data)
    if columns is not None and not hasattr(columns, "items"):
        columns = file_path(columns)
    foreign = load_data(data, scene, columns)
    if foreign.is_modes:
        return DataComparison(*compare_modes(foreign, scene, tolerance))
    return DataComparison(*compare_with_reference(foreign, scene, tolerance, timeout))


@dataclass(repr=False)
class DataComparison:
    """Result of `rotor_mbs.compare`. Prints as a table.

    Attributes
    ----------
    verdict : errors and verdict, see `rotor_mbs.comparison.verdict.DataVerdict`.
    record : data, reference, errors and defects, as `save` stores them.
    status, message, agrees : status, the reason if it is not "ok", and whether it is "ok".
    likely : probable causes of a difference.
    """

    verdict: DataVerdict
    record: Record

    def __post_init__(self) -> None:
        self.status, self.message = self.verdict.status, self.verdict.message
        self.agrees, self.likely = self.verdict.agrees, self.verdict.likely

    def table(self) -> TextTable:
        """Table with a row per channel: errors (rad, rad/s), end of agreement (s)."""
        return channel_table(self.verdict)

    def plot(self) -> Panels:
        """Plot the defects of each coordinate over time and the tolerance; without defects, the errors."""
        return defect_panels(self.record) or error_panels(self.record)

    def to_xarray(self) -> Any:
        """Return data, reference, errors and defects as an xarray.Dataset over time.

        Variables by channel, with units: data `pitch_1`, then `pitch_1_reference`, `pitch_1_error`, and
        `pitch_1_defect` of the interval before each row (rad). Raises InputError if xarray is not installed.
        """
        record = self.record
        variables = {
            name: (column.dimensions, record.arrays[name], {"units": column.units, "long_name": column.long_name})
            for name, column in record.columns.items()
        }
        facts = {name: record.attributes[name] for name in ("source", "status", "message", "tolerance")}
        return need_xarray().Dataset(variables, attrs={"scene": record.scene} | facts)

    def to_html(self, folder: str | os.PathLike[str]) -> Path:
        """Write the page into a folder. Returns its path."""
        page = comparison_page(self.record)
        return write_page(file_path(folder), "comparison", page, versions() | machine())

    def save(self, path: str | os.PathLike[str]) -> Path:
        """Save data, reference, errors and verdict as a results file.

        An earlier comparison is replaced. Raises InputError for other files, StoreError if it cannot be written,
        TypeError if `path` is neither text nor a path.
        """
        target = file_path(path)
        write_records(target, [self.record])
        return target

    def __repr__(self) -> str:
        """Says how columns were read, numbers by channel, and the verdict."""
        verdict = self.verdict
        lines = [f"{verdict.source}: {verdict.rows} rows against {verdict.scene}", *map("  {}".format, verdict.read)]
        if verdict.unused:
            lines.append(f"  not used: {', '.join(verdict.unused[:12])}{', ...' * (len(verdict.unused) > 12)}")
        lines += ["", str(self.table()), ""]
        if verdict.horizon_s is not None:
            lines.append(
                f"compared up to {verdict.compared_until:g} s; errors up to the horizon at {verdict.horizon_s:g} s"
            )
        lines += verdict.notes
        lines.append(f"{verdict.status}{': ' * bool(verdict.message)}{verdict.message}")
        lines += [f"probable cause: {cause}" for cause in verdict.likely]
        return "\n".join(lines)

    def _repr_html_(self) -> str:
        return (
            f"<p>{escape(self.status)} {escape(self.message)}</p>{self.table()._repr_html_()}{self.plot()._repr_svg_()}"
        )


def comparison_page(record: Record) -> dict[str, object]:
    """The content of the page: verdict, pictures, tables."""
    verdict = verdict_of(record)
    facts = [
        ("Channels compared", ", ".join(channel.name for channel in verdict.channels)),
        ("Rows", f"{verdict.rows}, up to {with_unit(verdict.compared_until, _axis_unit(verdict), 4)}"),
    ]
    if verdict.horizon_s is not None:
        facts.append(("Errors checked up to the horizon", with_unit(verdict.horizon_s, "s", 4)))
    units = dict.fromkeys(channel.defect_unit for channel in verdict.channels)
    allowed = " or ".join("rad in an interval" if unit == "rad" else unit for unit in units)
    facts.append(("Tolerance", f"{number(verdict.tolerance)} {allowed}, beyond rounding"))
    if verdict.unused:
        facts.append(("Columns not used", ", ".join(verdict.unused)))
    if verdict.message:
        facts.append(("Reason", verdict.message))
    facts += [("Probable cause", cause) for cause in verdict.likely]
    facts += [("Note", note) for note in verdict.notes]
    table = channel_table(verdict)
    rows: list[Row] = []
    for channel, (name, error, defect, *others) in zip(verdict.channels, table.rows, strict=True):
        tone = "" if channel.defect is None else "good" if channel.defect <= verdict.tolerance else "bad"
        rows.append([name, error, TableCell(typeset(defect), tone), *others])
    return {
        "verdict": verdict,
        "title": record.attributes["title"],
        "source": Path(verdict.source).name,
        "facts": facts,
        "errors": Section(_pictures(record, verdict)),
        "channels": Section(tables=[PageTable("", table.head, rows)]),
    }


def channel_table(verdict: DataVerdict) -> TextTable:
    head = ("channel", "largest error", "largest defect", *(f"within {level:g} up to" for level in LEVELS))
    rows = []
    for channel in verdict.channels:
        errors = (f"{channel.error_max:.1e} {channel.unit}", _defect(channel))
        ends = channel.agrees_until.values()
        until = ("never" if end is None else f"{end:.6g} {_axis_unit(verdict)}" for end in ends)
        rows.append((channel.name, *errors, *until))
    return TextTable(head, rows)


def _axis_unit(verdict: DataVerdict) -> str:
    return "s" if verdict.axis == "time" else "rad/s"


def verdict_of(record: Record) -> DataVerdict:
    """Return the verdict that a stored comparison has."""
    return from_dictionary(json.loads(record.attributes["verdict"]))


def error_panels(record: Record) -> Panels:
    """The error of each channel over time, on a logarithmic axis."""
    verdict, channels = verdict_of(record), _drawn(verdict_of(record))
    rows = record.arrays[verdict.axis]
    series = [Series(rows, np.abs(_array(record, channel, "_error")), _look(channel)) for channel in channels]
    panels = plots.errors(series, f"error ({channels[0].unit})", verdict.horizon_s)
    if len(rows) and rows[-1] > rows[0]:  # also where no error is above zero, so that nothing is drawn
        panels.axes[-1].set_xlim(rows[0], rows[-1])
    if verdict.axis == "speed":
        panels.axes[-1].set_xlabel(canvas.SPEED_AXIS)
    return panels


def defect_panels(record: Record) -> Panels | None:
    """The defects of each channel over time, with the tolerance; None without any."""
    verdict = verdict_of(record)
    time = record.arrays[verdict.axis][1:]
    series = []
    for channel in _drawn(verdict):
        if channel.defect is not None and channel.defect_unit == "rad":
            series.append(Series(time, np.nan_to_num(_array(record, channel, "_defect")[1:]), _look(channel)))
    if not series:
        return None
    series.append(Series(time, np.full(len(time), verdict.tolerance), Look(GREY, ":", "", "tolerance")))
    return plots.errors(series, "defect of an interval (rad)")


def _defect(channel: ChannelErrors) -> str:
    return "" if channel.defect is None else f"{channel.defect:.1e} {channel.defect_unit}"


def _array(record: Record, channel: ChannelErrors, ending: str = "") -> Any:
    return record.arrays[channel.name.replace(" ", "_") + ending]


def _drawn(verdict: DataVerdict) -> Sequence[ChannelErrors]:
    """The channels that are drawn: the angles, else the rates; of modes all."""
    units = [channel.unit for channel in verdict.channels]
    unit = "rad" if "rad" in units else units[0]
    return [channel for channel in verdict.channels if channel.unit == unit]


def _look(channel: ChannelErrors) -> Look:
    """The look of the channel's coordinate: 0 the rotor, 1 the pitch of blade 1, ..."""
    digits = "".join(filter(str.isdigit, channel.name))
    return coordinate_look(int(digits or 0))


def _pictures(record: Record, verdict: DataVerdict) -> list[Picture]:
    """Angles of the data upon those of the reference; errors; defects."""
    pictures = []
    channels, time = _drawn(verdict), record.arrays[verdict.axis]
    is_modes = verdict.axis == "speed"
    if is_modes or channels[0].unit == "rad":
        panels = canvas.panels((2.9,), canvas.SPEED_AXIS if is_modes else canvas.TIME_AXIS)
        axes = panels.axes[0]
        drawn = []
        for channel in channels:
            data, reference = _array(record, channel), _array(record, channel, "_reference")
            drawn += [data, reference]
            canvas.curve(axes, *plots.thin(time, reference), Look(GREY, "-", "", "reference"), 4.0, alpha=0.4)
            canvas.curve(axes, *plots.thin(time, data), _look(channel))
        plots.set_range(axes, np.stack(drawn, axis=1))
        axes.set_ylabel("frequency (rad/s)" if is_modes else plots.ANGLE_AXIS)
        what = "Frequencies" if is_modes else "Angles"
        pictures.append(picture(panels, "motion", f"{what} of the data and of the reference"))
    caption = "Error against the reference" + ("" if is_modes else "; vertical line: horizon")
    pictures.append(picture(error_panels(record), "errors-0", caption))
    defects = defect_panels(record)
    if defects is not None:
        caption = "Interval defects, including rounding of the data, and tolerance"
        pictures.append(picture(defects, "defects", caption))
    return pictures
