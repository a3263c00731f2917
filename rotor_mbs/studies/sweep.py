"""Sweeps: the runs of a parameter study into one dataset, in worker processes or on a cluster. Prints nothing."""

from __future__ import annotations

import os
import time
from collections import Counter
from collections.abc import Callable, Sequence
from contextlib import closing, nullcontext
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from rotor_mbs.errors import InputError, MethodRefusal, StoreError
from rotor_mbs.execution.engines import open_engine
from rotor_mbs.execution.pool import Finished, TaskPool, run_in
from rotor_mbs.methods.catalogue import is_corrected
from rotor_mbs.models.lagrange.heyoka_adapter import LEAST_LANES
from rotor_mbs.scenario.sweep import Sweep
from rotor_mbs.solution.status import STATUSES, code_of
from rotor_mbs.store.sweep_columns import Rows
from rotor_mbs.store.sweep_layout import lost_rows
from rotor_mbs.studies.sweep_plan import ENSEMBLE_RUNS, SweepPlan, plan_sweep
from rotor_mbs.studies.sweep_work import Chunk, perform

_GRACE_S = 5.0  # in which a run that ends itself at its limit stores what it reached

# From (runs stored, runs in all, statuses of those that have just been stored).
OnProgress = Callable[[int, int, Counter[str]], None]


@dataclass(frozen=True)
class SweepResult:
    """A sweep that is complete.

    runs, made   in the dataset, and by this call
    statuses     how many runs have each status
    seconds      of this call
    is_ok        whether every run is ok whose method claims the correct equations
    """

    path: Path
    runs: int
    made: int
    statuses: Counter[str]
    seconds: float
    is_ok: bool


def run_sweep(
    sweep: Sweep,
    output: Path,
    *,
    methods: Sequence[str] = (),
    workers: int | None = None,
    engine: str | TaskPool = "local",
    part: tuple[int, int] = (1, 1),
    timeout_s: float = 60.0,
    on_progress: OnProgress | None = None,
    work: Callable[[Chunk], Rows | NDArray[np.int8]] = perform,
) -> SweepResult:
    """Computes the runs that `output` misses. However it is interrupted, the same call continues from there.

    Parameters
    ----------
    methods
        Instead of those of the sweep.
    workers
        Number of processes, for the engine "local"; default: one per core.
    engine
        "local", "dask:tcp://host:port", or a pool that is open.
    part
        (k, n): part k of n alone, counted from 1.
    timeout_s
        Time limit of a run in s.
    on_progress
        Called when runs have been stored, first with those that were there.
    work
        What is done with a chunk of runs in a worker.

    Raises
    ------
    InputError, MethodRefusal
        Where the sweep cannot be done, or the output is another file.
    StoreError
        Where the output cannot be written; what was stored stays.
    """
    from rotor_mbs.store.sweep_dataset import SweepDataset  # h5py: the workers start meanwhile

    plan = plan_sweep(sweep, methods, part, timeout_s)
    start = time.monotonic()
    pool = open_engine(engine, workers or os.cpu_count() or 1) if isinstance(engine, str) else engine
    with nullcontext() if pool is engine else closing(pool), SweepDataset(output, plan.layout) as dataset:
        gaps = dataset.missing()
        runs = plan.last - plan.first
        missing = sum(last - first for first, last in gaps)
        done = runs - missing
        report = on_progress or (lambda *_: None)
        report(done, runs, Counter())
        columns = dataset.columns if pool.shares_disk else None
        chunks = (replace(chunk, columns=columns) for chunk in plan.chunks(gaps, pool.workers))
        for end in run_in(pool, work, chunks, _hard_limit, Chunk.split):
            first, found = end.task.first, _found(end)
            stored = dataset.write(first, found) if isinstance(found, dict) else dataset.note(first, found)
            done += len(stored)
            report(done, runs, Counter(STATUSES[code] for code in stored.tolist()))
        statuses = Counter(STATUSES[code] for code in dataset.statuses.tolist())
        return SweepResult(
            dataset.path, runs, missing, statuses, time.monotonic() - start, _is_ok(plan, dataset.statuses)
        )


def _found(end: Finished[Chunk, Rows | NDArray[np.int8]]) -> Rows | NDArray[np.int8]:
    """What a chunk left: rows to be written, or the statuses of those that its worker has written."""
    if isinstance(end.error, InputError | MethodRefusal | StoreError):
        raise end.error
    if end.value is None:
        status = "solver_failed" if end.failure == "error" else end.failure
        return lost_rows(len(end.task.values), end.task.row, status, end.message)
    return end.value


def _hard_limit(chunk: Chunk) -> float:
    """When a worker is ended: runs of a batch go side by side, batches one after the other."""
    batches = -(-len(chunk.values) // LEAST_LANES)
    return chunk.time_limit_s * batches + _GRACE_S


def _is_ok(plan: SweepPlan, statuses: NDArray[np.int8]) -> bool:
    is_corrected_by_number = [is_corrected(method) for method in plan.methods]
    failed = np.flatnonzero(statuses != code_of("ok")) + plan.first
    return not any(is_corrected_by_number[number] for number in set((failed // plan.rows).tolist()))


def estimate_seconds(plan: SweepPlan, pool: TaskPool) -> float:
    """How long all runs will take, from one chunk of each method; infinite where one did not end in its time."""
    seconds = 0.0
    for k in range(len(plan.methods)):
        runs = max(min(plan.last, (k + 1) * plan.rows) - max(plan.first, k * plan.rows), 0)
        if runs:
            seconds += runs * _seconds_per_run(plan, k * plan.rows, pool) / pool.workers
    return seconds


def _seconds_per_run(plan: SweepPlan, first: int, pool: TaskPool) -> float:
    chunk = next(plan.chunks([(first, first + min(plan.rows, ENSEMBLE_RUNS))]))
    try:
        # The first one loads and compiles, which all others find done.
        pool.submit(perform, chunk.part(0, 1), plan.time_limit_s).result()
        start = time.perf_counter()
        pool.submit(perform, chunk, plan.time_limit_s).result()
    except Exception as error:
        if pool.failure(error) == "error":
            raise
        return float("inf")
    return (time.perf_counter() - start) / len(chunk.values)
