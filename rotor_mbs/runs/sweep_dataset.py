"""The dataset of a sweep, which is its own journal: laid out first, then filled in any order. Judges nothing.

All space is taken before the first run. From then on no HDF5 metadata changes, so that the file is valid at every
moment and can be read while the sweep goes on. A run's numbers are written to their offsets, its status last, after a
sync: a run is stored where its status is not -1 and its checksum is right.
"""

from __future__ import annotations

import errno
import os
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from rotor_mbs.errors import InputError, StoreError
from rotor_mbs.runs import digests, files, sweep_columns
from rotor_mbs.runs.layout import SWEEP_IDENTITY, Column
from rotor_mbs.runs.lock import refuse_finished_runs, writing
from rotor_mbs.runs.read import damages_of
from rotor_mbs.runs.sweep_columns import COLUMNS, MISSING, RunColumns
from rotor_mbs.runs.write import put_scales
from rotor_mbs.scenario.sweep import Sweep
from rotor_mbs.scenario.sweep_design import SPLITS, split_rows
from rotor_mbs.solution.quantities import scale_values
from rotor_mbs.solution.status import STATUSES, code_of

_HEAD_BYTES = 1 << 17  # of a file beside its runs, at most: descriptions and texts


@contextmanager
def open_sweep(
    output: Path,
    sweep: Sweep,
    methods: Sequence[str],
    numbers: range,
    attributes: Mapping[str, object],
    time_limit_s: float = 0.0,
) -> Iterator[tuple[RunColumns, NDArray[np.int8]]]:
    """The file `output`, laid out where it is not there, which no other process writes in the block: where its runs
    are, and their statuses, MISSING where none is stored, or a time limit shorter than time_limit_s ended the run.

    numbers      of its runs; run r is row r mod rows of the design, by method r div rows
    attributes   of the file; `sweep_identity` is a hash of all that decides its numbers

    Raises InputError where the output is another file, or another process is writing it; StoreError where it cannot be
    read or written, or the disk has no room for all runs.
    """
    with writing(output) as parts:
        refuse_finished_runs(parts)
        path = output.resolve() if output.is_symlink() else output  # a link stays one
        if not path.exists():
            _lay_out(path, sweep, methods, numbers, attributes)
        with files.open_file(path) as file, files.reading(path):
            if file.attrs.get(SWEEP_IDENTITY) != attributes[SWEEP_IDENTITY]:
                raise InputError(
                    f"{path}: holds something else than this sweep (or a sweep of another version); allowed: another "
                    "output file, or remove that one"
                )
            runs, marked, statuses = _stored_runs(file)
            statuses[(statuses == code_of("timed_out")) & (file["time_limit_s"][()] < time_limit_s)] = MISSING
        lost = (marked != MISSING) & (statuses == MISSING)
        if lost.any():  # readers see it, too
            np.memmap(path, np.int8, "r+", runs.offsets["status"], lost.shape)[lost] = MISSING
        try:
            yield runs, statuses
        finally:
            if (statuses == MISSING).all():
                path.unlink(missing_ok=True)  # a sweep that stored nothing leaves nothing


def _stored_runs(file: Any) -> tuple[RunColumns, NDArray[np.int8], NDArray[np.int8]]:
    """Where the runs of an open dataset are, their statuses as they stand there, and with MISSING for a wrong checksum.

    Raises StoreError where what is known of the runs before they are computed is not what was laid out.
    """
    damages = [part for part in damages_of(file) if part != digests.DIGESTS]
    if damages:
        raise StoreError(f"{file.filename}: {', '.join(damages)} changed after the file was laid out")
    names = digests.unfilled_in(digests.stored_digests(file.attrs))
    row = np.dtype([(name, file[name].dtype, file[name].shape[1:]) for name in names])
    offsets = {name: file[name].id.get_offset() for name in names}
    path, marked = Path(file.filename), files.values_of(file["status"])
    first = int(file["run"][0]) if len(marked) else 0  # of a part without runs
    runs = RunColumns(path, path.stat().st_ino, first, offsets, row)
    return runs, marked, runs.stored(marked)


def _lay_out(
    path: Path, sweep: Sweep, methods: Sequence[str], numbers: range, attributes: Mapping[str, object]
) -> None:
    """The file without its runs, with room for all of them; complete under its name, or not there. Raises StoreError.

    The space is reserved twice: HDF5 does not survive a disk that fills up under it, and truncates the file it begins.
    """
    with files.replacing(path) as temporary:
        row = sweep_columns.row_type(sweep)
        _reserve(temporary, _HEAD_BYTES + len(numbers) * (row.itemsize + 8 * (4 + len(sweep.keys))))
        with files.begin_file(temporary) as file:
            files.put_attributes(file, attributes)
            _put_columns(file, sweep, methods, numbers)
            digests.seal(file, later=row.names or ())
        _reserve(temporary, temporary.stat().st_size)
    files.sync_folder(path.parent)


def _reserve(path: Path, size: int) -> None:
    """Takes the space on the disk, where the system and the file system can: not on macOS and Windows, where a disk
    that fills up is reported by the run that finds it full. Raises OSError."""
    with path.open("ab") as file:
        try:
            if hasattr(os, "posix_fallocate"):
                os.posix_fallocate(file.fileno(), 0, size)
        except OSError as exc:
            if exc.errno not in (errno.EOPNOTSUPP, errno.EINVAL, errno.ENOSYS):
                raise OSError(exc.errno, f"{exc.strerror} ({size:.2g} bytes for all runs)") from exc
        os.fsync(file.fileno())


def _put_columns(file: Any, sweep: Sweep, methods: Sequence[str], numbers: range) -> None:
    """What is known of the runs before they are computed, scales, then room for what is computed."""
    runs, rows, table = np.arange(numbers.start, numbers.stop), sweep.design.count, sweep.table
    files.put(file, "run", runs, COLUMNS["run"])
    values = sweep.design.rows(numbers.start, numbers.stop)
    for i, (key, unit) in enumerate(zip(sweep.keys, sweep.units, strict=True)):
        column = Column(("run",), unit, f"varied parameter {key}")
        files.put(file, sweep_columns.parameter_name(key), np.ascontiguousarray(values[:, i]), column)
    files.put(file, "variant", runs % rows, COLUMNS["variant"])
    files.put_flags(files.put(file, "solver", (runs // rows).astype(np.int8), COLUMNS["solver"]), methods)
    if table.validation or table.test:
        splits = split_rows(rows, table.validation, table.test, table.seed)
        files.put_flags(files.put(file, "split", splits[runs % rows], COLUMNS["split"]), SPLITS)
    columns, row = sweep_columns.result_columns(sweep), sweep_columns.row_type(sweep)
    files.put(file, "message_byte", np.arange(sweep_columns.MESSAGE_BYTES, dtype=np.int16), COLUMNS["message_byte"])
    put_scales(file, columns.values(), scale_values(sweep.base), sweep.base.coordinate_labels)
    files.put_attributes(file["time"], {"standard_name": "time"})
    for name, column in columns.items():
        fill = MISSING if name == "status" else None
        files.put_empty(file, name, (len(runs), *row[name].shape), row[name].base, column, fill)
    files.put_flags(file["status"], STATUSES)


class StoredSweep:
    """A dataset that `rotor-mbs sweep` wrote, complete or not.

    attributes     of the file
    columns        every dataset, scales included, in the order of the file
    keys           of the varied parameters
    damaged_runs   numbers of the stored runs that are not what was written, by their checksums

    Raises StoreError where it is none, or is damaged; with allow_damaged_runs, not where only runs are.
    """

    def __init__(self, path: Path, *, allow_damaged_runs: bool = False) -> None:
        self._path = path
        self.columns: dict[str, Column] = {}
        with files.open_file(path) as file, files.reading(path):
            self.attributes = files.attributes_of(file)
            if SWEEP_IDENTITY not in self.attributes:
                raise StoreError(f"{path}: no sweep's dataset; allowed: a file that `rotor-mbs sweep` wrote")
            runs, marked, statuses = _stored_runs(file)
            for name, item in file.items():
                dimensions = tuple(one or name for one in files.dimensions_of(item))
                self.columns[name] = Column(dimensions, str(item.attrs["units"]), str(item.attrs["long_name"]))
        self.keys: list[str] = self.attributes["parameter_keys"]
        self.damaged_runs = runs.first + np.flatnonzero((marked != MISSING) & (statuses == MISSING))
        if len(self.damaged_runs) and not allow_damaged_runs:
            which = ", ".join(map(str, self.damaged_runs[:5])) + (" ..." if len(self.damaged_runs) > 5 else "")
            raise StoreError(
                f"{path}: runs {which} changed after they were written; allowed: the sweep's own command, which "
                "computes them anew"
            )

    def column(self, name: str) -> NDArray[Any]:
        """A dataset, such as `status` or `angles`, as it lies in the file: it is read where it is indexed.

        Raises StoreError where there is none of that name.
        """
        if name not in self.columns:
            raise StoreError(f"{self._path}: does not hold {name}; allowed: a sweep whose outputs have it")
        with files.open_file(self._path) as file, files.reading(self._path, name):
            return files.mapped(file[name])
