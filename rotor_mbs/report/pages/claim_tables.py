"""The paper's numbers and claims against the models: tables of stored runs, shares of many runs, other conditions."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import replace

from rotor_mbs.analysis.claim_study import FAILS, HOLDS, RULE, UNDECIDED, ClaimShares, Conditions, NumberTrials
from rotor_mbs.analysis.claims import STATISTICS, Claim
from rotor_mbs.analysis.published import Published, published
from rotor_mbs.report.core.elements import PageTable, Row, TableCell
from rotor_mbs.report.core.numbers import NOTHING, SPACE, fixed, number, power, with_unit

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
        description = f"{STATISTICS[item.of.statistic].text} {body} {item.of.quantity} ({_unit(item)})"
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
    """Of a number; "" where it has none."""
    return _UNITS[item.of.quantity] if item.of is not None and STATISTICS[item.of.statistic].has_unit else ""


def claim_table(claims: Iterable[Claim], shares: ClaimShares | None = None) -> PageTable:
    """The claims in words, a row each: verdicts by the shares of many runs, if there are any, else by stored runs."""
    durations = [] if shares is None else shares.durations
    head = ["Figure", "Claim"]
    for side in ("As printed", "Corrected model"):
        head += [side, *(f"over {duration:g}{SPACE}s" for duration in durations)]
    rows: list[Row] = []
    for claim in claims:
        item = claim.published
        if item.is_number:
            continue
        statement = TableCell(item.statement, note=f"«{item.quote}»", note_language="es")
        row: list[TableCell | str] = [item.figure, statement]
        for place, result in enumerate((claim.printed, claim.corrected)):
            if shares is None or item.id not in shares.claims:
                row += [_verdict(result.holds, HOLDS, FAILS), *[""] * len(durations)]
                continue
            method = shares.methods[place]
            verdict = shares.verdict(item.id, method)
            row.append(TableCell(verdict, tone=_TONES[verdict]))
            for share in shares.of(item.id, method):
                percent = f"{100.0 * share.share:.0f}{SPACE}%" if share.deciding else NOTHING
                row.append(TableCell(percent, note=f"of {share.deciding}"))
        rows.append(row)
    return PageTable("Published claims", head, rows)


def _verdict(holds: bool | None, yes: str, no: str) -> TableCell:
    if holds is None:
        return TableCell(NOTHING)
    return TableCell(yes if holds else no, tone="good" if holds else "bad")


def study_note(shares: ClaimShares) -> str:
    """What the shares are, and the rule of the verdicts."""
    return (
        f"Percentages: of the deciding runs, of {shares.runs} of each scene from starts whose angles were moved by up "
        f"to {number(shares.spread)} rad. {RULE}"
    )


def trial_tables(trials: NumberTrials) -> list[PageTable]:
    """The published numbers for other durations, other tolerances and other ways of writing the first row of (56)."""
    items = {item.id: item for item in published() if item.id in trials.numbers}
    heads = [f"Fig. {item.figure}: {fixed(item.value, item.decimals)} {_unit(item)}" for item in items.values()]
    usual = trials.usual

    def values(conditions: Conditions) -> list[TableCell]:
        tried = trials.under(conditions)
        return [
            TableCell(fixed(tried[name].value, item.decimals), tone="good" if tried[name].reproduced else "")
            for name, item in items.items()
        ]

    durations: list[Row] = [
        [with_unit(conditions.duration, "s"), *values(conditions)] for conditions in trials.of_row(usual.gravity_row)
    ]
    tolerances: list[Row] = [
        [_power(conditions.relative_tolerance), _power(conditions.absolute_tolerance), *values(conditions)]
        for conditions in trials.with_tolerances()
    ]
    rows: list[Row] = []
    for row, formula in trials.rows.items():
        conditions = replace(usual, gravity_row=row)
        remainder = next(iter(trials.under(conditions).values())).remainder
        rows.append([formula, number(remainder), *values(conditions)])
    over = f", over {with_unit(usual.duration, 's')}"
    return [
        PageTable("The published numbers by the duration of the run", ("Duration", *heads), durations),
        PageTable(f"The published numbers by the tolerances of ode45{over}", ("RelTol", "AbsTol", *heads), tolerances),
        PageTable(f"By the way of writing the first row of (56){over}", ("Row", "At the start (N m)", *heads), rows),
    ]


def _power(value: float) -> str:
    return power(int(f"{value:.0e}".partition("e")[2]))
