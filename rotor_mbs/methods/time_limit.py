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
from collections.abc import Callable, Iterator
from contextlib import contextmanager

_LONGEST_S = 1e9  # the system's timers take no more than the seconds of its clock


class OutOfTimeError(Exception):
    """A run is over its time limit."""


class _State:
    end = math.inf
    polled = False
    reported = False
    has_signal = False
    signalled = False


@contextmanager
def time_limit(seconds: float) -> Iterator[None]:
    """Raises OutOfTimeError in the block after `seconds` (inf: never), except inside `polled`."""
    usable = hasattr(signal, "SIGALRM") and threading.current_thread() is threading.main_thread()
    if seconds > _LONGEST_S:
        yield
        return
    _State.end, _State.reported = time.monotonic() + seconds, False
    _State.has_signal, _State.signalled = usable, False
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
        _State.has_signal, _State.signalled = False, False


def _interrupt(_number: int, _frame: object) -> None:
    _State.signalled = True
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


def step_callback() -> Callable[[object], bool] | None:
    """Called with anything after every step, it returns whether to go on; None where there is no limit.

    For use inside `polled`. To look at the clock after every step costs a fast integrator an eighth of its run time;
    where there is a signal, only what the signal has set is read.
    """
    if math.isinf(_State.end):
        return None
    if _State.has_signal:
        return lambda _: not _State.signalled
    return lambda _: not is_over()


def is_over() -> bool:
    """Whether the limit is reached; once it has been reported, a late signal interrupts no more."""
    _State.reported = _State.reported or _State.signalled or time.monotonic() > _State.end
    return _State.reported


def message() -> str:
    """The message of a run that was ended so."""
    return "ended by its time limit"
