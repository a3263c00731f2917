"""Hypotheses that may explain a difference, and the one search that tries them.

Every search for a cause has the same form, whatever the data are: columns of a trajectory, defects
of intervals, loads, frequencies. There are candidates, each with a text, with what it changes in
the data or the model, and with a price: the number of mistakes or parameters that it takes. There
is a measure of what a change leaves of the difference. What leaves no more than is allowed explains
it; of these the cheapest, or those that leave least, are named.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass
from typing import Generic, TypeVar

Change = TypeVar("Change")


@dataclass(frozen=True)
class Hypothesis(Generic[Change]):
    """A possible cause of a difference.

    Attributes
    ----------
    text : the cause, in words; "" where nothing is wrong.
    change : what it changes: another model, corrected data, another component of loads.
    price : number of mistakes or parameters that it takes.
    """

    text: str
    change: Change
    price: int = 1


@dataclass(frozen=True)
class Explanation(Generic[Change]):
    """A hypothesis that explains a difference, and what it leaves, by the measure of the search."""

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
    hypotheses : what is tried, in this order.
    left : what a change leaves of the difference; NaN or infinite where it explains nothing.
    allowed : what may be left.

    Yields
    ------
    Explanation
        As soon as it is found, so that a caller who wants the first one tries no more.
    """
    for hypothesis in hypotheses:
        size = left(hypothesis.change)
        if size <= allowed and size < math.inf:
            yield Explanation(hypothesis, size)


def cheapest(explained: Iterable[Explanation[Change]]) -> list[Explanation[Change]]:
    """Return the explanations of the lowest price, with the fewest mistakes or parameters."""
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
    factor : by which what an explanation leaves may exceed what the best one leaves.
    least : what a right explanation may leave; smaller differences are not distinguished.
    """
    ordered = sorted(explained, key=lambda explanation: explanation.left)
    best = ordered[0].left if ordered else 0.0
    return [each for each in ordered if each.left <= factor * max(best, least)]
