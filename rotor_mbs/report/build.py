"""The report of a file, whatever it has: all pages are made, those of scenes in a process pool, then written."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

from rotor_mbs.analysis import published, run_selection
from rotor_mbs.analysis.claim_study import claim_study
from rotor_mbs.analysis.claims import claims
from rotor_mbs.analysis.stability import suite_runs
from rotor_mbs.analysis.work_precision import by_scene
from rotor_mbs.errors import StoreError
from rotor_mbs.methods.catalogue import errata_methods
from rotor_mbs.report.core import files
from rotor_mbs.report.core.files import Site, page_names, render
from rotor_mbs.report.pages import Context
from rotor_mbs.report.pages.bench import bench_pages
from rotor_mbs.report.pages.errata import errata_page
from rotor_mbs.report.pages.figures import available, walk_figure
from rotor_mbs.report.pages.index import index_page
from rotor_mbs.report.pages.scene import scene_page
from rotor_mbs.report.pages.stability import is_stability_suite, stability_page
from rotor_mbs.runs.pool import Workers, pool_of, run_in
from rotor_mbs.runs.read import OpenResults, is_sweep, open_results
from rotor_mbs.runs.records import Record, read_records
from rotor_mbs.runs.sweeps import StoredSweep

_GROUPS = 2  # per worker
_TIMEOUT_S = 600.0

Task = Callable[[OpenResults], Any]  # makes pages by file name, or what a page has of a figure
OnPage = Callable[[int, int], None]  # with how many are drawn, of how many


def write_report(
    results: Path, output: Path, jobs: Workers = 1, on_page: OnPage = lambda *_: None, *, checked: bool = False
) -> Path:
    """Write the pages about any file that this program writes into a folder, all or none; returns the index.

    Parameters
    ----------
    results, output : the file; the folder, which is made where it does not exist.
    jobs : so many processes, or a pool that is open.
    on_page : called with the number of pages that are made, and of all.
    checked : also a page with the verdicts of `check` on the file's runs, which takes seconds of its own.

    Raises
    ------
    StoreError
        Where the file cannot be read or has nothing to report, or the folder cannot be written.
    """
    if is_sweep(results):
        from rotor_mbs.report.pages.sweep import sweep_page  # late: workers load what most files need

        return files.write_page(output, "sweep", sweep_page(StoredSweep(results)))
    with open_results(results) as opened:
        pages = _pages(opened, jobs, on_page, checked)
    files.write_pages(output, pages)
    return output / files.INDEX


def _pages(opened: OpenResults, jobs: Workers, on_page: OnPage, checked: bool) -> dict[str, str]:
    """By file name. The first of the main pages is the index."""
    modes, bench, compared = (read_records(opened.path, kind) for kind in ("modes", "bench", "comparison"))
    has_runs = any(scene.methods for scene in opened.scenes.values()) or not (modes or bench or compared)
    is_suite = has_runs and is_stability_suite(opened)
    is_usual = has_runs and not is_suite
    figures = available(opened.scenes) if is_usual else ()
    printed = {run_selection.PRINTED, *errata_methods().values()}
    data_files = [f"data--{i + 1}.html" if i else files.COMPARISON for i in range(len(compared))]
    labels: dict[str, str] = {}
    if has_runs:
        labels[files.INDEX] = "Stability suite" if is_suite else "Overview"
    if figures:
        labels[files.FIGURES] = "The paper's figures"
    if is_usual and any(printed & {*scene.runs} for scene in opened.scenes.values()):
        labels[files.ERRATA] = "Errata"
    if bench:
        labels[files.BENCH] = "Error against run time"
    if modes:
        labels[files.MODES] = "Modes"
    for file, record in zip(data_files, compared, strict=True):
        labels[file] = f"Data against {record.scene}"
    if has_runs and checked:
        labels[files.CHECK] = "Accuracy check"
    names = {file: file for file in labels}
    names[next(iter(labels))] = files.INDEX
    site = [(names[file], label) for file, label in labels.items()]

    tasks: list[Task] = []
    context = Context({})
    if has_runs:
        if not opened.scenes:
            raise StoreError(f"{opened.path}: no scene in it, nothing to report")
        context = _context(opened, bench, is_suite=is_suite, has_errata=files.ERRATA in labels)
        template, content = ("stability", stability_page) if is_suite else ("index", index_page)
        tasks += [partial(walk_figure, figure, context) for figure in figures]
        tasks.append(partial(_page, template, files.INDEX, site, partial(content, context)))
        for scene, file in context.files.items():
            tasks.append(partial(_page, "scene", file, site, partial(scene_page, scene, context)))
    if files.ERRATA in labels:
        tasks.append(partial(_page, "errata", files.ERRATA, site, partial(errata_page, context)))
    if bench:
        tasks.append(partial(bench_pages, names[files.BENCH], site))
    if modes:
        from rotor_mbs.report.mode_study import stored_modes_page  # late, as above

        tasks.append(partial(_page, "modes", names[files.MODES], site, stored_modes_page))
    for place, file in enumerate(data_files):
        from rotor_mbs.report.data_comparison import stored_comparison_page

        tasks.append(partial(_page, "data_comparison", names[file], site, partial(stored_comparison_page, place)))
    if files.CHECK in labels:
        from rotor_mbs.report.pages.check import check_page

        tasks.append(partial(_page, "check", files.CHECK, site, check_page))
    made = _made(opened.path, tasks, jobs, on_page)
    pages: dict[str, str] = {}
    for part in made[len(figures) :]:
        pages |= part
    if figures:
        pages[files.FIGURES] = render("figures", {"figures": made[: len(figures)]}, site, files.FIGURES)
    return pages


def _context(opened: OpenResults, bench: Sequence[Record], *, is_suite: bool, has_errata: bool) -> Context:
    if is_suite:
        runs = suite_runs(opened.path)
        ladders = [
            record
            for record in read_records(opened.path, "stability")
            if np.isfinite(record.arrays["angle_error_max"]).any()
        ]
        return Context(page_names(dict.fromkeys(run.scene for run in runs)), suite_runs=runs, ladders=ladders)
    decided = claims(opened.scenes)
    return Context(
        page_names(opened.scenes),
        decided,
        published.conditions() if decided else {},
        claim_study() if decided else None,
        by_scene(bench),
        published.errata() if has_errata else (),
    )


def _made(path: Path, tasks: Sequence[Task], jobs: Workers, on_page: OnPage) -> list[Any]:
    """What each task makes, in `jobs` processes."""
    made: dict[int, Any] = {}
    on_page(0, len(tasks))
    with pool_of(0 if jobs == 1 else jobs) as pool:
        # More groups of pages than workers, so that none waits long for the last one; each group opens the file.
        count = min(_GROUPS * pool.workers, len(tasks)) if pool.workers > 1 else 1
        groups = [dict(list(enumerate(tasks))[start::count]) for start in range(count)]
        for finished in run_in(pool, partial(make_parts, path), groups, _TIMEOUT_S):
            if finished.value is None:
                raise finished.error or StoreError(f"{path}: a page was not made: {finished.message}")
            made |= finished.value
            on_page(len(made), len(tasks))
    return [made[i] for i in range(len(tasks))]


def make_parts(results: Path, tasks: dict[int, Task]) -> dict[int, Any]:
    """The work of a process: what each task makes, by its number. Raises StoreError."""
    with open_results(results) as opened:
        return {number: task(opened) for number, task in tasks.items()}


def _page(
    template: str, file: str, site: Site, content: Callable[[OpenResults], dict[str, object]], opened: OpenResults
) -> dict[str, str]:
    return {file: render(template, content(opened), site, file)}
