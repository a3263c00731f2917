"""Run tasks in parallel worker processes, each task with a time limit."""

from __future__ import annotations

import operator
from abc import ABC, abstractmethod
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from concurrent.futures import FIRST_COMPLETED, CancelledError, Future, ThreadPoolExecutor, wait
from contextlib import AbstractContextManager, nullcontext
from dataclasses import dataclass, replace
from queue import LifoQueue
from types import MappingProxyType
from typing import Any, Generic, Self, TypeAlias, TypeVar

from rotor_mbs.errors import (
    SYSTEM_ERRORS,
    InputError,
    ResourceError,
    RotorError,
    one_line,
    shown_value,
    system_errors_apart,
)
from rotor_mbs.processes import MAX_WORKERS, cores
from rotor_mbs.processes.worker import TaskLostError, Worker, delayed_interrupts

T = TypeVar("T")
R = TypeVar("R")

_PER_WORKER = 2  # tasks submitted per worker: one to work on, one waiting
# If so many tasks in a row fail for lack of memory, files or processes, the rest is not run.
_MAX_SYSTEM_FAILURES = 10


@dataclass(frozen=True, slots=True)
class TaskEnd(Generic[T, R]):
    """The result of a task, or the reason why it has none.

    Attributes
    ----------
    task : the task.
    value : result of the task; None if it has none.
    failure : why the task failed: "timed_out", "worker_died" or "error"; "" if it did not.
        `runs.runner` also uses other failures. Its TaskEnd of a failed task can have a `value`: the
        rows that were stored for the task.
    message : cause of the failure in one line; "" if the task has a result.
    error : error that the task raised, or that the system caused for lack of memory, files or
        processes; otherwise None.
    """

    task: T
    value: R | None = None
    failure: str = ""
    message: str = ""
    error: BaseException | None = None


class TaskPool(ABC):
    """A context manager that runs tasks.

    The tasks run in processes of this machine (`WorkerPool`), in this process (`SerialPool`), or in
    a cluster (`cluster.Cluster`).

    Attributes
    ----------
    workers : number of tasks that run at once.
    shares_disk : whether the workers can read and write the files of this process.
    """

    workers: int
    shares_disk = True

    @abstractmethod
    def submit(self, work: Callable[[T], R], task: T, timeout_s: float) -> Future[R]:
        """Return the future of `work(task)`; `timeout_s` is its time limit in s."""

    def failure(self, error: BaseException) -> str:
        """Return why a future failed: "timed_out", "worker_died", or "error" if the task raised."""
        return error.failure if isinstance(error, TaskLostError) else "error"

    def close(self) -> None:  # noqa: B027  (a pool in this process has nothing to end)
        """End the workers."""

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()


Workers: TypeAlias = int | TaskPool  # number of worker processes, or an open pool


class WorkerPool(TaskPool):
    """Worker processes, each of which keeps its state between tasks.

    A process starts when there is a task for it. If there is an initializer, processes start
    together with the pool, at most one for each core. A process that dies, or is ended at a time
    limit, is replaced.

    Parameters
    ----------
    workers : number of processes.
    initializer : function that every process calls first. If it raises an error, the next task of
        the process raises this error.
    core : number of the core to which the processes are bound, if the system allows it; None for
        any.
    environment : values of environment variables that the processes get if they are not set in this
        process.

    Examples
    --------
    >>> with WorkerPool(1) as pool:
    ...     pool.submit(abs, -3, timeout_s=10.0).result()
    3
    """

    def __init__(
        self,
        workers: int,
        initializer: Callable[[], object] | None = None,
        core: int | None = None,
        environment: Mapping[str, str] = MappingProxyType({}),
    ) -> None:
        """Start the first processes if there is an initializer.

        Parameters
        ----------
        workers, initializer, core, environment : see the class.
        """
        self.workers = workers
        self._threads = ThreadPoolExecutor(workers)
        self._workers = [
            Worker(initializer, core=core, environment=environment) for _ in range(workers)
        ]
        # The worker that became free last is used first. If there are few tasks, few processes are
        # then started.
        self._free: LifoQueue[Worker] = LifoQueue()
        for worker in reversed(self._workers):
            self._free.put(worker)
        if initializer is not None:
            for worker in self._workers[: cores()]:
                self._in_thread(worker.start)

    def submit(self, work: Callable[[T], R], task: T, timeout_s: float) -> Future[R]:
        """Return the future of `work(task)`, which has the result or the error of `Worker.run`.

        Function, task and result must be picklable. The time limit counts from the moment at which
        a process begins the task. Raises ResourceError if a thread cannot be started.
        """
        return self._in_thread(self._run, work, task, timeout_s)

    def close(self) -> None:
        """End the processes at once.

        The futures of running tasks then raise TaskLostError. Those of waiting tasks are cancelled.
        """
        with delayed_interrupts():
            for worker in self._workers:
                worker.close()
            self._threads.shutdown(cancel_futures=True)

    def _in_thread(self, function: Callable[..., R], *arguments: Any) -> Future[R]:
        try:
            return self._threads.submit(function, *arguments)
        except RuntimeError as exc:
            raise ResourceError(f"not enough processes or threads: {exc}") from exc

    def _run(self, work: Callable[[T], R], task: T, timeout_s: float) -> R:
        worker = self._free.get()
        try:
            return worker.run(work, task, timeout_s)
        finally:
            self._free.put(worker)


class SerialPool(TaskPool):
    """A pool that runs tasks in this process, one after the other, without time limits.

    It is for scripts that must not start processes.

    >>> SerialPool().submit(abs, -3, timeout_s=10.0).result()
    3
    """

    workers = 1

    def submit(self, work: Callable[[T], R], task: T, timeout_s: float) -> Future[R]:  # noqa: ARG002
        """Call `work(task)` now, without a time limit, and return a future that is done."""
        future: Future[R] = Future()
        try:
            with system_errors_apart():
                future.set_result(work(task))
        except (Exception, SystemExit) as exc:  # a method of another package may raise any
            is_exit = isinstance(exc, SystemExit)
            future.set_exception(RuntimeError(one_line(exc)) if is_exit else exc)
        return future


def check_workers(workers: int) -> None:
    """Raise InputError for a number of worker processes that is out of range.

    Raises TypeError if it is no whole number.
    """
    if not 0 <= operator.index(workers) <= MAX_WORKERS:
        allowed = f"a whole number from 0 to {MAX_WORKERS}"
        raise InputError(f"workers: {shown_value(workers)}; allowed: {allowed}")


def local_pool(
    workers: int,
    initializer: Callable[[], object] | None = None,
    environment: Mapping[str, str] = MappingProxyType({}),
) -> TaskPool:
    """Return a pool of worker processes of this machine.

    Parameters
    ----------
    workers : number of processes. With 0, tasks run in this process, without a time limit.
    initializer, environment : arguments of `WorkerPool`; not used with 0 workers.

    Raises
    ------
    InputError
        If the number of workers is out of range.
    """
    check_workers(workers)
    return WorkerPool(workers, initializer, environment=environment) if workers else SerialPool()


def pool_of(workers: Workers) -> AbstractContextManager[TaskPool]:
    """Return a context manager for a pool, given an open pool or a number of workers.

    A given pool remains open after the block. A number makes a new `local_pool`, which is closed.
    """
    return nullcontext(workers) if isinstance(workers, TaskPool) else local_pool(workers)


def run_in(
    pool: TaskPool,
    work: Callable[[T], R],
    tasks: Iterable[T],
    timeout_s: float | Callable[[T], float],
    split: Callable[[T], Sequence[T]] | None = None,
) -> Iterator[TaskEnd[T, R]]:
    """Call `work(task)` for all tasks in an open pool, and yield the end of each.

    If a task exceeds its time limit, or its worker dies, it is split if possible, and its parts are
    run instead, after the other tasks. After the death of a worker the parts, or the task itself if
    it cannot be split, are run last and one at a time.

    Parameters
    ----------
    pool : the open pool.
    work : function that is called with each task.
    tasks : the tasks; the next one is taken from the iterable when a worker becomes free.
    timeout_s : time limit of a task in s, or a function that returns it for a task.
    split : (task) -> parts of a task that consists of many runs; an empty sequence if the task
        cannot be split.

    Raises
    ------
    ResourceError
        If several tasks in a row fail because memory, files or processes are lacking, or because
        code cannot be loaded.
    """
    # Tasks and parts of tasks that are run again, by failure.
    retries: dict[str, list[T]] = {"timed_out": [], "worker_died": []}
    system_failures = 0  # number in a row

    def ends_of(tasks: Iterable[T], at_once: int) -> Iterator[TaskEnd[T, R]]:
        waiting: dict[Future[R], T] = {}
        for task in tasks:
            limit = timeout_s(task) if callable(timeout_s) else timeout_s
            waiting[pool.submit(work, task, limit)] = task
            if len(waiting) >= at_once:
                yield from next_ends(waiting)
        while waiting:
            yield from next_ends(waiting)

    def next_ends(waiting: dict[Future[R], T]) -> Iterator[TaskEnd[T, R]]:
        nonlocal system_failures
        done = wait(waiting, return_when=FIRST_COMPLETED).done
        # If several tasks have ended, they are yielded in the order in which they were submitted.
        for future in [future for future in waiting if future in done]:
            end = _end_of(waiting.pop(future), future, pool)
            is_system_failure = end.failure == "worker_died" and end.error is not None
            system_failures = system_failures + 1 if is_system_failure else 0
            if system_failures >= _MAX_SYSTEM_FAILURES:
                count = f"{system_failures} failures in a row"
                raise ResourceError(f"stopped after {count}: {end.message}; stored runs are kept")
            yield end

    for source in (tasks, retries["timed_out"]):
        for end in ends_of(source, _PER_WORKER * pool.workers):
            parts: Sequence[T] = ()
            if split is not None and end.failure in retries:
                parts = split(end.task)
            if parts or end.failure == "worker_died":
                retries[end.failure].extend(parts or [end.task])
            else:
                yield end
    # These tasks run one at a time, so that no other task takes the memory that they may need.
    for end in ends_of(retries["worker_died"], 1):
        if end.failure == "worker_died":
            yield replace(end, message=f"{end.message}, also when it was retried alone")
        else:
            yield end


def _end_of(task: T, future: Future[R], pool: TaskPool) -> TaskEnd[T, R]:
    """Return the end of a task whose future is done.

    Parameters
    ----------
    task : the task.
    future : future of the task.
    pool : the pool, whose method `failure` tells why a task failed.

    Returns
    -------
    TaskEnd
        Its `error` is None if the task has a result, or was lost because its worker was ended or
        died.
    """
    error = CancelledError() if future.cancelled() else future.exception()
    if error is None:
        return TaskEnd(task, future.result())
    text = str(error) if isinstance(error, RotorError) else one_line(error)
    if isinstance(error, SYSTEM_ERRORS):
        what = "not enough memory, files or processes"
        if isinstance(error, ImportError):
            what = "code cannot be loaded"
        return TaskEnd(task, None, "worker_died", f"{what}: {text}", error)
    failure = pool.failure(error)
    if failure == "error":
        return TaskEnd(task, None, failure, text, error)
    return TaskEnd(task, None, failure, str(error))
