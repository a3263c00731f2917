"""Where the tasks of a sweep run: in processes of this machine, or on a dask cluster.

The only module that knows dask (an extra, and slow to load). A cluster needs no shared disk.
"""

from __future__ import annotations

import os
import pkgutil
import re
from collections.abc import Callable
from concurrent.futures import Future
from typing import Any, TypeVar

from rotor_mbs.errors import InputError
from rotor_mbs.execution.pool import TaskPool, WorkerPool

T = TypeVar("T")
R = TypeVar("R")

ENGINE_FORMS = "local, or dask:tcp://host:port"
_CONNECT_S = 3.0

# By its name: only the workers import it.
_LOAD = "rotor_mbs.studies.sweep_work:prepare"

# A task's arrays are as large as the last one's. Memory that a process keeps (with the GNU C library, up to 128 MB) it
# need not get from the system again, page by page: an eleventh of a fast run with many samples.
_KEEP_MEMORY = {"MALLOC_MMAP_THRESHOLD_": str(1 << 25), "MALLOC_TRIM_THRESHOLD_": str(1 << 27)}


def open_task_pool(name: str, workers: int) -> TaskPool:
    """The engine called `name`, with `workers` processes where it is local; these load their code at once.

    Raises InputError where there is no such engine, or it does not answer.
    """
    if name == "local":
        for variable, value in _KEEP_MEMORY.items():
            os.environ.setdefault(variable, value)
        return WorkerPool(workers, _load)
    if re.fullmatch(r"dask:tcp://[^\s/:]+:[0-9]{1,5}", name):
        return _open_cluster(name.removeprefix("dask:"))
    raise InputError(f"--engine {name}: no such engine; allowed: {ENGINE_FORMS}")


def _load() -> None:
    pkgutil.resolve_name(_LOAD)()


def _open_cluster(address: str) -> Cluster:
    try:
        from distributed import Client
    except ImportError as exc:
        raise InputError("--engine dask: dask is not installed; pip install distributed") from exc
    if not _answers(address):
        raise InputError(f"--engine dask:{address}: no dask scheduler answers there; allowed: {ENGINE_FORMS}")
    make: Any = Client
    client = make(address, timeout=_CONNECT_S, set_as_default=False)
    workers = sum(client.nthreads().values())
    if not workers:
        client.close()
        raise InputError(f"--engine dask:{address}: the scheduler has no workers; allowed: one with workers")
    return Cluster(client, workers)


class Cluster:
    """Runs tasks on the workers of a dask client; a TaskPool."""

    shares_disk = False

    def __init__(self, client: Any, workers: int) -> None:
        self._client, self.workers = client, workers
        self._executor = client.get_executor(pure=False)  # two equal calls are two runs

    def submit(self, work: Callable[[T], R], task: T, timeout_s: float) -> Future[R]:
        future: Future[R] = self._executor.submit(_with_time_limit, work, task, timeout_s)
        return future

    def failure(self, error: BaseException) -> str:
        from distributed import KilledWorker

        return "worker_died" if isinstance(error, KilledWorker) else "error"

    def close(self) -> None:
        self._client.close()


def _answers(address: str) -> bool:
    """Whether a scheduler answers there: a client that finds none, or another program, waits for minutes."""
    import asyncio
    import logging

    from distributed.comm.core import connect

    async def greet() -> None:
        meet: Any = connect
        comm = await meet(address, timeout=_CONNECT_S)
        await comm.close()

    logging.getLogger("distributed").setLevel(logging.CRITICAL)
    try:
        asyncio.run(asyncio.wait_for(greet(), _CONNECT_S))
    except Exception:  # whatever another program at that address may answer
        return False
    return True


def _with_time_limit(work: Callable[[T], R], task: T, timeout_s: float) -> R:
    """Ends this worker process where the task takes too long (dask has no time limits); its nanny starts a new one.

    By a watchdog outside the interpreter: an engine that hangs may hold the interpreter's lock.
    """
    import faulthandler

    with open(os.devnull, "w") as nowhere:  # noqa: PTH123  (a device)
        faulthandler.dump_traceback_later(timeout_s, exit=True, file=nowhere)
        try:
            return work(task)
        finally:
            faulthandler.cancel_dump_traceback_later()
