"""The paper's claims as shares of many runs, and its numbers under other conditions, from reference/claims.json.

The runs are chaotic: a claim may hold for one rounding and fail for the next. So it was tested on runs from many starts
moved by rounding, for several durations. `tests/support/make_claims.py` computes the file.
"""

from __future__ import annotations

import functools
import json
import math
from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import NamedTuple

from rotor_mbs.scenario.catalogue import reference_folder

HOLDS, FAILS, UNDECIDED = "holds", "fails", "undecided"
SURE = 0.95  # share of the deciding runs from which on a claim holds; 1 - SURE: up to which it fails
DECIDING = 0.5  # share of the runs that must decide
RULE = (
    f"A claim holds where at least {100 * SURE:.0f} % of the deciding runs say so for every duration, fails where at "
    f"most {100 * (1 - SURE):.0f} % do for every duration, and is undecided otherwise, also where fewer than "
    f"{100 * DECIDING:.0f} % of the runs decide. A run that broke off or whose energy rose a thousandfold decides "
    "nothing."
)


@dataclass(frozen=True)
class ClaimShare:
    """A claim tested on the runs of one method for one duration (s).

    marks: one for each run, the first from the start as given, the others from moved starts: "y" where the claim
    holds, "n" where it fails, "-" where the run decides nothing.
    """

    claim: str
    method: str
    duration: float
    marks: str

    @property
    def moved(self) -> str:
        """Marks of the runs from moved starts."""
        return self.marks[1:]

    @property
    def deciding(self) -> int:
        """How many runs from moved starts decide."""
        return len(self.moved) - self.moved.count("-")

    @property
    def share(self) -> float:
        """Share of the deciding runs from moved starts in which the claim holds; NaN where none decides."""
        return self.moved.count("y") / self.deciding if self.deciding else math.nan

    @property
    def verdict(self) -> str:
        """ "holds", "fails" or "undecided" for this duration alone."""
        if not self.deciding or self.deciding < DECIDING * len(self.moved):
            return UNDECIDED
        return HOLDS if self.share >= SURE else FAILS if self.share <= 1.0 - SURE else UNDECIDED


@dataclass(frozen=True)
class ClaimShares:
    """All shares of a study; starts were moved by `spread` (rad) at most, in so many runs of each."""

    shares: tuple[ClaimShare, ...]
    spread: float
    runs: int

    @property
    def durations(self) -> list[float]:
        return sorted({share.duration for share in self.shares})

    @property
    def claims(self) -> list[str]:
        return list(dict.fromkeys(share.claim for share in self.shares))

    @property
    def methods(self) -> list[str]:
        return list(dict.fromkeys(share.method for share in self.shares))

    def of(self, claim: str, method: str) -> list[ClaimShare]:
        shares = [share for share in self.shares if share.claim == claim and share.method == method]
        return sorted(shares, key=lambda share: share.duration)

    def verdict(self, claim: str, method: str) -> str:
        """ "holds", "fails" or "undecided" whatever the rounding and the duration; "" without data."""
        verdicts = {share.verdict for share in self.of(claim, method)} or {""}
        return verdicts.pop() if len(verdicts) == 1 else UNDECIDED

    def count(self, method: str) -> dict[str, int]:
        verdicts = [self.verdict(claim, method) for claim in self.claims]
        return {verdict: verdicts.count(verdict) for verdict in (HOLDS, FAILS, UNDECIDED)}


@dataclass(frozen=True, order=True)
class Conditions:
    """What the paper does not print: way of writing the first row of (56), duration (s), tolerances of ode45."""

    gravity_row: str
    duration: float
    relative_tolerance: float
    absolute_tolerance: float


@dataclass(frozen=True)
class NumberTrial:
    """A published number, by its id, as read off the printed model's run (rad or rad/s; NaN where there is none).

    reproduced: whether it has the printed digits. remainder: N m, the row's value at the start of Fig. 5: zero but for
    rounding.
    """

    number: str
    conditions: Conditions
    value: float
    reproduced: bool
    remainder: float


@dataclass(frozen=True)
class NumberTrials:
    """All trials of a study.

    usual: the conditions of the paper's scenes. rows: formulas of the tried ways of writing the row, by name;
    rows_of_56: those that are the row as printed, multiplied out in one order or another.
    """

    trials: tuple[NumberTrial, ...]
    usual: Conditions
    rows: Mapping[str, str]
    rows_of_56: tuple[str, ...]

    @property
    def numbers(self) -> list[str]:
        return list(dict.fromkeys(trial.number for trial in self.trials))

    def under(self, conditions: Conditions) -> dict[str, NumberTrial]:
        return {trial.number: trial for trial in self.trials if trial.conditions == conditions}

    def reproduces_all(self, conditions: Conditions) -> bool:
        return sum(trial.reproduced for trial in self.under(conditions).values()) == len(self.numbers)

    def of_row(self, row: str) -> list[Conditions]:
        """Those with this way of writing the row and the usual tolerances, by duration."""
        usual = replace(self.usual, gravity_row=row)
        tried = {trial.conditions for trial in self.trials}
        return sorted(conditions for conditions in tried if conditions == replace(usual, duration=conditions.duration))

    def durations_of_all(self, row: str) -> list[float]:
        """s, for which all numbers come out with this way of writing the row and the usual tolerances."""
        return [conditions.duration for conditions in self.of_row(row) if self.reproduces_all(conditions)]

    def with_tolerances(self) -> list[Conditions]:
        """Those of the usual row and duration, by tolerance."""
        usual = self.usual.gravity_row, self.usual.duration
        tried = {trial.conditions for trial in self.trials}
        return sorted(conditions for conditions in tried if (conditions.gravity_row, conditions.duration) == usual)


class ClaimStudy(NamedTuple):
    shares: ClaimShares
    numbers: NumberTrials


@functools.cache
def claim_study() -> ClaimStudy:
    """Read reference/claims.json.

    >>> study = claim_study()
    >>> study.shares.verdict("fig11-pitches-grow", "printed/ode45")
    'holds'
    >>> study.numbers.durations_of_all("multiplied_in")   # s, for which all four published numbers come out
    [12.0]
    """
    data = json.loads((reference_folder() / "claims.json").read_text(encoding="utf-8"))
    shares = ClaimShares(tuple(ClaimShare(**row) for row in data["shares"]), data["spread"], data["runs"])
    trials = []
    for row in data["trials"]:
        number, value, reproduced, remainder = (row.pop(key) for key in ("number", "value", "reproduced", "remainder"))
        value = math.nan if value is None else value
        trials.append(NumberTrial(number, Conditions(**row), value, reproduced, remainder))
    rows = {row["name"]: row["formula"] for row in data["rows"]}
    of_56 = tuple(row["name"] for row in data["rows"] if row["is_of_56"])
    return ClaimStudy(shares, NumberTrials(tuple(trials), Conditions(**data["usual"]), rows, of_56))
