"""Worker processes: a task's end is its own, whichever other process dies, hangs or is ended."""

from __future__ import annotations

import gc
import os
import resource
import signal
import subprocess
import sys
import threading
import time
from collections.abc import Callable, Iterable, Iterator
from concurrent.futures import ThreadPoolExecutor
from contextlib import contextmanager
from functools import partial
from importlib import import_module
from pathlib import Path
from typing import Any

import pytest

from rotor_mbs.errors import ResourceError
from rotor_mbs.processes.pool import SerialPool, TaskEnd, TaskPool, WorkerPool, run_in
from rotor_mbs.processes.worker import TaskLostError, Worker, delayed_interrupts

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


# An interrupt at the worst moment: the thread that starts processes runs, and its executor does not
# know it yet.
_INTERRUPTED_START = """
import signal, threading
from rotor_mbs.processes.worker import Worker

start = threading.Thread.start

def start_and_interrupt(thread):
    start(thread)
    threading.Thread.start = start
    signal.raise_signal(signal.SIGINT)

threading.Thread.start = start_and_interrupt
try:
    Worker().start()
except KeyboardInterrupt:
    print("interrupted")
"""


def test_an_interrupt_while_a_process_is_started_leaves_no_thread_to_wait_for() -> None:
    ended = subprocess.run(
        [sys.executable, "-c", _INTERRUPTED_START],
        capture_output=True,
        text=True,
        timeout=_LONG_S,
        check=False,
    )
    assert (ended.returncode, ended.stdout, ended.stderr) == (0, "interrupted\n", "")


@pytest.mark.skipif(not Path("/proc/self/status").is_file(), reason="needs /proc")
def test_a_worker_ignores_what_its_parent_ignores() -> None:
    """As under nohup: a terminal that is closed must not end the workers."""
    before = signal.signal(signal.SIGHUP, signal.SIG_IGN)
    try:
        with delayed_interrupts():
            ignored = subprocess.run(
                [sys.executable, "-c", "import signal; print(signal.getsignal(signal.SIGHUP))"],
                capture_output=True,
                text=True,
                check=True,
            )
        assert ignored.stdout.strip() == str(signal.SIG_IGN)
        assert signal.getsignal(signal.SIGHUP) == signal.SIG_IGN
    finally:
        signal.signal(signal.SIGHUP, before)


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
            with pytest.raises((TaskLostError, ResourceError), match=r"died|could not be started"):
                pool.submit(_pid, None, _LONG_S).result()  # where its end is not yet known
            with pytest.raises(
                ResourceError,
                match=(
                    r"a process could not be started: "
                    r".*open files"
                ),
            ):
                pool.submit(_pid, None, _LONG_S).result()
        assert pool.submit(_pid, None, _LONG_S).result() != pid


def test_a_system_without_room_for_a_timer_costs_the_tasks_of_that_time(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    def refuse(*_: object) -> None:
        raise RuntimeError("can't start new thread")

    with WorkerPool(1) as pool:
        with monkeypatch.context() as patched:
            patched.setattr(threading.Timer, "start", refuse)
            with pytest.raises(ResourceError, match="not enough threads: can't start new thread"):
                pool.submit(_pid, None, _LONG_S).result()
        assert pool.submit(_pid, None, _LONG_S).result() != os.getpid()


def test_a_system_without_room_for_a_thread_is_told(monkeypatch: pytest.MonkeyPatch) -> None:
    def refuse(*_: object) -> None:
        raise RuntimeError("can't start new thread")

    monkeypatch.setattr("concurrent.futures.thread.ThreadPoolExecutor.submit", refuse)
    told = "not enough processes or threads: can't start new thread"
    with pytest.raises(ResourceError, match=told), WorkerPool(1) as pool:
        pool.submit(_pid, None, _LONG_S)
    with pytest.raises(ResourceError, match=told):
        WorkerPool(1, gc.collect)


def _ends(
    work: Callable[[Any], Any], tasks: Iterable[Any], pool: TaskPool
) -> list[TaskEnd[Any, Any]]:
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


# Endless, in Python or in C code that keeps the interpreter's lock, after the number of the
# process.
_BUSY = {
    "loop": "import os; os.write(2, b'%d\\n' % os.getpid())\nwhile True: pass",
    "C code": "import os; os.write(2, b'%d\\n' % os.getpid()); sum(range(10**13))",
}
_BUSY_PROGRAM = """
from rotor_mbs.processes.pool import WorkerPool
with WorkerPool(2) as pool:
    tasks = [pool.submit(exec, {!r}, 90) for _ in range(4)]
    tasks[0].result()
"""


@pytest.mark.parametrize("kind", _BUSY)
def test_a_time_limit_ends_whatever_a_task_does(kind: str) -> None:
    with WorkerPool(1) as pool:
        pid = pool.submit(_pid, None, _LONG_S).result()
        lost = pool.submit(exec, _BUSY[kind], 0.2).exception(_LONG_S)
        assert isinstance(lost, TaskLostError)
        assert (lost.failure, str(lost)) == ("timed_out", "ended after 0.2 s")
        assert pool.submit(_pid, None, _LONG_S).result() != pid


@pytest.mark.skipif(sys.platform != "linux", reason="only Linux ends a process with a thread")
def test_a_process_outlives_the_thread_that_first_used_it() -> None:
    with Worker() as worker:
        pids = []
        for _ in range(2):
            with ThreadPoolExecutor(1) as thread:
                pids.append(thread.submit(worker.run, _pid, None, _LONG_S).result())
            time.sleep(0.1)  # until the system has ended the thread
    assert pids[0] == pids[1]


def _fork_and_die(file: Path) -> None:
    pid = os.fork()
    if pid == 0:
        time.sleep(2.0 * _LONG_S)
    file.write_text(str(pid))
    os._exit(3)


@pytest.mark.skipif(not hasattr(os, "fork"), reason="no fork here")
# multi-threaded, says Python 3.12
@pytest.mark.filterwarnings("ignore:This process:DeprecationWarning")
def test_a_process_that_a_task_forked_keeps_nobody_waiting(tmp_path: Path) -> None:
    """It has the pipes of its parent, whose end would not be seen."""
    with WorkerPool(1) as pool:
        lost = pool.submit(_fork_and_die, tmp_path / "pid", _LONG_S).exception(0.5 * _LONG_S)
    os.kill(int((tmp_path / "pid").read_text()), signal.SIGKILL)
    assert str(lost) == "its process died (exit code 3)"


@pytest.mark.skipif(not Path("/proc/self").exists(), reason="looks for processes in /proc")
@pytest.mark.parametrize(
    ("kind", "signals"),
    [
        ("loop", [signal.SIGINT]),
        pytest.param("loop", [signal.SIGINT, signal.SIGINT], marks=pytest.mark.full),
        pytest.param("loop", [signal.SIGKILL], marks=pytest.mark.full),
        ("C code", [signal.SIGKILL]),
    ],
)
def test_workers_end_with_their_parent(
    tmp_path: Path, kind: str, signals: list[signal.Signals]
) -> None:
    """Interrupted once or twice, or killed: no worker goes on."""
    program = tmp_path / "program.py"
    program.write_text(_BUSY_PROGRAM.format(_BUSY[kind]))
    with subprocess.Popen(
        [sys.executable, str(program)], stderr=subprocess.PIPE, text=True
    ) as process:
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
    with pytest.raises(
        ResourceError, match="stopped after 10 failures in a row: not enough memory, files"
    ):
        _ends(_lacks_files, tasks, SerialPool())
    assert next(tasks) < 20


def test_a_task_that_exits_ends_no_process() -> None:
    (end,) = _ends(_raise, [SystemExit(3)], SerialPool())
    assert end.failure == "error"
    assert "SystemExit: 3" in end.message


def _answers_of(folder: Path, script: str, *, is_input: bool = False) -> list[str]:
    """Run a script, by its path or from standard input, and return the lines that it prints."""
    (folder / "script.py").write_text(script)
    command = [sys.executable, "-" if is_input else "script.py"]
    given = script if is_input else ""
    ended = subprocess.run(
        command, input=given, capture_output=True, text=True, cwd=folder, timeout=_LONG_S
    )
    assert ended.stderr == ""
    return ended.stdout.splitlines()


_SCRIPT = """
from rotor_mbs.processes.pool import local_pool

print("begins")
with local_pool(1) as pool:
    print(pool.submit(abs, -3, 60.0).result())
"""


@pytest.mark.parametrize("is_input", [False, True], ids=["file", "standard input"])
def test_a_worker_does_not_run_the_script(tmp_path: Path, is_input: bool) -> None:
    """A script needs no guard."""
    assert _answers_of(tmp_path, _SCRIPT, is_input=is_input) == ["begins", "3"]


def test_a_working_folder_that_is_gone_is_not_needed(tmp_path: Path) -> None:
    (tmp_path / "gone").mkdir()
    program = """
import os
os.chdir("gone")
os.rmdir("../gone")
from rotor_mbs.processes.pool import WorkerPool
with WorkerPool(1) as pool:
    print(pool.submit(abs, -3, 60.0).result())
"""
    assert _answers_of(tmp_path, program) == ["3"]


def _end_at_start() -> None:
    os._exit(4)


def test_a_process_that_ends_at_its_start_is_the_systems_fault_and_names_a_memory_limit() -> None:
    reason = (
        r"could not be started: it ended at once with exit code 4 under a memory limit \(ulimit "
        r"-v\) of 67108864 MiB"
    )
    with (
        _limited(resource.RLIMIT_AS, 1 << 46),
        WorkerPool(1, _end_at_start) as pool,
        pytest.raises(ResourceError, match=reason),
    ):
        pool.submit(_pid, None, _LONG_S).result()


@contextmanager
def _interrupted(error: BaseException, after_s: float = 0.2) -> Iterator[None]:
    """A handler of SIGALRM, as a user's own time limit has one, that raises an error in this
    process."""

    def raise_error(*_: object) -> None:
        raise error

    before = signal.signal(signal.SIGALRM, raise_error)
    signal.setitimer(signal.ITIMER_REAL, after_s)
    try:
        yield
    finally:
        signal.setitimer(signal.ITIMER_REAL, 0.0)
        signal.signal(signal.SIGALRM, before)


@pytest.mark.skipif(not hasattr(signal, "SIGALRM"), reason="no alarms here")
@pytest.mark.parametrize(
    "error", [TimeoutError("mine"), MemoryError("mine"), ConnectionResetError("mine")]
)
def test_what_the_caller_raises_while_it_waits_is_its_own(error: Exception) -> None:
    with Worker() as worker:
        pid = worker.run(_pid, None, _LONG_S)
        with pytest.raises(type(error), match="mine"), _interrupted(error):
            worker.run(time.sleep, _LONG_S, _LONG_S)
        assert worker.run(_pid, None, _LONG_S) != pid
        worker.end_process()
        with (
            pytest.raises(type(error), match="mine"),
            Worker(partial(time.sleep, _LONG_S)) as slow,
            _interrupted(error),
        ):
            slow.run(_pid, None, _LONG_S)


def test_a_set_up_that_takes_too_long_is_told() -> None:
    told = r"could not be started: it was not ready after 0\.2 s"
    with (
        Worker(partial(time.sleep, _LONG_S), set_up_limit_s=0.2) as worker,
        pytest.raises(ResourceError, match=told),
    ):
        worker.run(_pid, None, _LONG_S)


def test_threads_take_turns() -> None:
    with Worker() as worker, ThreadPoolExecutor(4) as threads:
        tasks = [threads.submit(worker.run, abs, -number, _LONG_S) for number in range(40)]
        assert [task.result() for task in tasks] == [*range(40)]


@pytest.mark.skipif(not hasattr(os, "fork"), reason="no fork here")
@pytest.mark.filterwarnings("ignore:This process:DeprecationWarning")
def test_a_forked_process_has_a_worker_of_its_own(tmp_path: Path) -> None:
    """Also where it is forked while another thread waits for an answer, with the locks held."""
    with Worker() as worker, ThreadPoolExecutor(1) as thread:
        pid = worker.run(_pid, None, _LONG_S)
        waits = thread.submit(worker.run, time.sleep, 1.0, _LONG_S)
        while not worker._turn.locked():
            time.sleep(0.01)
        child = os.fork()
        if child == 0:
            try:
                (tmp_path / "pid").write_text(str(worker.run(_pid, None, _LONG_S)))
            finally:
                os._exit(0)
        os.waitpid(child, 0)
        waits.result()
        assert worker.run(_pid, None, _LONG_S) == pid
    assert (tmp_path / "pid").read_text() not in ("", str(pid))


def _folder(_: object) -> str:
    return str(Path.cwd())


def test_a_function_runs_in_the_folder_of_its_caller(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    with Worker() as worker:
        for name in ("first", "second"):
            (tmp_path / name).mkdir()
            monkeypatch.chdir(tmp_path / name)
            assert worker.run(_folder, None, _LONG_S) == str(tmp_path / name)


def test_variables_of_the_environment_are_defaults_of_the_process(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    names = ("ROTOR_MBS_FIRST", "ROTOR_MBS_SECOND")
    with Worker(environment=dict.fromkeys(names, "default")) as worker:
        monkeypatch.setenv(names[1], "mine")
        assert [worker.run(os.getenv, name, _LONG_S) for name in names] == ["default", "mine"]
    assert names[0] not in os.environ
