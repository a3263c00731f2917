"""Several methods on one scene, judged against its reference: a table of errors, energy drifts and run times."""

from __future__ import annotations

import shutil
import tempfile
import weakref
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

from rotor_mbs.analysis.rehydrate import rehydrate
from rotor_mbs.errors import MethodRefusal
from rotor_mbs.execution.execute import OnProgress, ignore_progress
from rotor_mbs.methods.catalogue import check_names
from rotor_mbs.scenario.scene import Scene
from rotor_mbs.solution.solution import Solution
from rotor_mbs.store.read import open_results
from rotor_mbs.studies.run import asked_methods, run_scenes, selected_methods


@dataclass(frozen=True)
class ComparedRun:
    """A row of the table; None where a number does not exist.

    angle_error_max    rad, against the reference, up to the horizon
    energy_drift_max   of the scene's energy scale
    run_time_s         s, median
    """

    method: str
    status: str
    message: str
    angle_error_max: float | None
    energy_drift_max: float | None
    run_time_s: float


@dataclass(frozen=True)
class Comparison:
    """scene; file: the results file with its reference and runs; rows: the table, in the order of the methods."""

    scene: Scene
    file: Path
    rows: tuple[ComparedRun, ...]

    def solutions(self) -> dict[str, Solution]:
        """The runs with their samples, by method; those without any sample are left out."""
        with open_results(self.file) as results:
            stored = results.scenes[self.scene.name]
            found = {row.method: rehydrate(stored, stored.runs[row.method]).run for row in self.rows}
        return {name: run for name, run in found.items() if run is not None}


def compare(
    scene: Scene,
    methods: Sequence[str] = (),
    output: Path | None = None,
    *,
    settings: Mapping[str, object] | None = None,
    workers: int = 0,
    timeout_s: float = 60.0,
    on_progress: OnProgress = ignore_progress,
) -> Comparison:
    """The scene by several methods and its reference, each computed unless `output` has it already.

    methods      by name; where none is named, those that the rule selects for the scene
    output       results file; None: a temporary one, removed with the last reference to what is returned
    settings     of every method, in place of its defaults
    workers      parallel processes; 0: all in this process
    timeout_s    a run over this ends itself with the status timed_out

    Raises InputError for an unknown method or setting and for a method that cannot represent the scene, MethodRefusal
    where the rule selects no method, StoreError.
    """
    chosen, reasons = (asked_methods([scene], check_names(methods)), []) if methods else selected_methods([scene])
    if not chosen[scene.name]:
        raise MethodRefusal("; ".join(reasons))
    if output is None:
        folder = Path(tempfile.mkdtemp(prefix="rotor-mbs-"))
        found = compare(
            scene, methods, folder / "compare.h5", settings=settings, workers=workers, timeout_s=timeout_s,
            on_progress=on_progress,
        )  # fmt: skip
        weakref.finalize(found, shutil.rmtree, folder)
        return found
    run_scenes(
        [scene], chosen, output, workers=workers, timeout_s=timeout_s, settings=settings, on_progress=on_progress
    )
    return Comparison(scene, output, _rows(output, scene, chosen[scene.name]))


def _rows(path: Path, scene: Scene, methods: Sequence[str]) -> tuple[ComparedRun, ...]:
    with open_results(path) as results:
        runs = results.scenes[scene.name].runs
        facts = [(name, runs[name].attributes) for name in methods if name in runs]
        return tuple(
            ComparedRun(
                name, str(one["status"]), str(one["message"]), one.get("angle_error_max"), one.get("energy_drift_max"),
                float(one["run_time_s"]),
            )
            for name, one in facts
        )  # fmt: skip
