"""Worker processes: a task's end is its own, whichever other process dies, hangs or is ended."""

from __future__ import annotations

import gc
import os
import resource
import signal
import subprocess
import sys
import time
from collections.abc import Callable, Iterable, Iterator
from contextlib import contextmanager
from functools import partial
from importlib import import_module
from pathlib import Path
from typing import Any

import pytest

from rotor_mbs.errors import ResourceError
from rotor_mbs.runs import pool as pool_module
from rotor_mbs.runs.pool import Finished, SerialPool, TaskLostError, TaskPool, WorkerPool, run_in

# Beyond any start of a process on a busy machine.
_LONG_S = 60.0


def _pid(_: object) -> int:
    return os.getpid()


def _raise(error: BaseException) -> None:
    raise error


def _end(_: object) -> None:
    os._exit(3)


@contextmanager
def _limited(kind: int, soft: int) -> Iterator[None]:
    """A limit of the system on this process and on those that it starts."""
    limits = resource.getrlimit(kind)
    resource.setrlimit(kind, (soft, limits[1]))
    try:
        yield
    finally:
        resource.setrlimit(kind, limits)


def test_a_time_out_under_a_memory_limit_is_no_end_of_a_task() -> None:
    """What lacks memory may wait for it; a limit far above what is used bounds nothing here."""
    with _limited(resource.RLIMIT_AS, 1 << 46), WorkerPool(1) as pool:
        end = pool.submit(time.sleep, _LONG_S, 0.2).exception()
    assert isinstance(end, TaskLostError)
    assert end.failure == "worker_died"
    assert str(end) == "ended after 0.2 s under a memory limit (ulimit -v) of 67108864 MiB"


class _Unusual(Exception):
    """Is pickled, but not made of what it was pickled to."""

    def __init__(self, first: str, second: str) -> None:
        super().__init__(f"{first} and {second}")


class _FailsToUnpickle:
    def __reduce__(self) -> tuple[Any, ...]:
        return _raise, (ZeroDivisionError("by nothing"),)


def _raise_unusual(_: object) -> None:
    raise _Unusual("this", "that")


def _function(_: object) -> object:
    return lambda: None


@pytest.mark.parametrize(
    ("work", "task", "error", "text"),
    [
        (_raise, ZeroDivisionError("by nothing"), ZeroDivisionError, "by nothing"),
        (_raise, SystemExit(3), RuntimeError, "SystemExit: 3"),
        (_raise_unusual, None, RuntimeError, "_Unusual: this and that"),
        (_pid, _FailsToUnpickle(), ZeroDivisionError, "by nothing"),
        (_function, None, Exception, "pickle|local object"),  # the second one from Python 3.13 on
    ],
)
def test_an_error_of_a_task_arrives_and_its_process_goes_on(
    work: Callable[[object], object], task: object, error: type[Exception], text: str
) -> None:
    with WorkerPool(1) as pool:
        pid = pool.submit(_pid, None, _LONG_S).result()
        with pytest.raises(error, match=text):
            pool.submit(work, task, _LONG_S).result()
        assert pool.submit(_pid, None, _LONG_S).result() == pid


_state: list[int] = []


def _add_to_state(number: int) -> list[int]:
    _state.append(number)
    return _state


def _cores(_: object) -> set[int]:
    return os.sched_getaffinity(0)


@pytest.mark.skipif(not hasattr(os, "sched_getaffinity"), reason="no process affinity here")
def test_one_process_on_one_core_keeps_its_state() -> None:
    core = max(os.sched_getaffinity(0))
    with WorkerPool(1, partial(_add_to_state, 5), core) as pool:
        assert pool.submit(_cores, None, _LONG_S).result() == {core}
        pool.submit(_add_to_state, 6, _LONG_S).result()
        assert pool.submit(_add_to_state, 7, _LONG_S).result() == [5, 6, 7]


def test_an_error_of_the_initializer_is_the_error_of_its_tasks() -> None:
    with (
        WorkerPool(1, partial(import_module, "no_such_module")) as pool,
        pytest.raises(ModuleNotFoundError, match="no_such"),
    ):
        pool.submit(_pid, None, _LONG_S).result()


def test_a_system_without_room_for_a_process_costs_the_tasks_of_that_time() -> None:
    with WorkerPool(1) as pool:
        pid = pool.submit(_pid, None, _LONG_S).result()
        with _limited(resource.RLIMIT_NOFILE, 3):
            os.kill(pid, signal.SIGKILL)
            for _ in range(2):
                with pytest.raises(TaskLostError, match="died") as refused:
                    pool.submit(_pid, None, _LONG_S).result()
                assert refused.value.failure == "worker_died"
        assert pool.submit(_pid, None, _LONG_S).result() != pid


def test_a_process_that_lacks_a_thread_beside_it_is_started_anew(monkeypatch: pytest.MonkeyPatch) -> None:
    from pebble.pool import process

    launch, refused = process.launch_thread, []

    def launch_but_once(name: str | None, loop: Callable[..., None], *more: object) -> object:
        if loop is process.pool_manager_loop and not refused:
            refused.append(loop)
            raise RuntimeError("can't start new thread")
        return launch(name, loop, *more)

    monkeypatch.setattr(process, "launch_thread", launch_but_once)
    with WorkerPool(1, gc.collect) as pool:  # which starts at once
        assert pool.submit(_pid, None, _LONG_S).result(_LONG_S) != os.getpid()
    assert refused


def test_a_system_without_room_for_a_thread_is_told(monkeypatch: pytest.MonkeyPatch) -> None:
    def refuse(*_: object) -> None:
        raise RuntimeError("can't start new thread")

    monkeypatch.setattr("concurrent.futures.thread.ThreadPoolExecutor.submit", refuse)
    told = "not enough processes or threads: can't start new thread"
    with pytest.raises(ResourceError, match=told), WorkerPool(1) as pool:
        pool.submit(_pid, None, _LONG_S)
    with pytest.raises(ResourceError, match=told):
        WorkerPool(1, gc.collect)


def _ends(work: Callable[[Any], Any], tasks: Iterable[Any], pool: TaskPool) -> list[Finished[Any, Any]]:
    with pool:
        return list(run_in(pool, work, tasks, _LONG_S))


def _die_once(folder: str) -> str:
    marks = list(Path(folder).iterdir())
    (Path(folder) / f"{len(marks)}").touch()
    if not marks:
        os._exit(1)
    return "done"


def test_a_task_whose_worker_died_is_tried_once_more(tmp_path: Path) -> None:
    ends = _ends(_die_once, [str(tmp_path)], WorkerPool(1))
    assert [(end.value, end.failure) for end in ends] == [("done", "")]
    ends = _ends(_end, [None], WorkerPool(1))
    assert [(end.failure, end.message) for end in ends] == [
        ("worker_died", "its process died (exit code 3), also when it was retried alone")
    ]


@pytest.mark.full
@pytest.mark.skipif(not Path("/proc/self/fd").exists(), reason="counts open files in /proc")
def test_dead_processes_leave_no_open_files() -> None:
    _ends(_pid, [0], WorkerPool(1))  # opens what stays open
    before = len(list(Path("/proc/self/fd").iterdir()))
    gc.disable()
    try:
        ended = _ends(_end, range(4), WorkerPool(2))
        assert len(list(Path("/proc/self/fd").iterdir())) <= before
    finally:
        gc.enable()
    assert [end.failure for end in ended] == ["worker_died"] * 4


_BUSY_PROGRAM = r"""
import os, time
from rotor_mbs.runs.pool import WorkerPool

def busy(_):
    os.write(2, b"%d\n" % os.getpid())  # in one piece: both workers write here
    end = time.monotonic() + 60
    while time.monotonic() < end:
        pass

if __name__ == "__main__":
    with WorkerPool(2) as pool:
        tasks = [pool.submit(busy, None, 90) for _ in range(4)]
        tasks[0].result()
"""


@pytest.mark.skipif(not Path("/proc/self").exists(), reason="looks for processes in /proc")
@pytest.mark.parametrize(
    "signals",
    [
        [signal.SIGINT],
        pytest.param([signal.SIGINT, signal.SIGINT], marks=pytest.mark.full),
        pytest.param([signal.SIGKILL], marks=pytest.mark.full),
    ],
)
def test_workers_end_with_their_parent(tmp_path: Path, signals: list[signal.Signals]) -> None:
    """Interrupted once or twice, or killed: no worker goes on."""
    program = tmp_path / "program.py"
    program.write_text(_BUSY_PROGRAM)
    with subprocess.Popen([sys.executable, str(program)], stderr=subprocess.PIPE, text=True) as process:
        assert process.stderr is not None
        pids = [int(process.stderr.readline()) for _ in range(2)]
        for number in signals:
            process.send_signal(number)
            time.sleep(0.05)
        process.wait(20.0)
        process.stderr.read()
    end = time.monotonic() + 20.0
    while any(Path(f"/proc/{pid}").exists() for pid in pids) and time.monotonic() < end:
        time.sleep(0.05)
    assert not any(Path(f"/proc/{pid}").exists() for pid in pids)


def _lacks_files(_: int) -> int:
    raise OSError(24, "Too many open files")


def test_a_machine_without_room_is_given_up_after_some_tasks_in_a_row() -> None:
    """Thousands of tasks would each be tried alone, a second each."""
    tasks = iter(range(10_000))
    with pytest.raises(ResourceError, match="stopped after 10 failures in a row: not enough memory, files"):
        _ends(_lacks_files, tasks, SerialPool())
    assert next(tasks) < 20


def test_a_task_that_exits_ends_no_process() -> None:
    (end,) = _ends(_raise, [SystemExit(3)], SerialPool())
    assert end.failure == "error"
    assert "SystemExit: 3" in end.message


_SCRIPT = """
from rotor_mbs.errors import RotorError
from rotor_mbs.runs.pool import local_pool

def main():
    with local_pool(1) as pool:
        try:
            pool.submit(abs, -3, 60.0).result()
        except RotorError as exc:
            print(exc)
"""
_GUARDED = _SCRIPT + 'if __name__ == "__main__":\n    main()\n'


def _answer_of(command: list[str], script: str = "", cwd: Path | None = None) -> str:
    ended = subprocess.run([sys.executable, *command], input=script, capture_output=True, text=True, cwd=cwd)
    return ended.stdout.strip()


def test_a_script_from_standard_input_is_named_where_a_worker_cannot_run_it() -> None:
    answer = _answer_of(["-"], _GUARDED)
    assert "the script <stdin> is no file that it can read; allowed: a script in a file, or workers=0" in answer
    assert "if __name__" not in answer


def test_a_script_without_a_guard_is_asked_for_one(tmp_path: Path) -> None:
    (tmp_path / "script.py").write_text(_SCRIPT + "main()\n")
    assert 'in a script, the call belongs under `if __name__ == "__main__":`' in _answer_of(["script.py"], cwd=tmp_path)
    (tmp_path / "script.py").write_text(_GUARDED)
    assert _answer_of(["script.py"], cwd=tmp_path) == ""


def test_a_working_folder_that_is_gone_is_named(tmp_path: Path) -> None:
    (tmp_path / "script.py").write_text(_GUARDED)
    (tmp_path / "gone").mkdir()
    command = 'rmdir ../gone; exec "$@"'  # in the folder that goes
    ended = subprocess.run(
        ["sh", "-c", command, "sh", sys.executable, str(tmp_path / "script.py")],
        cwd=tmp_path / "gone",
        capture_output=True,
        text=True,
    )
    assert "its process died (the working folder is gone)" in ended.stdout
    assert "if __name__" not in ended.stdout


def test_a_memory_limit_is_named_where_a_worker_dies_at_its_start(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(sys.modules["__main__"], "__file__", None, raising=False)
    with _limited(resource.RLIMIT_AS, 1 << 46):
        reason = pool_module._reason_of_death(RuntimeError("All workers expired"), None)
    assert reason == "All workers expired; under a memory limit (ulimit -v) of 67108864 MiB"
