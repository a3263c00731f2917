"""The errata page: the errors in print, every entry that was checked, the effect of each erratum on each scene."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

from rotor_mbs.analysis.errata import CheckedEntry, Effect, effects
from rotor_mbs.analysis.published import Erratum
from rotor_mbs.methods.catalogue import errata_methods
from rotor_mbs.report.core.elements import PageTable, Section, TableCell
from rotor_mbs.report.core.numbers import number, prefixed
from rotor_mbs.report.pages.scene_tables import status_text
from rotor_mbs.store.read import StoredScene


@dataclass(frozen=True)
class ErrataPage:
    """largest_agreeing: the largest relative difference of an entry that agrees."""

    errata: Sequence[Erratum]
    differing: Section
    effects: Section
    agreeing: PageTable
    largest_agreeing: float


def errata_page(
    errata: Sequence[Erratum],
    entries: Sequence[CheckedEntry],
    scenes: Mapping[str, StoredScene],
    files: Mapping[str, str],
) -> ErrataPage:
    """scenes: in order; files: the file name of each scene's page."""
    agreeing = [entry for entry in entries if entry.agrees]
    return ErrataPage(
        errata,
        Section(tables=[_differing_table([entry for entry in entries if not entry.agrees], len(entries))]),
        Section(tables=[_effects_table(scenes, files)]),
        _agreeing_table(agreeing),
        max((entry.difference for entry in agreeing), default=0.0),
    )


def _differing_table(entries: Sequence[CheckedEntry], checked: int) -> PageTable:
    head = ("Equation", "Entry", "Printed", "Correct", "Relative difference", "Explained by")
    rows = [
        [
            TableCell(one.equation), TableCell(one.entry), TableCell(one.printed), TableCell(one.right),
            TableCell(number(one.difference)), TableCell(one.explained_by or "nothing"),
        ]
        for one in entries
    ]  # fmt: skip
    caption = f"{len(entries)} of {checked} printed entries differ from what follows from (3)"
    return PageTable(caption, head, rows, numeric=(4,))


def _agreeing_table(entries: Sequence[CheckedEntry]) -> PageTable:
    head = ("Equation", "Entry", "Printed", "Relative difference")
    rows = [[*map(TableCell, (e.equation, e.entry, e.printed, number(e.difference)))] for e in entries]
    return PageTable("", head, rows, numeric=(3,))


def _effects_table(scenes: Mapping[str, StoredScene], files: Mapping[str, str]) -> PageTable:
    head = ["Scene"]
    for erratum in errata_methods():
        head += [
            f"{erratum}: {what}" for what in ("angle change to the horizon (rad)", "whole run (rad)", "energy gain")
        ]
    rows = []
    for name, scene in scenes.items():
        found = effects(scene)
        if found:
            cells = [cell for erratum in errata_methods() for cell in _effect_cells(found.get(erratum))]
            rows.append([TableCell(name, href=files[name], note=scene.title), *cells])
    return PageTable("", head, rows, numeric=range(1, len(head))).without_empty_columns()


def _effect_cells(effect: Effect | None) -> list[TableCell]:
    if effect is None:
        return [TableCell(""), TableCell(""), TableCell("")]
    return [
        TableCell(number(effect.angle_horizon), note="" if effect.status == "ok" else status_text(effect.status)),
        TableCell(number(effect.angle_whole)),
        TableCell(prefixed(effect.energy_gain, "J")),
    ]
