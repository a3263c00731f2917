"""Limit the time of runs, and keep the signal handlers of the caller while methods run.

A limit ends a block by OutOfTimeError, or, inside `samples_kept_at_limit`, lets the code ask
`is_over` between steps, where an exception would lose samples. In the main thread the exception
comes from SIGALRM, so that it also ends code that never asks; in other threads, and on Windows, the
code must ask.

Python has one handler for SIGALRM and one timer, ITIMER_REAL, and the caller may use both
(pytest-timeout does). While a block is active, they are shared: the timer is set to whatever is due
next, ours or the caller's, and the caller's handler is called when its own time has come. After the
block, handler and timer are the caller's again.

What a handler of the caller raises must reach the caller, although engines and our own code catch
exceptions of methods, to store them as results: see `caller_signals`.
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

MESSAGE = "stopped at the time limit"  # of a run that was
_MAX_LIMIT_S = 1e9  # the system's timers take no more than the seconds of its clock
_SHORTEST_S = 1e-6  # 0 would switch the timer off
_SOON_S = 1e-4  # until an alarm that came at a wrong moment comes again
# an alarm is for what is due until then: clock and timer need not agree to the last digit
_EARLY_S = 1e-3


class OutOfTimeError(Exception):
    """A run is over its time limit."""


def valid_seconds(timeout: float) -> float:
    """Return a valid time limit in s; infinity means none.

    Raises InputError unless it is above 0, TypeError if it is no number.
    """
    try:
        seconds = math.fsum([timeout])  # as float(timeout), but not of text
    except OverflowError:  # a whole number above 1e308
        seconds = math.nan
    if not seconds > 0.0:
        raise InputError(f"timeout: {shown_value(timeout)}; allowed: seconds, more than 0")
    return seconds


def time_limit(seconds: float) -> AbstractContextManager[object]:
    """Raise OutOfTimeError in the block after `seconds`; infinity means never.

    Inside `samples_kept_at_limit` it is not raised. Limits may be nested: one that ends while an
    inner one is active ends the inner block, too.
    """
    return nullcontext() if seconds > _MAX_LIMIT_S else _Limit(seconds)


@contextmanager
def samples_kept_at_limit() -> Iterator[None]:
    """Raise no OutOfTimeError in the block.

    Its code calls `is_over` itself, and keeps the samples that it has computed.
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
    """Return whether a limit is reached.

    Once this has returned True, a late signal does not interrupt the innermost block.
    """
    stack = _limits.stack
    if not stack:
        return False
    limit = stack[-1]
    limit.is_known = limit.is_known or time.monotonic() > limit.until
    return limit.is_known


def raise_if_over() -> None:
    """Raise OutOfTimeError if a limit is reached.

    It is called between parts of long work, for threads that the signal does not reach.
    """
    if is_over():
        raise OutOfTimeError(MESSAGE)


def step_callback() -> Callable[[object], bool] | None:
    """Return a function for an engine to call after every step, which returns whether to go on.

    It is None if no alarm can come, neither of a limit nor of the caller: the call takes time, and
    Python handles signals in it. For use inside `samples_kept_at_limit`.
    """
    has_alarm = bool(_limits.stack)
    if not has_alarm and _handles_signals() and hasattr(signal, "getitimer"):
        has_alarm = signal.getitimer(signal.ITIMER_REAL)[0] > 0.0
    return (lambda _: not is_over()) if has_alarm else None


def must_ask() -> bool:
    """Return whether a limit is active that cannot interrupt code.

    This is so in a thread, or without SIGALRM.
    """
    return bool(_limits.stack) and not (_handles_signals() and _signals.has_alarm)


def _handles_signals() -> bool:
    return threading.current_thread() is threading.main_thread()


# ---- Limits


class _Limits(threading.local):
    """The limits of each thread, the innermost last.

    The limits of one thread do not affect those of another.
    """

    def __init__(self) -> None:
        self.stack: list[_Limit] = []


class _Limit:
    """The context of `time_limit`.

    A class, because its methods are known to the handler of the alarm, which lets them finish: an
    exception inside a `contextmanager`'s own code, before or after the block, would leave the limit
    behind.
    """

    def __init__(self, seconds: float) -> None:
        self._seconds = seconds
        # on the monotonic clock; `until`: of the limits around it, too
        self.end = self.until = math.inf
        self.is_polled = False
        self.is_known = False  # to the code in the block, which is not interrupted any more
        self.has_fired = False
        self.frame: FrameType | None = None  # that has the block

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
        for limit in stack:  # those around it end their own blocks, which are interrupted again
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
    """Exception that carries one of a caller's handler past every `except Exception`.

    The exception that it carries is raised at the end of `caller_signals`.
    """

    def __init__(self, error: BaseException) -> None:
        super().__init__(error)
        self.error = error


class caller_signals(ContextDecorator):  # noqa: N801  (a context manager, as `contextlib.suppress`)
    """Let exceptions of the caller's signal handlers through, whatever catches them in the block.

    Exudyn turns an exception that a handler raises during its run into one of its own, and our own
    code stores what a method raises as its result. So handlers are wrapped: what they raise is
    noted, passes every `except Exception`, and is raised at the end of the block where something
    has caught it nevertheless. In the main thread; in others, where Python runs no handlers,
    nothing is done.
    """

    def __enter__(self) -> None:
        if _handles_signals():
            _signals.enter()

    def __exit__(self, _type: object, error: BaseException | None, _traceback: object) -> None:
        if _handles_signals():
            _signals.leave(error)


class _Signals:
    """The signal handlers and the timer of the caller, while ours replace them.

    Only the main thread uses it.
    """

    def __init__(self) -> None:
        self._depth = 0  # of blocks, while there are handlers
        self._handlers: dict[int, Any] = {}  # of the caller, by signal
        self._raised: BaseException | None = None  # by one of them, since the outermost block began
        self._shares_timer = False  # whether it is set by `arm`; else it is the caller's
        self._is_giving_back = False
        # of the caller's timer, on the monotonic clock; s, where it repeats
        self._due, self._interval = math.inf, 0.0
        self._is_missed = False  # whether an alarm of the caller came where it had to wait
        # whether Python ignored what was raised, so that it is raised once more
        self._is_lost = False
        # the caller's
        self._hook: Callable[[sys.UnraisableHookArgs], object] = sys.__unraisablehook__

    def enter(self) -> None:
        """Begin a block; the outermost one replaces the caller's handlers by ours."""
        if self._handlers:  # ours are in place
            self._depth += 1
            return
        self._raised, self._is_missed, self._is_lost = None, False, False
        try:
            if sys.unraisablehook is not _on_unraisable:
                self._hook, sys.unraisablehook = sys.unraisablehook, _on_unraisable
            for number in _SIGNALS:
                handler = signal.getsignal(number)
                # one that is not Python's could not be set again
                if number == _ALARM and handler is not None:
                    self._handlers[number] = handler
                    signal.signal(number, _on_alarm)
                elif callable(handler):
                    self._handlers[number] = handler
                    signal.signal(number, _on_signal)
            self._depth = 1  # from now on no handler interrupts what begins or ends a block
        except BaseException:
            self._restore_handlers()
            raise

    def leave(self, error: BaseException | None) -> None:
        """End a block; raise the exception that a handler of the caller has raised in it.

        Parameters
        ----------
        error : with which the block ends, or None.
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
                raised.__context__ = context  # without what happened to it in between

    def _restore_handlers(self) -> None:
        try:
            self.give_timer_back()
            if sys.unraisablehook is _on_unraisable:
                sys.unraisablehook = self._hook
            for number, handler in list(self._handlers.items()):
                signal.signal(number, handler)
                del self._handlers[number]
        except BaseException:  # of a handler that is already the caller's again
            self._restore_handlers()
            raise

    # The timer

    @property
    def has_alarm(self) -> bool:
        """Return whether SIGALRM exists, and its handler can be set again."""
        return _ALARM in self._handlers

    def share_timer(self) -> None:
        """Set the timer for the limits, too; how long the caller's still has to run is noted."""
        if not self.has_alarm:
            return
        if not self._shares_timer:
            remaining, self._interval = signal.getitimer(signal.ITIMER_REAL)
            # inside, an alarm that was on its way is handled, as the caller's
            signal.signal(_ALARM, _on_alarm)
            self._shares_timer = True
            now = time.monotonic()
            self._due = now + remaining if remaining else math.inf
            if self._is_missed:
                self._due, self._is_missed = now, False
        self.arm()

    def arm(self) -> None:
        """Set the timer to the next due time: of the caller's alarm or of a limit."""
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
        """Set the timer to what is left of the caller's time.

        An alarm that came due meanwhile comes at once.

        Parameters
        ----------
        handler : replaces ours before the timer is set.
        """
        if not self._shares_timer:
            return
        self._is_giving_back = True
        signal.setitimer(signal.ITIMER_REAL, 0.0)
        # Inside, an alarm of ours that was on its way is handled, while it is still known as ours.
        signal.signal(_ALARM, handler or _on_alarm)
        self._shares_timer = self._is_giving_back = False
        if not math.isinf(self._due):
            seconds = max(self._due - time.monotonic(), _SHORTEST_S)
            signal.setitimer(signal.ITIMER_REAL, seconds, self._interval)

    def on_alarm(self, frame: FrameType | None) -> None:
        """Raise OutOfTimeError or call the caller's handler, whichever is due.

        This is delayed if the code that was interrupted must finish first.

        Parameters
        ----------
        frame : that was interrupted.
        """
        if self._is_giving_back:  # the caller's, if it is due, is set to come at once
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
        """Call the caller's handler of the alarm as if ours were not installed.

        It may set the timer and the handler.

        Parameters
        ----------
        frame : that was interrupted.
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
            else:  # the system's: it ends the process
                signal.raise_signal(_ALARM)
        finally:
            changed = signal.getsignal(_ALARM)
            self._handlers[_ALARM] = changed
            signal.signal(_ALARM, _on_alarm)
            if shared:
                self.share_timer()

    def call_handler(self, number: int, frame: FrameType | None) -> None:
        """Call the caller's handler of a signal, and keep what it raises."""
        try:
            self._handlers[number](number, frame)
        except BaseException as error:
            self._raised = error
            if _is_in(frame, None, _is_ours):
                return  # it is raised at the end of the block
            raise _passing(error) from None

    def on_unraisable(self, unraisable: sys.UnraisableHookArgs) -> None:
        """Raise an error of ours again that Python ignored, as in a weak reference's callback.

        Parameters
        ----------
        unraisable : the arguments of `sys.unraisablehook`; other errors go to the former hook.
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
    """Return an exception in a form that `except Exception` and our own code do not catch.

    One that these do not catch anyway is returned unchanged.
    """
    return _HandlerError(error) if isinstance(error, Exception | SystemExit) else error


_signals = _Signals()
_ALARM: int = getattr(signal, "SIGALRM", 0)  # 0 is no signal: on Windows
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
    """Return whether a function in the stack of frames is sought.

    The stack begins at the innermost `frame` and ends before `outer`.
    """
    while frame is not None and frame is not outer:
        if is_sought(frame.f_code):
            return True
        frame = frame.f_back
    return False


def _is_ours(code: CodeType) -> bool:
    """Return whether a function begins or ends a block, or handles a signal.

    It must not be interrupted halfway.
    """
    return code in _OURS


def _must_finish(code: CodeType) -> bool:
    """Return whether a limit waits for a function: what it would leave half stays in the process.

    A compiled module whose import was broken off cannot be imported again, and a context that is
    not left, as that of NumPy's floating-point errors, stays for what comes after.
    """
    return code.co_name in ("__enter__", "__exit__", "__del__") or code.co_filename.startswith(
        "<frozen importlib"
    )
