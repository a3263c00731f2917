"""`check`: prints every verdict that fails (with --verbose all), then a count; status 1 where one fails."""

from __future__ import annotations

import argparse
import os
import sys
from pathlib import Path

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
        verdicts = study.check_file(arguments.file, bounds, required)
    else:
        with ProgressLine() as progress:
            verdicts = study.check_default_set(bounds, arguments.jobs, progress)
    if verdicts and earlier is not None:
        verdicts += study.regressions(verdicts, earlier, arguments.shrink)

    if arguments.junit is not None:
        replace_file(arguments.junit, formats.junit(verdicts))
    stream = sys.stdout
    if arguments.json == _STANDARD_OUTPUT:
        print(formats.as_json(verdicts))
        stream = sys.stderr  # standard output is the JSON's alone
    elif arguments.json is not None:
        replace_file(arguments.json, formats.as_json(verdicts).encode())

    failures = [verdict for verdict in verdicts if not verdict.passed]
    for verdict in verdicts if arguments.verbose else failures:
        print(formats.line(verdict), file=stream)
    if arguments.github:
        for verdict in formats.worst_first(failures)[: formats.WORST]:
            print(formats.github(verdict), file=stream)
        _append_job_summary(formats.summary(verdicts))
    runs = ", ".join(f"{count} {method}" for method, count in study.judged_runs(verdicts).items())
    print(f"runs judged: {runs or 'none'}", file=stream)
    print(f"{len(verdicts) - len(failures)} passed, {len(failures)} failed", file=stream)
    return 1 if failures else 0


def _append_job_summary(text: str) -> None:
    """Into the file that GitHub names in the environment of a job's step; nothing elsewhere."""
    path = os.environ.get("GITHUB_STEP_SUMMARY")
    if path:
        try:
            with Path(path).open("a", encoding="utf-8") as file:
                file.write(text)
        except OSError as exc:
            raise StoreError(f"{path} (GITHUB_STEP_SUMMARY): cannot be written: {exc.strerror}") from exc
