"""Time limits leave nothing behind; the caller's alarm, pytest-timeout's for one, passes through
every call."""

# ruff: noqa: PT012  (what is tested is where in a block it is ended)

from __future__ import annotations

import gc
import signal
import sys
import threading
import time
import weakref
from collections.abc import Callable, Iterator
from concurrent.futures import ThreadPoolExecutor
from contextlib import suppress
from pathlib import Path
from types import FrameType
from typing import Any

import numpy as np
import pytest

import rotor_mbs as rm
from rotor_mbs.errors import RotorError
from rotor_mbs.methods import time_limit as module
from rotor_mbs.methods.catalogue import find_method
from rotor_mbs.methods.time_limit import (
    OutOfTimeError,
    caller_signals,
    is_over,
    samples_kept_at_limit,
    time_limit,
)
from rotor_mbs.studies.method_test import examine

pytestmark = pytest.mark.skipif(not hasattr(signal, "SIGALRM"), reason="needs SIGALRM")


class Late(Exception):
    """Raised by the handler of a test; an Exception, which is what our own code catches."""


def late(_number: int, _frame: FrameType | None) -> None:
    raise Late


def state() -> tuple[object, ...]:
    """What a call must leave as it was."""
    return (
        [signal.getsignal(number) for number in sorted(signal.valid_signals())],
        signal.getitimer(signal.ITIMER_REAL),
        gc.isenabled(),
        np.geterr(),
        sys.unraisablehook,
        is_over(),
        _time_left(),
    )


def _time_left() -> bool:
    """Whether a limit that is none has its time: no other one is left around it."""
    if signal.getitimer(signal.ITIMER_REAL)[0]:
        return True  # the test's own
    with time_limit(1e6):
        return signal.getitimer(signal.ITIMER_REAL)[0] > 1e5


@pytest.fixture(autouse=True)
def _alarm() -> Iterator[None]:
    """Everything is as before; what the test itself sets is taken back first."""
    before, handler = state(), signal.getsignal(signal.SIGALRM)
    yield
    signal.setitimer(signal.ITIMER_REAL, 0.0)
    signal.signal(signal.SIGALRM, handler)
    assert state() == before


def wait(seconds: float) -> None:
    """Sleep, in parts: time.sleep goes on to its end after a signal."""
    end = time.monotonic() + seconds
    while time.monotonic() < end:
        time.sleep(0.001)


# ---- The limit alone


@pytest.mark.parametrize("seconds", [-1.0, 0.0, 1e-12, 1e-7, 1e-3])
def test_a_limit_of_any_size_ends_its_block_alone(seconds: float) -> None:
    for _ in range(20):
        with pytest.raises(OutOfTimeError), time_limit(seconds):
            wait(10.0)
        wait(0.001)
        assert not is_over()


def test_an_inner_limit_leaves_the_outer_one_its_time() -> None:
    with pytest.raises(OutOfTimeError), time_limit(0.2):
        with pytest.raises(OutOfTimeError), time_limit(0.05):
            wait(10.0)
        assert 0.0 < signal.getitimer(signal.ITIMER_REAL)[0] <= 0.15
        with time_limit(100.0):
            assert signal.getitimer(signal.ITIMER_REAL)[0] <= 0.15
        assert not is_over()
        wait(10.0)


def test_an_outer_limit_ends_an_inner_block_too() -> None:
    """Also where the inner one asks, and keeps its samples: the outer block is ended by itself
    then."""
    inner_ended = False
    with pytest.raises(OutOfTimeError), time_limit(0.05):
        with pytest.raises(OutOfTimeError), time_limit(10.0):
            wait(10.0)
        inner_ended = True
        wait(10.0)
    assert inner_ended
    asked = 0
    with pytest.raises(OutOfTimeError), time_limit(0.05):
        with time_limit(10.0), samples_kept_at_limit():
            while not is_over():
                asked += 1
        wait(10.0)
    assert asked


def test_limits_of_other_threads_touch_no_signal() -> None:
    before = state()

    def limited() -> bool:
        with time_limit(1e-3):
            assert state()[:2] == before[:2]
            while not is_over():
                pass
        return is_over()

    with ThreadPoolExecutor(1) as other:
        assert not other.submit(limited).result(10.0)


def test_an_import_and_the_end_of_a_context_are_not_broken_off(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    (tmp_path / "slowly_imported.py").write_text(
        "import time\nfor _ in range(50):\n    time.sleep(0.001)\nDONE = 1\n"
    )
    monkeypatch.syspath_prepend(tmp_path)
    ended = []

    class Context:
        def __enter__(self) -> None:
            wait(0.01)
            ended.append("begin")

        def __exit__(self, *_: object) -> None:
            wait(0.03)
            ended.append("end")

    with pytest.raises(OutOfTimeError), time_limit(0.01):
        import slowly_imported  # type: ignore[import-not-found]

        wait(10.0)
    assert slowly_imported.DONE
    with pytest.raises(OutOfTimeError), time_limit(0.02):
        with Context():
            pass
        wait(10.0)
    assert ended == ["begin", "end"]


# ---- The caller's alarm


@pytest.mark.parametrize("seconds", [1e-12, 0.01, 10.0])
@pytest.mark.parametrize("interval", [0.0, 7.0])
def test_the_callers_timer_keeps_what_is_left_of_its_time(seconds: float, interval: float) -> None:
    signal.signal(signal.SIGALRM, late)
    begun = time.monotonic()
    signal.setitimer(signal.ITIMER_REAL, 5.0, interval)
    try:
        with time_limit(seconds), time_limit(2.0 * seconds):
            wait(0.05)
    except OutOfTimeError:
        assert seconds < 1.0
    remaining, repeats = signal.getitimer(signal.ITIMER_REAL)
    # What has passed: the block at least, and at most all until now. The system counts in
    # microseconds.
    assert 5.0 - (time.monotonic() - begun) - 1e-3 < remaining < 5.0 - min(seconds, 0.05) + 1e-3
    assert (repeats, signal.getsignal(signal.SIGALRM)) == (interval, late)


def test_the_callers_handler_is_called_in_time_and_may_set_its_timer() -> None:
    """Three times, a hundredth of a second apart; the limit ends the block all the same."""
    called: list[float] = []

    def again(_number: int, _frame: FrameType | None) -> None:
        called.append(time.monotonic())
        if len(called) < 3:
            signal.setitimer(signal.ITIMER_REAL, 0.01)

    signal.signal(signal.SIGALRM, again)
    signal.setitimer(signal.ITIMER_REAL, 0.01)
    with pytest.raises(OutOfTimeError), time_limit(0.2):
        wait(10.0)
    assert len(called) == 3
    assert np.diff(called).min() >= 0.01
    assert signal.getitimer(signal.ITIMER_REAL) == (0.0, 0.0)


def test_a_repeated_timer_goes_on() -> None:
    called: list[int] = []
    signal.signal(signal.SIGALRM, lambda number, _: called.append(number))
    signal.setitimer(signal.ITIMER_REAL, 0.01, 0.01)
    with time_limit(100.0):
        while len(called) < 2:  # on a busy machine several of them may be one
            wait(0.01)
    during = len(called)
    end = time.monotonic() + 100.0
    while len(called) == during and time.monotonic() < end:
        wait(0.01)
    assert len(called) > during


def _at_every_line(call: Callable[[], object], wait_s: float) -> Iterator[int]:
    """Run `call` once for each line of the module that it comes to, and wait there."""
    reached, stop_at = 0, 0

    def trace(frame: FrameType, event: str, _: object) -> Any:
        nonlocal reached
        if frame.f_code.co_filename != module.__file__:
            return None
        if event in ("call", "line"):
            reached += 1
            if reached == stop_at:
                sys.settrace(None)  # not in what the alarm calls
                wait(wait_s)
        return trace

    before = sys.gettrace()
    while reached >= stop_at:
        reached, stop_at = 0, stop_at + 1
        sys.settrace(trace)
        try:
            call()
        finally:
            sys.settrace(before)
        yield stop_at


def test_a_limit_that_ends_at_any_line_leaves_nothing() -> None:
    """While it is set, while it is lifted, and in between."""
    before = state()

    def limited() -> None:
        try:
            with time_limit(5e-4):
                pass
        except OutOfTimeError:
            pass
        # Outside, nothing may come any more.
        wait(0.001)

    lines = 0
    for line in _at_every_line(limited, 1e-3):
        lines = line
        assert state() == before, line
    assert lines > 30


@pytest.mark.full
def test_an_alarm_of_the_caller_at_any_line_comes_once() -> None:
    """And its exception arrives, at the latest just after the block."""
    arrived: list[int] = []
    before = state()

    def limited() -> None:
        signal.signal(signal.SIGALRM, late)
        signal.setitimer(signal.ITIMER_REAL, 1e-3)
        times = 0
        try:
            with time_limit(10.0):
                pass
            wait(0.05)
        except Late:
            times += 1
            wait(0.003)
        arrived.append(times)
        assert signal.getsignal(signal.SIGALRM) is late
        signal.signal(signal.SIGALRM, signal.SIG_DFL)

    for line in _at_every_line(limited, 2e-3):
        assert (state(), arrived[-1]) == (before, 1), line
    assert len(arrived) > 30


@pytest.mark.parametrize("error", [Late, SystemExit, KeyboardInterrupt, ValueError])
def test_what_a_handler_raises_is_raised_again_where_it_was_caught(
    error: type[BaseException],
) -> None:
    raised = error("mine")

    def handler(_number: int, _frame: FrameType | None) -> None:
        raise raised

    before = signal.signal(signal.SIGUSR1, handler)
    went_on = False
    try:
        with pytest.raises(error) as caught, caller_signals():
            with caller_signals(), suppress(BaseException):
                signal.raise_signal(signal.SIGUSR1)
            went_on = True
        assert caught.value is raised
        assert raised.__context__ is None
        assert not went_on
    finally:
        signal.signal(signal.SIGUSR1, before)


class Slowly:
    """Goes slowly where Python ignores exceptions."""

    def __init__(self) -> None:
        weakref.finalize(self, wait, 0.05)


def test_what_python_ignores_is_raised_once_more() -> None:
    """An alarm, of the limit or the caller, that comes in the callback of a weak reference."""
    with pytest.raises(OutOfTimeError), time_limit(0.02):
        Slowly()
        wait(10.0)

    went_on = []

    def ends() -> None:
        Slowly()
        wait(1.0)
        went_on.append(True)

    alarmed(caller_signals()(ends), 0.02)
    assert not went_on


# ---- Around calls

SHORT = rm.scene("paper/fig08").replace(duration=0.2, samples=11)
LONG = rm.scene("paper/fig11").replace(duration=2e4, samples=2_000_001, outputs=["angles", "rates"])
DOP853 = "lagrange/dop853"
METHODS = (
    "lagrange/taylor",
    DOP853,
    "lagrange/radau",
    "lagrange/ode45",
    "printed/ode45",
    "mujoco/rk4",
    "exudyn_tree/rk67",
    "exudyn_tree/dopri5",
    "exudyn_tree/generalized_alpha",
    "exudyn_chain/generalized_alpha",
    "exudyn_chain/newmark_index2",
    "exudyn_chain/extrapolated",
)


def alarmed(call: Callable[[], object], seconds: float, error: type[BaseException] = Late) -> None:
    """As pytest-timeout's method "signal": the call must end by the exception of the handler."""

    def handler(_number: int, _frame: FrameType | None) -> None:
        raise error("of the test")

    signal.signal(signal.SIGALRM, handler)
    signal.setitimer(signal.ITIMER_REAL, seconds)
    try:
        with pytest.raises(error, match="of the test"):
            call()
    finally:
        signal.setitimer(signal.ITIMER_REAL, 0.0)
    assert signal.getsignal(signal.SIGALRM) is handler


# An alarm between the opening of a file and what closes it: the collector does, and says so.
A_FILE_MAY_STAY_OPEN = pytest.mark.filterwarnings("ignore::pytest.PytestUnraisableExceptionWarning")


@pytest.mark.parametrize("error", [Late, pytest.param(TimeoutError, marks=pytest.mark.full),
                                   pytest.param(RuntimeError, marks=pytest.mark.nightly),
                                   pytest.param(ValueError, marks=pytest.mark.nightly),
                                   pytest.param(pytest.fail.Exception, marks=pytest.mark.full)])  # fmt: skip
@pytest.mark.parametrize("timeout", [100.0, float("inf")])
@pytest.mark.parametrize("method", METHODS)
@A_FILE_MAY_STAY_OPEN
def test_the_callers_alarm_passes_through_a_method(
    method: str, timeout: float, error: type[BaseException]
) -> None:
    if not find_method(method).is_installed:
        pytest.skip(f"{method} is not installed")
    # so that the alarm does not come while the engine is loaded, which Python cannot do again
    rm.run(SHORT, method)
    # The printed equations break off after 19 s, which takes longer than this.
    alarmed(lambda: rm.run(LONG, method, timeout=timeout), 0.1, error)


CALLS: dict[str, Callable[[], object]] = {
    "several methods": lambda: rm.run(LONG, ["exudyn_tree/rk67", DOP853]),
    "several methods with a limit": lambda: rm.run(
        LONG, ["exudyn_tree/rk67", DOP853], timeout=100.0
    ),
    "a reference": lambda: rm.run(LONG, DOP853, reference=True, timeout=100.0),
    "a comparison": lambda: rm.compare(
        {"time": np.linspace(0.0, 1e4, 10), "rotor": np.zeros(10)}, LONG
    ),
    "a comparison with a limit": lambda: rm.compare(
        {"time": np.linspace(0.0, 1e4, 10), "rotor": np.zeros(10)}, LONG, timeout=100.0
    ),
    "a sweep": lambda: rm.sweep(
        LONG, {"gravity": [9.0, 9.8]}, methods=["exudyn_tree/rk67"], samples=101
    ),
}


@pytest.mark.parametrize("name", CALLS)
@A_FILE_MAY_STAY_OPEN
def test_the_callers_alarm_passes_through_a_call(name: str) -> None:
    """What has been caught on the way is no result of a method, and no task that is tried again."""
    rm.run(SHORT, ["exudyn_tree/rk67", DOP853])  # loads what is needed
    _compare(10.0)
    alarmed(CALLS[name], 0.3, TimeoutError)


@pytest.mark.full
def test_the_callers_alarm_passes_through_the_examination_of_a_method() -> None:
    alarmed(lambda: examine("exudyn_tree/rk67"), 0.5)


def test_a_limit_that_ends_while_it_is_set_spoils_no_later_call() -> None:
    for i in range(20):
        rm.run(SHORT, "lagrange/dop853", timeout=1e-9 * (i + 1))
        assert rm.run(SHORT, "lagrange/dop853").status == "ok"


# ---- Random calls with random limits

REFUSED = SHORT.replace(hub={"inertia": 3.0})  # by the printed equations


def _compare(timeout: float) -> object:
    return rm.compare({"time": [0.0, 0.1, 0.2], "angles": np.zeros((3, 4))}, SHORT, timeout=timeout)


def _in_thread(timeout: float) -> object:
    with ThreadPoolExecutor(1) as other:
        return other.submit(rm.run, SHORT, DOP853, timeout=timeout).result(60.0)


LIMITED: tuple[Callable[[float], object], ...] = (
    lambda timeout: rm.run(SHORT, DOP853, timeout=timeout),
    lambda timeout: rm.run(SHORT, "exudyn_tree/rk67", timeout=timeout),
    lambda timeout: rm.run(SHORT, "lagrange/ode45", reference=True, timeout=timeout),
    lambda timeout: rm.run(SHORT, [DOP853, "exudyn_tree/rk67"], timeout=timeout),
    lambda timeout: rm.run(REFUSED, "printed/ode45", timeout=timeout),
    _compare,
    _in_thread,
)


def _spoilt(seed: int, calls: int) -> list[tuple[int, float]]:
    """The calls, by kind and limit, after which a call without a limit gives other bits, or
    anything is left."""
    random = np.random.default_rng(seed)
    expected, before = rm.run(SHORT, DOP853), state()
    others = set(threading.enumerate())
    spoilt = []
    for _ in range(calls):
        kind, limit_s = (
            int(random.integers(len(LIMITED))),
            float(10.0 ** random.uniform(-12.0, 0.0)),
        )
        with suppress(RotorError):  # the refused scene; a comparison without a reference
            LIMITED[kind](limit_s)
        run = rm.run(SHORT, DOP853)
        is_same = run.status == "ok" and all(
            np.array_equal(run[name], expected[name], equal_nan=True) for name in run.quantities
        )
        is_same = (
            is_same
            and np.array_equal(run.angles, expected.angles)
            and np.array_equal(run.rates, expected.rates)
        )
        if not is_same or state() != before or set(threading.enumerate()) != others:
            spoilt.append((kind, limit_s))
    return spoilt


@pytest.mark.full
def test_after_random_calls_with_random_limits_a_call_gives_the_same_bits() -> None:
    assert not _spoilt(seed=1, calls=25)


@pytest.mark.nightly
def test_after_a_thousand_random_calls_with_random_limits_a_call_gives_the_same_bits() -> None:
    assert not _spoilt(seed=2, calls=1000)
