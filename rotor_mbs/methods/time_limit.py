"""A time limit that a run ends by itself, with what it reached. Knows no engine.

An engine that looks for signals (Exudyn at every step, anything in Python) is interrupted by an exception; one that
would lose its samples that way asks `is_over` between steps instead, inside `polled`. What does neither is ended from
outside by the runner and leaves nothing. Needs a main thread and SIGALRM (not Windows); elsewhere only asking works.
"""

from __future__ import annotations

import math
import signal
import threading
import time
from collections.abc import Iterator
from contextlib import contextmanager


class OutOfTimeError(Exception):
    """A run is over its time limit."""


class _State:
    end = math.inf
    polled = False
    reported = False


@contextmanager
def time_limit(seconds: float) -> Iterator[None]:
    """Raises OutOfTimeError in the block after `seconds` (inf: never), except inside `polled`."""
    usable = hasattr(signal, "SIGALRM") and threading.current_thread() is threading.main_thread()
    if math.isinf(seconds):
        yield
        return
    _State.end, _State.reported = time.monotonic() + seconds, False
    if usable:
        before = signal.signal(signal.SIGALRM, _interrupt)
        signal.setitimer(signal.ITIMER_REAL, seconds)
    try:
        yield
    finally:
        if usable:
            signal.setitimer(signal.ITIMER_REAL, 0.0)
            signal.signal(signal.SIGALRM, before)
        _State.end, _State.reported = math.inf, False


def _interrupt(_number: int, _frame: object) -> None:
    if not (_State.polled or _State.reported):
        raise OutOfTimeError(message())


@contextmanager
def polled() -> Iterator[None]:
    """Inside, nothing is raised: the code asks `is_over` itself and keeps its samples."""
    _State.polled = True
    try:
        yield
    finally:
        _State.polled = False


def is_set() -> bool:
    """Whether there is a limit at all: without one nobody needs to ask between steps."""
    return not math.isinf(_State.end)


def is_over() -> bool:
    """Whether the limit is reached; once it has been reported, a late signal interrupts no more."""
    _State.reported = _State.reported or time.monotonic() > _State.end
    return _State.reported


def message() -> str:
    """The message of a run that was ended so."""
    return "ended by its time limit"
