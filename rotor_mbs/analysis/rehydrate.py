"""A stored run back as scene, solution and reference, so that it can be judged again from its samples."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from rotor_mbs.errors import InputError
from rotor_mbs.methods.catalogue import REFERENCE, look_up
from rotor_mbs.runs.read import StoredRun, StoredScene
from rotor_mbs.runs.results import FROZEN
from rotor_mbs.scenario.scene import Scene, parse_scene
from rotor_mbs.solution.quantities import known_quantities, quantities, row_shape
from rotor_mbs.solution.solution import Solution
from rotor_mbs.solution.trajectory import Integration, Trajectory


class Rehydrated(NamedTuple):
    """run: None where its arrays cannot be used; faults: a line for every array that is missing or wrong."""

    scene: Scene
    run: Solution | None
    reference: Trajectory | None
    faults: list[str]


def scene_of(stored: StoredScene) -> Scene | None:
    """The scene of its stored text; None where that is not a scene."""
    try:
        return parse_scene(str(stored.attributes.get("scene_toml", "")), stored.name)
    except InputError:
        return None


def reference_of(stored: StoredScene) -> Trajectory | None:
    """The scene's reference; None where there is none, or its arrays cannot be used. Raises InputError, StoreError."""
    scene = parse_scene(str(stored.attributes["scene_toml"]), stored.name)
    if stored.reference is None or _faults(scene, stored.reference, complete=False):
        return None
    return _trajectory(scene, stored.reference)


def rehydrate(stored: StoredScene, run: StoredRun, reference: Trajectory | None = None) -> Rehydrated:
    """reference: where it has been read already. Raises InputError where the stored scene text is no scene."""
    scene = parse_scene(str(stored.attributes["scene_toml"]), stored.name)
    faults = _faults(scene, run)
    if reference is None:
        reference = reference_of(stored)
    if faults and _faults(scene, run, complete=False):  # more is wrong than that the run stops early
        return Rehydrated(scene, None, reference, faults)
    facts = run.attributes
    success = bool(facts.get("engine_success", _is_frozen(run)))
    out_of_time = run.status == "timed_out" and not success
    engine = Integration(success, str(facts.get("engine_message", "")), out_of_time=out_of_time)
    solution = Solution(scene, run.method, _trajectory(scene, run), engine, run.settings)
    if (method := look_up(run.method)) is not None:
        solution.is_corrected, solution.bounds = method.is_corrected, method.bounds
    return Rehydrated(scene, solution, reference, faults)


def _is_frozen(run: StoredRun) -> bool:
    """A frozen reference has no report of its engine, and need not have what follows from its angles and rates."""
    return run.method == REFERENCE and "frozen_with" in run.attributes


def _faults(scene: Scene, run: StoredRun, complete: bool = True) -> list[str]:
    """complete: every sample must be there; else as many as there are times."""
    rows = scene.samples if complete or "time" not in run else len(run.array("time"))
    expected: dict[str, tuple[int, ...]] = {"time": (rows,)}
    for quantity in quantities(scene.outputs):
        if _is_frozen(run) and quantity.name not in (*FROZEN, *run.names):
            continue
        if quantity.required or (quantity.name == "angle_uncertainty" and run.method == REFERENCE):
            expected[quantity.name] = (rows, *row_shape(quantity, scene))
    faults = []
    for name, shape in expected.items():
        if name not in run:
            faults.append(f"{name} is missing")
            continue
        values = run.array(name)
        if values.dtype.kind != "f" or values.shape[1:] != shape[1:]:
            faults.append(f"{name} has shape {values.shape} of {values.dtype}, not {shape} of numbers")
        elif len(values) != shape[0]:
            faults.append(f"{name} has {len(values)} rows, not {shape[0]}")
        elif not np.isfinite(values).all():
            faults.append(f"{name} is not finite at sample {int(np.argwhere(~np.isfinite(values))[0][0])}")
    return faults


def _trajectory(scene: Scene, run: StoredRun) -> Trajectory:
    """Angles and rates that were not asked for are zeros, which are not judged."""
    time = run.array("time")
    blank = np.zeros((len(time), 1 + len(scene.blades)))
    names = {quantity.name for quantity in known_quantities(scene.outputs) if quantity.is_over_time}
    arrays = {name: run.array(name) for name in names if name in run}
    return Trajectory(**{"time": time, "angles": blank, "rates": blank, **arrays})
