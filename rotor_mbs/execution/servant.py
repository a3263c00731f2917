"""A process of its own that answers requests, each within a time limit.

Knows nothing of scenes, models or files: it is given a picklable function that makes the answering object.
"""

from __future__ import annotations

import gc
import multiprocessing
import os
import signal
import threading
import time
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager, suppress
from dataclasses import dataclass
from multiprocessing import resource_tracker
from multiprocessing.connection import Connection
from types import TracebackType
from typing import Any, Self

from rotor_mbs.execution.collector import collect_seldom

Answer = Callable[[Any], Any]

# One thread per process: the processes are the parallelism, and timings must not depend on a library's threads.
ONE_THREAD = ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS")

_START_S = 120.0  # for a process to load its code
_LONGEST_S = 2e6  # that a system can be told to wait: its milliseconds have 32 bits
_AGAIN_S = 1.0  # for the system to find room for a process
_DEATH_S = 1.0  # for one whose line is broken to end by itself, so that it tells its exit code


class NoAnswerError(Exception):
    """The process hung (`timed_out`) or died, and was ended; the next request starts another one."""

    def __init__(self, message: str, timed_out: bool) -> None:
        super().__init__(message)
        self.timed_out = timed_out


@dataclass
class _Line:
    """To one hand of a process; is_ready: whether it has told that its code is loaded."""

    end: Connection
    is_ready: bool = False


class Servant:
    """`make()` is called in the new process, on one core if the system allows; what it returns answers requests.

    The process is started afresh (spawn), watches its parent and ends with it, and leaves Ctrl-C to it.

    hands   how many requests it answers at once: the first in its main thread, the others in threads beside it
    """

    def __init__(self, make: Callable[[], Answer], core: int | None = None, hands: int = 1) -> None:
        self._make, self._core, self._hands = make, core, hands
        self._context = multiprocessing.get_context("spawn")
        self._process: Any = None
        self._lines: list[_Line] = []
        self._is_closed = False
        self._lock = threading.Lock()

    def start(self) -> None:
        """Starts the process, where there is none, and returns at once: it loads its code by itself. Where the system
        has no room for it, the first request tries again."""
        with self._lock, suppress(OSError):
            if self._process is None and not self._is_closed:
                self._start()

    def ask(self, request: object, limit_s: float, hand: int = 0) -> Any:
        """The answer. Raises NoAnswerError where none comes within `limit_s` of a process that is ready, RuntimeError
        with the servant's error. No hand may be asked by two threads at once."""
        process, line = self._begun(hand)
        if not line.is_ready:
            try:
                self._received(process, line.end, _START_S)
            except NoAnswerError as exc:  # the request was not begun: it is not late
                exc.timed_out = False
                raise
            line.is_ready = True
        failure, value = self._received(process, line.end, limit_s, request)
        if failure:
            raise RuntimeError(failure)
        return value

    def kill(self) -> None:
        """Ends the process for good, without waiting for its end; from any thread. Whoever waits for an answer has a
        NoAnswerError."""
        with self._lock:
            self._is_closed = True
            if self._process is not None:
                self._process.kill()

    def close(self) -> None:
        """The same, and waits for it."""
        self.kill()
        with self._lock:
            self._end()

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.close()

    def _begun(self, hand: int) -> tuple[Any, _Line]:
        try:
            with self._lock:
                if self._is_closed:
                    raise NoAnswerError("its process was ended", timed_out=False)
                if self._process is None:
                    self._start()
                return self._process, self._lines[hand]
        except OSError as exc:
            time.sleep(_AGAIN_S)  # there may be room then; and who asks again and again is not told so at once
            raise NoAnswerError(f"its process could not be started ({exc.strerror})", timed_out=False) from None

    def _start(self) -> None:
        for name in ONE_THREAD:
            os.environ.setdefault(name, "1")
        pipes = [self._context.Pipe() for _ in range(self._hands)]
        far_ends = [far_end for _, far_end in pipes]
        process: Any = self._context.Process(target=_serve, args=(far_ends, self._make, self._core), daemon=True)
        with _deaf_to_ctrl_c():
            process.start()
        self._process, self._lines = process, [_Line(end) for end, _ in pipes]
        for far_end in far_ends:
            far_end.close()

    def _received(self, process: Any, line: Connection, limit_s: float, *requests: object) -> Any:
        is_broken = False
        try:
            for request in requests:
                line.send(request)
            if line.poll(min(limit_s, _LONGEST_S)):
                return line.recv()
        except (EOFError, OSError):  # it died before the request, or amid its answer
            is_broken = True
        line.close()
        if is_broken:
            process.join(_DEATH_S)
        code = self._replaced(process)
        if is_broken:
            raise NoAnswerError(f"its process died (exit code {code})", timed_out=False)
        raise NoAnswerError(f"ended after {limit_s:g} s", timed_out=True)

    def _replaced(self, process: Any) -> int | None:
        """Ends this process, where another hand has not done so, and makes room for the next: its exit code."""
        with self._lock:
            if self._process is process:
                self._end()
            code: int | None = process.exitcode
            return code

    def _end(self) -> None:
        if self._process is not None:
            self._process.kill()
            self._process.join()
        self._process, self._lines = None, []


@contextmanager
def _deaf_to_ctrl_c() -> Iterator[None]:
    """A process started in the block hears it not even while it loads Python, of which it would print where it was."""
    if not hasattr(signal, "pthread_sigmask"):  # Windows
        yield
        return
    resource_tracker.ensure_running()  # in the block it would start itself, and let the signal through after that
    before = signal.pthread_sigmask(signal.SIG_BLOCK, {signal.SIGINT})
    try:
        yield
    finally:
        signal.pthread_sigmask(signal.SIG_SETMASK, before)


def last_core() -> int | None:
    """The core to time on: the last allowed one, as the first serves most interrupts; None where that is not known."""
    return max(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else None


def _serve(lines: Sequence[Connection], make: Callable[[], Answer], core: int | None) -> None:
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    threading.Thread(target=_end_with_parent, daemon=True).start()
    if core is not None and hasattr(os, "sched_setaffinity"):
        os.sched_setaffinity(0, {core})
    often = gc.get_threshold()
    collect_seldom()
    answer = make()
    gc.freeze()
    gc.set_threshold(*often)
    for line in lines[1:]:
        threading.Thread(target=_answer_or_die, args=(line, answer), daemon=True).start()
    _answer_all(lines[0], answer)


def _answer_all(line: Connection, answer: Answer) -> None:
    line.send(("", None))  # ready
    while True:
        try:
            request = line.recv()
        except (EOFError, OSError):  # the other side has closed
            return
        except Exception as exc:  # it came whole, but is nothing that could be made here
            line.send((f"{type(exc).__name__}: {exc}", None))
            continue
        try:
            line.send(("", answer(request)))
        except Exception as exc:
            line.send((f"{type(exc).__name__}: {exc}", None))


def _answer_or_die(line: Connection, answer: Answer) -> None:
    """A thread that ends leaves its line open, on which the other side would wait."""
    try:
        _answer_all(line, answer)
    finally:
        os._exit(1)


def _end_with_parent() -> None:
    """A killed parent closes nothing: who is at work would go on without it."""
    parent = multiprocessing.parent_process()
    if parent is not None:
        parent.join()
    os._exit(1)
