"""Stability suite: every corrected method on the stiff and extreme scenes.

Some methods are also run over ladders of steps. The result is a map: how each method ends on every
scene, and whether a smaller step helps.
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

TARGET = 1e-6  # rad: what a method must reach on the stiff and light scenes

# Outcomes in the map: the status of a run, or a more specific one, with its symbol and text. The
# report chooses the colours.
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
    scene, method : names.
    status, message : as stored.
    outcome : a key of OUTCOMES.
    false_success : whether the engine reported success of a run that is wrong.
    has_reference : whether the scene has a reference that is ok.
    step : s, that an error of 1e-6 rad needs; None where no ladder found it.
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
        """Return the folder of its scene, such as "stiff"."""
        return self.scene.partition("/")[0]


def suite_runs(path: Path) -> list[SuiteRun]:
    """Return every run of the results file at `path`, in its order.

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
    """Return a table of the runs that are ok, by method and folder of scenes.

    A cell "12+1 of 14" says that 13 runs are ok, 1 of them only with a smaller step; of the printed
    equations it is "2 of 2 completed". Runs that are singular in scenes without a reference are not
    counted: there no motion exists.

    Parameters
    ----------
    runs : of any number of scenes and methods.
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
            if not is_corrected(method):  # never ok
                text = f"{outcomes.count('completed')} of {len(outcomes)} completed"
            cells.append(text if outcomes else "")
        claimed = sum(run.false_success for run in runs if run.method == method)
        rows.append((method, *cells, str(claimed)))
    return TextTable(("method", *folders, "reported as success"), rows)


SUITE = ("stiff", "extreme")

# The method that `run` relies on is given enough time for the longest scenes: a map of time-outs
# shows nothing.
_PATIENT_METHOD, _PATIENT_S = "lagrange/taylor", 120.0
# A ladder takes a few times its longest run; what is over this is stuck.
_TASK_LIMIT_S = 40.0
STEPS = "stability"  # table

# Each step of a ladder is a quarter of the one before, until the error is well below the target, or
# a run is expected to take this long.
_FACTOR = 4
_LONGEST_RUN_S = 1.5
_STIFF_OR_LIGHT = ("stiff/", "extreme/light", "extreme/feather")
# A run that fails at once costs nothing, however small its step.
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
    """Compute the suite on some scenes into a results file.

    What the file has already is kept; records of these scenes that are no longer wanted are
    dropped.

    Parameters
    ----------
    scenes : the scenes.
    output : the results file.
    workers : parallel processes.
    timeout_s : time limit of a run in s.
    methods : names; all corrected methods if there are none.
    settings : of the methods that have them, for the runs of the map. Ladders vary the step by
        themselves.
    on_progress : called after each run.

    Returns
    -------
    list of RunOutcome
        What this call computed, or tried to.
    list of Refusal
        Runs that were left out.

    Raises
    ------
    InputError, StoreError
        InputError also if no run is left.
    """
    names = methods or method_names(is_corrected=True)
    settings_for(list(names), settings or {})  # refuses what no method has
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
        # The patient method first: a run that ended at its longer limit is not computed again with
        # the shorter one.
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
    """Complete the ladders of steps of these scenes, where the stored runs need them.

    A ladder is needed for methods with a fixed step, on stiff and light scenes and where the run
    failed at the default step.

    Parameters
    ----------
    scenes : the scenes.
    methods : names of methods by scene name, whose ladders are replaced.
    output : the results file, which has the runs.
    workers : parallel processes, or a pool that is open.
    on_progress : called after each ladder.
    """
    by_name = {scene.name: scene for scene in scenes}
    # Where a fixed step may matter: the stiff and light scenes, and runs that failed at the default
    # step.
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
        # Ladders of these scenes and methods that the runs no longer need are removed.
        replaced = [(STEPS, scene, method) for scene, able in methods.items() for method in able]
        file = fit_file_to_request(output, curve_tables(curves), replaced)
        missing = [curve for curve in curves if not curve.is_stored(file)]
        tasks = curve_tasks(
            file, missing, _TASK_LIMIT_S, _LONGEST_RUN_S / _FACTOR, 2.0 * _LONGEST_RUN_S
        )
        return run_tasks_references_first(tasks, pool, on_progress)


def ladder_curve(scene: Scene, method: str) -> Curve:
    """Return the curve of a scene and method over steps that become smaller by factors of 4.

    The first step is the sample interval; the last one is limited by the number of steps of a run.
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
