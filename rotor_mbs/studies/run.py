"""Solve runs of scenes, judge them against a reference, and store them in a results file."""

from __future__ import annotations

import math
import time
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from rotor_mbs.analysis.judgement import judge
from rotor_mbs.errors import SYSTEM_ERRORS, MethodRefusal, RotorError
from rotor_mbs.methods.catalogue import (
    REFERENCE,
    default_methods,
    error_line,
    find_method,
    find_method_or_none,
    is_corrected,
)
from rotor_mbs.methods.selection import own_settings, settings_of_run
from rotor_mbs.methods.solve import solve
from rotor_mbs.methods.time_limit import OutOfTimeError, caller_signals, time_limit
from rotor_mbs.processes.pool import Workers, pool_of
from rotor_mbs.runs.design import MISSING, STATUS_COPIES, RunRequest, results_tables
from rotor_mbs.runs.merge import fit_file_to_request
from rotor_mbs.runs.output_files import locked
from rotor_mbs.runs.rows import RowLocation, Rows, row_of_run, text_of
from rotor_mbs.runs.runner import (
    OnProgress,
    RunOutcome,
    Task,
    ignore_progress,
    run_tasks_references_first,
)
from rotor_mbs.runs.table import TableFile
from rotor_mbs.scenario.scene import Scene, scene_hash
from rotor_mbs.solution.defects import Defects
from rotor_mbs.solution.quantities import DEFECT
from rotor_mbs.solution.status import STATUSES
from rotor_mbs.solution.trajectory import Integration, Solution, Trajectory
from rotor_mbs.studies.stored_references import frozen_solution, read_reference, shipped_versions

# A short run is integrated up to _REPEATS times, as long as all integrations together take at most
# _REPEAT_BUDGET_S (s). Its median time is then not that of a cold cache.
_REPEATS = 5
_REPEAT_BUDGET_S = 0.05
_JUDGING_S = 1.0  # time in s that judging a run may always take, even after its time limit
_FIXED_WORK = 3.0  # work of building, judging and storing a run, in the unit of `work_of`


@dataclass(frozen=True, kw_only=True)
class RunTask(Task):
    """Solve and judge one run, in a worker process.

    Attributes
    ----------
    request : the run that is requested.
    time_limit_s : time limit of the run in s, at which the run stops itself.
    """

    request: RunRequest
    time_limit_s: float

    def failed(self, status: str, message: str) -> Rows:
        """Return the row that is stored if the run fails: no samples, a status and its reason."""
        request = self.request
        run = without_samples(request.scene, request.method, request.settings, status, message)
        limit = self.time_limit_s if status == "timed_out" else np.nan
        return row_of_run(run, self.place, {"false_success": 0, "time_limit_s": limit})

    def perform(self) -> Rows:
        """Solve and judge the run, and return its row.

        A shipped reference is read instead of computed. An error that the method raises becomes the
        status of the run, except for MethodRefusal and SYSTEM_ERRORS.

        Raises
        ------
        StoreError
            If the file of the shipped reference cannot be read.
        MethodRefusal
            If the method cannot represent the scene.
        Exception
            One of SYSTEM_ERRORS, for example if the system lacks memory.
        """
        request = self.request
        end = time.monotonic() + self.time_limit_s
        shipped = frozen_solution(request.scene) if request.is_shipped else None
        try:
            if shipped is not None:
                run = shipped
            else:
                run = solve(
                    request.method,
                    request.scene,
                    request.settings,
                    _REPEATS,
                    _REPEAT_BUDGET_S,
                    self.time_limit_s,
                )
        except (*SYSTEM_ERRORS, MethodRefusal):
            raise
        except OutOfTimeError as exc:  # the method lost its samples when it was stopped
            return self.failed("timed_out", str(exc))
        except Exception as exc:
            message = str(exc) if isinstance(exc, RotorError) else error_line(exc)
            return self.failed("solver_failed", message)
        reference = run.trajectory if request.method == REFERENCE else None
        if self.reference is not None:
            reference = read_reference(self.reference, request.scene)
        run, false_success = _judged(run, reference, end)
        # `time_limit_s` is the time limit of this call if this limit ended the run, otherwise NaN.
        # It is also NaN for a shipped reference that ends early because its own computation was
        # stopped before it was shipped.
        was_stopped_before = shipped is not None and shipped.integration.out_of_time
        is_over = run.status == "timed_out" and not was_stopped_before
        limit = self.time_limit_s if is_over else np.nan
        return row_of_run(
            run, self.place, {"false_success": int(false_success), "time_limit_s": limit}
        )

    def outcome(self, rows: Rows) -> RunOutcome:
        """Return the outcome that is stored in the row of the run."""
        is_shipped = self.request.is_shipped
        return RunOutcome(
            self.label,
            self.method,
            STATUSES[int(rows["status"][0])],
            text_of(rows["message"][0]),
            seconds=math.nan if is_shipped else float(rows["run_time_s"][0]),
            is_shipped=is_shipped,
        )


def work_of(scene: Scene, method: str) -> float:
    """Return the rough amount of work of a run, for the order of tasks and the shown progress.

    The integration of 10 s of a scene by the fastest method counts as 1. A constant is added for
    building, judging and storing.

    Parameters
    ----------
    scene, method : the scene, and the name of the method.
    """
    return _FIXED_WORK + find_method(method).relative_cost * scene.duration / 10.0


@caller_signals()
def run_scenes(
    scenes: Sequence[Scene],
    methods: Mapping[str, Sequence[str]],
    output: Path,
    *,
    workers: Workers,
    timeout_s: float,
    settings: Mapping[str, object] | None = None,
    use_frozen: bool = True,
    on_progress: OnProgress = ignore_progress,
) -> list[RunOutcome]:
    """Compute references and runs, and store them in a results file.

    Rows that the file already has are kept. A requested row is computed again if its settings, its
    versions or the numbers of its scene differ from the stored ones, and in the cases that
    `missing_runs` lists.

    Parameters
    ----------
    scenes : the scenes.
    methods : names of methods by scene name.
    output : the results file.
    workers : number of parallel processes, or a pool that is open; with 0, this process computes
        all runs.
    timeout_s : time limit of a run in s. A run that exceeds it stops itself, and is stored with the
        status timed_out.
    settings : settings of methods by name. They override the defaults and the scene's own settings;
        each applies to the methods that have it.
    use_frozen : whether a shipped reference, if there is one, is read instead of computed.
    on_progress : called after each run.

    Returns
    -------
    list of RunOutcome
        The runs that this call computed or tried to compute, then the runs that were stored before.

    Raises
    ------
    InputError, StoreError, KeyboardInterrupt
        Runs that ended before the error stay in the file, and a repeated call computes the others.
    """
    requests = requested_runs(scenes, methods, settings or {}, use_frozen=use_frozen)
    with locked(output), pool_of(workers) as pool:
        file = fit_file_to_request(output, results_tables(requests))
        tasks, stored = missing_runs(file, requests, timeout_s)
        return run_tasks_references_first(tasks, pool, on_progress) + stored


def requested_runs(
    scenes: Sequence[Scene],
    methods: Mapping[str, Sequence[str]],
    settings: Mapping[str, object],
    *,
    use_frozen: bool = True,
) -> list[RunRequest]:
    """Return the runs of these scenes; the reference of a scene precedes its other runs.

    The reference is the shipped one if there is one and `use_frozen` is set. Otherwise the
    reference is to be computed.

    Parameters
    ----------
    scenes : the scenes.
    methods : names of methods by scene name.
    settings : settings of methods by name. They override the defaults and the scene's own settings;
        each applies to the methods that have it.
    use_frozen : whether a shipped reference may be used.

    Raises
    ------
    InputError
        If a method is unknown, or a scene has a setting that no method has.
    """
    requests: list[RunRequest] = []
    for scene in scenes:
        shipped = shipped_versions(scene_hash(scene)) if use_frozen else None
        requests.append(RunRequest(scene, REFERENCE, versions=shipped))
        for name in methods[scene.name]:
            requests.append(RunRequest(scene, name, settings_of_run(scene, name, settings)))
    return requests


def missing_runs(
    file: TableFile, requests: Sequence[RunRequest], timeout_s: float
) -> tuple[list[RunTask], list[RunOutcome]]:
    """Return the runs that are to be computed, and mark their rows in the file as missing.

    Parameters
    ----------
    file : the results file, with a row for each run.
    requests : the runs; the reference of each scene comes before its other runs.
    timeout_s : time limit of a run (s).

    Returns
    -------
    tasks : list of RunTask
        A task for each run that is not stored, that a shorter time limit ended, or whose reference
        is to be computed.
    stored : list of RunOutcome
        The outcome of each other run. The row of such a run stays as it is.
    """
    tasks: list[RunTask] = []
    stored: list[RunOutcome] = []
    references: dict[str, RowLocation] = {}  # by label of the reference
    new_references = set[str]()
    for run in requests:
        place = file.place(run.label)
        row = place.read()
        status = STATUSES[row["status"][0]] if place.is_stored else ""
        # `limit` is the time limit that ended the stored run, or NaN. A run with the status
        # timed_out is computed again unless `limit` is at least the present time limit. A shipped
        # reference may itself end early, because its computation was stopped before it was shipped.
        # Its row then has the status timed_out and `limit` NaN. Such a reference is not read again:
        # it would end at the same sample.
        limit = row["time_limit_s"][0]
        is_short = not limit >= timeout_s
        if run.is_shipped:
            is_short = limit < timeout_s
        is_over = status == "timed_out" and is_short
        is_missing = not status or is_over or run.reference_label in new_references
        reference = references.get(run.reference_label)
        if run.method == REFERENCE:
            references[run.label] = place
            if is_missing:
                new_references.add(run.label)
        label = f"{run.scene.name} {run.method}"
        if not is_missing:
            message = text_of(row["message"][0])
            stored.append(RunOutcome(label, run.method, status, message, is_computed=False))
            continue
        copied_status = row[STATUS_COPIES["status"]][0]
        if row["status"][0] != MISSING or copied_status != MISSING:
            place.mark_missing([0])
        tasks.append(
            RunTask(
                label=label,
                method=run.method,
                place=place,
                reference=reference,
                # The run stops itself at the time limit. The limit for the process is longer,
                # because the process also loads the engine, compiles code and writes the row.
                kill_after_s=1.2 * timeout_s + 10.0,
                work=work_of(run.scene, run.method),
                request=run,
                time_limit_s=timeout_s,
            )
        )
    return tasks, stored


@caller_signals()
def solve_judged(
    scene: Scene,
    method: str,
    settings: Mapping[str, object] | None = None,
    *,
    compute_reference: bool = False,
    time_limit_s: float = float("inf"),
) -> tuple[Solution, Trajectory | None]:
    """Solve and judge one run in this process; nothing is stored.

    Parameters
    ----------
    scene, method : the scene, and the name of the method.
    settings : settings of the method, which override the scene's own settings.
    compute_reference : whether a reference is computed if none is shipped.
    time_limit_s : time limit in s of the run, the reference and the judging, in this order. Each of
        them may use the time that is left. The judging may take _JUDGING_S even if less is left.

    Returns
    -------
    Solution
        The run, with status, message and metrics.
    Trajectory or None
        The reference by which the run was judged, if there is one.

    Notes
    -----
    `rotor_mbs.run` lists the errors raised, and has an example.
    """
    end = time.monotonic() + time_limit_s
    shipped = frozen_solution(scene)
    is_reference_short = False
    reference = None if shipped is None else shipped.trajectory
    own = own_settings(scene, method) | dict(settings or {})
    try:
        run = solve(method, scene, own, time_limit_s=time_limit_s)
    except OutOfTimeError as exc:
        return without_samples(scene, method, own, "timed_out", str(exc)), reference
    if reference is None and compute_reference:
        try:
            solution = solve(REFERENCE, scene, {}, time_limit_s=max(end - time.monotonic(), 0.0))
            reference = solution.trajectory
            is_reference_short = solution.integration.out_of_time
        except OutOfTimeError:
            is_reference_short = True
    run, _ = _judged(run, reference, end)
    if is_reference_short and run.status != "timed_out":
        run = replace(
            run,
            status="timed_out",
            message="the reference that was asked for is over the time limit",
        )
    return run, reference


def _judged(run: Solution, reference: Trajectory | None, end: float) -> tuple[Solution, bool]:
    """Judge a run.

    Return the run with status, message and metrics, and whether the engine reported success
    although the samples are wrong.

    Parameters
    ----------
    run : a run as its method returned it.
    reference : the reference of the scene; None if there is none.
    end : end of the time limit on the monotonic clock (s). Judging may always take _JUDGING_S.
    """
    try:
        with time_limit(max(end - time.monotonic(), _JUDGING_S)):
            judgement = judge(run.scene, run, reference)
    except OutOfTimeError as exc:
        message = f"{exc}, while its samples were assessed"
        return replace(run, status="timed_out", message=message), False
    advice = judgement.advice or next_to_try(run.scene, run.method, run.settings, judgement.status)
    message = judgement.message + advice
    trajectory = run.trajectory
    if judgement.defects is not None:
        trajectory = _with_defects(trajectory, judgement.defects)
    judged = replace(
        run,
        trajectory=trajectory,
        status=judgement.status,
        message=message,
        metrics=judgement.metrics,
    )
    return judged, judgement.false_success


def _with_defects(samples: Trajectory, defects: Defects) -> Trajectory:
    """Return the samples with defects: each sample has the defect of the interval that ends there.

    The size of the defect is stored. It is NaN at the first sample, and where it is not finite.
    """
    sizes = np.concatenate([[np.nan], defects.sizes])
    with_defects = samples.replace(**{DEFECT: np.where(np.isfinite(sizes), sizes, np.nan)})
    with_defects.refined = samples.refined
    return with_defects


def next_to_try(scene: Scene, method: str, settings: Mapping[str, object], status: str) -> str:
    """Return advice on an inaccurate run, as text: finer settings or another method; "" for none.

    The finer settings are the next rung of the method's ladder. There is no advice on a reference,
    which no other method can replace, nor on a run of the printed equations.

    Parameters
    ----------
    scene : the scene. The steps of the ladder are shares of its sample interval.
    method, settings : method and settings of the run.
    status : status of the run; there is advice only for "inaccurate".
    """
    known = find_method_or_none(method)
    if status != "inaccurate" or known is None or not known.is_corrected or method == REFERENCE:
        return ""
    finer = known.finer(settings, scene.duration / (scene.samples - 1))
    if finer:
        return "; next to try: " + ", ".join(f"{name}={value:.3g}" for name, value in finer.items())
    others = [name for name in default_methods() if name != method and is_corrected(name)]
    if not others:
        return ""
    return f"; no finer settings of this method are known; next to try: {others[0]}"


def without_samples(
    scene: Scene, method: str, settings: Mapping[str, object], status: str, message: str
) -> Solution:
    """Return a run without samples, whose engine report says that it failed.

    Parameters
    ----------
    scene, method, settings : the run that was requested.
    status, message : the status of the run and its reason.
    """
    columns = 1 + len(scene.blades)
    trajectory = Trajectory(np.empty(0), np.empty((0, columns)), np.empty((0, columns)))
    chosen = find_method(method).settings.of(method, settings).as_dict()
    engine = Integration(False, message)
    # The times of the run are unknown (NaN), as its process may have been ended.
    return Solution(
        scene, method, trajectory, engine, chosen, math.nan, [], math.nan, status, message
    )
