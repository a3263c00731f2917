"""A file of another program as columns, read by a process of its own with limits.

What a file holds is decided by others: it may be damaged, or made to harm. Every format is read
apart, so that a file that ends a library's process, keeps it busy or fills its memory is one line
here.
"""

from __future__ import annotations

import json
import os
import subprocess
import sys
import tempfile
from pathlib import Path

import numpy as np

from rotor_mbs.comparison.columns import DataColumn, DataTable
from rotor_mbs.comparison.formats import FORMATS, MAX_BYTES
from rotor_mbs.errors import InputError, ResourceError

TIME_LIMIT_S = 120.0  # for reading a file; text of MAX_BYTES takes some 40 s
# Bytes of address space: text of MAX_BYTES takes half of it, with its arrays.
MEMORY_LIMIT = 1 << 32
_CALL = "from rotor_mbs.comparison.formats import write_columns; write_columns()"
# Threads of linear algebra, of which there is none here, reserve address space for each processor.
_ONE_THREAD = {"OPENBLAS_NUM_THREADS": "1", "MKL_NUM_THREADS": "1", "OMP_NUM_THREADS": "1"}


def read_table(path: str | os.PathLike[str], group: str = "", scene: str = "") -> DataTable:
    """Read the columns of numbers in a file of any format.

    Parameters
    ----------
    path : the file; what it is is decided by its first bytes.
    group, scene : of an HDF5 file, see `runs.table.read_arrays`.

    Raises
    ------
    InputError
        In one line, for what cannot be read within `TIME_LIMIT_S` and `MEMORY_LIMIT`.
    ResourceError
        If the reading process cannot be started, or its result not be stored.
    """
    path = Path(path)
    if not path.is_file():
        problem = "is a folder" if path.is_dir() else "no such file"
        raise InputError(f"{path}: {problem}; allowed: {FORMATS}")
    size = path.stat().st_size
    if size == 0:
        raise InputError(f"{path}: empty; allowed: {FORMATS}")
    if size > MAX_BYTES:
        allowed = f"up to {MAX_BYTES / 2**30:g} GB: export fewer rows"
        raise InputError(f"{path}: {size / 2**30:.1f} GB; allowed: {allowed}")
    try:
        path.open("rb").close()
    except OSError as exc:
        raise InputError(f"{path}: cannot be read: {exc.strerror}") from exc
    try:
        return _read_apart(path, group, scene)
    except OSError as exc:
        problem = f"the reading process could not be started: {exc}"
        raise ResourceError(f"{path}: cannot be read: {problem}") from exc


def _read_apart(path: Path, group: str, scene: str) -> DataTable:
    """Read a file in a process of its own.

    Parameters
    ----------
    path, group, scene : see `read_table`.

    Raises
    ------
    InputError
        For what cannot be read.
    OSError
        Where the process cannot be started, or its files not be written.
    """
    folders = os.pathsep.join(str(Path(folder).absolute()) for folder in sys.path)
    with tempfile.TemporaryDirectory() as folder:
        output = Path(folder) / "columns"
        limits = [str(MEMORY_LIMIT), str(TIME_LIMIT_S)]
        command = [sys.executable, "-P", "-W", "ignore", "-c", _CALL]
        command += [str(path), str(output), group, scene, *limits]
        try:
            # Whatever libraries print is dropped: it may be of any size.
            subprocess.run(
                command,
                stdin=subprocess.DEVNULL,
                stdout=subprocess.DEVNULL,
                stderr=subprocess.DEVNULL,
                timeout=TIME_LIMIT_S,
                check=False,
                env=os.environ | _ONE_THREAD | {"PYTHONPATH": folders},
            )
        except subprocess.TimeoutExpired:
            problem = f"cannot be read within {TIME_LIMIT_S:g} s"
            raise InputError(f"{path}: {problem}; allowed: {FORMATS}") from None
        try:
            result = json.loads(output.with_suffix(".json").read_text(encoding="ascii"))
        except (FileNotFoundError, ValueError):
            problem = "cannot be read: the reading process died"
            raise InputError(f"{path}: {problem}; allowed: {FORMATS}") from None
        if "problems" in result:
            raise InputError(result["problems"])
        numbers = np.fromfile(output.with_suffix(".f8"), np.float64)
    columns = {}
    begin = 0
    for name, unit, length in zip(result["names"], result["units"], result["lengths"], strict=True):
        columns[name] = DataColumn(numbers[begin : begin + length], unit)
        begin += length
    return DataTable(str(path), columns)
