"""A time limit that a run ends by itself, with what it reached: by an exception, or inside `polled` by asking `is_over`
between steps, where samples would be lost. The signal needs a main thread and SIGALRM (not Windows)."""

from __future__ import annotations

import math
import signal
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager

MESSAGE = "ended by its time limit"  # of a run that was
_MAX_LIMIT_S = 1e9  # the system's timers take no more than the seconds of its clock


class OutOfTimeError(Exception):
    """A run is over its time limit."""


class _State:
    end = math.inf
    polled = False
    is_over = False  # as the signal, or a question to `is_over`, has set it
    has_signal = False


@contextmanager
def time_limit(seconds: float) -> Iterator[None]:
    """Raises OutOfTimeError in the block after `seconds` (inf: never), except inside `polled`."""
    if seconds > _MAX_LIMIT_S:
        yield
        return
    has_signal = hasattr(signal, "SIGALRM") and threading.current_thread() is threading.main_thread()
    _State.end, _State.is_over, _State.has_signal = time.monotonic() + seconds, False, has_signal
    if has_signal:
        before = signal.signal(signal.SIGALRM, _interrupt)
        signal.setitimer(signal.ITIMER_REAL, seconds)
    try:
        yield
    finally:
        if has_signal:
            signal.setitimer(signal.ITIMER_REAL, 0.0)
            signal.signal(signal.SIGALRM, before)
        _State.end, _State.is_over = math.inf, False


def _interrupt(_number: int, _frame: object) -> None:
    was_known, _State.is_over = _State.is_over, True
    if not (_State.polled or was_known):
        raise OutOfTimeError(MESSAGE)


@contextmanager
def polled() -> Iterator[None]:
    """Inside, nothing is raised: the code asks `is_over` itself and keeps its samples."""
    _State.polled = True
    try:
        yield
    finally:
        _State.polled = False


def step_callback() -> Callable[[object], bool] | None:
    """Called with anything after every step, it returns whether to go on; None where there is no limit; for use inside
    `polled`."""
    if math.isinf(_State.end):
        return None
    if _State.has_signal:
        return lambda _: not _State.is_over
    return lambda _: not is_over()


def is_over() -> bool:
    """Whether the limit is reached; once that is known, a late signal interrupts no more."""
    _State.is_over = _State.is_over or time.monotonic() > _State.end
    return _State.is_over
