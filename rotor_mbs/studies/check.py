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
AGAINST = "against"  # name of the checks that compare with an earlier file
CHANGED = "scene"  # name of the checks that compare the scenes of this file and the earlier one
_SHOWN_CHANGES = 10  # maximum number of differing keys of a scene that a hint lists
_OF_EVERY_RUN = "status"  # name of the check that every run has exactly once
# Values below this, a few units in the last place of a double, are rounding errors. They are raised
# to this value before they are compared: a change among rounding errors means nothing.
_ROUNDING = 2.0**-50
_SHRINK = 10.0  # factor by which a margin may be smaller than in an earlier file


def check_file(path: Path, bounds: Bounds, required: Sequence[str] = ()) -> list[Check]:
    """Check the stored runs of a file, and that each required method has run.

    Each scene of a results file must have a run of every required method, and so must a sweep.

    Parameters
    ----------
    path : a results file or a sweep.
    bounds : bounds of all checks.
    required : names of methods, or method files.

    Raises
    ------
    InputError
        If the file has no runs except references, as a bench file or a file of references.
    StoreError
        If the file cannot be read.
    """
    checks = judge_file(path, bounds)
    if all(check.passed and check.where.method == REFERENCE for check in checks):
        raise InputError(f"{path}: nothing to check: no run of a method")
    methods: dict[str, list[str]] = {}  # methods that have run, by scene
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

    The default set has the scenes of the paper by the default methods, and the scenes made for
    checking by every installed method with the corrected equations. If `methods` are named, they
    compute all of these scenes instead, except those that they cannot represent.

    Parameters
    ----------
    bounds : bounds of all checks.
    workers : number of parallel processes.
    on_progress : called after each run.
    methods : names of methods that replace those of the default set.
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
    """Return the check that a scene has a run of a required method.

    The check fails if the run is missing.
    """
    return Check("required", Where(scene, method, "run"), float(is_missing), 0.0, hint, "missing")


def judge_file(path: Path, bounds: Bounds) -> list[Check]:
    """Return the checks of a results file or a sweep.

    The runs of a results file are checked in full, and the list is empty if it has none. A sweep is
    checked for completeness and integrity only, because its runs were judged when computed.

    Parameters
    ----------
    path : a results file or a sweep.
    bounds : bounds of all checks.

    Raises
    ------
    InputError, StoreError
        If a stored scene is not valid (InputError), or the file cannot be read (StoreError).
    """
    writer = (
        "; another process is writing it, or was killed while it did"
        if is_being_written(path)
        else ""
    )
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
        with reading(path):  # an error in this block is reported as an error in `path`
            checks = checks_of(results, shipped, bounds)
    runs = TableFile(path, [RUNS]).tables.get(RUNS)
    missing = 0 if runs is None else int((runs.column("status") == MISSING).sum())
    if missing:
        absent = f"{missing} runs missing; the command that wrote the file computes them{writer}"
        checks.append(bounded(bounds, "complete", Where("*", "*", "runs"), missing, "runs", absent))
    return checks


def runs_gone(path: Path, earlier: Path) -> Check:
    """Check that the sweep at `path` has every run of an earlier sweep.

    Runs of both sweeps correspond if their methods and their varied numbers are equal.

    Parameters
    ----------
    path, earlier : the sweep that is checked, and the earlier sweep.
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
    """Return the scenes of a file by name.

    A sweep has a single scene: the base scene, whose parameters are varied.

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
    """Return a check for each name that is in both sets of scenes.

    The value of the check is the number of keys in which the two scenes differ.

    Parameters
    ----------
    new, old : scenes by name.
    are_allowed : whether scenes may differ. If they may, the check passes; its hint lists the
        differences in either case.
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
    """Return the bounds that apply to no check.

    They are reported, because a misspelt method or scene would otherwise pass unnoticed.

    Parameters
    ----------
    entries : the bounds of a user's own file.
    checks : the checks that were made.
    scenes : the scenes that were checked, by name.
    """
    # Like `checks_of`, this compares the pattern of a bound with the names of shipped scenes only.
    # A scene that differs from the shipped scene of its name does not count as shipped.
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
    """Return the number of runs that were judged, by method.

    The verdict prints these numbers, so that its reader notices a missing run.
    """
    return Counter(
        check.where.method
        for check in checks
        if check.name == _OF_EVERY_RUN and check.where.method != REFERENCE
    )


def changed_settings(new: Path, old: Path) -> dict[tuple[str, str], str]:
    """Return the changed settings of runs, by (scene, method).

    Runs that only one of the files has are left out.

    Parameters
    ----------
    new, old : results files. A run whose settings cannot be read is left out here; its own checks
        report the damage.

    Returns
    -------
    dict
        For each run whose settings differ, a text such as "step 0.0005 -> 0.02".
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
    """Compare the checks of a file with those of an earlier file.

    For each check of the earlier file a new check is returned. Its value is the factor by which the
    margin has shrunk, and it fails if the factor is above ten. Special values are

    - NaN, which fails, if `new` lacks the check;
    - infinite if the check passed before and fails now;
    - 1 if it failed before and fails now, which is no regression;
    - 0 if it failed before and passes now.

    A run that is missing now has a single check, which fails.

    Parameters
    ----------
    new, old : checks of this file and of the earlier file.
    changed : names of scenes that differ between the files. For these only the presence of the runs
        is checked: errors in different scenes cannot be compared.
    settings : differences in the settings of a run, by (scene, method); a hint begins with them if
        there are any.
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
            # The value if the check fails now. The branches below are for a check that passes now.
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
            # A setting that the user changed is the likelier cause: it comes before other hints.
            hint += f"settings changed: {other}; {now.hint}" if other else now.hint
        where = check.where._replace(channel=f"{check.name}: {check.where.channel}")
        changes.append(Check(AGAINST, where, value, _SHRINK, hint, "fold"))
    return changes
