"""The paper's numbers under other conditions: which durations, tolerances and ways of writing a row reproduce them."""

from __future__ import annotations

from dataclasses import dataclass, replace

from rotor_mbs.models.printed.gravity_rows import GRAVITY_ROWS


@dataclass(frozen=True, order=True)
class Conditions:
    """What the paper does not print, or what depends on rounding.

    gravity_row   way of writing the first row of (56), as the setting of printed/ode45
    duration      s
    relative_tolerance, absolute_tolerance   of ode45; the latter in rad and rad/s
    """

    gravity_row: str
    duration: float
    relative_tolerance: float
    absolute_tolerance: float


@dataclass(frozen=True)
class NumberTrial:
    """A published number under some conditions.

    number      its id
    value       rad or rad/s, read off the printed model's run; NaN where there is none
    reproduced  whether it has the printed digits
    remainder   N m, the row's value at the start of Fig. 5: zero but for rounding
    """

    number: str
    conditions: Conditions
    value: float
    reproduced: bool
    remainder: float


@dataclass(frozen=True)
class NumberTrials:
    """All trials of a study.

    usual   the conditions of the paper's scenes, but for the duration
    rows    tried ways of writing the row, names of `GRAVITY_ROWS`, in order
    """

    trials: tuple[NumberTrial, ...]
    usual: Conditions
    rows: tuple[str, ...]

    @property
    def numbers(self) -> list[str]:
        """Ids, in order."""
        return list(dict.fromkeys(one.number for one in self.trials))

    @property
    def conditions(self) -> list[Conditions]:
        """All that were tried, in order."""
        return list(dict.fromkeys(one.conditions for one in self.trials))

    def under(self, conditions: Conditions) -> dict[str, NumberTrial]:
        """The trials under these conditions, by number."""
        return {one.number: one for one in self.trials if one.conditions == conditions}

    def reproduces_all(self, conditions: Conditions) -> bool:
        """Whether every number comes out."""
        return sum(one.reproduced for one in self.under(conditions).values()) == len(self.numbers)

    def durations_of_all(self, row: str) -> list[float]:
        """s, for which all numbers come out with this way of writing the row and the usual tolerances."""
        return [one.duration for one in self.of_row(row) if self.reproduces_all(one)]

    def of_row(self, row: str) -> list[Conditions]:
        """Those with this way of writing the row and the usual tolerances, by duration."""
        usual = replace(self.usual, gravity_row=row)
        return sorted(one for one in self.conditions if one == replace(usual, duration=one.duration))

    def with_tolerances(self) -> list[Conditions]:
        """Those of the usual row and duration, by tolerance."""
        same = (self.usual.gravity_row, self.usual.duration)
        return sorted(one for one in self.conditions if (one.gravity_row, one.duration) == same)


def count_of_rows(trials: NumberTrials, duration: float) -> tuple[int, int]:
    """(ways of writing the printed row that give all numbers for `duration`, all such ways)."""
    found = [duration in trials.durations_of_all(row) for row in trials.rows if GRAVITY_ROWS[row].of is not None]
    return sum(found), len(found)
