"""Runs of scenes: solved, judged against the reference of their scene, and stored."""

from __future__ import annotations

import itertools
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

import numpy as np

from rotor_mbs.errors import InputError, MethodRefusal, RotorError
from rotor_mbs.methods.catalogue import (
    REFERENCE,
    check_names,
    default_methods,
    find_method,
    is_corrected,
    look_up,
    method_names,
    settings_for,
)
from rotor_mbs.methods.selection import choose
from rotor_mbs.methods.solve import solve
from rotor_mbs.methods.time_limit import OutOfTimeError
from rotor_mbs.runs.case import RUN, Case
from rotor_mbs.runs.layout import KEY_ATTRIBUTE, LIMIT
from rotor_mbs.runs.lock import writing
from rotor_mbs.runs.pool import OF_THE_MACHINE, Workers, one_line
from rotor_mbs.runs.read import open_results
from rotor_mbs.runs.results_file import ResultsStore
from rotor_mbs.runs.runner import Job, OnProgress, Outcome, Result, execute, ignore_progress, in_pool
from rotor_mbs.runs.write import write_run
from rotor_mbs.scenario.scene import Scene, scene_hash
from rotor_mbs.scenario.toml_file import of_file
from rotor_mbs.solution.judgement import judge
from rotor_mbs.solution.solution import Solution
from rotor_mbs.solution.trajectory import Integration, Trajectory
from rotor_mbs.studies.stored_references import digest, frozen_file, frozen_solution, load_reference

# Short runs are repeated, so that the stored time is not that of a cold cache; long ones are not.
_REPEATS = 5
_REPEAT_BUDGET_S = 0.05


@dataclass(frozen=True)
class RunReport:
    """What became of a list of cases: those that this call computed, and how many were stored already.

    stored_failures   a line for each of the latter that should have succeeded and did not
    """

    made: list[Outcome]
    kept: int
    stored_failures: list[str] = field(default_factory=list)

    @property
    def failures(self) -> list[Outcome]:
        """Runs that should have succeeded and did not. How far the printed equations get is data, not a failure."""
        return [one for one in self._with_record() if is_corrected(one.case.method)]

    @property
    def broken_off(self) -> list[Outcome]:
        """Runs of the printed equations that did not reach the end."""
        return [one for one in self._with_record() if not is_corrected(one.case.method)]

    @property
    def not_computed(self) -> list[Outcome]:
        """Runs whose process died or could not start; nothing is stored, the same call tries them again."""
        return [one for one in self.made if not one.is_computed]

    def _with_record(self) -> list[Outcome]:
        return [one for one in self.made if one.is_computed and one.result.status != "ok"]


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
    beside: Sequence[Case] = (),
    perform: Callable[[Job], Result] | None = None,
) -> RunReport:
    """Every scene's reference and runs into the results file `output`; what it has already is kept.

    methods      by scene name
    workers      parallel processes, or a pool that is open; 0: all in this process
    timeout_s    a run over this ends itself, and is stored with the status timed_out
    settings     of the methods that have them, in place of defaults and of the scene's own
    use_frozen   whether a shipped reference may stand for a computed one
    beside       cases of other studies, computed with the runs and not told of in the report
    perform      what computes runs and those cases

    Raises InputError, StoreError, KeyboardInterrupt; the same call then goes on where it stopped.
    """
    settings_for(list(dict.fromkeys(name for scene in scenes for name in methods[scene.name])), settings or {})
    cases: list[Case] = []
    for scene in scenes:
        reference = reference_case(scene, use_frozen=use_frozen)
        own = {name: own_settings(scene, name, settings or {}) for name in methods[scene.name]}
        cases += [reference, *(Case(scene, name, own[name], reference=reference.key) for name in own)]
    runs = {case.key for case in cases}
    # Slowest first, so that no long one starts last and keeps one process busy while the others wait; between them the
    # fastest, which are those that are compiled, so that two processes seldom compile the same code at once.
    cases = sorted([*beside, *cases], key=lambda case: -case.work)
    quarter, count = len(cases) // 4, len(cases)
    turns = zip(cases[:quarter], cases[count - quarter :], strict=True)
    cases = [*itertools.chain.from_iterable(turns), *cases[quarter : count - quarter]]
    run = in_pool(perform or perform_run, workers, timeout_s, store_time_out)
    with writing(output):
        refuse_losses(output, cases)
        made = execute(cases, run, ResultsStore(output, timeout_s), on_progress)
        made = [one for one in made if one.case.key in runs]
        asked = [case for case in cases if case.key in runs]
        return RunReport(made, len(asked) - len(made), _stored_failures(output, asked, made))


def _stored_failures(output: Path, cases: Sequence[Case], made: Sequence[Outcome]) -> list[str]:
    """Runs that this call found in the file, and that are no success."""
    new = {one.case.key for one in made}
    kept = {f"{case.scene.name}/{case.method}": case for case in cases if case.key not in new}
    if not kept:
        return []
    with open_results(output, verify=False) as results:  # verified when the keys of what is kept were read
        runs = {f"{scene.name}/{run.method}": run for scene in results.scenes.values() for run in scene.runs.values()}
        return [
            f"{case.label} {runs[name].status}: {runs[name].attributes.get('message', '')}"
            for name, case in kept.items()
            if name in runs and runs[name].status != "ok" and is_corrected(case.method)
        ]


def solve_judged(
    scene: Scene,
    method: str,
    settings: Mapping[str, object] | None = None,
    *,
    compute_reference: bool = False,
    time_limit_s: float = float("inf"),
) -> tuple[Solution, Trajectory | None]:
    """One run in this process, with status, message and metrics, and the reference it was judged by; stores nothing.

    Arguments, errors raised and an example: `rotor_mbs.run`.
    """
    reference = None
    scene_key = scene_hash(scene)
    if frozen_file(scene_key) is not None:
        reference = frozen_solution(scene, scene_key)[0].trajectory
    elif compute_reference:
        reference = solve(REFERENCE, scene, {}).trajectory
    own = own_settings(scene, method, {}) | dict(settings or {})
    try:
        run, _ = _judged(solve(method, scene, own, _REPEATS, _REPEAT_BUDGET_S, time_limit_s), reference)
    except OutOfTimeError as exc:
        run = _without_samples(scene, method, own, "timed_out", str(exc))
    return run, reference


def _judged(run: Solution, reference: Trajectory | None) -> tuple[Solution, bool]:
    """The run with status, message and metrics; and whether its engine claims a success that it is not."""
    found = judge(run.scene, run, reference)
    message = found.message + next_to_try(run.scene, run.method, run.settings, found.status)
    return replace(run, status=found.status, message=message, metrics=found.metrics), found.false_success


def next_to_try(scene: Scene, method: str, settings: Mapping[str, object], status: str) -> str:
    """What would make an inaccurate run better: the next rung of the method's ladder, or another method; else ""."""
    found = look_up(method)
    if status != "inaccurate" or found is None or not found.is_corrected:
        return ""
    finer = found.finer(settings, scene.duration / (scene.samples - 1))
    if finer:
        return "; next to try: " + ", ".join(f"{name}={value:.3g}" for name, value in finer.items())
    others = [name for name in default_methods() if name != method and is_corrected(name)]
    return f"; as fine as its ladder goes, next to try: {others[0]}" if others else ""


def reference_case(scene: Scene, *, use_frozen: bool = True) -> Case:
    """The reference of a scene: the shipped one, where there is one and it may be used, or one to be computed."""
    case = Case(scene, REFERENCE)
    path = frozen_file(case.scene_hash) if use_frozen else None
    return case if path is None else Case(scene, REFERENCE, options={"frozen": digest(path)})


def own_settings(scene: Scene, method: str, given: Mapping[str, object]) -> dict[str, object]:
    """Those of the scene's settings that the method has, with those of the `given` ones in their place.

    Raises InputError for a setting of the scene that no method at all has, or that is out of range.
    """
    of_scene: dict[str, dict[str, object]] = {}
    if scene.settings:
        of_scene = of_file(scene.name, scene.text, "settings", settings_for, method_names(), dict(scene.settings))
    allowed = find_method(method).settings.allowed()
    return of_scene.get(method, {}) | {name: value for name, value in given.items() if name in allowed}


def perform_run(job: Job) -> Result:
    """Solves, judges and stores one run, in a worker process. Raises StoreError where it cannot be written."""
    case = job.case
    if case.method == REFERENCE and "frozen" in case.options:
        run, attributes = frozen_solution(case.scene, case.scene_hash)
    else:
        attributes = {}
        try:
            run = solve(case.method, case.scene, case.settings, _REPEATS, _REPEAT_BUDGET_S, job.time_limit_s)
        except OF_THE_MACHINE:
            raise
        except OutOfTimeError as exc:  # from a method that cannot be stopped with its samples
            return store_failure("timed_out", job, str(exc))
        except Exception as exc:
            return store_failure("solver_failed", job, str(exc) if isinstance(exc, RotorError) else one_line(exc))
    if case.method == REFERENCE:
        reference: Trajectory | None = run.trajectory
    else:
        reference = load_reference(job.reference, case.scene) if job.reference is not None else None
    run, false_success = _judged(run, reference)
    return _store(job, run, attributes | {"false_success": false_success})


def store_time_out(job: Job, message: str) -> Result:
    """Stores a run that was ended at its time limit; other studies store nothing of such a case."""
    return store_failure("timed_out", job, message) if job.case.study == RUN else Result("timed_out", message)


def store_failure(status: str, job: Job, message: str) -> Result:
    """Stores a run that left no samples."""
    case = job.case
    run = _without_samples(case.scene, case.method, case.settings, status, message)
    return _store(job, run, {"false_success": False})


def _without_samples(scene: Scene, method: str, settings: Mapping[str, object], status: str, message: str) -> Solution:
    columns = 1 + len(scene.blades)
    trajectory = Trajectory(np.empty(0), np.empty((0, columns)), np.empty((0, columns)))
    chosen = find_method(method).settings.of(method, settings).as_dict()
    return Solution(scene, method, trajectory, Integration(False, message), chosen, status=status, message=message)


def _store(job: Job, run: Solution, attributes: Mapping[str, Any]) -> Result:
    """Writes a judged run; attributes: further ones. One with `frozen_with` was read, not computed."""
    is_read = "frozen_with" in attributes
    facts = {"status": run.status, "message": run.message, KEY_ATTRIBUTE: job.case.key, **run.metrics, **attributes}
    if run.status == "timed_out" and not is_read:
        facts[LIMIT] = job.time_limit_s
    write_run(job.part, job.case.scene_hash, run, facts)
    return Result(run.status, run.message, 0.0 if is_read else float(np.median(run.run_times_s)), is_read=is_read)


def able_methods(scene: Scene, names: Iterable[str]) -> tuple[list[str], list[str]]:
    """Those of `names` that can represent the scene, and a line for each that cannot."""
    able, refused = [], []
    for name in names:
        try:
            find_method(name).items(scene)
            able.append(name)
        except MethodRefusal as exc:
            refused.append(f"{scene.name}: not by {name}: {exc}")
    return able, refused


def asked_methods(scenes: Sequence[Scene], names: Sequence[str]) -> dict[str, list[str]]:
    """`names` for every scene. Raises InputError where one cannot represent a scene."""
    found = {scene.name: able_methods(scene, names) for scene in scenes}
    refused = [line for _, lines in found.values() for line in lines]
    if refused:
        raise InputError(refused)
    return {name: able for name, (able, _) in found.items()}


def selected_methods(scenes: Sequence[Scene]) -> tuple[dict[str, list[str]], list[str]]:
    """The methods that each scene names itself, or that the rule selects, none where it refuses; and the reasons.

    Raises InputError where a scene names a method that is unknown or cannot represent it.
    """
    methods: dict[str, list[str]] = {}
    reasons: list[str] = []
    for scene in scenes:
        if scene.methods:
            methods |= asked_methods([scene], of_file(scene.name, scene.text, "methods", check_names, scene.methods))
            continue
        try:
            chosen, reason = choose(scene, default_methods())
        except MethodRefusal as exc:
            methods[scene.name] = []
            reasons.append(str(exc))
            continue
        methods[scene.name], left_out = able_methods(scene, chosen)
        reasons += [f"{scene.name}: {reason}: {', '.join(methods[scene.name])}", *left_out]
    return methods, reasons


def refuse_losses(output: Path, cases: Sequence[Case]) -> None:
    """Raises InputError where runs stored for a scene with other numbers would be dropped and not made anew."""
    if not output.exists():
        return
    wanted = {(case.scene.name, case.method) for case in cases if case.study == RUN}
    numbers = {case.scene.name: case.scene_hash for case in cases}
    with open_results(output) as results:
        lost = [
            f"{output}: {scene.name}: has {run.method} of a scene of that name with other numbers, which this call "
            "would drop; allowed: another output file, or a call that has this method too"
            for scene in results.scenes.values()
            if numbers.get(scene.name, scene.attributes["scene_hash"]) != scene.attributes["scene_hash"]
            for run in scene.runs.values()
            if (scene.name, run.method) not in wanted
        ]
    if lost:
        raise InputError(lost)
