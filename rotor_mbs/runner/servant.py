"""One process of its own that answers requests one at a time, each within a time limit; for timing undisturbed.

Knows nothing of scenes, models or files: it is given a picklable function that makes the answering object.
"""

from __future__ import annotations

import contextlib
import gc
import multiprocessing
import os
from collections.abc import Callable
from multiprocessing.connection import Connection
from types import TracebackType
from typing import Any, Self

from rotor_mbs.runner.pool import ONE_THREAD

Answer = Callable[[Any], Any]


class NoAnswerError(Exception):
    """The process hung (`timed_out`) or died, and was ended; the next request starts another one."""

    def __init__(self, message: str, timed_out: bool) -> None:
        super().__init__(message)
        self.timed_out = timed_out


class Servant:
    """`make()` is called in the new process, on one core if the system allows; what it returns answers requests."""

    def __init__(self, make: Callable[[], Answer], core: int | None = None) -> None:
        self._make, self._core = make, core
        self._context = multiprocessing.get_context("spawn")
        self._process: Any = None
        self._line: Connection | None = None

    def ask(self, request: object, limit_s: float) -> Any:
        """The answer. Raises NoAnswerError where none comes within `limit_s`, RuntimeError with the servant's error."""
        line = self._line or self._start()
        line.send(request)
        if not line.poll(limit_s):
            self.close()
            raise NoAnswerError(f"ended after {limit_s:g} s", timed_out=True)
        try:
            failure, value = line.recv()
        except EOFError as exc:
            code = self._ended()
            raise NoAnswerError(f"its process died (exit code {code})", timed_out=False) from exc
        if failure:
            raise RuntimeError(failure)
        return value

    def close(self) -> None:
        """Ends the process."""
        if self._process is not None:
            self._process.kill()
            self._ended()

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.close()

    def _start(self) -> Connection:
        for name in ONE_THREAD:
            os.environ.setdefault(name, "1")
        line, far_end = self._context.Pipe()
        self._process = self._context.Process(target=_serve, args=(far_end, self._make, self._core), daemon=True)
        self._process.start()
        far_end.close()
        self._line = line
        return line

    def _ended(self) -> int | None:
        self._process.join()
        code: int | None = self._process.exitcode
        if self._line is not None:
            self._line.close()
        self._process = self._line = None
        return code


def last_core() -> int | None:
    """The core to time on: the last allowed one, as the first serves most interrupts; None where that is not known."""
    return max(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else None


def _serve(line: Connection, make: Callable[[], Answer], core: int | None) -> None:
    if core is not None and hasattr(os, "sched_setaffinity"):
        os.sched_setaffinity(0, {core})
    answer = make()
    gc.freeze()
    gc.disable()
    with contextlib.suppress(EOFError, KeyboardInterrupt):  # the other side has closed, or everything is interrupted
        while True:
            request = line.recv()
            try:
                line.send(("", answer(request)))
            except Exception as exc:
                line.send((f"{type(exc).__name__}: {exc}", None))
