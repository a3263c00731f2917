"""A dask cluster as an engine: the only file that knows dask. Needs the scheduler's address, and no shared disk."""

from __future__ import annotations

import os
from collections.abc import Callable
from concurrent.futures import Future
from typing import Any, TypeVar

from rotor_mbs.errors import InputError
from rotor_mbs.execution.pool import ImportedCall

T = TypeVar("T")
R = TypeVar("R")

_CONNECT_S = 3.0
_INITIALIZE_S = 60.0


def open_cluster(address: str, initializer: ImportedCall | None = None) -> Cluster:
    """The cluster whose scheduler is at `address`, tcp://host:port. Raises InputError where none answers.

    initializer   called once per worker before there are tasks, to load their code
    """
    forms = "local, or dask:tcp://host:port"
    try:
        from distributed import Client
    except ImportError as exc:
        raise InputError("--engine dask: dask is not installed; pip install distributed") from exc
    if not _answers(address):
        raise InputError(f"--engine dask:{address}: no dask scheduler answers there; allowed: {forms}")
    make: Any = Client
    client = make(address, timeout=_CONNECT_S, set_as_default=False)
    workers = sum(client.nthreads().values())
    if not workers:
        client.close()
        raise InputError(f"--engine dask:{address}: the scheduler has no workers; allowed: one with workers")
    cluster = Cluster(client, workers)
    if initializer is not None:
        for _ in range(workers):
            cluster.submit(_call, initializer, _INITIALIZE_S)
    return cluster


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


def _call(function: Callable[[], None]) -> None:
    function()


def _answers(address: str) -> bool:
    """Whether a scheduler answers there: a client that finds none waits long, and longer when it is closed."""
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
