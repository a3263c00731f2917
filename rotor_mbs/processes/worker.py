"""Call functions in a worker process, which can be ended at any time.

A worker process is a plain Python process with the import path of its parent. Functions, arguments
and results are sent through two pipes as pickles. The process therefore does not need to import the
script that its parent runs.
"""

from __future__ import annotations

import math
import os
import pickle
import signal
import subprocess
import sys
import threading
import time
import weakref
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager, suppress
from functools import cache, partial
from pathlib import Path
from types import MappingProxyType
from typing import TYPE_CHECKING, Any, BinaryIO, Self, TypeVar, cast

from rotor_mbs.errors import ResourceError, RotorError
from rotor_mbs.processes.serving import address_space, send, set_up

if TYPE_CHECKING:
    from concurrent.futures import Future, ThreadPoolExecutor

T = TypeVar("T")
R = TypeVar("R")

SET_UP_LIMIT_S = 300.0  # s; large engines load in seconds, on a busy machine in minutes
# Libraries run one thread each: work is parallel by processes, and timings must not depend on
# threads.
_ONE_THREAD = dict.fromkeys(("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS"), "1")
# Program of the process. The option -P is needed, as Python would otherwise import from the current
# folder.
_PROGRAM = (
    "import sys; sys.path[:] = sys.argv[1:]; from rotor_mbs.processes.serving import serve; serve()"
)
_SIGNALS_OF_END = [
    getattr(signal, name) for name in ("SIGINT", "SIGTERM", "SIGHUP") if hasattr(signal, name)
]
_RETRY_START_S = 1.0  # s, pause after the system could not start a process
_END_S = 1.0  # s, time that a process gets to end after its pipe was closed
# Errors that a pipe raises if its other end is closed.
_PIPE_ERRORS = (EOFError, ConnectionError, pickle.UnpicklingError)


class TaskLostError(RotorError):
    """Raised if the process of a task ends before the task has a result.

    Attributes
    ----------
    failure : "timed_out" if the task exceeded its time limit; "worker_died" if its process died. If
        this process has a memory limit, it is "worker_died" in both cases, as a task that exceeded
        the time limit may have waited for memory.
    exit_code : exit code of the process, negative if a signal ended it; None if the process was
        ended at the time limit.
    """

    def __init__(self, message: str, failure: str, exit_code: int | None = None) -> None:
        super().__init__(message)
        self.failure = failure
        self.exit_code = exit_code


class Worker:
    """A process that calls one function at a time, keeps its state, and is replaced if it dies.

    The process starts when it is first used, ignores Ctrl-C, and ends with its parent. Its
    functions run in the current folder of the parent. If several threads call a worker, they take
    turns. In a process that is forked off the parent, the worker starts a process of its own.

    A worker can be used as a context manager: it is closed after the block.

    Parameters
    ----------
    initializer : function that every process calls first. If it raises an error, the next task
        raises this error.
    core : number of the core to which the process is bound, if the system allows it; None for any.
    memory_limit : bytes of address space, if the system can limit it; None for no limit.
    is_silent : whether output of the process is dropped; otherwise it goes to standard error.
    environment : values of environment variables that the process gets if they are not set in this
        process.
    set_up_limit_s : s, time limit for the start of the process. The imports and the initializer of
        the process together have a second limit of the same length.

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
        environment: Mapping[str, str] = MappingProxyType({}),
        set_up_limit_s: float = SET_UP_LIMIT_S,
    ) -> None:
        """Store how the process is to be started; no process is started yet.

        Parameters
        ----------
        initializer, core, memory_limit, is_silent, environment, set_up_limit_s : see the class.
        """
        self._set_up = partial(set_up, core, memory_limit)
        self._initializer = initializer
        self._default_environment = _ONE_THREAD | dict(environment)
        # Under a memory limit, variables of this process do not change the number of threads: even
        # idle threads take address space.
        self._fixed_environment = _ONE_THREAD if memory_limit is not None else {}
        self._stderr = subprocess.DEVNULL if is_silent else None
        self._set_up_limit_s = set_up_limit_s
        self._turn = threading.Lock()  # held while a function is called
        self._lock = threading.Lock()  # held while the process is started or replaced
        self._process: _Process | None = None
        self._is_closed = False
        _workers.add(self)

    def start(self) -> _Process:
        """Return the process, after starting it if it is not running.

        A new process loads its code while the caller continues.

        Raises
        ------
        ResourceError
            If this worker is closed, or the system cannot start a process. If the system reports an
            error, ResourceError is raised after a pause.
        """
        with self._lock:
            if self._process is not None and self._process.poll() is not None:
                self._process.end()
                self._process = None
            if self._is_closed:
                raise ResourceError("a process could not be started: its pool is closed")
            if self._process is None:
                self._process = self._start_process()
            return self._process

    def run(self, work: Callable[[T], R], task: T, timeout_s: float) -> R:
        """Return `work(task)`, called in the worker process, in the current folder of this process.

        Parameters
        ----------
        work, task : a function and its argument; both must be picklable.
        timeout_s : time limit in s, counted from the start of the task, after the initializer.

        Raises
        ------
        TaskLostError
            If the process died, or was ended at the time limit or by `close`.
        ResourceError
            If no process could be started.
        Exception
            The error that `work` raised. If it cannot be pickled, a RuntimeError with its type and
            the first line of its text. Also an error that is raised in this process while it waits,
            for example by a signal handler.
        """
        folder = ""
        with suppress(OSError):  # the current folder was deleted
            folder = os.getcwd()  # noqa: PTH109  (a text)
        request = pickle.dumps((work, task))
        with self._turn:
            process = None
            try:
                process = self.start()
                if not process.is_set_up:
                    self._wait_until_set_up(process)
                answer = process.exchange(pickle.dumps((folder, request)), timeout_s)
            except BaseException:  # a late answer would be taken for the answer to the next task
                if process is not None:
                    process.end()
                raise
        result: R = _result(answer)
        return result

    def end_process(self) -> None:
        """End the process at once, with its task and its state; the next call starts another."""
        with self._lock:
            if self._process is not None:
                self._process.end()

    def close(self) -> None:
        """End the process at once with its task, and start no process any more.

        Any thread may call this method.
        """
        self._is_closed = True
        self.end_process()

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def _start_process(self) -> _Process:
        """Start a process and send it the request to set itself up.

        Raises
        ------
        ResourceError
            If the system cannot start it, or takes too long.
        """
        # Not at the top: commands that start no process, such as `rotor-mbs list`, do not need it.
        from concurrent.futures import wait

        beginning: Future[_Process] | None = None
        try:
            try:
                # The executor starts its thread, then records it. An interrupt between these steps
                # would leave a thread that the executor never ends, and Python would wait for this
                # thread when it exits.
                with delayed_interrupts():
                    beginning = _starter(os.getpid()).submit(self._begin)
            except RuntimeError as exc:
                raise _not_started(str(exc)) from exc
            # An error of the start is returned by `beginning.exception()`. An error that `wait`
            # raises has another cause, such as an interrupt, and is raised unchanged.
            done, _ = wait([beginning], self._set_up_limit_s)
            if not done:
                raise _not_started(f"the system did not start it in {self._set_up_limit_s:g} s")
            error = beginning.exception()
            if isinstance(error, OSError | RuntimeError):
                time.sleep(_RETRY_START_S)
                raise _not_started(str(error)) from error
            process = beginning.result()
            request = pickle.dumps((self._set_up, self._initializer))
            process.send(pickle.dumps(("", request)))  # "": it stays in its folder
        except BaseException:
            if beginning is not None:  # no caller waits for the process any more
                beginning.add_done_callback(_end_begun)
            raise
        return process

    def _begin(self) -> _Process:
        """Start a process and return it. Raises OSError if the system cannot start it."""
        # The folder of the package is added, as `sys.path` may have it as a relative path.
        folders = [*map(str, sys.path), str(Path(__file__).parents[2])]
        return _Process(
            [sys.executable, "-P", "-c", _PROGRAM, *folders],
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            stderr=self._stderr,
            env=self._default_environment | dict(os.environ) | self._fixed_environment,
        )

    def _wait_until_set_up(self, process: _Process) -> None:
        """Wait until the initializer has returned; raise an error that it has raised.

        Raises ResourceError if the process ends or takes too long.
        """
        try:
            answer = process.exchange(b"", self._set_up_limit_s)
        except TaskLostError as exc:
            reason = f"it ended at once with exit code {exc.exit_code}"
            if exc.exit_code is None:
                reason = f"it was not ready after {self._set_up_limit_s:g} s"
            raise _not_started(reason) from exc
        _result(answer)
        process.is_set_up = True

    def _forget_after_fork(self) -> None:
        """Forget the worker process, in a child that was forked off the parent.

        The worker process remains that of the parent. The child gets new locks, as other threads of
        the parent may have held the old ones.
        """
        self._turn, self._lock = threading.Lock(), threading.Lock()
        if self._process is not None:
            self._process.forget()
            self._process = None


_workers: weakref.WeakSet[Worker] = weakref.WeakSet()


def _forget_processes() -> None:
    """Forget all worker processes, in a child that was forked off the parent."""
    for worker in list(_workers):
        worker._forget_after_fork()


if hasattr(os, "register_at_fork"):
    os.register_at_fork(after_in_child=_forget_processes)


class _Process(subprocess.Popen[bytes]):
    """A process with pipes to its standard input and from its standard output.

    Attributes
    ----------
    is_set_up : whether its initializer is known to have returned.
    """

    stdin: BinaryIO
    stdout: BinaryIO
    is_set_up = False

    def send(self, message: bytes) -> None:
        """Send a message. If the process has died, only the next `exchange` raises an error.

        An error with another cause is raised here, for example one of a signal handler.
        """
        try:
            send(self.stdin, message)
        except Exception as exc:
            if not self._ends(exc):
                raise

    def exchange(self, request: bytes, timeout_s: float) -> bytes:
        """Send a request, and return the next answer.

        Parameters
        ----------
        request : a pickled message; if it is empty, nothing is sent.
        timeout_s : s, time limit of the answer, at which the process is ended.

        Raises
        ------
        TaskLostError
            If the process exceeded the limit or has died.
        ResourceError
            If the system cannot start the thread that watches the time.
        Exception
            An error that is raised in this process while it waits, for example by a signal handler.
        """
        answer = b""
        with self._killed_after(timeout_s) as is_late:
            try:
                if request:
                    send(self.stdin, request)
                answer = pickle.load(self.stdout)
            except Exception as exc:
                # An error of a pipe mostly means that the process has ended. But a signal handler,
                # or a lack of memory here, may raise any error while the process still runs.
                if not is_late.is_set() and not self._ends(exc):
                    raise
        if is_late.is_set():  # even if it answered at the same moment
            # Under a memory limit a process may wait for memory without end. The task then need not
            # be a slow one.
            limit = memory_limit_text()
            failure = "worker_died" if limit else "timed_out"
            raise TaskLostError(f"ended after {timeout_s:g} s{limit}", failure)
        if not answer:
            code = self.end(_END_S)
            raise TaskLostError(f"its process died (exit code {code})", "worker_died", code)
        return answer

    def _ends(self, error: Exception) -> bool:
        """Return whether the process has ended.

        If the error is one of a pipe, the process gets _END_S seconds to end.
        """
        try:
            self.wait(_END_S if isinstance(error, _PIPE_ERRORS) else 0.0)
        except subprocess.TimeoutExpired:
            return False
        return True

    @contextmanager
    def _killed_after(self, limit_s: float) -> Iterator[threading.Event]:
        """Yield an event; if the block takes too long, set the event and kill the process.

        Parameters
        ----------
        limit_s : time limit in s.

        Raises
        ------
        ResourceError
            If the thread that watches the time cannot be started.
        """
        is_late = threading.Event()

        def end_late() -> None:
            is_late.set()
            self.kill()

        timer = threading.Timer(min(limit_s, threading.TIMEOUT_MAX), end_late)
        try:
            timer.start()
        except RuntimeError as exc:
            raise ResourceError(f"not enough threads: {exc}") from exc
        try:
            yield is_late
        finally:
            timer.cancel()
            timer.join()

    def end(self, patience_s: float = 0.0) -> int:
        """End the process and return its exit code.

        The process is killed if it has not ended by itself within `patience_s` seconds.
        """
        try:
            code = self.wait(patience_s)
        except subprocess.TimeoutExpired:
            self.kill()
            code = self.wait()
        for stream in (self.stdin, self.stdout):
            with suppress(OSError):  # data that was not sent cannot be written any more
                stream.close()
        return code

    def forget(self) -> None:
        """Close the pipes without waiting, in a child that was forked off the parent.

        If the parent was sending data during the fork, the child drops its copy of them.
        """
        # The worker process is not a child of this process, which therefore cannot wait for it.
        # With an exit code set, subprocess does not try to.
        self.returncode = 0
        for stream in (self.stdin, self.stdout):
            # Only the raw stream can be closed: a thread that the fork has not copied may hold the
            # lock of the buffer.
            cast(Any, stream).raw.close()


def _end_begun(beginning: Future[_Process]) -> None:
    """End the process of a finished start; nothing is done if no process was started.

    It is called when the caller has stopped waiting for the process, as after an interrupt.
    """
    if not beginning.cancelled() and beginning.exception() is None:
        beginning.result().end()


def _not_started(reason: str) -> ResourceError:
    """Return the error for a process that could not be started.

    The message has the reason and, if this process has a memory limit, the limit.
    """
    return ResourceError(f"a process could not be started: {reason}{memory_limit_text()}")


@cache
def _starter(_process_id: int) -> ThreadPoolExecutor:
    """Return an executor whose only thread starts the worker processes.

    Linux ends a worker process when the thread that started it ends. A caller's thread may end too
    early; the thread of the executor does not. It blocks Ctrl-C, and the processes that it starts
    inherit this, so that Ctrl-C does not end them even in their first moments.

    Parameters
    ----------
    _process_id : number of the process that calls. A process that is forked off it has another
        number, and gets an executor of its own.
    """
    # Not at the top: commands that start no process, such as `rotor-mbs list`, do not need it.
    from concurrent.futures import ThreadPoolExecutor

    return ThreadPoolExecutor(1, initializer=_block_interrupts)


def _block_interrupts() -> None:
    """Block Ctrl-C in this thread, and in the processes that it starts."""
    if hasattr(signal, "pthread_sigmask"):  # not on Windows
        signal.pthread_sigmask(signal.SIG_BLOCK, {signal.SIGINT})


@contextmanager
def delayed_interrupts() -> Iterator[None]:
    """Delay Ctrl-C, SIGTERM and SIGHUP to the end of the block.

    A block that ends several processes is then not interrupted before it has ended all of them. A
    block that starts a thread is not interrupted before it has stored the thread.
    """
    if threading.current_thread() is not threading.main_thread():
        yield
        return
    received: list[int] = []
    before: dict[signal.Signals, Any] = {}
    try:
        for number in _SIGNALS_OF_END:
            # A signal that is ignored, as under nohup, remains so. A process that is started in the
            # block then ignores it, too.
            if signal.getsignal(number) != signal.SIG_IGN:
                before[number] = signal.signal(number, lambda number, _: received.append(number))
        yield
    finally:
        for number, handler in before.items():
            signal.signal(number, signal.SIG_DFL if handler is None else handler)
        if received:
            signal.raise_signal(received[0])


def memory_limit_text() -> str:
    """Return the memory limit of this process in words; "" if there is none."""
    limit = address_space()
    if math.isinf(limit):
        return ""
    return f" under a memory limit (ulimit -v) of {int(limit) >> 20} MiB"


def _result(answer: bytes) -> Any:
    """Return the result that a worker process has sent, or raise the error that it has sent."""
    result, error = pickle.loads(answer)
    if error is not None:
        raise error
    return result
