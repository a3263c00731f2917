"""Cases and tasks, computed in this process, in worker processes of this machine, or on a cluster."""

import os


def cores() -> int:
    """The cores that this process may use."""
    return len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1
