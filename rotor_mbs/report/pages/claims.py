"""Tables of the paper's numbers and claims against the models, for the index and for the pages of scenes."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import replace

from rotor_mbs.analysis.claim_shares import ClaimShares
from rotor_mbs.analysis.claims import Claim, ClaimResult, Reading
from rotor_mbs.analysis.published import TrajectoryNumber
from rotor_mbs.report.core.elements import PageTable, Row, TableCell
from rotor_mbs.report.core.numbers import fixed, number, with_unit
from rotor_mbs.report.pages import claim_study

ROUNDING = "amplified rounding error, which depends on how the equations are written"
_STATISTICS = {
    "min": "smallest",
    "max": "largest",
    "max_abs": "largest magnitude of",
    "range": "range of",
    "max_abs_change": "largest change of",
    "net_change": "change from start to end of",
    "reversals": "changes of sign of",
    "growth": "growth (later by earlier departure) of",
    "swing_ratio": "largest by smallest swing of",
}
_WITHOUT_UNIT = ("reversals", "growth", "swing_ratio")
_UNITS = {"angle": "rad", "rate": "rad/s"}


def number_table(claims: Iterable[Claim]) -> PageTable:
    """The published numbers, a row each."""
    head = ("Figure", "In the paper", "Printed", "As printed", "Verdict", "Corrected model", "Corrected model agrees?")
    rows = [_number_row(claim) for claim in claims if claim.published.is_number]
    return PageTable("Published numbers", head, rows, numeric=(2, 3, 5))


def claim_table(claims: Iterable[Claim], shares: ClaimShares | None = None) -> PageTable:
    """The claims in words, a row each: by the shares of many runs where there are any, else by the stored runs."""
    rows = [_claim_row(claim, shares) for claim in claims if not claim.published.is_number]
    return PageTable("Published claims", ("Figure", "In the paper", "As printed", "Corrected model"), rows)


def description_of(asked: TrajectoryNumber) -> str:
    """What is read off a trajectory: "largest pitch 1 rate"."""
    body = "rotor" if asked.coordinate == 0 else f"pitch {asked.coordinate}"
    return f"{_STATISTICS.get(asked.statistic, asked.statistic)} {body} {asked.quantity}"


def unit_of(asked: TrajectoryNumber) -> str:
    """The unit of the number, "" where it has none."""
    return "" if asked.statistic in _WITHOUT_UNIT else _UNITS[asked.quantity]


def _number_row(claim: Claim) -> Row:
    item, printed, corrected = claim.published, claim.printed, claim.corrected
    assert item.of is not None  # every number has it
    verdict = _verdict(printed.holds, "reproduced", "not reproduced")
    if item.rounding and printed.holds:
        verdict = replace(verdict, note=ROUNDING)
    return [
        item.figure,
        TableCell(f"{description_of(item.of)} ({unit_of(item.of)})", note=f"«{item.quote}»", note_language="es"),
        fixed(item.value, item.decimals),
        fixed(printed.value, item.decimals + 2),
        verdict,
        fixed(corrected.value, item.decimals + 2),
        _verdict(corrected.holds, "yes", "no"),
    ]


def _claim_row(claim: Claim, shares: ClaimShares | None) -> Row:
    item = claim.published
    quoted = TableCell(item.statement, note=f"«{item.quote}»", note_language="es")
    if shares is None or item.id not in shares.claims:
        return [item.figure, quoted, _stored_verdict(claim.printed), _stored_verdict(claim.corrected)]
    cells = (claim_study.verdict_cell(shares.of(item.id, method)) for method in shares.methods)
    return [item.figure, quoted, *cells]


def _stored_verdict(result: ClaimResult) -> TableCell:
    cell = _verdict(result.holds, "holds", "does not hold")
    return replace(cell, note=_evidence(result) if result.holds is not None else "")


def _verdict(holds: bool | None, yes: str, no: str) -> TableCell:
    if holds is None:
        return TableCell("–")
    return TableCell(yes if holds else no, tone="good" if holds else "bad")


def _evidence(outcome: ClaimResult) -> str:
    """The reading that decides: the first that fails, or the first of all where none does."""
    failed = [reading for reading in outcome.readings if reading.holds is False]
    shown = failed or list(outcome.readings)
    if not shown:
        return ""
    text = _reading(shown[0])
    if len(shown) > 1:
        text += f"; {len(shown) - 1} more {'fail' if failed else 'tests hold'}"
    if outcome.ended_early:
        text += f" (judged by the samples there are: the run ended early in {', '.join(outcome.ended_early)})"
    return text


def _reading(reading: Reading) -> str:
    """ "paper/fig05: largest pitch 1 angle 0.21 rad, < 0.5"."""
    test, of, than = reading.test, reading.test.of, reading.test.than
    text = f"{of.scene}: {description_of(of)} {_measured(reading.value, of)}"
    if reading.value is None and than is None:
        return text
    sign: str = "opposite to" if test.relation == "opposite" else test.relation
    if test.bound is not None:
        sign += f" {number(test.bound, 3)}"
    text += f", {sign}" if reading.holds else f", not {sign}"
    if than is not None:
        scene = "" if than.scene == of.scene else f"{than.scene} "
        same = (than.quantity, than.coordinate, than.statistic) == (of.quantity, of.coordinate, of.statistic)
        text += f" {scene}{'' if same else description_of(than) + ' '}{_measured(reading.limit, than)}"
    return text


def _measured(value: float | None, asked: TrajectoryNumber) -> str:
    if value is None:
        return "undefined (no motion)"
    return with_unit(value, unit_of(asked), 3) if unit_of(asked) else number(value, 3)
