"""The paper's numbers and claims against the models: tables of stored runs, shares of many runs, other conditions."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import replace

from rotor_mbs.analysis.claims import STATISTICS, Claim
from rotor_mbs.analysis.published import FAILS, HOLDS, UNDECIDED, ClaimStudy, Published, published
from rotor_mbs.report.core.elements import PageTable, Row, TableCell
from rotor_mbs.report.core.numbers import NOTHING, SPACE, fixed, number

ROUNDING = "amplified rounding error, which depends on how the equations are written"
_UNITS = {"angle": "rad", "rate": "rad/s"}
_TONES = {HOLDS: "good", FAILS: "bad", UNDECIDED: ""}


def number_table(claims: Iterable[Claim]) -> PageTable:
    """The published numbers, a row each."""
    head = ("Figure", "Quantity", "Published", "As printed", "Reproduced?", "Corrected model", "Same number?")
    rows: list[Row] = []
    for claim in claims:
        item, printed, corrected = claim.published, claim.printed, claim.corrected
        if item.of is None:
            continue
        verdict = _verdict(printed.holds, "yes", "no")
        if item.rounding and printed.holds:
            verdict = replace(verdict, note=ROUNDING)
        body = "rotor" if item.of.coordinate == 0 else f"pitch {item.of.coordinate}"
        _, words = STATISTICS[item.of.quantity, item.of.statistic]
        description = f"{words} {body} {item.of.quantity} ({_unit(item)})"
        rows.append([
            item.figure,
            TableCell(description, note=f"«{item.quote}»", note_language="es"),
            fixed(item.value, item.decimals),
            fixed(printed.value, item.decimals + 2),
            verdict,
            fixed(corrected.value, item.decimals + 2),
            _verdict(corrected.holds, "yes", "no"),
        ])  # fmt: skip
    return PageTable("Published numbers", head, rows)


def _unit(item: Published) -> str:
    return _UNITS[item.of.quantity] if item.of is not None else ""


def claim_table(claims: Iterable[Claim], study: ClaimStudy) -> PageTable:
    """The claims in words, a row each: verdicts by the shares of many runs."""
    head = ["Figure", "Claim"]
    for side in ("As printed", "Corrected model"):
        head += [side, *(f"over {duration:g}{SPACE}s" for duration in study.durations)]
    rows: list[Row] = []
    for claim in claims:
        item = claim.published
        if item.is_number:
            continue
        statement = TableCell(item.statement, note=f"«{item.quote}»", note_language="es")
        row: list[TableCell | str] = [item.figure, statement]
        for method in study.methods:
            verdict = study.verdicts[item.id][method]
            row.append(TableCell(verdict, tone=_TONES[verdict]))
            for share, deciding in study.shares[item.id][method]:
                percent = NOTHING if share is None else f"{100.0 * share:.0f}{SPACE}%"
                row.append(TableCell(percent, note=f"of {deciding}"))
        rows.append(row)
    return PageTable("Published claims", head, rows)


def _verdict(holds: bool | None, yes: str, no: str) -> TableCell:
    if holds is None:
        return TableCell(NOTHING)
    return TableCell(yes if holds else no, tone="good" if holds else "bad")


def study_note(study: ClaimStudy) -> str:
    """What the shares are, and the rule of the verdicts."""
    return (
        f"Percentages: of the deciding runs, of {study.runs} of each scene from starts whose angles were moved by up "
        f"to {number(study.spread)} rad. {study.rule}"
    )


def trial_tables(study: ClaimStudy) -> list[PageTable]:
    """The published numbers for other durations, other tolerances and other ways of writing the first row of (56)."""
    items = [item for item in published() if item.id in study.numbers]
    heads = [f"Fig. {item.figure}: {fixed(item.value, item.decimals)} {_unit(item)}" for item in items]
    tables = []
    for table in study.trials:
        rows: list[Row] = []
        for labels, values, reproduced in table.rows:
            cells = [
                TableCell(fixed(value, item.decimals), tone="good" if is_reproduced else "")
                for value, is_reproduced, item in zip(values, reproduced, items, strict=True)
            ]
            rows.append([*labels, *cells])
        tables.append(PageTable(table.caption, (*table.head, *heads), rows))
    return tables
