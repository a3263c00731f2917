"""The paper's numbers and claims against the models: tables of stored runs, shares of many runs, other conditions."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import replace

from rotor_mbs.analysis.claim_study import (
    FAILS,
    HOLDS,
    RULE,
    UNDECIDED,
    ClaimShares,
    Conditions,
    NumberTrials,
    count_of_rows,
)
from rotor_mbs.analysis.claims import STATISTICS, Claim, ClaimResult, Reading
from rotor_mbs.analysis.published import Published, TrajectoryNumber, published
from rotor_mbs.report.core.elements import PageTable, Row, TableCell
from rotor_mbs.report.core.numbers import fixed, number, power, with_unit
from rotor_mbs.solution.text_table import listed

ROUNDING = "amplified rounding error, which depends on how the equations are written"
_UNITS = {"angle": "rad", "rate": "rad/s"}
_TONES = {HOLDS: "good", FAILS: "bad", UNDECIDED: ""}
_VERBS = {HOLDS: "hold whatever the rounding and the duration", FAILS: "fail", UNDECIDED: "are undecided"}


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
    return f"{STATISTICS[asked.statistic].text} {body} {asked.quantity}"


def unit_of(asked: TrajectoryNumber) -> str:
    """The unit of the number, "" where it has none."""
    return _UNITS[asked.quantity] if STATISTICS[asked.statistic].has_unit else ""


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
    return [item.figure, quoted, *(_verdict_cell(shares, item.id, method) for method in shares.methods)]


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


def _verdict_cell(study: ClaimShares, claim: str, method: str) -> TableCell:
    """The verdict of one model whatever the rounding and the duration; the shares below it.

    Such as "100 %, 97 % and 12 % of 100, 100 and 87 deciding runs over 8, 10 and 12 s".
    """
    shares, verdict = study.of(claim, method), study.verdict(claim, method)
    percents = listed(["–" if not one.deciding else f"{100.0 * one.share:.0f}\N{NO-BREAK SPACE}%" for one in shares])
    deciding = [str(one.deciding) for one in shares]
    runs = deciding[0] if len(set(deciding)) == 1 else listed(deciding)
    note = f"{percents} of {runs} deciding runs over {_durations([one.duration for one in shares])}"
    return TableCell(verdict, tone=_TONES[verdict], note=note)


def study_note(shares: ClaimShares) -> str:
    """How the shares were found, and the rule of the verdicts."""
    return (
        f"Shares: {shares.runs} runs of each scene by the printed equations and by the closed form, with every angle "
        f"of the start moved by up to {number(shares.spread)} rad, over {_durations(shares.durations)}, read off "
        f"samples 0.01 s apart. {RULE}"
    )


def headline(shares: ClaimShares) -> str:
    """How many claims hold, fail and are undecided in each model, in one sentence."""
    parts = []
    for method, name in zip(shares.methods, ("printed", "corrected"), strict=True):
        count = shares.count(method)
        said = [f"{count[verdict]} {verb}" for verdict, verb in _VERBS.items() if count[verdict]]
        parts.append(f"in the {name} model {listed(said)}")
    return (
        f"Of the paper's {len(shares.claims)} claims in words, {parts[0]}; {parts[1]} ({shares.runs} runs each from "
        f"starts moved by up to {number(shares.spread)} rad, over {_durations(shares.durations)})."
    )


def numbers_headline(trials: NumberTrials) -> str:
    """Under which one set of conditions all numbers come out; "" where they do not."""
    usual = trials.usual
    if not trials.reproduces_all(usual):
        return ""
    count, of = count_of_rows(trials, usual.duration)
    return (
        f"All {len(trials.numbers)} come out under one set of conditions, over {with_unit(usual.duration, 's')}, for "
        f"{count} of {of} ways of writing one row of (56): the likelier reading of what the authors ran, not a proof."
    )


def trial_tables(trials: NumberTrials) -> list[PageTable]:
    """The published numbers for other durations, other tolerances and other ways of writing the first row of (56)."""
    items = {item.id: item for item in published() if item.id in trials.numbers}
    heads = [
        f"Fig. {item.figure}: {fixed(item.value, item.decimals)} {unit_of(item.of)}"
        for item in items.values()
        if item.of is not None  # every number has it
    ]
    usual = trials.usual
    over = f", over {with_unit(usual.duration, 's')}"

    def table(caption: str, head: Sequence[str], labels: Mapping[Conditions, Row], first: int = 1) -> PageTable:
        rows = [[*texts, *_cells(trials, one, items)] for one, texts in labels.items()]
        return PageTable(caption, (*head, *heads), rows, numeric=range(first, len(head) + len(heads)))

    durations: dict[Conditions, Row] = {one: [with_unit(one.duration, "s")] for one in trials.of_row(usual.gravity_row)}
    tolerances: dict[Conditions, Row] = {
        one: [_power(one.relative_tolerance), _power(one.absolute_tolerance)] for one in trials.with_tolerances()
    }
    rows: dict[Conditions, Row] = {}
    for row in trials.rows:
        conditions = replace(usual, gravity_row=row)
        for trial in list(trials.under(conditions).values())[:1]:
            rows[conditions] = [TableCell(trials.rows[row]), number(trial.remainder)]
    return [
        table("The published numbers by the duration of the run", ("Duration",), durations),
        table(f"The published numbers by the tolerances of ode45{over}", ("RelTol", "AbsTol"), tolerances, 2),
        table(f"By the way of writing the first row of (56){over}", ("Row", "At the start (N m)"), rows),
    ]


def trial_note(trials: NumberTrials) -> str:
    """For how many ways of writing the row all numbers come out."""
    duration = trials.usual.duration
    count, of = count_of_rows(trials, duration)
    elsewhere = [d for d in sorted({one.duration for one in trials.conditions}) if d != duration]
    others = sum(count_of_rows(trials, one)[0] for one in elsewhere)
    return (
        f"{count} of {of} ways of writing the printed row give all {len(trials.numbers)} numbers over "
        f"{with_unit(duration, 's')}, {others or 'none'} over {_durations(elsewhere)}. Where the row is exactly zero "
        "at the start of Fig. 5, nothing moves."
    )


def _cells(trials: NumberTrials, conditions: Conditions, items: Mapping[str, Published]) -> list[TableCell]:
    found = trials.under(conditions)
    return [
        TableCell(fixed(found[name].value, item.decimals), tone="good" if found[name].reproduced else "")
        for name, item in items.items()
    ]


def _power(value: float) -> str:
    return power(int(f"{value:.0e}".partition("e")[2]))


def _durations(values: Sequence[float]) -> str:
    return f"{listed([f'{value:g}' for value in values])} s"
