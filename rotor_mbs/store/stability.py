"""What the stability suite finds beside its runs, under /stability: step ladders, stability limits, conservation.

Each record is a group of its own, one-dimensional over `row`, with attributes. Judges nothing.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from rotor_mbs.solution.status import RUN_STATUSES
from rotor_mbs.store import hdf5
from rotor_mbs.store.layout import Column
from rotor_mbs.store.read import open_results

GROUP = "stability"
# Codes of a rung's status, in this order; the last: no run was made of it.
STATUSES = (*RUN_STATUSES, "left_out")

_ROW = Column(("row",), "1", "number of the row")
_QUANTITIES = {
    "step": Column(("row",), "s", "fixed step"),
    "status": Column(("row",), "1", "how the run ended, from its state"),
    "angle_error_max": Column(("row",), "rad", "largest angle error up to the horizon"),
    "energy_drift_max": Column(("row",), "1", "largest energy error over the run, of the energy scale"),
    "time": Column(("row",), "s", "time"),
    "energy_drift_rms": Column(("row",), "1", "energy error over perturbed starts, root mean square, of its scale"),
}


@dataclass(frozen=True)
class Record:
    """kind: "steps", "limits" or "conservation"; name: "<scene>/<model>/<integrator>"; arrays: (rows,) by name."""

    kind: str
    name: str
    attributes: Mapping[str, Any]
    arrays: Mapping[str, NDArray[Any]] = field(default_factory=dict)

    @property
    def scene(self) -> str:
        return self.name.rsplit("/", 2)[0]

    @property
    def method(self) -> str:
        return "/".join(self.name.rsplit("/", 2)[1:])

    @property
    def statuses(self) -> list[str]:
        return [STATUSES[int(code)] for code in self.arrays["status"]]


def write_records(path: Path, records: Sequence[Record]) -> None:
    """A results file with these records alone, atomically. Raises StoreError."""
    with hdf5.new_file(path) as file:
        for record in records:
            group = hdf5.new_group(file, f"{GROUP}/{record.kind}/{record.name}")
            hdf5.put_attributes(group, {"record": 1, **record.attributes})
            if record.arrays:
                rows = len(next(iter(record.arrays.values())))
                hdf5.put(group, "row", np.arange(rows), _ROW)
            for name, values in record.arrays.items():
                dataset = hdf5.put(group, name, np.asarray(values), _QUANTITIES[name])
                if name == "status":
                    dataset.attrs["flag_values"] = np.arange(len(STATUSES), dtype=np.int64)
                    dataset.attrs["flag_meanings"] = " ".join(STATUSES)


def read_records(path: Path) -> list[Record]:
    """Every record of a results file; none where the suite was not run. Raises StoreError."""
    with open_results(path) as results:
        if GROUP not in results.root:
            return []
        return list(_records(results.root[GROUP], ""))


def _records(group: Any, path: str) -> Iterator[Record]:
    for name, item in group.items():
        if not hdf5.is_group(item):
            continue
        below = f"{path}/{name}" if path else name
        if "record" in item.attrs:
            kind, _, rest = below.partition("/")
            arrays = {key: values[()] for key, values in item.items() if key != "row"}
            yield Record(kind, rest, hdf5.attributes_of(item), arrays)
        else:
            yield from _records(item, below)
