"""A report from a results file: pages made in parallel, each worker with the file open for itself, then written.

Knows the order of things only.
"""

from __future__ import annotations

import multiprocessing
from collections.abc import Iterator, Mapping, Sequence
from concurrent.futures import ProcessPoolExecutor
from dataclasses import dataclass
from pathlib import Path

from rotor_mbs.analysis import errata as errata_analysis
from rotor_mbs.analysis import methods, published
from rotor_mbs.analysis.claims import Claim, claims
from rotor_mbs.errors import StoreError
from rotor_mbs.report import paper_set, texts
from rotor_mbs.report.core.environment import Entry, ScenePage, WalkPage, render
from rotor_mbs.report.core.files import ERRATA, INDEX, WALK, page_names, write_pages
from rotor_mbs.report.pages import claims as claim_tables
from rotor_mbs.report.pages import scene_tables as metrics
from rotor_mbs.report.pages.errata import errata_page
from rotor_mbs.report.pages.index import index_page
from rotor_mbs.scenario.names import natural_order
from rotor_mbs.store.read import Results, StoredScene, open_results

_PIECES = 2  # per worker


@dataclass(frozen=True)
class SceneTask:
    """A scene's page to be made, and what it needs to know of the rest of the file."""

    scene: str
    claims: tuple[Claim, ...]
    conditions: tuple[str, ...]
    has_errata: bool
    previous: str
    next: str


@dataclass(frozen=True)
class FigureTask:
    """A figure of the paper for the walk, and what it needs to know of the rest of the file."""

    number: str
    claims: tuple[Claim, ...]
    files: Mapping[str, str]


@dataclass(frozen=True)
class _Made:
    """What a worker gives back: pages by scene, the walk's entries by figure."""

    pages: dict[str, str]
    entries: dict[str, Entry]


def write_report(results: Path, output: Path, jobs: int = 1) -> Path:
    """Pages from the results file into the folder `output`, with `jobs` processes; returns the index.

    Raises StoreError where the file cannot be read, has no scene, or the folder cannot be written. Nothing is written
    before every page is made.
    """
    with open_results(results) as opened:
        tasks, files, pages = _prepared(opened)
    made = _made(results, tasks, jobs)
    if made.entries:
        in_order = sorted(made.entries.values(), key=lambda entry: int(entry.number))
        pages[WALK] = render("walk", WalkPage(in_order, has_errata=ERRATA in pages))
    pages |= {files[scene]: text for scene, text in made.pages.items()}
    write_pages(output, pages)
    return output / INDEX


def made_of(results: Path, tasks: Sequence[SceneTask | FigureTask]) -> _Made:
    """HTML of each scene, entry of each figure. Raises StoreError."""
    from rotor_mbs.report.pages import walk  # late: matplotlib, in the workers alone

    made = _Made({}, {})
    with open_results(results) as opened:
        figures = {one.number: one for one in paper_set.available(opened.scenes)}
        for task in tasks:
            if isinstance(task, SceneTask):
                made.pages[task.scene] = render("scene", _scene_page(opened.scenes[task.scene], task))
            else:
                figure = figures[task.number]
                made.entries[task.number] = walk.entry(figure, opened.scenes, task.claims, task.files)
    return made


def _prepared(opened: Results) -> tuple[list[SceneTask | FigureTask], dict[str, str], dict[str, str]]:
    """What is to be made for the scenes, their file names, and the pages that need the whole file."""
    scenes = {name: opened.scenes[name] for name in natural_order(opened.scenes)}
    if not scenes:
        raise StoreError(f"{opened.path}: no scene in it, nothing to report")
    files = page_names(scenes)
    said_of = claims(scenes)
    conditions = published.conditions() if said_of else {}
    entries = errata_analysis.entries(opened)
    errata = published.errata() if entries or _speaks_of_errata(scenes) else ()
    figures = paper_set.available(scenes)
    index = index_page(opened, scenes, files, said_of, conditions, errata, has_walk=bool(figures))
    pages = {INDEX: render("index", index)}
    if errata:
        pages[ERRATA] = render("errata", errata_page(errata, entries, scenes, files))
    tasks: list[SceneTask | FigureTask] = list(_tasks(files, said_of, conditions, has_errata=bool(errata)))
    tasks += [FigureTask(one.number, tuple(said_of), files) for one in figures]
    return tasks, files, pages


def _speaks_of_errata(scenes: Mapping[str, StoredScene]) -> bool:
    return any(
        name in scene.methods for scene in scenes.values() for name in (methods.PRINTED, *methods.ALONE.values())
    )


def _tasks(
    files: Mapping[str, str], said_of: Sequence[Claim], conditions: Mapping[str, str], *, has_errata: bool
) -> Iterator[SceneTask]:
    names = list(files)
    for i, name in enumerate(names):
        yield SceneTask(
            name,
            tuple(claim for claim in said_of if name in claim.published.scenes),
            tuple(claim_tables.conditions_of(name, conditions)),
            has_errata,
            files[names[i - 1]] if i else "",
            files[names[i + 1]] if i + 1 < len(names) else "",
        )


def _made(results: Path, tasks: Sequence[SceneTask | FigureTask], jobs: int) -> _Made:
    """All tasks, in `jobs` processes (here where it is one)."""
    workers = min(jobs, len(tasks))
    if workers <= 1:
        return made_of(results, tasks)
    # A few tasks a piece: opening the file costs as much as two pictures, waiting for the slowest piece more.
    pieces = [tasks[start :: _PIECES * workers] for start in range(_PIECES * workers)]
    made = _Made({}, {})
    # spawn: the parent may have threads of numerical libraries, which a fork would copy half-way.
    with ProcessPoolExecutor(workers, mp_context=multiprocessing.get_context("spawn")) as pool:
        for piece in pool.map(made_of, [results] * len(pieces), pieces):
            made.pages.update(piece.pages)
            made.entries.update(piece.entries)
    return made


def _scene_page(scene: StoredScene, task: SceneTask) -> ScenePage:
    from rotor_mbs.report.pages.scene import lead, sections, source_comment  # late: matplotlib, in the workers alone

    return ScenePage(
        name=scene.name,
        title=scene.title,
        figures=texts.figures(str(scene.attributes.get("figures", ""))),
        lead=lead(scene),
        failures=metrics.failures(scene),
        source=source_comment(scene),
        sections=sections(scene, task.claims, task.conditions),
        toml=str(scene.attributes.get("scene_toml", "")),
        has_errata=task.has_errata,
        previous=task.previous,
        next=task.next,
    )
