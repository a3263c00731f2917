"""Compute rows of a table: send tasks to worker processes, and write their rows to the file.

A run passes through `run_tasks_references_first`, `run_tasks`, `pool.run_in` and `TaskPool.submit`
here, and in the worker process through `run_in_worker` and `RunTask.perform`.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass, replace
from functools import partial
from typing import Self, TypeVar

import numpy as np

from rotor_mbs.errors import InputError, MethodRefusal, StoreError
from rotor_mbs.methods.catalogue import is_corrected, with_method_files
from rotor_mbs.processes.pool import TaskEnd, TaskPool, run_in
from rotor_mbs.runs.rows import RowLocation, Rows
from rotor_mbs.solution.status import REFUSED

# Columns that a worker returns of rows that it has written.
_REPORTED = ("status", "message", "run_time_s")


@dataclass(frozen=True)
class RunOutcome:
    """The outcome of a run, or of other rows of a study.

    They were computed by this call, could not be computed, or were stored before.

    Attributes
    ----------
    label, method : of the run; the label begins with the name of the scene and a space.
    status : of a run; "measured" for other rows. If nothing is stored, the failure: REFUSED if the
        method refused the scene, "no_reference", or that of a `TaskEnd`.
    message : the reason of the status, if there is one.
    seconds : run time in s; NaN if nothing was timed.
    is_stored : whether there is a row; if not, the same call tries again.
    is_computed : whether this call computed it, or tried to; if not, it was stored before.
    is_shipped : whether it was read from a shipped file and not computed.
    share : part of the work of the call that was done when it ended, from 0 to 1.
    """

    label: str
    method: str
    status: str
    message: str = ""
    seconds: float = float("nan")
    is_stored: bool = True
    is_computed: bool = True
    is_shipped: bool = False
    share: float = 0.0

    @property
    def scene(self) -> str:
        """Return the name of its scene."""
        return self.label.partition(" ")[0]

    @property
    def has_failed(self) -> bool:
        """Return whether the stored run should have succeeded and did not.

        The printed equations cannot fail: how far their runs get is a result.
        """
        return self.is_stored and self.status != "ok" and is_corrected(self.method)


OnProgress = Callable[[int, int, RunOutcome], None]


def ignore_progress(_done: int, _total: int, _outcome: RunOutcome) -> None:
    """Do nothing, in calls that report no progress."""


@dataclass(frozen=True, kw_only=True)
class Task(ABC):
    """Consecutive rows of a table, computed together by one process.

    Attributes
    ----------
    label, method : of the line of progress.
    place : location of the rows in the file.
    reference : location of the row that must be stored before this task is computed.
    kill_after_s : time in s after which the process is ended, if it has not ended the task itself.
    work : rough amount of work, relative to that of other tasks.
    """

    label: str
    method: str
    place: RowLocation
    reference: RowLocation | None = None
    kill_after_s: float = float("inf")
    work: float = 1.0

    @property
    def first(self) -> int:
        """Return the number of the first row, the initial value of its checksum."""
        return self.place.first

    @abstractmethod
    def perform(self) -> Rows:
        """Compute the rows, in a worker process."""

    def store(self, rows: Rows) -> None:
        """Write the rows into the file. Raises StoreError."""
        self.place.write(rows)

    def split(self) -> Sequence[Self]:
        """Return a task for each row; none if there is only one row, or they cannot be split."""
        return ()

    def failed(self, status: str, message: str) -> Rows | None:  # noqa: ARG002
        """Return the rows of a task that was ended or raised an error.

        None means that nothing is stored, so that the task is tried again.
        """
        return None

    def outcome(self, rows: Rows) -> RunOutcome:
        """Return the outcome of the task, from what `run_tasks` yields of its rows."""
        return RunOutcome(self.label, self.method, "measured", f"{len(rows['status'])} points")


T = TypeVar("T", bound=Task)


def run_tasks(pool: TaskPool, tasks: Iterable[T]) -> Iterator[TaskEnd[T, Rows]]:
    """Compute tasks in a pool and store their rows.

    The worker stores them if it sees the file, otherwise this process. However the loop ends, the
    rows of all tasks that have ended are in the file.

    Parameters
    ----------
    pool : a pool that is open.
    tasks : taken as workers become free.

    Yields
    ------
    TaskEnd
        Its `value` has at least the columns `status` and `message` of the stored rows, and their
        run time if there is one; a failure can be stored, too. If nothing is stored, `value` is
        None, and `failure` and `message` say why: REFUSED if the method refused the scene.

    Raises
    ------
    InputError, StoreError
        If a task raised it.
    """
    work = with_method_files(partial(run_in_worker, stores=pool.shares_disk))
    for end in run_in(pool, work, tasks, lambda task: task.kill_after_s, lambda task: task.split()):
        task = end.task
        if isinstance(end.error, InputError | StoreError):
            raise end.error
        if isinstance(end.error, MethodRefusal):
            yield TaskEnd(task, None, REFUSED, str(end.error).removeprefix(f"{task.method}: "))
            continue
        if end.value is not None:
            if not pool.shares_disk:
                task.store(end.value)
            yield end
            continue
        status = "solver_failed" if end.failure == "error" else end.failure
        # A process may have died for reasons of the machine: nothing is stored, and the next call
        # tries again.
        rows = None if end.failure == "worker_died" else task.failed(status, end.message)
        if rows is not None:
            task.store(rows)
        yield TaskEnd(task, rows, end.failure, end.message)


def run_in_worker(task: Task, *, stores: bool) -> Rows:
    """Compute the rows of a task in a worker process, and return them.

    With `stores` they are written into the file, and only the columns that are reported are
    returned.
    """
    rows = task.perform()
    if not stores:
        return rows
    task.store(rows)
    return {name: np.asarray(rows[name]) for name in _REPORTED if name in rows}


def run_tasks_references_first(
    tasks: Sequence[Task], pool: TaskPool, on_progress: OnProgress = ignore_progress
) -> list[RunOutcome]:
    """Compute references first, then all other tasks whose reference is stored.

    Of these, slow and fast ones take turns.

    Parameters
    ----------
    tasks : in any order.
    pool : a pool that is open.
    on_progress : called after each task with the number of tasks that have ended, the number of
        all, and the outcome.

    Returns
    -------
    list of RunOutcome
        The outcome of each task, in the order in which they ended; those whose reference is missing
        are last.
    """
    outcomes: list[RunOutcome] = []
    total_work = sum(task.work for task in tasks)
    done_work = 0.0

    def report(end: TaskEnd[Task, Rows]) -> None:
        nonlocal done_work
        done_work += end.task.work
        if end.value is None:
            outcome = RunOutcome(
                end.task.label, end.task.method, end.failure, end.message, is_stored=False
            )
        else:
            outcome = end.task.outcome(end.value)
        outcome = replace(outcome, share=done_work / total_work)
        outcomes.append(outcome)
        on_progress(len(outcomes), len(tasks), outcome)

    for end in run_tasks(pool, [task for task in tasks if task.reference is None]):
        report(end)
    ready: list[Task] = []
    without_reference: list[Task] = []
    for task in tasks:
        if task.reference is None:
            continue
        if task.reference.is_stored:
            ready.append(task)
        else:
            without_reference.append(task)
    # The slowest tasks come first: one that started last would keep one process busy while the
    # others wait. They take turns with the fastest, whose methods compile code when they start, so
    # that two processes seldom compile the same code at once.
    ready.sort(key=lambda task: -task.work)
    quarter, count = len(ready) // 4, len(ready)
    ordered: list[Task] = []
    for slow, fast in zip(ready[:quarter], ready[count - quarter :], strict=True):
        ordered += [slow, fast]
    ordered += ready[quarter : count - quarter]
    for end in run_tasks(pool, ordered):
        report(end)
    for task in without_reference:
        report(TaskEnd(task, None, "no_reference", "its reference was not computed"))
    return outcomes
