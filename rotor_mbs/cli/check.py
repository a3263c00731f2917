"""`check`: prints every verdict that fails (with --verbose all), then a count; status 1 where one fails."""

from __future__ import annotations

import argparse
import os
import sys
from pathlib import Path
from typing import TextIO

from rotor_mbs.analysis.checks import Check
from rotor_mbs.cli.terminal import ProgressLine
from rotor_mbs.errors import StoreError
from rotor_mbs.methods.catalogue import check_names
from rotor_mbs.report.pages import check as formats
from rotor_mbs.runs.files import replace_file
from rotor_mbs.scenario.accuracy_bounds import load_bounds
from rotor_mbs.studies import check as study

_STANDARD_OUTPUT = Path("-")


def check(arguments: argparse.Namespace) -> int:
    """Judges the file given, or a default set that is computed."""
    bounds = load_bounds(arguments.bounds)
    required = check_names(arguments.require or ())
    earlier = None if arguments.against is None else study.judge_file(arguments.against, bounds)
    if arguments.file is not None:
        found = study.check_file(arguments.file, bounds, required)
    else:
        with ProgressLine() as progress:
            found = study.check_default_set(bounds, arguments.jobs, progress)
    if found and earlier is not None:
        found += study.regressions(found, earlier, arguments.shrink)
    _write(arguments, found)
    # With --json - the standard output is the JSON's alone.
    stream = sys.stderr if arguments.json == _STANDARD_OUTPUT else sys.stdout
    failed = [verdict for verdict in found if not verdict.passed]
    for verdict in found if arguments.verbose else failed:
        print(formats.line(verdict), file=stream)
    if arguments.github:
        _tell_github(found, stream)
    runs = ", ".join(f"{count} {method}" for method, count in study.judged_runs(found).items())
    print(f"runs judged: {runs or 'none'}", file=stream)
    print(f"{len(found) - len(failed)} passed, {len(failed)} failed", file=stream)
    return 1 if failed else 0


def _tell_github(found: list[Check], stream: TextIO) -> None:
    """The worst failures as annotations; a table into the job's summary, where a job has one."""
    failed = [verdict for verdict in formats.worst_first(found) if not verdict.passed]
    for verdict in failed[: formats.WORST]:
        print(formats.github(verdict), file=stream)
    place = os.environ.get("GITHUB_STEP_SUMMARY")
    if place:
        try:
            with Path(place).open("a", encoding="utf-8") as file:
                file.write(formats.summary(found))
        except OSError as exc:
            raise StoreError(f"{place} (GITHUB_STEP_SUMMARY): cannot be written: {exc.strerror}") from exc


def _write(arguments: argparse.Namespace, found: list[Check]) -> None:
    if arguments.junit is not None:
        replace_file(arguments.junit, formats.junit(found))
    if arguments.json == _STANDARD_OUTPUT:
        print(formats.as_json(found))
    elif arguments.json is not None:
        replace_file(arguments.json, formats.as_json(found).encode())
