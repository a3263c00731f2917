"""The one way to compute cases: skip what is stored, compute the rest in parallel, store each when it ends.

Every finished case is a file `<output>.parts/<key>.h5`, written by its worker process. The parts are merged into the
output at the end of the call, or by the next call where this one was interrupted.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Sequence
from collections.abc import Set as AbstractSet
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Protocol, TypeAlias

from rotor_mbs.errors import RotorError
from rotor_mbs.runs.case import Case
from rotor_mbs.runs.lock import writing
from rotor_mbs.runs.pool import TaskPool, Workers, pool_of, run_in

# Statuses of a case of which there is no record: the same call tries it again.
NOT_COMPUTED = ("worker_died", "error", "no_reference")


@dataclass(frozen=True)
class Job:
    """A case on its way to a worker process.

    part            the file that its record goes to
    reference       the file that has the record of `case.reference`; None where there is none
    time_limit_s    after which it ends itself
    """

    case: Case
    part: Path
    reference: Path | None = None
    time_limit_s: float = float("inf")


@dataclass(frozen=True)
class Result:
    """What a worker process reports of a job: status, one line of message ("" where all is well), run time in s.

    is_read: it was not computed but read from a file that is shipped.
    """

    status: str
    message: str = ""
    seconds: float = 0.0
    is_read: bool = False


@dataclass(frozen=True)
class Outcome:
    """A case that this call computed, or tried to.

    share: how much of the work of the call was done when it ended, from 0 to 1.
    """

    case: Case
    result: Result
    share: float = 0.0

    @property
    def is_computed(self) -> bool:
        """False where its process died or could not start: nothing is known of the case and nothing stored."""
        return self.result.status not in NOT_COMPUTED


class Store(Protocol):
    """Where records are kept: a file found by its path, in which each record has a key."""

    @property
    def path(self) -> Path: ...

    def stored_keys(self) -> AbstractSet[str]:
        """Keys of all records in the file that need not be computed again. Raises StoreError."""

    def merge(self, parts: Sequence[Path]) -> None:
        """The records of `parts` into the file, atomically; later ones take the place of earlier ones."""


Perform: TypeAlias = Callable[[Job], Result]
JobRunner: TypeAlias = Callable[[Iterable[Sequence[Job]]], Iterable[tuple[Job, Result]]]
OnProgress: TypeAlias = Callable[[int, int, Outcome], None]
OnTimeOut: TypeAlias = Callable[[Job, str], Result]


def ignore_progress(_done: int, _total: int, _outcome: Outcome) -> None:
    """For calls that report no progress."""


def execute(
    cases: Iterable[Case],
    run_jobs: JobRunner,
    store: Store,
    on_progress: OnProgress = ignore_progress,
) -> list[Outcome]:
    """The outcomes of the cases that `store` did not have; those that others are compared with come first.

    run_jobs      computes lists of jobs, each when the one before has ended, and writes their parts: `in_pool`, or a
                  study's own way (a bench times its jobs together)
    on_progress   called with (cases done, of how many, outcome) after each

    Raises InputError where another process is writing the output, StoreError, and what `run_jobs` raises of RotorError.
    """
    with writing(store.path) as parts:
        _merge(store, parts)
        stored = store.stored_keys()
        cases = list(cases)
        lacking = {case.key for case in cases if case.key not in stored}
        missing = [case for case in cases if case.key in lacking or case.reference in lacking]
        made: list[Outcome] = []
        work, done = sum(case.work for case in missing), 0.0
        for case, result in _results(missing, run_jobs, parts, store.path, stored) if missing else ():
            done += case.work
            made.append(Outcome(case, result, done / work))
            on_progress(len(made), len(missing), made[-1])
        _merge(store, parts, even_none=not store.path.exists())
    return made


def _merge(store: Store, parts: Path, *, even_none: bool = False) -> None:
    """Finished parts into the output, also those of a call that was interrupted; then they go."""
    found = sorted(parts.glob("*.h5"))
    if found or even_none:
        store.merge(found)
    for part in found:
        part.unlink()


def in_pool(perform: Perform, workers: Workers, timeout_s: float, on_time_out: OnTimeOut | None = None) -> JobRunner:
    """Computes jobs in parallel processes.

    perform       computes a job and writes its part
    workers       parallel processes, or a pool that is open; 0: one job after the other in this process
    timeout_s     of one job; its process is ended where it has not ended itself a while after that
    on_time_out   writes the part of a job whose process was ended, in this process

    Raises what a job raised of RotorError.
    """

    def run_jobs(waves: Iterable[Sequence[Job]]) -> Iterator[tuple[Job, Result]]:
        limited = ([replace(job, time_limit_s=timeout_s) for job in jobs] for jobs in waves)
        if not workers:
            yield from ((job, perform(job)) for jobs in limited for job in jobs)
            return
        with pool_of(workers) as pool:
            for jobs in limited:
                yield from ends(pool, jobs)

    def ends(pool: TaskPool, jobs: Sequence[Job]) -> Iterator[tuple[Job, Result]]:
        # What ends itself at its time limit needs a while before, to load its engine and compile, and to write after.
        for end in run_in(pool, perform, jobs, 1.2 * timeout_s + 10.0):
            if isinstance(end.error, RotorError):
                raise end.error
            if end.failure == "timed_out" and on_time_out is not None:
                yield end.task, on_time_out(end.task, end.message)
            else:
                yield end.task, end.value or Result(end.failure, end.message)

    return run_jobs


def _results(
    cases: Sequence[Case], run_jobs: JobRunner, parts: Path, output: Path, stored: AbstractSet[str]
) -> Iterator[tuple[Case, Result]]:
    lost: list[Case] = []

    def waves() -> Iterator[list[Job]]:
        yield [Job(case, parts / f"{case.key}.h5") for case in cases if not case.reference]
        jobs: list[Job] = []
        for case in filter(lambda case: case.reference, cases):
            reference = output if case.reference in stored else parts / f"{case.reference}.h5"
            if reference.exists():
                jobs.append(Job(case, parts / f"{case.key}.h5", reference))
            else:
                lost.append(case)
        yield jobs

    yield from ((job.case, result) for job, result in run_jobs(waves()))
    yield from ((case, Result("no_reference", "its reference was not computed")) for case in lost)
