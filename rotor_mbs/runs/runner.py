"""Compute rows of a table: send tasks to worker processes, and write their rows to the file.

In the parent process `run_tasks_references_first` calls `run_tasks`, which calls `run_in` of
`processes.pool`, which calls `TaskPool.submit` for each task. In the worker process `run_in_worker`
calls the task's `perform`.
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

# Columns that a worker returns after it has written all columns into the file itself.
_REPORTED = ("status", "message", "run_time_s")


@dataclass(frozen=True)
class RunOutcome:
    """The outcome of a run, or of another part of a study such as a curve of a bench.

    A function such as `studies.run.run_scenes` returns an outcome for each run that it computed,
    tried to compute, or found in the file.

    Attributes
    ----------
    label : label for messages, which begins with the name of the scene and a space.
    method : name of the method.
    status : status of a run; "measured" for another part of a study. If nothing is stored, the kind
        of failure: REFUSED if the method refused the scene, "no_reference", or `TaskEnd.failure`.
    message : reason of the status, or a count of points; "" if there is neither.
    seconds : run time in s; NaN if nothing was timed.
    is_stored : whether the file has the row. If it has not, a repeated call tries again.
    is_computed : whether this call computed the run, or tried to. If not, it was stored before.
    is_shipped : whether this call read the run, a reference, from a shipped file.
    share : share of the call's whole work that was done when this run ended, from 0 to 1.
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
        """Return the name of the scene."""
        return self.label.partition(" ")[0]

    @property
    def has_failed(self) -> bool:
        """Return whether the stored run should have succeeded and did not.

        Runs of the printed equations never count as failed: how far they get is a result.
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
    label : label for the line of progress.
    method : name of the method; "" if the task has several.
    place : location of the rows in the file.
    reference : location of the reference's row, which must be stored before this task is computed;
        None if the task needs no reference.
    kill_after_s : time in s after which the worker process is ended, if the task still runs.
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
        """Return the initial value of the first row's checksum, see `RowLocation`."""
        return self.place.first

    @abstractmethod
    def perform(self) -> Rows:
        """Compute the rows, in a worker process."""

    def store(self, rows: Rows) -> None:
        """Write the rows into the file. Raises StoreError."""
        self.place.write(rows)

    def split(self) -> Sequence[Self]:
        """Return smaller tasks that compute the same rows; none if this task cannot be split."""
        return ()

    def failed(self, status: str, message: str) -> Rows | None:  # noqa: ARG002
        """Return the rows that are stored if this task was ended or raised an error.

        If None is returned, nothing is stored, and the next call tries the task again.
        """
        return None

    def outcome(self, rows: Rows) -> RunOutcome:
        """Return the outcome of the task; `rows` are the columns that `run_tasks` yields."""
        return RunOutcome(self.label, self.method, "measured", f"{len(rows['status'])} points")


T = TypeVar("T", bound=Task)


def run_tasks(pool: TaskPool, tasks: Iterable[T]) -> Iterator[TaskEnd[T, Rows]]:
    """Compute tasks in a pool and store their rows.

    The worker writes the rows if it sees the file; otherwise this process writes them. The rows of
    a task are in the file before its TaskEnd is yielded.

    Parameters
    ----------
    pool : a pool that is open.
    tasks : the tasks; the next one is taken from the iterable when a worker becomes free.

    Yields
    ------
    TaskEnd
        The end of each task. Its `value` has at least the columns `status` and `message` of the
        stored rows, and `run_time_s` if the rows have it. Rows can also be stored for a task that
        failed. If nothing is stored, `value` is None, and `failure` and `message` give the reason;
        `failure` is REFUSED if the method refused the scene.

    Raises
    ------
    InputError, StoreError
        If a task raised such an error, or the rows cannot be written.
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
        # If a process died, the machine may be the cause: nothing is stored, and the next call
        # tries again.
        rows = None if end.failure == "worker_died" else task.failed(status, end.message)
        if rows is not None:
            task.store(rows)
        yield TaskEnd(task, rows, end.failure, end.message)


def run_in_worker(task: Task, *, stores: bool) -> Rows:
    """Compute the rows of a task in a worker process, and return them.

    If `stores` is set, the rows are written into the file here, and only the columns in _REPORTED
    are returned.
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

    The slowest of the other tasks start first, in turns with the fastest.

    Parameters
    ----------
    tasks : the tasks, in any order.
    pool : a pool that is open.
    on_progress : called after each task with the number of tasks that have ended, the number of
        all tasks, and the outcome.

    Returns
    -------
    list of RunOutcome
        The outcomes in the order in which the tasks ended. Tasks that were not computed because
        their reference is missing come last.
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
    # The slowest tasks start first: a slow task that started last would keep one process busy while
    # the other processes are idle. The fastest tasks start in turns with the slowest, because fast
    # methods compile code when they start: two processes then seldom compile the same code at once.
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
