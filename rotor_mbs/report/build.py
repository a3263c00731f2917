"""The report of a results file: every page is made in a process pool, then all are written."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import partial
from pathlib import Path

from rotor_mbs.analysis import errata as errata_analysis
from rotor_mbs.analysis import published, run_selection
from rotor_mbs.analysis.claim_records import ClaimStudy, stored_claims
from rotor_mbs.analysis.claims import Claim, claims
from rotor_mbs.analysis.work_precision import by_scene
from rotor_mbs.errors import StoreError
from rotor_mbs.execution.pool import run_tasks
from rotor_mbs.methods.catalogue import errata_methods
from rotor_mbs.report.core.files import ERRATA, INDEX, WALK, page_names, render, write_pages
from rotor_mbs.report.pages.errata import errata_page
from rotor_mbs.report.pages.index import index_page
from rotor_mbs.report.paper_figures import PaperFigure, available
from rotor_mbs.scenario.catalogue import natural_order
from rotor_mbs.store.read import OpenResults, StoredScene, open_results
from rotor_mbs.store.records import Record, read_records

Part = str | PaperFigure  # a scene by its name, or a figure of the paper
_GROUPS = 2  # per worker
_TIMEOUT_S = 600.0


@dataclass(frozen=True)
class Context:
    """What the page of a scene or a figure needs to know of the rest of the file.

    files: the file name of each scene's page, in order; curves: error against run time, by scene
    """

    results: Path
    files: Mapping[str, str]
    claims: tuple[Claim, ...]
    conditions: Mapping[str, str]
    has_errata: bool
    study: ClaimStudy | None
    curves: Mapping[str, Sequence[Record]]


def write_report(results: Path, output: Path, jobs: int = 1) -> Path:
    """Write the pages about the results file into the folder `output`, with `jobs` processes.

    Returns the path of the index. Nothing is written before every page is made. Raises StoreError where the file
    cannot be read or has no scene, or where the folder cannot be written.
    """
    with open_results(results) as opened:
        context, pages, figures = _prepared(opened)
    parts = _parts(context, figures, jobs)
    if figures:
        walk = [parts[figure] for figure in figures]
        pages[WALK] = render("walk", {"figures": walk, "has_errata": context.has_errata})
    pages |= {file: str(parts[scene]) for scene, file in context.files.items()}
    write_pages(output, pages)
    return output / INDEX


def _prepared(opened: OpenResults) -> tuple[Context, dict[str, str], tuple[PaperFigure, ...]]:
    """The context, the pages that need the whole file, and the figures that it has."""
    scenes = {name: opened.scenes[name] for name in natural_order(opened.scenes)}
    if not scenes:
        raise StoreError(f"{opened.path}: no scene in it, nothing to report")
    files = page_names(scenes)
    decided = tuple(claims(scenes))
    conditions = published.conditions() if decided else {}
    study = stored_claims(opened) if decided else None
    entries = errata_analysis.entries(opened)
    errata = published.errata() if entries or _has_printed_model(scenes) else ()
    figures = available(scenes)
    curves = by_scene(read_records(opened.path, "bench"))
    index = index_page(
        opened, scenes, files, decided, conditions, errata, has_walk=bool(figures), study=study, curves=curves
    )
    pages = {INDEX: render("index", index)}
    if errata:
        pages[ERRATA] = render("errata", errata_page(errata, entries, scenes, files))
    return Context(opened.path, files, decided, conditions, bool(errata), study, curves), pages, figures


def _has_printed_model(scenes: Mapping[str, StoredScene]) -> bool:
    printed = (run_selection.PRINTED, *errata_methods().values())
    return any(name in scene.methods for scene in scenes.values() for name in printed)


def _parts(context: Context, figures: Sequence[PaperFigure], jobs: int) -> dict[Part, object]:
    """All scenes and figures, in `jobs` processes (in this one where it is 1)."""
    parts: list[Part] = [*context.files, *figures]
    workers = min(jobs, len(parts))
    work = partial(make_parts, context)
    if workers <= 1:
        return work(parts)
    # More groups of pages than workers, so that none waits long for the last one; each group opens the file.
    count = _GROUPS * workers
    found: dict[Part, object] = {}
    for finished in run_tasks(work, [parts[start::count] for start in range(count)], workers, _TIMEOUT_S):
        if finished.value is None:
            raise finished.error or StoreError(f"{context.results}: a page was not made: {finished.message}")
        found |= finished.value
    return found


def make_parts(context: Context, parts: Sequence[Part]) -> dict[Part, object]:
    """The task of a worker: the page of each scene, and the content of each figure. Raises StoreError."""
    from rotor_mbs.report.pages.figures import walk_figure
    from rotor_mbs.report.pages.scene import scene_page  # late: matplotlib, in the workers alone

    names = list(context.files)
    neighbours = dict(zip(names, zip(["", *names], [*names[1:], ""], strict=False), strict=True))
    found: dict[Part, object] = {}
    with open_results(context.results) as opened:
        for part in parts:
            if isinstance(part, PaperFigure):
                found[part] = walk_figure(part, opened.scenes, context.claims, context.files)
                continue
            previous, following = (context.files.get(other, "") for other in neighbours[part])
            own = [claim for claim in context.claims if part in claim.published.scenes]
            page = scene_page(
                opened.scenes[part], own, context.conditions,
                has_errata=context.has_errata, previous=previous, following=following, study=context.study,
                curves=context.curves.get(part, ()),
            )  # fmt: skip
            found[part] = render("scene", page)
    return found
