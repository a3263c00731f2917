"""Where a sweep's work is done: on this machine, or on a dask cluster. One small interface on executors.

Knows nothing of scenes, models or files: a task is a picklable function with its argument.
"""

from __future__ import annotations

import importlib
import multiprocessing
import os
import re
import threading
from collections.abc import Callable
from concurrent.futures import Executor, Future
from dataclasses import dataclass
from typing import Any, TypeVar

from rotor_mbs.errors import InputError
from rotor_mbs.runner.pool import ONE_THREAD

T = TypeVar("T")
R = TypeVar("R")

_PREPARE_S = 60.0
_LOOK_EVERY_S = 0.01  # for a worker that died, a task that is late, the end

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
    shares_disk   whether the workers see this process's files
    """

    executor: Executor
    workers: int
    cause: Callable[[BaseException], str]
    stop: Callable[[], None]
    shares_disk: bool = False

    def submit(self, work: Callable[[T], R], task: T, timeout_s: float) -> Future[R]:
        return self.executor.submit(work, task, timeout_s)  # type: ignore[call-arg]

    def prepare(self, target: str) -> None:
        """Lets the workers call the function "module:name" in advance, to load their code; returns at once."""
        for _ in range(self.workers):
            self.submit(_call, target, _PREPARE_S)


def _call(target: str) -> None:
    module, _, name = target.partition(":")
    getattr(importlib.import_module(module), name)()


def open_engine(name: str, workers: int) -> Engine:
    """The engine called `name`. Raises InputError where there is none, or it does not answer."""
    if name == "local":
        return _local(workers)
    if re.fullmatch(r"dask:tcp://[^\s/:]+:[0-9]{1,5}", name):
        from rotor_mbs.runner.dask_engine import open_cluster  # an extra, and slow to load

        return open_cluster(name.removeprefix("dask:"))
    raise InputError(f"--engine {name}: no such engine; allowed: {ENGINE_FORMS}")


class _LocalExecutor(Executor):
    """Processes of this machine, started afresh (spawn); one that dies or hangs takes no other with it."""

    def __init__(self, workers: int) -> None:
        from pebble import CONSTS, ProcessPool

        CONSTS.sleep_unit = _LOOK_EVERY_S
        for name, value in {**dict.fromkeys(ONE_THREAD, "1"), **_KEEP_MEMORY}.items():
            os.environ.setdefault(name, value)
        context = multiprocessing.get_context("spawn")
        self._pool = ProcessPool(max_workers=workers, context=context, initializer=_end_with_parent)

    def submit(self, work: Callable[..., Any], /, *args: Any, **_: Any) -> Future[Any]:
        task, timeout_s = args
        future: Future[Any] = self._pool.schedule(work, args=(task,), timeout=timeout_s)
        return future

    def shutdown(self, wait: bool = True, *, cancel_futures: bool = False) -> None:
        if cancel_futures:
            self._pool.stop()  # type: ignore[no-untyped-call]
        else:
            self._pool.close()  # type: ignore[no-untyped-call]
        if wait:
            self._pool.join()


def _end_with_parent() -> None:
    """A killed parent closes nothing: its workers watch it, so that none is left behind."""
    parent = multiprocessing.parent_process()

    def watch() -> None:
        if parent is not None:
            parent.join()
        os._exit(1)

    threading.Thread(target=watch, daemon=True).start()


def _local(workers: int) -> Engine:
    from pebble import ProcessExpired

    executor = _LocalExecutor(workers)

    def cause(error: BaseException) -> str:
        if isinstance(error, TimeoutError):
            return "timed_out"
        return "worker_died" if isinstance(error, ProcessExpired) else "error"

    return Engine(executor, workers, cause, lambda: executor.shutdown(cancel_futures=True), shares_disk=True)
