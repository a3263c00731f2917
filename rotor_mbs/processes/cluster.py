"""Run tasks on a dask cluster, which needs no shared disk.

The only module that imports dask (an extra, and slow to load).
"""

from __future__ import annotations

import logging
import os
import threading
import time
from collections.abc import Callable
from concurrent.futures import CancelledError, Future
from contextlib import ExitStack, suppress
from typing import Any

from rotor_mbs.errors import InputError, StoreError, one_line
from rotor_mbs.processes.pool import R, T, TaskPool

_CONNECT_S = 3.0


def open_cluster(address: str, check: Callable[[], object]) -> Cluster:
    """Connect to a dask scheduler.

    Parameters
    ----------
    address : "tcp://host:port".
    check : called in every worker, now and before each task; raises InputError for a worker that
        must not be used.

    Raises
    ------
    InputError
        If dask is not installed, no scheduler answers there, or it has no worker that can be used.
    """
    import asyncio

    engine = f"engine dask:{address}"
    try:
        from distributed import Client
        from distributed.comm.core import connect
    except ImportError as exc:
        message = "engine dask: dask is not installed; pip install distributed"
        raise InputError(message) from exc
    # What it logs of a lost connection is said here in a line.
    for logger in list(logging.root.manager.loggerDict):
        if logger.startswith(("distributed", "tornado")):
            logging.getLogger(logger).setLevel(logging.CRITICAL + 1)
    try:  # a client would wait for the answer of another program without end
        asyncio.run(asyncio.wait_for(connect(address), _CONNECT_S)).abort()
    except Exception as exc:  # whatever answers there
        allowed = "local, or the address of a scheduler"
        message = f"{engine}: no dask scheduler answers there; allowed: {allowed}"
        raise InputError(message) from exc
    with ExitStack() as stack:
        client = stack.enter_context(Client(address, timeout=_CONNECT_S, set_as_default=False))
        try:
            client.run(check)
        except InputError:
            raise
        except Exception as exc:  # of a worker that has no such function
            allowed = "workers with the code of this process"
            message = f"{engine}: a worker has other code ({one_line(exc)}); allowed: {allowed}"
            raise InputError(message) from exc
        if not client.nthreads():
            allowed = "one with workers"
            raise InputError(f"{engine}: the scheduler has no workers; allowed: {allowed}")
        stack.pop_all()
    return Cluster(client, check)


class Cluster(TaskPool):
    """The workers of a dask client.

    A scheduler that is lost, or has no worker for `patience_s`, is a StoreError.

    Parameters
    ----------
    client : a dask client; closed with the pool.
    check : called in a worker before each task.
    patience_s : time in s that may pass without a worker.
    """

    shares_disk = False

    def __init__(self, client: Any, check: Callable[[], object], patience_s: float = 30.0) -> None:
        self.workers = sum(client.nthreads().values())
        self._client = client
        self._check = check
        self._patience_s = patience_s
        self._executor = client.get_executor(pure=False)  # two equal calls are two runs
        self._waiting: set[Future[Any]] = set()
        threading.Thread(target=self._watch, daemon=True).start()

    def submit(self, work: Callable[[T], R], task: T, timeout_s: float) -> Future[R]:
        """Return the future of `work(task)`. Raises StoreError if the scheduler is lost."""
        self._refuse_without_scheduler()
        future: Future[R] = self._executor.submit(run_as_worker, work, task, timeout_s, self._check)
        self._waiting.add(future)
        future.add_done_callback(self._waiting.discard)
        return future

    def failure(self, error: BaseException) -> str:
        """Return why a future failed: "worker_died", or "error" of the task itself.

        Raises StoreError if the scheduler is lost.
        """
        from distributed import KilledWorker

        self._refuse_without_scheduler()
        return "worker_died" if isinstance(error, KilledWorker | CancelledError) else "error"

    def close(self) -> None:
        """Close the connection to the cluster."""
        self._client.close()

    def _refuse_without_scheduler(self) -> None:
        if self._client.status != "running":
            problem = "the scheduler was lost; stored runs are kept"
            raise StoreError(f"engine dask: {problem}, repeat the command to continue")

    def _watch(self) -> None:
        """Fail all waiting futures if the cluster has no worker for `patience_s`.

        Otherwise they would wait without end.
        """
        without_since = time.monotonic()
        while time.monotonic() - without_since < self._patience_s:
            time.sleep(min(self._patience_s / 2.0, 1.0))
            # The scheduler is gone, which ends the futures, too; or this client is closed.
            with suppress(Exception):
                if self._client.nthreads():
                    without_since = time.monotonic()
        error = StoreError(
            f"engine dask: no workers for {self._patience_s:g} s; stored runs are kept"
        )
        for future in list(self._waiting):
            with suppress(Exception):  # one that has just ended
                future.set_exception(error)


def run_as_worker(
    work: Callable[[T], R], task: T, timeout_s: float, check: Callable[[], object]
) -> R:
    """Call `work(task)` in a worker of a cluster, which is ended if the task takes too long.

    Dask has no time limits; the worker's nanny starts a new one. It is ended by a watchdog outside
    the interpreter, as an engine that hangs may hold the interpreter's lock.

    Parameters
    ----------
    work, task : a function and its argument.
    timeout_s : time limit in s.
    check : called before; raises an error in a worker that must not be used.
    """
    import faulthandler

    check()  # the worker may have joined later
    with open(os.devnull, "w") as nowhere:  # noqa: PTH123  (a device)
        faulthandler.dump_traceback_later(timeout_s, exit=True, file=nowhere)
        try:
            return work(task)
        finally:
            faulthandler.cancel_dump_traceback_later()
