"""Hold runs in Python: a `Run` is one run, `Results` are those of a call, a sweep or a file."""

from __future__ import annotations

import functools
import math
import operator
import os
import shutil
import tempfile
import textwrap
import weakref
from collections import Counter
from collections.abc import Iterator, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass
from html import escape
from itertools import islice
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from rotor_mbs.analysis.judgement import defects_of
from rotor_mbs.analysis.text_tables import (
    MOST_ROWS,
    RUN_HEAD,
    TextTable,
    method_table,
    run_row,
    sweep_parameters,
)
from rotor_mbs.api.tables import data_frame
from rotor_mbs.errors import InputError, StoreError, shown_value
from rotor_mbs.methods.catalogue import REFERENCE
from rotor_mbs.runs.design import COLUMNS
from rotor_mbs.runs.hdf5 import CHARACTERS, Column, reading
from rotor_mbs.runs.merge import copy_file
from rotor_mbs.runs.read import StoredRuns, is_sweep, open_results
from rotor_mbs.runs.rows import text_of
from rotor_mbs.runs.sweeps import StoredSweep, parameter_name
from rotor_mbs.scenario.keys import counted
from rotor_mbs.scenario.toml_file import file_path
from rotor_mbs.solution.defects import Defects
from rotor_mbs.solution.metrics import METRICS
from rotor_mbs.solution.trajectory import Solution, Trajectory

if TYPE_CHECKING:
    from rotor_mbs.report.plots import ComparisonPlots, RunPlots


# Dimensions of the columns that have one number or one text for each run.
_OF_A_RUN = (("run",), ("run", CHARACTERS))
_JSON = ("settings", "options", "versions", "scene_hash")


@dataclass(repr=False)
class Run(Solution):
    """A run: a scene simulated with one method.

    It has the members of `Solution` (`time`, `angles`, `rates`, `run["tip"]`, `status`, `message`,
    `metrics`, `settings`, `to_xarray()`), and:

    Attributes
    ----------
    reference : the reference trajectory; None if there is no reference.
    plot : `run.plot()` draws the motion. Other plots are `run.plot.energy()`, `.error()`,
        `.tips()`, `.loads("shaft_force")`.
    """

    reference: Trajectory | None = None

    @property
    def defects(self) -> Defects | None:
        """Compute the interval defects of the run; None if they cannot be computed.

        The closed form is integrated from each sample to the next, and the run's next sample is
        subtracted. This needs two samples or more, with angles and rates.

        Examples
        --------
        >>> import rotor_mbs as rm
        >>> defects = rm.run("check/general", "lagrange/ode45").defects
        >>> defects.angles.shape, bool(defects.sizes.max() < 1e-5)
        ((150, 4), True)
        """
        return defects_of(self.scene, self.trajectory)

    @property
    def plot(self) -> RunPlots:
        """Return the plots of the run; `run.plot()` draws the motion."""
        from rotor_mbs.report.plots import RunPlots  # not at the top: it loads matplotlib

        return RunPlots(self, self.reference)

    def _metrics_shown(self) -> dict[str, str]:
        """Return the metrics with their units, as text."""
        shown = {}
        for name, value in self.metrics.items():
            unit = COLUMNS[name].units if name in COLUMNS else "1"
            shown[name] = f"{value:.3g}" if unit == "1" else f"{value:.3g} {unit}"
        return shown

    def __repr__(self) -> str:
        """Return a summary of the run with its main metrics, as text."""
        known = self._metrics_shown()
        main = [
            f"{name} {known[name]}"
            for name, value in METRICS.items()
            if value.is_main and name in known
        ]
        if not main:
            return super().__repr__()
        if len(known) > len(main):
            main.append(f"... {len(known) - len(main)} more in run.metrics")
        lines = textwrap.wrap(
            f"metrics: {', '.join(main)}", 110, initial_indent="  ", subsequent_indent="    "
        )
        return "\n".join([super().__repr__(), *lines])

    def _repr_html_(self) -> str:
        """Return a summary of the run with all metrics and a drawing, for a notebook."""
        drawn = ""
        with suppress(InputError):  # no plot without samples, or without angles and rates
            drawn = self.plot()._repr_svg_()
        cells = ""
        for name, text in self._metrics_shown().items():
            about = escape(COLUMNS[name].long_name) if name in COLUMNS else ""
            cells += (
                f"<tr><th>{escape(name)}</th><td>{escape(text)}</td><td "
                f"style='text-align:left'>{about}</td></tr>"
            )
        summary = f"<summary>{counted(len(self.metrics), 'metric')}</summary>"
        folded = f"<details>{summary}<table>{cells}</table></details>"
        return super()._repr_html_() + (folded if cells else "") + drawn


class TemporaryFolder:
    """A temporary folder that is removed with the last object that refers to it."""

    def __init__(self) -> None:
        self.path = Path(tempfile.mkdtemp(prefix="rotor_mbs-"))
        weakref.finalize(self, shutil.rmtree, self.path, ignore_errors=True)


class Results(Mapping[Any, Any]):
    """A mapping from label to `Run`, for the runs of a file; a run is read on access.

    `rm.run` with several methods and `rm.sweep` return such a mapping, and `rm.open` returns it for
    a stored results file or sweep. Labels are method names (and "reference") for one scene,
    "paper/fig11/lagrange/taylor" for a file with several scenes, and run numbers for a sweep. In a
    file with several scenes, `results["paper/fig11"]` has the runs of one scene.

    Parameters
    ----------
    path : Path
        The file. It is open only during reading.
    scene : str
        The scene; "" for all scenes of the file.

    Attributes
    ----------
    plot : plots of the runs of one scene: `results.plot.error()`, `.rotor()`, `.energy_error()`.
    scenes : names of the scenes, sorted; for a sweep, the name of the scene that is varied.
    statuses : number of stored runs with each status.
    """

    def __init__(
        self,
        path: str | os.PathLike[str],
        scene: str = "",
        *,
        _folder: TemporaryFolder | None = None,
    ) -> None:
        """Read the labels of the runs.

        Parameters
        ----------
        path, scene : see the class.
        _folder : the temporary folder of the file; it exists at least as long as this object.

        Raises
        ------
        StoreError
            If the file cannot be read, or has no such scene.
        """
        self.path, self.scene, self._folder = file_path(path), os.fsdecode(scene), _folder
        self._stored: StoredRuns | StoredSweep
        if is_sweep(self.path):
            self._stored = StoredSweep(self.path)
        else:
            self._stored = StoredRuns(self.path, self.scene)
        self._labels = dict.fromkeys(self._stored.labels)  # in this order
        self.scenes = list(self._stored.scenes)

    def __reduce__(self) -> tuple[Any, ...]:
        """Return the arguments of `_restored`, for a copy or a pickle.

        The content of a temporary file is one of the arguments, so that the copy has a file of its
        own.
        """
        content = None if self._folder is None else self.path.read_bytes()
        return _restored, (self.path, self.scene, content)

    def __getitem__(self, label: Any) -> Any:
        """Return the run with a label, or the runs of a scene.

        Parameters
        ----------
        label : see the class. For the runs of one scene, the name of the scene may precede the
            method.

        Raises
        ------
        KeyError
            If the file has no such run.
        StoreError
            If the samples of the run cannot be read.
        """
        # Accept "paper/fig11/lagrange/taylor" also in a file of one scene.
        if self.scene and isinstance(label, str):
            label = label.removeprefix(f"{self.scene}/")
        if label not in self._labels:
            if label in self._stored.subsets:
                return Results(self.path, label, _folder=self._folder)
            available = ", ".join(map(str, islice(self._labels, 20)))
            raise KeyError(f"{shown_value(label)}; available: {available}")
        with self._stored.opened_run(label) as stored:
            solution = stored.solution()
            if solution is None:
                faults = "; ".join(stored.faults())
                raise StoreError(f"{stored.scene_name}/{stored.method}: {faults}")
            return Run(**vars(solution), reference=stored.reference)

    def __iter__(self) -> Iterator[Any]:
        return iter(self._labels)

    def __len__(self) -> int:
        return len(self._labels)

    @functools.cached_property
    def statuses(self) -> dict[str, int]:
        """Return the number of stored runs with each status."""
        self._stored.verify()
        with reading(self.path):
            return dict(Counter(map(str, self._values("status"))))

    def table(self) -> Any:
        """Return a pandas DataFrame with a row per run, by label.

        The columns are all numbers and texts that are stored for a run: varied parameters, status,
        metrics, times, settings, versions. `table.attrs["defect_max"]` has the unit and a
        description of the column "defect_max": `units` and `long_name`.

        Raises
        ------
        StoreError
            If a run is damaged.
        """
        self._stored.verify()
        with reading(self.path):
            values: dict[str, Any] = {}
            about: dict[str, Column] = {}
            # Long texts, such as JSON, are the last columns.
            for name, column in sorted(self._stored.columns.items(), key=lambda c: c[0] in _JSON):
                if name not in ("run", "crc32") and column.dimensions in _OF_A_RUN:
                    shown = "method_name" if name == "method_code" else name  # names, not codes
                    values[shown], about[shown] = self._values(name), column
            return data_frame(values, about, list(self._labels))

    def column(self, name: str) -> Any:
        """Return a stored quantity of all runs, (runs, ...): "status", "pitch_max", "angles", ...

        Quantities over time are available for one scene and for a sweep. Raises StoreError if the
        file has no such quantity.
        """
        if name not in self._stored.columns:
            raise self._missing(name)
        self._stored.verify()
        return self._stored.values(name)

    def at(self, name: str, sample: int) -> Any:
        """Return a quantity over time, such as "angles", at one sample of all runs, (runs, ...).

        Raises StoreError if the file has no such quantity or sample, TypeError if `sample` is not a
        whole number.
        """
        sample, columns = operator.index(sample), self._stored.columns
        if name not in columns:
            raise self._missing(name)
        self._stored.verify()
        count = len(self._stored.values("time")) if "time" in columns else 0
        if "time" not in columns[name].dimensions[1:] or sample not in range(-count, count):
            allowed = f"a quantity over time, samples 0 to {count - 1}"
            raise StoreError(f"{name}, sample {shown_value(sample)}: allowed: {allowed}")
        return self._stored.values(name, sample)

    def _missing(self, name: str) -> StoreError:
        """Return the error to raise for a column that the file does not have."""
        allowed = ", ".join(self._stored.columns)
        return StoreError(f"{self.path}: has no {shown_value(name)}; allowed: {allowed}")

    def _values(self, name: str) -> list[Any] | NDArray[Any]:
        """Return a column of all runs, with stored characters and codes decoded as texts."""
        values, column = self._stored.values(name), self._stored.columns[name]
        if values.ndim == 2:
            return [text_of(characters) for characters in values]
        return _meanings(values, column.attributes)

    @property
    def plot(self) -> ComparisonPlots:
        """Return the plots of the runs of one scene.

        Raises InputError if these are the runs of several scenes or of a sweep.
        """
        from rotor_mbs.report.plots import ComparisonPlots  # not at the top: it loads matplotlib

        if not self.scene:
            chosen = [f"results[{name!r}]" for name in [*self._stored.subsets[:1], *self][:2]]
            raise InputError(
                f"plot: only of the runs of one scene; allowed: {'.plot, '.join(chosen)}.plot, or "
                "the pages, to_html(FOLDER)"
            )
        reference = self[REFERENCE].trajectory if REFERENCE in self else None
        return ComparisonPlots({name: self[name] for name in self if name != REFERENCE}, reference)

    def to_xarray(self, *, unstack: bool = False) -> Any:
        """Return the runs as xarray objects with units, long names and labels.

        Parameters
        ----------
        unstack : bool
            Whether each varied parameter of a grid sweep becomes a dimension in place of `run`.

        Returns
        -------
        xarray.Dataset
            For one scene, or for a sweep, which is opened lazily. It has the dimension `run`;
            statuses are texts. Select by label, for example
            `data.angles.sel(run="lagrange/taylor", coordinate="pitch 1")` or
            `data.tip.sel(blade=1, axis="y")`.
        xarray.DataTree
            For a file with several scenes, which is opened lazily.

        Raises
        ------
        StoreError
            If a run is damaged.
        InputError
            If `unstack` is true and the runs are not a grid of varied parameters.
        """
        import xarray  # not at the top: it takes 0.4 s

        self._stored.verify()
        if unstack and not self._stored.keys:
            raise InputError("unstack: nothing is varied; allowed: the sweep of a grid")
        if self._stored.group is None:
            return xarray.open_datatree(self.path)
        data = xarray.open_dataset(self.path, group=self._stored.group or None)
        if self.scene:  # load it now: another call may replace the file
            with data:
                data = data.load()
        data = _labelled(data)
        return _unstacked(data, self._stored.keys) if unstack else data

    def save(self, path: str | os.PathLike[str]) -> Path:
        """Save a copy of the file, which `rotor-mbs report` and `rotor_mbs.open` read.

        A file at `path` is replaced if none of its runs is lost. Raises InputError if that file has
        other runs or is of another kind, StoreError if it is damaged, not of this program, or
        cannot be written, TypeError if `path` is neither text nor a path.
        """
        target = file_path(path)
        copy_file(self.path, target)
        return target

    def to_html(self, folder: str | os.PathLike[str]) -> Path:
        """Write the report pages into a folder, and return the path of the index."""
        from rotor_mbs.report.build import write_report  # not at the top: it loads the templates

        return write_report(self.path, file_path(folder))

    def __repr__(self) -> str:
        return f"{self._headline()}\n{self._short_table()}"

    def _repr_html_(self) -> str:
        drawn = ""
        # There is no plot for several scenes, without a reference or without angles.
        with suppress(InputError):
            drawn = self.plot.error()._repr_svg_()
        return f"<p>{escape(self._headline())}</p>{self._short_table()._repr_html_()}{drawn}"

    def _headline(self) -> str:
        counts = ", ".join(f"{count} {status}" for status, count in self.statuses.items())
        # The path of a temporary file tells a user nothing.
        place = self._stored.title if self.scene or self._folder is not None else self.path
        # "changed: duration: 5 runs" would read as a duration of 5
        separator = "; " if ": " in str(place) else ": "
        return f"{place}{separator}{counted(len(self), 'run')}: {counts}"

    def _short_table(self) -> TextTable:
        """Return a short table for a screen.

        It has a row per run, or a row per method if there are many runs. For a sweep it has the
        varied parameters.
        """
        if isinstance(self._stored, StoredSweep):
            return sweep_parameters(self._stored)
        with open_results(self.path, only=self.scenes) as results:
            if len(self) > MOST_ROWS:
                return method_table(
                    run for scene in results.scenes.values() for run in scene.methods.values()
                )
            rows = []
            for scene in results.scenes.values():
                before = () if self.scene else (scene.label,)
                rows += [(*before, *run_row(run)) for run in scene.runs.values()]
        return TextTable(RUN_HEAD if self.scene else ("scene", *RUN_HEAD), rows)


def _restored(path: Path, scene: str, content: bytes | None) -> Results:
    if content is None:
        return Results(path, scene)
    folder = TemporaryFolder()
    own = folder.path / path.name
    own.write_bytes(content)
    return Results(own, scene, _folder=folder)


def _meanings(values: NDArray[Any], attributes: Mapping[str, Any]) -> NDArray[Any]:
    """Return the meanings of a column's codes by its CF attributes; keep values without codes."""
    if "flag_meanings" not in attributes:
        return values
    codes = np.atleast_1d(attributes["flag_values"]).tolist()
    meanings = dict(zip(codes, str(attributes["flag_meanings"]).split(), strict=True))
    return np.array([meanings[code] for code in values.tolist()], dtype=str)


def _labelled(data: Any) -> Any:
    """Return a dataset in which coordinates, axes, statuses and methods are names, not numbers."""
    labels: dict[str, Any] = {}
    if "coordinate" in data.coords:
        labels["coordinate"] = list(np.atleast_1d(data.coordinate.attrs["labels"]))
    if "axis" in data.coords:
        labels["axis"] = ["x", "y", "z"]
    if "method_code" in data:
        labels["method_name"] = "run", _meanings(data.method_code.values, data.method_code.attrs)
    statuses = _meanings(data.status.values, data.status.attrs)
    return data.assign_coords(labels).assign(status=("run", statuses))


def _unstacked(data: Any, keys: Sequence[str]) -> Any:
    """Return the dataset of a grid with a dimension for each varied parameter, in place of `run`.

    Parameters
    ----------
    data : xarray.Dataset of a sweep.
    keys : keys of the varied parameters.

    Raises
    ------
    InputError
        If the runs are not a grid.
    """
    names = [parameter_name(key) for key in keys]
    if len(set(data.method_name.values.tolist())) > 1:
        names.append("method_name")
    if len(names) == 1:
        return data.swap_dims(run=names[0]).drop_vars("run")
    values = [data[name].values.tolist() for name in names]
    # In the unstacked dataset, a missing combination would be NaN, and a combination that occurs
    # twice would have no place.
    combinations = len(set(zip(*values, strict=True)))
    size = math.prod(len(set(of_name)) for of_name in values)
    if not combinations == len(data.run) == size:
        what = (
            f"the {len(data.run)} runs are not every combination of {', '.join(names)}, once each"
        )
        raise InputError(f"unstack: {what}; allowed: the sweep of a grid")
    return data.set_index(run=names).unstack("run")
