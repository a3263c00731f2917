"""What the timing worker of a bench does: it builds a point, runs it as often as asked, and judges the last run.

A point is one method at one setting. Engines are loaded beforehand, so that this is part of no run's time.
"""

from __future__ import annotations

import gc
import time
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, TypeAlias

import numpy as np

from rotor_mbs.analysis.judgement import judge
from rotor_mbs.errors import InputError
from rotor_mbs.methods.base import Solver
from rotor_mbs.methods.catalogue import REFERENCE, find_method
from rotor_mbs.runs.results import TableFile
from rotor_mbs.scenario.scene import Scene
from rotor_mbs.solution.solution import Solution
from rotor_mbs.solution.status import COMPLETE
from rotor_mbs.solution.trajectory import Array, Integration, Trajectory
from rotor_mbs.studies.stored_references import read_reference

# Errors are compared on at most so many sample intervals: more would make every step shorter than a coarse rung's, and
# a bench would time the reading of samples.
_MOST_INTERVALS = 100
# An error as large as the motion itself: such a run is a failure, not a point on the curve.
USELESS_RAD = 1.0
USELESS_DRIFT = 0.1  # of the energy scale, where there is no reference
ERRORS = ("angle_error_max", "angle_error_end", "tip_error_max", "energy_drift_max", "defect_max", "defect_median")


@dataclass(frozen=True)
class Point:
    """One method at one setting: a rung of a curve. settings as (name, value) pairs."""

    curve: str
    method: str
    setting: float
    settings: tuple[tuple[str, object], ...]


# Of each point its scene, and its reference if there is one.
PointScenes: TypeAlias = Mapping[Point, tuple[Scene, Trajectory | None]]


class PointTimer:
    """Prepares, repeats and judges points; first prepares one that the process before this one had prepared.

    Its answers are numbers by the names that they are stored under; times in s.
    """

    def __init__(self, scenes: PointScenes, clock: Callable[[], float] = time.perf_counter) -> None:
        self._scenes, self._clock = scenes, clock
        self._solvers: dict[Point, Solver] = {}
        self._last: dict[Point, Integration] = {}
        self._first_angles: dict[Point, Array] = {}

    def prepare(self, point: Point) -> dict[str, float]:
        """The times of a first build (everything compiled anew), of a second one, and of one run (the warm-up)."""
        method = find_method(point.method)
        settings = method.settings.of(point.method, dict(point.settings))
        scene, _ = self._scenes[point]
        setups = []
        for _ in range(2):
            start = self._clock()
            self._solvers[point] = method.build(scene, settings)
            setups.append(self._clock() - start)
        if not gc.isenabled():  # in the timing worker
            gc.collect()
        seconds = self._timed_run(point)
        self._first_angles[point] = self._solvers[point].observe().angles
        return {"setup_time_s": setups[0], "setup_again_time_s": setups[1], "run_time_s": seconds}

    def repeat(self, point: Point) -> float:
        """Seconds of one more run."""
        if point not in self._solvers:
            self.prepare(point)
        return self._timed_run(point)

    def _timed_run(self, point: Point) -> float:
        solver = self._solvers[point]
        start = self._clock()
        self._last[point] = solver.integrate()
        return self._clock() - start

    def judge(self, point: Point) -> dict[str, Any]:
        """The last run's status, message, errors, steps, and time to read out and compute the samples; `same`: whether
        it is bit for bit the warm-up. The point is done with."""
        if point not in self._solvers:
            self.prepare(point)
        start = self._clock()
        trajectory = self._solvers[point].observe()
        output = self._clock() - start
        integration = self._last[point]
        scene, reference = self._scenes[point]
        method = find_method(point.method)
        run = Solution(scene, point.method, trajectory, integration, dict(point.settings))
        run.is_corrected, run.bounds = method.is_corrected, method.bounds
        with np.errstate(over="ignore", invalid="ignore"):  # a runaway's distances may overflow
            judgement = judge(scene, run, reference)
        status, message = _status(judgement.status, judgement.message, judgement.metrics)
        del self._solvers[point]
        same = np.array_equal(trajectory.angles, self._first_angles[point])
        errors = judgement.metrics if status in COMPLETE else {}  # those of a run that broke off are of its part
        return {
            "status": status,
            "message": message,
            "false_success": int(integration.success and status != "ok"),
            "steps": integration.steps or 0,
            "output_time_s": output,
            "same": same,
            **{name: errors.get(name, np.nan) for name in ERRORS},
        }


def _status(status: str, message: str, metrics: Mapping[str, float]) -> tuple[str, str]:
    """A bench asks how large an error is: it is a failure only where nothing of the motion is right."""
    if status not in COMPLETE:
        return status, message
    if "angle_error_max" not in metrics:  # no reference: energy alone decides
        return ("ok", "") if metrics.get("energy_drift_max", np.inf) < USELESS_DRIFT else (status, message)
    error = metrics["angle_error_max"]
    if error < USELESS_RAD:
        return "ok", ""
    return "inaccurate", f"angle error {error:.1e} rad before the horizon: as large as the motion"


_timer = PointTimer({})


def start_timer(methods: Sequence[str], scenes: PointScenes) -> None:
    """Makes this process one that does nothing but time points: engines loaded, collector off."""
    global _timer
    for method in methods:
        find_method(method).load()
    gc.disable()
    _timer = PointTimer(scenes)


def ask(request: tuple[str, Point]) -> Any:
    """What the timer of this process answers: ("prepare", "repeat" or "judge", point)."""
    task, point = request
    if task == "prepare":
        return _timer.prepare(point)
    return _timer.repeat(point) if task == "repeat" else _timer.judge(point)


def prepared_scene(scene: Scene, results: Path) -> tuple[Scene, Trajectory]:
    """The scene as it is benched, without loads, and its reference. Raises InputError where the file has none."""
    reference = read_reference(TableFile(results).place(f"{scene.name}/{REFERENCE}"), scene)
    return prepared(scene, reference)


def prepared(scene: Scene, reference: Trajectory | None) -> tuple[Scene, Trajectory]:
    """The scene as it is benched, and its reference at the same samples. Raises InputError where there is none."""
    if reference is None or len(reference.time) < scene.samples:
        raise InputError(f"{scene.name}: no usable reference (it does not reach the end); a bench needs one")
    short, k = thinned(scene)
    short = replace(short, outputs=tuple(name for name in short.outputs if name != "loads"))
    return short, thinned_reference(reference, k)


def thinned(scene: Scene) -> tuple[Scene, int]:
    """The scene with every k-th sample, and k: the finest thinning with at most 100 intervals, or none."""
    intervals = scene.samples - 1
    k = next((k for k in range(1, intervals + 1) if intervals % k == 0 and intervals // k <= _MOST_INTERVALS), 1)
    # A number of intervals without a fitting divisor would leave too few samples to see an error's largest.
    k = k if intervals // k >= _MOST_INTERVALS // 5 or intervals <= _MOST_INTERVALS else 1
    return replace(scene, samples=intervals // k + 1), k


def thinned_reference(reference: Trajectory, k: int) -> Trajectory:
    """Every k-th sample of everything that a comparison uses."""
    arrays = {name: values[::k] for name, values in reference.quantities.items()}
    return Trajectory(reference.time[::k], reference.angles[::k], reference.rates[::k], **arrays)
