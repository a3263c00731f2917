"""Run code in other processes: a worker that can be ended at any time, pools, a cluster."""

import os

MAX_WORKERS = 1024  # largest number of worker processes


def cores() -> int:
    """Return the number of cores that this process may use."""
    if hasattr(os, "sched_getaffinity"):
        return len(os.sched_getaffinity(0))
    return os.cpu_count() or 1


def last_core() -> int | None:
    """Return the number of the core on which timings run; None if the system does not name cores.

    It is the last core that this process may use, as the first one handles most interrupts.
    """
    return max(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else None
