"""The dataset of a sweep, which is its own journal: laid out first, then filled in any order. Judges nothing.

All space is taken before the first run. From then on no HDF5 metadata changes, so that the file is valid at every
moment and can be read while the sweep goes on. A run's numbers are written to their offsets, its status last, after a
sync: a run is stored where its status is not -1 and its checksum is right.
"""

from __future__ import annotations

import errno
import json
import os
from collections.abc import Iterator
from contextlib import ExitStack, suppress
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from rotor_mbs.errors import InputError, StoreError
from rotor_mbs.execution.output_lock import SWEEP, writing
from rotor_mbs.scenario.sweep_design import split_rows
from rotor_mbs.solution.status import STATUSES, code_of
from rotor_mbs.store import digests, hdf5, sweep_layout
from rotor_mbs.store.layout import Column
from rotor_mbs.store.read import damages_of
from rotor_mbs.store.sweep_columns import MISSING, Rows, RunColumns
from rotor_mbs.store.sweep_layout import COLUMNS, CRC32, SPLITS, SweepLayout

_HEAD_BYTES = 1 << 17  # of a file beside its runs, at most: descriptions and texts


class SweepDataset:
    """The runs of a sweep in the file `output`; a context manager that locks it against other processes.

    time_limit_s   runs that were ended by a shorter one are missing

    Raises
    ------
    InputError
        Where the output is another file, or another process is writing it.
    StoreError
        Where it cannot be read or written, or the disk has no room for all runs.
    """

    def __init__(self, output: Path, layout: SweepLayout, time_limit_s: float = 0.0) -> None:
        self.path = output
        self._layout, self._time_limit_s = layout, time_limit_s
        self._writing = ExitStack()
        self.statuses = np.full(layout.last - layout.first, MISSING, np.int8)
        self.columns: RunColumns

    def __enter__(self) -> SweepDataset:
        self._writing.enter_context(writing(self.path, SWEEP))
        try:
            if self.path.is_symlink():
                self.path = self.path.resolve()  # a link stays one
            self._open()
        except BaseException:
            self._writing.close()
            raise
        return self

    def __exit__(self, *_: object) -> None:
        if (self.statuses == MISSING).all():
            with suppress(OSError):  # a sweep that stored nothing leaves nothing
                self.path.unlink()
        self._writing.close()

    def missing(self) -> list[tuple[int, int]]:
        """(first, last) of every gap."""
        edges = np.flatnonzero(np.diff(self.statuses == MISSING, prepend=False, append=False))
        return [(int(first), int(last)) for first, last in self._layout.first + edges.reshape(-1, 2)]

    def write(self, first: int, rows: Rows) -> NDArray[np.int8]:
        """Stores runs that were returned to this process. Raises StoreError."""
        return self.note(first, self.columns.write(first, rows))

    def note(self, first: int, statuses: NDArray[np.int8]) -> NDArray[np.int8]:
        """Counts runs that a worker has stored; returns their statuses."""
        start = first - self._layout.first
        self.statuses[start : start + len(statuses)] = statuses
        return statuses

    def _open(self) -> None:
        if not self.path.exists():
            _lay_out(self.path, self._layout)
        with hdf5.open_file(self.path) as file:
            facts = hdf5.attributes_of(file)
            if (facts.get("sweep_identity"), facts.get("runs")) != (self._layout.identity, len(self.statuses)):
                raise InputError(
                    f"{self.path}: holds something else than this sweep (or a sweep of another version); allowed: "
                    "another output file, or remove that one"
                )
            row = self._layout.row
            offsets = {name: file[name].id.get_offset() for name in (*(row.names or ()), "crc32")}
            marked, limits = file["status"][()] != MISSING, file["time_limit_s"][()]
            refuse_damages(file)
        inode = self.path.stat().st_ino
        self.columns = RunColumns(self.path, inode, self._layout.first, offsets, row)
        self.statuses = self.columns.stored(len(self.statuses))
        self.statuses[(self.statuses == code_of("timed_out")) & (limits < self._time_limit_s)] = MISSING
        self.columns.mark_missing(self._layout.first + np.flatnonzero(marked & (self.statuses == MISSING)))


def _lay_out(path: Path, layout: SweepLayout) -> None:
    """The file without its runs, with room for all of them; complete under its name, or not there. Raises StoreError.

    The space is reserved twice: HDF5 does not survive a disk that fills up under it, and truncates the file it begins.
    """
    temporary = path.with_name(f".{path.name}.tmp")
    count = layout.last - layout.first
    expected = _HEAD_BYTES + count * (layout.row.itemsize + 8 * (4 + len(layout.sweep.keys)))
    try:
        _reserve(temporary, expected)
        with hdf5.begin_file(temporary) as file:
            hdf5.put_attributes(file, {**layout.attributes, "sweep_identity": layout.identity, "runs": count})
            _put_run_columns(file, layout)
            _put_result_columns(file, layout)
            digests.seal(file, later=(*(layout.row.names or ()), "crc32"))
        _reserve(temporary, temporary.stat().st_size)
        temporary.replace(path)
    except OSError as exc:
        with suppress(OSError):
            temporary.unlink()
        room = f"{expected:.2g} bytes for {count} runs"
        raise StoreError(f"{path}: cannot be written: {exc.strerror} ({room}); nothing stored before is lost") from exc
    hdf5.sync_folder(path.parent)


def _reserve(path: Path, size: int) -> None:
    """Takes the space on the disk, where the system and the file system can: not on macOS and Windows, where a disk
    that fills up is reported by the run that finds it full. Raises OSError."""
    file = os.open(path, os.O_RDWR | os.O_CREAT, 0o644)
    try:
        if hasattr(os, "posix_fallocate"):
            os.posix_fallocate(file, 0, size)
        os.fsync(file)
    except OSError as exc:
        if exc.errno not in (errno.EOPNOTSUPP, errno.EINVAL, errno.ENOSYS):
            raise
    finally:
        os.close(file)


def _put_run_columns(file: Any, layout: SweepLayout) -> None:
    """What is known of the runs before they are computed."""
    sweep, runs = layout.sweep, np.arange(layout.first, layout.last)
    rows = sweep.design.count
    hdf5.put(file, "run", runs, COLUMNS["run"])
    hdf5.put(file, "message_byte", np.arange(sweep_layout.MESSAGE_BYTES, dtype=np.int16), COLUMNS["message_byte"])
    hdf5.put_attributes(file, {"parameter_keys": list(sweep.keys)})
    values = sweep.design.rows(layout.first, layout.last)
    for i, (key, unit) in enumerate(zip(sweep.keys, sweep.units, strict=True)):
        column = Column(("run",), unit, f"varied parameter {key}")
        hdf5.put(file, sweep_layout.parameter_name(key), np.ascontiguousarray(values[:, i]), column)
    hdf5.put(file, "variant", runs % rows, COLUMNS["variant"])
    solver = hdf5.put(file, "solver", (runs // rows).astype(np.int8), COLUMNS["solver"])
    hdf5.put_flags(solver, layout.methods)
    if sweep.table.validation or sweep.table.test:
        splits = split_rows(rows, sweep.table.validation, sweep.table.test, sweep.table.seed)
        hdf5.put_flags(hdf5.put(file, "split", splits[runs % rows], COLUMNS["split"]), SPLITS)


def _put_result_columns(file: Any, layout: SweepLayout) -> None:
    """Scales, then room for metrics and trajectories."""
    for name, (values, scale) in sweep_layout.scales(layout.sweep.base, layout.sweep.outputs).items():
        dataset = hdf5.put(file, name, values, scale)
        if name == "time":
            hdf5.put_attributes(dataset, {"standard_name": "time"})
        if name == "coordinate":
            hdf5.put_attributes(dataset, {"labels": layout.sweep.base.coordinate_labels})
    count, row = layout.last - layout.first, layout.row
    for name, column in {**layout.metrics, **sweep_layout.trajectories(layout.sweep.outputs)}.items():
        kind, shape = row[name].base, (count, *row[name].shape)
        if name == "message":
            kind, shape = np.dtype("u1"), (count, sweep_layout.MESSAGE_BYTES)
        hdf5.put_empty(file, name, shape, kind, column, fill=MISSING if name == "status" else None)
    hdf5.put_empty(file, "crc32", (count,), np.dtype("<u4"), CRC32)
    hdf5.put_flags(file["status"], STATUSES)


def refuse_damages(file: Any) -> None:
    """Raises StoreError where what is known of the runs before they are computed is not what was laid out."""
    damages = [part for part in damages_of(file) if part != digests.DIGESTS]
    if damages:
        raise StoreError(f"{file.filename}: {', '.join(damages)} changed after the file was laid out")


class Variable(NamedTuple):
    """A dataset of a sweep; `kind` is "f" for floating point numbers, "i" or "u" for integers."""

    name: str
    dimensions: tuple[str, ...]
    shape: tuple[int, ...]
    kind: str
    units: str
    long_name: str


def is_sweep(path: Path) -> bool:
    """Whether a file of this program is the dataset of a sweep. Raises StoreError where it cannot be read."""
    with hdf5.open_file(path) as file, hdf5.reading(path):
        return "sweep_identity" in file.attrs


class StoredSweep:
    """A dataset that `rotor-mbs sweep` wrote, complete or not. Raises StoreError where it is none.

    keys, units   of the varied parameters
    attributes    of the file
    """

    def __init__(self, path: Path) -> None:
        self._path = path
        with hdf5.open_file(path) as file, hdf5.reading(path):
            self.attributes = hdf5.attributes_of(file)
            if "sweep_identity" not in self.attributes:
                raise StoreError(f"{path}: no sweep's dataset; allowed: a file that `rotor-mbs sweep` wrote")
            refuse_damages(file)
            self.keys: list[str] = self.attributes["parameter_keys"]
            self.units = [str(hdf5.attributes_of(file[sweep_layout.parameter_name(key)])["units"]) for key in self.keys]

    @property
    def shape(self) -> tuple[int, ...]:
        """Values along every axis of its grid, slowest first."""
        return tuple(json.loads(self.attributes["shape"]))

    @property
    def title(self) -> str:
        return str(self.attributes["title"])

    @property
    def summary(self) -> str:
        """One sentence: how many runs of what, over which parameters."""
        return str(self.attributes.get("summary", self.title))

    def variables(self) -> list[Variable]:
        """Every dataset, scales included, in the order of the file."""
        with hdf5.open_file(self._path) as file:
            return [_variable(name, item) for name, item in file.items() if not hdf5.is_group(item)]

    def parameter(self, key: str) -> NDArray[np.float64]:
        """(runs,) the values of a varied parameter. Raises StoreError."""
        return self.column(sweep_layout.parameter_name(key))

    def column(self, name: str) -> NDArray[Any]:
        """A dataset whole, such as `status` or `time`. Raises StoreError where there is none of that name."""
        with hdf5.open_file(self._path) as file, hdf5.reading(self._path, name):
            return hdf5.values_of(self._dataset(file, name))

    def at(self, name: str, sample: int) -> NDArray[Any]:
        """(runs, ...) a trajectory at one sample of all runs, without reading the others. Raises StoreError."""
        with hdf5.open_file(self._path) as file, hdf5.reading(self._path, name):
            return np.array(hdf5.mapped(self._dataset(file, name))[:, sample])

    def damaged_runs(self) -> NDArray[np.int64]:
        """Numbers of the stored runs that are not what was written, by their checksums. Reads all of the file."""
        with hdf5.open_file(self._path) as file, hdf5.reading(self._path):
            marked = hdf5.values_of(file["status"])
            names = digests.unfilled_in(digests.stored_digests(file.attrs))
            offsets = {name: file[name].id.get_offset() for name in names}
            kinds = {name: (file[name].dtype, file[name].shape[1:]) for name in names if name != "crc32"}
            row = sweep_layout.stored_row(kinds)
            first = int(file["run"][0])
        columns = RunColumns(self._path, self._path.stat().st_ino, first, offsets, row)
        return first + np.flatnonzero((marked != MISSING) & (columns.stored(len(marked)) == MISSING))

    def refuse_damaged_runs(self) -> None:
        """Raises StoreError where a stored run is not what was written."""
        damaged = self.damaged_runs().tolist()
        if damaged:
            which = ", ".join(map(str, damaged[:5])) + (" ..." if len(damaged) > 5 else "")
            raise StoreError(
                f"{self._path}: runs {which} changed after they were written; allowed: the sweep's own command, which "
                "computes them anew"
            )

    def pieces(self, name: str, runs: int) -> Iterator[NDArray[Any]]:
        """An array in pieces of at most `runs` runs: for trajectories."""
        with hdf5.open_file(self._path) as file:
            dataset = self._dataset(file, name)
            for first in range(0, len(dataset), runs):
                yield dataset[first : first + runs]

    def _dataset(self, file: Any, name: str) -> Any:
        if name not in file:
            raise StoreError(f"{self._path}: does not hold {name}; allowed: a sweep whose outputs have it")
        return file[name]


def _variable(name: str, item: Any) -> Variable:
    facts = hdf5.attributes_of(item)
    dimensions = tuple(dim.keys()[0] if len(dim) else name for dim in item.dims)
    return Variable(name, dimensions, item.shape, item.dtype.kind, str(facts["units"]), str(facts["long_name"]))
