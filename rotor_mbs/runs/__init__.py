"""Tables of runs in HDF5 files, and what fills them: a runner, worker processes, a cluster."""

import os

MAX_WORKERS = 1024  # processes


def cores() -> int:
    """The cores that this process may use."""
    return len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1


def last_core() -> int | None:
    """The core to time on: the last allowed one, as the first serves most interrupts; None where that is not known."""
    return max(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else None
