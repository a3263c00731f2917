"""The page of the accuracy check: what was seen, the bound, the margin and the outcome of verdicts on a file."""

from __future__ import annotations

import math
from collections.abc import Sequence
from pathlib import Path

from rotor_mbs.analysis.verdicts import Verdict
from rotor_mbs.report.core.elements import PageTable, Row, Section, TableCell
from rotor_mbs.report.core.numbers import NOTHING, number, with_unit
from rotor_mbs.report.pages.scene_tables import method_cell
from rotor_mbs.report.verdict_formats import WORST, largest_seen, printable, worst_first
from rotor_mbs.scenario.accuracy_bounds import load_bounds
from rotor_mbs.studies.check import judge_file


def check_page(results: Path) -> dict[str, object]:
    """What `rotor-mbs check` finds in the results file. Raises StoreError, InputError."""
    found = judge_file(results, load_bounds(None))
    failed = [one for one in found if not one.passed]
    count = f"{len(failed)} of {len(found)} verdicts fail" if failed else f"All {len(found)} verdicts pass"
    # A count of faults has no distance to its bound: zero is all there is.
    measured = [one for one in worst_first(found) if one.passed and 0.0 < one.margin < math.inf]
    return {
        "lead": [f"{count}: numbers computed again from the stored samples, each against its bound."],
        "failures": Section(tables=[_table("Verdicts that fail", worst_first(failed))]),
        "nearest": Section(tables=[_table("The verdicts that pass by least", measured[:WORST])]),
        "all": Section(
            tables=[_table("The largest number seen of every check, method and bound", largest_seen(found))]
        ),
    }


def _table(caption: str, verdicts: Sequence[Verdict]) -> PageTable:
    head = ("Check", "Method", "Where", "Seen", "Bound", "Margin", "Outcome")
    return PageTable(caption, head, [_row(one) for one in verdicts], numeric=(3, 4, 5))


def _row(one: Verdict) -> Row:
    outcome = TableCell("pass", "good") if one.passed else TableCell("fail", "bad", note=printable(one.look_at))
    return [
        printable(one.check),
        method_cell(printable(one.method)),
        TableCell(printable(one.scene), note=printable(one.channel)),
        number(one.value),
        with_unit(one.bound, one.unit),
        number(one.margin, 3) if math.isfinite(one.margin) else NOTHING,
        outcome,
    ]
