"""The paper's claims as shares of many runs, and its numbers under other conditions: cells, tables, sentences."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

from rotor_mbs.analysis.claim_shares import FAILS, HOLDS, RULE, UNDECIDED, ClaimShare, ClaimShares, joint_verdict
from rotor_mbs.analysis.number_trials import Conditions, NumberTrials, count_of_rows
from rotor_mbs.analysis.published import Published, published
from rotor_mbs.report.core.elements import PageTable, TableCell
from rotor_mbs.report.core.numbers import fixed, number, power, with_unit

_TONES = {HOLDS: "good", FAILS: "bad", UNDECIDED: ""}


def verdict_cell(shares: Sequence[ClaimShare]) -> TableCell:
    """The verdict of one model whatever the rounding and the duration; the shares below it."""
    verdict = joint_verdict(shares)
    return TableCell(verdict, tone=_TONES[verdict], note=shares_text(shares))


def shares_text(shares: Sequence[ClaimShare]) -> str:
    """ "100 %, 97 % and 12 % of 100, 100 and 87 deciding runs over 8, 10 and 12 s"."""
    percents = _listed(["–" if not one.deciding else f"{100.0 * one.share:.0f}\N{NO-BREAK SPACE}%" for one in shares])
    deciding = [str(one.deciding) for one in shares]
    runs = deciding[0] if len(set(deciding)) == 1 else _listed(deciding)
    return f"{percents} of {runs} deciding runs over {_durations([one.duration for one in shares])}"


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
        parts.append(f"in the {name} model {_listed(said)}")
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


_VERBS = {HOLDS: "hold whatever the rounding and the duration", FAILS: "fail", UNDECIDED: "are undecided"}


def trial_tables(trials: NumberTrials) -> list[PageTable]:
    """The published numbers for other durations, other tolerances and other ways of writing the first row of (56)."""
    items = {item.id: item for item in published() if item.id in trials.numbers}
    heads = [f"Fig. {item.figure}: {fixed(item.value, item.decimals)} {_unit(item)}" for item in items.values()]
    by_duration, by_tolerance = trials.of_row(trials.usual.gravity_row), trials.with_tolerances()
    return [
        PageTable(
            "The published numbers by the duration of the run",
            ("Duration", *heads),
            [[TableCell(with_unit(one.duration, "s")), *_cells(trials, one, items)] for one in by_duration],
            numeric=range(1, 1 + len(heads)),
        ),
        PageTable(
            f"The published numbers by the tolerances of ode45, over {with_unit(trials.usual.duration, 's')}",
            ("RelTol", "AbsTol", *heads),
            [
                [_power(one.relative_tolerance), _power(one.absolute_tolerance), *_cells(trials, one, items)]
                for one in by_tolerance
            ],
            numeric=range(2, 2 + len(heads)),
        ),
        _row_table(trials, items, heads),
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


def _row_table(trials: NumberTrials, items: Mapping[str, Published], heads: Sequence[str]) -> PageTable:
    rows = []
    for row in trials.rows:
        of_row = trials.of_row(row.name)
        usual = next((one for one in of_row if one.duration == trials.usual.duration), None)
        if usual is not None:
            remainder = next(iter(trials.under(usual).values())).remainder
            rows.append([TableCell(row.formula), TableCell(number(remainder)), *_cells(trials, usual, items)])
    caption = f"By the way of writing the first row of (56), over {with_unit(trials.usual.duration, 's')}"
    return PageTable(caption, ("Row", "At the start (N m)", *heads), rows, numeric=range(1, 2 + len(heads)))


def _cells(trials: NumberTrials, conditions: Conditions, items: Mapping[str, Published]) -> list[TableCell]:
    found = trials.under(conditions)
    return [
        TableCell(fixed(found[name].value, item.decimals), tone="good" if found[name].reproduced else "")
        for name, item in items.items()
    ]


def _power(value: float) -> TableCell:
    return TableCell(power(int(f"{value:.0e}".partition("e")[2])))


def _unit(item: Published) -> str:
    return "rad/s" if item.of is not None and item.of.quantity == "rate" else "rad"


def _durations(values: Sequence[float]) -> str:
    return f"{_listed([f'{value:g}' for value in values])} s"


def _listed(texts: Sequence[str]) -> str:
    return texts[0] if len(texts) == 1 else f"{', '.join(texts[:-1])} and {texts[-1]}"
