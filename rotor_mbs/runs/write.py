"""A run into a results file of its own. Knows the layout; judges nothing."""

from __future__ import annotations

import json
from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from rotor_mbs.methods.catalogue import REFERENCE
from rotor_mbs.runs import files
from rotor_mbs.runs.layout import Column
from rotor_mbs.solution.quantities import SCALES, Quantity, quantities, scale_values
from rotor_mbs.solution.solution import Solution


def write_run(path: Path, scene_hash: str, run: Solution, attributes: Mapping[str, object]) -> None:
    """One run of one scene as a results file of its own, atomically.

    attributes: what else is known of the run (status, metrics, hash). Raises StoreError.
    """
    scene = run.scene
    facts = {
        "title": scene.title,
        "figures": ", ".join(scene.figures),
        "blades": len(scene.blades),
        "scene_toml": scene.text,
        "scene_hash": scene_hash,
    }
    refined = run.trajectory.get("refined_time")
    datasets = {**scale_values(scene), "time": run.time, "refined_time": refined, **run.quantities}
    outputs: tuple[str, ...] = scene.outputs
    if run.method == REFERENCE:  # it is read back by its angles and rates, whatever the scene asks for
        datasets |= {"angles": run.angles, "rates": run.rates}
        outputs = (*outputs, "angles", "rates")
    with files.new_file(path) as file:
        files.put_attributes(files.new_group(file, scene.name), facts)
        group = files.new_group(file, f"{scene.name}/{run.method}")
        put_datasets(group, datasets, quantities(outputs), list(scene.coordinate_labels))
        files.put_attributes(group, {**_facts(run), **attributes})


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


def put_datasets(group: Any, named: Mapping[str, Any], known: Sequence[Quantity], labels: Sequence[str]) -> None:
    """The scales that the data use, then the data: those arrays of `named` that `known` describes."""
    data = [quantity for quantity in known if quantity.name in named]
    put_scales(group, data, named, labels)
    for quantity in data:
        files.put(group, quantity.name, named[quantity.name], quantity, compress=not quantity.is_over_time)
    if "angles" in group:
        files.put_attributes(group, {"NX_class": "NXdata", "signal": "angles", "axes": ["time", "coordinate"]})


def put_scales(group: Any, data: Iterable[Column | Quantity], values: Mapping[str, Any], labels: Sequence[str]) -> None:
    """The time, and the other scales that the data use."""
    used = {"time"}.union(*(one.dimensions for one in data))
    for name, scale in SCALES.items():
        if name in used:
            dataset = files.put(group, name, values[name], scale)
            if name == "coordinate":
                files.put_attributes(dataset, {"labels": labels})
