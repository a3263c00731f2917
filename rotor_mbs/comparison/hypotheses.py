"""Define hypotheses that may explain a difference, and the search that tries them.

The searches for mistakes in columns and times, for other models, and for causes in loads and
frequencies have the same form. A hypothesis has a text, a change of the data or the model,
and a price, which is the number of mistakes or parameters that it assumes. A function measures how
much of the difference a change leaves. A hypothesis explains the difference if its change leaves no
more than is allowed. Depending on the search, the first explanation is named, the cheapest ones, or
those that leave least.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass
from typing import Generic, TypeVar

Change = TypeVar("Change")


@dataclass(frozen=True)
class Hypothesis(Generic[Change]):
    """Hold a possible cause of a difference.

    Attributes
    ----------
    text : the cause, in words; "" if nothing is wrong.
    change : another model, corrected data, another component of loads, or another factor and
        reference point of moments.
    price : number of mistakes or parameters that the hypothesis assumes.
    """

    text: str
    change: Change
    price: int = 1


@dataclass(frozen=True)
class Explanation(Generic[Change]):
    """Hold a hypothesis that explains a difference, and how much of the difference it leaves."""

    hypothesis: Hypothesis[Change]
    left: float

    @property
    def text(self) -> str:
        """Return the cause, in words."""
        return self.hypothesis.text


def explanations(
    hypotheses: Iterable[Hypothesis[Change]],
    left: Callable[[Change], float],
    allowed: float = math.inf,
) -> Iterator[Explanation[Change]]:
    """Search for the hypotheses that explain a difference.

    Parameters
    ----------
    hypotheses : the hypotheses, in the order in which they are tried.
    left : function that returns how much of the difference a change leaves; NaN or infinite if the
        change explains nothing.
    allowed : how much an explanation may leave.

    Yields
    ------
    Explanation
        Each as soon as it is found: a caller who needs only the first one saves the other trials.
    """
    for hypothesis in hypotheses:
        size = left(hypothesis.change)
        if size <= allowed and size < math.inf:
            yield Explanation(hypothesis, size)


def cheapest(explained: Iterable[Explanation[Change]]) -> list[Explanation[Change]]:
    """Return the explanations with the fewest mistakes or parameters, those of the lowest price."""
    explained = list(explained)
    lowest = min((explanation.hypothesis.price for explanation in explained), default=0)
    return [explanation for explanation in explained if explanation.hypothesis.price == lowest]


def closest(
    explained: Iterable[Explanation[Change]], factor: float, least: float
) -> list[Explanation[Change]]:
    """Return the explanations that cannot be distinguished from the best one, the best first.

    Parameters
    ----------
    explained : explanations in any order.
    factor : explanations that leave up to this many times as much as the best one are returned.
    least : how much a right explanation may leave; if the best one leaves less, `factor` multiplies
        this number instead.
    """
    ordered = sorted(explained, key=lambda explanation: explanation.left)
    best = ordered[0].left if ordered else 0.0
    return [each for each in ordered if each.left <= factor * max(best, least)]
