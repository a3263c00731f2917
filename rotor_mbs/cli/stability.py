"""`stability`: the stiff and extreme suite, what each method is good for, and its pages."""

from __future__ import annotations

import argparse
import sys
import time

from rotor_mbs.analysis.stability import advice_lines, unreached
from rotor_mbs.cli.argument_values import pages_beside
from rotor_mbs.cli.terminal import ProgressLine, print_not_computed
from rotor_mbs.report.build import write_report
from rotor_mbs.studies.stability import run_suite


def stability(arguments: argparse.Namespace) -> int:
    """1 where a claim of the suite fails, see `unreached`, or a case was not computed."""
    start, output = time.monotonic(), arguments.output
    with ProgressLine() as progress:
        report = run_suite(
            arguments.scenes,
            output,
            workers=arguments.jobs,
            timeout_s=arguments.timeout,
            settings=dict(arguments.set or ()),
            on_progress=progress,
        )
    print(*advice_lines(report.runs), sep="\n")
    print(f"{output}: {report.scenes} scenes, {len(report.runs)} runs, {time.monotonic() - start:.0f} s in all")
    pages = arguments.report or pages_beside(output)
    print(f"report: {write_report(output, pages)}")
    missing = unreached(report.runs)
    for scene in missing:
        print(f"{scene}: no method reaches 1e-6 rad", file=sys.stderr)
    print_not_computed(report.not_computed)
    return 1 if missing or report.not_computed else 0
