"""`sweep`: a parameter study into one dataset. The workers load their code while this process reads the file."""

from __future__ import annotations

import argparse
import json
import sys
from collections import Counter
from pathlib import Path
from typing import TYPE_CHECKING

from rotor_mbs.cli import show
from rotor_mbs.cli.terminal import SweepProgress, span
from rotor_mbs.errors import InputError, StoreError
from rotor_mbs.runs.cluster import open_task_pool
from rotor_mbs.runs.pool import TaskPool

if TYPE_CHECKING:
    from rotor_mbs.studies.sweep import SweepPlan, SweepResult

_MANY = 1_000_000  # runs that are not started without --yes


def sweep(arguments: argparse.Namespace) -> int:
    """1 where a run did not succeed, or the disk is full. Raises InputError, StoreError."""
    with open_task_pool(arguments.engine, arguments.jobs) as pool:
        from rotor_mbs.scenario.sweep import load_sweep
        from rotor_mbs.studies.sweep import plan_sweep

        plan = plan_sweep(load_sweep(arguments.file), arguments.method or (), arguments.part, arguments.timeout)
        if arguments.dry_run:
            return _show_estimate(plan, pool, arguments)
        if plan.runs > _MANY and not arguments.yes:
            raise InputError(f"{arguments.file}: {plan.runs:,} runs; allowed without --yes: at most {_MANY:,}")
        return _run(plan, pool, arguments)


def _run(plan: SweepPlan, pool: TaskPool, arguments: argparse.Namespace) -> int:
    from rotor_mbs.studies.sweep import run_sweep

    output = arguments.output or Path(f"{plan.sweep.name}.{arguments.format}")
    try:
        with SweepProgress(as_json=arguments.json) as progress:
            result = run_sweep(plan, output, pool, progress, fresh=arguments.fresh)
    except StoreError as exc:  # the disk, not the input: what is stored stays, the same command continues
        show(str(exc), sys.stderr)
        return 1
    _summarize(result, as_json=arguments.json)
    if result.older:
        show(f"{result.older} runs were computed by other versions; --fresh computes them again", sys.stderr)
    for line in result.lost:
        show(f"{line}; not computed, the same command tries again", sys.stderr)
    if plan.sweep.table.picture and arguments.part == (1, 1):
        from rotor_mbs.report.pages.sweep import save_picture  # late: matplotlib
        from rotor_mbs.runs.sweeps import StoredSweep

        line = save_picture(StoredSweep(result.path), output.with_suffix(".svg"))
        print(line, file=sys.stderr if arguments.json else sys.stdout)
    if arguments.metadata:
        from rotor_mbs.studies.sweep_metadata import describe

        names = ", ".join(place.name for place in describe(result.path))
        print(f"{result.path}: described in {names}", file=sys.stderr if arguments.json else sys.stdout)
    return 0 if result.is_ok else 1


def _summarize(result: SweepResult, *, as_json: bool) -> None:
    if as_json:
        facts = {"runs": result.runs, "made": result.made, "statuses": result.statuses, "files": [str(result.path)]}
        print(json.dumps({"event": "end", **facts, "seconds": round(result.seconds, 3)}))
        return
    by_status = ", ".join(f"{count} {status}" for status, count in Counter(result.statuses).most_common())
    rate = f", {result.made / result.seconds:.4g} per s" if result.made else ""
    print(f"{result.path}: {result.runs} runs: {by_status}; {result.made} made in {result.seconds:.1f} s{rate}")


def _show_estimate(plan: SweepPlan, pool: TaskPool, arguments: argparse.Namespace) -> int:
    from rotor_mbs.studies.sweep import estimate_seconds

    size, seconds = plan.runs * plan.table().row_type.itemsize, estimate_seconds(plan, pool)
    if arguments.json:
        facts = {"runs": plan.runs, "methods": list(plan.methods), "seconds": seconds, "bytes": size, "files": 1}
        print(json.dumps(facts))
        return 0
    print(f"{plan.runs:,} runs by {', '.join(plan.methods)}: about {span(seconds)} on {arguments.engine}")
    print(f"{_size(size)} in 1 file")
    return 0


def _size(count: float) -> str:
    for unit in ("bytes", "kB", "MB", "GB"):
        if count < 1000.0:
            return f"{count:.4g} {unit}"
        count /= 1000.0
    return f"{count:.4g} TB"
