"""Tasks in parallel processes of their own, each with a time limit; one that dies or hangs takes no other with it.

Knows nothing of scenes, models or files: it is given a picklable function and its arguments.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import Executor, Future, ThreadPoolExecutor, as_completed
from dataclasses import dataclass
from queue import SimpleQueue
from typing import Any, Generic, TypeVar

from rotor_mbs.execution.interrupts import interrupts_put_off
from rotor_mbs.execution.servant import NoAnswerError, Servant
from rotor_mbs.execution.worker import Worker

T = TypeVar("T")
R = TypeVar("R")


# Tasks that a process may have side by side.
_HANDS = 2


class ProcessPool(Executor):
    """`submit(work, task, timeout_s)` gives a future: the work's result or what it raised, or a NoAnswerError.

    Half of the processes start at once; `begin` says what the other half of the workers are.

    prepare   "module:name", a function that each process calls first, while this one goes on
    """

    def __init__(self, workers: int, prepare: str = "") -> None:
        self._workers, self._prepare = workers, prepare
        self._threads = ThreadPoolExecutor(workers)
        self._servants: list[Servant] = []
        self._free: SimpleQueue[tuple[Servant, int]] = SimpleQueue()
        self._has_begun = False
        self._add(-(-workers // _HANDS))

    def begin(self, *, in_threads: bool) -> None:
        """Before the first task: whether two may share a process, each in its thread, as work does well that leaves
        the interpreter's lock alone and needs no main thread. It saves the other process's start; should one task kill
        the process, both are lost."""
        self._has_begun = True
        hands = range(_HANDS) if in_threads else range(1)
        self._add(0 if in_threads else self._workers - len(self._servants))
        for hand in [(servant, hand) for hand in hands for servant in self._servants][: self._workers]:
            self._free.put(hand)

    def submit(self, work: Callable[..., Any], /, *args: Any, **_: Any) -> Future[Any]:
        if not self._has_begun:
            self.begin(in_threads=False)
        task, timeout_s = args
        return self._threads.submit(self._answer, work, task, timeout_s)

    def shutdown(self, wait: bool = True, *, cancel_futures: bool = False) -> None:
        """Ends the processes: now with cancel_futures, else when all is done, if that is waited for."""
        if not cancel_futures:
            self._threads.shutdown(wait)
        if wait or cancel_futures:
            with interrupts_put_off():
                self._threads.shutdown(wait=False, cancel_futures=True)
                for servant in self._servants:
                    servant.kill()
                for servant in self._servants:
                    servant.close()
                self._threads.shutdown(wait)

    def _add(self, processes: int) -> None:
        for _ in range(processes):
            servant = Servant(Worker(self._prepare), hands=min(_HANDS, self._workers))
            servant.start()
            self._servants.append(servant)

    def _answer(self, work: Callable[[T], R], task: T, timeout_s: float) -> R:
        servant, hand = self._free.get()
        try:
            result, error = servant.ask((work, task), timeout_s, hand)
        except NoAnswerError as exc:
            raise exc.with_traceback(None) from None  # it would hold the process's lines as long as the future is kept
        finally:
            self._free.put((servant, hand))
        if error is not None:
            raise error
        found: R = result
        return found


@dataclass(frozen=True, slots=True)
class Finished(Generic[T, R]):
    """A task's end. Either `value`, or `failure` ("timed_out", "worker_died", "error") with one line of `message`;
    error: what the task itself raised."""

    task: T
    value: R | None = None
    failure: str = ""
    message: str = ""
    error: BaseException | None = None


def run_tasks(work: Callable[[T], R], tasks: Sequence[T], workers: int, timeout_s: float) -> Iterator[Finished[T, R]]:
    """Results as they come. A task over `timeout_s` has its process ended, as have all on an interrupt."""
    if not tasks:
        return
    pool = ProcessPool(min(workers, len(tasks)))
    try:
        futures: dict[Future[R], T] = {pool.submit(work, task, timeout_s): task for task in tasks}
        for future in as_completed(futures):
            yield _finished(futures[future], future)
    finally:
        pool.shutdown(cancel_futures=True)


def _finished(task: T, future: Future[R]) -> Finished[T, R]:
    try:
        return Finished(task, future.result())
    except NoAnswerError as exc:
        return Finished(task, failure=cause_of(exc), message=str(exc))
    except Exception as exc:
        return Finished(task, None, "error", in_words(exc), exc)


def cause_of(error: BaseException) -> str:
    """Why a task of a pool failed: "timed_out", "worker_died", or "error" for what it raised itself."""
    if not isinstance(error, NoAnswerError):
        return "error"
    return "timed_out" if error.timed_out else "worker_died"


def in_words(error: BaseException) -> str:
    """What a task raised, in one line: its type, and the first line of what it says."""
    text = str(error).strip().splitlines()
    return f"{type(error).__name__}: {text[0] if text else 'no message'}"
