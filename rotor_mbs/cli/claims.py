"""`claims`: the paper's claims in words tested on many runs, its numbers under other conditions."""

from __future__ import annotations

import argparse
import sys

from rotor_mbs.analysis.claim_shares import RULE
from rotor_mbs.analysis.number_trials import count_of_rows
from rotor_mbs.studies.claims import study_claims


def claims(arguments: argparse.Namespace) -> int:
    """Always 0: the verdicts are what is found out. Raises InputError, StoreError."""

    def report(done: int, total: int, what: str) -> None:
        print(f"[{done:{len(str(total))}d}/{total}] {what}", file=sys.stderr, flush=True)

    study = study_claims(
        arguments.output, runs=arguments.runs, seed=arguments.seed, workers=arguments.jobs, on_sweep=report
    )
    print(study.shares)
    print(f"\n{RULE}\n")
    for duration in sorted({one.duration for one in study.numbers.conditions}):
        count, of = count_of_rows(study.numbers, duration)
        print(f"{duration:g} s: {count} of {of} ways of writing the first row of (56) give all published numbers")
    print(f"{arguments.output}: written")
    return 0
