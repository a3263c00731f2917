"""Open what runs the tasks of a sweep (`--engine`): processes of this machine or a cluster."""

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

# A task's arrays are as large as the last one's. Memory that a process keeps (with the GNU C
# library, up to 128 MB) it need not get from the system again, page by page: an eleventh of a fast
# run with many samples.
_KEEP_MEMORY = {"MALLOC_MMAP_THRESHOLD_": str(1 << 25), "MALLOC_TRIM_THRESHOLD_": str(1 << 27)}


def open_task_pool(name: str, workers: int) -> TaskPool:
    """Open what runs the tasks of a sweep.

    Parameters
    ----------
    name : "local", or "dask:tcp://host:port".
    workers : how many processes of a local engine; 0 for this process.

    Raises
    ------
    InputError
        For another name, and a cluster that cannot be used.
    """
    if name == "local":
        return local_pool(workers, _load, _KEEP_MEMORY)
    if not re.fullmatch(r"dask:tcp://[^\s/:]+:[0-9]{1,5}", name):
        raise InputError(f"engine {name}: no such engine; allowed: {ENGINE_FORMS}")
    from rotor_mbs.processes.cluster import open_cluster  # late: only for a cluster

    return open_cluster(name.removeprefix("dask:"), partial(refuse_other_code, identity()))


def _load() -> None:
    """Load what the runs of a sweep compute with, and the fast engine where it is installed."""
    import_module("rotor_mbs.studies.sweep")  # by its name: only the workers import it
    import_module("rotor_mbs.models.lagrange.heyoka_adapter").is_available()


def identity() -> dict[str, str]:
    """Return what must be equal here and in a worker, or its numbers differ: versions and code."""
    return {**versions(), "code of rotor_mbs": numerics_digest()}


def refuse_other_code(expected: Mapping[str, str]) -> None:
    """Raise InputError in a worker that has another version of anything that decides a number."""
    here = identity()
    others = [name for name in expected if name not in here]  # packages of a method's file
    here = versions_with(*others) | here
    wrong = []
    for name, version in expected.items():
        if here[name] != version:
            wrong.append(f"{name} {here[name]} (here {version})")
    if wrong:
        problem = "a worker has other versions or other code; allowed: workers with the same"
        where = f"on {socket.gethostname()}: {', '.join(wrong)}"
        raise InputError(f"engine dask: {problem} ({where})")
