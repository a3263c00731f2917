"""Compare data of another program with a scene: `rm.compare`, and what it returns."""

from __future__ import annotations

import os
from collections.abc import Mapping
from dataclasses import asdict, dataclass
from html import escape
from pathlib import Path
from typing import TYPE_CHECKING, Any

from rotor_mbs.api.tables import data_frame
from rotor_mbs.comparison.data import load_data
from rotor_mbs.comparison.modes import compare_modes
from rotor_mbs.comparison.trajectory import compare_with_reference
from rotor_mbs.comparison.verdict import (
    DEFAULT_TOLERANCE,
    DataVerdict,
    channel_table,
    unused_lines,
    verdict_of,
)
from rotor_mbs.errors import StoreError
from rotor_mbs.methods.time_limit import valid_seconds
from rotor_mbs.runs.hdf5 import reading
from rotor_mbs.runs.progress import progress_of_call
from rotor_mbs.runs.read import Record, read_records, write_records
from rotor_mbs.runs.trailer import COMPARISON
from rotor_mbs.runs.versions import machine, versions
from rotor_mbs.scenario.catalogue import scene_of
from rotor_mbs.scenario.keys import as_float, counted, positive
from rotor_mbs.scenario.scene import Scene
from rotor_mbs.scenario.toml_file import file_path

if TYPE_CHECKING:
    from rotor_mbs.report.canvas import Panels


def compare(
    data: str | os.PathLike[str] | Mapping[str, Any],
    scene: Scene | str | os.PathLike[str],
    *,
    columns: str | os.PathLike[str] | Mapping[str, Any] | None = None,
    tolerance: float = DEFAULT_TOLERANCE,
    timeout: float = 600.0,
    progress: bool | None = None,
) -> DataComparison:
    """Compare a trajectory, loads or modes of another program with a scene.

    A trajectory is compared with the reference at the times of the data. Loads are compared with
    the loads of the closed form at the states of the data. A table of modes is compared with the
    frequencies of the closed form.

    Parameters
    ----------
    data : a file, or arrays by name; also an `xarray.Dataset` or a `pandas.DataFrame`. A trajectory
        has `time` (n,) s, `angles` and `rates` (n, 1 + blades) rad and rad/s, or single columns
        such as `rotor`, `pitch_1_deg`; angles or rates may be missing. Columns of loads (N, N m)
        have the names in docs/compare.md. Modes have `speed` (m,) rad/s, `frequencies` (m, modes)
        rad/s.
    scene : a Scene, the name of a shipped scene, or a TOML file.
    columns : path of a mapping file, or a dict with its keys: for each channel its column, with
        unit, sign, offset, frame, and whether whole turns are missing; also `omit`, `only`,
        `group`, `program`, `openfast`. By default columns are identified by their names;
        `verdict.read` of the result lists them.
    tolerance : rad, the largest allowed interval defect, beyond what the rounding of the data
        explains. For loads and frequencies it is the largest allowed relative error.
    timeout : time limit for the reference, the defects and the search for causes (s).
    progress : whether to show the progress. By default on a terminal and in a notebook.

    Raises
    ------
    InputError
        If the mapping or the data cannot be read, or the data cannot be compared. The message has
        one line per problem, with file, column or row, and what is allowed. Also if the reference
        and the defects take longer than the time limit.
    TypeError
        If `data` or `columns` is neither a mapping nor text nor a path, if `scene` is neither a
        scene nor text nor a path, or if `timeout` or `tolerance` is not a number.

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
    with progress_of_call(progress) as shown:
        foreign = load_data(data, scene, columns)
        if foreign.is_modes:
            return DataComparison(*compare_modes(foreign, scene, tolerance))
        return DataComparison(
            *compare_with_reference(foreign, scene, tolerance, timeout, shown.stage)
        )


def open_comparisons(path: Path) -> DataComparison | dict[str, DataComparison]:
    """Return the comparison in a file, or a dict by "scene/name" if the file has several.

    Raises StoreError if the file has no comparison or cannot be read.
    """
    comparisons = {}
    for record in read_records(path, COMPARISON):
        with reading(path):
            label = f"{record.scene}/{record.name}"
            comparisons[label] = DataComparison(verdict_of(record), record)
    if not comparisons:
        raise StoreError(
            f"{path}: no comparison in it; allowed: a file that rotor-mbs compare has written"
        )
    return comparisons if len(comparisons) > 1 else next(iter(comparisons.values()))


@dataclass(repr=False)
class DataComparison:
    """Result of `rotor_mbs.compare`; it prints as a table.

    Attributes
    ----------
    verdict : errors and verdict, see `rotor_mbs.comparison.verdict.DataVerdict`.
    record : data, reference, errors and defects, as `save` stores them.
    status, message : "ok" or another status; the reason if the status is not "ok".
    agrees : whether the status is "ok".
    likely : probable causes of a difference, in words.
    """

    verdict: DataVerdict
    record: Record

    def __post_init__(self) -> None:
        self.status, self.message = self.verdict.status, self.verdict.message
        self.agrees, self.likely = self.verdict.agrees, self.verdict.likely

    def table(self) -> Any:
        """Return a pandas DataFrame with a row per channel.

        `error_max` and `error_whole` are the largest errors up to the horizon and over all rows, in
        `unit`. `defect` is the number that is compared with the tolerance. For an angle or a rate
        it is the largest interval defect: three times the effect of rounding on each defect is
        subtracted, and the rest is divided by a factor for long intervals and error growth. For a
        load or a frequency it is the largest relative error, less three times the effect of
        rounding. `floor` is the largest estimated effect of rounding on a defect or relative error,
        not multiplied by three. The unit of `defect` and `floor` is `defect_unit`. Each column
        `within LEVEL up to` has the time (s) up to which the errors stay within the level; for
        modes the speed (rad/s).
        """
        rows = []
        for channel in self.verdict.channels:
            row = asdict(channel)
            ends = row.pop("agrees_until")
            rows.append(row | {f"within {level} up to": end for level, end in ends.items()})
        names = list(dict.fromkeys(name for row in rows for name in row))
        return data_frame({name: [row.get(name) for row in rows] for name in names}, {})

    def plot(self) -> Panels:
        """Plot the interval defects of the angles over time with the tolerance.

        If the data have no angles, plot the defects of the rates. If no interval defects are known,
        for example for a table of modes, plot the errors.
        """
        # not at the top: it loads matplotlib
        from rotor_mbs.report.pages.comparison import defect_panels, error_panels

        return (defect_panels(self.record) or error_panels(self.record)).with_legend()

    def to_xarray(self) -> Any:
        """Return data, reference, errors and defects as an xarray.Dataset over time or speed.

        The names of a channel's variables begin with the name of the channel, with "_" for blanks.
        For the channel "pitch 1", for example, the variable `pitch_1` has the data. The other
        variables are `pitch_1_reference`, `pitch_1_error`, and for angles and rates
        `pitch_1_defect` (rad), the defect of the interval before each row. Variables have units.
        """
        import xarray  # not at the top: it takes 0.4 s

        record = self.record
        variables = {
            name: (
                column.dimensions,
                record.arrays[name],
                {"units": column.units, "long_name": column.long_name},
            )
            for name, column in record.columns.items()
        }
        facts = {
            name: record.attributes[name] for name in ("source", "status", "message", "tolerance")
        }
        return xarray.Dataset(variables, attrs={"scene": record.scene} | facts)

    def to_html(self, folder: str | os.PathLike[str]) -> Path:
        """Write the page on the comparison into a folder, and return the path of the page."""
        from rotor_mbs.report.files import write_page  # not at the top: it loads the templates
        from rotor_mbs.report.pages.comparison import comparison_page

        return write_page(file_path(folder), comparison_page(self.record), versions() | machine())

    def save(self, path: str | os.PathLike[str]) -> Path:
        """Save data, reference, errors and verdict in a file that `rotor-mbs report` reads.

        An earlier comparison of the same scene and kind (trajectory or modes) is replaced; other
        comparisons in the file are kept. Raises InputError if `path` is a file of another kind,
        StoreError if it cannot be read or written, TypeError if `path` is neither text nor a path.
        """
        target = file_path(path)
        write_records(target, [self.record])
        return target

    def __repr__(self) -> str:
        """Return a text: how columns were read, the numbers of each channel, and the verdict."""
        verdict = self.verdict
        lines = [
            (
                f"{verdict.source}: {counted(verdict.rows, 'row')} against "
                f"{self.record.attributes.get('scene_label', verdict.scene)}"
            ),
            *map("  {}".format, verdict.read),
        ]
        lines += [f"  {line}" for line in unused_lines(verdict)]
        lines += ["", str(channel_table(self.verdict)), ""]
        if verdict.horizon_s is not None:
            lines.append(
                f"compared up to {verdict.compared_until:g} s; errors up to the horizon at "
                f"{verdict.horizon_s:g} s"
            )
        lines += verdict.notes
        lines.append(f"{verdict.status}{': ' * bool(verdict.message)}{verdict.message}")
        lines += [f"probable cause: {cause}" for cause in verdict.likely]
        return "\n".join(lines)

    def _repr_html_(self) -> str:
        return (
            f"<p>{escape(self.status)} "
            f"{escape(self.message)}</p>{channel_table(self.verdict)._repr_html_()}{self.plot()._repr_svg_()}"
        )
