"""Run scenes and parameter studies in Python: `rm.scene`, `rm.run`, `rm.sweep`."""

from __future__ import annotations

import os
from collections.abc import Iterable, Mapping, Sequence
from typing import overload

from rotor_mbs.api.results import Results, Run, TemporaryFolder
from rotor_mbs.errors import InputError, MethodRefusal, ResourceError, shown_value
from rotor_mbs.methods.catalogue import check_names, default_method
from rotor_mbs.methods.method_file import ENDING
from rotor_mbs.methods.selection import problems_of_scene, selected_methods
from rotor_mbs.methods.time_limit import valid_seconds
from rotor_mbs.processes.pool import check_workers
from rotor_mbs.runs.progress import progress_of_call
from rotor_mbs.scenario.catalogue import list_scenes, only_scene, scene_of
from rotor_mbs.scenario.scene import Scene, load_scene
from rotor_mbs.scenario.toml_file import file_path, plain_value
from rotor_mbs.studies.run import run_scenes, solve_judged

_NO_LIMIT_S = 1e9
_SHOWN = 5  # largest number of lost runs that a message lists


def scenes(folder: str = "") -> list[str]:
    """List the names of the shipped scenes, or of those in one folder.

    Parameters
    ----------
    folder : name of a folder, such as "paper"; by default all folders.

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
    name : name of a shipped scene, or path of a TOML file.

    Raises
    ------
    InputError
        If there is no such scene; the message has the most similar name of a scene.
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
    """Read a scene from a TOML file.

    The name of the scene is the file name without its ending. Implausible numbers, such as 30 rad,
    cause a PlausibilityWarning. Raises InputError with one line per error in the file, TypeError if
    `path` is neither text nor a path.
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
) -> Results: ...


def run(
    scene: Scene | str | os.PathLike[str],
    method: str | Sequence[str] = "",
    *,
    timeout: float = float("inf"),
    reference: bool = False,
    workers: int = 0,
    progress: bool | None = None,
    **settings: object,
) -> Run | Results:
    """Simulate a scene with one or more methods, and determine the status of each run.

    Parameters
    ----------
    scene : Scene or str
        A Scene, the name of a shipped scene, or a TOML file.
    method : str or sequence of str
        "model/integrator", as listed by `rotor-mbs list`, or a Python file that defines methods
        ("mine.py"), see docs/your-engine.md. By default lagrange/taylor, or lagrange/dop853 where
        heyoka is not installed. For an empty list, methods are selected as by `rotor-mbs run`
        without `-m`.
    timeout : float
        Time limit in s for the run of a method with its reference and assessment. A run that
        exceeds the limit has the status "timed_out" and the samples computed so far. Loading and
        compilation, and up to 1 s of assessment, do not count.
    reference : bool
        Whether to compute the quad-precision reference (up to some seconds) if none is shipped.
        With several methods a reference is always computed. Without a reference the status follows
        from the samples and the energy balance.
    workers : int
        Number of worker processes for several methods; 0: everything runs in this process.
    progress : bool, optional
        Whether to show the progress of several methods. By default on a terminal and in a notebook.
    **settings
        Settings of the methods. `rotor-mbs show METHOD` lists names, units, ranges and defaults.

    Returns
    -------
    Run
        For one method.
    Results
        For several methods: the runs by method name, including the reference.

    Raises
    ------
    InputError
        For an unknown method, for a setting that is unknown or not allowed, for a time limit or a
        number of workers out of range, for a file of several methods, or if one of several methods
        cannot represent the scene.
    TypeError
        For any other argument of a wrong type, such as a text in place of a number.
    MethodRefusal
        If a single method cannot represent the scene or is not installed, or if no method is left.
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
        method = method or default_method()
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
        outcomes = run_scenes(
            [scene],
            chosen,
            path,
            workers=workers,
            timeout_s=min(timeout, _NO_LIMIT_S),
            settings=settings,
            on_progress=on_progress,
        )
    refuse_losses([f"{run.label}: {run.message}" for run in outcomes if not run.is_stored])
    return Results(path, scene.name, _folder=folder)


def sweep(
    scene: Scene | str | os.PathLike[str],
    parameters: Mapping[str, object],
    *,
    methods: str | Sequence[str] = "",
    output: str | os.PathLike[str] | None = None,
    workers: int = 0,
    timeout: float = 60.0,
    fresh: bool = False,
    progress: bool | None = None,
    **options: object,
) -> Results:
    """Run a parameter study: simulate a scene for all combinations of parameter values.

    All runs are stored in one dataset.

    Parameters
    ----------
    scene : a Scene, the name of a shipped scene, or a TOML file.
    parameters : varied parameters by key in a scene file, such as "bearing.stiffness" or
        "initial.angles[1]". Each has a list of values, or a table such as `{"uniform": [0.0, 1.0]}`
        as in an [[axis]] of a sweep file.
    methods : name of a method, or a list of names; or Python files that define methods. By default
        lagrange/taylor, or lagrange/dop853 where heyoka is not installed.
    output : file of the dataset. A repeated call continues it after an interruption. By default a
        temporary file.
    workers : number of worker processes; 0: everything runs in this process.
    timeout : time limit of each run (s).
    fresh : whether stored runs are recomputed. By default all stored runs are kept, including those
        that were computed by other versions.
    progress : whether to show the progress. By default on a terminal and in a notebook.
    **options : other keys of a sweep file: samples, outputs, draws, seed, combine, validation,
        settings, ...

    Returns
    -------
    Results
        The runs by run number.

    Raises
    ------
    InputError
        For an invalid key, value or option, or if `output` is not the file of this sweep.
    MethodRefusal
        If a method cannot represent the scene: no run is computed. If a method cannot represent
        some of the scene's variants: the other runs are stored in `output`.
    TypeError
        For an argument of a wrong type, and for a value or option that a sweep file cannot have,
        such as None.
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
    if isinstance(methods, str):
        methods = methods or default_method()
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
    return Results(path, _folder=folder)


def texts(values: Iterable[str]) -> list[str]:
    """Return the texts of an iterable as a list; raise TypeError for an entry that is no text."""
    listed = list(values)
    "".join(listed)  # raises TypeError for an entry that is no text
    return listed


def refuse_losses(lost: Sequence[str]) -> None:
    """Raise ResourceError if requested runs could not be computed.

    Parameters
    ----------
    lost : a line for each lost run; the message has the first lines.
    """
    if lost:
        more = [f"... ({len(lost)} in all)"] if len(lost) > _SHOWN else []
        raise ResourceError("\n".join([*lost[:_SHOWN], *more]))
