"""Where the tasks of a sweep run: in processes of this machine, or on a dask cluster.

The only module that knows dask (an extra, and slow to load). A cluster needs no shared disk.
"""

from __future__ import annotations

import logging
import os
import re
import socket
import threading
import time
from collections.abc import Callable, Mapping
from concurrent.futures import CancelledError, Future
from contextlib import ExitStack, suppress
from importlib import import_module
from typing import Any

from rotor_mbs.errors import InputError, StoreError, one_line
from rotor_mbs.runs.pool import R, T, TaskPool, local_pool
from rotor_mbs.runs.versions import numerics_digest, versions, versions_with

ENGINE_FORMS = "local, or dask:tcp://host:port"
_CONNECT_S = 3.0
_OTHER_CODE = "a worker has other versions or other code; allowed: workers with the same"

# A task's arrays are as large as the last one's. Memory that a process keeps (with the GNU C library, up to 128 MB) it
# need not get from the system again, page by page: an eleventh of a fast run with many samples.
_KEEP_MEMORY = {"MALLOC_MMAP_THRESHOLD_": str(1 << 25), "MALLOC_TRIM_THRESHOLD_": str(1 << 27)}


def open_task_pool(name: str, workers: int) -> TaskPool:
    """The engine called `name`; of a local one the number of processes, 0 for this one. Raises InputError."""
    if name == "local":
        for variable, value in _KEEP_MEMORY.items() if workers else ():
            os.environ.setdefault(variable, value)
        return local_pool(workers, _load)
    if not re.fullmatch(r"dask:tcp://[^\s/:]+:[0-9]{1,5}", name):
        raise InputError(f"engine {name}: no such engine; allowed: {ENGINE_FORMS}")
    import asyncio

    address, engine = name.removeprefix("dask:"), f"engine {name}"
    try:
        from distributed import Client
        from distributed.comm.core import connect
    except ImportError as exc:
        raise InputError("engine dask: dask is not installed; pip install distributed") from exc
    for logger in list(logging.root.manager.loggerDict):
        if logger.startswith(("distributed", "tornado")):  # what it logs of a lost connection is said here in a line
            logging.getLogger(logger).setLevel(logging.CRITICAL + 1)
    try:  # a client would wait for the answer of another program without end
        asyncio.run(asyncio.wait_for(connect(address), _CONNECT_S)).abort()
    except Exception as exc:  # whatever answers there
        raise InputError(f"{engine}: no dask scheduler answers there; allowed: {ENGINE_FORMS}") from exc
    with ExitStack() as stack:
        client = stack.enter_context(Client(address, timeout=_CONNECT_S, set_as_default=False))
        try:
            client.run(refuse_other_code, identity())
        except InputError:
            raise
        except Exception as exc:  # of a worker that has no such function
            raise InputError(f"{engine}: {_OTHER_CODE} ({one_line(exc)})") from exc
        if not client.nthreads():
            raise InputError(f"{engine}: the scheduler has no workers; allowed: one with workers")
        stack.pop_all()
    return Cluster(client)


def _load() -> None:
    """What the runs of a sweep compute with, the fast path's engine too, where it is installed."""
    import_module("rotor_mbs.studies.sweep")  # by its name: only the workers import it
    import_module("rotor_mbs.models.lagrange.heyoka_adapter").is_available()


class Cluster(TaskPool):
    """A TaskPool of a dask client's workers. A scheduler that is gone, or has none for patience_s, is a StoreError."""

    shares_disk = False

    def __init__(self, client: Any, patience_s: float = 30.0) -> None:
        self._client, self.workers, self._patience_s = client, sum(client.nthreads().values()), patience_s
        self._executor = client.get_executor(pure=False)  # two equal calls are two runs
        self._waiting: set[Future[Any]] = set()
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
        self._client.close()

    def _refuse_without_scheduler(self) -> None:
        if self._client.status != "running":
            raise StoreError(
                "engine dask: the scheduler was lost; stored runs are kept, repeat the command to continue"
            )

    def _watch(self) -> None:
        """A cluster whose last worker is gone would be waited for without end."""
        without_since = time.monotonic()
        while time.monotonic() - without_since < self._patience_s:
            time.sleep(min(self._patience_s / 2.0, 1.0))
            with suppress(Exception):  # the scheduler is gone, which ends the futures, too; or this client is closed
                if self._client.nthreads():
                    without_since = time.monotonic()
        error = StoreError(f"engine dask: no workers for {self._patience_s:g} s; stored runs are kept")
        for future in list(self._waiting):
            with suppress(Exception):  # one that has just ended
                future.set_exception(error)


def identity() -> dict[str, str]:
    """What must be equal here and in a worker, or its numbers would be others: versions and code."""
    return {**versions(), "code of rotor_mbs": numerics_digest()}


def refuse_other_code(expected: Mapping[str, str]) -> None:
    """In a worker. Raises InputError where it has another version of anything that decides a number."""
    known = identity()
    found = versions_with(*(name for name in expected if name not in known)) | known  # also of a method file's packages
    wrong = [f"{name} {found[name]} (here {here})" for name, here in expected.items() if found[name] != here]
    if wrong:
        raise InputError(f"engine dask: {_OTHER_CODE} (on {socket.gethostname()}: {', '.join(wrong)})")


def run_as_worker(work: Callable[[T], R], task: T, timeout_s: float, expected: Mapping[str, str]) -> R:
    """Ends this worker process where the task takes too long, as dask has no time limits; its nanny starts a new one.
    By a watchdog outside the interpreter: an engine that hangs may hold the interpreter's lock."""
    import faulthandler

    refuse_other_code(expected)  # the worker may have joined later
    with open(os.devnull, "w") as nowhere:  # noqa: PTH123  (a device)
        faulthandler.dump_traceback_later(timeout_s, exit=True, file=nowhere)
        try:
            return work(task)
        finally:
            faulthandler.cancel_dump_traceback_later()
