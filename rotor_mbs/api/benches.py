"""Measure error against run time in Python: `rm.bench`, and what it returns."""

from __future__ import annotations

import operator
import os
from collections.abc import Iterable, Iterator, Mapping
from html import escape
from pathlib import Path
from typing import Any

from rotor_mbs.analysis.text_tables import TextTable, bench_table
from rotor_mbs.api.results import TemporaryFolder
from rotor_mbs.api.runs import refuse_losses, texts
from rotor_mbs.api.tables import data_frame
from rotor_mbs.errors import InputError, MethodRefusal, shown_value
from rotor_mbs.methods.catalogue import check_names
from rotor_mbs.processes import cores
from rotor_mbs.runs.design import COLUMNS
from rotor_mbs.runs.progress import progress_of_call
from rotor_mbs.runs.read import read_records
from rotor_mbs.scenario.catalogue import scene_of
from rotor_mbs.scenario.keys import as_float, counted, positive
from rotor_mbs.scenario.scene import Scene
from rotor_mbs.scenario.toml_file import file_path


def bench(
    scene: Scene | str | os.PathLike[str],
    methods: str | Iterable[str] = (),
    *,
    output: str | os.PathLike[str] | None = None,
    repeats: int = 20,
    budget: float = 28.0,
    progress: bool | None = None,
) -> BenchCurves:
    """Measure the error of methods against their run time, over a ladder of settings.

    A ladder is a list of time steps or tolerances, from coarse to fine.

    Parameters
    ----------
    scene : a Scene, the name of a shipped scene, or a TOML file.
    methods : names of methods, or paths of Python files; by default all methods with a ladder.
    output : file for the curves; curves that it already has are not measured again. By default a
        temporary file, which is removed with the last object that refers to it.
    repeats : largest number of timed runs of a method at one setting; 1 or more.
    budget : time for all curves (s).
    progress : whether to show the progress. By default on a terminal and in a notebook.

    Returns
    -------
    BenchCurves

    Raises
    ------
    InputError
        For a wrong value, a method without a ladder, or a scene without a usable reference.
    MethodRefusal
        If a method that is named cannot represent the scene.
    TypeError
        For an argument of a wrong type.
    ResourceError
        If the process that measures curves died or could not be started; the other curves are
        stored in `output`.

    Examples
    --------
    >>> import numpy as np
    >>> import rotor_mbs as rm
    >>> scene = rm.scene("paper/fig03").replace(duration=0.5, samples=51)
    >>> curves = rm.bench(scene, "exudyn_tree/rk44", repeats=1, budget=1.0)
    >>> curve = curves["paper/fig03/exudyn_tree/rk44"]
    >>> bool(np.nanmin(curve["angle_error_max"]) < 1e-9)
    True
    """
    from rotor_mbs.studies.bench import run_bench  # not at the top: most users time nothing

    scene, budget = scene_of(scene), positive("budget", as_float(budget))
    if operator.index(repeats) < 1:
        raise InputError(f"repeats: {shown_value(repeats)}; allowed: a whole number from 1")
    names = (
        list(check_names(methods if isinstance(methods, str) else texts(methods)))
        if methods
        else []
    )
    folder = None
    if output is None:
        folder = TemporaryFolder()
        output = folder.path / "bench.h5"
    path = file_path(output)
    with progress_of_call(progress) as shown:
        outcomes, refused = run_bench(
            [scene],
            names,
            path,
            repeats=repeats,
            budget_s=budget,
            workers=cores(),
            on_progress=shown,
        )
    if refused and names:
        raise MethodRefusal("\n".join(map(str, refused)))
    refuse_losses([f"{curve.label}: {curve.message}" for curve in outcomes if not curve.is_stored])
    return BenchCurves(path, _folder=folder)


class BenchCurves(Mapping[str, Mapping[str, Any]]):
    """Curves of error against run time: a mapping from "scene/curve" to its arrays.

    The curves are read from a file that `rm.bench` or `rotor-mbs bench` wrote. An array has one
    value per setting: `curves["paper/fig11/exudyn_tree/rk67"]["angle_error_max"]` (rad),
    `["run_time_s"]` (s), `["setting"]`: a time step in s or a tolerance.
    """

    def __init__(self, path: Path, *, _folder: TemporaryFolder | None = None) -> None:
        self.path = path
        self._folder = _folder
        self._records = {
            f"{record.scene}/{record.name}": record for record in read_records(path, "bench")
        }

    def __getitem__(self, label: str) -> Mapping[str, Any]:
        return self._records[label].arrays

    def __iter__(self) -> Iterator[str]:
        return iter(self._records)

    def __len__(self) -> int:
        return len(self._records)

    def table(self) -> Any:
        """Return a pandas DataFrame with a row per point: a curve at one of its settings.

        The columns are the curve, the status, and every number that is stored for a point.
        `table.attrs["run_time_s"]` has the unit and the name of the column "run_time_s": `units`
        and `long_name`.
        """
        values: dict[str, list[Any]] = {"curve": [], "status": [], "message": []}
        for label, record in self._records.items():
            values["curve"] += [label] * len(record.statuses)
            values["status"] += record.statuses
            values["message"] += record.messages
            for name, array in record.arrays.items():
                if name not in ("status", "crc32"):
                    values.setdefault(name, []).extend(array.tolist())
        return data_frame(values, COLUMNS)

    def to_html(self, folder: str | os.PathLike[str]) -> Path:
        """Write the pages on the curves into a folder, and return the path of the index."""
        from rotor_mbs.report.build import write_report  # not at the top: it loads the templates

        return write_report(self.path, file_path(folder))

    def __repr__(self) -> str:
        return f"{self._headline()}\n{self._summary()}"

    def _repr_html_(self) -> str:
        return f"<p>{escape(self._headline())}</p>{self._summary()._repr_html_()}"

    def _summary(self) -> TextTable:
        """Return a table with a row per curve: its smallest error, run times to given errors."""
        return bench_table(list(self._records.values()))

    def _headline(self) -> str:
        """Return a heading: the path of the file unless it is temporary, the number of curves."""
        place = f"{self.path}: " if self._folder is None else ""
        return f"{place}{counted(len(self), 'curve')} of error against run time"
