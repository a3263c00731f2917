"""The runs of a sweep as one netCDF-4 readable dataset, laid out before they are run. Judges nothing."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any, BinaryIO

import numpy as np
from numpy.typing import NDArray

from rotor_mbs.execution.pool import delayed_interrupts
from rotor_mbs.store import hdf5, sweep_layout
from rotor_mbs.store.chunk_index import ChunkIndex
from rotor_mbs.store.read import open_results
from rotor_mbs.store.sweep_layout import Plan
from rotor_mbs.store.sweep_memory import SparseFile
from rotor_mbs.store.sweep_rows import Places, write_at

_MESSAGES = 100  # of runs that did not end well, in the file's attributes


class SweepFile:
    """The dataset of the runs first ... last - 1, without them: what the library writes, held in memory.

    It all follows from the plan: where each run's numbers belong is known before there are any, and a file that was
    filled in any order, by anyone, ends with the same bytes.
    """

    @delayed_interrupts()
    def __init__(self, plan: Plan, first: int, last: int) -> None:
        self._memory = SparseFile()
        self._file = hdf5.new_file_in(self._memory)
        hdf5.put_attributes(self._file, {**plan.attributes, "sweep_identity": plan.identity, "runs": last - first})
        _put_columns(self._file, plan, np.arange(first, last))
        datasets = _put_datasets(self._file, plan, last - first)
        self._file.flush()
        index = ChunkIndex(self._memory.extents())
        self._first = first
        self._places = {name: hdf5.places(dataset, index) for name, dataset in datasets.items()}
        self._sizes = {name: plan.row[name].itemsize for name in datasets}

    def places(self, path: Path) -> Places:
        """Of all its runs, in the file that is to be."""
        return Places(path, self._first, self._places, self._sizes)

    @delayed_interrupts()
    def complete(self, file: BinaryIO, messages: Mapping[int, str]) -> None:
        """Writes all that is not a run's around the runs. May be done again if it breaks off. Raises OSError."""
        if messages:
            told = [f"run {run}: {messages[run]}" for run in sorted(messages)[:_MESSAGES]]
            hdf5.put_attributes(self._file, {"messages": told})
        self.close()
        for place, content in self._memory.extents():
            write_at(file, place, content)
        file.truncate(self._memory.size)

    @delayed_interrupts()
    def close(self) -> None:
        self._file.close()


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
    """Scales, then metrics and trajectories, with room for the runs."""
    for name, (values, quantity) in sweep_layout.scales(plan.scene, plan.outputs).items():
        scale = hdf5.put(file, name, values, quantity)
        if name == "coordinate":
            hdf5.put_attributes(scale, {"labels": plan.scene.coordinate_labels})
    columns = {**sweep_layout.METRICS, **sweep_layout.trajectories(plan.outputs)}
    datasets = {}
    for name, column in columns.items():
        kind = plan.row[name]
        datasets[name] = hdf5.put_empty(file, name, (count, *kind.shape), kind.base, column)
    _put_flags(datasets["status"], sweep_layout.SWEEP_STATUSES)
    return datasets


def _put_flags(dataset: Any, meanings: Sequence[str]) -> None:
    """Integer codes as the CF conventions have them; a blank parts two meanings, and none of ours has one."""
    dataset.attrs["flag_values"] = np.arange(len(meanings), dtype=np.int8)
    dataset.attrs["flag_meanings"] = " ".join(meanings)


def identity_of(path: Path) -> str:
    """Which sweep a file belongs to; "" for another results file. Raises StoreError."""
    with open_results(path) as results:
        return str(results.attributes.get("sweep_identity", ""))


def statuses_of(path: Path) -> NDArray[np.int8]:
    """(runs,) the codes. Raises StoreError."""
    with open_results(path) as results:
        codes: NDArray[np.int8] = results.root["status"][()]
        return codes
