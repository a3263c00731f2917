"""Define the commands `run`, `reproduce` and `reference`."""

from __future__ import annotations

import argparse
import sys
import time
from functools import partial
from importlib import import_module
from pathlib import Path

from rotor_mbs.analysis.text_tables import table_of_runs
from rotor_mbs.cli.terminal import print_summary, print_table
from rotor_mbs.errors import InputError
from rotor_mbs.methods.selection import problems_of_scene, selected_methods
from rotor_mbs.processes.pool import local_pool
from rotor_mbs.runs.output_files import is_being_written, replace_file
from rotor_mbs.runs.progress import ProgressLine
from rotor_mbs.runs.read import open_results
from rotor_mbs.scenario.catalogue import find_scenes
from rotor_mbs.studies.run import run_scenes


def run(arguments: argparse.Namespace) -> int:
    """Run scenes with methods, and print a table of the runs and a summary.

    The methods of a scene are those named with -m. Without -m they are the methods listed in the
    scene's file. If the file lists none, a rule selects methods for the scene.

    Parameters
    ----------
    arguments : parsed arguments: `scenes`, `method`, `set` (settings), `output`, `jobs`, and
        `timeout` (time limit of a run in s).

    Returns
    -------
    int
        The exit status of `print_summary`.

    Raises
    ------
    InputError
        If an argument or a scene file is invalid, or no scene has a method that can run it.
    """
    scenes = find_scenes(arguments.scenes, problems_of_scene)
    settings = dict(arguments.set or ())
    methods, reasons, refused = selected_methods(scenes, arguments.method, settings)
    for reason in reasons:
        print(reason, file=sys.stderr)
    scenes = [scene for scene in scenes if methods[scene.name]]
    if not scenes:
        raise InputError(map(str, refused))
    with ProgressLine() as progress:
        outcomes = run_scenes(
            scenes, methods, arguments.output, workers=arguments.jobs, timeout_s=arguments.timeout,
            settings=settings, on_progress=progress,
        )  # fmt: skip
    with open_results(arguments.output) as results:
        table = table_of_runs(results.scenes, methods)
    print_table(table)
    return print_summary(outcomes, arguments.output, refused)


def reproduce(arguments: argparse.Namespace) -> int:
    """Compute every scene of the paper, and write the report.

    Nothing is computed if the last call succeeded, all its output files exist, and neither its
    inputs nor the results file have changed since then. To find changes, a call that succeeds
    stores a digest of the inputs and the results file (`studies.reproduce.made_from`), and the next
    call computes the digest again.

    Parameters
    ----------
    arguments : parsed arguments: `output` (folder), `jobs`, and `timeout` (time limit of a run in
        s).

    Returns
    -------
    int
        The exit status of `print_summary`, or 0 if nothing had to be computed.
    """
    # `studies.reproduce` imports the benchmarks, which `run` does not need. It is therefore
    # imported here and in `_reproduce`, not at the top of the file.
    from rotor_mbs.studies.reproduce import made_from

    start = time.monotonic()
    status = 0
    results, pages = arguments.output / "results.h5", arguments.output / "report"
    index, summary, stamp = pages / "index.html", pages / "summary.txt", pages / ".made-from"
    has_outputs = all(path.is_file() for path in (results, index, summary, stamp))
    if (
        has_outputs
        and stamp.read_bytes() == made_from(results, arguments.timeout).encode()
        and not is_being_written(results)
    ):
        print(f"{results}: nothing to do, every run is already stored")
    else:
        status, text = _reproduce(arguments, results, pages)
        replace_file(summary, text.encode(), rb"\A\s*(result|method) ")
        # The stamp is written last, and only after success. Without a stamp, the next call computes
        # what is missing.
        if status == 0:
            replace_file(
                stamp, made_from(results, arguments.timeout).encode(), rb"\A[0-9a-f]{64}\Z"
            )
    print_table(summary.read_text(encoding="utf-8", errors="replace"))
    print(f"report: {index}\n{time.monotonic() - start:.1f} s")
    return status


def _reproduce(arguments: argparse.Namespace, results: Path, pages: Path) -> tuple[int, str]:
    """Compute the runs and write the pages, and return the exit status and the text of the summary.

    The runs and the pages share one pool of processes.
    """
    load_code = partial(import_module, "rotor_mbs.studies.reproduce")
    from rotor_mbs.studies.reproduce import reproduce as reproduce_paper
    from rotor_mbs.studies.reproduce import summary_of

    with local_pool(arguments.jobs, load_code) as pool, ProgressLine() as progress:
        outcomes, refused = reproduce_paper(
            results, workers=pool, timeout_s=arguments.timeout, on_progress=progress
        )
        from rotor_mbs.report.build import write_report  # only `reproduce` needs it

        write_report(results, pages, pool, partial(progress.stage, "pages and figures"))
    return print_summary(outcomes, results, refused), summary_of(results)


def reference(arguments: argparse.Namespace) -> int:
    """Compute the references of scenes, even if a reference is shipped, and print a summary."""
    scenes = find_scenes(arguments.scenes)
    with ProgressLine() as progress:
        outcomes = run_scenes(
            scenes, {scene.name: () for scene in scenes}, arguments.output, workers=arguments.jobs,
            timeout_s=arguments.timeout, use_frozen=False, on_progress=progress,
        )  # fmt: skip
    return print_summary(outcomes, arguments.output)
