"""Run scenes and parameter studies in Python: `rm.run`, `rm.sweep`, and what they return."""

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
from collections.abc import Iterable, Iterator, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass
from html import escape
from itertools import islice
from pathlib import Path
from typing import TYPE_CHECKING, Any, overload

import numpy as np

from rotor_mbs.analysis.judgement import defects_of
from rotor_mbs.analysis.text_tables import (
    MOST_ROWS,
    RUN_HEAD,
    TextTable,
    method_table,
    run_row,
    sweep_parameters,
)
from rotor_mbs.errors import InputError, MethodRefusal, ResourceError, StoreError, shown_value
from rotor_mbs.methods.catalogue import REFERENCE, check_names, problems_of_scene, selected_methods
from rotor_mbs.methods.method_file import ENDING
from rotor_mbs.methods.time_limit import valid_seconds
from rotor_mbs.processes.pool import check_workers
from rotor_mbs.runs.design import COLUMNS, MISSING
from rotor_mbs.runs.hdf5 import reading
from rotor_mbs.runs.merge import copy_file
from rotor_mbs.runs.progress import progress_of_call
from rotor_mbs.runs.read import StoredRun, is_sweep, open_results, run_names
from rotor_mbs.runs.sweeps import StoredSweep, parameter_name
from rotor_mbs.scenario.catalogue import list_scenes, only_scene, scene_of
from rotor_mbs.scenario.keys import counted
from rotor_mbs.scenario.scene import Scene, load_scene
from rotor_mbs.scenario.toml_file import file_path, plain_value
from rotor_mbs.solution.defects import Defects
from rotor_mbs.solution.metrics import METRICS
from rotor_mbs.solution.status import STATUSES
from rotor_mbs.solution.trajectory import Solution, Trajectory
from rotor_mbs.studies.run import run_scenes, solve_judged

if TYPE_CHECKING:
    from rotor_mbs.report.plots import ComparisonPlots, RunPlots

_NO_LIMIT_S = 1e9
_SHOWN = 5  # lines of lost runs


def scenes(folder: str = "") -> list[str]:
    """List the names of the shipped scenes, or of those in one folder.

    Parameters
    ----------
    folder : name of a folder, such as "paper"; by default all.

    Raises
    ------
    InputError
        If there is no such folder.

    Examples
    --------
    >>> import rotor_mbs as rm
    >>> rm.scenes("paper")[:3]
    ['paper/fig03', 'paper/fig04b', 'paper/fig05']
    """
    beginning = os.fsdecode(folder).rstrip("/")
    names = [name for name, _ in list_scenes() if not folder or name.startswith(f"{beginning}/")]
    if not names:
        allowed = ", ".join(sorted({name.partition("/")[0] for name, _ in list_scenes()}))
        raise InputError(f"no shipped scenes in {shown_value(folder)}; allowed: {allowed}")
    return names


def scene(name: str) -> Scene:
    """Return a shipped scene, or the scene in a TOML file.

    Parameters
    ----------
    name : of a shipped scene, or the path of a TOML file.

    Raises
    ------
    InputError
        If there is no such scene; the message has the most similar name.
    TypeError
        If `name` is neither text nor a path.

    Examples
    --------
    >>> import rotor_mbs as rm
    >>> scene = rm.scene("paper/fig11")
    >>> scene.title, len(scene.blades), scene.gravity
    ('Three pitched blades, rotor at 30 degrees and pi/10 rad/s', 3, 9.8)
    >>> scene.replace(gravity=9.81, **{"initial.angles[1]": 0.3}).initial_angles[1]
    0.3
    """
    return only_scene(os.fsdecode(name))


def load(path: str | os.PathLike[str]) -> Scene:
    """Read a scene from a TOML file; its name is that of the file.

    Implausible numbers, such as 30 rad, cause a PlausibilityWarning. Raises InputError with one
    line per error in the file, TypeError if `path` is neither text nor a path.
    """
    return load_scene(file_path(path), check=problems_of_scene, stacklevel=3)


@overload
def run(  # type: ignore[overload-overlap]
    scene: Scene | str | os.PathLike[str],
    method: str = ...,
    *,
    timeout: float = ...,
    reference: bool = ...,
    workers: int = ...,
    progress: bool | None = ...,
    **settings: object,
) -> Run: ...


@overload
def run(
    scene: Scene | str | os.PathLike[str],
    method: Sequence[str],
    *,
    timeout: float = ...,
    reference: bool = ...,
    workers: int = ...,
    progress: bool | None = ...,
    **settings: object,
) -> Runs: ...


def run(
    scene: Scene | str | os.PathLike[str],
    method: str | Sequence[str] = "lagrange/taylor",
    *,
    timeout: float = float("inf"),
    reference: bool = False,
    workers: int = 0,
    progress: bool | None = None,
    **settings: object,
) -> Run | Runs:
    """Simulate a scene with one or more methods, and determine the status from the samples.

    Parameters
    ----------
    scene : Scene or str
        A Scene, the name of a shipped scene, or a TOML file.
    method : str or sequence of str
        "model/integrator", as listed by `rotor-mbs list`, or a Python file that defines methods
        ("mine.py"), see docs/your-engine.md. For an empty list, methods are selected by the same
        rule as in `rotor-mbs run`.
    timeout : float
        Time limit in s for run, reference and assessment of a method. A run that exceeds it has the
        status "timed_out" and the samples computed so far. Loading and compilation, and up to 1 s
        of assessment, are not included.
    reference : bool
        Whether to compute the quad-precision reference (up to some seconds) if none is shipped.
        With several methods it is always computed. Without a reference the status follows from the
        samples and the energy balance.
    workers : int
        Number of worker processes for several methods; 0: everything runs in this process.
    progress : bool, optional
        Whether to show the progress of several methods. By default on a terminal and in a notebook.
    **settings
        Settings of the methods. `rotor-mbs show METHOD` lists names, units, ranges and defaults.

    Returns
    -------
    Run
        For one method. For several, `Runs` by method name, including the reference.

    Raises
    ------
    InputError
        For an unknown method, an unknown setting, or one that is not allowed, a limit or a number
        of workers out of range, or if one of several methods cannot represent the scene.
    TypeError
        For any other argument of a wrong type, such as a text in place of a number.
    MethodRefusal
        If the method cannot represent the scene or is not installed.
    ResourceError
        If a worker process died or could not be started.

    Examples
    --------
    >>> import rotor_mbs as rm
    >>> run = rm.run(rm.scene("paper/fig08"), "lagrange/dop853", relative_tolerance=5e-14)
    >>> run.status
    'ok'
    >>> run.metrics["angle_error_max"] < 1e-9   # rad, to the scene's horizon
    True
    >>> scene = rm.scene("paper/fig08").replace(duration=1.0, samples=101)
    >>> runs = rm.run(scene, ["lagrange/dop853", "exudyn_tree/rk67"])
    >>> [run.status for run in runs.values()]
    ['ok', 'ok', 'ok']
    >>> data = runs.to_xarray()
    >>> float(abs(data.angles - data.angles.sel(run="reference")).max()) < 1e-9   # rad
    True
    """
    scene, timeout = scene_of(scene), valid_seconds(timeout)
    check_workers(workers)
    if isinstance(method, str):
        if method.endswith(ENDING):
            method, *others = check_names(method)
            if others:
                raise InputError(
                    f"method: the file has {', '.join([method, *others])}; allowed: a list, "
                    "[FILE], for all"
                )
        solution, exact = solve_judged(
            scene, method, settings, compute_reference=reference, time_limit_s=timeout
        )
        return Run(**vars(solution), reference=exact)
    chosen, _, refused = selected_methods([scene], check_names(texts(method)), settings)
    if asked := [str(refusal) for refusal in refused if refusal.is_asked]:
        raise InputError(asked)
    if not chosen[scene.name]:
        raise MethodRefusal("\n".join(map(str, refused)))
    folder = TemporaryFolder()
    path = folder.path / "runs.h5"
    with progress_of_call(progress) as on_progress:
        report = run_scenes(
            [scene],
            chosen,
            path,
            workers=workers,
            timeout_s=min(timeout, _NO_LIMIT_S),
            settings=settings,
            on_progress=on_progress,
        )
    refuse_losses([f"{run.label}: {run.message}" for run in report.not_computed])
    return Runs(path, scene.name, _folder=folder)


@dataclass(repr=False)
class Run(Solution):
    """A run: a scene simulated with one method.

    In addition to the members of `Solution` (`time`, `angles`, `rates`, `run["tip"]`, `status`,
    `message`, `metrics`, `settings`, `to_xarray()`):

    Attributes
    ----------
    reference : the reference trajectory; None without a reference.
    plot : `run.plot()` draws the motion; `run.plot.energy()`, `.error()`, `.tips()`,
        `.loads("shaft_force")`.
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
        """Return the plots of the run; called, it draws the motion."""
        from rotor_mbs.report.plots import RunPlots  # late: matplotlib

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
        with suppress(InputError):  # without samples, or without angles and rates
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


def sweep(
    scene: Scene | str | os.PathLike[str],
    parameters: Mapping[str, object],
    *,
    methods: str | Sequence[str] = ("lagrange/taylor",),
    output: str | os.PathLike[str] | None = None,
    workers: int = 0,
    timeout: float = 60.0,
    fresh: bool = False,
    progress: bool | None = None,
    **options: object,
) -> Runs:
    """Run a parameter study: simulate a scene for all combinations of parameter values.

    All runs are stored in one dataset.

    Parameters
    ----------
    scene : a Scene, the name of a shipped scene, or a TOML file.
    parameters : for each key of a number in a scene file, such as "bearing.stiffness" or
        "initial.angles[1]", a list of values or a table as in an [[axis]] of a sweep file, such as
        `{"uniform": [0.0, 1.0]}`.
    methods : name of a method, or a list of names; or Python files that define methods.
    output : file of the dataset. A repeated call continues it after an interruption. Default: a
        temporary file.
    workers : number of worker processes; 0: everything runs in this process.
    timeout : time limit of each run (s).
    fresh : whether stored runs are recomputed. By default they are kept, including those of other
        versions.
    progress : whether to show the progress. By default on a terminal and in a notebook.
    **options : other keys of a sweep file: samples, outputs, draws, seed, combine, validation,
        settings, ...

    Returns
    -------
    Runs
        By run number.

    Raises
    ------
    InputError
        For an invalid key, value or option, or if `output` is not the file of this sweep.
    MethodRefusal
        If a method cannot represent the scene, or some of its variants; the other runs are stored
        in `output`.
    TypeError
        For an argument of a wrong type, and a value or option that no sweep file can have, such as
        None.
    ResourceError
        If worker processes died or could not be started; the other runs are stored in `output`.

    Examples
    --------
    >>> import rotor_mbs as rm
    >>> scene = rm.scene("paper/fig08").replace(duration=1.0, samples=101)
    >>> axes = {"bearing.stiffness": [0.0, 1e3, 1e4]}
    >>> runs = rm.sweep(scene, axes, methods=["lagrange/dop853"], samples=11)
    >>> runs.statuses
    {'ok': 3}
    >>> runs.to_xarray().angles.dims
    ('run', 'time', 'coordinate')
    >>> runs.to_xarray(unstack=True).angles.sel(bearing_stiffness=1e3, coordinate="pitch 1").dims
    ('time',)
    """
    from rotor_mbs.runs.engines import open_task_pool
    from rotor_mbs.scenario.sweep import sweep_of
    from rotor_mbs.studies.sweep import plan_sweep, run_sweep

    scene, timeout = scene_of(scene), min(valid_seconds(timeout), _NO_LIMIT_S)
    check_workers(workers)
    names = list(check_names(methods if isinstance(methods, str) else texts(methods)))
    study = sweep_of(scene, plain_value({**parameters}), methods=names, **plain_value(options))
    if output is None:
        folder = TemporaryFolder()
        path = folder.path / "sweep.h5"
    else:
        folder, path = None, file_path(output)
    plan = plan_sweep(study, time_limit_s=timeout)
    if plan.refused:
        raise MethodRefusal("\n".join(map(str, plan.refused)))
    with open_task_pool("local", workers) as pool, progress_of_call(progress) as shown:
        result = run_sweep(plan, path, pool, shown.runs, fresh=fresh)
    if result.refused:
        raise MethodRefusal("\n".join(result.refused))
    refuse_losses(result.lost)
    return Runs(path, _folder=folder)


def texts(values: Iterable[str]) -> list[str]:
    """Return the texts of an iterable as a list; raise TypeError for an entry that is no text."""
    listed = list(values)
    "".join(listed)  # refuses an entry that is no text
    return listed


def refuse_losses(lost: Sequence[str]) -> None:
    """Raise ResourceError if requested runs could not be computed.

    Parameters
    ----------
    lost : a line for each such run; the message has the first of them.
    """
    if lost:
        more = [f"... ({len(lost)} in all)"] if len(lost) > _SHOWN else []
        raise ResourceError("\n".join([*lost[:_SHOWN], *more]))


class TemporaryFolder:
    """A temporary folder that is removed with the last object that refers to it."""

    def __init__(self) -> None:
        self.path = Path(tempfile.mkdtemp(prefix="rotor_mbs-"))
        weakref.finalize(self, shutil.rmtree, self.path, ignore_errors=True)


class Runs(Mapping[Any, Any]):
    """A mapping from label to `Run`, for the runs of a file; a run is read on access.

    Labels are method names (and "reference") for one scene, "paper/fig11/lagrange/taylor" for a
    file with several scenes, and run numbers for a sweep. `runs["paper/fig11"]` returns the runs of
    one scene of a file.

    Parameters
    ----------
    path : Path
        The file. It is open only during reading.
    scene : str
        The scene; "" for all scenes of the file.

    Attributes
    ----------
    plot : plots of the runs of one scene: `runs.plot.error()`, `.rotor()`, `.energy_error()`.
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
        _folder : the temporary folder of the file, which is kept as long as these runs.

        Raises
        ------
        StoreError
            If the file cannot be read, or has no such scene.
        """
        self.path, self.scene, self._folder = file_path(path), os.fsdecode(scene), _folder
        self._is_sweep = is_sweep(self.path)
        self._labels: dict[Any, tuple[str, str]] = {}  # scene and method by label, in this order
        if self._is_sweep:
            stored = self._sweep.column("status") != MISSING
            self._labels = dict.fromkeys(self._sweep.column("run")[stored].tolist(), ("", ""))
        else:
            names = run_names(self.path)
            if self.scene and self.scene not in dict(names):
                allowed = ", ".join(dict(names))
                raise StoreError(
                    f"{self.path}: has no scene {shown_value(self.scene)}; allowed: {allowed}"
                )
            for name, method in names:
                if self.scene in ("", name):
                    self._labels[method if self.scene else f"{name}/{method}"] = name, method

    def __reduce__(self) -> tuple[Any, ...]:
        """Return the arguments of `_restored`, for a copy or a pickle.

        The content of a temporary file is among them, so that the copy has a file of its own.
        """
        return _restored, (
            self.path,
            self.scene,
            self.path.read_bytes() if self._folder is not None else None,
        )

    def __getitem__(self, label: Any) -> Any:
        """Return the run with a label, or the runs of a scene.

        Parameters
        ----------
        label : see the class; of one scene also with the name of the scene before the method.

        Raises
        ------
        KeyError
            If the file has no such run.
        StoreError
            If its samples cannot be read.
        """
        # "paper/fig11/lagrange/taylor", as in a file of several scenes
        if self.scene and isinstance(label, str):
            label = label.removeprefix(f"{self.scene}/")
        if label not in self._labels:
            if not self._is_sweep and label in self.scenes:
                return Runs(self.path, label, _folder=self._folder)
            available = ", ".join(map(str, islice(self._labels, 20)))
            raise KeyError(f"{shown_value(label)}; available: {available}")
        if self._is_sweep:
            with reading(self.path):
                return _loaded(self._sweep.scene_of(int(label)), self._sweep.run(int(label)), None)
        name, method = self._labels[label]
        with open_results(self.path, only=[name]) as results:
            if name not in results.scenes or method not in results.scenes[name].runs:
                raise StoreError(
                    f"{self.path}: has no {name}/{method} any more: another file has taken its "
                    "place"
                )
            scene = results.scenes[name]
            reference = None if method == REFERENCE else scene.reference_trajectory
            return _loaded(scene.scene, scene.runs[method], reference)

    def __iter__(self) -> Iterator[Any]:
        return iter(self._labels)

    def __len__(self) -> int:
        return len(self._labels)

    @property
    def scenes(self) -> list[str]:
        """Return the names of the scenes in the order of the file; for a sweep its base scene."""
        if self._is_sweep:
            return [str(self._sweep.attributes["base_scene"])]
        return list(dict.fromkeys(scene for scene, _ in self._labels.values()))

    @functools.cached_property
    def statuses(self) -> dict[str, int]:
        """Return the number of stored runs with each status."""
        if self._is_sweep:
            codes = self._sweep.column("status").tolist()
            return dict(Counter(STATUSES[code] for code in codes if code != MISSING))
        return dict(Counter(run.status for run in self._runs()))

    @functools.cached_property
    def _sweep(self) -> StoredSweep:
        """Read and verify the dataset of a sweep, once."""
        return StoredSweep(self.path)

    def _runs(self) -> Iterator[StoredRun]:
        with open_results(self.path, only=[self.scene] if self.scene else None) as results:
            for scene in results.scenes.values():
                yield from scene.runs.values()

    def table(self) -> TextTable:
        """Return a table with a row per run, or for a sweep with a row per status.

        A run has its status, error (rad), energy drift (relative to the energy scale) and run time
        (s).
        """
        if self._is_sweep:
            counts: list[tuple[str, ...]] = [
                (status, str(count)) for status, count in self.statuses.items()
            ]
            return TextTable(("status", "runs"), counts)
        rows = []
        with open_results(self.path, only=[self.scene] if self.scene else None) as results:
            for scene in results.scenes.values():
                before = () if self.scene else (scene.label,)
                rows += [(*before, *run_row(run)) for run in scene.runs.values()]
        return TextTable(RUN_HEAD if self.scene else ("scene", *RUN_HEAD), rows)

    @property
    def plot(self) -> ComparisonPlots:
        """Return the plots of the runs of one scene.

        Raises InputError for several scenes or a sweep.
        """
        from rotor_mbs.report.plots import ComparisonPlots  # late: matplotlib

        if self._is_sweep:
            raise InputError(
                "plot: of a sweep only that of a run, runs[0].plot(), or the pages, to_html(FOLDER)"
            )
        if not self.scene:
            raise InputError(
                f"plot: only of the runs of one scene, such as runs[{self.scenes[0]!r}]"
            )
        reference = self[REFERENCE].trajectory if REFERENCE in self else None
        return ComparisonPlots({name: self[name] for name in self if name != REFERENCE}, reference)

    def column(self, name: str) -> Any:
        """Return an array of a sweep, (runs, ...), such as "status", "pitch_max" or "angles".

        Raises StoreError if the sweep has no such array.
        """
        return np.array(self._sweep.column(name))

    def at(self, name: str, sample: int) -> Any:
        """Return a trajectory of a sweep, such as "angles", at one sample of all runs.

        Raises StoreError for another quantity or sample, TypeError if `sample` is no whole number.
        """
        sample = operator.index(sample)
        values, count = self._sweep.column(name), len(self._sweep.column("time"))
        if "time" not in self._sweep.columns[name].dimensions or sample not in range(-count, count):
            allowed = f"a quantity over time, samples 0 to {count - 1}"
            raise StoreError(f"{name}, sample {shown_value(sample)}: allowed: {allowed}")
        return np.array(values[:, sample])

    def to_xarray(self, *, unstack: bool = False) -> Any:
        """Return the runs as xarray objects with units, long names and labels.

        Parameters
        ----------
        unstack : bool
            Whether each varied parameter of a grid sweep becomes a dimension in place of `run`.

        Returns
        -------
        xarray.Dataset
            For one scene or a sweep (opened lazily), with the dimension `run`. Select by label:
            `data.angles.sel(run="lagrange/taylor", coordinate="pitch 1")`, `data.tip.sel(blade=1,
            axis="y")`.
        xarray.DataTree
            For a file with several scenes, opened lazily.

        Raises
        ------
        StoreError
            If a run of a sweep is damaged.
        InputError
            If a sweep that is no grid is to be unstacked.
        """
        import xarray  # late: 0.4 s

        if not self._is_sweep and not self.scene:
            return xarray.open_datatree(self.path)
        if self._is_sweep:
            data = _labelled(xarray.open_dataset(self.path))
            names = np.array(self._sweep.methods)[self._sweep.column("method_code")]
            data = data.assign_coords(method_name=("run", names))
            if unstack:
                keys = [parameter_name(key) for key in self._sweep.keys]
                keys += ["method_name"] if len(self._sweep.methods) > 1 else []
                if len(keys) == 1:
                    return data.swap_dims(run=keys[0]).drop_vars("run")
                values = [data[key].values.tolist() for key in keys]
                # Unstacked, a missing combination would be NaN, and one that occurs twice has no
                # place.
                combinations = len(set(zip(*values, strict=True)))
                if (
                    not combinations
                    == len(data.run)
                    == math.prod(len(set(of_key)) for of_key in values)
                ):
                    what = (
                        f"the {len(data.run)} runs are not every combination of {', '.join(keys)}, "
                        "once each"
                    )
                    raise InputError(f"unstack: {what}; allowed: the sweep of a grid")
                data = data.set_index(run=keys).unstack("run")
            return data
        with xarray.open_dataset(self.path, group=self.scene) as scene:
            data = _labelled(scene.load())
        return data.assign(status=("run", [run.status for run in self._runs()]))

    def save(self, path: str | os.PathLike[str]) -> Path:
        """Save a copy of the file, which `rotor-mbs report` and `rotor_mbs.open` read.

        An earlier copy is replaced if no run in it is lost. Raises InputError for files with other
        runs or of another kind, StoreError for files that are damaged or not of this program,
        TypeError if `path` is neither text nor a path.
        """
        target = file_path(path)
        copy_file(self.path, target)
        return target

    def to_html(self, folder: str | os.PathLike[str]) -> Path:
        """Write the report pages into a folder, and return the path of the index."""
        from rotor_mbs.report.build import write_report  # late: templates

        return write_report(self.path, file_path(folder))

    def __repr__(self) -> str:
        return f"{self._headline()}\n{self._short_table()}"

    def _repr_html_(self) -> str:
        drawn = ""
        with suppress(InputError):  # of several scenes, without a reference or without angles
            drawn = self.plot.error()._repr_svg_()
        return f"<p>{escape(self._headline())}</p>{self._short_table()._repr_html_()}{drawn}"

    def _headline(self) -> str:
        counts = ", ".join(f"{count} {status}" for status, count in self.statuses.items())
        place = self._scene_label or str(self.path)
        if self._is_sweep and self._folder is not None:  # a temporary file's path says nothing
            place = f"sweep of {self._sweep.base_scene.label}"
        return f"{place}: {counted(len(self), 'run')}: {counts}"

    @functools.cached_property
    def _scene_label(self) -> str:
        """Return the scene's name with the changes to a shipped one.

        It is "" for several scenes and for a sweep.
        """
        if self._is_sweep or not self.scene:
            return ""
        with open_results(self.path, only=[self.scene]) as results:
            return results.scenes[self.scene].label

    def _short_table(self) -> TextTable:
        """Return a table for a screen.

        With many runs it has a row per method, for a sweep its parameters.
        """
        if self._is_sweep:
            return sweep_parameters(self._sweep)
        if len(self) <= MOST_ROWS:
            return self.table()
        with open_results(self.path, only=[self.scene] if self.scene else None) as results:
            return method_table(
                run for scene in results.scenes.values() for run in scene.methods.values()
            )


def _restored(path: Path, scene: str, content: bytes | None) -> Runs:
    if content is None:
        return Runs(path, scene)
    folder = TemporaryFolder()
    own = folder.path / path.name
    own.write_bytes(content)
    return Runs(own, scene, _folder=folder)


def _labelled(data: Any) -> Any:
    """Return a dataset whose coordinates and axes have names instead of numbers."""
    labels = {}
    if "coordinate" in data.coords:
        labels["coordinate"] = list(np.atleast_1d(data.coordinate.attrs["labels"]))
    if "axis" in data.coords:
        labels["axis"] = ["x", "y", "z"]
    return data.assign_coords(labels)


def _loaded(scene: Scene, stored: StoredRun, reference: Trajectory | None) -> Run:
    """Return a stored run as a `Run`. Raises StoreError if its arrays cannot be used."""
    solution = stored.solution(scene)
    if solution is None:
        raise StoreError(f"{stored.scene}/{stored.method}: {'; '.join(stored.faults(scene))}")
    return Run(**vars(solution), reference=reference)
