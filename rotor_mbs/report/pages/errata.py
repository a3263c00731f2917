"""The errata page: what is wrong in print, every checked entry, what each erratum does to each scene. Knows no HTML."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

from rotor_mbs.analysis.errata import Effect, Entry, effects
from rotor_mbs.analysis.methods import ALONE
from rotor_mbs.analysis.published import Erratum
from rotor_mbs.report import texts
from rotor_mbs.report.core.elements import Cell, Section, Table, without_empty_columns
from rotor_mbs.report.core.environment import ErrataPage
from rotor_mbs.report.core.numbers import number, prefixed
from rotor_mbs.store.read import StoredScene


def errata_page(
    errata: Sequence[Erratum], entries: Sequence[Entry], scenes: Mapping[str, StoredScene], files: Mapping[str, str]
) -> ErrataPage:
    """scenes: in order; files: each scene's page."""
    differing = [entry for entry in entries if not entry.agrees]
    agreeing = [entry for entry in entries if entry.agrees]
    sections = [
        Section("entries", texts.ENTRIES, tables=[_differing_table(differing, len(entries))]),
        Section("effects", texts.EFFECTS, tables=[_effects_table(scenes, files)], notes=[texts.EFFECTS_NOTE]),
    ]
    largest = max((entry.difference for entry in agreeing), default=0.0)
    return ErrataPage(
        errata,
        [section for section in sections if section.has_content],
        _agreeing_table(agreeing) if agreeing else None,
        texts.agreeing_summary(len(agreeing), largest),
    )


def _differing_table(entries: Sequence[Entry], checked: int) -> Table:
    head = (texts.EQUATION, texts.ENTRY, texts.PRINTED, texts.RIGHT, texts.RELATIVE_DIFFERENCE, texts.EXPLAINED_BY)
    rows = [
        [
            Cell(one.equation), Cell(one.entry), Cell(one.printed), Cell(one.right), Cell(number(one.difference)),
            Cell(one.explained_by or texts.UNEXPLAINED),
        ]
        for one in entries
    ]  # fmt: skip
    return Table(texts.differing_caption(len(entries), checked), head, rows, numeric=(4,))


def _agreeing_table(entries: Sequence[Entry]) -> Table:
    head = (texts.EQUATION, texts.ENTRY, texts.PRINTED, texts.RELATIVE_DIFFERENCE)
    rows = [[Cell(e.equation), Cell(e.entry), Cell(e.printed), Cell(number(e.difference))] for e in entries]
    return Table(texts.AGREEING, head, rows, numeric=(3,))


def _effects_table(scenes: Mapping[str, StoredScene], files: Mapping[str, str]) -> Table:
    head = [texts.SCENE]
    for erratum in ALONE:
        head += [texts.effect_column(erratum, what) for what in texts.EFFECT_COLUMNS]
    rows = []
    for name, scene in scenes.items():
        found = effects(scene)
        if found:
            cells = [cell for erratum in ALONE for cell in _effect_cells(found.get(erratum))]
            rows.append([Cell(name, href=files[name], note=scene.title), *cells])
    table = Table(texts.EFFECTS, head, rows, numeric=range(1, len(head)))
    return without_empty_columns(table) if rows else table


def _effect_cells(effect: Effect | None) -> list[Cell]:
    if effect is None:
        return [Cell(""), Cell(""), Cell("")]
    ended = "" if effect.status == "ok" else texts.status(effect.status)
    return [
        Cell(number(effect.angle_horizon), note=ended),
        Cell(number(effect.angle_whole)),
        Cell(prefixed(effect.energy_gain, "J")),
    ]
