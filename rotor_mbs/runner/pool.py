"""Tasks in parallel processes of their own, each with a time limit; one that dies or hangs takes no other with it.

Knows nothing of scenes, models or files: it is given a picklable function and its arguments.
"""

from __future__ import annotations

import multiprocessing
import os
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import Future, as_completed
from dataclasses import dataclass
from typing import Generic, TypeVar

from pebble import ProcessExpired, ProcessPool

T = TypeVar("T")
R = TypeVar("R")

# One thread per process: the processes are the parallelism, and timings must not depend on a library's threads.
ONE_THREAD = ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS")


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
    for name in ONE_THREAD:
        os.environ.setdefault(name, "1")
    context = multiprocessing.get_context("spawn")
    pool = ProcessPool(max_workers=min(workers, len(tasks)), context=context)
    try:
        futures: dict[Future[R], T] = {pool.schedule(work, args=(task,), timeout=timeout_s): task for task in tasks}
        for future in as_completed(futures):
            yield _finished(futures[future], future, timeout_s)
        pool.close()  # type: ignore[no-untyped-call]
    except BaseException:
        pool.stop()  # type: ignore[no-untyped-call]
        raise
    finally:
        pool.join()


def _finished(task: T, future: Future[R], timeout_s: float) -> Finished[T, R]:
    try:
        return Finished(task, future.result())
    except TimeoutError:
        return Finished(task, failure="timed_out", message=f"ended after {timeout_s:g} s")
    except ProcessExpired as exc:
        return Finished(task, failure="worker_died", message=f"its process died (exit code {exc.exitcode})")
    except Exception as exc:
        return Finished(task, None, "error", in_words(exc), exc)


def in_words(error: BaseException) -> str:
    """What a task raised, in one line: its type, and the first line of what it says."""
    text = str(error).strip().splitlines()
    return f"{type(error).__name__}: {text[0] if text else 'no message'}"
