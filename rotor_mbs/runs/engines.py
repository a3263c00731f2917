"""Open the pool that runs the tasks of a sweep (`--engine`): local processes or a dask cluster."""

from __future__ import annotations

import re
import socket
from collections.abc import Mapping
from functools import partial
from importlib import import_module

from rotor_mbs.errors import InputError
from rotor_mbs.processes.pool import TaskPool, local_pool
from rotor_mbs.runs.versions import numerics_digest, versions, versions_with

ENGINE_FORMS = "local, or dask:tcp://host:port"

# Settings of the GNU C library with which a process keeps up to 128 MB of memory that it has freed.
# The arrays of a task are as large as those of the task before, and reuse this memory. To get it
# from the system again, page by page, takes an eleventh of the time of a fast run with many
# samples.
_KEEP_MEMORY = {"MALLOC_MMAP_THRESHOLD_": str(1 << 25), "MALLOC_TRIM_THRESHOLD_": str(1 << 27)}


def open_task_pool(name: str, workers: int) -> TaskPool:
    """Open the pool that runs the tasks of a sweep.

    Parameters
    ----------
    name : "local", or "dask:tcp://host:port".
    workers : number of local processes; with 0, tasks run in this process. A cluster ignores it.

    Raises
    ------
    InputError
        If the name is another one, or the cluster cannot be used.
    """
    if name == "local":
        return local_pool(workers, _load, _KEEP_MEMORY)
    if not re.fullmatch(r"dask:tcp://[^\s/:]+:[0-9]{1,5}", name):
        raise InputError(f"engine {name}: no such engine; allowed: {ENGINE_FORMS}")
    from rotor_mbs.processes.cluster import open_cluster  # imported late: only a cluster needs it

    return open_cluster(name.removeprefix("dask:"), partial(refuse_other_code, identity()))


def _load() -> None:
    """Load the code that computes the runs of a sweep, and heyoka if it is installed."""
    import_module("rotor_mbs.studies.sweep")  # by its name, as only the workers import it
    import_module("rotor_mbs.models.lagrange.heyoka_adapter").is_available()


def identity() -> dict[str, str]:
    """Return versions and a digest of the code; if a worker has others, its numbers may differ."""
    return {**versions(), "code of rotor_mbs": numerics_digest()}


def refuse_other_code(expected: Mapping[str, str]) -> None:
    """Raise InputError if this worker has other versions or other code than are expected.

    Parameters
    ----------
    expected : `identity` of the process that sends the tasks.
    """
    here = identity()
    # Packages that a method file names, which this worker has not loaded.
    others = [name for name in expected if name not in here]
    here = versions_with(*others) | here
    wrong = []
    for name, version in expected.items():
        if here[name] != version:
            wrong.append(f"{name} {here[name]} (here {version})")
    if wrong:
        problem = "a worker has other versions or other code; allowed: workers with the same"
        where = f"on {socket.gethostname()}: {', '.join(wrong)}"
        raise InputError(f"engine dask: {problem} ({where})")
