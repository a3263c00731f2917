"""A sweep from its file to its dataset, on an engine that is there; and what is told of it."""

from __future__ import annotations

import argparse
import json
import sys
import time
from collections import Counter
from collections.abc import Callable, Iterator
from dataclasses import replace
from pathlib import Path

import numpy as np

from rotor_mbs.errors import InputError, MethodRefusal, StoreError
from rotor_mbs.execution.meter import Meter
from rotor_mbs.execution.pool import Finished, TaskPool, run_in
from rotor_mbs.methods.catalogue import is_corrected
from rotor_mbs.models.lagrange.heyoka_adapter import LEAST_LANES
from rotor_mbs.scenario.sweep import load_sweep
from rotor_mbs.store.sweep_layout import SWEEP_STATUSES
from rotor_mbs.store.sweep_rows import Receipt, Rows
from rotor_mbs.store.sweep_store import SweepStore, runs_per_file
from rotor_mbs.studies.sweep_plan import Work, estimate_seconds, plan_work
from rotor_mbs.studies.sweep_work import Chunk, lost, perform

_MANY = 1_000_000  # runs that are not started without being asked for twice
_GRACE_S = 5.0  # in which a run that ends itself at its limit stores what it reached


def sweep_on(engine: TaskPool, arguments: argparse.Namespace) -> int:
    """Runs what is missing; 1 where a run did not succeed, or the disk is full. Raises InputError, StoreError."""
    study = load_sweep(arguments.file)
    work = plan_work(study, arguments.method or (), arguments.part, arguments.timeout)
    runs = work.last - work.first
    if arguments.dry_run:
        return _tell_estimate(work, engine, arguments)
    if runs > _MANY and not arguments.yes:
        raise InputError(f"{arguments.file}: {runs:,} runs; allowed without --yes: at most {_MANY:,}")
    output = arguments.output or Path(f"{study.name}.h5")
    with SweepStore(output, work.plan, work.first, work.last, study.file_bytes) as store:
        kept = runs - sum(last - first for first, last in store.missing())
        meter = Meter(runs, kept, as_json=arguments.json)
        start = time.monotonic()
        try:
            store.complete()
            execute(work, engine, store, meter)
        except StoreError as exc:  # the disk, not the input: what is stored stays, the same command goes on
            print(exc, file=sys.stderr)
            return 1
        finally:
            meter.close()
        _summarize(store, kept, time.monotonic() - start, as_json=arguments.json)
        if study.picture and arguments.part == (1, 1):
            from rotor_mbs.cli.sweep_picture import draw

            told = draw(study, store.files, output)
            print(told, file=sys.stderr if arguments.json else sys.stdout)
        return _exit_status(work, store)


def execute(
    work: Work, engine: TaskPool, store: SweepStore, meter: Meter, perform: Callable[[Chunk], Rows | Receipt] = perform
) -> None:
    """Runs all that the store misses. Raises StoreError, InputError, MethodRefusal, KeyboardInterrupt."""
    for ended in run_in(engine, perform, _placed(work, engine, store), _hard_limit, Chunk.parts):
        receipt = _receipt(ended, store)
        store.note([receipt])
        meter.add(Counter(SWEEP_STATUSES[code] for code in receipt.statuses))


def _placed(work: Work, engine: TaskPool, store: SweepStore) -> Iterator[Chunk]:
    """The missing runs; workers that share the disk write them themselves.

    But for the first ones, which come back: each worker has one to do while this process lays out the file.
    """
    for number, chunk in enumerate(work.chunks(store.missing(), engine.workers)):
        writes = engine.shares_disk and number >= engine.workers
        yield replace(chunk, places=store.places(chunk.first, chunk.last)) if writes else chunk


def _receipt(ended: Finished[Chunk, Rows | Receipt], store: SweepStore) -> Receipt:
    if isinstance(ended.value, Receipt):
        return ended.value
    if isinstance(ended.error, InputError | MethodRefusal | StoreError):
        raise ended.error
    chunk, rows = ended.task, ended.value
    if rows is None:
        rows = lost(chunk, ended.failure if ended.failure in SWEEP_STATUSES else "solver_failed", ended.message)
    return store.places(chunk.first, chunk.last).put(rows)


def _hard_limit(chunk: Chunk) -> float:
    """Runs of a batch go side by side, batches one after the other."""
    batches = -(-len(chunk.values) // LEAST_LANES)
    return chunk.time_limit_s * batches + _GRACE_S


def _summarize(store: SweepStore, kept: int, seconds: float, *, as_json: bool) -> None:
    counts = Counter(SWEEP_STATUSES[code] for code in store.statuses.tolist())
    made = len(store.statuses) - kept
    files = [str(path) for path in store.files]
    if as_json:
        facts = {"runs": len(store.statuses), "made": made, "statuses": counts, "files": files}
        print(json.dumps({"event": "end", **facts, "seconds": round(seconds, 3)}))
        return
    shown = files[0] if len(files) == 1 else f"{files[0]} to {files[-1]}"
    by_status = ", ".join(f"{count} {status}" for status, count in counts.most_common())
    rate = f", {made / seconds:.4g} per s" if made else ""
    print(f"{shown}: {len(store.statuses)} runs: {by_status}; {made} made in {seconds:.1f} s{rate}")


def _exit_status(work: Work, store: SweepStore) -> int:
    """1 where a run of a method that claims to be right is not ok."""
    corrected = [is_corrected(method) for method in work.methods]
    runs = np.arange(work.first, work.last)
    failed = runs[store.statuses != SWEEP_STATUSES.index("ok")] // work.rows
    return int(any(corrected[method] for method in set(failed.tolist())))


def _tell_estimate(work: Work, engine: TaskPool, arguments: argparse.Namespace) -> int:
    runs = work.last - work.first
    row = work.plan.row.itemsize
    seconds = estimate_seconds(work, engine)
    files = -(-runs // runs_per_file(work.sweep.file_bytes, work.plan))
    facts = {"runs": runs, "methods": list(work.methods), "seconds": seconds, "bytes": runs * row, "files": files}
    if arguments.json:
        print(json.dumps(facts))
        return 0
    print(f"{runs:,} runs by {', '.join(work.methods)}: about {_readable(seconds)} on {arguments.engine}")
    print(f"{_size(runs * row)} in {files} file{'s' if files > 1 else ''}")
    return 0


def _readable(seconds: float) -> str:
    for length, unit in ((86400.0, "days"), (3600.0, "hours"), (60.0, "minutes")):
        if seconds >= 2.0 * length:
            return f"{seconds / length:.1f} {unit}"
    return f"{seconds:.1f} seconds"


def _size(count: float) -> str:
    for unit in ("bytes", "kB", "MB", "GB"):
        if count < 1000.0:
            return f"{count:.4g} {unit}"
        count /= 1000.0
    return f"{count:.4g} TB"
