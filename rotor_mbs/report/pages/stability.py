"""Pages of the stability suite: the map, and a page per scene. Reads the store alone; judges nothing."""

from __future__ import annotations

from collections.abc import Collection, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

from rotor_mbs.analysis.stability import OUTCOMES, Advice, Cell, advice, cells, in_words, is_number, reached_by
from rotor_mbs.report.core.elements import Cell as Entry
from rotor_mbs.report.core.elements import Section, Table
from rotor_mbs.report.core.environment import render
from rotor_mbs.report.core.files import INDEX, page_names, write_pages
from rotor_mbs.report.names import name_of
from rotor_mbs.report.pages import stability_texts as words
from rotor_mbs.report.pages.stability_scene import scene_page
from rotor_mbs.store.read import open_results
from rotor_mbs.store.stability import Record, read_records


@dataclass(frozen=True)
class Mark:
    """A cell of the map: outcome names its colour, symbol and text are read, href leads to the scene's page."""

    outcome: str
    symbol: str
    text: str
    href: str


@dataclass(frozen=True)
class MapRow:
    scene: str
    href: str
    title: str
    marks: Sequence[Mark | None]
    right_by: str


@dataclass(frozen=True)
class StabilityPage:
    """The map. families: (name, rows); key: (outcome, symbol, words)."""

    methods: Sequence[str]
    families: Sequence[tuple[str, Sequence[MapRow]]]
    key: Sequence[tuple[str, str, str]]
    summary: Sequence[str]
    lead: Sequence[str]
    sections: Sequence[Section]


def write_stability_report(results: Path, output: Path) -> Path:
    """The map and a page per scene into `output`; returns the map's path. Raises StoreError."""
    found, records = cells(results), read_records(results)
    with open_results(results) as opened:
        names = list(dict.fromkeys(cell.scene for cell in found))
        files = page_names(names)
        titles = {name: opened.scenes[name].title for name in names}
        pages = {INDEX: render("stability", _map(found, records, files, titles))}
        for i, name in enumerate(names):
            own = [cell for cell in found if cell.scene == name]
            ladders = [record for record in records if record.kind == "steps" and record.scene == name]
            previous, following = names[i - 1] if i else "", names[i + 1] if i + 1 < len(names) else ""
            page = scene_page(opened.scenes[name], own, ladders, files.get(previous, ""), files.get(following, ""))
            pages[files[name]] = render("scene", page)
    write_pages(output, pages)
    return output / INDEX


def _map(
    found: Sequence[Cell], records: Sequence[Record], files: dict[str, str], titles: dict[str, str]
) -> StabilityPage:
    methods = list(dict.fromkeys(cell.method for cell in found))
    families: dict[str, list[MapRow]] = {}
    for name, file in files.items():
        own = {cell.method: cell for cell in found if cell.scene == name}
        any_cell = next(iter(own.values()))
        marks = [_mark(own[method], file) if method in own else None for method in methods]
        row = MapRow(name, file, titles[name], marks, _right_by(own.values(), any_cell))
        families.setdefault(words.FAMILIES.get(any_cell.family, any_cell.family), []).append(row)
    sections = [_limits(records), _kept(records)]
    used = {cell.outcome for cell in found}
    return StabilityPage(
        [name_of(method) for method in methods],
        list(families.items()),
        [(outcome, symbol, text) for outcome, (symbol, text) in OUTCOMES.items() if outcome in used],
        [in_words(_named(one)) for one in advice(found)],
        [words.LEAD, words.false_successes(sum(cell.false_success for cell in found))],
        [section for section in sections if section.has_content],
    )


def _named(one: Advice) -> Advice:
    """Methods by the names, families by the headings that the map has for them."""
    use, in_part, avoid = (
        tuple(f"“{words.FAMILIES.get(family, family)}”" for family in kind)
        for kind in (one.use, one.in_part, one.avoid)
    )
    return replace(one, method=name_of(one.method), use=use, in_part=in_part, avoid=avoid)


def _mark(cell: Cell, file: str) -> Mark:
    symbol, text = OUTCOMES[cell.outcome]
    claimed = "!" if cell.false_success and cell.outcome != "false_success" else ""
    return Mark(cell.outcome, symbol + claimed, f"{name_of(cell.method)}: {text}. {cell.message}".strip(), file)


def _right_by(own: Collection[Cell], any_cell: Cell) -> str:
    if not any_cell.has_reference:
        return words.NO_REFERENCE
    if all(cell.angle_error is None for cell in own):
        return words.NOT_COMPARED
    method = reached_by(own, any_cell.scene)
    return words.NOBODY if method is None else name_of(method)


def _limits(records: Sequence[Record]) -> Section:
    rows = []
    for record in records:
        if record.kind != "limits" or not is_number(record.attributes["largest_stable_step_s"]):
            continue
        facts = record.attributes
        step, theory, mode = facts["largest_stable_step_s"], facts["theory_s"], facts["fastest_mode_per_s"]
        numbers = [f"{step:.4g}", f"{theory:.4g}", f"{step / theory:.3f}", f"{step * mode:.3f}"]
        numbers.append(f"{facts['mode_damping_ratio']:.3g}")
        rows.append([Entry(record.scene), Entry(name_of(record.method)), *map(Entry, numbers)])
    head = [words.SCENE, words.METHOD, words.MEASURED, words.THEORY, words.RATIO, words.SCALED, words.DAMPING]
    return Section(
        "limits", words.LIMITS, tables=[Table(words.LIMITS, head, rows, (2, 3, 4, 5, 6))], notes=[words.LIMITS_NOTE]
    )


def _kept(records: Sequence[Record]) -> Section:
    rows = []
    for record in records:
        if record.kind == "conservation":
            values = [record.attributes.get(name) for name in words.KEPT_COLUMNS]
            shown = [Entry("–" if value is None else f"{value:.2g}") for value in values]
            rows.append([Entry(record.scene), Entry(name_of(record.method)), *shown])
    head = [words.SCENE, words.METHOD, *words.KEPT_COLUMNS.values()]
    columns = range(2, len(head))
    return Section("kept", words.KEPT, tables=[Table(words.KEPT, head, rows, tuple(columns))], notes=[words.KEPT_NOTE])
