"""What a sweep stores of a run: names, types and units of its columns. Knows no file library.

run, variant, solver, split   (run) which run this is
bearing_stiffness ...         (run) a variable per varied parameter, in its own unit
status, steps ...             (run) metrics; message and crc32 beside them
angles ...                    (run, time, coordinate) trajectories, as asked for; NaN after a run broke off
"""

from __future__ import annotations

import re
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from rotor_mbs.scenario.scene import Scene
from rotor_mbs.scenario.sweep import Sweep
from rotor_mbs.solution import quantities
from rotor_mbs.solution.quantities import SCALES, Quantity
from rotor_mbs.solution.status import code_of
from rotor_mbs.store.layout import Column
from rotor_mbs.store.sweep_columns import Rows

SPLITS = ("train", "validation", "test")
MESSAGE_BYTES = 120

METRICS = {
    "status": Column(("run",), "1", "how the run ended, -1 while it is missing"),
    "steps": Column(("run",), "1", "integration steps, -1 where not known"),
    "rhs_evaluations": Column(("run",), "1", "evaluations of the right-hand side, -1 where not known"),
    "time_reached": Column(("run",), "s", "time of the last finite sample"),
    "energy_drift_max": Column(("run",), "1", "largest energy error of the run, of its energy scale"),
    "rotor_angle_max": Column(("run",), "rad", "largest rotor angle, either way"),
    "rotor_rate_max": Column(("run",), "rad/s", "largest rotor rate, either way"),
    "pitch_max": Column(("run",), "rad", "largest pitch angle of any blade, either way"),
    "time_limit_s": Column(("run",), "s", "time limit that ended the run, NaN where none did"),
    "message": Column(("run", "message_byte"), "1", "why the run did not end well: UTF-8 bytes, then zeros"),
}
# Asked for by `amplification = true`: the variational equations cost a hundred times the run itself.
AMPLIFICATION = {
    "error_growth": Column(("run",), "1", "largest amplification of a small error of the initial state"),
    "horizon_s": Column(("run",), "s", "last sample before the amplification reaches 1e5, or the end"),
}
CRC32 = Column(("run",), "1", "CRC-32 of the run's bytes in all other columns that are computed")
_TYPES = {"status": "i1", "steps": "<i8", "rhs_evaluations": "<i8", "message": f"S{MESSAGE_BYTES}"}

COLUMNS = {
    "run": Column(("run",), "1", "run number, from 0"),
    "message_byte": Column(("message_byte",), "1", "number of a byte in a message"),
    "variant": Column(("run",), "1", "row of the design, the same for every method"),
    "solver": Column(("run",), "1", "by which method"),
    "split": Column(("run",), "1", "for training, validation or testing"),
}


@dataclass(frozen=True)
class SweepLayout:
    """All that a sweep's file says beside its results.

    identity     hash of the sweep's numbers, methods and versions
    attributes   of the file
    first, last  runs of the file: first ... last - 1; run r is row r mod rows of the design, by method r div rows
    """

    identity: str
    attributes: Mapping[str, object]
    sweep: Sweep
    methods: Sequence[str]
    first: int
    last: int

    @property
    def row(self) -> np.dtype[np.void]:
        table = self.sweep.table
        return row_type(self.sweep.base, self.sweep.outputs, table.precision, amplification=table.amplification)

    @property
    def metrics(self) -> dict[str, Column]:
        """The columns of numbers of a run that are stored."""
        return {name: column for name, column in (METRICS | AMPLIFICATION).items() if name in (self.row.names or ())}


def parameter_name(key: str) -> str:
    """The variable of a varied parameter.

    >>> parameter_name("bearing.stiffness"), parameter_name("initial.angles[1]")
    ('bearing_stiffness', 'initial_angles_1')
    """
    return re.sub(r"[.\[]", "_", key).replace("]", "")


def trajectories(outputs: Sequence[str]) -> dict[str, Column]:
    """The datasets that `outputs` ask for, with a run in front of their dimensions."""
    asked = [one for one in quantities.quantities(outputs) if one.output and one.required]
    return {one.name: Column(("run", *one.dimensions), one.units, one.long_name) for one in asked}


def scales(scene: Scene, outputs: Sequence[str]) -> dict[str, tuple[NDArray[Any], Quantity]]:
    """The scales that the trajectories need, with their values."""
    used = {name for column in trajectories(outputs).values() for name in column.dimensions}
    return {name: (value, SCALES[name]) for name, value in quantities.scale_values(scene).items() if name in used}


def row_type(scene: Scene, outputs: Sequence[str], precision: str, *, amplification: bool = False) -> np.dtype[np.void]:
    """The results of one run: metrics, message, and trajectories in `precision`."""
    metrics = [*METRICS, *(AMPLIFICATION if amplification else ())]
    lengths = {name: len(values) for name, (values, _) in scales(scene, outputs).items()}
    kind = {"float64": "<f8", "float32": "<f4"}[precision]
    fields: list[Any] = [(name, _TYPES.get(name, "<f8")) for name in metrics]
    for name, column in trajectories(outputs).items():
        fields.append((name, kind, tuple(lengths[dimension] for dimension in column.dimensions[1:])))
    return np.dtype(fields)


def stored_row(columns: Mapping[str, tuple[np.dtype[Any], tuple[int, ...]]]) -> np.dtype[np.void]:
    """The type of a stored run, from type and shape of a run in every column that is computed, in the file's order."""
    fields = [(name, _TYPES["message"]) if name == "message" else (name, *kind) for name, kind in columns.items()]
    return np.dtype(fields)


def empty_rows(count: int, row: np.dtype[np.void], names: Iterable[str] | None = None) -> Rows:
    """Runs that left nothing: NaN, -1 and no text. `names`: these columns only."""
    blank = {"f": np.nan, "S": b"", "i": -1}
    kinds = {name: row[name] for name in names or row.names or ()}
    return {name: np.full((count, *kind.shape), blank[kind.base.kind], kind.base) for name, kind in kinds.items()}


def lost_rows(count: int, row: np.dtype[np.void], status: str, message: str) -> Rows:
    """Rows with a status and its message alone, for runs whose process died, or was ended."""
    rows = empty_rows(count, row)
    rows["status"][:], rows["message"][:] = code_of(status), message.encode()[:MESSAGE_BYTES]
    rows["time_reached"][:] = 0.0
    return rows
