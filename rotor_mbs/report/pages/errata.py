"""The errata page: the errors in print, every entry that was checked, the effect of each erratum on each scene."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

from rotor_mbs.analysis.errata import Effect, effects
from rotor_mbs.analysis.errata import entries as checked_entries
from rotor_mbs.methods.catalogue import errata_methods
from rotor_mbs.models.printed.errata import CheckedEntry
from rotor_mbs.report.core.elements import PageTable, Row, Section, TableCell
from rotor_mbs.report.core.numbers import number, prefixed
from rotor_mbs.report.pages import Context
from rotor_mbs.report.pages.formulas import matrices
from rotor_mbs.report.pages.scene_tables import status_text
from rotor_mbs.store.read import OpenResults, StoredScene


def errata_page(opened: OpenResults, context: Context) -> dict[str, object]:
    """The content of the page of errata."""
    entries = checked_entries(opened)
    agreeing = [entry for entry in entries if entry.agrees]
    return {
        "errata": [(one, matrices(entries, one.stands_in)) for one in context.errata],
        "differing": Section(tables=[_differing_table([one for one in entries if not one.agrees], len(entries))]),
        "effects": Section(tables=[_effects_table(opened.scenes, context.files)]),
        "agreeing": _agreeing_table(agreeing),
        "largest_agreeing": max((entry.difference for entry in agreeing), default=0.0),
    }


def _differing_table(entries: Sequence[CheckedEntry], checked: int) -> PageTable:
    head = ("Equation", "Entry", "Printed", "Correct", "Relative difference", "Explained by")
    rows = [
        (e.equation, e.entry, e.printed, e.right, number(e.difference), e.explained_by or "nothing") for e in entries
    ]
    caption = f"{len(entries)} of {checked} printed entries differ from what follows from (3)"
    return PageTable(caption, head, rows, numeric=(4,))


def _agreeing_table(entries: Sequence[CheckedEntry]) -> PageTable:
    head = ("Equation", "Entry", "Printed", "Relative difference")
    rows = [(e.equation, e.entry, e.printed, number(e.difference)) for e in entries]
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


def _effect_cells(effect: Effect | None) -> Row:
    if effect is None:
        return ["", "", ""]
    return [
        TableCell(number(effect.angle_horizon), note="" if effect.status == "ok" else status_text(effect.status)),
        number(effect.angle_whole),
        prefixed(effect.energy_gain, "J"),
    ]
