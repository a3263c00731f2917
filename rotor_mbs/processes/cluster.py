"""Run tasks on a dask cluster, which needs no shared disk.

This is the only module that imports dask, which is an optional package and slow to load.
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
    """Connect to a dask scheduler, and return its cluster as an open pool.

    Parameters
    ----------
    address : "tcp://host:port".
    check : function that is called in every worker now, and before each task. It raises InputError
        in a worker that must not be used.

    Raises
    ------
    InputError
        If dask is not installed, no scheduler answers at the address, the scheduler has no workers,
        or one of its workers must not be used.
    """
    import asyncio

    engine = f"engine dask:{address}"
    try:
        from distributed import Client
        from distributed.comm.core import connect
    except ImportError as exc:
        message = "engine dask: dask is not installed; pip install distributed"
        raise InputError(message) from exc
    # The logs of dask on a lost connection are dropped: this module raises an error of one line.
    for logger in list(logging.root.manager.loggerDict):
        if logger.startswith(("distributed", "tornado")):
            logging.getLogger(logger).setLevel(logging.CRITICAL + 1)
    try:  # if another program answers at the address, a client would wait for it without end
        asyncio.run(asyncio.wait_for(connect(address), _CONNECT_S)).abort()
    except Exception as exc:  # any error, as any program may answer
        allowed = "local, or the address of a scheduler"
        message = f"{engine}: no dask scheduler answers there; allowed: {allowed}"
        raise InputError(message) from exc
    with ExitStack() as stack:
        client = stack.enter_context(Client(address, timeout=_CONNECT_S, set_as_default=False))
        try:
            client.run(check)
        except InputError:
            raise
        except Exception as exc:  # a worker does not have the function `check`
            allowed = "workers with the code of this process"
            message = f"{engine}: a worker has other code ({one_line(exc)}); allowed: {allowed}"
            raise InputError(message) from exc
        if not client.nthreads():
            allowed = "one with workers"
            raise InputError(f"{engine}: the scheduler has no workers; allowed: {allowed}")
        stack.pop_all()
    return Cluster(client, check)


class Cluster(TaskPool):
    """The workers of a dask client, as a pool.

    StoreError is raised if the scheduler is lost, or has no worker for longer than `patience_s`.

    Parameters
    ----------
    client : a dask client, which is closed with the pool.
    check : function that is called in a worker before each task.
    patience_s : s, longest time without a worker.
    """

    shares_disk = False

    def __init__(self, client: Any, check: Callable[[], object], patience_s: float = 30.0) -> None:
        self.workers = sum(client.nthreads().values())
        self._client = client
        self._check = check
        self._patience_s = patience_s
        self._executor = client.get_executor(pure=False)  # dask must compute equal calls, too
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
        """Return why a future failed: "worker_died", or "error" if the task raised one.

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

        Otherwise the futures would wait without end.
        """
        without_since = time.monotonic()
        while time.monotonic() - without_since < self._patience_s:
            time.sleep(min(self._patience_s / 2.0, 1.0))
            # An error means that the scheduler is gone, which also ends the futures, or that this
            # client is closed.
            with suppress(Exception):
                if self._client.nthreads():
                    without_since = time.monotonic()
        error = StoreError(
            f"engine dask: no workers for {self._patience_s:g} s; stored runs are kept"
        )
        for future in list(self._waiting):
            with suppress(Exception):  # the future has just ended
                future.set_exception(error)


def run_as_worker(
    work: Callable[[T], R], task: T, timeout_s: float, check: Callable[[], object]
) -> R:
    """Return `work(task)`, called in a worker of a cluster; end the worker if it takes too long.

    Dask has no time limits for tasks. A watchdog therefore ends the worker process, and the nanny
    of dask starts a new one. The watchdog is outside the interpreter, as an engine that hangs may
    hold the interpreter's lock.

    Parameters
    ----------
    work, task : a function and its argument.
    timeout_s : time limit in s.
    check : function that is called first. It raises an error in a worker that must not be used.
    """
    import faulthandler

    check()  # the worker may have joined the cluster after `open_cluster` called this function
    with open(os.devnull, "w") as nowhere:  # noqa: PTH123  (a device)
        faulthandler.dump_traceback_later(timeout_s, exit=True, file=nowhere)
        try:
            return work(task)
        finally:
            faulthandler.cancel_dump_traceback_later()
