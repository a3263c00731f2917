"""The report of a file, whatever it has: all pages are made, those of scenes in a process pool, then written."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from functools import partial
from pathlib import Path
from typing import Any

from rotor_mbs.analysis import published, run_selection
from rotor_mbs.analysis.claim_study import claim_study
from rotor_mbs.analysis.claims import claims
from rotor_mbs.analysis.mode_records import read_modes
from rotor_mbs.analysis.work_precision import by_scene
from rotor_mbs.errors import StoreError
from rotor_mbs.methods.catalogue import errata_methods
from rotor_mbs.report.core import files
from rotor_mbs.report.core.files import Site, page_names, render
from rotor_mbs.report.pages import Context
from rotor_mbs.report.pages.bench import bench_pages
from rotor_mbs.report.pages.data_comparison import comparison_page
from rotor_mbs.report.pages.errata import errata_page
from rotor_mbs.report.pages.figures import PaperFigure, available, walk_figure
from rotor_mbs.report.pages.index import index_page
from rotor_mbs.report.pages.modes import modes_page
from rotor_mbs.report.pages.scene import scene_page
from rotor_mbs.report.pages.stability import is_stability_suite, stability_pages
from rotor_mbs.runs.pool import Workers, pool_of, run_in
from rotor_mbs.runs.read import OpenResults, in_memory, is_sweep, open_results
from rotor_mbs.runs.records import Record, read_records
from rotor_mbs.runs.sweep_dataset import StoredSweep

Part = str | Path | PaperFigure  # a scene by its name, a page by its file, or a figure of the paper
_GROUPS = 2  # per worker
_TIMEOUT_S = 600.0

OnPage = Callable[[int, int], None]  # with how many are drawn, of how many


def write_report(
    results: Path, output: Path, jobs: Workers = 1, on_page: OnPage = lambda *_: None, *, checked: bool = False
) -> Path:
    """Write the pages about any file that this program writes into the folder `output`.

    jobs: so many processes, or a pool that is open.

    Runs, the stability suite, a bench, modes, a sweep: what the file has is one site with one navigation. checked:
    also a page with the verdicts of `check` on its runs, which takes seconds of its own. Returns the path of the index.
    Nothing is written before every page is made. Raises StoreError where the file cannot be read or has nothing to
    report, or where the folder cannot be written.
    """
    if is_sweep(results):
        from rotor_mbs.report.pages.sweep import sweep_page  # late, as below: workers load what most files need

        return files.write_page(output, "sweep", sweep_page(StoredSweep(results)))
    with open_results(results) as opened:
        pages = _pages(in_memory(opened), jobs, on_page, checked)
    files.write_pages(output, pages)
    return output / files.INDEX


def _pages(opened: OpenResults, jobs: Workers, on_page: OnPage, checked: bool) -> dict[str, str]:
    """By file name. What comes first is the index."""
    modes, bench, compared = (read_records(opened.path, kind) for kind in ("modes", "bench", "comparison"))
    has_runs = any(scene.methods for scene in opened.scenes.values()) or not (modes or bench or compared)
    is_suite = has_runs and is_stability_suite(opened)
    figures = available(opened.scenes) if has_runs and not is_suite else ()
    has_errata = has_runs and not is_suite and _has_errata(opened)
    data_files = [f"data--{i + 1}.html" if i else files.COMPARISON for i in range(len(compared))]
    kinds = [
        (has_runs, files.INDEX, "Stability suite" if is_suite else "Overview"),
        (bool(figures), files.WALK, "The paper's figures"),
        (has_errata, files.ERRATA, "Errata"),
        (bool(bench), files.BENCH, "Error against run time"),
        (bool(modes), files.MODES, "Modes"),
        *((True, file, f"Data against {one.scene}") for file, one in zip(data_files, compared, strict=True)),
        (has_runs and checked, files.CHECK, "Accuracy check"),
    ]
    there = {file: label for has, file, label in kinds if has}
    names = {file: file if place else files.INDEX for place, file in enumerate(there)}
    site = [(names[file], label) for file, label in there.items()]
    pages: dict[str, str] = {}
    if is_suite:
        pages |= stability_pages(opened, files.INDEX, site)
    elif has_runs:
        pages |= _run_pages(opened, site, figures, bench, jobs, on_page)
    if bench and names[files.BENCH] not in pages:
        pages |= bench_pages(opened, names[files.BENCH], site)
    if modes:
        page = modes_page(list(read_modes(opened.path).values()))
        pages[names[files.MODES]] = render("modes", page, site, names[files.MODES])
    for file, record in zip(data_files, compared, strict=True):
        pages[names[file]] = render("data_comparison", comparison_page(record), site, names[file])
    if has_runs and checked:
        from rotor_mbs.report.pages.check import check_page

        pages[files.CHECK] = render("check", check_page(opened.path), site, files.CHECK)
    return pages


def _has_errata(opened: OpenResults) -> bool:
    """Whether there are runs of the printed equations."""
    printed = {run_selection.PRINTED, *errata_methods().values()}
    return any(printed & {*one.runs} for one in opened.scenes.values())


def _run_pages(
    opened: OpenResults,
    site: Site,
    figures: Sequence[PaperFigure],
    bench: Sequence[Record],
    jobs: Workers,
    on_page: OnPage,
) -> dict[str, str]:
    """The index, errata, error against run time, figures one by one, and a page per scene."""
    if not opened.scenes:
        raise StoreError(f"{opened.path}: no scene in it, nothing to report")
    decided = claims(opened.scenes)
    context = Context(
        opened.path,
        page_names(opened.scenes),
        decided,
        published.conditions() if decided else {},
        claim_study() if decided else None,
        by_scene(bench),
        published.errata() if files.ERRATA in dict(site) else (),
        site,
    )
    made: list[Part] = [Path(file) for file in (files.INDEX, files.ERRATA, files.BENCH) if file in dict(site)]
    made += context.files
    parts = _parts(context, [*figures, *made], jobs, on_page)
    pages: dict[str, str] = {}
    for part in made:
        pages |= parts[part]
    if figures:
        pages[files.WALK] = render("walk", {"figures": [parts[figure] for figure in figures]}, site, files.WALK)
    return pages


def _parts(context: Context, parts: Sequence[Part], jobs: Workers, on_page: OnPage) -> dict[Part, Any]:
    """The parts, in `jobs` processes (in this one where it is 1)."""
    found: dict[Part, Any] = {}
    on_page(0, len(parts))
    with pool_of(0 if jobs == 1 else jobs) as pool:
        # More groups of pages than workers, so that none waits long for the last one; each group opens the file.
        count = min(_GROUPS * pool.workers, len(parts)) if pool.workers > 1 else 1
        groups = [parts[start::count] for start in range(count)]
        for finished in run_in(pool, partial(make_parts, context), groups, _TIMEOUT_S):
            if finished.value is None:
                raise finished.error or StoreError(f"{context.results}: a page was not made: {finished.message}")
            found |= finished.value
            on_page(len(found), len(parts))
    return found


def make_parts(context: Context, parts: Sequence[Part]) -> dict[Part, Any]:
    """The task of a worker: pages, and the content of figures. Raises StoreError."""
    with open_results(context.results) as file:
        opened = in_memory(file)
        return {part: _part(context, opened, part) for part in parts}


def _part(context: Context, opened: OpenResults, part: Part) -> Any:
    """Pages by file name, or what the page of figures takes of one."""
    site = context.site
    if isinstance(part, PaperFigure):
        return walk_figure(part, opened.scenes, context)
    if part == Path(files.INDEX):
        return {files.INDEX: render("index", index_page(opened, context), site, files.INDEX)}
    if part == Path(files.ERRATA):
        return {files.ERRATA: render("errata", errata_page(opened, context), site, files.ERRATA)}
    if part == Path(files.BENCH):
        return bench_pages(opened, files.BENCH, site)
    return {context.files[str(part)]: render("scene", scene_page(opened.scenes[str(part)], context), site)}
