"""The stability suite: every corrected method on the stiff and extreme scenes, step limits, and conservation."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

from rotor_mbs.analysis.stability import SuiteRun, suite_runs
from rotor_mbs.execution.case import Case
from rotor_mbs.execution.execute import OnProgress, Outcome, execute, ignore_progress, in_pool
from rotor_mbs.methods.catalogue import find_method, method_names, settings_for
from rotor_mbs.scenario.catalogue import find_scenes
from rotor_mbs.scenario.scene import Scene
from rotor_mbs.store.records import read_records
from rotor_mbs.store.results_file import ResultsStore
from rotor_mbs.studies.run import able_methods, reference_case, run_scenes
from rotor_mbs.studies.stability_records import DRIFT, LIMIT, STEPS, SYMMETRY, has_limit, perform_record

SUITE = ("stiff", "extreme")

# The method that `run` relies on is given time for the longest scenes: a map of time-outs shows nothing.
_PATIENT_METHOD, _PATIENT_S = "lagrange/taylor", 120.0
# A ladder takes a few times its longest run; what is over this is stuck.
_RECORD_LIMIT_S = 40.0
# Scenes on which conservation is looked at: one without gravity, one regular with it.
_SYMMETRY_SCENES = ("extreme/zero-gravity", "extreme/light-1e-2")
_DRIFT_CASE = ("extreme/zero-gravity", "lagrange/taylor")
_SOURCES = ("studies/stability_records.py", "analysis/exact.py")


@dataclass(frozen=True)
class SuiteReport:
    """runs: all runs of the file, as they stand on the map; made: what this call computed, or tried to."""

    scenes: int
    runs: list[SuiteRun]
    made: list[Outcome]


def run_suite(
    names: Sequence[str],
    output: Path,
    *,
    workers: int,
    timeout_s: float,
    methods: Sequence[str] = (),
    settings: Mapping[str, object] | None = None,
    on_progress: OnProgress = ignore_progress,
) -> SuiteReport:
    """The suite on the scenes of these names (all of it where there are none) into the results file `output`.

    methods: all corrected ones where none is named; settings: of the methods that have them, for the runs of the map
    (the step ladders vary the step by themselves).
    What the file has already is kept; records of these scenes that are no longer wanted are dropped. Raises InputError,
    StoreError.
    """
    scenes = find_scenes(names or SUITE)
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
    made += complete_records(scenes, asked, output, workers, on_progress)
    return SuiteReport(len(scenes), suite_runs(output), made)


def complete_records(
    scenes: Sequence[Scene],
    methods: Mapping[str, Sequence[str]],
    output: Path,
    workers: int,
    on_progress: OnProgress = ignore_progress,
) -> list[Outcome]:
    """Step ladders, step limits and conservation of these scenes, where the runs in `output` call for them."""
    cases = [*_step_cases(scenes, suite_runs(output)), *_conservation_cases(scenes, methods)]
    store = ResultsStore(output)
    made = execute(cases, in_pool(perform_record, workers, _RECORD_LIMIT_S), store, on_progress)
    records = read_records(output, "steps", "limits", "conservation")
    stale = {record.key for record in records if record.method in methods.get(record.scene, ())}
    stale -= {case.key for case in cases}
    if stale:
        store.merge((), without=stale)
    return made


def _step_cases(scenes: Sequence[Scene], found: Sequence[SuiteRun]) -> list[Case]:
    """Ladders where a fixed step may matter: the stiff and light scenes, and runs that failed at the default step."""
    by_name = {scene.name: scene for scene in scenes}
    cases = []
    for run in found:
        scene = by_name.get(run.scene)
        if scene is None or not find_method(run.method).fixed_step or not run.has_reference:
            continue
        reference = reference_case(scene).key
        if run.is_stiff_or_light or run.status in ("inaccurate", "diverged", "solver_failed"):
            cases.append(Case(scene, run.method, study=STEPS, reference=reference, sources=_SOURCES))
        if has_limit(scene, run.method):
            cases.append(Case(scene, run.method, study=LIMIT, reference=reference, sources=_SOURCES))
    return cases


def _conservation_cases(scenes: Sequence[Scene], methods: Mapping[str, Sequence[str]]) -> list[Case]:
    return [
        Case(scene, method, study=DRIFT if (scene.name, method) == _DRIFT_CASE else SYMMETRY, sources=_SOURCES)
        for scene in scenes
        if scene.name in _SYMMETRY_SCENES
        for method in methods[scene.name]
    ]
