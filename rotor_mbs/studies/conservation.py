"""Experiments on conservation: each method on a scene, its images and its way back; perturbed starts for the drift."""

from __future__ import annotations

from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from rotor_mbs.analysis import conservation as kept
from rotor_mbs.methods.solve import solve
from rotor_mbs.methods.time_limit import OutOfTimeError, time_limit
from rotor_mbs.scenario.scene import Scene
from rotor_mbs.solution.metrics import energy_scale
from rotor_mbs.solution.quantities import energy_error
from rotor_mbs.solution.record import Trajectory
from rotor_mbs.store.records import Record

_LIMIT_S = 30.0
# Enough starts for an exponent to ±0.05, on a motion long enough for round-off to walk.
STARTS = 64
_LONG_S = 4000.0
_PERTURBATION = 1e-3
_SEED = 20200101  # any: the starts must be the same on every machine


@dataclass(frozen=True)
class ConservationTask:
    """kind: "symmetry", or "drift" for that and the drift; piece: where the record goes.

    The scene must be without damping and without a torque that changes.
    """

    kind: str
    scene: Scene
    method: str
    piece: Path | None = None


def perform_conservation(task: ConservationTask) -> Record:
    """What an exact run keeps, as a record: relative, or in rad; where a run fails, its message."""
    try:
        with time_limit(_LIMIT_S):
            symmetry = _symmetry(task.scene, task.method)
            if task.kind != "drift":
                return Record("conservation", task.scene.name, task.method, symmetry)
            drift = drift_record(task)
            return replace(drift, attributes={**symmetry, **drift.attributes})
    except OutOfTimeError as exc:
        return Record("conservation", task.scene.name, task.method, {"message": str(exc)})


def drift_record(task: ConservationTask, starts: int = STARTS, duration: float = _LONG_S) -> Record:
    """Root mean square of the relative energy error over perturbed starts, over time, and its growth exponent."""
    generator = np.random.default_rng(_SEED)
    scene = replace(task.scene, duration=duration, samples=401, outputs=("angles", "rates", "energy"))
    squares = np.zeros(scene.samples)
    for _ in range(starts):
        shift = _PERTURBATION * generator.standard_normal(len(scene.initial_angles))
        start = replace(scene, initial_angles=tuple((np.array(scene.initial_angles) + shift).tolist()))
        run = _run(start, task.method)
        error = energy_error(run)
        assert error is not None  # the scene asks for energies
        squares += (error / energy_scale(start, run)) ** 2
        time = run.time
    rms = np.sqrt(squares / starts)
    attributes = {"exponent": kept.growth_exponent(time, rms), "starts": starts, "largest": float(rms.max())}
    return Record("conservation", task.scene.name, task.method, attributes, {"time": time, "energy_drift_rms": rms})


def _run(scene: Scene, method: str) -> Trajectory:
    return solve(method, scene, {}).trajectory


def _symmetry(scene: Scene, method: str) -> dict[str, float]:
    """rad, but for the angular momentum (relative); what does not exist for the scene is left out."""
    there = _run(scene, method)
    found = {
        "mirror_error": kept.mirror_error(there.angles, _run(kept.mirrored(scene), method).angles),
        "relabelling_error": kept.relabelling_error(there.angles, _run(kept.relabelled(scene), method).angles),
    }
    back = _run(kept.reversed_from(scene, there.angles, there.rates), method)
    found["reversal_error"] = float(np.abs(back.angles[-1] - np.array(scene.initial_angles)).max())
    if scene.gravity == 0.0 and not scene.has_torque:
        momentum = kept.angular_momentum(scene, there.angles, there.rates)
        found["angular_momentum_drift"] = kept.largest_relative_change(momentum)
    return found
