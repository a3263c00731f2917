"""Limit the time of runs, and keep the signal handlers of the caller while methods run.

A time limit applies to a block of code and ends it by OutOfTimeError. In the main thread the
handler of SIGALRM raises the exception, which also ends code that never asks for the time. In other
threads, and on Windows, the code must call `raise_if_over` or `is_over`.

The exception would lose the samples computed so far. Code that keeps its samples runs in a block of
`samples_kept_at_limit`, in which the exception is not raised. The code calls `is_over` between
steps.

A process has one handler for SIGALRM and one timer, ITIMER_REAL. The caller of this package may use
both, as pytest-timeout does. While a block is active, this module shares them with the caller: it
sets the timer to the next due time, of a limit or of the caller, and calls the caller's handler at
the caller's time. After the block it gives both back.

An exception that a signal handler of the caller raises must reach the caller. But engines catch
exceptions, and so does our own code, which stores those of methods as results. `caller_signals`
passes the exceptions of handlers on nevertheless.
"""

from __future__ import annotations

import math
import signal
import sys
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import AbstractContextManager, ContextDecorator, contextmanager, nullcontext
from types import CodeType, FrameType
from typing import Any

from rotor_mbs.errors import InputError, shown_value

MESSAGE = "stopped at the time limit"  # message of a run that reached its limit
_MAX_LIMIT_S = 1e9  # longer limits count as none: the system's timers do not take them
_SHORTEST_S = 1e-6  # shortest time to which the timer is set; 0 would switch it off
_SOON_S = 1e-4  # delay after which an alarm that cannot be handled now comes again
# A time counts as due up to this many seconds early, as the clock and the timer differ slightly.
_EARLY_S = 1e-3


class OutOfTimeError(Exception):
    """Raised if a run has exceeded its time limit."""


def valid_seconds(timeout: float) -> float:
    """Return a time limit in s as a float, after a check; infinity means no limit.

    Raises InputError if the limit is not above 0, and TypeError if it is not a number.
    """
    try:
        seconds = math.fsum([timeout])  # like float(timeout), but raises TypeError for text
    except OverflowError:  # for a whole number above 1e308
        seconds = math.nan
    if not seconds > 0.0:
        raise InputError(f"timeout: {shown_value(timeout)}; allowed: seconds, more than 0")
    return seconds


def time_limit(seconds: float) -> AbstractContextManager[object]:
    """Return a context manager that raises OutOfTimeError in its block after `seconds`.

    Infinity means no limit. Inside `samples_kept_at_limit` the error is not raised. Limits may be
    nested: a limit that is reached while the block of an inner limit runs ends this block, too.
    """
    return nullcontext() if seconds > _MAX_LIMIT_S else _Limit(seconds)


@contextmanager
def samples_kept_at_limit() -> Iterator[None]:
    """Prevent a time limit from raising OutOfTimeError in the block.

    The code in the block calls `is_over` instead, and keeps the samples computed so far.
    """
    stack = _limits.stack
    if not stack:
        yield
        return
    limit = stack[-1]
    before, limit.is_polled = limit.is_polled, True
    try:
        yield
    finally:
        limit.is_polled = before


def is_over() -> bool:
    """Return whether a time limit of this thread is reached.

    After it has returned True, a late alarm does not interrupt the innermost block any more.
    """
    stack = _limits.stack
    if not stack:
        return False
    limit = stack[-1]
    limit.is_known = limit.is_known or time.monotonic() > limit.until
    return limit.is_known


def raise_if_over() -> None:
    """Raise OutOfTimeError if a time limit of this thread is reached.

    Long computations call this function between their parts. It is needed in threads that the
    alarm does not reach.
    """
    if is_over():
        raise OutOfTimeError(MESSAGE)


def step_callback() -> Callable[[object], bool] | None:
    """Return a function that an engine calls after every step to learn whether to go on.

    Python handles signals during the call. But each call takes time: None is returned if no limit
    is active and the caller has set no alarm. The engine must run in a block of
    `samples_kept_at_limit`.
    """
    has_alarm = bool(_limits.stack)
    if not has_alarm and _handles_signals() and hasattr(signal, "getitimer"):
        has_alarm = signal.getitimer(signal.ITIMER_REAL)[0] > 0.0
    return (lambda _: not is_over()) if has_alarm else None


def must_ask() -> bool:
    """Return whether a limit is active that cannot interrupt code, so that the code must ask.

    No limit can interrupt code outside the main thread, or on a system without SIGALRM.
    """
    return bool(_limits.stack) and not (_handles_signals() and _signals.has_alarm)


def _handles_signals() -> bool:
    return threading.current_thread() is threading.main_thread()


# ---- Limits


class _Limits(threading.local):
    """The active limits of a thread, with the innermost one last.

    Each thread has its own limits, which do not affect other threads.
    """

    def __init__(self) -> None:
        self.stack: list[_Limit] = []


class _Limit:
    """The context manager that `time_limit` returns.

    It is a class because the handler of the alarm can then recognize its methods (`_OURS`) and let
    them finish. With `contextmanager`, an exception in the code before or after `yield` would leave
    the limit active.
    """

    def __init__(self, seconds: float) -> None:
        self._seconds = seconds
        # Times on the monotonic clock: `end` of this limit, `until` the earliest end of this limit
        # and the limits around it.
        self.end = self.until = math.inf
        self.is_polled = False  # whether the code in the block calls `is_over` itself
        # Whether the code in the block knows that it is over its limit. No alarm then
        # interrupts the code.
        self.is_known = False
        self.has_fired = False  # whether the alarm of this limit has been handled
        self.frame: FrameType | None = None  # frame of the function that has the block

    def __enter__(self) -> None:
        stack = _limits.stack
        is_main = _handles_signals()
        if is_main:
            _signals.enter()
        self.frame = sys._getframe(1)
        self.end = time.monotonic() + self._seconds
        self.until = min(self.end, stack[-1].until) if stack else self.end
        stack.append(self)  # before the timer is armed
        if is_main:
            _signals.share_timer()

    def __exit__(self, _type: object, error: BaseException | None, _traceback: object) -> None:
        stack = _limits.stack
        del stack[stack.index(self) :]
        self.frame = None
        # A limit around this one may have ended this block. It now has to end its own block by
        # another alarm, unless the code there knows that it is over its limit.
        for limit in stack:
            limit.has_fired = limit.is_known
        if _handles_signals():
            if stack:
                _signals.arm()
            else:
                _signals.give_timer_back()
            _signals.leave(error)


_limits = _Limits()


# ---- Signals


class _HandlerError(BaseException):
    """Carry an exception of the caller's signal handler past every `except Exception`.

    Such a clause does not catch this class, which is not a subclass of Exception. The exception
    that it carries is raised at the end of the outermost block, of `caller_signals` or of a limit.
    """

    def __init__(self, error: BaseException) -> None:
        super().__init__(error)
        self.error = error


class caller_signals(ContextDecorator):  # noqa: N801  (a context manager, as `contextlib.suppress`)
    """Pass exceptions of the caller's signal handlers on, even if code in the block catches them.

    Exudyn replaces an exception that a handler raises during a run by one of its own, and our own
    code stores an exception of a method as the result of the run. Therefore our handlers replace
    the caller's and call them. An exception that a handler of the caller raises is stored, and is
    raised in a form that `except Exception` does not catch. If other code catches it nevertheless,
    it is raised again at the end of the block.

    All this happens in the main thread only: Python runs no signal handlers in other threads.
    """

    def __enter__(self) -> None:
        if _handles_signals():
            _signals.enter()

    def __exit__(self, _type: object, error: BaseException | None, _traceback: object) -> None:
        if _handles_signals():
            _signals.leave(error)


class _Signals:
    """The caller's signal handlers and timer while ours replace them.

    Only the main thread uses this class.
    """

    def __init__(self) -> None:
        self._depth = 0  # number of nested blocks
        self._handlers: dict[int, Any] = {}  # the caller's handlers by signal; empty outside blocks
        # The last exception that one of them has raised since the outermost block began.
        self._raised: BaseException | None = None
        self._shares_timer = False  # whether `arm` sets the timer; otherwise the caller does
        self._is_giving_back = False  # whether the timer is just being set to the caller's time
        # Next due time of the caller's timer on the monotonic clock, and its period in s; a period
        # of 0 means that the timer does not repeat.
        self._due, self._interval = math.inf, 0.0
        self._is_missed = False  # whether an alarm of the caller had to wait
        # Whether Python ignored the exception in `_raised`. It then has to be raised once more.
        self._is_lost = False
        # The caller's `sys.unraisablehook`.
        self._hook: Callable[[sys.UnraisableHookArgs], object] = sys.__unraisablehook__

    def enter(self) -> None:
        """Begin a block; the outermost block replaces the caller's handlers by ours."""
        if self._handlers:  # our handlers are in place
            self._depth += 1
            return
        self._raised, self._is_missed, self._is_lost = None, False, False
        try:
            if sys.unraisablehook is not _on_unraisable:
                self._hook, sys.unraisablehook = sys.unraisablehook, _on_unraisable
            for number in _SIGNALS:
                handler = signal.getsignal(number)
                # A handler that was not set by Python is None here: it could not be set again.
                if number == _ALARM and handler is not None:
                    self._handlers[number] = handler
                    signal.signal(number, _on_alarm)
                elif callable(handler):
                    self._handlers[number] = handler
                    signal.signal(number, _on_signal)
            # All handlers are ours now. They raise nothing in code that begins or ends a block.
            self._depth = 1
        except BaseException:
            self._restore_handlers()
            raise

    def leave(self, error: BaseException | None) -> None:
        """End a block, and raise the exception that a handler of the caller has raised in it.

        Parameters
        ----------
        error : the exception with which the block ends, or None.
        """
        if self._depth > 1:
            self._depth -= 1
            raised = self._raised
            if raised is not None and error is not raised and not isinstance(error, _HandlerError):
                raise _passing(raised)
            return
        self._restore_handlers()
        raised = error.error if isinstance(error, _HandlerError) else self._raised
        self._raised = None
        if raised is not None and error is not raised:
            context = raised.__context__
            try:
                raise raised
            finally:
                raised.__context__ = context  # `raise raised` may have changed it

    def _restore_handlers(self) -> None:
        try:
            self.give_timer_back()
            if sys.unraisablehook is _on_unraisable:
                sys.unraisablehook = self._hook
            for number, handler in list(self._handlers.items()):
                signal.signal(number, handler)
                del self._handlers[number]
        except BaseException:  # raised by a handler of the caller that is in place again
            self._restore_handlers()
            raise

    # The timer

    @property
    def has_alarm(self) -> bool:
        """Return whether SIGALRM exists and a block has replaced its handler."""
        return _ALARM in self._handlers

    def share_timer(self) -> None:
        """Store the caller's due time, and set the timer to the next due time by `arm`."""
        if not self.has_alarm:
            return
        if not self._shares_timer:
            remaining, self._interval = signal.getitimer(signal.ITIMER_REAL)
            # During this call Python handles an alarm that has already arrived. The timer was the
            # caller's, so that the alarm counts as the caller's.
            signal.signal(_ALARM, _on_alarm)
            self._shares_timer = True
            now = time.monotonic()
            self._due = now + remaining if remaining else math.inf
            if self._is_missed:
                self._due, self._is_missed = now, False
        self.arm()

    def arm(self) -> None:
        """Set the timer to the next due time of the caller or of a limit."""
        if not self._shares_timer:
            return
        now = time.monotonic()
        times = [self._due, *(limit.end for limit in _limits.stack if not limit.has_fired)]
        if self._is_lost:
            times.append(now + _SOON_S)
        seconds = min(times) - now
        signal.setitimer(
            signal.ITIMER_REAL, 0.0 if math.isinf(seconds) else max(seconds, _SHORTEST_S)
        )

    def give_timer_back(self, handler: Any = None) -> None:
        """Set the timer to the time that is left until the caller's alarm is due.

        If the caller's alarm is due already, the timer is set to come at once.

        Parameters
        ----------
        handler : handler of SIGALRM that is installed before the timer is set; None for ours.
        """
        if not self._shares_timer:
            return
        self._is_giving_back = True
        signal.setitimer(signal.ITIMER_REAL, 0.0)
        # During this call Python handles an alarm that has already arrived. `on_alarm` ignores it,
        # as `_is_giving_back` is set.
        signal.signal(_ALARM, handler or _on_alarm)
        self._shares_timer = self._is_giving_back = False
        if not math.isinf(self._due):
            seconds = max(self._due - time.monotonic(), _SHORTEST_S)
            signal.setitimer(signal.ITIMER_REAL, seconds, self._interval)

    def on_alarm(self, frame: FrameType | None) -> None:
        """Raise OutOfTimeError or call the caller's handler, whichever is due.

        If the interrupted code must finish first, the alarm is set to come again soon.

        Parameters
        ----------
        frame : the frame that was interrupted.
        """
        if self._is_giving_back:  # if the caller's alarm is due, the timer is set to come at once
            return
        if _is_in(frame, None, _is_ours):
            interval = 0.0
            if not self._shares_timer:
                self._is_missed = True
                interval = signal.getitimer(signal.ITIMER_REAL)[1]
            signal.setitimer(signal.ITIMER_REAL, _SOON_S, interval)
            return
        if not self._shares_timer:
            self._is_missed = False
            self._call_alarm_handler(frame)
            return
        now = time.monotonic() + _EARLY_S
        if self._due <= now:
            periods = math.ceil((now - self._due) / self._interval) if self._interval else math.inf
            self._due += max(periods, 1) * self._interval if self._interval else math.inf
            self._call_alarm_handler(frame)
        if self._is_lost and self._raised is not None:
            self._is_lost = False
            self.arm()
            raise _passing(self._raised)
        stack = _limits.stack
        for place, limit in enumerate(stack):
            if limit.end > now or limit.has_fired:
                continue
            asking = next(
                (inner for inner in reversed(stack[place:]) if inner.is_polled or inner.is_known),
                None,
            )
            if asking is None and _is_in(frame, limit.frame, _must_finish):
                signal.setitimer(signal.ITIMER_REAL, _SOON_S)
                return
            limit.has_fired = True
            if asking is None:
                self.arm()
                raise OutOfTimeError(MESSAGE)
            asking.is_known = True
        self.arm()

    def _call_alarm_handler(self, frame: FrameType | None) -> None:
        """Call the caller's handler of SIGALRM, with the caller's handler and timer in place.

        The caller's handler may set both; its settings are kept.

        Parameters
        ----------
        frame : the frame that was interrupted.
        """
        handler, shared = self._handlers[_ALARM], self._shares_timer
        if handler == signal.SIG_IGN:
            return
        if shared:
            self.give_timer_back(handler)
        else:
            signal.signal(_ALARM, handler)
        try:
            if callable(handler):
                self.call_handler(_ALARM, frame)
            else:  # the system's default handler, which ends the process
                signal.raise_signal(_ALARM)
        finally:
            changed = signal.getsignal(_ALARM)
            self._handlers[_ALARM] = changed
            signal.signal(_ALARM, _on_alarm)
            if shared:
                self.share_timer()

    def call_handler(self, number: int, frame: FrameType | None) -> None:
        """Call the caller's handler of a signal; store and pass on an exception that it raises."""
        try:
            self._handlers[number](number, frame)
        except BaseException as error:
            self._raised = error
            if _is_in(frame, None, _is_ours):
                return  # `leave` raises the exception
            raise _passing(error) from None

    def on_unraisable(self, unraisable: sys.UnraisableHookArgs) -> None:
        """Handle an error that Python ignores: if this module raised it, it is raised again.

        The timer is set for this, and `on_alarm` raises the error. Python ignores errors in the
        callback of a weak reference, for example. Errors that this module has not raised are passed
        to the caller's `sys.unraisablehook`.

        Parameters
        ----------
        unraisable : argument of `sys.unraisablehook`.
        """
        error = unraisable.exc_value
        if isinstance(error, _HandlerError):
            error = error.error
        is_callers = error is not None and error is self._raised
        if not (_handles_signals() and (is_callers or isinstance(error, OutOfTimeError))):
            self._hook(unraisable)
            return
        self._is_lost = self._is_lost or is_callers
        if not is_callers:
            for limit in _limits.stack:
                limit.has_fired = limit.is_known
        self.share_timer()


def _passing(error: BaseException) -> BaseException:
    """Return an exception in a form that neither `except Exception` nor our own code catches.

    An exception that neither of them would catch, such as KeyboardInterrupt, is returned unchanged.
    """
    return _HandlerError(error) if isinstance(error, Exception | SystemExit) else error


_signals = _Signals()
_ALARM: int = getattr(signal, "SIGALRM", 0)  # 0, the number of no signal, on Windows
_SIGNALS = tuple(signal.valid_signals())


def _on_alarm(_number: int, frame: FrameType | None) -> None:
    _signals.on_alarm(frame)


def _on_signal(number: int, frame: FrameType | None) -> None:
    _signals.call_handler(number, frame)


def _on_unraisable(unraisable: sys.UnraisableHookArgs) -> None:
    _signals.on_unraisable(unraisable)


_OURS = {
    function.__code__
    for function in (
        _Limit.__enter__,
        _Limit.__exit__,
        caller_signals.__enter__,
        caller_signals.__exit__,
        _on_alarm,
        _on_signal,
        _on_unraisable,
    )
}


def _is_in(
    frame: FrameType | None, outer: FrameType | None, is_sought: Callable[[CodeType], bool]
) -> bool:
    """Return whether `is_sought` is true for the code of a frame on the stack.

    The frames from the innermost one, `frame`, up to `outer`, which is excluded, are searched.
    """
    while frame is not None and frame is not outer:
        if is_sought(frame.f_code):
            return True
        frame = frame.f_back
    return False


def _is_ours(code: CodeType) -> bool:
    """Return whether code begins or ends a block of this module, or handles a signal.

    Such code must not be interrupted halfway.
    """
    return code in _OURS


def _must_finish(code: CodeType) -> bool:
    """Return whether a limit must not interrupt a function, as this would damage the process.

    A compiled module cannot be imported again after an interrupted import. A context that is not
    left properly, such as NumPy's handling of floating-point errors, also affects later code.
    """
    return code.co_name in ("__enter__", "__exit__", "__del__") or code.co_filename.startswith(
        "<frozen importlib"
    )
