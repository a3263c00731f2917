"""Build the report of a file of any kind: make all pages in a process pool, then write them."""

from __future__ import annotations

import warnings
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from functools import partial
from pathlib import Path
from typing import NamedTuple

import numpy as np

from rotor_mbs.errors import StoreError
from rotor_mbs.processes.pool import Workers, pool_of, run_in
from rotor_mbs.report import files
from rotor_mbs.report.elements import PageContent
from rotor_mbs.report.pages import Report
from rotor_mbs.report.pages.bench import bench_page
from rotor_mbs.report.pages.figures import figures_page
from rotor_mbs.report.pages.index import index_page
from rotor_mbs.report.pages.paper import claims_page, errata_page
from rotor_mbs.report.pages.scene import scene_page, short_name
from rotor_mbs.report.pages.stability import stability_page
from rotor_mbs.report.paper_figures import available
from rotor_mbs.runs.hdf5 import reading
from rotor_mbs.runs.read import is_sweep, open_results, read_records
from rotor_mbs.runs.sweeps import StoredSweep
from rotor_mbs.runs.versions import made_with

# Pages are divided into this number of groups per worker. A group is one task of a worker, which
# opens the file anew for it. With more than one group per worker, a worker that ends early takes
# another one.
_GROUPS = 2
_TIMEOUT_S = 600.0  # time limit for a group of pages, s

# A function that is called with the number of pages made so far, and with the number of all pages.
OnPage = Callable[[int, int], None]


class Page(NamedTuple):
    """Describe a page before it is made.

    Attributes
    ----------
    file : name of the page's file.
    label : label of the page in the navigation; a page with the label "" is not in the navigation.
    content : function that makes the content of the page.
    """

    file: str
    label: str
    content: Callable[[], PageContent]


def write_report(
    results: Path, output: Path, jobs: Workers = 1, on_page: OnPage = lambda *_: None
) -> Path:
    """Write the pages about a file into a folder, and return the path of the index page.

    All pages are made before the first one is written.

    Parameters
    ----------
    results : a file of any kind that this program writes.
    output : the folder, which is created if it does not exist.
    jobs : number of processes, or an open pool.
    on_page : function that is called with the number of pages made so far, and with the number of
        all pages. It is not called for a sweep, which has one page.

    Raises
    ------
    InputError
        If a file in the folder has the name of a page, but was not written by a report.
    StoreError
        If the file cannot be read or has nothing to report, or the folder cannot be written.
    """
    if is_sweep(results):
        from rotor_mbs.report.pages.sweep import (
            sweep_page,
        )  # imported only here, because most files need no such page

        sweep = StoredSweep(results)
        with reading(results), _without_warnings():
            page = sweep_page(sweep)
        return files.write_page(output, page, sweep.attributes)
    with open_results(results) as opened:
        count = len(pages_of(Report(**vars(opened))))
    made: dict[str, str] = {}
    on_page(0, count)
    with pool_of(0 if jobs == 1 else jobs) as pool:
        groups = min(_GROUPS * pool.workers, count) if pool.workers > 1 else 1
        numbers = [range(count)[start::groups] for start in range(groups)]
        for finished in run_in(pool, partial(make_pages, results), numbers, _TIMEOUT_S):
            if finished.value is None:
                raise finished.error or StoreError(
                    f"{results}: a page was not made: {finished.message}"
                )
            made |= finished.value
            on_page(len(made), count)
    files.write_pages(output, made)
    return output / files.INDEX


def make_pages(results: Path, numbers: Sequence[int]) -> dict[str, str]:
    """Make some pages of a report, as one task of a process, and return their HTML by file name.

    Parameters
    ----------
    results : the results file.
    numbers : indices of the pages in the list that `pages_of` returns.

    Raises
    ------
    StoreError
        If the file cannot be read.
    """
    with open_results(results) as opened, _without_warnings():
        pages = pages_of(Report(**vars(opened)))
        versions = made_with(opened.attributes)
        links = [(page.file, page.label) for page in pages if page.label]
        made = {}
        for number in numbers:
            page = pages[number]
            made[page.file] = files.render(page.content(), versions, links, page.file)
        return made


@contextmanager
def _without_warnings() -> Iterator[None]:
    """Suppress warnings in the block.

    A file may hold any number, so that a number may overflow in a plot. The warning of an overflow
    names a line of this program's source, which does not help a user.
    """
    with warnings.catch_warnings(), np.errstate(all="ignore"):
        warnings.simplefilter("ignore")
        yield


def pages_of(report: Report) -> list[Page]:
    """Return the pages of the report of a file, which depend on the content of the file.

    The first page is the index of the report. If the file has one scene, which is not of the
    stability suite, the page of this scene is the first one. Other pages of scenes come last.

    Parameters
    ----------
    report : the open results file.

    Raises
    ------
    StoreError
        If the file has neither scenes nor other results.
    """
    modes, bench, compared = (
        read_records(report.path, kind) for kind in ("modes", "bench", "comparison")
    )
    has_runs = any(scene.methods for scene in report.scenes.values()) or not (
        modes or bench or compared
    )
    if has_runs and not report.scenes:
        raise StoreError(f"{report.path}: no scene in it, nothing to report")
    pages: list[Page] = []
    scenes: list[Page] = []
    if has_runs:
        scenes = [
            Page(file, "", partial(scene_page, name, report)) for name, file in report.files.items()
        ]
    if has_runs and report.is_suite:
        pages.append(Page("stability.html", "Stability suite", partial(stability_page, report)))
    elif has_runs and len(scenes) == 1:
        scene = next(iter(report.files))
        pages.append(scenes.pop()._replace(label=short_name(scene)))
    elif has_runs:
        pages.append(Page("index.html", "Overview", partial(index_page, report)))
    if has_runs and not report.is_suite:
        if report.claims:
            pages.append(Page("claims.html", "Published claims", partial(claims_page, report)))
        if available(report.scenes):
            pages.append(Page("figures.html", "The paper's figures", partial(figures_page, report)))
        if report.errata:
            pages.append(Page("errata.html", "Errors in the paper", partial(errata_page, report)))
    if bench:
        pages.append(Page("bench.html", "Error and run time", partial(bench_page, report)))
    if modes:
        from rotor_mbs.analysis.modes import read_modes  # imported only if needed
        from rotor_mbs.report.pages.modes import modes_page

        pages.append(
            Page("modes.html", "Modes", partial(modes_page, list(read_modes(report.path).values())))
        )
    for number, record in enumerate(compared, 1):
        from rotor_mbs.report.pages.comparison import comparison_page

        label = f"Data against {record.scene}"
        pages.append(Page(f"data--{number}.html", label, partial(comparison_page, record)))
    pages[0] = pages[0]._replace(file=files.INDEX)
    return pages + scenes
