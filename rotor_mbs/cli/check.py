"""`check`: prints every verdict that fails (with --verbose all), then a count; status 1 where one fails."""

from __future__ import annotations

import argparse
import sys
from pathlib import Path

from rotor_mbs.analysis.verdicts import Verdict
from rotor_mbs.cli.terminal import ProgressLine
from rotor_mbs.methods.catalogue import check_names
from rotor_mbs.report import verdict_formats
from rotor_mbs.scenario.accuracy_bounds import load_bounds
from rotor_mbs.store.hdf5 import replace_file
from rotor_mbs.studies.check import check_default_set, check_file, check_speed, default_set, judged_runs

_STANDARD_OUTPUT = Path("-")


def check(arguments: argparse.Namespace) -> int:
    """Of the file given, or of a default set that is computed."""
    bounds = load_bounds(arguments.bounds)
    required = check_names(arguments.require or ())
    if arguments.file is not None:
        found = check_file(arguments.file, bounds, required)
    else:
        with ProgressLine() as progress:
            found = check_default_set(default_set(), bounds, arguments.jobs, progress)
    if arguments.speed:
        found += check_speed(bounds)
    _write(arguments, found)
    # With --json - the standard output is the JSON's alone.
    stream = sys.stderr if arguments.json == _STANDARD_OUTPUT else sys.stdout
    failed = [verdict for verdict in found if not verdict.passed]
    for verdict in found if arguments.verbose else failed:
        print(verdict_formats.line(verdict), file=stream)
    if arguments.github:
        for verdict in failed:
            print(verdict_formats.github(verdict), file=stream)
    runs = ", ".join(f"{count} {method}" for method, count in judged_runs(found).items())
    print(f"runs judged: {runs or 'none'}", file=stream)
    print(f"{len(found) - len(failed)} passed, {len(failed)} failed", file=stream)
    return 1 if failed or not found else 0


def _write(arguments: argparse.Namespace, found: list[Verdict]) -> None:
    if arguments.junit is not None:
        replace_file(arguments.junit, verdict_formats.junit(found))
    if arguments.json == _STANDARD_OUTPUT:
        print(verdict_formats.as_json(found))
    elif arguments.json is not None:
        replace_file(arguments.json, verdict_formats.as_json(found).encode())
    if not found:
        print("nothing to check: the file has no run", file=sys.stderr)
