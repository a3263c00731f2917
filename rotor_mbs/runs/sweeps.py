"""Write and read the file of a sweep, which has one table at its root.

run, variant, method_code, split   (run) numbers and codes that identify a run
bearing_stiffness ...              (run) a variable for each varied parameter, in its own unit
status, steps, message ...         (run) outcome and metrics of a run
code                               (run) CRC-32 of the versions that computed a run
angles ...                         (run, time, coordinate) requested trajectories; NaN after the end
                                   of a run that stopped early
"""

from __future__ import annotations

import functools
import json
import re
import zlib
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from rotor_mbs.errors import InputError, StoreError
from rotor_mbs.methods.catalogue import find_method
from rotor_mbs.runs.design import MISSING, columns_in, flags, scene_scales
from rotor_mbs.runs.hdf5 import Column, TableSpec, reading
from rotor_mbs.runs.layout import create_file
from rotor_mbs.runs.output_files import locked
from rotor_mbs.runs.read import StoredRun
from rotor_mbs.runs.table import IDENTITY, StoredTable, TableFile, parsed, require_texts
from rotor_mbs.runs.trailer import SWEEP, may_extend
from rotor_mbs.runs.versions import row_versions
from rotor_mbs.scenario.scene import Scene, parse_scene
from rotor_mbs.scenario.sweep import SPLITS, Sweep
from rotor_mbs.solution import quantities
from rotor_mbs.solution.quantities import SCALES
from rotor_mbs.solution.status import code_of

# Length of a message in bytes. The longest message seen has 242: it reports a singularity that
# ode45 does not pass.
MESSAGE_LENGTH = 256

COLUMNS_OF_A_RUN = columns_in("sweep")
_EARLIER = "the file of a sweep of an earlier version, whose runs have other columns"


def parameter_name(key: str) -> str:
    """Return the name of the variable of a varied parameter.

    >>> parameter_name("bearing.stiffness"), parameter_name("initial.angles[1]")
    ('bearing_stiffness', 'initial_angles_1')
    """
    return re.sub(r"[.\[]", "_", key).replace("]", "")


def code_of_method(method: str) -> int:
    """Return the CRC-32 of the versions with which a method would compute a run now."""
    return zlib.crc32(json.dumps(row_versions(find_method(method)), sort_keys=True).encode())


def sweep_table(sweep: Sweep, methods: Sequence[str], numbers: range) -> TableSpec:
    """Return the table of a range of runs of a sweep.

    If the design has n rows, run r is row r mod n of the design, by method number r div n.

    Parameters
    ----------
    sweep : the sweep: a scene, the design, its keys and its outputs.
    methods : names of the methods, in the order of their codes.
    numbers : numbers of the runs, a range with step 1.
    """
    runs, rows, options = np.arange(numbers.start, numbers.stop), sweep.design.count, sweep.design
    known: dict[str, tuple[Column, Any]] = {}
    values = sweep.design.rows(numbers.start, numbers.stop)
    for i, (key, unit) in enumerate(zip(sweep.keys, sweep.units, strict=True)):
        column = Column(("run",), unit, f"varied parameter {key}")
        known[parameter_name(key)] = column, np.ascontiguousarray(values[:, i])
    known["variant"] = Column(("run",), "1", "number of the parameter combination"), runs % rows
    column = Column(("run",), "1", "code of the method", attributes=flags(methods))
    known["method_code"] = column, (runs // rows).astype(np.int8)
    if options.validation or options.test:
        column = Column(("run",), "1", "split of the dataset", attributes=flags(SPLITS))
        known["split"] = column, options.splits()[runs % rows]
    kind = {"float64": "<f8", "float32": "<f4"}[options.precision]
    asked = [
        quantity
        for quantity in quantities.quantities(sweep.outputs)
        if quantity.output and quantity.required
    ]
    trajectories = {
        quantity.name: Column(
            ("run", *quantity.dimensions), quantity.units, quantity.long_name, kind
        )
        for quantity in asked
    }
    computed = COLUMNS_OF_A_RUN | trajectories
    if options.error_growth:  # optional: it takes a hundred times as long as the run itself
        computed = COLUMNS_OF_A_RUN | columns_in("sweep_growth") | trajectories
    known = scene_scales(sweep.base, trajectories.values()) | known
    return TableSpec("", runs, known, computed, characters=MESSAGE_LENGTH)


@contextmanager
def open_sweep(
    output: Path,
    table: TableSpec,
    attributes: Mapping[str, object],
    time_limit_s: float = 0.0,
    *,
    fresh: bool = False,
) -> Iterator[tuple[StoredTable, NDArray[np.int8]]]:
    """Open the file of a sweep, and lock it during the block.

    A file that does not exist is laid out. This new file is removed after the block if no run was
    stored in it.

    Parameters
    ----------
    output : the file.
    table : the table of the sweep's runs.
    attributes : attributes of a new file. An existing file must have the same sweep identity.
    time_limit_s : time limit of a run in s. A stored run that a shorter limit ended counts as
        missing.
    fresh : whether all runs are to be computed. A stored run stays until it is replaced.

    Yields
    ------
    StoredTable, (runs,) int8
        The table, and the status of each run, MISSING if the run is to be computed. When the caller
        has stored a run, it must set the status of the run in this array.

    Raises
    ------
    InputError
        If the file is of another kind or another sweep, or another process is writing it.
    StoreError
        If the file cannot be read or written, or the disk has no room for all runs.
    """
    with locked(output):
        path = output.resolve() if output.is_symlink() else output  # a symbolic link is kept
        is_new = not may_extend(path, SWEEP)
        if is_new:
            with create_file(path, [table], attributes):
                pass
        file = TableFile(path, [""])
        if file.attributes.get(IDENTITY) != attributes[IDENTITY]:
            raise InputError(
                f"{path}: not the file of this sweep; allowed: another output file, or remove that "
                "one"
            )
        stored = file.tables[""]
        if stored.computed.keys() != table.computed.keys():
            allowed = "another output file, or remove that one"
            raise InputError(f"{path}: {_EARLIER}; allowed: {allowed}")
        statuses = stored.statuses()
        statuses[
            (statuses == code_of("timed_out")) & (stored.column("time_limit_s") < time_limit_s)
        ] = MISSING
        taken_back = np.flatnonzero((stored.column("status") != MISSING) & (statuses == MISSING))
        # These runs are marked as missing in the file, too, so that its readers do not use them.
        stored.place().mark_missing(taken_back.tolist())
        if fresh:
            statuses[:] = MISSING
        try:
            yield stored, statuses
        finally:
            if is_new and (statuses == MISSING).all():
                path.unlink(missing_ok=True)  # a sweep that stored no run leaves no file


class StoredSweep:
    """The dataset of a sweep in a file, complete or not.

    Attributes
    ----------
    attributes : attributes of the file.
    columns : descriptions of all columns and scales, by name.
    keys : keys of the varied parameters.
    damaged_runs : numbers of the stored runs whose checksums are wrong.
    subsets : always empty, as all runs vary the same scene; see `StoredRuns`.
    group : always "", as the arrays are at the root of the file; see `StoredRuns`.
    """

    subsets: Sequence[str] = ()
    group = ""

    def __init__(self, path: Path, *, allow_damaged_runs: bool = False) -> None:
        """Read the dataset, and verify all its runs.

        Parameters
        ----------
        path : the file.
        allow_damaged_runs : if set, damaged runs raise no error; they are in `damaged_runs`.

        Raises
        ------
        StoreError
            If the file is not that of a sweep, or is damaged.
        """
        self._path = path
        file = TableFile(path, [""])
        self.attributes = file.attributes
        if IDENTITY not in self.attributes or "" not in file.tables:
            raise StoreError(
                f"{path}: no sweep's dataset; allowed: a file that `rotor-mbs sweep` wrote"
            )
        self._table = table = file.tables[""]
        self._check()
        self.columns = {"run": Column(("run",), "1", "run number, from 0"), **table.columns}
        self.keys: list[str] = self.attributes["parameter_keys"]
        with reading(path):
            is_damaged = (table.column("status") != MISSING) & (table.statuses() == MISSING)
        self.damaged_runs = table.column("run")[is_damaged]
        if len(self.damaged_runs) and not allow_damaged_runs:
            which = ", ".join(map(str, self.damaged_runs[:5])) + (
                " ..." if len(self.damaged_runs) > 5 else ""
            )
            raise StoreError(
                f"{path}: runs {which} changed after they were written; allowed: the sweep's own "
                "command, which computes them again"
            )

    def _check(self) -> None:
        """Set `shape` and `settings`, and check attributes and columns that every sweep has.

        Raises StoreError if one of them is missing or inconsistent.
        """
        table, place = self._table, str(self._path)
        texts = ("title", "summary", "sweep_toml", "base_scene", "scene_toml", "scene_hash")
        require_texts(self.attributes, texts, place)
        for name in ("methods", "parameter_keys"):
            names = self.attributes.get(name)
            if (
                not isinstance(names, list)
                or not names
                or not all(isinstance(one, str) for one in names)
            ):
                raise StoreError(f"{place}: its attribute {name} is no list of texts; damaged")
        # Numbers of values along the axes of a grid, the slowest axis first.
        self.shape = parsed(self.attributes.get("shape"), list, place)
        self.settings = parsed(self.attributes.get("settings"), dict, place)
        columns = sorted({*COLUMNS_OF_A_RUN} - {*table.computed})
        if columns:
            raise StoreError(
                f"{place}: has no {', '.join(columns)}: {_EARLIER}; allowed: to compute it again"
            )
        parameters = map(parameter_name, self.attributes["parameter_keys"])
        missing = sorted({*parameters, "time", "method_code"} - {*table.known})
        if missing:
            raise StoreError(f"{place}: has no {', '.join(missing)}; damaged")
        runs, codes = table.column("run"), table.column("method_code")
        if (
            runs.dtype.kind != "i"
            or (runs != np.arange(len(runs)) + runs[:1].sum()).any()
            or (runs < 0).any()
        ):
            raise StoreError(f"{place}: run is no count; damaged")
        if ((codes < 0) | (codes >= len(self.methods))).any():
            raise StoreError(f"{place}: method_code names no method; damaged")

    @functools.cached_property
    def _stored_rows(self) -> NDArray[np.intp]:
        """Return the row numbers of the stored runs."""
        return np.flatnonzero(np.asarray(self._table.column("status")) != MISSING)

    @property
    def labels(self) -> list[int]:
        """Return the numbers of the stored runs."""
        numbers: list[int] = self._table.column("run")[self._stored_rows].tolist()
        return numbers

    @property
    def scenes(self) -> list[str]:
        """Return the name of the scene that is varied."""
        return [str(self.attributes["base_scene"])]

    @property
    def title(self) -> str:
        """Return the title of the sweep, such as "sweep of paper/fig11".

        It is shown in place of the path if the file is a temporary one.
        """
        return f"sweep of {self.base_scene.label}"

    @contextmanager
    def opened_run(self, label: int) -> Iterator[StoredRun]:
        """Yield the run with the number `label`, as `StoredRuns.opened_run` does for a label."""
        with reading(self._path):
            yield self.run(int(label))

    def verify(self) -> None:
        """Do nothing: all runs were verified when the dataset was opened."""

    def values(self, name: str, sample: int | None = None) -> NDArray[Any]:
        """Return a column of the stored runs, or a scale; see `StoredRuns.values`."""
        return self._table.rows(name, self._stored_rows, sample)

    @functools.cached_property
    def base_scene(self) -> Scene:
        """Return the scene that is varied. Raises InputError if its text is no scene."""
        return parse_scene(str(self.attributes["scene_toml"]), str(self.attributes["base_scene"]))

    @property
    def methods(self) -> list[str]:
        """Return the names of the methods, in the order of their codes."""
        names: list[str] = self.attributes["methods"]
        return names

    def column(self, name: str) -> NDArray[Any]:
        """Return a column or a scale; a computed column is read when it is indexed.

        Raises StoreError if there is no column of that name.
        """
        return self._table.column(name)

    def scene_of(self, number: int) -> Scene:
        """Return the scene of the run with a number.

        The number of samples of the scene is that of the stored arrays.
        """
        row = self._row_of(number)
        values = {key: float(self.column(parameter_name(key))[row]) for key in self.keys}
        return self.base_scene.replace(**values, samples=len(self.column("time")))

    def run(self, number: int) -> StoredRun:
        """Return the run with a number."""
        row = self._row_of(number)
        scales = {name: values for name, (_, values) in self._table.known.items() if name in SCALES}
        method = self.methods[int(self.column("method_code")[row])]
        known = {"settings": self.attributes["settings"]}
        return StoredRun(
            str(self.attributes["base_scene"]),
            method,
            known,
            scales,
            self._table.place(row),
            partial(self.scene_of, number),
        )

    def _row_of(self, number: int) -> int:
        return number - int(self.column("run")[0])
