"""The main job: every scene of the paper by the default methods and with each erratum alone.

And error against run time of all methods on one scene, at a few settings each, in seconds: a bench takes one process on
one core and rounds over all points; here each curve is a task beside the runs, and a point is run once. Its errors are
those of a bench, its times are good to a factor.
"""

from __future__ import annotations

import hashlib
from dataclasses import dataclass
from pathlib import Path

import rotor_mbs
from rotor_mbs.analysis.published import claims, finding
from rotor_mbs.analysis.text_tables import TextTable, method_table
from rotor_mbs.methods.catalogue import REFERENCE, able_methods, default_methods, errata_methods, ladders
from rotor_mbs.runs.output_files import locked
from rotor_mbs.runs.pool import Workers, pool_of
from rotor_mbs.runs.read import open_results
from rotor_mbs.runs.runner import OnProgress, Task, compute_tasks, ignore_progress
from rotor_mbs.runs.table import Rows, extend_file, results_tables
from rotor_mbs.runs.versions import versions
from rotor_mbs.scenario.catalogue import find_scenes, reference_folder, scenarios_folder
from rotor_mbs.scenario.scene import Scene
from rotor_mbs.studies.bench import (
    Curve,
    PointTimer,
    bench_table,
    curve_of,
    facts_of,
    is_measured,
    prepared,
    rows_of_curve,
)
from rotor_mbs.studies.run import RunReport, asked_runs, run_tasks, work_of

# The scene whose error against run time is measured by all methods: the paper's own crest, and a horizon of 6 s.
BENCHED = "paper/fig11"
_LONGEST_S = 0.25  # a run longer than this is the last of its curve: the next one takes up to eight times as long


@dataclass(frozen=True, kw_only=True)
class CurveTask(Task):
    """A short curve on its way to a worker process: consecutive rows of the table /bench."""

    curve: Curve

    def perform(self) -> Rows:
        """Run and judge the points of one curve; their rows."""
        curve = self.curve
        assert self.reference is not None  # every curve has one
        short, reference = prepared(curve.scene, self.reference)
        longest, rows = 0.0, []
        for point in curve.points:
            timer = PointTimer(point, short, reference)
            if longest > _LONGEST_S:
                timer.left_out = f"not run: the setting before took {longest:.2g} s"
            else:
                timer.warm_up()
            if timer.is_repeatable:
                longest = timer.warm_s
                timer.times.append(longest)
            rows.append(timer.row())
        return rows_of_curve(self.place, curve, rows, facts_of(short, reference))


def reproduce(
    output: Path, *, workers: Workers, timeout_s: float, on_progress: OnProgress = ignore_progress
) -> RunReport:
    """Into the results file `output`; what it has already is kept. Raises InputError, StoreError."""
    scenes, benched = find_scenes(["paper"]), find_scenes([BENCHED])[0]
    names = (*default_methods(), *errata_methods().values())
    methods = {scene.name: able_methods(scene, names)[0] for scene in scenes}
    curves = short_curves(benched)
    asked = asked_runs(scenes, methods, {})
    with locked(output), pool_of(workers) as pool:
        file = extend_file(output, [*results_tables(asked), bench_table(curves)], [curve.key for curve in curves])
        missing, kept = file.split_missing(asked, timeout_s)
        runs: list[Task] = [*run_tasks(missing, timeout_s)]
        reference = f"{benched.name}/{REFERENCE}"
        is_new = any(run.label == reference for run, _, _ in missing)
        of_curves = [
            CurveTask(
                label=curve.label,
                method=curve.method,
                place=curve.place(file),
                reference=file.place(reference),
                kill_after_s=1.2 * timeout_s + 10.0,
                work=work_of(benched, curve.method),
                curve=curve,
            )
            for curve in curves
            if is_new or not is_measured(file, curve)
        ]
        made = compute_tasks([*runs, *of_curves], pool, on_progress)
        labels = {task.label for task in runs}
        return RunReport([outcome for outcome in made if outcome.label in labels], kept)


def made_from(results: Path, timeout_s: float) -> str:
    """A digest of the results file, code, versions, scenes, references and the time limit."""
    package = Path(rotor_mbs.__file__).parent
    sources = sorted(path for path in package.rglob("*") if path.is_file() and path.parent.name != "__pycache__")
    digest = hashlib.sha256(f"{versions()} {timeout_s}".encode())
    for path in (results, *sources, *sorted(scenarios_folder().rglob("*.toml")), *sorted(reference_folder().iterdir())):
        with path.open("rb") as file:
            digest.update(hashlib.file_digest(file, "sha256").digest())
    return digest.hexdigest()


def summary_of(path: Path) -> str:
    """Numbers and claims of the paper, and a line for each method over all its scenes."""
    with open_results(path) as results:
        runs = [run for scene in results.scenes.values() for run in scene.methods.values()]
        rows = finding(results.scenes, claims(results.scenes))
        table = TextTable(("result", "as printed", "corrected model"), [*rows])
        return f"{table}\n\n{method_table(runs)}\n"


def short_curves(scene: Scene) -> list[Curve]:
    """A short curve of each method on `scene`."""
    able, _ = able_methods(scene, list(dict.fromkeys(ladder.method for ladder in ladders())))
    options = {"budget_s": _LONGEST_S, "is_short": True}
    return [curve_of(scene, ladder.short, options) for ladder in ladders(able) if not ladder.variant]
