"""Conservation: each method on a scene, on its images and backwards in time; perturbed starts for the energy drift.

The scene must be without damping and without a load that changes.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from rotor_mbs.analysis import exact as theory
from rotor_mbs.execution.execute import Job
from rotor_mbs.methods.solve import solve
from rotor_mbs.methods.time_limit import OutOfTimeError, time_limit
from rotor_mbs.scenario.scene import Scene
from rotor_mbs.solution.impulse import angular_momentum
from rotor_mbs.solution.metrics import energy_scale
from rotor_mbs.solution.quantities import energy_error
from rotor_mbs.solution.trajectory import Trajectory
from rotor_mbs.store.records import Record

SYMMETRY, DRIFT = "symmetry", "drift"

_LIMIT_S = 30.0
# Enough starts for an exponent to ±0.05, on a motion long enough for round-off to walk.
STARTS = 64
_LONG_S = 4000.0
_PERTURBATION = 1e-3
_SEED = 20200101  # any: the starts must be the same on every machine


def conservation_record(job: Job) -> Record:
    """What an exact run conserves: errors, relative or in rad; where a run fails, its message."""
    scene, method = job.case.scene, job.case.method
    try:
        with time_limit(_LIMIT_S):
            symmetry = _symmetry(scene, method)
            if job.case.study != DRIFT:
                return Record("conservation", scene.name, method, symmetry)
            drift = drift_record(scene, method)
            return replace(drift, attributes={**symmetry, **drift.attributes})
    except OutOfTimeError as exc:
        return Record("conservation", scene.name, method, {"message": str(exc)})


def drift_record(scene: Scene, method: str) -> Record:
    """Root mean square of the relative energy error over perturbed starts, over time, and its growth exponent."""
    generator = np.random.default_rng(_SEED)
    long = replace(scene, duration=_LONG_S, samples=401, outputs=("angles", "rates", "energy"))
    squares = np.zeros(long.samples)
    for _ in range(STARTS):
        shift = _PERTURBATION * generator.standard_normal(len(long.initial_angles))
        start = replace(long, initial_angles=tuple((np.array(long.initial_angles) + shift).tolist()))
        run = _run(start, method)
        error = energy_error(run)
        assert error is not None  # the scene asks for energies
        squares += (error / energy_scale(start, run)) ** 2
        time = run.time
    rms = np.sqrt(squares / STARTS)
    attributes = {"exponent": theory.drift_exponent(time, rms), "starts": STARTS, "largest": float(rms.max())}
    return Record("conservation", scene.name, method, attributes, {"time": time, "energy_drift_rms": rms})


def _run(scene: Scene, method: str) -> Trajectory:
    return solve(method, scene, {}).trajectory


def _symmetry(scene: Scene, method: str) -> dict[str, float]:
    """rad, but for the angular momentum (relative); what does not exist for the scene is left out."""
    there = _run(scene, method)
    found = {
        "mirror_error": theory.mirror_error(there.angles, _run(theory.mirrored(scene), method).angles),
        "relabelling_error": theory.relabelling_error(there.angles, _run(theory.relabelled(scene), method).angles),
    }
    # From the last sample on with all rates reversed it runs back to its start.
    end = tuple(there.angles[-1].tolist()), tuple((-there.rates[-1]).tolist())
    back = _run(replace(scene, initial_angles=end[0], initial_rates=end[1]), method)
    found["reversal_error"] = float(np.abs(back.angles[-1] - np.array(scene.initial_angles)).max())
    if scene.gravity == 0.0 and not scene.has_torque:
        momentum = angular_momentum(scene, there.angles, there.rates)
        found["angular_momentum_drift"] = float(np.abs(momentum - momentum[0]).max() / abs(momentum[0]))
    return found
