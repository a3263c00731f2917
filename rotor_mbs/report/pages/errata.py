"""The errata page: the errors in print, every entry that was checked, the effect of each erratum on each scene."""

from __future__ import annotations

import re
from collections.abc import Sequence

from markupsafe import Markup

from rotor_mbs.analysis.published import CheckedEntry, checked_entries
from rotor_mbs.methods.catalogue import errata_methods
from rotor_mbs.report.core.elements import PageTable, Row, Section, TableCell
from rotor_mbs.report.core.numbers import formula, number, prefixed
from rotor_mbs.report.pages import Report
from rotor_mbs.report.pages.scene_tables import metric, status_text
from rotor_mbs.solution.status import GOOD

_PLACE = re.compile(r"row (\d) column (\d)")
Cell = tuple[Markup, Markup | None]  # an entry as printed; the correct one where it is faulty


def errata_page(report: Report) -> dict[str, object]:
    """The content of the page of errata."""
    entries = checked_entries()
    agreeing = [entry for entry in entries if entry.agrees]
    differing = [entry for entry in entries if not entry.agrees]
    differing_table = PageTable(
        f"{len(differing)} of {len(entries)} printed entries differ from what follows from (3); the errata explain "
        f"{sum(bool(entry.explained_by) for entry in differing)}",
        ("Equation", "Entry", "Printed", "Correct", "Relative difference", "Explained by"),
        [
            (
                e.equation,
                e.entry,
                formula(e.printed),
                formula(e.right),
                number(e.difference),
                e.explained_by or "nothing",
            )
            for e in differing
        ],
    )
    # What each erratum alone does.
    effects_head = ["Scene"]
    for erratum in errata_methods():
        for what in ("angle change to the horizon (rad)", "whole run (rad)", "energy gain"):
            effects_head.append(f"{erratum}: {what}")
    effects: list[Row] = []
    for name, scene in report.scenes.items():
        runs = [scene.methods.get(method) for method in errata_methods().values()]
        row: list[TableCell | str] = [TableCell(name, href=report.files[name], note=scene.title)]
        for run in runs:
            if run is None:
                row += ["", "", ""]
                continue
            status = "" if run.status in GOOD else status_text(run)
            row.append(TableCell(number(metric(run, "angle_error_max")), note=status))
            row += [number(metric(run, "angle_error_whole")), prefixed(metric(run, "energy_gain_J"), "J")]
        if any(run is not None for run in runs):
            effects.append(row)
    effects_table = PageTable("", effects_head, effects)
    agreeing_rows = [(e.equation, e.entry, formula(e.printed), number(e.difference)) for e in agreeing]
    return {
        "errata": [(erratum, matrices(entries, erratum.stands_in)) for erratum in report.errata],
        "differing": Section(tables=[differing_table]),
        "effects": Section(tables=[effects_table]),
        "agreeing": PageTable("", ("Equation", "Entry", "Printed", "Relative difference"), agreeing_rows),
        "largest_agreeing": max((entry.difference for entry in agreeing), default=0.0),
    }


def matrices(entries: Sequence[CheckedEntry], equations: Sequence[str]) -> list[tuple[str, list[list[Cell]]]]:
    """(equation, rows of its matrix) of those of `equations` that are matrices."""
    shown = []
    for equation in equations:
        places = {}
        for entry in entries:
            place = _PLACE.fullmatch(entry.entry)
            if entry.equation == equation and place is not None:
                places[int(place[1]), int(place[2])] = entry
        if places:
            rows, columns = (range(1, 1 + max(place[axis] for place in places)) for axis in (0, 1))
            matrix = []
            for row in rows:
                cells: list[Cell] = []
                for column in columns:
                    checked = places.get((row, column))
                    printed = Markup() if checked is None else formula(checked.printed)
                    cells.append((printed, None if checked is None or checked.agrees else formula(checked.right)))
                matrix.append(cells)
            shown.append((equation, matrix))
    return shown
