"""The runs of a sweep as one netCDF-4 readable dataset, written slice by slice. Knows the layout; judges nothing."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from rotor_mbs.scenario.scene import Scene
from rotor_mbs.store import hdf5, sweep_layout
from rotor_mbs.store.journal import Rows, sync_folder
from rotor_mbs.store.read import open_results

_SLICE = 1 << 23  # bytes of rows held at once
_MESSAGES = 100  # of runs that did not end well, in the file's attributes


@dataclass(frozen=True)
class Plan:
    """All that a sweep's files say beside the runs themselves.

    identity    stands for the sweep's numbers, methods and versions
    attributes  of the file
    scene       the base: number of blades, samples, duration
    parameters  from (first, last) run to (last - first, keys) numbers
    variants    rows of the design: run r is row r mod variants, by method r div variants
    splits      (variants,) 0 training, 1 validation; or None
    """

    identity: str
    attributes: Mapping[str, object]
    scene: Scene
    outputs: Sequence[str]
    precision: str
    keys: Sequence[str]
    units: Sequence[str]
    methods: Sequence[str]
    variants: int
    parameters: Callable[[int, int], NDArray[np.float64]]
    splits: NDArray[np.int8] | None

    @property
    def row(self) -> np.dtype[np.void]:
        return sweep_layout.row_type(self.scene, self.outputs, self.precision)


def write_dataset(path: Path, plan: Plan, first: int, last: int, read: Callable[[int, int], Rows]) -> None:
    """The runs first ... last - 1, from `read`, into `path`, atomically. Its bytes follow from plan and rows alone.

    Raises StoreError.
    """
    with hdf5.new_file(path) as file:
        hdf5.put_attributes(file, {**plan.attributes, "sweep_identity": plan.identity, "runs": last - first})
        _put_columns(file, plan, np.arange(first, last))
        datasets = _put_datasets(file, plan, last - first)
        messages: list[str] = []
        step = max(_SLICE // plan.row.itemsize, 1)
        for start in range(first, last, step):
            end = min(start + step, last)
            rows = read(start, end)
            for name, dataset in datasets.items():
                dataset[start - first : end - first] = rows[name]
            messages += _messages(start, rows)[: _MESSAGES - len(messages)]
        if messages:
            hdf5.put_attributes(file, {"messages": messages})
    sync_folder(path.parent)


def _put_columns(file: Any, plan: Plan, runs: NDArray[np.int64]) -> None:
    columns = sweep_layout.COLUMNS
    hdf5.put(file, "run", runs, columns["run"])
    scale = hdf5.put(file, "parameter", np.arange(len(plan.keys)), columns["parameter"])
    hdf5.put_attributes(scale, {"labels": plan.keys})
    parameters = hdf5.put(file, "parameters", plan.parameters(int(runs[0]), int(runs[-1]) + 1), columns["parameters"])
    hdf5.put_attributes(parameters, {"labels": plan.keys, "label_units": plan.units})
    hdf5.put(file, "variant", runs % plan.variants, columns["variant"])
    method = hdf5.put(file, "method", (runs // plan.variants).astype(np.int8), columns["method"])
    _put_flags(method, plan.methods)
    if plan.splits is not None:
        split = hdf5.put(file, "split", plan.splits[runs % plan.variants], columns["split"])
        _put_flags(split, ("train", "validation"))


def _put_datasets(file: Any, plan: Plan, count: int) -> dict[str, Any]:
    """Scales, then metrics and trajectories, empty."""
    for name, (values, quantity) in sweep_layout.scales(plan.scene, plan.outputs).items():
        scale = hdf5.put(file, name, values, quantity)
        if name == "coordinate":
            hdf5.put_attributes(scale, {"labels": plan.scene.coordinate_labels})
    quantities = {**sweep_layout.METRICS, **sweep_layout.trajectories(plan.outputs)}
    datasets = {}
    for name, quantity in quantities.items():
        kind = plan.row[name]
        datasets[name] = hdf5.put_empty(file, name, (count, *kind.shape), kind.base, quantity)
    _put_flags(datasets["status"], sweep_layout.SWEEP_STATUSES)
    return datasets


def _put_flags(dataset: Any, meanings: Sequence[str]) -> None:
    """Integer codes as the CF conventions have them; a blank parts two meanings, and none of ours has one."""
    dataset.attrs["flag_values"] = np.arange(len(meanings), dtype=np.int8)
    dataset.attrs["flag_meanings"] = " ".join(meanings)


def _messages(first: int, rows: Rows) -> list[str]:
    told = np.flatnonzero(rows["message"] != b"")
    return [f"run {first + i}: {rows['message'][i].decode(errors='replace')}" for i in told[:_MESSAGES].tolist()]


def identity_of(path: Path) -> str:
    """Which sweep a file belongs to; "" for another results file. Raises StoreError."""
    with open_results(path) as results:
        return str(results.attributes.get("sweep_identity", ""))


def statuses_of(path: Path) -> NDArray[np.int8]:
    """(runs,) the codes. Raises StoreError."""
    with open_results(path) as results:
        codes: NDArray[np.int8] = results.root["status"][()]
        return codes
