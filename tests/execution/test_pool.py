"""Processes that answer: each task's end is its own, whoever dies, hangs or is ended beside it."""

from __future__ import annotations

import errno
import gc
import os
import signal
import subprocess
import sys
import time
from collections.abc import Iterator
from concurrent.futures import CancelledError
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import pytest

from rotor_mbs.execution import servant
from rotor_mbs.execution.pool import ProcessPool, cause_of, run_tasks
from rotor_mbs.execution.servant import NoAnswerError, Servant

# Beyond any start of a process on a busy machine.
_LONG_S = 60.0


@contextmanager
def _pool(workers: int, *, in_threads: bool) -> Iterator[ProcessPool]:
    pool = ProcessPool(workers)
    pool.begin(in_threads=in_threads)
    try:
        yield pool
    finally:
        pool.shutdown(cancel_futures=True)


def _meet(folder: str) -> int:
    """Waits until another task has come here, too: its process."""
    place = Path(folder)
    (place / f"{os.getpid()}-{time.monotonic_ns()}").touch()
    end = time.monotonic() + _LONG_S
    while len(list(place.iterdir())) < 2 and time.monotonic() < end:
        time.sleep(0.01)
    assert len(list(place.iterdir())) == 2, "nobody came"
    return os.getpid()


def _die(folder: str) -> None:
    _meet(folder)
    os.kill(os.getpid(), signal.SIGKILL)


def _meet_and_sleep(folder: str) -> None:
    _meet(folder)
    time.sleep(_LONG_S)


def _pid(_: object) -> int:
    return os.getpid()


def _raise(error: Exception) -> None:
    raise error


@pytest.mark.parametrize("in_threads", [False, True])
def test_two_tasks_at_once_are_in_two_processes_or_in_two_threads_of_one(tmp_path: Path, in_threads: bool) -> None:
    with _pool(2, in_threads=in_threads) as pool:
        pids = [pool.submit(_meet, str(tmp_path), _LONG_S) for _ in range(2)]
        found = {future.result() for future in pids}
    assert len(found) == (1 if in_threads else 2)
    assert os.getpid() not in found


@pytest.mark.parametrize("in_threads", [False, True])
def test_who_dies_takes_those_of_its_process_and_the_next_find_another(tmp_path: Path, in_threads: bool) -> None:
    with _pool(2, in_threads=in_threads) as pool:
        futures = [pool.submit(_die, str(tmp_path), _LONG_S), pool.submit(_meet_and_sleep, str(tmp_path), 2.0)]
        causes = [cause_of(error) for future in futures if (error := future.exception()) is not None]
        assert causes == (["worker_died"] * 2 if in_threads else ["worker_died", "timed_out"])
        dead = {int(file.name.split("-")[0]) for file in tmp_path.iterdir()}
        assert not dead & {pool.submit(_pid, None, _LONG_S).result() for _ in range(4)}


def test_a_late_task_is_ended_and_told_so(tmp_path: Path) -> None:
    with _pool(2, in_threads=True) as pool:
        late = pool.submit(_meet_and_sleep, str(tmp_path), 0.5)
        beside = pool.submit(_meet_and_sleep, str(tmp_path), _LONG_S)
        with pytest.raises(NoAnswerError, match=r"ended after 0\.5 s") as ended:
            late.result()
        assert ended.value.timed_out
        with pytest.raises(NoAnswerError, match="exit code -9"):
            beside.result()


def test_a_process_killed_while_it_waits_fails_one_task_and_is_replaced() -> None:
    with _pool(1, in_threads=False) as pool:
        pid = pool.submit(_pid, None, _LONG_S).result()
        os.kill(pid, signal.SIGKILL)
        with pytest.raises(NoAnswerError, match="its process died"):
            pool.submit(_pid, None, _LONG_S).result()
        assert pool.submit(_pid, None, _LONG_S).result() != pid


def test_what_a_task_raises_arrives_and_its_process_goes_on() -> None:
    with _pool(1, in_threads=False) as pool:
        pid = pool.submit(_pid, None, _LONG_S).result()
        with pytest.raises(ZeroDivisionError, match="by nothing"):
            pool.submit(_raise, ZeroDivisionError("by nothing"), _LONG_S).result()
        assert pool.submit(_pid, None, _LONG_S).result() == pid


def test_a_limit_beyond_what_a_system_can_wait_is_none() -> None:
    with _pool(1, in_threads=False) as pool:
        assert pool.submit(_pid, None, 1e300).result() > 0


def test_stopped_it_ends_what_it_does_and_begins_nothing_more(tmp_path: Path) -> None:
    pool = ProcessPool(2)
    pool.begin(in_threads=True)
    at_work = [pool.submit(_meet_and_sleep, str(tmp_path), _LONG_S) for _ in range(2)]
    waiting = pool.submit(_meet_and_sleep, str(tmp_path), _LONG_S)
    while len(list(tmp_path.iterdir())) < 2:
        time.sleep(0.01)
    start = time.monotonic()
    pool.shutdown(cancel_futures=True)
    assert time.monotonic() - start < 0.5 * _LONG_S
    assert all(isinstance(future.exception(), NoAnswerError) for future in at_work)
    with pytest.raises(CancelledError):
        waiting.result()


class _Odd(Exception):
    """Is pickled, but not made of what it was pickled to."""

    def __init__(self, one: str, other: str) -> None:
        super().__init__(f"{one} and {other}")


class _NotMadeHere:
    def __reduce__(self) -> tuple[Any, ...]:
        return _raise, (ZeroDivisionError("by nothing"),)


def test_what_cannot_be_sent_as_it_is_is_told_in_words() -> None:
    with _pool(1, in_threads=False) as pool:
        pid = pool.submit(_pid, None, _LONG_S).result()
        with pytest.raises(RuntimeError, match="_Odd: this and that"):
            pool.submit(_raise_odd, None, _LONG_S).result()
        with pytest.raises(RuntimeError, match="ZeroDivisionError: by nothing"):
            pool.submit(_pid, _NotMadeHere(), _LONG_S).result()
        with pytest.raises(RuntimeError, match="pickle"):
            pool.submit(_function, None, _LONG_S).result()
        assert pool.submit(_pid, None, _LONG_S).result() == pid


def _raise_odd(_: object) -> None:
    raise _Odd("this", "that")


def _function(_: object) -> object:
    return lambda: None


def test_code_that_cannot_be_loaded_in_advance_is_the_first_task_s_affair() -> None:
    pool = ProcessPool(1, "no_such_module:prepare")
    try:
        assert pool.submit(_pid, None, _LONG_S).result() > 0
    finally:
        pool.shutdown(cancel_futures=True)


def test_a_system_without_room_for_a_process_costs_the_tasks_of_that_time(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(servant, "_AGAIN_S", 0.01)
    start = Servant._start
    with _pool(1, in_threads=False) as pool:
        os.kill(pool.submit(_pid, None, _LONG_S).result(), signal.SIGKILL)
        monkeypatch.setattr(Servant, "_start", _no_room)
        with pytest.raises(NoAnswerError, match="its process died"):
            pool.submit(_pid, None, _LONG_S).result()
        with pytest.raises(NoAnswerError, match="could not be started") as refused:
            pool.submit(_pid, None, _LONG_S).result()
        assert not refused.value.timed_out
        monkeypatch.setattr(Servant, "_start", start)
        assert pool.submit(_pid, None, _LONG_S).result() > 0


def _no_room(_: Servant) -> None:
    raise OSError(errno.ENOMEM, os.strerror(errno.ENOMEM))


@pytest.mark.skipif(not Path("/proc/self/fd").exists(), reason="counts open files in /proc")
def test_the_dead_leave_no_open_files() -> None:
    list(run_tasks(_pid, [0], 1, _LONG_S))  # opens what stays open
    before = len(list(Path("/proc/self/fd").iterdir()))
    gc.disable()
    try:
        ended = list(run_tasks(_end, list(range(6)), 2, _LONG_S))
        assert len(list(Path("/proc/self/fd").iterdir())) <= before
    finally:
        gc.enable()
    assert [end.failure for end in ended] == ["worker_died"] * 6


def _end(_: int) -> None:
    os._exit(3)


_LONG_TASKS = """
import sys, time
from rotor_mbs.execution.pool import ProcessPool
from rotor_mbs.execution.servant import Servant

def slowly(self, kill=Servant.kill):
    time.sleep(0.3)
    kill(self)

Servant.kill = slowly
if __name__ == "__main__":
    pool = ProcessPool(2)
    try:
        tasks = [pool.submit(time.sleep, 60.0, 90.0) for _ in range(4)]
        time.sleep(0.5)
        print("at work", flush=True)
        tasks[0].result()
    finally:
        pool.shutdown(cancel_futures=True)
"""


def test_a_second_interrupt_does_not_keep_it_from_its_end() -> None:
    with subprocess.Popen(
        [sys.executable, "-c", _LONG_TASKS], stdout=subprocess.PIPE, stderr=subprocess.PIPE
    ) as process:
        assert process.stdout is not None
        process.stdout.readline()
        process.send_signal(signal.SIGINT)
        time.sleep(0.2)  # it is ending the first process
        process.send_signal(signal.SIGINT)
        process.communicate(timeout=20.0)  # the tasks take a minute
