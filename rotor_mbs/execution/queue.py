"""Tasks through an engine with a bounded queue; one that kills its worker is found, tried once more, and told.

A task may stand for many runs: when its worker dies or is late, it is split, and its parts are tried alone at the end,
when nothing else can be taken for the culprit.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Sequence
from concurrent.futures import FIRST_COMPLETED, Future, wait
from dataclasses import dataclass
from typing import Generic, TypeVar

from rotor_mbs.execution.engines import Engine
from rotor_mbs.execution.pool import Finished, in_words

T = TypeVar("T")
R = TypeVar("R")

# Tasks handed out per worker: one to work on, one waiting, so that no worker waits for its parent.
_PER_WORKER = 2


@dataclass(frozen=True)
class Queue(Generic[T, R]):
    """work: what is done with a task; parts: a task in parts to be tried alone, [] where it is one run;
    timeout_s: a task's time limit; alone: how many tasks may be tried again at once, none sharing a process."""

    engine: Engine
    work: Callable[[T], R]
    parts: Callable[[T], Sequence[T]]
    timeout_s: Callable[[T], float]
    alone: int

    def run(self, tasks: Iterable[T]) -> Iterator[list[Finished[T, R]]]:
        """Tasks as they end, all that have ended since the last look together."""
        suspects: list[T] = []
        yield from self._pass(iter(tasks), suspects, _PER_WORKER * self.engine.workers)
        yield from self._pass(iter(suspects), None, self.alone)

    def _pass(self, tasks: Iterator[T], suspects: list[T] | None, most: int) -> Iterator[list[Finished[T, R]]]:
        waiting: dict[Future[R], T] = {}
        more = True
        while more or waiting:
            while more and len(waiting) < most:
                task = next(tasks, None)
                more = task is not None
                if task is not None:
                    waiting[self.engine.submit(self.work, task, self.timeout_s(task))] = task
            done = wait(waiting, return_when=FIRST_COMPLETED).done if waiting else set()
            ended = [self._ended(waiting.pop(future), future) for future in done]
            told = [end for end in ended if not _retried(end, suspects, self.parts)]
            if told:
                yield told

    def _ended(self, task: T, future: Future[R]) -> Finished[T, R]:
        error = future.exception()
        if error is None:
            return Finished(task, future.result())
        cause = self.engine.cause(error)
        if cause == "timed_out":
            return Finished(task, failure=cause, message=f"ended after {self.timeout_s(task):g} s")
        if cause == "worker_died":
            return Finished(task, failure=cause, message="its process died, and died again when it was tried alone")
        return Finished(task, None, cause, in_words(error), error)


def _retried(end: Finished[T, R], suspects: list[T] | None, parts: Callable[[T], Sequence[T]]) -> bool:
    """Whether the task is tried once more: a dead worker's, and one that was late for the sake of a part of it."""
    if not end.failure or suspects is None:
        return False
    single = parts(end.task)
    if end.failure == "worker_died" or single:
        suspects.extend(single or [end.task])
        return True
    return False
