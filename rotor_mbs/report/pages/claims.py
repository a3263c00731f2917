"""Tables of what the paper says against what the models give. Knows verdicts, judges nothing."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import replace

from rotor_mbs.analysis.claims import Claim, Outcome, Reading
from rotor_mbs.report import texts
from rotor_mbs.report.core.elements import Cell, Table
from rotor_mbs.report.core.numbers import fixed


def number_table(claims: Iterable[Claim]) -> Table:
    """The published numbers, a row each."""
    rows = [_number_row(claim) for claim in claims if claim.published.is_number]
    head = (
        texts.FIGURE, texts.IN_THE_PAPER, texts.PRINTED, texts.PRINTED_COLUMN, texts.VERDICT, texts.RIGHT_COLUMN,
        texts.ALSO_RIGHT,
    )  # fmt: skip
    return Table(texts.NUMBERS, head, rows, numeric=(2, 3, 5))


def claim_table(claims: Iterable[Claim]) -> Table:
    """The claims in words, a row each."""
    rows = [_claim_row(claim) for claim in claims if not claim.published.is_number]
    return Table(texts.CLAIMS, (texts.FIGURE, texts.IN_THE_PAPER, texts.PRINTED_COLUMN, texts.RIGHT_COLUMN), rows)


def conditions_of(scene: str, conditions: Mapping[str, str]) -> list[str]:
    """What had to be found out for this scene alone."""
    key = scene.rpartition("/")[2]
    return [conditions[key]] if key in conditions else []


def general_conditions(conditions: Mapping[str, str]) -> list[str]:
    """What had to be found out for all."""
    return [text for key, text in conditions.items() if not key.startswith("fig")]


def _number_row(claim: Claim) -> list[Cell]:
    item = claim.published
    assert item.of is not None
    what = texts.asked(item.of.quantity, item.of.coordinate, item.of.statistic)
    unit = "rad" if item.of.quantity == "angle" else "rad/s"
    printed, right = claim.printed, claim.right
    return [
        Cell(item.figure),
        Cell(f"{what} ({unit})", note=f"«{item.quote}»", language="es"),
        Cell(fixed(item.value, item.decimals)),
        Cell(fixed(printed.value, item.decimals + 2)),
        _reproduced(claim),
        Cell(fixed(right.value, item.decimals + 2)),
        _verdict(right.holds, texts.YES, texts.NO),
    ]


def _reproduced(claim: Claim) -> Cell:
    cell = _verdict(claim.printed.holds, texts.REPRODUCED, texts.NOT_REPRODUCED)
    is_matched = claim.published.matched and claim.printed.holds
    return replace(cell, note=f"{texts.GROWN_ROUNDING}; {texts.MATCHED}") if is_matched else cell


def _claim_row(claim: Claim) -> list[Cell]:
    item = claim.published
    return [
        Cell(item.figure),
        Cell(item.statement, note=f"«{item.quote}»", language="es"),
        _claim_cell(claim.printed),
        _claim_cell(claim.right),
    ]


def _verdict(holds: bool | None, yes: str, no: str) -> Cell:
    if holds is None:
        return Cell(texts.UNDECIDED)
    return Cell(yes if holds else no, tone="good" if holds else "bad")


def _claim_cell(outcome: Outcome) -> Cell:
    cell = _verdict(outcome.holds, texts.HOLDS, texts.HOLDS_NOT)
    return Cell(cell.text, cell.tone, note=_evidence(outcome)) if outcome.holds is not None else cell


def _evidence(outcome: Outcome) -> str:
    """The reading that decides: the first that fails; the first of all where none does."""
    failed = [reading for reading in outcome.readings if reading.holds is False]
    shown = failed or list(outcome.readings)
    if not shown:
        return ""
    text = _reading(shown[0])
    if len(shown) > 1:
        text += texts.more_readings(len(shown) - 1, bool(failed))
    if outcome.broke_off:
        text += f" ({texts.ENDED_EARLY_NOTE} {', '.join(outcome.broke_off)})"
    return text


def _reading(reading: Reading) -> str:
    test, of = reading.test, reading.test.of
    text = (
        f"{of.scene}: {texts.asked(of.quantity, of.coordinate, of.statistic)} "
        f"{texts.measured(reading.value, of.quantity, of.statistic)}"
    )
    if reading.value is None and test.than is None:
        return text
    sign = (
        texts.relation(test.relation, test.bound)
        if reading.holds
        else texts.not_so(texts.relation(test.relation, test.bound))
    )
    text += f", {sign}"
    if test.than is not None:
        than = test.than
        other = "" if than.scene == of.scene else f"{than.scene} "
        same = (than.quantity, than.coordinate, than.statistic) == (of.quantity, of.coordinate, of.statistic)
        what = "" if same else f"{texts.asked(than.quantity, than.coordinate, than.statistic)} "
        text += f" {other}{what}{texts.measured(reading.limit, than.quantity, than.statistic)}"
    return text
