"""Accuracy check of a results file, or of a default set of runs, against bounds."""

from __future__ import annotations

import itertools
import math
import tempfile
from collections import Counter
from collections.abc import Collection, Iterable, Mapping, Sequence
from contextlib import ExitStack, suppress
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from rotor_mbs.analysis.checks import Check, Where, checks_of
from rotor_mbs.analysis.run_checks import bounded
from rotor_mbs.errors import InputError, StoreError
from rotor_mbs.methods.catalogue import (
    REFERENCE,
    check_names,
    default_methods,
    find_method,
    method_names,
)
from rotor_mbs.methods.method_file import ENDING
from rotor_mbs.methods.selection import supporting_methods
from rotor_mbs.runs.design import MISSING, RUNS
from rotor_mbs.runs.hdf5 import reading
from rotor_mbs.runs.output_files import is_being_written
from rotor_mbs.runs.read import is_sweep, open_results
from rotor_mbs.runs.runner import OnProgress, ignore_progress
from rotor_mbs.runs.sweeps import StoredSweep, parameter_name
from rotor_mbs.runs.table import TableFile
from rotor_mbs.scenario.accuracy_bounds import Bound, Bounds
from rotor_mbs.scenario.catalogue import changes_from_shipped, find_scenes, natural_key
from rotor_mbs.scenario.scene import Scene, scene_changes
from rotor_mbs.studies.run import run_scenes
from rotor_mbs.studies.stored_references import shipped_reference

_DEFAULT_SCENES = ("paper", "check")
_TIMEOUT_S = 60.0
AGAINST = "against"  # the name of the checks that compare with an earlier file
CHANGED = "scene"  # the name of those that compare the scenes of both
_SHOWN_CHANGES = 10  # keys of a scene
_OF_EVERY_RUN = "status"  # the name of a check that each run has one of
# A value below a few units in the last place of a double is rounding: its change says nothing.
_ROUNDING = 2.0**-50
_SHRINK = 10.0  # times by which a margin may be smaller than in an earlier file


def check_file(path: Path, bounds: Bounds, required: Sequence[str] = ()) -> list[Check]:
    """Check what is stored in a file, and that each required method has run.

    Every scene of a results file, or the sweep, must have a run of each of these methods.

    Parameters
    ----------
    path : a results file or a sweep.
    bounds : bounds of all checks.
    required : names of methods, or method files.

    Raises
    ------
    InputError
        If there is no run of a method, as in a bench file or a file of references.
    StoreError
        If the file cannot be read.
    """
    checks = judge_file(path, bounds)
    if all(check.passed and check.where.method == REFERENCE for check in checks):
        raise InputError(f"{path}: nothing to check: no run of a method")
    methods: dict[str, list[str]] = {}  # by scene
    if is_sweep(path):
        sweep = StoredSweep(path, allow_damaged_runs=True)
        codes = np.asarray(sweep.column("method_code"))[
            np.asarray(sweep.column("status")) != MISSING
        ]
        methods[checks[0].where.scene] = [sweep.methods[code] for code in np.unique(codes)]
    else:
        for check in checks:
            methods.setdefault(check.where.scene, []).append(check.where.method)
    named = [check_names(name) if name.endswith(ENDING) else (name,) for name in required]
    for name in dict.fromkeys(itertools.chain(*named)):
        for scene, stored in methods.items():
            hint = f"not in the file, which has {', '.join(dict.fromkeys(stored))}"
            checks.append(_required(scene, name, hint, is_missing=name not in stored))
    return checks


def check_default_set(
    bounds: Bounds,
    workers: int,
    on_progress: OnProgress = ignore_progress,
    methods: Sequence[str] = (),
) -> list[Check]:
    """Compute the default set of runs in a temporary file, and return their checks.

    The set is every scene of the paper by the default methods, and the scenes made for checking by
    every corrected method that is installed; or all of these scenes by the `methods` that are
    named, where they can represent them.

    Parameters
    ----------
    bounds : bounds of all checks.
    workers : parallel processes.
    on_progress : called after each run.
    methods : names; by default those described above.
    """
    paper, own = (find_scenes([folder]) for folder in _DEFAULT_SCENES)
    corrected = [name for name in method_names(is_corrected=True) if find_method(name).is_installed]
    asked: dict[str, Sequence[str]] = {}
    for scene in (*paper, *own):
        if methods:
            asked[scene.name] = supporting_methods(scene, methods, {})[0]
        else:
            asked[scene.name] = corrected if scene in own else default_methods()
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "check.h5"
        runs = run_scenes(
            [*paper, *own],
            asked,
            path,
            workers=workers,
            timeout_s=_TIMEOUT_S,
            on_progress=on_progress,
        )
        checks = [
            _required(run.scene, run.method, run.message) for run in runs if not run.is_stored
        ]
        return checks + judge_file(path, bounds)


def _required(scene: str, method: str, hint: str, *, is_missing: bool = True) -> Check:
    """Return the check that a scene has a run of a required method; it fails if that is missing."""
    return Check("required", Where(scene, method, "run"), float(is_missing), 0.0, hint, "missing")


def judge_file(path: Path, bounds: Bounds) -> list[Check]:
    """Return the checks of the runs, or the sweep, in a file; an empty list if it has neither.

    Of a sweep only completeness and integrity are checked: its runs were judged when they were
    computed.

    Parameters
    ----------
    path : a results file or a sweep.
    bounds : bounds of all checks.

    Raises
    ------
    InputError, StoreError
        If a stored scene is not valid, or the file cannot be read.
    """
    writer = (
        "; another process is writing it, or was killed while it did"
        if is_being_written(path)
        else ""
    )
    # all runs are there, and as written; their energies were judged when they were computed
    if is_sweep(path):
        sweep = StoredSweep(path, allow_damaged_runs=True)
        where = Where(str(sweep.attributes.get("base_scene", "sweep")), "*", "runs")
        missing, damaged = int((sweep.column("status") == MISSING).sum()), len(sweep.damaged_runs)
        absent = (
            f"{missing} runs missing; the sweep's own command computes them, or says why "
            f"not{writer}"
        )
        changed = (
            f"{damaged} runs changed after they were written" if damaged else "every run as written"
        )
        return [
            bounded(bounds, "complete", where, missing, "runs", absent),
            bounded(bounds, "integrity", where, damaged, "runs", changed),
        ]
    with ExitStack() as stack:
        results = stack.enter_context(open_results(path, verify=False))
        frozen = [
            shipped_reference(str(scene.attributes["scene_hash"]))
            for scene in results.scenes.values()
        ]
        shipped = [
            stack.enter_context(
                open_results(file, only=[known.scene for known in frozen if known is not None])
            )
            for file in {known.path for known in frozen if known is not None}
        ]
        with reading(path):  # within the shipped ones, which are not what is wrong
            checks = checks_of(results, shipped, bounds)
    runs = TableFile(path, [RUNS]).tables.get(RUNS)
    missing = 0 if runs is None else int((runs.column("status") == MISSING).sum())
    if missing:
        absent = f"{missing} runs missing; the command that wrote the file computes them{writer}"
        checks.append(bounded(bounds, "complete", Where("*", "*", "runs"), missing, "runs", absent))
    return checks


def runs_gone(path: Path, earlier: Path) -> Check:
    """Check that the sweep at `path` has every run of an earlier one.

    A run is found by its method and its varied numbers.

    Parameters
    ----------
    path, earlier : the sweep that is checked, and the earlier one.
    """
    new, old = (StoredSweep(place, allow_damaged_runs=True) for place in (path, earlier))
    methods = [*old.methods, *new.methods]

    def runs(sweep: StoredSweep) -> NDArray[Any]:
        is_there = np.asarray(sweep.column("status")) != MISSING
        numbers = np.array([methods.index(name) for name in sweep.methods])[
            sweep.column("method_code")
        ]
        columns = [numbers, *(sweep.column(parameter_name(key)) for key in sweep.keys)]
        return np.rec.fromarrays([column[is_there] for column in columns])

    before = runs(old)
    gone = np.isin(before, runs(new), invert=True).sum() if new.keys == old.keys else len(before)
    where = Where(str(old.attributes["base_scene"]), "*", "run: all")
    hint = f"{gone} of {len(before)} runs of the earlier file are missing in this one"
    return Check(AGAINST, where, float(gone), 0.0, hint, "runs")


def scenes_checked(path: Path | None) -> dict[str, Scene]:
    """Return the scenes of a file by name; of a sweep the one that is varied.

    Parameters
    ----------
    path : a results file or a sweep; None for the scenes of the default set.

    Raises
    ------
    InputError
        If a stored scene is not valid.
    StoreError
        If the file cannot be read.
    """
    if path is None:
        return {scene.name: scene for scene in find_scenes(_DEFAULT_SCENES)}
    if is_sweep(path):
        base = StoredSweep(path, allow_damaged_runs=True).base_scene
        return {base.name: base}
    with open_results(path, verify=False) as results:
        return {name: stored.scene for name, stored in results.scenes.items()}


def changed_scenes(
    new: Mapping[str, Scene], old: Mapping[str, Scene], *, are_allowed: bool = False
) -> list[Check]:
    """Compare the scenes that have the same name: a check for each, of how many keys differ.

    Parameters
    ----------
    new, old : scenes by name.
    are_allowed : whether scenes may differ; the differences are reported in either case.
    """
    checks = []
    for name in new.keys() & old.keys():
        changes = scene_changes(old[name], new[name])
        told = [str(change) for change in changes[:_SHOWN_CHANGES]]
        if len(changes) > _SHOWN_CHANGES:
            told.append(f"{len(changes) - _SHOWN_CHANGES} more")
        count = float(len(changes))
        hint = "as in the earlier file"
        if told:
            hint = f"{name}: {', '.join(told)}; margins of another scene are not compared"
        checks.append(
            Check(
                CHANGED,
                Where(name, "*", "keys"),
                count,
                count if are_allowed else 0.0,
                hint,
                "keys",
            )
        )
    return sorted(checks, key=lambda check: natural_key(check.where.scene))


def unused_bounds(
    entries: Iterable[Bound], checks: Sequence[Check], scenes: Mapping[str, Scene]
) -> list[Bound]:
    """Return the entries that fit no check: a misspelt method or scene would pass unnoticed.

    Parameters
    ----------
    entries : of a user's own file of bounds.
    checks : those that were made.
    scenes : that were checked, by name.
    """
    # Patterns of scenes are compared as `checks_of` does: with the names of shipped scenes alone.
    shipped = {name for name, scene in scenes.items() if changes_from_shipped(scene) == []}
    unused = []
    for entry in entries:
        fitting = (
            check
            for check in checks
            if Bounds([entry], check.where.scene if check.where.scene in shipped else "").find(
                check.name, check.where.method
            )
        )
        if next(fitting, None) is None:
            unused.append(entry)
    return unused


def judged_runs(checks: Iterable[Check]) -> Counter[str]:
    """Return the number of runs of each method that were judged.

    With it a reader of the verdict notices a run that is missing.
    """
    return Counter(
        check.where.method
        for check in checks
        if check.name == _OF_EVERY_RUN and check.where.method != REFERENCE
    )


def changed_settings(new: Path, old: Path) -> dict[tuple[str, str], str]:
    """Compare the settings of the runs that two results files have both.

    Parameters
    ----------
    new, old : results files; damaged settings are left to the check of them.

    Returns
    -------
    dict
        From scene and method to "step 0.0005 -> 0.02", where the settings differ.
    """
    found: list[dict[tuple[str, str], dict[str, Any]]] = []
    for path in (new, old):
        settings = {}
        with open_results(path, verify=False) as results:
            for name, scene in results.scenes.items():
                for method, run in scene.runs.items():
                    with suppress(StoreError):
                        settings[name, method] = run.settings
        found.append(settings)
    now, before = found
    told = {}
    for key in now.keys() & before.keys():
        words = [
            f"{name} {before[key].get(name)} -> {now[key].get(name)}"
            for name in sorted(now[key].keys() | before[key].keys())
            if now[key].get(name) != before[key].get(name)
        ]
        if words:
            told[key] = ", ".join(words)
    return told


def regressions(
    new: Sequence[Check],
    old: Sequence[Check],
    changed: Collection[str] = (),
    settings: Mapping[tuple[str, str], str] | None = None,
) -> list[Check]:
    """Return a check for each earlier one: by what factor its margin has shrunk.

    A factor above ten fails. There is also a check for each run that is missing now. The value is
    NaN, which fails, where `new` lacks the check or the run, and infinite where a check that passed
    fails. What failed before and fails now is no regression.

    Parameters
    ----------
    new, old : checks of this file and of the earlier one.
    changed : names of scenes that differ: an error of one scene says nothing of that of another,
        so only the presence of their runs is checked.
    settings : what differs between the settings of two runs, by scene and method; it is told where
        a margin shrank.
    """
    present = {(check.name, check.where): check for check in new}
    runs = {check.where[:2] for check in new}
    gone = {check.where[:2]: check for check in old if check.where[:2] not in runs}
    kept = [check for check in old if check.where[:2] in runs and check.where.scene not in changed]
    lost = [
        replace(check, name="run", where=check.where._replace(channel="all"))
        for check in gone.values()
    ]
    changes = []
    for check in [*kept, *lost]:
        now = present.get((check.name, check.where))
        if now is None:
            value, hint = math.nan, "checked in the earlier file, missing in this one"
        else:
            # Of a check that fails now: infinite if it passed before, else 1.
            value = math.inf if check.passed else 1.0
            if now.passed and check.passed:
                before, after = max(check.value, _ROUNDING), max(now.value, _ROUNDING)
                value = (after / before) * (
                    check.bound / now.bound if now.bound and check.bound else 1.0
                )
            elif now.passed:
                value = 0.0
            hint = (
                f"margin shrank {value:,.0f}-fold (limit {_SHRINK:g}): {check.value:.2e} before, "
                f"{now.value:.2e} now, bound {now.bound:.2e} {now.unit}; "
            )
            other = (settings or {}).get((check.where.scene, check.where.method))
            # What a person set comes before the causes that a defect may have.
            hint += f"settings changed: {other}; {now.hint}" if other else now.hint
        where = check.where._replace(channel=f"{check.name}: {check.where.channel}")
        changes.append(Check(AGAINST, where, value, _SHRINK, hint, "fold"))
    return changes
