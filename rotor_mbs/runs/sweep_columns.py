"""What a sweep stores of a run, column by column, and the way of the columns to their offsets in a file.

run, variant, solver, split   (run) which run this is
bearing_stiffness ...         (run) a variable per varied parameter, in its own unit
status, steps ...             (run) metrics; message and crc32 beside them
angles ...                    (run, time, coordinate) trajectories, as asked for; NaN after a run broke off

Knows no file format and no file library: worker processes, which write the runs that they have computed, load it.
"""

from __future__ import annotations

import os
import re
import zlib
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from rotor_mbs.errors import StoreError, saving
from rotor_mbs.runs.layout import Column
from rotor_mbs.scenario.sweep import Sweep
from rotor_mbs.solution import quantities
from rotor_mbs.solution.status import STATUSES

# (runs, ...) arrays by the name of their dataset.
Rows = dict[str, NDArray[Any]]

MISSING = -1  # status of a run that is not stored
_READ_BYTES = 1 << 25  # read at once when checksums are verified

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
    "crc32": Column(("run",), "1", "CRC-32 of the run's bytes in all other columns that are computed"),
}
# Asked for by `amplification = true`: the variational equations cost a hundred times the run itself.
AMPLIFICATION = {
    "error_growth": Column(("run",), "1", "largest amplification of a small error of the initial state"),
    "horizon_s": Column(("run",), "s", "last sample before the amplification reaches 1e5, or the end"),
}
_TYPES = {"status": "i1", "steps": "<i8", "rhs_evaluations": "<i8", "message": "u1", "crc32": "<u4"}

COLUMNS = {
    "run": Column(("run",), "1", "run number, from 0"),
    "message_byte": Column(("message_byte",), "1", "number of a byte in a message"),
    "variant": Column(("run",), "1", "row of the design, the same for every method"),
    "solver": Column(("run",), "1", "by which method"),
    "split": Column(("run",), "1", "for training, validation or testing"),
}


def parameter_name(key: str) -> str:
    """The variable of a varied parameter.

    >>> parameter_name("bearing.stiffness"), parameter_name("initial.angles[1]")
    ('bearing_stiffness', 'initial_angles_1')
    """
    return re.sub(r"[.\[]", "_", key).replace("]", "")


def result_columns(sweep: Sweep) -> dict[str, Column]:
    """What is stored of a run, in the order of the file: metrics, then the trajectories that are asked for."""
    asked = [one for one in quantities.quantities(sweep.outputs) if one.output and one.required]
    trajectories = {one.name: Column(("run", *one.dimensions), one.units, one.long_name) for one in asked}
    return METRICS | (AMPLIFICATION if sweep.table.amplification else {}) | trajectories


def row_type(sweep: Sweep) -> np.dtype[np.void]:
    """The results of one run: a field for each column."""
    scales = quantities.scale_values(sweep.base)
    lengths = {name: len(values) for name, values in scales.items()} | {"message_byte": MESSAGE_BYTES}
    types = dict.fromkeys(METRICS | AMPLIFICATION, "<f8") | _TYPES
    kind = {"float64": "<f8", "float32": "<f4"}[sweep.table.precision]
    columns = result_columns(sweep).items()
    shapes = {name: tuple(lengths[one] for one in column.dimensions[1:]) for name, column in columns}
    return np.dtype([(name, types.get(name, kind), shape) for name, shape in shapes.items()])


@dataclass(frozen=True)
class RunColumns:
    """Where the runs of a file are; worker processes that see the file write them by it.

    path, inode   the file, and its number: another file of that name is not written to
    first         its first run
    offsets       bytes from its beginning to each column
    row           the type of a run: its columns, in the order in which the checksum covers them
    """

    path: Path
    inode: int
    first: int
    offsets: Mapping[str, int]
    row: np.dtype[np.void]

    def write(self, first: int, rows: Rows) -> NDArray[np.int8]:
        """Stores the rows of the runs from `first` on; returns their statuses. Raises StoreError."""
        columns = rows | {"crc32": checksums(first, rows, self.row)}
        status: NDArray[np.int8] = columns.pop("status")
        with saving(self.path), self.path.open("r+b") as file:
            if os.fstat(file.fileno()).st_ino != self.inode:
                raise StoreError(f"{self.path}: is another file by now")
            for name, values in [*columns.items(), ("status", status)]:
                if name == "status":  # last, when all else is on the disk
                    file.flush()
                    os.fsync(file.fileno())
                file.seek(self.offsets[name] + (first - self.first) * self.row[name].itemsize)
                file.write(np.ascontiguousarray(values).data)
        return status

    def stored(self, marked: NDArray[np.int8]) -> NDArray[np.int8]:
        """(runs,) the statuses `marked` in the file; MISSING, too, where a checksum is wrong.

        Raises OSError, ValueError where the file ends before.
        """
        found = np.full_like(marked, MISSING)
        step = max(_READ_BYTES // self.row.itemsize, 1)
        for start in range(0, len(marked), step):
            status = marked[start : start + step]
            if (status == MISSING).all():
                continue
            rows = {
                name: np.fromfile(self.path, kind, len(status), offset=self.offsets[name] + start * kind.itemsize)
                for name, kind in ((name, self.row[name]) for name in self.row.names or ())
            }
            is_right = checksums(self.first + start, rows, self.row) == rows["crc32"]
            found[start : start + step] = np.where(is_right & (status < len(STATUSES)), status, MISSING)
        return found


def checksums(first: int, rows: Rows, row: np.dtype[np.void]) -> NDArray[np.uint32]:
    """(runs,) CRC-32 over each run's columns, one after the other, begun with its number."""
    found = [first + i & 0xFFFFFFFF for i in range(len(rows["status"]))]
    for name in (name for name in row.names or () if name != "crc32"):
        contents: Any = np.ascontiguousarray(rows[name], row[name].base).reshape(len(found), -1)
        found = [zlib.crc32(content, known) for content, known in zip(contents, found, strict=True)]
    return np.array(found, np.uint32)
