"""The report of a file, whatever it has: all pages are made, those of scenes in a process pool, then written."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, fields, replace
from functools import cached_property, partial
from pathlib import Path
from typing import Any

from numpy.typing import NDArray

from rotor_mbs.analysis import errata as errata_analysis
from rotor_mbs.analysis import published, run_selection
from rotor_mbs.analysis.claim_records import ClaimStudy, stored_claims
from rotor_mbs.analysis.claims import Claim, claims
from rotor_mbs.analysis.mode_records import read_modes
from rotor_mbs.analysis.work_precision import by_scene
from rotor_mbs.errors import StoreError
from rotor_mbs.execution.pool import run_tasks
from rotor_mbs.methods.catalogue import errata_methods
from rotor_mbs.report.core.files import (
    BENCH,
    CHECK,
    COMPARISON,
    ERRATA,
    INDEX,
    MODES,
    WALK,
    Site,
    page_names,
    render,
    write_pages,
)
from rotor_mbs.report.pages.bench import bench_pages
from rotor_mbs.report.pages.check import check_page
from rotor_mbs.report.pages.data_comparison import comparison_page
from rotor_mbs.report.pages.modes import modes_page
from rotor_mbs.report.pages.stability import is_stability_suite, stability_pages
from rotor_mbs.report.pages.sweep import sweep_page
from rotor_mbs.report.paper_figures import PaperFigure, available
from rotor_mbs.scenario.catalogue import natural_order
from rotor_mbs.store.read import OpenResults, StoredRun, StoredScene, is_sweep, open_results
from rotor_mbs.store.records import Record, read_records
from rotor_mbs.store.sweep_dataset import StoredSweep

Part = str | Path | PaperFigure  # a scene by its name, a page by its file, or a figure of the paper
_GROUPS = 2  # per worker
_TIMEOUT_S = 600.0


@dataclass(frozen=True)
class Context:
    """What the page of a scene or a figure needs to know of the rest of the file.

    files: the file name of each scene's page, in order; curves: error against run time, by scene;
    errata: empty where there is no such page
    """

    results: Path
    files: Mapping[str, str]
    claims: tuple[Claim, ...]
    conditions: Mapping[str, str]
    study: ClaimStudy | None
    curves: Mapping[str, Sequence[Record]]
    errata: Sequence[published.Erratum]
    site: Site


OnPage = Callable[[int, int], None]  # with how many are drawn, of how many


def write_report(
    results: Path, output: Path, jobs: int = 1, on_page: OnPage = lambda *_: None, *, checked: bool = False
) -> Path:
    """Write the pages about any file that this program writes into the folder `output`, with `jobs` processes.

    Runs, the stability suite, a bench, modes, a sweep: what the file has is one site with one navigation. checked:
    also a page with the verdicts of `check` on its runs, which takes seconds of its own. Returns the path of the index.
    Nothing is written before every page is made. Raises StoreError where the file cannot be read or has nothing to
    report, or where the folder cannot be written.
    """
    if is_sweep(results):
        pages = {INDEX: render("sweep", sweep_page(StoredSweep(results)))}
    else:
        with open_results(results) as opened:
            pages = _pages(opened, jobs, on_page, checked)
    write_pages(output, pages)
    return output / INDEX


def _pages(opened: OpenResults, jobs: int, on_page: OnPage, checked: bool) -> dict[str, str]:
    """By file name. What comes first is the index."""
    modes, bench, compared = (read_records(opened.path, kind) for kind in ("modes", "bench", "comparison"))
    has_runs = any(scene.methods for scene in opened.scenes.values()) or not (modes or bench or compared)
    data_pages = [
        (f"data--{i + 1}.html" if i else COMPARISON, f"Data against {one.scene}") for i, one in enumerate(compared)
    ]
    is_suite = has_runs and is_stability_suite(opened)
    kinds = [
        (has_runs, INDEX, "Stability suite" if is_suite else "Overview"),
        (bool(bench), BENCH, "Error against run time"),
        (bool(modes), MODES, "Modes"),
        *((True, file, label) for file, label in data_pages),
        (has_runs and checked, CHECK, "Accuracy check"),
    ]
    there = [(file, label) for has, file, label in kinds if has]
    names = {file: INDEX if not place else file for place, (file, _) in enumerate(there)}
    main = [(names[file], label) for file, label in there]
    pages: dict[str, str] = {}
    site = Site(tuple(main))
    if is_suite:
        pages |= stability_pages(opened, INDEX, site)
    elif has_runs:
        context, figures = _prepared(opened, main)
        site = context.site
        pages |= _run_pages(context, figures, jobs, on_page)
    if bench:
        pages |= bench_pages(opened, names[BENCH], site)
    if modes:
        pages[names[MODES]] = modes_page(list(read_modes(opened.path).values()), site, names[MODES])
    for (file, _), record in zip(data_pages, compared, strict=True):
        pages[names[file]] = render("data_comparison", comparison_page(record), site, names[file])
    if has_runs and checked:
        pages[CHECK] = render("check", check_page(opened.path), site, CHECK)
    return pages


def _prepared(opened: OpenResults, main: Sequence[tuple[str, str]]) -> tuple[Context, tuple[PaperFigure, ...]]:
    """What every page needs, and the figures that the file has; main: the site's pages that are known so far."""
    scenes = _scenes(opened)
    if not scenes:
        raise StoreError(f"{opened.path}: no scene in it, nothing to report")
    decided, figures = tuple(claims(scenes)), available(scenes)
    has_errata = bool(errata_analysis.entries(opened)) or _has_printed_model(scenes)
    more = [(WALK, "The paper's figures")] if figures else []
    more += [(ERRATA, "Errata")] if has_errata else []
    context = Context(
        opened.path,
        page_names(scenes),
        decided,
        published.conditions() if decided else {},
        stored_claims(opened) if decided else None,
        by_scene(read_records(opened.path, "bench")),
        published.errata() if has_errata else (),
        Site((main[0], *more, *main[1:])),
    )
    return context, figures


def _scenes(opened: OpenResults) -> dict[str, StoredScene]:
    return {name: _read_once(opened.scenes[name]) for name in natural_order(opened.scenes)}


class _ReadOnce(StoredRun):
    """A run whose arrays stay in memory: the pages ask for each of them some six times."""

    @cached_property
    def _known(self) -> dict[str, NDArray[Any]]:
        return {}

    def array(self, name: str) -> NDArray[Any]:
        if name not in self._known:
            self._known[name] = super().array(name)
        return self._known[name]


def _read_once(scene: StoredScene) -> StoredScene:
    runs = {name: _ReadOnce(*(getattr(run, one.name) for one in fields(run))) for name, run in scene.runs.items()}
    return replace(scene, runs=dict(runs))


def _run_pages(context: Context, figures: Sequence[PaperFigure], jobs: int, on_page: OnPage) -> dict[str, str]:
    """The index, errata, figures one by one, and a page per scene."""
    files = [Path(INDEX), *([Path(ERRATA)] if context.errata else [])]
    parts = _parts(context, [*files, *context.files, *figures], jobs, on_page)
    pages = {file.name: str(parts[file]) for file in files}
    pages |= {file: str(parts[scene]) for scene, file in context.files.items()}
    if figures:
        walk = {"figures": [parts[figure] for figure in figures]}
        pages[WALK] = render("walk", walk, context.site, WALK)
    return pages


def _has_printed_model(scenes: Mapping[str, StoredScene]) -> bool:
    printed = (run_selection.PRINTED, *errata_methods().values())
    return any(name in scene.methods for scene in scenes.values() for name in printed)


def _parts(context: Context, parts: Sequence[Part], jobs: int, on_page: OnPage) -> dict[Part, object]:
    """The parts, in `jobs` processes (in this one where it is 1)."""
    workers = min(jobs, len(parts))
    work = partial(make_parts, context)
    if workers <= 1:
        return work(parts)
    # More groups of pages than workers, so that none waits long for the last one; each group opens the file.
    count = _GROUPS * workers
    found: dict[Part, object] = {}
    on_page(0, len(parts))
    for finished in run_tasks(work, [parts[start::count] for start in range(count)], workers, _TIMEOUT_S):
        if finished.value is None:
            raise finished.error or StoreError(f"{context.results}: a page was not made: {finished.message}")
        found |= finished.value
        on_page(len(found), len(parts))
    return found


def make_parts(context: Context, parts: Sequence[Part]) -> dict[Part, object]:
    """The task of a worker: pages, and the content of figures. Raises StoreError."""
    with open_results(context.results) as opened:
        scenes = _scenes(opened)
        return {part: _part(context, opened, scenes, part) for part in parts}


def _part(context: Context, opened: OpenResults, scenes: Mapping[str, StoredScene], part: Part) -> object:
    from rotor_mbs.report.pages.errata import errata_page
    from rotor_mbs.report.pages.figures import walk_figure
    from rotor_mbs.report.pages.index import index_page
    from rotor_mbs.report.pages.scene import scene_page  # late: matplotlib, in the workers alone

    if isinstance(part, PaperFigure):
        return walk_figure(part, scenes, context.claims, context.files)
    if part == Path(INDEX):
        page = index_page(
            opened, scenes, context.files, context.claims, context.conditions, context.errata,
            study=context.study, curves=context.curves,
        )  # fmt: skip
        return render("index", page, context.site, INDEX)
    if isinstance(part, Path):
        page = errata_page(context.errata, errata_analysis.entries(opened), scenes, context.files)
        return render("errata", page, context.site, ERRATA)
    names = list(context.files)
    place = names.index(part)
    page = scene_page(
        scenes[part],
        [claim for claim in context.claims if part in claim.published.scenes],
        context.conditions,
        previous=context.files[names[place - 1]] if place else "",
        following=context.files[names[place + 1]] if place + 1 < len(names) else "",
        study=context.study,
        curves=context.curves.get(part, ()),
    )
    return render("scene", page, context.site)
