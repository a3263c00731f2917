"""Compute every scene of the paper by the default methods, and with each erratum alone.

The study also measures error and run time of all methods on one scene, as curves over a few
settings, within seconds. A bench runs its points one after the other in one process on one core,
and repeats them in rounds. Here each curve is a task beside the runs, and each point is run once.
The errors are those of a bench; the times are only approximate.
"""

from __future__ import annotations

import hashlib
from pathlib import Path

import rotor_mbs
from rotor_mbs.analysis.published import claims, finding
from rotor_mbs.analysis.text_tables import TextTable, method_table
from rotor_mbs.methods.catalogue import (
    REFERENCE,
    default_methods,
    errata_methods,
    ladders,
)
from rotor_mbs.methods.selection import Refusal, supporting_methods
from rotor_mbs.processes.pool import Workers, pool_of
from rotor_mbs.runs.design import results_tables
from rotor_mbs.runs.merge import fit_file_to_request
from rotor_mbs.runs.output_files import locked
from rotor_mbs.runs.read import open_results
from rotor_mbs.runs.runner import (
    OnProgress,
    RunOutcome,
    ignore_progress,
    run_tasks_references_first,
)
from rotor_mbs.runs.versions import versions
from rotor_mbs.scenario.catalogue import REFERENCES, SCENARIOS, find_scenes
from rotor_mbs.scenario.scene import Scene
from rotor_mbs.studies.bench import Curve, curve_of, curve_tables, curve_tasks
from rotor_mbs.studies.run import missing_runs, requested_runs

# Scene on which the error and run time of all methods are measured. The paper prints the crest of
# its rotor angle, and its horizon is 6 s.
BENCHED = "paper/fig11"
# Time in s: a run that takes longer is the last of its curve, as the next run may take eight times
# as long.
_LONGEST_S = 0.25


def reproduce(
    output: Path, *, workers: Workers, timeout_s: float, on_progress: OnProgress = ignore_progress
) -> tuple[list[RunOutcome], list[Refusal]]:
    """Compute the default set of runs and the curves into a results file; stored rows are kept.

    Parameters
    ----------
    output : the results file.
    workers : number of parallel processes, or a pool that is open.
    timeout_s : time limit of a run in s.
    on_progress : called after each run and each curve.

    Returns
    -------
    list of RunOutcome
        The runs that this call computed or tried to compute, then the runs that were stored before.
    list of Refusal
        The runs that were left out, as their method cannot represent the scene.

    Raises
    ------
    InputError, StoreError
        Rows that were computed before the error stay in the file, and a repeated call computes the
        others.
    """
    scenes, benched = find_scenes(["paper"]), find_scenes([BENCHED])[0]
    names = (*default_methods(), *errata_methods().values())
    methods: dict[str, list[str]] = {}
    refused: list[Refusal] = []
    for scene in scenes:
        methods[scene.name], others = supporting_methods(scene, names, {}, are_named=False)
        refused += others
    curves = short_curves(benched)
    requests = requested_runs(scenes, methods, {})
    with locked(output), pool_of(workers) as pool:
        file = fit_file_to_request(
            output,
            [*results_tables(requests), *curve_tables(curves)],
            [curve.key for curve in curves],
        )
        runs, stored = missing_runs(file, requests, timeout_s)
        labels = {task.label for task in runs}
        is_new = f"{benched.name} {REFERENCE}" in labels
        unmeasured = [curve for curve in curves if is_new or not curve.is_stored(file)]
        of_curves = curve_tasks(file, unmeasured, 1.2 * timeout_s + 10.0, _LONGEST_S)
        made = run_tasks_references_first([*runs, *of_curves], pool, on_progress)
        return [outcome for outcome in made if outcome.label in labels] + stored, refused


def made_from(results: Path, timeout_s: float) -> str:
    """Return a digest of a results file and of everything that it was computed from.

    The digest covers the package's files, the versions, scenes, references and the time limit.

    Parameters
    ----------
    results : the results file.
    timeout_s : time limit of a run in s.
    """
    package = Path(rotor_mbs.__file__).parent
    sources = sorted(
        path for path in package.rglob("*") if path.is_file() and path.parent.name != "__pycache__"
    )
    digest = hashlib.sha256(f"{versions()} {timeout_s}".encode())
    for path in (
        results,
        *sources,
        *sorted(SCENARIOS.rglob("*.toml")),
        *sorted(REFERENCES.iterdir()),
    ):
        with path.open("rb") as file:
            digest.update(hashlib.file_digest(file, "sha256").digest())
    return digest.hexdigest()


def summary_of(path: Path) -> str:
    """Return the summary of a results file as text.

    It counts the numbers and claims of the paper that the printed equations and the corrected model
    reproduce, and has a line for each method.
    """
    with open_results(path) as results:
        runs = [run for scene in results.scenes.values() for run in scene.methods.values()]
        rows = finding(results.scenes, claims(results.scenes))
        table = TextTable(("result", "as printed", "corrected model"), [*rows])
        return f"{table}\n\n{method_table(runs)}\n"


def short_curves(scene: Scene) -> list[Curve]:
    """Return a short curve of each method that can represent `scene`."""
    able, _ = supporting_methods(
        scene, list(dict.fromkeys(method.name for method, _ in ladders().values()))
    )
    options = {"budget_s": _LONGEST_S, "is_short": True}
    return [
        curve_of(scene, method, ladder.coarse, options)
        for method, ladder in ladders(able).values()
        if not ladder.variant
    ]
