"""One run, start to stored piece, in a worker process: solve, judge against the reference, write."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

from rotor_mbs.methods.base import solve
from rotor_mbs.methods.catalogue import REFERENCE, find_method
from rotor_mbs.methods.time_limit import OutOfTimeError
from rotor_mbs.scenario.scene import Scene
from rotor_mbs.solution.judgement import judge
from rotor_mbs.solution.record import Integration, Trajectory
from rotor_mbs.solution.solution import Solution
from rotor_mbs.store.read import StoredRun, open_results
from rotor_mbs.store.write import write_run

# Short runs are repeated, so that the stored time is not that of a cold cache; long ones are not.
_REPEATS = 5
_REPEAT_BUDGET_S = 0.05


@dataclass(frozen=True)
class Task:
    """A run to make. `piece`: where it is written; `reference`: a results file with the scene's reference, if any.

    frozen: for the reference alone, a file that has it already.
    time_limit_s: the run ends itself then, and what it reached is stored.
    """

    scene: Scene
    scene_hash: str
    method: str
    run_hash: str
    piece: Path
    settings: Mapping[str, object] = field(default_factory=dict)
    reference: Path | None = None
    time_limit_s: float = float("inf")
    frozen: Path | None = None

    @property
    def label(self) -> str:
        return f"{self.scene.name} {self.method}"


@dataclass(frozen=True)
class Summary:
    """What the parent tells of a finished run."""

    status: str
    message: str
    run_time_s: float


def perform(task: Task) -> Summary:
    """Solves, judges and stores one task. Raises StoreError where the piece cannot be written."""
    if task.frozen is not None:
        run, attributes = _thawed(task, task.frozen)
        reference: Trajectory | None = run.trajectory
    else:
        method = find_method(task.method)
        try:
            run = solve(task.method, method, task.scene, task.settings, _REPEATS, _REPEAT_BUDGET_S, task.time_limit_s)
        except OutOfTimeError as exc:  # from a method that cannot be stopped with its samples
            return record_failure(task, "timed_out", str(exc))
        attributes = {}
        reference = run.trajectory if task.method == REFERENCE else load_reference(task)
    verdict = judge(task.scene, run, reference)
    attributes |= {
        "status": verdict.status,
        "message": verdict.message,
        "false_success": verdict.false_success,
        "run_hash": task.run_hash,
        **verdict.metrics,
    }
    write_run(task.piece, task.scene_hash, run, attributes)
    return Summary(verdict.status, verdict.message, float(np.median(run.run_times_s)))


def record_failure(task: Task, status: str, message: str) -> Summary:
    """Stores a run that left no samples: its process was ended, or died."""
    columns = 1 + len(task.scene.blades)
    trajectory = Trajectory(np.empty(0), np.empty((0, columns)), np.empty((0, columns)))
    run = Solution(task.scene, task.method, trajectory, Integration(False, message), dict(task.settings))
    attributes = {"status": status, "message": message, "false_success": False, "run_hash": task.run_hash}
    write_run(task.piece, task.scene_hash, run, attributes)
    return Summary(status, message, 0.0)


def load_reference(task: Task) -> Trajectory | None:
    """The reference of the task's scene; None where there is none, or where it is empty."""
    if task.reference is None:
        return None
    with open_results(task.reference) as results:
        stored = results.scenes[task.scene.name].reference
        if stored is None or not len(stored.array("time")):
            return None
        return reference_trajectory(task.scene, stored)


def reference_trajectory(scene: Scene, stored: StoredRun) -> Trajectory:
    """A stored reference with what its scene asks for, computed from its angles and rates by its own closed form."""
    from rotor_mbs.models.lagrange import samples

    angles, rates = stored.array("angles"), stored.array("rates")
    moving = [0] + [1 + i for i, blade in enumerate(scene.blades) if blade.has_pitch_inertia]
    states = [angles[:, moving], rates[:, moving]]
    if "work" in stored:
        states.append(stored.array("work")[:, None])
    result = samples.trajectory(scene, stored.array("time"), np.hstack(states), tuple(moving))
    result.angle_uncertainty = stored.array("angle_uncertainty")
    result.error_growth = stored.array("error_growth") if "error_growth" in stored else None
    return result


def _thawed(task: Task, frozen: Path) -> tuple[Solution, dict[str, object]]:
    """The frozen reference as if it had been run now, with the settings and times of when it was."""
    with open_results(frozen) as results:
        scene = next(s for s in results.scenes.values() if s.attributes["scene_hash"] == task.scene_hash)
        stored = scene.reference
        assert stored is not None  # found so by whoever made the task
        facts = stored.attributes
        trajectory = reference_trajectory(task.scene, stored)
        complete = len(trajectory.time) == task.scene.samples
        run = Solution(
            task.scene,
            REFERENCE,
            trajectory,
            Integration(
                complete,
                "" if complete else "the frozen reference ends here",
                facts["time_reached"],
                facts["steps"],
                out_of_time=facts["status"] == "timed_out",
            ),
            stored.settings,
            facts["setup_time_s"],
            [facts["run_time_s"]],
            facts["output_time_s"],
        )
        return run, {"frozen_with": facts["frozen_with"]}
