"""A worker process: it calls functions for its parent, and can be ended at any time.

It is a plain Python process with the import path of its parent. Functions, arguments and results
pass through two pipes as pickles, so that it does not need the script that its parent runs.
"""

from __future__ import annotations

import os
import pickle
import signal
import subprocess
import sys
import threading
import time
from collections.abc import Callable
from contextlib import suppress
from functools import cache, partial
from pathlib import Path
from typing import TYPE_CHECKING, Any, BinaryIO, Self, TypeVar

from rotor_mbs.errors import ResourceError, RotorError
from rotor_mbs.processes.serving import send, set_up

if TYPE_CHECKING:
    from concurrent.futures import ThreadPoolExecutor

T = TypeVar("T")
R = TypeVar("R")

# The processes are the parallelism, and timings must not depend on a library's threads.
_ONE_THREAD = dict.fromkeys(("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS"), "1")
# Without -P, Python would import from the current folder.
_PROGRAM = "import sys; sys.path[:] = sys.argv[1:]; from rotor_mbs.processes.serving import serve; serve()"
_RETRY_START_S = 1.0  # after the system had no room for a process
_END_S = 1.0  # until a process whose pipe is closed has ended


class TaskLostError(RotorError):
    """Raised if a task leaves no result.

    Attributes
    ----------
    failure : "timed_out" if it exceeded its time limit, "worker_died" if its process died.
    exit_code : of its process; negative for the number of a signal.
    """

    def __init__(self, message: str, failure: str, exit_code: int | None = None) -> None:
        super().__init__(message)
        self.failure = failure
        self.exit_code = exit_code


class Worker:
    """A process that calls one function at a time, keeps its state, and is replaced if it dies.

    It starts when it is first used, ignores Ctrl-C, and ends with its parent. A context manager.

    Parameters
    ----------
    initializer : called first in every process; what it raises is the error of the next task.
    core : to which the process is bound, where the system allows it; None for any.
    memory_limit : bytes of address space, where the system can limit it; None for no limit.
    is_silent : whether what the process prints is dropped; otherwise it goes to standard error.

    Examples
    --------
    >>> with Worker() as worker:
    ...     worker.run(abs, -3, timeout_s=10.0)
    3
    """

    def __init__(
        self,
        initializer: Callable[[], object] | None = None,
        *,
        core: int | None = None,
        memory_limit: int | None = None,
        is_silent: bool = False,
    ) -> None:
        self._set_up = partial(set_up, core, memory_limit)
        self._initializer = initializer
        # Idle threads, too, take address space.
        self._environment = _ONE_THREAD if memory_limit is not None else {}
        self._stderr = subprocess.DEVNULL if is_silent else None
        self._lock = threading.Lock()  # held while the process is started or replaced
        self._process: _Process | None = None
        self._is_set_up = False
        self._is_closed = False

    def start(self) -> _Process:
        """Start the process unless it works; it loads its code while the caller goes on.

        Raises
        ------
        ResourceError
            If the system has no room for it, after a moment in which there may be some again.
        """
        with self._lock:
            if self._process is not None and self._process.poll() is not None:
                self._process.end()
                self._process = None
            if self._is_closed:
                raise ResourceError("a process could not be started: its pool is closed")
            if self._process is None:
                self._is_set_up = False
                try:
                    self._process = _starter(os.getpid()).submit(self._begin).result()
                except (OSError, RuntimeError) as exc:
                    time.sleep(_RETRY_START_S)
                    raise ResourceError(f"a process could not be started: {exc}{_memory_limit()}") from exc
                with suppress(OSError):  # it has died, which its first use finds
                    send(self._process.stdin, pickle.dumps((self._set_up, self._initializer)))
            return self._process

    def run(self, work: Callable[[T], R], task: T, timeout_s: float) -> R:
        """Call `work(task)` in the process, for one thread at a time.

        The time limit counts from when the process, with its initializer done, begins.

        Raises
        ------
        TaskLostError
            If the process died, or was ended, at the time limit or by `close`.
        ResourceError
            If no process could be started.
        Exception
            What `work` raised. If that cannot be pickled, a RuntimeError with its first line.
        """
        request = pickle.dumps((work, task))
        process = None
        try:
            process = self.start()
            if not self._is_set_up:
                self._wait_until_set_up(process)
            answer = process.exchange(request, timeout_s)
        except BaseException:  # also an interrupt: a later answer would be taken for the next one
            if process is not None:
                process.end()
            raise
        result: R = _result(answer)
        return result

    def close(self) -> None:
        """End the process at once, with what it does, and start no other; from any thread."""
        self._is_closed = True
        with self._lock:
            if self._process is not None:
                self._process.end()

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def _begin(self) -> _Process:
        """Start a process. Raises OSError."""
        # Its own folder last: Python may have found this package by a path that is relative.
        folders = [*map(str, sys.path), str(Path(__file__).parents[2])]
        return _Process(
            [sys.executable, "-P", "-c", _PROGRAM, *folders],
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            stderr=self._stderr,
            env=_ONE_THREAD | dict(os.environ) | self._environment,
        )

    def _wait_until_set_up(self, process: _Process) -> None:
        """Wait for the initializer. Raises ResourceError if the process ends, and what it raises."""
        try:
            answer = pickle.load(process.stdout)
        except Exception as exc:
            reason = f"it ended at once with exit code {process.end(_END_S)}{_memory_limit()}"
            raise ResourceError(f"a process could not be started: {reason}") from exc
        _result(answer)
        self._is_set_up = True


class _Process(subprocess.Popen[bytes]):
    """A process with pipes to its standard input and from its standard output."""

    stdin: BinaryIO
    stdout: BinaryIO

    def exchange(self, request: bytes, timeout_s: float) -> bytes:
        """Send a request and return its answer. Raises TaskLostError, ResourceError."""
        is_late = threading.Event()

        def end_late() -> None:
            is_late.set()
            self.kill()

        timer = threading.Timer(min(timeout_s, threading.TIMEOUT_MAX), end_late)
        try:
            timer.start()
        except RuntimeError as exc:
            raise ResourceError(f"not enough threads: {exc}") from exc
        try:
            send(self.stdin, request)
            answer: bytes = pickle.load(self.stdout)
        except Exception:  # none is the task's own: those come back as answers
            answer = b""
        finally:
            timer.cancel()
            timer.join()
        if is_late.is_set():  # also in the moment of its answer
            # What lacks memory may wait for it without end: that says nothing of the task.
            limit = _memory_limit()
            failure = "worker_died" if limit else "timed_out"
            raise TaskLostError(f"ended after {timeout_s:g} s{limit}", failure)
        if not answer:
            code = self.end(_END_S)
            raise TaskLostError(f"its process died (exit code {code})", "worker_died", code)
        return answer

    def end(self, patience_s: float = 0.0) -> int:
        """End the process, where it has not ended by itself within `patience_s`; return its exit code."""
        try:
            code = self.wait(patience_s)
        except subprocess.TimeoutExpired:
            self.kill()
            code = self.wait()
        for stream in (self.stdin, self.stdout):
            with suppress(OSError):  # what was not sent
                stream.close()
        return code


@cache
def _starter(_process_id: int) -> ThreadPoolExecutor:
    """Return the thread of a parent process that starts its workers.

    Linux ends a worker when the thread that started it ends, which must be no thread of a caller;
    and processes started by a thread that does not receive Ctrl-C do not, from their first moment.
    """
    from concurrent.futures import ThreadPoolExecutor  # late: `rotor-mbs list` starts no process

    return ThreadPoolExecutor(1, initializer=_block_interrupts)


def _block_interrupts() -> None:
    """Keep Ctrl-C from this thread and from the processes that it starts."""
    if hasattr(signal, "pthread_sigmask"):  # not on Windows
        signal.pthread_sigmask(signal.SIG_BLOCK, {signal.SIGINT})


def _memory_limit() -> str:
    """Return the limit of this process's memory in words, "" if there is none."""
    with suppress(ImportError):  # Windows
        import resource

        limit, _ = resource.getrlimit(resource.RLIMIT_AS)
        if limit != resource.RLIM_INFINITY:
            return f" under a memory limit (ulimit -v) of {limit >> 20} MiB"
    return ""


def _result(answer: bytes) -> Any:
    """Return the result of an answer, or raise its error."""
    result, error = pickle.loads(answer)
    if error is not None:
        raise error
    return result
