"""The Python API: what `import rotor_mbs as rm` offers, on the studies that the command line runs, too.

Prints nothing. Bad input raises `rotor_mbs.errors.InputError`, an unreadable or foreign file `StoreError`.
"""

from __future__ import annotations

import functools
import os
import shutil
import tempfile
import warnings
import weakref
from collections import Counter
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from html import escape
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from rotor_mbs.analysis.rehydrate import rehydrate
from rotor_mbs.analysis.run_tables import RUN_HEAD, run_row
from rotor_mbs.errors import InputError, MethodRefusal, PlausibilityWarning, StoreError
from rotor_mbs.methods.catalogue import REFERENCE, check_names
from rotor_mbs.runs.files import replace_file
from rotor_mbs.runs.read import StoredRun, StoredScene, is_sweep, open_results
from rotor_mbs.runs.records import records_in
from rotor_mbs.runs.sweep_columns import MISSING
from rotor_mbs.scenario.catalogue import list_scenes, only_scene, scene_of
from rotor_mbs.scenario.plausibility import doubts
from rotor_mbs.scenario.scene import Scene
from rotor_mbs.scenario.scene_file import load_scene
from rotor_mbs.solution.metrics import metrics_of
from rotor_mbs.solution.solution import Solution, need_xarray
from rotor_mbs.solution.status import STATUSES
from rotor_mbs.solution.text_table import TextTable
from rotor_mbs.solution.trajectory import Trajectory
from rotor_mbs.studies.run import asked_methods, run_scenes, selected_methods, solve_judged

if TYPE_CHECKING:
    from rotor_mbs.report.run_plots import ComparisonPlots, RunPlots
    from rotor_mbs.runs.sweep_dataset import StoredSweep


def scenes(folder: str = "") -> list[str]:
    """Names of the shipped scenes, of one folder where it is named.

    Examples
    --------
    >>> import rotor_mbs as rm
    >>> rm.scenes("paper")[:3]
    ['paper/fig03', 'paper/fig04b', 'paper/fig05']
    """
    names = [name for name, _ in list_scenes() if not folder or name.startswith(f"{folder.rstrip('/')}/")]
    if not names:
        folders = sorted({name.partition("/")[0] for name, _ in list_scenes()})
        raise InputError(f"no shipped scenes in {folder!r}; allowed: {', '.join(folders)}")
    return names


def scene(name: str) -> Scene:
    """The shipped scene of that name. Raises InputError, with the nearest names, where there is none.

    Examples
    --------
    >>> import rotor_mbs as rm
    >>> scene = rm.scene("paper/fig11")
    >>> scene.title, len(scene.blades), scene.gravity
    ('Three pitched blades, rotor at 30 degrees and pi/10 rad/s', 3, 9.8)
    >>> scene.replace(gravity=9.81, **{"initial.angles[1]": 0.3}).initial_angles[1]
    0.3
    """
    return only_scene(name)


def load(path: str | os.PathLike[str]) -> Scene:
    """The scene in a TOML file, named like the file.

    Numbers that look like a slip, such as 30 rad, give a PlausibilityWarning. Raises InputError with every fault of the
    file, a line each.
    """
    found = load_scene(Path(path), Path(path).stem)
    for doubt in doubts(found):
        warnings.warn(f"{path}: {doubt}", PlausibilityWarning, stacklevel=2)
    return found


def run(
    scene: Scene | str, method: str = "lagrange/taylor", *, timeout: float = float("inf"), reference: bool = False,
    **settings: object,
) -> Run:  # fmt: skip
    """One scene by one method, in this process, judged from its samples.

    Parameters
    ----------
    scene : from `scene`, `load`, or made by `Scene.replace`; or its name, as in all functions here.
    method : "model/integrator"; `rotor-mbs show` lists those that can represent a scene.
    timeout : s, after which the integration ends itself; `Run.status` is then "timed_out".
    reference : whether to compute the quad-precision reference of a scene that has no shipped one (up to some seconds).
        Without any, the status rests on the samples and the energy balance.
    **settings : of the method, in place of its defaults; `rotor-mbs show METHOD` has names, units and ranges.

    Raises
    ------
    InputError
        For an unknown method, or a setting that the method does not have or that is out of its range.
    MethodRefusal
        Where the method cannot represent the scene, or is not installed.

    Examples
    --------
    >>> import rotor_mbs as rm
    >>> run = rm.run(rm.scene("paper/fig08"), "lagrange/dop853", relative_tolerance=1e-12)
    >>> run.status
    'ok'
    >>> run.metrics["angle_error_max"] < 1e-9   # rad, against the reference, up to the scene's horizon
    True
    """
    found, exact = solve_judged(scene_of(scene), method, settings, compute_reference=reference, time_limit_s=timeout)
    return Run(**vars(found), reference=exact)


@dataclass(repr=False)
class Run(Solution):
    """A scene by one method.

    As `Solution`: samples (`time`, `angles`, `rates`, `run["tip"]`), `status`, `message`, `metrics`, `settings`, times,
    `to_xarray()`. In addition:

    Attributes
    ----------
    reference : the trajectory it was judged against; None where there was none.
    plot : `run.plot()` draws the motion; `run.plot.energy()`, `.error()`, `.tips()`, `.loads("shaft_force")`.
    """

    reference: Trajectory | None = None

    @property
    def plot(self) -> RunPlots:
        from rotor_mbs.report.run_plots import RunPlots  # late: matplotlib

        return RunPlots(self, self.reference)

    def _repr_html_(self) -> str:
        return super()._repr_html_() + (self.plot()._repr_svg_() if len(self.time) else "")


@dataclass
class Comparison:
    """A scene by several methods, judged against its reference, in one results file.

    Attributes
    ----------
    scene, runs : the scene; a `Run` by the name of each method.
    reference : the trajectory that they were compared with.
    plot : `comparison.plot.error()`, `.rotor()`, `.energy_error()`.
    """

    scene: Scene
    runs: dict[str, Run]
    reference: Trajectory | None
    _file: Path  # in a temporary folder, removed with this object

    def __post_init__(self) -> None:
        weakref.finalize(self, shutil.rmtree, self._file.parent, ignore_errors=True)

    def __getitem__(self, method: str) -> Run:
        return self.runs[method]

    def table(self) -> TextTable:
        """A row for each method: status, error (rad), energy drift (of the energy scale), run time (s)."""
        rows = [run_row(r.method, r.status, r.metrics, float(np.median(r.run_times_s))) for r in self.runs.values()]
        return TextTable(RUN_HEAD, rows)

    @property
    def plot(self) -> ComparisonPlots:
        from rotor_mbs.report.run_plots import ComparisonPlots  # late: matplotlib

        return ComparisonPlots(self.runs, self.reference)

    def to_xarray(self) -> Any:
        """All runs as one xarray.Dataset with the dimension `solver`; samples that a run did not reach are NaN.

        Select by label: `data.angles.sel(solver="lagrange/taylor", coordinate="pitch 1")`.
        """
        xarray = need_xarray()
        over_time = [run.to_xarray().drop_dims("refined_time", errors="ignore") for run in self.runs.values()]
        solvers = xarray.Variable("solver", list(self.runs))
        joined = xarray.concat(over_time, solvers, join="outer", combine_attrs="drop_conflicts")
        return joined.assign(status=("solver", [run.status for run in self.runs.values()]))

    def save(self, path: str | os.PathLike[str]) -> Path:
        """The results file under another name; `rotor-mbs report` and `rotor_mbs.open` read it. Replaces the file."""
        target = Path(path)
        replace_file(target, self._file.read_bytes())
        return target

    def to_html(self, folder: str | os.PathLike[str]) -> Path:
        """The report's pages into a folder; the path of its index."""
        from rotor_mbs.report.build import write_report  # late: templates

        return write_report(self._file, Path(folder))

    def __repr__(self) -> str:
        return f"{self.scene.name}: {self.scene.title}\n{self.table()}"

    def _repr_html_(self) -> str:
        drawn = self.plot.error()._repr_svg_() if self.reference is not None else ""
        return f"<p>{escape(self.scene.name)}: {escape(self.scene.title)}</p>{self.table()._repr_html_()}{drawn}"


def compare(
    scene: Scene | str,
    methods: str | Sequence[str] = (),
    *,
    workers: int = 0,
    timeout: float = 60.0,
    **settings: object,
) -> Comparison:
    """One scene by several methods, each judged against the scene's reference (shipped, or computed).

    On the command line that is `rotor-mbs run SCENE -m METHOD -m METHOD`. `rotor-mbs compare` is `compare_data`.

    Parameters
    ----------
    methods : names; where none is given, those that the selection rule takes for such a scene.
    workers : parallel processes; 0 runs everything in this process. In a script, processes need the usual
        `if __name__ == "__main__":`.
    timeout : s, for each run.
    **settings : of the methods that have them, in place of defaults and of the scene's own.

    Raises
    ------
    InputError
        For an unknown method or setting, and for a method that was named and cannot represent the scene.
    MethodRefusal
        Where no method is named and the scene has no motion to be followed.

    Examples
    --------
    >>> import rotor_mbs as rm
    >>> scene = rm.scene("paper/fig08").replace(duration=1.0, samples=101)
    >>> study = rm.compare(scene, ["lagrange/dop853", "exudyn_tree/rk67"])
    >>> [run.status for run in study.runs.values()]
    ['ok', 'ok']
    >>> float(study.to_xarray().angles.sel(solver="exudyn_tree/rk67", coordinate="pitch 1").isel(time=0))
    0.7853981633974483
    """
    scene, named = scene_of(scene), check_names(methods)
    chosen, reasons = (asked_methods([scene], named), []) if named else selected_methods([scene])
    if not (able := chosen[scene.name]):
        raise MethodRefusal("; ".join(reasons))
    path = Path(tempfile.mkdtemp(prefix="rotor_mbs-")) / "comparison.h5"
    run_scenes([scene], {scene.name: able}, path, workers=workers, timeout_s=timeout, settings=settings)
    with open_results(path) as results:
        stored = results.scenes[scene.name]
        runs = {name: _loaded(stored, stored.runs[name]) for name in able}
    reference = next(iter(runs.values())).reference if runs else None
    return Comparison(scene, runs, reference, path)


def sweep(
    scene: Scene | str,
    parameters: Mapping[str, object],
    *,
    methods: str | Sequence[str] = ("lagrange/taylor",),
    output: str | os.PathLike[str] | None = None,
    workers: int = 0,
    timeout: float = 60.0,
    **options: object,
) -> SweepData:
    """One scene over all combinations of the values of its parameters, into one dataset.

    Parameters
    ----------
    parameters : by the key of a number in a scene file, such as "bearing.stiffness" or "initial.angles[1]": a list of
        values, or a table as an [[axis]] of a sweep file has it, such as `{"uniform": [0.0, 1.0]}`.
    output : the dataset's file, from which the same call continues after an interruption; a temporary one where it is
        left out.
    workers : parallel processes; 0 runs everything in this process. In a script, processes need the usual
        `if __name__ == "__main__":`.
    timeout : s, for each run.
    **options : other keys of a sweep file: samples, outputs, draws, seed, combine, validation, settings, ...

    Raises
    ------
    InputError
        For a key, value or option that is not allowed, or an output that holds something else.

    Examples
    --------
    >>> import rotor_mbs as rm
    >>> scene = rm.scene("paper/fig08").replace(duration=1.0, samples=101)
    >>> data = rm.sweep(scene, {"bearing.stiffness": [0.0, 1e3, 1e4]}, methods=["lagrange/dop853"], samples=11)
    >>> data.statuses
    {'ok': 3}
    >>> data.to_xarray().angles.dims
    ('run', 'time', 'coordinate')
    """
    from rotor_mbs.runs.cluster import open_task_pool
    from rotor_mbs.scenario.sweep import sweep_of
    from rotor_mbs.studies.sweep import plan_sweep, run_sweep

    study = sweep_of(scene_of(scene), parameters, methods=list(check_names(methods)), **options)
    path = Path(tempfile.mkdtemp(prefix="rotor_mbs-")) / "sweep.h5" if output is None else Path(output)
    plan = plan_sweep(study, time_limit_s=timeout)
    with open_task_pool("local", workers) as pool:
        run_sweep(plan, path, pool)
    data = SweepData(path)
    if output is None:
        weakref.finalize(data, shutil.rmtree, path.parent, ignore_errors=True)
    return data


@dataclass(eq=False)
class SweepData:
    """The dataset of a sweep.

    Attributes
    ----------
    path : of the file.
    statuses : how many runs have each status, of those that are stored.
    """

    path: Path

    @functools.cached_property
    def statuses(self) -> dict[str, int]:
        return dict(Counter(STATUSES[code] for code in self.column("status").tolist() if code != MISSING))

    def column(self, name: str) -> Any:
        """An array whole, such as "status", "pitch_max" or "angles": one row for each run. Raises StoreError."""
        return np.array(self._stored.column(name))

    def at(self, name: str, sample: int) -> Any:
        """(runs, ...) a trajectory, such as "angles", at one sample of all runs. Raises StoreError."""
        return np.array(self._stored.column(name)[:, sample])

    def to_xarray(self) -> Any:
        """The dataset as an xarray.Dataset, opened lazily: one variable for each parameter, with its unit.

        Raises StoreError, as `column` and `at` do, where a run is not what was written.
        """
        xarray, _ = need_xarray(), self._stored
        return xarray.open_dataset(self.path)

    @functools.cached_property
    def _stored(self) -> StoredSweep:
        """Read whole once, to verify it."""
        from rotor_mbs.runs.sweep_dataset import StoredSweep

        return StoredSweep(self.path)

    def __repr__(self) -> str:
        counts = ", ".join(f"{count} {status}" for status, count in self.statuses.items())
        return f"{self.path}: {sum(self.statuses.values())} runs: {counts}"


def open(path: str | os.PathLike[str]) -> ResultsTree | SweepData:
    """The results file at `path`: its scenes and runs by path, or the dataset of a sweep. Raises StoreError for others.

    Examples
    --------
    >>> import rotor_mbs as rm
    >>> tree = rm.open("rotor-mbs-out/results.h5")            # doctest: +SKIP
    >>> tree["paper/fig11/lagrange/taylor"].angles.shape      # doctest: +SKIP
    (1001, 4)
    """
    if is_sweep(file := Path(path)):
        return SweepData(file)
    with open_results(file) as results:
        runs = {name: tuple(scene.runs) for name, scene in results.scenes.items()}
        return ResultsTree(file, runs, tuple(name for name, _ in records_in(results.root)))


@dataclass(frozen=True)
class ResultsTree(Mapping[str, Run]):
    """A results file: a mapping from "scene/model/integrator" (or "scene/reference") to a `Run`, read when asked for.

    Attributes
    ----------
    path : of the file, which is open only while something is read.
    scenes : names of the methods (and "reference") by the name of each scene.
    records : paths of what other studies stored: curves of a bench, modes, comparisons, ...
    """

    path: Path
    scenes: Mapping[str, tuple[str, ...]]
    records: tuple[str, ...] = ()

    def __getitem__(self, name: str) -> Run:
        """Raises KeyError for what the file does not have, StoreError for samples that cannot be read."""
        scene = next((one for one in self.scenes if name.startswith(f"{one}/")), None)
        if scene is None or name.removeprefix(f"{scene}/") not in self.scenes[scene]:
            raise KeyError(f"{name}; the file has: {', '.join(self)}")
        with open_results(self.path) as results:
            stored = results.scenes[scene]
            return _loaded(stored, stored.runs[name.removeprefix(f"{scene}/")])

    def __iter__(self) -> Iterator[str]:
        return (f"{scene}/{method}" for scene, methods in self.scenes.items() for method in methods)

    def __len__(self) -> int:
        return sum(map(len, self.scenes.values()))

    def to_xarray(self) -> Any:
        """The whole file as an xarray.DataTree, opened lazily."""
        return need_xarray().open_datatree(self.path)

    def __repr__(self) -> str:
        head = f"{self.path}: {len(self.scenes)} scenes, {len(self)} runs"
        if self.records:
            head += f", {len(self.records)} records"
        return "\n".join([head, *map("  {}".format, (*self, *self.records))])


def _loaded(scene: StoredScene, stored: StoredRun) -> Run:
    """A run as it was stored; its metrics follow from its samples."""
    found = rehydrate(scene, stored)
    if found.run is None:
        raise StoreError(f"{scene.name}/{stored.method}: {'; '.join(found.faults)}")
    facts = stored.attributes
    run = Run(**vars(found.run), reference=None if stored.method == REFERENCE else found.reference)
    run.status, run.message = stored.status, str(facts.get("message", ""))
    run.metrics = metrics_of(run.scene, run.trajectory, run.reference)
    setup, seconds, output = (float(facts.get(f"{name}_time_s", 0.0)) for name in ("setup", "run", "output"))
    run.setup_time_s, run.run_times_s, run.output_time_s = setup, [seconds], output
    return run
