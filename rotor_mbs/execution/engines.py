"""Where the tasks of a sweep run: in processes of this machine, or on a dask cluster."""

from __future__ import annotations

import os
import re

from rotor_mbs.errors import InputError
from rotor_mbs.execution.pool import ImportedCall, TaskPool, open_pool

ENGINE_FORMS = "local, or dask:tcp://host:port"

# A task's arrays are as large as the last one's. Memory that a process keeps (with the GNU C library, up to 128 MB) it
# need not get from the system again, page by page: an eleventh of a fast run with many samples.
_KEEP_MEMORY = {"MALLOC_MMAP_THRESHOLD_": str(1 << 25), "MALLOC_TRIM_THRESHOLD_": str(1 << 27)}


def open_engine(name: str, workers: int, initializer: ImportedCall | None = None) -> TaskPool:
    """The engine called `name`, with `workers` processes where it is local.

    Parameters
    ----------
    initializer
        What its workers call first, to load their code.

    Raises
    ------
    InputError
        Where there is no such engine, or it does not answer.
    """
    if name == "local":
        for variable, value in _KEEP_MEMORY.items():
            os.environ.setdefault(variable, value)
        return open_pool(workers, initializer)
    if re.fullmatch(r"dask:tcp://[^\s/:]+:[0-9]{1,5}", name):
        from rotor_mbs.execution.dask_engine import open_cluster  # an extra, and slow to load

        return open_cluster(name.removeprefix("dask:"), initializer)
    raise InputError(f"--engine {name}: no such engine; allowed: {ENGINE_FORMS}")
