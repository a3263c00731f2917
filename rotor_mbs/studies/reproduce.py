"""The main job: every scene of the paper by the default methods and with each erratum alone.

And error against run time of all methods on one scene, at a few settings each, in seconds: a bench takes one process on
one core and rounds over all points; here each curve is a case beside the runs, and a point is run once. Its errors are
those of a bench, its times are good to a factor.
"""

from __future__ import annotations

import hashlib
import os
from pathlib import Path

from rotor_mbs.analysis.claim_study import claim_study
from rotor_mbs.analysis.claims import claims, finding
from rotor_mbs.analysis.run_tables import finding_lines, method_table
from rotor_mbs.errors import RotorError
from rotor_mbs.methods.catalogue import default_methods, errata_methods, ladders
from rotor_mbs.runs.case import RUN, Case
from rotor_mbs.runs.pool import OF_THE_MACHINE, Workers, one_line
from rotor_mbs.runs.read import in_memory, open_results
from rotor_mbs.runs.runner import Job, OnProgress, Result, ignore_progress
from rotor_mbs.runs.versions import fingerprint, versions
from rotor_mbs.scenario.catalogue import find_scenes, reference_folder, scenarios_folder
from rotor_mbs.scenario.scene import Scene
from rotor_mbs.studies.bench import BENCH, SOURCES, Measured, curve_record, facts_of, points_of, store_curve
from rotor_mbs.studies.bench_worker import PointTimer, prepared_scene
from rotor_mbs.studies.run import RunReport, able_methods, perform_run, reference_case, run_scenes

# The scene whose error against run time is measured by all methods: the paper's own crest, and a horizon of 6 s.
BENCHED = "paper/fig11"
_LONGEST_S = 0.25  # a run longer than this is the last of its curve: the next one takes up to eight times as long


def reproduce(
    output: Path, *, workers: Workers, timeout_s: float, on_progress: OnProgress = ignore_progress
) -> RunReport:
    """Into the results file `output`; what it has already is kept. Raises InputError, StoreError."""
    scenes, benched = find_scenes(["paper"]), find_scenes([BENCHED])[0]
    names = (*default_methods(), *errata_methods().values())
    methods = {scene.name: able_methods(scene, names)[0] for scene in scenes}
    return run_scenes(
        scenes, methods, output, workers=workers, timeout_s=timeout_s, on_progress=on_progress,
        beside=ladder_cases(benched), perform=perform,
    )  # fmt: skip


def made_from(results: Path, timeout_s: float) -> str:
    """A digest of the results file, code, versions, scenes, references and the time limit."""
    digest = hashlib.sha256(f"{fingerprint('.')} {versions()} {timeout_s}".encode())
    for path in (results, *sorted(scenarios_folder().rglob("*.toml")), *sorted(reference_folder().iterdir())):
        with path.open("rb") as file:
            digest.update(hashlib.file_digest(file, "sha256").digest())
    return digest.hexdigest()


def summary_of(path: Path) -> str:
    """Numbers and claims of the paper, and a line for each method over all its scenes."""
    with open_results(path) as file:
        results = in_memory(file)
        runs = [run for scene in results.scenes.values() for run in scene.methods.values()]
        facts = finding(results.scenes, claims(results.scenes))
        lines = finding_lines(facts, claim_study().shares)
        return "\n".join([*lines, "", str(method_table(runs)), ""])


def perform(job: Job) -> Result:
    """A run, or what is computed beside the runs, in a worker process. Raises StoreError."""
    return {RUN: perform_run, BENCH: perform_ladder}[job.case.study](job)


def ladder_cases(scene: Scene) -> list[Case]:
    """A short curve of each method on `scene`, judged by its reference."""
    chosen = [ladder.short for ladder in ladders() if not ladder.variant]
    able, _ = able_methods(scene, [ladder.method for ladder in chosen])
    reference = reference_case(scene).key
    sources = (*SOURCES, "studies/reproduce.py")
    return [
        Case(scene, one.method, {}, BENCH, {"curve": one.curve, "values": list(one.values)}, reference, sources)
        for one in chosen
        if one.method in able
    ]


def perform_ladder(job: Job) -> Result:
    """Runs, judges and stores one curve, in a worker process."""
    assert job.reference is not None  # every case of a ladder has a reference
    case = job.case
    short, reference = prepared_scene(case.scene, job.reference)
    ladder = next(one.short for one in ladders() if one.curve == case.options["curve"])
    points = points_of(ladder, short.duration / (short.samples - 1))
    timer = PointTimer(dict.fromkeys(points, (short, reference)))
    found, longest = Measured(), 0.0
    for point in points:
        if longest > _LONGEST_S:
            found.timings.left_out[point] = f"not run: the setting before took {longest:.2g} s"
            continue
        try:
            seconds = timer.prepare(point)
            found.timings.times[point] = [seconds["run_time_s"]]
            found.answers[point] = seconds | timer.judge(point)
            longest = seconds["run_time_s"]
        except OF_THE_MACHINE:
            raise
        except RotorError as exc:
            found.fail(point, str(exc))
        except Exception as exc:
            found.fail(point, one_line(exc))
    shared = facts_of(case, short, reference) | {
        "budget_s": _LONGEST_S, "load_before": os.getloadavg()[0], "pinned_core": -1, "is_short": True,
    }  # fmt: skip
    return store_curve(job, curve_record(case, ladder, found.rows(points), shared))
