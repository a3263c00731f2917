"""Processes that answer: each task's end is its own, whoever dies, hangs or is ended beside it."""

from __future__ import annotations

import os
import signal
import time
from collections.abc import Iterator
from concurrent.futures import CancelledError
from contextlib import contextmanager
from pathlib import Path

import pytest

from rotor_mbs.runner.pool import ProcessPool, cause_of
from rotor_mbs.runner.servant import NoAnswerError

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
        assert all(pool.submit(_pid, None, _LONG_S).result() != os.getpid() for _ in range(4))


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
        assert pool.submit(_pid, None, 1e300).result() != os.getpid()


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
