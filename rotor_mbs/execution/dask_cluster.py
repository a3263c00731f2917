"""Where the tasks of a sweep run: in processes of this machine, or on a dask cluster.

The only module that knows dask (an extra, and slow to load). A cluster needs no shared disk.
"""

from __future__ import annotations

import logging
import os
import pkgutil
import re
import socket
import threading
import time
from collections.abc import Callable, Mapping
from concurrent.futures import CancelledError, Future
from contextlib import suppress
from typing import Any, TypeVar

from rotor_mbs.errors import InputError, StoreError
from rotor_mbs.execution.pool import TaskPool, WorkerPool, one_line
from rotor_mbs.execution.provenance import fingerprint, versions

T = TypeVar("T")
R = TypeVar("R")

ENGINE_FORMS = "local, or dask:tcp://host:port"
_CONNECT_S = 3.0
_NO_WORKERS_S = 30.0
# Of the package: all that decides a number of a sweep.
_CODE = ("scenario", "solution", "methods", "models", "execution", "store", "studies")

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
    try:
        for worker, found in client.run(identity).items():
            _refuse_others(identity(), found, f"worker {worker}")
    except BaseException as exc:
        client.close()
        if isinstance(exc, InputError):
            raise
        raise InputError(
            f"--engine dask:{address}: a worker cannot tell its version ({one_line(exc)}); allowed: workers with "
            "the same versions and code"
        ) from exc
    _silence_dask()
    workers = sum(client.nthreads().values())
    if not workers:
        client.close()
        raise InputError(f"--engine dask:{address}: the scheduler has no workers; allowed: one with workers")
    return Cluster(client, workers)


def _silence_dask() -> None:
    """What it logs of a lost connection is what this program says in a line."""
    for name in list(logging.root.manager.loggerDict):
        if name.startswith(("distributed", "tornado")):
            logging.getLogger(name).setLevel(logging.CRITICAL + 1)


class Cluster:
    """Runs tasks on the workers of a dask client; a TaskPool.

    A scheduler that is gone, or has no worker for a while, is a StoreError: what is stored is kept.
    """

    shares_disk = False

    def __init__(self, client: Any, workers: int) -> None:
        self._client, self.workers = client, workers
        self._executor = client.get_executor(pure=False)  # two equal calls are two runs
        self._waiting: set[Future[Any]] = set()
        self._is_closed = threading.Event()
        threading.Thread(target=self._watch, daemon=True).start()

    def submit(self, work: Callable[[T], R], task: T, timeout_s: float) -> Future[R]:
        self._refuse_without_scheduler()
        future: Future[R] = self._executor.submit(run_as_worker, work, task, timeout_s, identity())
        self._waiting.add(future)
        future.add_done_callback(self._waiting.discard)
        return future

    def failure(self, error: BaseException) -> str:
        from distributed import KilledWorker

        self._refuse_without_scheduler()
        return "worker_died" if isinstance(error, KilledWorker | CancelledError) else "error"

    def close(self) -> None:
        self._is_closed.set()
        self._client.close()

    def _refuse_without_scheduler(self) -> None:
        if self._client.status != "running":
            raise StoreError("--engine dask: the scheduler is gone; what is stored is kept, the same command goes on")

    def _watch(self) -> None:
        """A cluster whose last worker is gone would be waited for without end."""
        without_since = time.monotonic()
        while not self._is_closed.wait(1.0):
            if self._client.status != "running" or self._client.nthreads():
                without_since = time.monotonic()
            elif time.monotonic() - without_since > _NO_WORKERS_S:
                error = StoreError(f"--engine dask: no workers for {_NO_WORKERS_S:g} s; what is stored is kept")
                for future in list(self._waiting):
                    with suppress(Exception):  # one that has just ended
                        future.set_exception(error)
                return


def identity() -> dict[str, str]:
    """What must be equal here and in a worker of a cluster, or its numbers would be others: versions and code."""
    return {**versions(), "code of rotor_mbs": fingerprint(*_CODE)[:12]}


def _refuse_others(expected: Mapping[str, str], found: Mapping[str, str], where: str) -> None:
    """Raises InputError where a worker has another version of anything that decides a number."""
    wrong = [
        f"{name} {found.get(name, 'missing')} (here {here})"
        for name, here in expected.items()
        if found.get(name) != here
    ]
    if wrong:
        raise InputError(
            f"--engine dask: {where} has {', '.join(wrong)}; allowed: workers with the same versions and code"
        )


def _answers(address: str) -> bool:
    """Whether a scheduler answers there: a client that finds none, or another program, waits for minutes."""
    import asyncio

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


def run_as_worker(work: Callable[[T], R], task: T, timeout_s: float, expected: Mapping[str, str]) -> R:
    """Ends this worker process where the task takes too long (dask has no time limits); its nanny starts a new one.

    By a watchdog outside the interpreter: an engine that hangs may hold the interpreter's lock.
    """
    import faulthandler

    _refuse_others(expected, identity(), f"the worker on {socket.gethostname()}")  # it may have joined later
    with open(os.devnull, "w") as nowhere:  # noqa: PTH123  (a device)
        faulthandler.dump_traceback_later(timeout_s, exit=True, file=nowhere)
        try:
            return work(task)
        finally:
            faulthandler.cancel_dump_traceback_later()
