"""The stability suite: every corrected method on the stiff and extreme scenes, step ladders and limits, symmetries.

Step limits of a fixed-step method on a scene: a ladder of steps, and the largest stable step, seen and in theory, where
|R(hλ)| <= 1 for the stability function R and every eigenvalue λ (Hairer & Wanner, Solving Ordinary Differential
Equations II, IV.2). Symmetries, on a scene without damping and without a load that changes: the scene, its images and
itself backwards in time.
"""

from __future__ import annotations

import cmath
import json
import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from rotor_mbs.analysis import exact as theory
from rotor_mbs.analysis.judgement import Judgement, judge
from rotor_mbs.analysis.stability import TARGET, SuiteRun, suite_runs
from rotor_mbs.methods.catalogue import REFERENCE, find_method, method_names, settings_for
from rotor_mbs.methods.solve import solve
from rotor_mbs.methods.time_limit import OutOfTimeError, time_limit
from rotor_mbs.runs.files import writing
from rotor_mbs.runs.records import points_table, row_of_point
from rotor_mbs.runs.results import TableFile, extend_file
from rotor_mbs.runs.runner import Task
from rotor_mbs.runs.table import Rows
from rotor_mbs.runs.versions import row_versions
from rotor_mbs.scenario.scene import Scene, scene_hash
from rotor_mbs.solution.impulse import angular_momentum
from rotor_mbs.solution.status import COMPLETE
from rotor_mbs.solution.trajectory import Trajectory
from rotor_mbs.studies.run import (
    OnProgress,
    Outcome,
    able_methods,
    compute_tasks,
    ignore_progress,
    run_scenes,
    work_of,
)
from rotor_mbs.studies.stored_references import read_reference

SUITE = ("stiff", "extreme")

# The method that `run` relies on is given time for the longest scenes: a map of time-outs shows nothing.
_PATIENT_METHOD, _PATIENT_S = "lagrange/taylor", 120.0
# A ladder takes a few times its longest run; what is over this is stuck.
_TASK_LIMIT_S = 40.0
# Scenes on which conservation is looked at: one without gravity, one regular with it.
_SYMMETRY_SCENES = ("extreme/zero-gravity", "extreme/light-1e-2")
STEPS, LIMIT, SYMMETRY = "stability", "stability_limits", "symmetry"  # tables

# A ladder goes down by fours until it reaches the target, stops gaining, or a run is expected to take this long.
_FACTOR = 4
_LONGEST_RUN_S = 1.5
# A run that fails at once costs nothing, however small its step.
_MAX_STEPS = 1e7
# Bisection: a window of so many radians of the fastest mode; a pitch this many times its start has grown, not swung.
_WINDOW_RADIANS = 5e3
_GROWTH = 100.0
_INTERVALS = 10
# s, of the runs that symmetries are seen by.
_SYMMETRY_LIMIT_S = 30.0


@dataclass(frozen=True, kw_only=True)
class StudyTask(Task):
    """Numbers of some runs of a scene by a method, on their way to a worker process: rows of STEPS, LIMIT, SYMMETRY."""

    table: str
    scene: Scene


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
    for chosen, limit_s in ((none, timeout_s), (patient, max(timeout_s, _PATIENT_S)), (asked, timeout_s)):
        own = {k: v for able in chosen.values() for method in able for k, v in chosen_settings[method].items()}
        report = run_scenes(
            scenes, chosen, output, workers=workers, timeout_s=limit_s, settings=own, on_progress=on_progress
        )
        made += report.made
    return made + complete_studies(scenes, asked, output, workers, on_progress)


def complete_studies(
    scenes: Sequence[Scene],
    methods: Mapping[str, Sequence[str]],
    output: Path,
    workers: int,
    on_progress: OnProgress = ignore_progress,
) -> list[Outcome]:
    """Step ladders, step limits and symmetries of these scenes, where the runs in `output` call for them."""
    wanted = _wanted(scenes, suite_runs(output))
    wanted += [
        (SYMMETRY, scene, method)
        for scene in scenes
        if scene.name in _SYMMETRY_SCENES
        for method in methods[scene.name]
    ]
    points = {(table, scene.name, method): study_points(table, scene, method) for table, scene, method in wanted}
    tables = [
        points_table(table, [point for key, own in points.items() if key[0] == table for point in own])
        for table in dict.fromkeys(table for table, _, _ in wanted)
    ]
    with writing(output):
        file = extend_file(output, tables, _stale(output, points, methods))
        tasks = []
        for table, scene, method in wanted:
            own = [file.place(str(point["run"]), table) for point in points[table, scene.name, method]]
            if not all(place.is_stored for place in own):
                reference = None if table == SYMMETRY else file.place(f"{scene.name}/{REFERENCE}")
                tasks.append(
                    StudyTask(
                        label=f"{scene.name} {method} {table}",
                        method=method,
                        place=own[0],
                        reference=reference,
                        kill_after_s=_TASK_LIMIT_S,
                        work=work_of(scene, method),
                        table=table,
                        scene=scene,
                    )
                )
        return compute_tasks(tasks, perform_study, workers, on_progress)


def study_points(table: str, scene: Scene, method: str) -> list[dict[str, object]]:
    """The known columns of the rows of a study: a row for each step of a ladder, else one."""
    known: dict[str, object] = {
        "run": f"{scene.name}/{method}",
        "scene": scene.name,
        "method_name": method,
        "versions": json.dumps(row_versions(find_method(method)), sort_keys=True),
        "scene_hash": scene_hash(scene),
    }
    if table != STEPS:
        return [known]
    return [known | {"run": f"{scene.name}/{method} step={step:.6g}", "step": step} for step in ladder_steps(scene)]


def ladder_steps(scene: Scene) -> list[float]:
    """s: the sample interval, then a quarter of the one before, as long as a run has not too many steps."""
    steps = [scene.duration / (scene.samples - 1)]
    while scene.duration <= _MAX_STEPS * steps[-1] / _FACTOR:
        steps.append(steps[-1] / _FACTOR)
    return steps


def _stale(
    output: Path, points: Mapping[tuple[str, str, str], object], methods: Mapping[str, Sequence[str]]
) -> list[tuple[str, str]]:
    """(table, run) of stored rows of these scenes and methods that the runs no longer call for."""
    if not output.exists():
        return []
    stale = []
    file = TableFile(output)
    for table in (STEPS, LIMIT, SYMMETRY):
        if table in file.groups:
            stored = file.table(table)
            owners = zip(stored.runs, stored.known["scene"], stored.known["method_name"], strict=True)
            stale += [
                (table, run)
                for run, scene, method in owners
                if method in methods.get(scene, ()) and (table, scene, method) not in points
            ]
    return stale


def _wanted(scenes: Sequence[Scene], runs: Sequence[SuiteRun]) -> list[tuple[str, Scene, str]]:
    """Ladders where a fixed step may matter: the stiff and light scenes, and runs that failed at the default step."""
    by_name = {scene.name: scene for scene in scenes}
    wanted = []
    for run in runs:
        scene = by_name.get(run.scene)
        if scene is None or not find_method(run.method).fixed_step or not run.has_reference:
            continue
        if run.is_stiff_or_light or run.status in ("inaccurate", "diverged", "solver_failed"):
            wanted.append((STEPS, scene, run.method))
        if has_limit(scene, run.method):
            wanted.append((LIMIT, scene, run.method))
    return wanted


def perform_study(task: StudyTask) -> Rows:
    """The rows of a study, in a worker process."""
    if task.table == STEPS:
        return ladder_rows(task)
    if task.table == LIMIT:
        return row_of_point(task.place, "ok", "", step_limit(task.scene, task.method))
    try:
        with time_limit(_SYMMETRY_LIMIT_S):
            return row_of_point(task.place, "ok", "", symmetry_errors(task.scene, task.method))
    except OutOfTimeError as exc:
        return row_of_point(task.place, "timed_out", str(exc), {})


def has_limit(scene: Scene, method: str) -> bool:
    """Whether theory gives a limit: an explicit method, and a spring in every bearing."""
    has_function = find_method(method).stability_function is not None
    return has_function and bool(scene.bearing_stiffness) and min(scene.bearing_stiffness) >= 1e6


def ladder_rows(task: StudyTask) -> Rows:
    """Errors in rad over steps in s, and the step that the target needs; steps that are not needed are left out."""
    scene, method = task.scene, task.method
    reference = read_reference(task.reference, scene) if task.reference is not None else None
    steps = ladder_steps(scene)
    judgements: list[Judgement] = []
    expected = 0.0
    for step in steps:
        if expected > _LONGEST_RUN_S:
            break
        judgement, seconds = _judged(scene, method, {"step": step}, reference)
        judgements.append(judgement)
        if judgement.metrics.get("angle_error_max", np.inf) <= 0.1 * TARGET and judgement.status == "ok":
            break
        expected = _FACTOR * seconds
    # A run that broke off has no error up to the horizon.
    errors = [
        judgement.metrics.get("angle_error_max", np.nan) if judgement.status in COMPLETE else np.nan
        for judgement in judgements
    ]
    needed = step_for(TARGET, np.array(steps[: len(errors)]), np.array(errors))
    rows = []
    for i in range(len(steps)):
        if i >= len(judgements):
            rows.append(row_of_point(task.place, "left_out", "", {"false_success": 0}))
            continue
        values = {
            "angle_error_max": errors[i],
            "energy_drift_max": judgements[i].metrics.get("energy_drift_max", np.nan),
            "false_success": int(judgements[i].false_success),
            "step_for_target_s": np.nan if needed is None else needed,
        }
        rows.append(row_of_point(task.place, judgements[i].status, judgements[i].message, values))
    return {name: np.concatenate([row[name] for row in rows]) for name in rows[0]}


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


def _judged(
    scene: Scene, method: str, settings: Mapping[str, object], reference: Trajectory | None
) -> tuple[Judgement, float]:
    """The judgement and the run time in s; a run over twice the longest one ends itself."""
    try:
        with time_limit(2.0 * _LONGEST_RUN_S):
            run = solve(method, scene, settings)
    except OutOfTimeError as exc:
        return Judgement("timed_out", str(exc), False, {}, None), 2.0 * _LONGEST_RUN_S
    return judge(scene, run, reference), run.run_times_s[0]


def step_limit(scene: Scene, method: str) -> dict[str, float]:
    """The largest stable step by bisection on what becomes of the pitches, beside that of the theory."""
    function = find_method(method).stability_function
    assert function is not None  # see has_limit
    # Of a pitch about zero, the rotor fixed: gravity and rotation are negligible beside such a spring.
    inertias = [(blade.pitch_inertia, *scene.bearing(i)) for i, blade in enumerate(scene.blades)]
    modes = [mode for numbers in inertias for mode in oscillator_modes(*numbers)]
    window = _WINDOW_RADIANS / max(abs(mode) for mode in modes)
    short = replace(scene, duration=window, samples=_INTERVALS + 1, outputs=("angles", "rates"))
    theory = largest_stable_step(function, modes, window, _GROWTH)
    low = max(1, int(0.5 * window / theory / _INTERVALS))  # steps per interval: too few, enough
    high = 4 * low + 1
    if not _stays(short, method, high) or _stays(short, method, low):
        stable = float("nan")
    else:
        while high - low > 1:
            middle = (low + high) // 2
            low, high = (low, middle) if _stays(short, method, middle) else (middle, high)
        stable = window / (_INTERVALS * high)
    return {
        "largest_stable_step_s": stable,
        "theory_s": theory,
        "fastest_mode_per_s": max(abs(mode) for mode in modes),
        "mode_damping_ratio": min(1.0, *(abs(mode.real) / abs(mode) for mode in modes)),
    }


def _stays(scene: Scene, method: str, steps: int) -> bool:
    """Whether every pitch keeps within `_GROWTH` times the largest one at the start, to the end."""
    step = scene.duration / (_INTERVALS * steps)
    with time_limit(20.0):
        run = solve(method, scene, {"step": step})
    pitches = np.abs(run.trajectory.angles[:, 1:])
    complete = len(pitches) == scene.samples
    return complete and float(pitches.max()) <= _GROWTH * max(map(abs, scene.initial_angles[1:]))


def oscillator_modes(inertia: float, stiffness: float, damping: float) -> tuple[complex, complex]:
    """λ in 1/s of J θ̈ + d θ̇ + k θ = 0 (kg m², N m/rad, N m s/rad)."""
    root = cmath.sqrt(damping * damping - 4.0 * inertia * stiffness)
    return (-damping + root) / (2.0 * inertia), (-damping - root) / (2.0 * inertia)


def largest_stable_step(
    stability_function: Callable[[complex], complex], modes: Sequence[complex], window: float, growth: float
) -> float:
    """s: where the first range of steps ends on which no mode grows more than `growth`-fold in `window` s.

    Growth within a window, not |R| <= 1 itself, is what a run can show: RK67 has |R| > 1 on the whole imaginary axis,
    by so little at small steps that nothing comes of it. By scan and bisection.
    """
    fastest = max(abs(mode) for mode in modes)

    def stable(h: float) -> bool:
        largest = max(abs(stability_function(h * mode)) for mode in modes)
        return window / h * math.log(largest) <= math.log(growth)

    width = 0.01 / fastest
    step = width
    while stable(step + width):
        step += width
    low, high = step, step + width
    while high - low > 1e-6 / fastest:
        middle = 0.5 * (low + high)
        low, high = (middle, high) if stable(middle) else (low, middle)
    return low


def _run(scene: Scene, method: str) -> Trajectory:
    return solve(method, scene, {}).trajectory


def symmetry_errors(scene: Scene, method: str) -> dict[str, float]:
    """What an exact run conserves: errors in rad, of the angular momentum relative.

    What does not exist for the scene is left out.
    """
    there = _run(scene, method)
    errors = {
        "mirror_error": theory.mirror_error(there.angles, _run(theory.mirrored(scene), method).angles),
        "relabelling_error": theory.relabelling_error(there.angles, _run(theory.relabelled(scene), method).angles),
    }
    # From the last sample on with all rates reversed it runs back to its start.
    end = tuple(there.angles[-1].tolist()), tuple((-there.rates[-1]).tolist())
    back = _run(replace(scene, initial_angles=end[0], initial_rates=end[1]), method)
    errors["reversal_error"] = float(np.abs(back.angles[-1] - np.array(scene.initial_angles)).max())
    if scene.gravity == 0.0 and not scene.has_torque:
        momentum = angular_momentum(scene, there.angles, there.rates)
        errors["angular_momentum_drift"] = float(np.abs(momentum - momentum[0]).max() / abs(momentum[0]))
    return errors
