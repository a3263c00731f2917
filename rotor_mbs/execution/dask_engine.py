"""A dask cluster as an engine: the only file that knows dask. Needs the scheduler's address, and no shared disk."""

from __future__ import annotations

import os
from collections.abc import Callable
from concurrent.futures import Executor, Future
from typing import Any, TypeVar

from rotor_mbs.errors import InputError
from rotor_mbs.execution.engines import ENGINE_FORMS, Engine
from rotor_mbs.execution.worker import call

T = TypeVar("T")
R = TypeVar("R")

_CONNECT_S = 3.0
_PREPARE_S = 60.0


def open_cluster(address: str, prepare: str = "") -> Engine:
    """The cluster whose scheduler is at `address`, tcp://host:port. Raises InputError where none answers.

    prepare   "module:name", a function to call on it before there are tasks
    """
    try:
        from distributed import Client, KilledWorker
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
    # pure=False: two equal calls are two runs.
    executor = client.get_executor(pure=False)

    def cause(error: BaseException) -> str:
        return "worker_died" if isinstance(error, KilledWorker) else "error"

    limited = _Limited(executor)
    for _ in range(workers if prepare else 0):
        limited.submit(call, prepare, _PREPARE_S)
    return Engine(limited, workers, cause, client.close)


def _answers(address: str) -> bool:
    """Whether a scheduler greets there: a client that finds none waits long, and longer when it is closed."""
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
    except Exception:  # whatever a stranger at that address may answer
        return False
    return True


class _Limited(Executor):
    """Gives every task its time limit: dask has none of its own."""

    def __init__(self, executor: Executor) -> None:
        self._executor = executor

    def submit(self, work: Callable[..., Any], /, *args: Any, **_: Any) -> Future[Any]:
        return self._executor.submit(_ended_when_late, work, *args)

    def shutdown(self, wait: bool = True, *, cancel_futures: bool = False) -> None:
        self._executor.shutdown(wait, cancel_futures=cancel_futures)


def _ended_when_late(work: Callable[[T], R], task: T, timeout_s: float) -> R:
    """Ends this worker process where the task takes too long; its supervisor starts a new one.

    By a watchdog outside the interpreter: an engine that hangs may hold the interpreter's lock.
    """
    import faulthandler

    with open(os.devnull, "w") as nowhere:  # noqa: PTH123  (a device)
        faulthandler.dump_traceback_later(timeout_s, exit=True, file=nowhere)
        try:
            return work(task)
        finally:
            faulthandler.cancel_dump_traceback_later()
