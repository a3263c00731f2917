"""The paper's claims as fractions: the share of many runs, from starts moved by rounding, in which each claim holds.

The runs are chaotic: what a claim says may hold for one rounding and fail for the next. So it is tested on runs from
many starts, for several durations, and holds or fails only where nearly all runs say so.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from rotor_mbs.analysis.claims import NumberValues, all_hold, readings_of
from rotor_mbs.analysis.published import Published, TrajectoryNumber
from rotor_mbs.analysis.trajectory_numbers import measure
from rotor_mbs.solution.status import COMPLETE, code_of
from rotor_mbs.solution.trajectory import Array

HOLDS, FAILS, UNDECIDED = "holds", "fails", "undecided"
SURE = 0.95  # share of the deciding runs from which on a claim holds; 1 - SURE: up to which it fails
DECIDING = 0.5  # share of the runs that must decide
ENERGY_GAIN = 1e3  # of the energy scale: a run that gains as much decides nothing
RULE = (
    f"A claim holds where at least {SURE:.0%} of the deciding runs say so for every duration, fails where at most "
    f"{1 - SURE:.0%} do for every duration, and is undecided otherwise, also where fewer than {DECIDING:.0%} of the "
    "runs decide. A run that broke off or whose energy rose a thousandfold decides nothing."
)
_MARKS = {True: "y", False: "n", None: "-"}


@dataclass(frozen=True)
class ClaimShare:
    """A claim tested on the runs of one method for one duration (s).

    marks   one for each run, the first from the start as given, the others from moved starts: "y" where the claim
            holds, "n" where it fails, "-" where the run decides nothing
    """

    claim: str
    method: str
    duration: float
    marks: str

    @property
    def deciding(self) -> int:
        """How many runs from moved starts decide."""
        return len(self.moved) - self.moved.count("-")

    @property
    def moved(self) -> str:
        """Marks of the runs from moved starts."""
        return self.marks[1:]

    @property
    def share(self) -> float:
        """Share of the deciding runs from moved starts in which the claim holds; NaN where none decides."""
        return self.moved.count("y") / self.deciding if self.deciding else float("nan")

    @property
    def verdict(self) -> str:
        """ "holds", "fails" or "undecided" for this duration alone."""
        if not self.deciding or self.deciding < DECIDING * len(self.moved):
            return UNDECIDED
        return HOLDS if self.share >= SURE else FAILS if self.share <= 1.0 - SURE else UNDECIDED


@dataclass(frozen=True)
class ClaimShares:
    """All shares of a study.

    spread   rad, by which starts were moved at most
    runs     from moved starts, for each claim, method and duration
    """

    shares: tuple[ClaimShare, ...]
    spread: float
    runs: int

    @property
    def durations(self) -> list[float]:
        """s, in ascending order."""
        return sorted({one.duration for one in self.shares})

    def of(self, claim: str, method: str) -> list[ClaimShare]:
        """By duration; [] where the study does not have the claim."""
        found = [one for one in self.shares if one.claim == claim and one.method == method]
        return sorted(found, key=lambda one: one.duration)

    @property
    def claims(self) -> list[str]:
        """Ids, in order."""
        return list(dict.fromkeys(one.claim for one in self.shares))

    @property
    def methods(self) -> list[str]:
        """In order: the printed equations, the corrected model."""
        return list(dict.fromkeys(one.method for one in self.shares))

    def count(self, method: str) -> dict[str, int]:
        """How many claims hold, fail, are undecided."""
        verdicts = [self.verdict(claim, method) for claim in self.claims]
        return {verdict: verdicts.count(verdict) for verdict in (HOLDS, FAILS, UNDECIDED)}

    def __str__(self) -> str:
        """A line for each claim and method: verdict, and share (deciding runs) for each duration."""
        lines = [f"shares of {self.runs} runs, starts moved by up to {self.spread:g} rad"]
        for claim in self.claims:
            for method in self.methods:
                shares = [f"{one.duration:g} s {one.share:.0%} ({one.deciding})" for one in self.of(claim, method)]
                lines.append(f"{claim:40s} {method:18s} {self.verdict(claim, method):10s} {'  '.join(shares)}")
        return "\n".join(lines)

    def verdict(self, claim: str, method: str) -> str:
        """ "holds", "fails" or "undecided" whatever the rounding and the duration; "" without data."""
        verdicts = {one.verdict for one in self.of(claim, method)} or {""}
        return verdicts.pop() if len(verdicts) == 1 else UNDECIDED


@dataclass(frozen=True)
class SampledRuns:
    """The runs of one scene by one method.

    time (n,) s; angles, rates (runs, n, 1 + blades) rad, rad/s; status (runs,) codes; energy_drift (runs,) of the scale
    """

    time: Array
    angles: Array
    rates: Array
    status: NDArray[np.int8]
    energy_drift: Array

    @property
    def decides(self) -> NDArray[np.bool_]:
        """(runs,) whether each reached its end without gaining a thousandfold energy."""
        complete = np.isin(self.status, [code_of(name) for name in COMPLETE])
        # Infinite or undefined: the energy is beyond all numbers.
        return complete & (np.nan_to_num(self.energy_drift, nan=np.inf) < ENERGY_GAIN)

    def values(self, asked: Sequence[TrajectoryNumber]) -> list[dict[TrajectoryNumber, float | None]]:
        """(runs,) the `asked` numbers of each run, None where one is undefined; none of a run that decides nothing."""
        runs = zip(self.decides.tolist(), self.angles, self.rates, strict=True)
        return [
            {one: measure({"time": self.time, "angles": angles, "rates": rates}, one) for one in asked if decides}
            for decides, angles, rates in runs
        ]


def marks(item: Published, runs: Iterable[NumberValues]) -> str:
    """A mark of the claim for each run; run k of one scene is compared with run k of another."""
    return "".join(_MARKS[all_hold(readings_of(item, values))] for values in runs)
