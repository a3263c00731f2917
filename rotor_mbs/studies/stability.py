"""Stability suite: every corrected method on the stiff and extreme scenes.

Methods with a fixed step are also run over ladders of steps. The result is a map, which has the
outcome of each method on every scene, and shows whether a smaller step helps.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

from rotor_mbs.analysis.text_tables import TextTable
from rotor_mbs.errors import InputError
from rotor_mbs.methods.base import STEP
from rotor_mbs.methods.catalogue import (
    find_method,
    is_corrected,
    method_names,
)
from rotor_mbs.methods.selection import Refusal, settings_for, supporting_methods
from rotor_mbs.methods.time_limit import caller_signals
from rotor_mbs.processes.pool import Workers, pool_of
from rotor_mbs.runs.design import RunRequest
from rotor_mbs.runs.merge import fit_file_to_request
from rotor_mbs.runs.output_files import locked
from rotor_mbs.runs.read import open_results, read_records
from rotor_mbs.runs.runner import (
    OnProgress,
    RunOutcome,
    ignore_progress,
    run_tasks_references_first,
)
from rotor_mbs.scenario.scene import Scene
from rotor_mbs.studies.bench import Curve, Point, curve_tables, curve_tasks
from rotor_mbs.studies.run import run_scenes

TARGET = 1e-6  # error in rad for which the ladders look for the step

# Outcomes in the map, each with its symbol and text. An outcome is the status of the run, or
# "smaller_step", which no run has as its status. The report chooses the colours.
OUTCOMES = {
    "ok": ("✓", "ok"),
    "smaller_step": ("▾", "ok with a smaller step"),
    "inaccurate": ("≈", "inaccurate: end reached, bound exceeded"),
    "diverged": ("↯", "diverged"),
    "singular": ("S", "singular"),
    "solver_failed": ("✗", "solver failed"),
    "timed_out": ("T", "timed out"),
    "unchecked": ("?", "unchecked: end reached, accuracy cannot be assessed"),
    "completed": ("C", "completed: printed equations, end reached; accuracy not assessed"),
}


@dataclass(frozen=True)
class SuiteRun:
    """Hold the outcome of a run of the suite: a scene by a method.

    Attributes
    ----------
    scene, method : names of the scene and of the method.
    status, message : status and message of the stored run.
    outcome : a key of OUTCOMES.
    false_success : whether the engine reported success although the run is wrong.
    has_reference : whether the scene has a reference with status ok.
    step : step in s with which the error is 1e-6 rad; None if there is no ladder.
    """

    scene: str
    method: str
    status: str
    outcome: str
    message: str
    false_success: bool
    has_reference: bool
    step: float | None

    @property
    def folder(self) -> str:
        """Return the folder of the scene, such as "stiff"."""
        return self.scene.partition("/")[0]


def suite_runs(path: Path) -> list[SuiteRun]:
    """Return the outcome of every run in the results file at `path`, in the order of the file.

    Raises
    ------
    StoreError
        If the file cannot be read.
    """
    ladders = {(record.scene, record.name): record for record in read_records(path, "stability")}
    runs = []
    with open_results(path) as results:
        for scene in results.scenes.values():
            reference = scene.reference
            for name, run in scene.methods.items():
                facts, ladder = run.attributes, ladders.get((scene.name, name))
                outcome, message = run.status, str(facts.get("message", ""))
                if run.status != "ok" and ladder is not None and "ok" in ladder.statuses:
                    outcome = "smaller_step"
                runs.append(
                    SuiteRun(
                        scene=scene.name,
                        method=name,
                        status=run.status,
                        outcome=outcome,
                        message=message,
                        false_success=bool(facts.get("false_success", 0)),
                        has_reference=reference is not None and reference.status == "ok",
                        step=None if ladder is None else ladder.attributes.get("step_for_target_s"),
                    )
                )
    return runs


def suite_table(runs: Sequence[SuiteRun]) -> TextTable:
    """Return a table with the number of runs that are ok, by method and folder of scenes.

    A cell "12+1 of 14" says that 13 runs are ok, 1 of them only with a smaller step. A cell of the
    printed equations, such as "2 of 2 completed", has the number of completed runs. Singular runs
    are not counted if their scene has no reference, because no motion exists there. The last
    column has the number of wrong runs whose engine reported success.

    Parameters
    ----------
    runs : runs of any scenes and methods.
    """
    compared = [run for run in runs if run.has_reference or run.status != "singular"]
    folders = list(dict.fromkeys(run.folder for run in compared))
    rows = []
    for method in dict.fromkeys(run.method for run in runs):
        cells = []
        for folder in folders:
            outcomes = [
                run.outcome for run in compared if (run.method, run.folder) == (method, folder)
            ]
            ok, smaller = outcomes.count("ok"), outcomes.count("smaller_step")
            count = f"{ok}+{smaller}" if smaller else f"{ok}"
            text = f"{count} of {len(outcomes)}"
            if not is_corrected(method):  # its runs never have the status ok
                text = f"{outcomes.count('completed')} of {len(outcomes)} completed"
            cells.append(text if outcomes else "")
        claimed = sum(run.false_success for run in runs if run.method == method)
        rows.append((method, *cells, str(claimed)))
    return TextTable(("method", *folders, "reported as success"), rows)


SUITE = ("stiff", "extreme")

# The method on which `run` relies has a longer time limit, in s, so that it completes the longest
# scenes: if it timed out, the map would not show its stability.
_PATIENT_METHOD, _PATIENT_S = "lagrange/taylor", 120.0
# Time after which the process of a ladder is ended, s. A ladder takes a few times as long as its
# longest run; a process that takes longer hangs.
_TASK_LIMIT_S = 40.0
STEPS = "stability"  # name of the table with the points of the ladders

# Each step of a ladder is a quarter of the step before. A ladder ends when the error is well below
# the target, or when the next run is expected to take longer than _LONGEST_RUN_S.
_FACTOR = 4
_LONGEST_RUN_S = 1.5
# Beginnings of the names of scenes for which every method with a fixed step has a ladder.
_STIFF_OR_LIGHT = ("stiff/", "extreme/light", "extreme/feather")
# Maximum number of steps of a run, which bounds ladders whose runs all fail at once: these reach no
# limit of time.
_MAX_STEPS = 1e7


@caller_signals()
def run_suite(
    scenes: Sequence[Scene],
    output: Path,
    *,
    workers: int,
    timeout_s: float,
    methods: Sequence[str] = (),
    settings: Mapping[str, object] | None = None,
    on_progress: OnProgress = ignore_progress,
) -> tuple[list[RunOutcome], list[Refusal]]:
    """Compute the runs and ladders of the suite, and store them in a results file.

    Runs and ladders that the file already has, with the same settings and versions, are kept.
    Ladders that the runs no longer need are removed.

    Parameters
    ----------
    scenes : the scenes.
    output : the results file.
    workers : number of parallel processes.
    timeout_s : time limit of a run in s.
    methods : names of methods; if empty, all corrected methods.
    settings : settings of the runs; each applies to the methods that have it. They do not apply to
        the ladders, which vary the step.
    on_progress : called after each run, and after each ladder.

    Returns
    -------
    list of RunOutcome
        Runs and ladders that this call computed, or tried to compute.
    list of Refusal
        Runs that were left out.

    Raises
    ------
    InputError
        If no method has one of the settings, if no run is left, or if `output` is a file of
        another kind.
    StoreError
        If the file cannot be read or written.
    """
    names = methods or method_names(is_corrected=True)
    settings_for(list(names), settings or {})  # raises if no method has a setting
    asked: dict[str, list[str]] = {}
    refused: list[Refusal] = []
    for scene in scenes:
        able, others = supporting_methods(scene, names, settings or {}, are_named=bool(methods))
        asked[scene.name] = able
        refused += others
    if not any(asked.values()):
        raise InputError(map(str, refused))
    scenes = [scene for scene in scenes if asked[scene.name]]
    patient = {
        name: [method for method in able if method == _PATIENT_METHOD]
        for name, able in asked.items()
    }
    made: list[RunOutcome] = []
    with pool_of(workers) as pool:
        # The method with the longer limit runs first: if its run reached that limit, it is not
        # computed again with the shorter limit.
        for chosen, limit_s in ((patient, max(timeout_s, _PATIENT_S)), (asked, timeout_s)):
            outcomes = run_scenes(
                scenes,
                chosen,
                output,
                workers=pool,
                timeout_s=limit_s,
                settings=settings,
                on_progress=on_progress,
            )
            made += [outcome for outcome in outcomes if outcome.is_computed]
        return made + complete_ladders(scenes, asked, output, pool, on_progress), refused


def complete_ladders(
    scenes: Sequence[Scene],
    methods: Mapping[str, Sequence[str]],
    output: Path,
    workers: Workers,
    on_progress: OnProgress = ignore_progress,
) -> list[RunOutcome]:
    """Compute the ladders of steps that stored runs need and the file lacks.

    A run needs a ladder if its method has a fixed step, its scene has a reference, and the scene is
    stiff or light or the run failed with the default step. Other ladders of these scenes and
    methods are removed from the file.

    Parameters
    ----------
    scenes : the scenes.
    methods : by scene name, the methods whose ladders are removed if no run needs them.
    output : the results file; it has the runs.
    workers : number of parallel processes, or an open pool.
    on_progress : called after each ladder.

    Returns
    -------
    list of RunOutcome
        The ladders that this call computed, or tried to compute.
    """
    by_name = {scene.name: scene for scene in scenes}
    # A smaller step may matter on the stiff and light scenes, and for runs that failed with the
    # default step.
    wanted = [
        (by_name[run.scene], run.method)
        for run in suite_runs(output)
        if run.scene in by_name
        and run.has_reference
        and find_method(run.method).fixed_step
        and (
            run.scene.startswith(_STIFF_OR_LIGHT)
            or run.status in ("inaccurate", "diverged", "solver_failed")
        )
    ]
    curves = [ladder_curve(scene, method) for scene, method in wanted]
    with locked(output), pool_of(workers) as pool:
        replaced = [(STEPS, scene, method) for scene, able in methods.items() for method in able]
        file = fit_file_to_request(output, curve_tables(curves), replaced)
        missing = [curve for curve in curves if not curve.is_stored(file)]
        tasks = curve_tasks(
            file, missing, _TASK_LIMIT_S, _LONGEST_RUN_S / _FACTOR, 2.0 * _LONGEST_RUN_S
        )
        return run_tasks_references_first(tasks, pool, on_progress)


def ladder_curve(scene: Scene, method: str) -> Curve:
    """Return the curve of a scene and method over steps, each a quarter of the step before.

    The first step is the sample interval. With the last step a run has at most `_MAX_STEPS` steps.
    """
    steps = [scene.duration / (scene.samples - 1)]
    while scene.duration <= _MAX_STEPS * steps[-1] / _FACTOR:
        steps.append(steps[-1] / _FACTOR)
    points = []
    for step in steps:
        known = RunRequest(scene, method, {STEP: step}).known | {
            "run": f"{scene.name}/{method} step={step:.6g}"
        }
        points.append(Point(method, step, {STEP: step}, known | {STEP: step}))
    return Curve(scene, method, STEP, points, STEPS, TARGET)
