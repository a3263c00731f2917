"""The paper's claims tested on runs: their statistics, the rule of the verdicts, and all runs of the study.

claim_runs.json has the runs, reference/claims.json what follows from them; `make_claims` makes both.
"""

from __future__ import annotations

import functools
import json
import math
import operator
from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Literal, NamedTuple, Protocol

import numpy as np

from rotor_mbs.analysis.published import FAILS, HOLDS, UNDECIDED, Published, TrajectoryNumber
from rotor_mbs.solution.trajectory import Array

FILE = Path(__file__).with_name("claim_runs.json")

# Numbers read off runs


class RunArrays(Protocol):
    """Arrays of a run by name: time (n,), angles, rates (n, 1 + blades); None where it has no such array."""

    def get(self, name: str, /) -> Array | None: ...


def _reversals(x: Array) -> float:
    signs = np.sign(x[x != 0.0])
    return float(np.count_nonzero(signs[1:] != signs[:-1]))


def _growth(t: Array, x: Array) -> float | None:
    """Largest departure from the start over the second half of the time reached by that over the first half."""
    first = t <= 0.5 * (t[0] + t[-1])
    away = np.abs(x - x[0])
    before = float(away[first].max())
    return float(away[~first].max()) / before if before > 0.0 and not first.all() else None


def _swing_ratio(x: Array) -> float | None:
    """Largest by smallest way from one turning point to the next; the start counts as one."""
    moving = np.flatnonzero(np.diff(x) != 0.0)
    signs = np.sign(np.diff(x)[moving])
    turning = moving[1:][signs[1:] != signs[:-1]]
    swings = np.abs(np.diff(x[[0, *turning]]))
    return float(swings.max() / swings.min()) if len(swings) >= 2 else None


STATISTICS: Mapping[str, Callable[[Array, Array], float | None]] = {
    "min": lambda _, x: float(x.min()),
    "max": lambda _, x: float(x.max()),
    "max_abs": lambda _, x: float(np.abs(x).max()),
    "range": lambda _, x: float(np.ptp(x)),
    "max_abs_change": lambda _, x: float(np.abs(x - x[0]).max()),
    "net_change": lambda _, x: float(x[-1] - x[0]),
    "reversals": lambda _, x: _reversals(x),
    "growth": _growth,
    "swing_ratio": lambda _, x: _swing_ratio(x),
}


def measure(run: RunArrays, asked: TrajectoryNumber) -> float | None:
    """The number in rad or rad/s (reversals and growth: 1); None where the run has no such data or it is undefined."""
    time, values = run.get("time"), run.get({"angle": "angles", "rate": "rates"}[asked.quantity])
    if time is None or values is None or not len(values) or asked.coordinate >= values.shape[1]:
        return None
    return STATISTICS[asked.statistic](time, values[:, asked.coordinate])


# Claims in words

# What is read off the runs of one model: None where it is undefined; without it where no run can decide.
NumberValues = Mapping[TrajectoryNumber, float | None]

_RELATIONS: Mapping[str, Callable[[float, float], bool]] = {
    "<": operator.lt,
    ">": operator.gt,
    "opposite": lambda value, other: value * other < 0.0,
}


class Condition(NamedTuple):
    """`of` stands in `relation` to another number, or to a bound; "opposite" means of opposite sign."""

    of: TrajectoryNumber
    relation: Literal["<", ">", "opposite"]
    than: TrajectoryNumber | None = None
    bound: float | None = None


def conditions_of(item: Published) -> list[Condition]:
    """The tests of a claim."""
    conditions = []
    for test in item.tests:
        sides = {side: TrajectoryNumber(*test[side]) for side in ("of", "than") if side in test}
        conditions.append(Condition(**{**test, **sides}))
    return conditions


def numbers_of(item: Published) -> list[TrajectoryNumber]:
    """All that is read off runs for a number or a claim, each once."""
    sides = [item.of, *(side for test in conditions_of(item) for side in (test.of, test.than))]
    return list(dict.fromkeys(side for side in sides if side is not None))


def claim_holds(item: Published, values: NumberValues) -> bool | None:
    """Whether all tests of a claim in words hold for what was read off the runs.

    False as soon as one fails, even where others cannot be decided; None where none fails and one is undecided.
    """
    undecided = not item.tests
    for test in conditions_of(item):
        if test.of not in values or (test.than is not None and test.than not in values):
            undecided = True
            continue
        value, limit = values[test.of], test.bound if test.than is None else values[test.than]
        if value is None or limit is None or not _RELATIONS[test.relation](value, limit):
            return False
    return None if undecided else True


# Shares of many runs

SURE = 0.95  # share of the deciding runs from which on a claim holds; 1 - SURE: up to which it fails
DECIDING = 0.5  # share of the runs that must decide
RULE = (
    f"A claim holds if it is true in at least {100 * SURE:.0f} % of the deciding runs for every duration, fails if it "
    f"is true in at most {100 * (1 - SURE):.0f} % for every duration, and is undecided otherwise, or if fewer than "
    f"{100 * DECIDING:.0f} % of the runs are deciding. A run that ended early or whose energy rose a thousandfold is "
    "not deciding."
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


class ClaimRuns(NamedTuple):
    shares: ClaimShares
    numbers: NumberTrials


@functools.cache
def claim_runs() -> ClaimRuns:
    """Read claim_runs.json."""
    data = json.loads(FILE.read_text(encoding="utf-8"))
    shares = ClaimShares(tuple(ClaimShare(**row) for row in data["shares"]), data["spread"], data["runs"])
    trials = []
    for row in data["trials"]:
        number, value, reproduced, remainder = (row.pop(key) for key in ("number", "value", "reproduced", "remainder"))
        value = math.nan if value is None else value
        trials.append(NumberTrial(number, Conditions(**row), value, reproduced, remainder))
    rows = {row["name"]: row["formula"] for row in data["rows"]}
    of_56 = tuple(row["name"] for row in data["rows"] if row["is_of_56"])
    return ClaimRuns(shares, NumberTrials(tuple(trials), Conditions(**data["usual"]), rows, of_56))
