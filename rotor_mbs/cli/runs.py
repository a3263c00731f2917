"""`run`, `reproduce` and `reference`."""

from __future__ import annotations

import argparse
import sys
import time

from rotor_mbs.cli import EXIT_BAD_INPUT
from rotor_mbs.cli.terminal import ProgressLine, print_summary
from rotor_mbs.methods.catalogue import check_names
from rotor_mbs.scenario.catalogue import find_scenes
from rotor_mbs.studies.reference import compute_references
from rotor_mbs.studies.reproduce import reproduce as reproduce_paper
from rotor_mbs.studies.run import asked_methods, run_scenes, selected_methods


def run(arguments: argparse.Namespace) -> int:
    """Methods named with -m must represent every scene; without, a rule selects them."""
    scenes = find_scenes(arguments.scenes)
    names = check_names(arguments.method or ())
    if names:
        methods = asked_methods(scenes, names)
    else:
        methods, reasons = selected_methods(scenes)
        print(*reasons, sep="\n", file=sys.stderr)
        scenes = [scene for scene in scenes if methods[scene.name]]
        if not scenes:
            return EXIT_BAD_INPUT
    with ProgressLine() as progress:
        report = run_scenes(
            scenes, methods, arguments.output, workers=arguments.jobs, timeout_s=arguments.timeout,
            settings=dict(arguments.set or ()), on_progress=progress,
        )  # fmt: skip
    return print_summary(report, arguments.output)


def reproduce(arguments: argparse.Namespace) -> int:
    """Every scene of the paper, and the report."""
    from rotor_mbs.cli.reports import render_if_changed

    start = time.monotonic()
    results = arguments.output / "results.h5"
    with ProgressLine() as progress:
        report = reproduce_paper(results, workers=arguments.jobs, timeout_s=arguments.timeout, on_progress=progress)
    status = print_summary(report, results)
    index = render_if_changed(results, arguments.output / "report", arguments.jobs)
    print(f"report: {index}\n{time.monotonic() - start:.1f} s in all")
    return status


def reference(arguments: argparse.Namespace) -> int:
    """References computed anew, whatever is shipped."""
    with ProgressLine() as progress:
        report = compute_references(
            find_scenes(arguments.scenes), arguments.output, workers=arguments.jobs, timeout_s=arguments.timeout,
            on_progress=progress,
        )  # fmt: skip
    return print_summary(report, arguments.output)
