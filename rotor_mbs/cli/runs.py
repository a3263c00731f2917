"""`run`, `reproduce` and `reference`."""

from __future__ import annotations

import argparse
import sys
import time
from functools import partial
from pathlib import Path

from rotor_mbs.analysis.claim_records import stored_claims
from rotor_mbs.analysis.claims import claims
from rotor_mbs.analysis.finding import finding
from rotor_mbs.analysis.run_tables import finding_lines, method_table, run_table
from rotor_mbs.cli import EXIT_BAD_INPUT
from rotor_mbs.cli.terminal import ProgressLine, print_doubts, print_summary, print_table, print_text
from rotor_mbs.methods.catalogue import check_names
from rotor_mbs.scenario.catalogue import find_scenes
from rotor_mbs.store.read import open_results
from rotor_mbs.studies.reference import compute_references
from rotor_mbs.studies.reproduce import reproduce as reproduce_paper
from rotor_mbs.studies.run import asked_methods, run_scenes, selected_methods

# Of the time of `reproduce`: runs, error against run time, pages.
_REPRODUCE_PARTS = (0.7, 0.1, 0.2)


def run(arguments: argparse.Namespace) -> int:
    """Methods named with -m, or by a scene's file, must represent it; without, a rule selects them."""
    scenes = find_scenes(arguments.scenes)
    print_doubts(scenes)
    names = check_names(arguments.method or ())
    if names:
        methods = asked_methods(scenes, names)
    else:
        methods, reasons = selected_methods(scenes)
        for reason in reasons:
            print(reason, file=sys.stderr)
        scenes = [scene for scene in scenes if methods[scene.name]]
        if not scenes:
            return EXIT_BAD_INPUT
    with ProgressLine() as progress:
        report = run_scenes(
            scenes, methods, arguments.output, workers=arguments.jobs, timeout_s=arguments.timeout,
            settings=dict(arguments.set or ()), on_progress=progress,
        )  # fmt: skip
    with open_results(arguments.output) as results:
        print_table(run_table(results.scenes, methods))
    return print_summary(report, arguments.output)


def reproduce(arguments: argparse.Namespace) -> int:
    """Every scene of the paper, and the report."""
    from rotor_mbs.cli.reports import render_if_changed

    start = time.monotonic()
    results = arguments.output / "results.h5"
    with ProgressLine(parts=_REPRODUCE_PARTS) as progress:
        report = reproduce_paper(results, workers=arguments.jobs, timeout_s=arguments.timeout, on_progress=progress)
        pages = partial(progress.stage, "pages and figures")
        index, summary = render_if_changed(results, arguments.output / "report", arguments.jobs, _summary, pages)
    status = print_summary(report, results)
    print_text(summary)
    print(f"report: {index}\n{time.monotonic() - start:.1f} s in all")
    return status


def _summary(path: Path) -> str:
    """Numbers and claims of the paper, and a line for each method over all its scenes."""
    with open_results(path) as results:
        runs = [run for scene in results.scenes.values() for run in scene.methods.values()]
        study = stored_claims(results)
        facts = finding(results.scenes, claims(results.scenes))
        lines = finding_lines(facts, None if study is None else study.shares)
        return "\n".join([*lines, "", str(method_table(runs)), ""])


def reference(arguments: argparse.Namespace) -> int:
    """References computed anew, whatever is shipped."""
    with ProgressLine() as progress:
        report = compute_references(
            find_scenes(arguments.scenes), arguments.output, workers=arguments.jobs, timeout_s=arguments.timeout,
            on_progress=progress,
        )  # fmt: skip
    return print_summary(report, arguments.output)
