"""The stability suite: every corrected method on the stiff and extreme scenes, and ladders of steps for some. As a map:
how each method ends on every scene, whether a smaller step helps, which is fastest."""

from __future__ import annotations

import json
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from rotor_mbs.analysis.judgement import Judgement, judge
from rotor_mbs.analysis.text_tables import TextTable
from rotor_mbs.methods.catalogue import REFERENCE, able_methods, find_method, method_names, settings_for
from rotor_mbs.methods.solve import solve
from rotor_mbs.methods.time_limit import OutOfTimeError, time_limit
from rotor_mbs.runs.output_files import locked
from rotor_mbs.runs.pool import Workers, pool_of
from rotor_mbs.runs.read import open_results, points_table, read_records
from rotor_mbs.runs.runner import OnProgress, Outcome, Task, compute_tasks, ignore_progress
from rotor_mbs.runs.table import Rows, extend_file
from rotor_mbs.runs.versions import row_versions
from rotor_mbs.scenario.scene import Scene, scene_hash
from rotor_mbs.solution.status import COMPLETE, code_of
from rotor_mbs.studies.run import run_scenes, work_of
from rotor_mbs.studies.stored_references import read_reference

TARGET = 1e-6  # rad: what a method must reach on the stiff and light scenes

# What the map shows of a run: its status, or one of two that say more. Symbol, text; colour is the report's.
OUTCOMES = {
    "ok": ("✓", "ok"),
    "energy_alone": ("E", "ok, without an angle error: no reference, or horizon before the second sample"),
    "smaller_step": ("▾", "ok with a smaller step"),
    "inaccurate": ("≈", "inaccurate: end reached, bound exceeded"),
    "diverged": ("↯", "diverged"),
    "singular": ("S", "singular"),
    "solver_failed": ("✗", "solver failed"),
    "timed_out": ("T", "timed out"),
    "unchecked": ("?", "unchecked: end reached, accuracy cannot be assessed"),
}


@dataclass(frozen=True)
class SuiteRun:
    """A run of the suite: a scene by a method.

    outcome: a key of OUTCOMES. angle_error: rad up to the horizon, None where nothing is compared. step: s, that 1e-6
    rad needs, where a ladder found it.
    """

    scene: str
    method: str
    status: str
    outcome: str
    message: str
    false_success: bool
    has_reference: bool
    angle_error: float | None
    run_time_s: float
    step: float | None

    @property
    def family(self) -> str:
        """What its scene stresses: stiff, or the first part of an extreme scene's name."""
        folder, _, name = self.scene.rpartition("/")
        first = name.split("-")[0]
        return "stiff" if folder == "stiff" else _FAMILIES.get(first, first)

    @property
    def is_stiff_or_light(self) -> bool:
        return self.family in ("stiff", "light")

    @property
    def reaches_target(self) -> bool:
        """Whether it is ok within 1e-6 rad, or a smaller step is."""
        is_close = self.status == "ok" and self.angle_error is not None and self.angle_error <= TARGET
        return is_close or self.step is not None


_FAMILIES = {  # of scenes whose names do not begin with that of their family
    "feather": "light",
    "passage": "singular",
    **dict.fromkeys(("spin", "tumbling", "rate", "rates", "torque"), "fast"),
    **dict.fromkeys(("hour", "pendulum"), "long"),
    **dict.fromkeys(("toy", "giant", "zero", "gravity"), "scale"),
}


def suite_runs(path: Path) -> list[SuiteRun]:
    """Every run of a results file, in its order. Raises StoreError."""
    ladders = {(record.scene, record.name): record for record in read_records(path, "stability")}
    runs = []
    with open_results(path) as results:
        for scene in results.scenes.values():
            reference = scene.reference
            for name, run in scene.methods.items():
                facts, ladder = run.attributes, ladders.get((scene.name, name))
                outcome, message = run.status, str(facts.get("message", ""))
                if run.status == "ok" and "angle_error_max" not in facts:
                    reason = "the horizon is before the second sample"
                    if reference is None:
                        reason = "there is no reference"
                    elif len(reference.array("time")) < 2:
                        reason = f"no reference ({reference.attributes['message']})"
                    outcome, message = "energy_alone", f"no angle error: {reason}"
                elif run.status != "ok" and ladder is not None and "ok" in ladder.statuses:
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
                        angle_error=facts.get("angle_error_max"),
                        run_time_s=float(facts["run_time_s"]),
                        step=None if ladder is None else ladder.attributes.get("step_for_target_s"),
                    )
                )
    return runs


def fastest_to_target(runs: Iterable[SuiteRun]) -> dict[str, str | None]:
    """By scene with a reference, the method that is ok within 1e-6 rad, or with a smaller step, in the least time; None
    where none is."""
    fastest: dict[str, SuiteRun | None] = {}
    for run in runs:
        if not run.has_reference:
            continue
        before = fastest.setdefault(run.scene, None)
        is_able = run.status == "ok" and run.reaches_target
        if is_able and (before is None or run.run_time_s < before.run_time_s):
            fastest[run.scene] = run
    return {scene: None if run is None else run.method for scene, run in fastest.items()}


def unreached(runs: Iterable[SuiteRun]) -> list[str]:
    """Stiff and light scenes with a reference on which no method reaches 1e-6 rad."""
    asked = [run for run in runs if run.is_stiff_or_light and run.has_reference]
    reached = {run.scene for run in asked if run.reaches_target}
    return [scene for scene in dict.fromkeys(run.scene for run in asked) if scene not in reached]


def family_table(runs: Sequence[SuiteRun], heading: Callable[[str], str] = str) -> TextTable:
    """A row for each method, a column for each family of scenes: "12+1 of 14" are ok, of these 1 with a smaller step.

    Without scenes that are singular and have no reference: there no motion exists. heading: how a family is called.
    """
    compared = [run for run in runs if run.has_reference or run.status != "singular"]
    families = list(dict.fromkeys(run.family for run in compared))
    rows = []
    for method in dict.fromkeys(run.method for run in runs):
        cells = []
        for family in families:
            outcomes = [run.outcome for run in compared if run.method == method and run.family == family]
            ok, smaller = sum(outcome in ("ok", "energy_alone") for outcome in outcomes), outcomes.count("smaller_step")
            count = f"{ok}+{smaller}" if smaller else f"{ok}"
            cells.append(f"{count} of {len(outcomes)}" if outcomes else "")
        claimed = sum(run.false_success for run in runs if run.method == method)
        rows.append((method, *cells, str(claimed)))
    return TextTable(("method", *map(heading, families), "reported as success"), rows)


SUITE = ("stiff", "extreme")

# The method that `run` relies on is given time for the longest scenes: a map of time-outs shows nothing.
_PATIENT_METHOD, _PATIENT_S = "lagrange/taylor", 120.0
# A ladder takes a few times its longest run; what is over this is stuck.
_TASK_LIMIT_S = 40.0
STEPS = "stability"  # table

# A ladder goes down by fours until it reaches the target, stops gaining, or a run is expected to take this long.
_FACTOR = 4
_LONGEST_RUN_S = 1.5
# A run that fails at once costs nothing, however small its step.
_MAX_STEPS = 1e7


@dataclass(frozen=True, kw_only=True)
class LadderTask(Task):
    """A ladder of steps of a scene by a method, on its way to a worker process: rows of the table STEPS."""

    scene: Scene

    def perform(self) -> Rows:
        """Errors in rad over steps in s, and the step that the target needs; steps that are not needed are left out."""
        reference = read_reference(self.reference, self.scene) if self.reference is not None else None
        steps, is_over = ladder_steps(self.scene), False
        each = []
        for step in steps:
            if is_over:
                each.append(self.place.rows_of({"status": "left_out", "false_success": 0}))
                continue
            try:
                with time_limit(2.0 * _LONGEST_RUN_S):
                    run = solve(self.method, self.scene, {"step": step})
            except OutOfTimeError as exc:
                judgement, seconds = Judgement("timed_out", str(exc), False, {}, None), 2.0 * _LONGEST_RUN_S
            else:
                judgement, seconds = judge(self.scene, run, reference), run.run_times_s[0]
            # A run that broke off has no error up to the horizon.
            metrics, is_complete = judgement.metrics, judgement.status in COMPLETE
            error = metrics.get("angle_error_max", np.nan) if is_complete else np.nan
            values = {
                "status": judgement.status,
                "message": judgement.message,
                "angle_error_max": error,
                "energy_drift_max": metrics.get("energy_drift_max", np.nan),
                "false_success": int(judgement.false_success),
            }
            each.append(self.place.rows_of(values))
            is_accurate = judgement.status == "ok" and error <= 0.1 * TARGET
            is_over = is_accurate or _FACTOR * seconds > _LONGEST_RUN_S
        rows = {name: np.concatenate([row[name] for row in each]) for name in each[0]}
        tried = rows["status"] != code_of("left_out")
        needed = step_for(TARGET, np.array(steps)[tried], rows["angle_error_max"][tried])
        rows["step_for_target_s"][tried] = np.nan if needed is None else needed
        return rows


def run_suite(
    scenes: Sequence[Scene],
    output: Path,
    *,
    workers: int,
    timeout_s: float,
    methods: Sequence[str] = (),
    settings: Mapping[str, object] | None = None,
    on_progress: OnProgress = ignore_progress,
) -> list[Outcome]:
    """The suite on some scenes into the results file `output`; what this call computed, or tried to.

    methods: all corrected ones where none is named; settings: of the methods that have them, for the runs of the map
    (the step ladders vary the step by themselves).
    What the file has already is kept; records of these scenes that are no longer wanted are dropped. Raises InputError,
    StoreError.
    """
    asked = {scene.name: able_methods(scene, methods or method_names(is_corrected=True))[0] for scene in scenes}
    none: Mapping[str, Sequence[str]] = dict.fromkeys(asked, ())  # references, some of which take long, first
    patient = {name: [method for method in able if method == _PATIENT_METHOD] for name, able in asked.items()}
    every = dict.fromkeys(method for able in asked.values() for method in able)
    chosen_settings = settings_for(list(every), settings or {})
    made: list[Outcome] = []
    with pool_of(workers) as pool:
        for chosen, limit_s in ((none, timeout_s), (patient, max(timeout_s, _PATIENT_S)), (asked, timeout_s)):
            own = {k: v for able in chosen.values() for method in able for k, v in chosen_settings[method].items()}
            report = run_scenes(
                scenes, chosen, output, workers=pool, timeout_s=limit_s, settings=own, on_progress=on_progress
            )
            made += report.made
        return made + complete_ladders(scenes, asked, output, pool, on_progress)


def complete_ladders(
    scenes: Sequence[Scene],
    methods: Mapping[str, Sequence[str]],
    output: Path,
    workers: Workers,
    on_progress: OnProgress = ignore_progress,
) -> list[Outcome]:
    """The ladders of steps of these scenes, where the runs in `output` call for them."""
    by_name = {scene.name: scene for scene in scenes}
    # Where a fixed step may matter: the stiff and light scenes, and runs that failed at the default step.
    wanted = [
        (by_name[run.scene], run.method)
        for run in suite_runs(output)
        if run.scene in by_name
        and run.has_reference
        and find_method(run.method).fixed_step
        and (run.is_stiff_or_light or run.status in ("inaccurate", "diverged", "solver_failed"))
    ]
    points = {(scene.name, method): ladder_points(scene, method) for scene, method in wanted}
    tables = [points_table(STEPS, [point for own in points.values() for point in own])] if points else []
    with locked(output), pool_of(workers) as pool:
        # Ladders of these scenes and methods that the runs no longer call for go.
        replaced = [(STEPS, scene, method) for scene, able in methods.items() for method in able]
        file = extend_file(output, tables, replaced)
        tasks = []
        for scene, method in wanted:
            own = [file.place(str(point["run"]), STEPS) for point in points[scene.name, method]]
            if not all(place.is_stored for place in own):
                tasks.append(
                    LadderTask(
                        label=f"{scene.name} {method} {STEPS}",
                        method=method,
                        place=own[0],
                        reference=file.place(f"{scene.name}/{REFERENCE}"),
                        kill_after_s=_TASK_LIMIT_S,
                        work=work_of(scene, method),
                        scene=scene,
                    )
                )
        return compute_tasks(tasks, pool, on_progress)


def ladder_points(scene: Scene, method: str) -> list[dict[str, object]]:
    """The known columns of the rows of a ladder."""
    known: dict[str, object] = {
        "scene": scene.name,
        "method_name": method,
        "versions": json.dumps(row_versions(find_method(method)), sort_keys=True),
        "scene_hash": scene_hash(scene),
    }
    return [known | {"run": f"{scene.name}/{method} step={step:.6g}", "step": step} for step in ladder_steps(scene)]


def ladder_steps(scene: Scene) -> list[float]:
    """s: the sample interval, then a quarter of the one before, as long as a run has not too many steps."""
    steps = [scene.duration / (scene.samples - 1)]
    while scene.duration <= _MAX_STEPS * steps[-1] / _FACTOR:
        steps.append(steps[-1] / _FACTOR)
    return steps


def step_for(target: float, steps: np.ndarray, errors: np.ndarray) -> float | None:
    """s: where the error crosses `target` for good, by a straight line in logarithms; None where it does not."""
    below = errors <= target
    if not below.any() or not below[-1]:
        return None
    last = len(errors) - 1 - int(np.argmin(below[::-1])) if not below.all() else -1
    if last < 0 or not np.isfinite(errors[last]) or errors[last + 1] == 0.0:
        return float(steps[last + 1])
    slope = np.log(errors[last] / errors[last + 1]) / np.log(steps[last] / steps[last + 1])
    return float(steps[last + 1] * (target / errors[last + 1]) ** (1.0 / slope))
