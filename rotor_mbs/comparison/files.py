"""Read a file of another program as columns, in a worker process with limits.

A file of another program may be damaged or malicious. Files of all formats are therefore read in a
worker process. If that process dies, takes too long or needs too much memory, the caller gets an
error of one line.
"""

from __future__ import annotations

import os
from pathlib import Path

from rotor_mbs.comparison.columns import DataTable
from rotor_mbs.comparison.formats import FORMATS, MAX_BYTES, read_in_worker
from rotor_mbs.errors import InputError
from rotor_mbs.processes.worker import TaskLostError, Worker

TIME_LIMIT_S = 120.0  # time limit for reading a file; a text file of MAX_BYTES takes some 40 s
# Limit of the worker's address space, in bytes. Reading a text file of MAX_BYTES takes half of it,
# including the arrays of its numbers.
MEMORY_LIMIT = 1 << 32


def read_table(path: str | os.PathLike[str], group: str = "", scene: str = "") -> DataTable:
    """Read the columns of numbers in a file of any format.

    Parameters
    ----------
    path : the file. The format is recognized by the first bytes of the file; OpenFAST's binary
        output is recognized by its ending `.outb`.
    group, scene : the group of an HDF5 file that is read, and the name of a scene whose groups are
        preferred, see `runs.arrays.read_arrays`.

    Raises
    ------
    InputError
        If the file cannot be read within `TIME_LIMIT_S` and `MEMORY_LIMIT`.
    ResourceError
        If the worker process cannot be started.
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
    # The worker discards what the libraries print, as the amount of it is not limited.
    with Worker(memory_limit=MEMORY_LIMIT, is_silent=True) as worker:
        try:
            return worker.run(read_in_worker, (path, group, scene), TIME_LIMIT_S)
        except TaskLostError as exc:
            problem = "cannot be read: the reading process died"
            if exc.failure == "timed_out":
                problem = f"cannot be read within {TIME_LIMIT_S:g} s"
            raise InputError(f"{path}: {problem}; allowed: {FORMATS}") from None
        except MemoryError:
            limit = f"{MEMORY_LIMIT / 2**30:g} GB"
            allowed = "fewer rows, columns or arrays in one file"
            problem = f"reading it takes more memory than {limit}; allowed: {allowed}"
            raise InputError(f"{path}: {problem}") from None
