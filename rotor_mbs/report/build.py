"""The report of a file, whatever it has: all pages are made, those of scenes in a process pool, then written."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from functools import partial
from pathlib import Path
from typing import NamedTuple

from rotor_mbs.errors import StoreError
from rotor_mbs.report import files
from rotor_mbs.report.files import Pairs, render
from rotor_mbs.report.pages import Report
from rotor_mbs.report.pages.bench import bench_page
from rotor_mbs.report.pages.index import index_page
from rotor_mbs.report.pages.paper import available, errata_page, figures_page
from rotor_mbs.report.pages.scene import scene_page
from rotor_mbs.report.pages.stability import stability_page
from rotor_mbs.runs.pool import Workers, pool_of, run_in
from rotor_mbs.runs.read import is_sweep, open_results, read_records
from rotor_mbs.runs.sweeps import StoredSweep

_GROUPS = 4  # of pages per worker, so that none waits long for the last one
_TIMEOUT_S = 600.0

OnPage = Callable[[int, int], None]  # with how many are drawn, of how many


class Page(NamedTuple):
    """A page before it is made: template, label in the navigation ("": it is not there), content, and its file."""

    template: str
    label: str
    content: Callable[[Report], Mapping[str, object]]
    file: str = ""  # by default named like the template


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

        sweep = StoredSweep(results)
        return files.write_page(output, "sweep", sweep_page(sweep), sweep.attributes)
    with open_results(results) as opened:
        planned = _plan(Report(**vars(opened)), checked)
        made = files.made_with(opened.attributes)
    links = [(page.file, page.label) for page in planned if page.label]
    pages: dict[str, str] = {}
    on_page(0, len(planned))
    with pool_of(0 if jobs == 1 else jobs) as pool:
        count = min(_GROUPS * pool.workers, len(planned)) if pool.workers > 1 else 1
        groups = [planned[start::count] for start in range(count)]
        for finished in run_in(pool, partial(make_pages, results, made, links), groups, _TIMEOUT_S):
            if finished.value is None:
                raise finished.error or StoreError(f"{results}: a page was not made: {finished.message}")
            pages |= finished.value
            on_page(len(pages), len(planned))
    files.write_pages(output, pages)
    return output / files.INDEX


def make_pages(results: Path, made: Pairs, links: Pairs, pages: Sequence[Page]) -> dict[str, str]:
    """The work of a process: pages by file name. Raises StoreError."""
    with open_results(results) as opened:
        report = Report(**vars(opened))
        return {page.file: render(page.template, page.content(report), made, links, page.file) for page in pages}


def _plan(report: Report, checked: bool) -> list[Page]:
    """The pages for what the file has. The first of the main pages is the index."""
    modes, bench, compared = (read_records(report.path, kind) for kind in ("modes", "bench", "comparison"))
    has_runs = any(scene.methods for scene in report.scenes.values()) or not (modes or bench or compared)
    if has_runs and not report.scenes:
        raise StoreError(f"{report.path}: no scene in it, nothing to report")
    pages: list[Page] = []
    if has_runs and report.is_suite:
        pages.append(Page("stability", "Stability suite", stability_page))
    elif has_runs:
        pages.append(Page("index", "Overview", index_page))
        if available(report.scenes):
            pages.append(Page("figures", "The paper's figures", figures_page))
        if report.errata:
            pages.append(Page("errata", "Errata", errata_page))
    if bench:
        pages.append(Page("bench", "Error and run time", bench_page))
    if modes:
        from rotor_mbs.report.pages.modes import stored_modes_page  # late, as above

        pages.append(Page("modes", "Modes", stored_modes_page))
    for place, record in enumerate(compared):
        from rotor_mbs.report.pages.comparison import stored_comparison_page

        content, file = partial(stored_comparison_page, place), f"data--{place + 1}.html"
        pages.append(Page("comparison", f"Data against {record.scene}", content, file))
    if has_runs and checked:
        from rotor_mbs.report.pages.check import check_page

        pages.append(Page("check", "Accuracy check", check_page))
    pages[0] = pages[0]._replace(file=files.INDEX)
    if has_runs:
        pages += [Page("scene", "", partial(scene_page, scene), file) for scene, file in report.files.items()]
    return [page._replace(file=page.file or f"{page.template}.html") for page in pages]
