"""A time limit that a run ends by itself, with what it reached: by an exception, or inside `polled` by asking `is_over`
between steps, where samples would be lost. The signal needs a main thread and SIGALRM (not Windows)."""

from __future__ import annotations

import math
import signal
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager

from rotor_mbs.errors import InputError, shown_value

MESSAGE = "stopped at the time limit"  # of a run that was
_MAX_LIMIT_S = 1e9  # the system's timers take no more than the seconds of its clock
_SHORTEST_S = 1e-6  # 0 would switch the timer off


class OutOfTimeError(Exception):
    """A run is over its time limit."""


class _State(threading.local):
    """Of each thread: a limit of one must not end, or lift, that of another."""

    end = math.inf
    polled = False
    is_over = False  # as the signal, or a question to `is_over`, has set it


_state = _State()


def checked_seconds(timeout: float) -> float:
    """Return a time limit in s; inf: none. Raises InputError unless it is above 0, TypeError for no number."""
    try:
        seconds = math.fsum([timeout])  # as float(timeout), but not of text
    except OverflowError:  # a whole number above 1e308
        seconds = math.nan
    if not seconds > 0.0:
        raise InputError(f"timeout: {shown_value(timeout)}; allowed: seconds, more than 0")
    return seconds


@contextmanager
def time_limit(seconds: float) -> Iterator[None]:
    """Raises OutOfTimeError in the block after `seconds` (inf: never), except inside `polled`."""
    if seconds > _MAX_LIMIT_S:
        yield
        return
    has_signal = hasattr(signal, "SIGALRM") and threading.current_thread() is threading.main_thread()
    _state.end, _state.is_over = time.monotonic() + seconds, False
    if has_signal:
        before = signal.signal(signal.SIGALRM, _interrupt)
        signal.setitimer(signal.ITIMER_REAL, max(seconds, _SHORTEST_S))
    try:
        yield
    finally:
        if has_signal:
            signal.setitimer(signal.ITIMER_REAL, 0.0)
            signal.signal(signal.SIGALRM, before)
        _state.end, _state.is_over = math.inf, False


def _interrupt(_number: int, _frame: object) -> None:
    was_known, _state.is_over = _state.is_over, True
    if not (_state.polled or was_known):
        raise OutOfTimeError(MESSAGE)


def stop_in_time() -> None:
    """Raises OutOfTimeError where the limit is reached: between parts of long work, for threads without the signal."""
    if is_over():
        raise OutOfTimeError(MESSAGE)


@contextmanager
def polled() -> Iterator[None]:
    """Inside, nothing is raised: the code asks `is_over` itself and keeps its samples."""
    _state.polled = True
    try:
        yield
    finally:
        _state.polled = False


def step_callback() -> Callable[[object], bool] | None:
    """Called with anything after every step, it returns whether to go on; None where there is no limit; for use inside
    `polled`."""
    return None if math.isinf(_state.end) else lambda _: not is_over()


def is_over() -> bool:
    """Whether the limit is reached; once that is known, a late signal interrupts no more."""
    _state.is_over = _state.is_over or time.monotonic() > _state.end
    return _state.is_over
