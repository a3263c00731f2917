"""A run into a results file of its own. Knows the layout; judges nothing."""

from __future__ import annotations

import json
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np

from rotor_mbs.scenario.scene import Scene
from rotor_mbs.solution.metrics import energy_error
from rotor_mbs.solution.record import Solution, Trajectory
from rotor_mbs.store import hdf5, layout


def write_run(path: Path, scene: Scene, scene_hash: str, run: Solution, attributes: Mapping[str, object]) -> None:
    """One run of one scene as a results file of its own, atomically.

    attributes: what is known of the run beyond its record (status, metrics, hash). Raises StoreError.
    """
    with hdf5.new_file(path) as file:
        _put_scene(file, scene, scene_hash)
        group = hdf5.new_group(file, f"{scene.name}/{run.method}")
        put_datasets(group, _with_scales(scene, datasets(scene, run.trajectory)), list(scene.coordinate_labels))
        hdf5.put_attributes(group, {**_facts(run), **attributes})


def _facts(run: Solution) -> dict[str, object]:
    facts: dict[str, object] = {
        "time_reached": run.integration.time_reached,
        "engine_success": run.integration.success,
        "engine_message": run.integration.message,
        "settings": json.dumps(run.settings, sort_keys=True),
        "setup_time_s": run.setup_time_s,
        "run_time_s": float(np.median(run.run_times_s)),
        "run_time_min_s": min(run.run_times_s),
        "output_time_s": run.output_time_s,
        "repeats": len(run.run_times_s),
    }
    for name, value in (("steps", run.integration.steps), ("rhs_evaluations", run.integration.rhs_evaluations)):
        if value is not None:
            facts[name] = value
    return facts


def datasets(scene: Scene, trajectory: Trajectory) -> dict[str, Any]:
    """What of a trajectory the scene asks to have stored, by dataset name."""
    found: dict[str, Any] = {"time": trajectory.time}
    asked = {"angles": trajectory.angles, "rates": trajectory.rates, "tip": trajectory.tip}
    found |= {name: values for name, values in asked.items() if scene.wants(name)}
    found |= {
        "kinetic_energy": trajectory.kinetic_energy,
        "potential_energy": trajectory.potential_energy,
        "work": trajectory.work,
        "energy_error": energy_error(trajectory),
        "constraint_error": trajectory.constraint_error,
        "angle_uncertainty": trajectory.uncertainty,
        "error_growth": trajectory.growth,
    }
    if trajectory.refined is not None:
        found["refined_time"] = trajectory.refined.time
        if scene.wants("angles"):
            found["refined_angles"] = trajectory.refined.angles
        if scene.wants("rates"):
            found["refined_rates"] = trajectory.refined.rates
    return {name: values for name, values in found.items() if values is not None}


def _put_scene(file: Any, scene: Scene, scene_hash: str) -> None:
    group = hdf5.new_group(file, scene.name)
    facts = {
        "title": scene.title,
        "figures": ", ".join(scene.figures),
        "blades": len(scene.blades),
        "scene_toml": scene.text,
        "scene_hash": scene_hash,
    }
    hdf5.put_attributes(group, facts)


def _with_scales(scene: Scene, arrays: Mapping[str, Any]) -> dict[str, Any]:
    blades = len(scene.blades)
    ranges = {"coordinate": np.arange(1 + blades), "blade": np.arange(1, 1 + blades), "axis": np.arange(3)}
    return {**ranges, **arrays}


def put_datasets(group: Any, arrays: Mapping[str, Any], labels: list[str]) -> None:
    """The scales that the data use, then the data."""
    data = {name: values for name, values in arrays.items() if name in layout.QUANTITIES}
    used = {dimension for name in data for dimension in layout.QUANTITIES[name].dimensions} | {"time"}
    for name, quantity in layout.SCALES.items():
        if name in used and name in arrays:
            dataset = hdf5.put(group, name, arrays[name], quantity)
            if name == "coordinate":
                hdf5.put_attributes(dataset, {"labels": labels})
    for name, values in data.items():
        hdf5.put(group, name, values, layout.QUANTITIES[name], compress=name.startswith("refined_"))
    if "angles" in data:
        hdf5.put_attributes(group, {"NX_class": "NXdata", "signal": "angles", "axes": ["time", "coordinate"]})
