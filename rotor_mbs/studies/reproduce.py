"""The main job: every scene of the paper by the default methods and with each erratum alone; the errata checked.

And error against run time of all methods on one scene, at a few settings each.
"""

from __future__ import annotations

from dataclasses import asdict
from pathlib import Path

from rotor_mbs.analysis.claim_records import shipped_claims
from rotor_mbs.analysis.errata import CheckedEntry, errata_fingerprint, write_errata
from rotor_mbs.execution.case import RUN
from rotor_mbs.execution.execute import Job, OnProgress, Result, ignore_progress
from rotor_mbs.execution.provenance import numerics_fingerprint
from rotor_mbs.methods.catalogue import default_methods, errata_methods
from rotor_mbs.scenario.catalogue import find_scenes
from rotor_mbs.store.read import open_results
from rotor_mbs.store.results_file import ResultsStore
from rotor_mbs.studies.run import RunReport, able_methods, perform_run, run_scenes
from rotor_mbs.studies.short_ladders import ladder_cases, perform_ladder

# The scene whose error against run time is measured by all methods: the paper's own crest, and a horizon of 6 s.
BENCHED = "paper/fig11"


def reproduce(output: Path, *, workers: int, timeout_s: float, on_progress: OnProgress = ignore_progress) -> RunReport:
    """Into the results file `output`; what it has already is kept. Raises InputError, StoreError."""
    scenes = find_scenes(["paper"])
    names = (*default_methods(), *errata_methods().values())
    methods = {scene.name: able_methods(scene, names)[0] for scene in scenes}
    # Before the runs: the whole file is written anew with each merge, and now it is small.
    _complete_errata(output)
    _complete_claims(output)
    return run_scenes(
        scenes, methods, output, workers=workers, timeout_s=timeout_s, on_progress=on_progress,
        beside=ladder_cases(find_scenes([BENCHED])[0]), perform=perform,
    )  # fmt: skip


def perform(job: Job) -> Result:
    """A run, or a curve of error against run time, in a worker process. Raises StoreError."""
    return perform_run(job) if job.case.study == RUN else perform_ladder(job)


def _complete_errata(output: Path) -> None:
    """The check of every printed entry, unless the file has that of the same code already."""
    from rotor_mbs.models.printed.errata import check_errata

    if output.exists():
        with open_results(output) as results:
            if errata_fingerprint(results) == numerics_fingerprint():
                return
    checks = [
        CheckedEntry(**{**asdict(check), "explained_by": ", ".join(check.explained_by)}) for check in check_errata()
    ]
    part = output.with_name(f"{output.name}.errata.h5")
    write_errata(part, checks, numerics_fingerprint())
    ResultsStore(output).merge([part])
    part.unlink()


def _complete_claims(output: Path) -> None:
    """The shipped study of claims and numbers, whose thousands of runs take too long to be repeated here."""
    shipped, results = shipped_claims(), ResultsStore(output)
    if shipped.exists() and not ResultsStore(shipped).stored_keys() <= results.stored_keys():
        results.merge([shipped])
