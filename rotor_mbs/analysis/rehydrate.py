"""A stored run back as the scene, run and reference it was, so that the one judgement can be passed on it again."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from rotor_mbs.scenario.load import parse_scene
from rotor_mbs.scenario.scene import Scene
from rotor_mbs.solution.record import Array, Integration, Solution, Trajectory
from rotor_mbs.store.read import StoredRun, StoredScene

ENERGIES = ("kinetic_energy", "potential_energy", "work")


@dataclass(frozen=True)
class Restored:
    """scene: as its stored text says; run: None where not even times are stored; reference: None where there is none.

    faults   a line for every channel that is missing, of the wrong length, or not finite
    """

    scene: Scene
    run: Solution | None
    reference: Trajectory | None
    faults: list[str]


def restore(stored: StoredScene, run: StoredRun) -> Restored:
    """Raises InputError where the stored scene text is no scene."""
    scene = parse_scene(str(stored.attributes["scene_toml"]), stored.name)
    faults = _faults(scene, run)
    reference = None
    if stored.reference is not None and not _faults(scene, stored.reference, complete=False):
        reference = _trajectory(scene, stored.reference)
    if faults and not _is_shorter_only(scene, run):
        return Restored(scene, None, reference, faults)
    facts = run.attributes
    engine = Integration(
        bool(facts.get("engine_success", 0)),
        str(facts.get("engine_message", "")),
        out_of_time=run.status == "timed_out" and not facts.get("engine_success", 0),
    )
    trajectory = _trajectory(scene, run)
    return Restored(scene, Solution(run.method, trajectory, engine, run.settings, 0.0, [0.0], 0.0), reference, faults)


def _is_shorter_only(scene: Scene, run: StoredRun) -> bool:
    """Whether all that is wrong is that the run stops early, with every channel at the same sample."""
    return not _faults(scene, run, complete=False)


def _faults(scene: Scene, run: StoredRun, complete: bool = True) -> list[str]:
    """complete: every sample must be there; else as many as there are times."""
    expected = ["time", *(name for name in ("angles", "rates", "tip") if scene.wants(name))]
    expected += [*ENERGIES, "energy_error"] if scene.wants("energy") else []
    if run.method == "reference":
        expected += ["angle_uncertainty"]
    shapes = {"angles": (1 + len(scene.blades),), "rates": (1 + len(scene.blades),), "tip": (len(scene.blades), 3)}
    rows = scene.samples if complete or "time" not in run else len(run.array("time"))
    return [fault for name in expected if (fault := _fault(run, name, (rows, *shapes.get(name, ()))))]


def _fault(run: StoredRun, name: str, shape: tuple[int, ...]) -> str:
    if name not in run:
        return f"{name} is missing"
    values = run.array(name)
    if values.dtype.kind != "f" or values.shape[1:] != shape[1:]:
        return f"{name} has shape {values.shape} of {values.dtype}, not {shape} of numbers"
    if len(values) != shape[0]:
        return f"{name} has {len(values)} rows, not {shape[0]}"
    if not np.isfinite(values).all():
        return f"{name} is not finite at sample {int(np.argwhere(~np.isfinite(values))[0][0])}"
    return ""


def _trajectory(scene: Scene, run: StoredRun) -> Trajectory:
    """Angles and rates that were not asked for are zeros, and not to be judged."""
    time = run.array("time")
    blank = np.zeros((len(time), 1 + len(scene.blades)))
    named: dict[str, Any] = {
        name: run.array(name) if name in run else None for name in ("tip", *ENERGIES, "constraint_error")
    }
    angles: Array = run.array("angles") if "angles" in run else blank
    rates: Array = run.array("rates") if "rates" in run else blank
    growth = run.array("error_growth") if "error_growth" in run else None
    return Trajectory(time, angles, rates, growth=growth, **named)
