"""Where a sweep's work is done: on this machine, or on a dask cluster. One small interface on executors.

Knows nothing of scenes, models or files: a task is a picklable function with its argument.
"""

from __future__ import annotations

import os
import re
from collections.abc import Callable
from concurrent.futures import Executor, Future
from dataclasses import dataclass
from typing import TypeVar

from rotor_mbs.errors import InputError
from rotor_mbs.execution.pool import ProcessPool, cause_of

T = TypeVar("T")
R = TypeVar("R")

# A task's arrays are as large as the last one's. Memory that a process keeps (with the GNU C library, up to 128 MB) it
# need not get from the system again, page by page: an eleventh of a fast run with many samples.
_KEEP_MEMORY = {"MALLOC_MMAP_THRESHOLD_": str(1 << 25), "MALLOC_TRIM_THRESHOLD_": str(1 << 27)}

ENGINE_FORMS = "local, or dask:tcp://host:port"


@dataclass(frozen=True)
class Engine:
    """An executor, and what is particular about it.

    executor   its `submit(work, task, timeout_s)` gives a future
    workers    how many tasks it works on at once
    cause      why a future failed: "timed_out", "worker_died", or "error" for what the task itself raised
    stop       ends it now, with all that it is doing
    begin      called before the first task: whether tasks may share a process, each in a thread of its own
    shares_disk   whether the workers see this process's files
    """

    executor: Executor
    workers: int
    cause: Callable[[BaseException], str]
    stop: Callable[[], None]
    begin: Callable[[bool], None] = lambda _: None
    shares_disk: bool = False

    def submit(self, work: Callable[[T], R], task: T, timeout_s: float) -> Future[R]:
        return self.executor.submit(work, task, timeout_s)  # type: ignore[call-arg]


def open_engine(name: str, workers: int, prepare: str = "") -> Engine:
    """The engine called `name`. Raises InputError where there is none, or it does not answer.

    prepare   "module:name", a function that its workers call in advance, to load their code
    """
    if name == "local":
        return _local(workers, prepare)
    if re.fullmatch(r"dask:tcp://[^\s/:]+:[0-9]{1,5}", name):
        from rotor_mbs.execution.dask_engine import open_cluster  # an extra, and slow to load

        return open_cluster(name.removeprefix("dask:"), prepare)
    raise InputError(f"--engine {name}: no such engine; allowed: {ENGINE_FORMS}")


def _local(workers: int, prepare: str) -> Engine:
    for name, value in _KEEP_MEMORY.items():
        os.environ.setdefault(name, value)
    pool = ProcessPool(workers, prepare)
    return Engine(
        pool,
        workers,
        cause_of,
        stop=lambda: pool.shutdown(cancel_futures=True),
        begin=lambda in_threads: pool.begin(in_threads=in_threads),
        shares_disk=True,
    )
