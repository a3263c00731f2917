"""Tasks in parallel worker processes, each task with a time limit. Knows nothing of scenes, models or files.

Every worker is a pebble pool of one process: processes of one pebble pool share a pipe and its locks, so that a process
killed while it waits, or while it writes a result, would stop the others (pebble 5.2).
"""

from __future__ import annotations

import gc
import multiprocessing
import operator
import os
import pickle
import signal
import sys
import threading
import time
from abc import ABC, abstractmethod
from collections.abc import Callable, Iterable, Iterator, Sequence
from concurrent.futures import FIRST_COMPLETED, CancelledError, Future, ThreadPoolExecutor, wait
from contextlib import AbstractContextManager, contextmanager, nullcontext, suppress
from dataclasses import dataclass, replace
from multiprocessing import process as process_module
from multiprocessing import resource_tracker
from pathlib import Path
from queue import LifoQueue
from typing import TYPE_CHECKING, Any, Generic, Self, TypeAlias, TypeVar

from rotor_mbs.errors import (
    SYSTEM_ERRORS,
    InputError,
    ResourceError,
    RotorError,
    one_line,
    shown_value,
    system_errors_apart,
)
from rotor_mbs.runs import MAX_WORKERS, cores

if TYPE_CHECKING:  # loaded with the first process
    from pebble import ProcessPool

T = TypeVar("T")
R = TypeVar("R")

# One thread per process: the processes are the parallelism, and timings must not depend on a library's threads.
ONE_THREAD = ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS")

_ENDING = [getattr(signal, name) for name in ("SIGINT", "SIGTERM", "SIGHUP") if hasattr(signal, name)]
_PER_WORKER = 2  # tasks submitted per worker: one to work on, one waiting
_RETRY_START_S = 1.0  # after the system had no room for a process
_MAX_LACKS = 10  # in a row, before all is given up
_POLL_S = 1.0  # how often a waiting thread looks whether its pool still works


class TaskLostError(RotorError):
    """A task left no result. failure: "timed_out" where it was over its limit, "worker_died" where its process died.
    at_start: before it began with the task."""

    def __init__(self, message: str, failure: str, *, at_start: bool = False) -> None:
        super().__init__(message)
        self.failure, self.at_start = failure, at_start


@dataclass(frozen=True, slots=True)
class Finished(Generic[T, R]):
    """The end of a task: `value`, or `failure` ("timed_out", "worker_died", "error") with a line, what it raised."""

    task: T
    value: R | None = None
    failure: str = ""
    message: str = ""
    error: BaseException | None = None


class TaskPool(ABC):
    """What runs tasks: worker processes of this machine (`WorkerPool`), or a cluster. A context manager.

    workers       how many tasks run at once
    shares_disk   whether the workers see the files of this process
    """

    workers: int
    shares_disk = True

    @abstractmethod
    def submit(self, work: Callable[[T], R], task: T, timeout_s: float) -> Future[R]:
        """The future of `work(task)`."""

    def failure(self, error: BaseException) -> str:
        """Why a future failed: "timed_out", "worker_died", or "error" for what the task itself raised."""
        return error.failure if isinstance(error, TaskLostError) else "error"

    def close(self) -> None:  # noqa: B027  (of this process there is nothing to end)
        """Ends what runs the tasks."""

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()


Workers: TypeAlias = int | TaskPool  # how many processes, or a pool that is open


class WorkerPool(TaskPool):
    """Worker processes, each of which keeps its state between tasks.

    Each starts afresh (spawn) when there is a task for it, and as many as there are cores at once where there is an
    initializer, which is called first in every process; what it raises becomes the error of that process's tasks. They
    ignore Ctrl-C and end with this process. One that dies, or is ended at a time limit, is replaced. They are bound to
    `core`, where the system allows it.

    >>> with WorkerPool(1) as pool:
    ...     pool.submit(abs, -3, timeout_s=10.0).result()
    3
    """

    def __init__(self, workers: int, initializer: Callable[[], object] | None = None, core: int | None = None) -> None:
        self.workers = workers
        self._threads = ThreadPoolExecutor(workers)
        self._processes = [_Process(initializer, core) for _ in range(workers)]
        # The last one that became free is taken first: with few tasks, few processes are started.
        self._free: LifoQueue[_Process] = LifoQueue()
        for process in reversed(self._processes):
            self._free.put(process)
        for process in self._processes[: cores()] if initializer is not None else ():
            self._in_thread(process.start)

    def submit(self, work: Callable[[T], R], task: T, timeout_s: float) -> Future[R]:
        """The future of `work(task)`: its result, what it raised, or a TaskLostError. Raises ResourceError. What goes
        in and out must be picklable; the time limit counts from when a process begins with the task."""
        return self._in_thread(self._run, work, task, timeout_s)

    def close(self) -> None:
        """Ends the processes at once, with what they do. Futures that were running raise TaskLostError."""
        with delayed_interrupts():
            for process in self._processes:
                process.cancel()
            self._threads.shutdown(cancel_futures=True)
            with suppress(RuntimeError), ThreadPoolExecutor(self.workers) as closing:
                list(closing.map(_Process.close, self._processes))
            for process in self._processes:  # those for which there was no room for a thread
                process.close()

    def _in_thread(self, function: Callable[..., R], *arguments: Any) -> Future[R]:
        try:
            return self._threads.submit(function, *arguments)
        except RuntimeError as exc:
            raise ResourceError(f"not enough processes or threads: {exc}") from exc

    def _run(self, work: Callable[[T], R], task: T, timeout_s: float) -> R:
        process = self._free.get()
        try:
            answer = process.run(pickle.dumps((work, task)), timeout_s)
        except TaskLostError as exc:
            raise exc.with_traceback(None) from None  # its frames would keep the dead process's pipes open
        finally:
            self._free.put(process)
        result, error = pickle.loads(answer)
        if error is not None:
            raise error
        found: R = result
        return found


class SerialPool(TaskPool):
    """A pool in this process, one task after the other, without time limits: where scripts must not start processes.

    >>> SerialPool().submit(abs, -3, timeout_s=10.0).result()
    3
    """

    workers = 1

    def submit(self, work: Callable[[T], R], task: T, timeout_s: float) -> Future[R]:  # noqa: ARG002
        future: Future[R] = Future()
        try:
            with system_errors_apart():
                future.set_result(work(task))
        except (Exception, SystemExit) as exc:  # also of another package's method
            future.set_exception(RuntimeError(one_line(exc)) if isinstance(exc, SystemExit) else exc)
        return future


def check_workers(workers: int) -> None:
    """Raise InputError for a wrong number of worker processes, TypeError for what is no whole number."""
    if not 0 <= operator.index(workers) <= MAX_WORKERS:
        allowed = f"a whole number from 0 to {MAX_WORKERS}"
        raise InputError(f"workers: {shown_value(workers)}; allowed: {allowed}")


def local_pool(workers: int, initializer: Callable[[], object] | None = None) -> TaskPool:
    """So many worker processes of this machine; 0: none, tasks run in this process, without a time limit.

    Raises InputError for another number, and where this process may not start processes.
    """
    check_workers(workers)
    if workers and getattr(multiprocessing.current_process(), "_inheriting", False):
        raise InputError(
            'workers: a worker process runs the script itself; allowed: the call under `if __name__ == "__main__":`, '
            "or workers=0"
        )
    if workers and multiprocessing.current_process().daemon:
        raise InputError("workers: a daemonic process cannot start processes; allowed: workers=0")
    return WorkerPool(workers, initializer) if workers else SerialPool()


def pool_of(workers: Workers) -> AbstractContextManager[TaskPool]:
    """A `local_pool` that ends with the block, or one that is given, which does not."""
    return nullcontext(workers) if isinstance(workers, TaskPool) else local_pool(workers)


def run_in(
    pool: TaskPool,
    work: Callable[[T], R],
    tasks: Iterable[T],
    timeout_s: float | Callable[[T], float],
    split: Callable[[T], Sequence[T]] | None = None,
) -> Iterator[Finished[T, R]]:
    """`work(task)` for all tasks in a pool that is open; `tasks` are taken as workers become free.

    timeout_s   time limit of a task in s, or a function of the task
    split       the parts of a task that stands for many runs; an empty sequence for one that cannot be split

    A task whose worker died is tried once more at the end, alone. One that can be split is split first, also where it
    was over its time limit. Raises ResourceError where several tasks in a row find no room on the machine, or no
    process that starts.
    """
    again: dict[str, list[T]] = {"timed_out": [], "worker_died": []}

    def completed(tasks: Iterable[T], at_once: int) -> Iterator[Finished[T, R]]:
        waiting: dict[Future[R], T] = {}
        for task in tasks:
            waiting[pool.submit(work, task, timeout_s(task) if callable(timeout_s) else timeout_s)] = task
            if len(waiting) >= at_once:
                yield from ended(waiting)
        while waiting:
            yield from ended(waiting)

    lacks = 0

    def ended(waiting: dict[Future[R], T]) -> Iterator[Finished[T, R]]:
        nonlocal lacks
        done = wait(waiting, return_when=FIRST_COMPLETED).done
        for future in [future for future in waiting if future in done]:  # of several in the order of their tasks
            task, error = waiting.pop(future), CancelledError() if future.cancelled() else future.exception()
            if error is None:
                end = Finished(task, future.result())
            elif isinstance(error, SYSTEM_ERRORS):
                what = "not enough memory, files or processes"
                if isinstance(error, ImportError):
                    what = "code cannot be loaded"
                end = Finished(task, None, "worker_died", f"{what}: {one_line(error)}", error)
            elif (failure := pool.failure(error)) == "error":
                end = Finished(task, None, failure, one_line(error), error)
            else:
                end = Finished(task, None, failure, str(error), error if getattr(error, "at_start", False) else None)
            is_lack = end.failure == "worker_died" and end.error is not None
            lacks = lacks + 1 if is_lack else 0
            if lacks >= _MAX_LACKS:
                raise ResourceError(f"stopped after {lacks} failures in a row: {end.message}; stored runs are kept")
            yield end

    for source in (tasks, again["timed_out"]):
        for end in completed(source, _PER_WORKER * pool.workers):
            parts = split(end.task) if split is not None and end.failure in again else ()
            if parts or end.failure == "worker_died":
                again[end.failure].extend(parts or [end.task])
            else:
                yield end
    for end in completed(again["worker_died"], 1):
        if end.failure == "worker_died":
            yield replace(end, message=f"{end.message}, also when it was retried alone")
        else:
            yield end


@contextmanager
def delayed_interrupts() -> Iterator[None]:
    """Delays Ctrl-C, SIGTERM and SIGHUP to the end of the block: other processes are ended all or not at all."""
    if threading.current_thread() is not threading.main_thread():
        yield
        return
    received: list[int] = []
    before: dict[signal.Signals, Any] = {}
    try:
        for number in _ENDING:
            before[number] = signal.signal(number, lambda number, _: received.append(number))
        yield
    finally:
        for number, handler in before.items():
            signal.signal(number, signal.SIG_DFL if handler is None else handler)
        if received:
            signal.raise_signal(received[0])


class _Process:
    """One worker process; started again where it has died. Used by one thread at a time, but for `cancel`."""

    def __init__(self, *initial: object) -> None:
        self._initial = initial
        self._lock = threading.RLock()
        self._pool: ProcessPool | None = None
        self._future: Future[bytes] | None = None
        self._is_cancelled = False

    def start(self) -> None:
        """Starts the process, which loads its code by itself; where that fails, the first task tries again."""
        with self._lock, suppress(OSError, RuntimeError):
            if not self._is_cancelled:
                self._started()

    def run(self, request: bytes, timeout_s: float) -> bytes:
        """The answer of the process. Raises TaskLostError."""
        try:
            with self._lock:
                if self._is_cancelled:
                    raise CancelledError
                pool = self._started()
                future = self._future = pool.schedule(_answer, [request], timeout=timeout_s)
            return _result(future, pool)
        except TimeoutError:
            raise _ended_at(timeout_s) from None
        except Exception as exc:  # none is the task's own: those come back as answers
            self.close()
            code = getattr(exc, "exitcode", None)
            reason = _reason_of_death(exc, code)
            at_start = code is None and not isinstance(exc, CancelledError)
            raise TaskLostError(f"its process died ({reason})", "worker_died", at_start=at_start) from None

    def cancel(self) -> None:
        """Ends what the process does; from any thread."""
        with self._lock:
            self._is_cancelled = True
            if self._future is not None:
                self._future.cancel()

    def close(self) -> None:
        with self._lock:
            if self._pool is not None:
                self._pool.stop()
                self._pool.join()
            self._pool = self._future = None

    def _started(self) -> ProcessPool:
        """The pool with the process, a new one where the old one is broken. Raises OSError, RuntimeError."""
        from pebble import ProcessPool

        if self._pool is not None and not self._pool.active:
            self.close()
        if self._pool is None:
            for name in ONE_THREAD:
                os.environ.setdefault(name, "1")
            context = multiprocessing.get_context("spawn")
            self._pool = ProcessPool(1, initializer=_initialize, initargs=self._initial, context=context)
            try:
                with _blocked_interrupts():
                    _ = self._pool.active  # starts the process
            except (OSError, RuntimeError):
                self.close()  # half of its threads would wait without end
                time.sleep(_RETRY_START_S)  # the system had no room; there may be some then
                raise
        return self._pool


def _reason_of_death(error: Exception, exit_code: int | None) -> str:
    """Return why a worker process died, in one line.

    Parameters
    ----------
    error : what its pool raised.
    exit_code : of the process; None if it died before its task began, or was ended by this process.
    """
    if exit_code is not None:
        return f"exit code {exit_code}"
    text = " ".join(str(error).split())[:200] or "ended by this process"
    if not isinstance(error, RuntimeError):
        return text
    # A process goes to the folder in which this one began, and runs its script before it takes a task.
    try:
        folder = Path(getattr(process_module, "ORIGINAL_DIR", None) or Path.cwd())
    except OSError:
        return "the working folder is gone"
    if not folder.is_dir():
        return f"the folder in which the program was started is gone: {folder}"
    main = sys.modules["__main__"]
    script = getattr(main, "__file__", None)
    if getattr(main, "__spec__", None) is None and script is not None:
        try:
            source = (folder / script).read_text(encoding="utf-8", errors="replace")
        except OSError:
            return f"{text}; the script {script} is no file that it can read; allowed: a script in a file, or workers=0"
        if "__main__" not in source:
            return f'{text}; in a script, the call belongs under `if __name__ == "__main__":`'
    if limit := _memory_limit():
        return f"{text}; {limit}"
    return text


def _memory_limit() -> str:
    """Return the limit of this process's memory in words, "" if there is none."""
    with suppress(ImportError):  # Windows
        import resource

        limit, _ = resource.getrlimit(resource.RLIMIT_AS)
        if limit != resource.RLIM_INFINITY:
            return f"under a memory limit (ulimit -v) of {limit >> 20} MiB"
    return ""


def _ended_at(timeout_s: float) -> TaskLostError:
    """Under a limit of its memory a library may wait for memory without end: that says nothing of the task."""
    limit = _memory_limit()
    if limit:
        return TaskLostError(f"ended after {timeout_s:g} s {limit}", "worker_died")
    return TaskLostError(f"ended after {timeout_s:g} s", "timed_out")


def _result(future: Future[bytes], pool: ProcessPool) -> bytes:
    """What the process answers. Raises what it failed with, RuntimeError where the pool broke."""
    while not future.done():
        with suppress(TimeoutError):  # of this call: the process is still working
            future.exception(_POLL_S)
        if not pool.active and not future.done():
            raise RuntimeError("killed before its task began")
    return future.result()


@contextmanager
def _blocked_interrupts() -> Iterator[None]:
    """Processes and threads started in the block do not receive Ctrl-C, not even while they load Python."""
    if not hasattr(signal, "pthread_sigmask"):  # Windows
        yield
        return
    resource_tracker.ensure_running()  # started in the block, it would unblock the signal
    before = signal.pthread_sigmask(signal.SIG_BLOCK, {signal.SIGINT})
    try:
        yield
    finally:
        signal.pthread_sigmask(signal.SIG_SETMASK, before)


# What the worker process does

_initial_error: Exception | None = None


def _initialize(initializer: Callable[[], object] | None, core: int | None) -> None:
    global _initial_error
    if threading.current_thread() is threading.main_thread():
        signal.signal(signal.SIGTERM, signal.SIG_DFL)  # pebble's handler would wait for the engine to return
    try:
        threading.Thread(target=_end_with_parent, daemon=True).start()
    except RuntimeError:  # the system has no room for it; pebble tries another process
        os._exit(1)
    gc.set_threshold(50_000, 20, 20)  # loading engines and drawing leave few cycles, and collecting took a twentieth
    if core is not None and hasattr(os, "sched_setaffinity"):
        os.sched_setaffinity(0, {core})
    try:
        if initializer is not None:
            initializer()
    except Exception as exc:
        _initial_error = exc


def _end_with_parent() -> None:
    """On Linux the kernel itself ends this process with its parent, whose end of the pipe is closed then: an engine may
    keep the interpreter's lock for long, so that no thread of Python would notice. Elsewhere this thread does."""
    parent = multiprocessing.parent_process()
    if parent is not None:
        with suppress(ImportError, AttributeError, OSError):
            import fcntl

            fcntl.fcntl(parent.sentinel, fcntl.F_SETOWN, os.getpid())
            fcntl.fcntl(parent.sentinel, fcntl.F_SETFL, fcntl.fcntl(parent.sentinel, fcntl.F_GETFL) | os.O_ASYNC)
        parent.join()
    os._exit(1)


def _answer(request: bytes) -> bytes:
    """Pickled (result, error) of a pickled (function, task): what cannot be pickled is an error of the task."""
    try:
        if _initial_error is not None:
            raise _initial_error
        with system_errors_apart():
            work, task = pickle.loads(request)
            result = work(task)
        return pickle.dumps((result, None))
    except Exception as exc:
        try:
            answer = pickle.dumps((None, exc))
            pickle.loads(answer)  # not every error arrives as it is sent
        except Exception:
            return pickle.dumps((None, RuntimeError(one_line(exc))))
        return answer
    except BaseException as exc:  # SystemExit and the like must not end the parent
        return pickle.dumps((None, RuntimeError(one_line(exc))))
