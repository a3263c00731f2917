"""What a sweep keeps of a run, as one row of fixed size, and the names and units of the columns. Knows no file library.

run                  scale; `parameters` (run, parameter), `variant`, `method`, `split` beside it
status, steps ...    (run) metrics
angles ...           (run, time, coordinate) trajectories, as asked for; NaN after a run broke off
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from rotor_mbs.scenario.scene import Scene
from rotor_mbs.solution import quantities
from rotor_mbs.solution.quantities import SCALES, Quantity
from rotor_mbs.solution.status import RUN_STATUSES
from rotor_mbs.store.layout import Column
from rotor_mbs.store.sweep_rows import MESSAGE, Rows

SWEEP_STATUSES = (*RUN_STATUSES, "worker_died")
MESSAGE_BYTES = 200

METRICS = {
    "status": Column(("run",), "1", "how the run ended"),
    "steps": Column(("run",), "1", "integration steps, -1 where not known"),
    "rhs_evaluations": Column(("run",), "1", "evaluations of the right-hand side, -1 where not known"),
    "time_reached": Column(("run",), "s", "time of the last finite sample"),
    "energy_drift_max": Column(("run",), "1", "largest energy error of the run, of its energy scale"),
    "rotor_angle_max": Column(("run",), "rad", "largest rotor angle, either way"),
    "rotor_rate_max": Column(("run",), "rad/s", "largest rotor rate, either way"),
    "pitch_max": Column(("run",), "rad", "largest pitch angle of any blade, either way"),
}
METRICS_AND_MESSAGE = (*METRICS, MESSAGE)
_INTEGERS = {"status": "i1", "steps": "<i8", "rhs_evaluations": "<i8"}

COLUMNS = {
    "run": Column(("run",), "1", "run number, from 0"),
    "parameter": Column(("parameter",), "1", "number of the parameter; its key in the labels"),
    "parameters": Column(("run", "parameter"), "1", "the varied numbers; keys and units in the attributes"),
    "variant": Column(("run",), "1", "row of the design, the same for every method"),
    "method": Column(("run",), "1", "by which method"),
    "split": Column(("run",), "1", "for training or for validation"),
}


def trajectories(outputs: Sequence[str]) -> dict[str, Column]:
    """The datasets that `outputs` ask for, with a run in front of their dimensions."""
    asked = [one for one in quantities.quantities(outputs) if one.output and one.required]
    return {one.name: Column(("run", *one.dimensions), one.units, one.long_name) for one in asked}


def scales(scene: Scene, outputs: Sequence[str]) -> dict[str, tuple[np.ndarray, Quantity]]:
    """The scales that the trajectories need, with their values."""
    used = {name for column in trajectories(outputs).values() for name in column.dimensions}
    return {name: (value, SCALES[name]) for name, value in quantities.scale_values(scene).items() if name in used}


def row_type(scene: Scene, outputs: Sequence[str], precision: str) -> np.dtype[np.void]:
    """One run: its metrics, its message, its trajectories in `precision`; all but the message are datasets."""
    lengths = {name: len(values) for name, (values, _) in scales(scene, outputs).items()}
    fields: list[tuple[str, str] | tuple[str, str, tuple[int, ...]]] = [
        (name, _INTEGERS.get(name, "<f8")) for name in METRICS
    ]
    fields.append((MESSAGE, f"S{MESSAGE_BYTES}"))
    kind = {"float64": "<f8", "float32": "<f4"}[precision]
    fields += [
        (name, kind, tuple(lengths[dimension] for dimension in quantity.dimensions[1:]))
        for name, quantity in trajectories(outputs).items()
    ]
    return np.dtype(fields)


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
        return row_type(self.scene, self.outputs, self.precision)


def empty_rows(count: int, row: np.dtype[np.void], names: Sequence[str] | None = None) -> Rows:
    """Runs of which nothing is known yet: NaN, -1 and no text. `names`: these columns only."""
    rows: Rows = {}
    for name in names or row.names or ():
        kind = row[name]
        blank = np.nan if kind.base.kind == "f" else b"" if name == MESSAGE else 0 if name == "status" else -1
        rows[name] = np.full((count, *kind.shape), blank, kind.base)
    return rows
