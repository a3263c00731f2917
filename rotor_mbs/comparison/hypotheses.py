"""What could explain a difference: hypotheses, and the one search that tries them.

Every search for a cause has the same form, whatever the data are: columns of a trajectory, defects of intervals, loads,
frequencies. There are candidates, each with a text, with what it makes of the data or of the model, and with a price in
freedom: the number of mistakes or parameters that it takes. There is a measure of what a candidate leaves of the
difference. Those that leave no more than is allowed explain it; of these the cheapest, or those that leave least, are
named.
"""

from __future__ import annotations

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
    change : what it changes: a model in place of the scene's, corrected data, a component of loads.
    price : number of mistakes or parameters that it takes.
    """

    text: str
    change: Change
    price: int = 1


@dataclass(frozen=True)
class Explanation(Generic[Change]):
    """A hypothesis that explains a difference, and what it leaves of it, by the measure of the search."""

    hypothesis: Hypothesis[Change]
    left: float

    @property
    def text(self) -> str:
        return self.hypothesis.text


def explanations(
    hypotheses: Iterable[Hypothesis[Change]],
    left: Callable[[Change], float],
    allowed: float,
) -> Iterator[Explanation[Change]]:
    """Search for the hypotheses that explain a difference.

    Parameters
    ----------
    hypotheses : what is tried, in this order.
    left : what a change leaves of the difference; infinite where it cannot be tried, NaN where nothing is known of it.
    allowed : what may be left.

    Yields
    ------
    Explanation
        As soon as it is found, so that a caller who wants the first one tries no more.
    """
    for hypothesis in hypotheses:
        size = left(hypothesis.change)
        if size <= allowed:
            yield Explanation(hypothesis, size)


def cheapest(found: Iterable[Explanation[Change]]) -> list[Explanation[Change]]:
    """Return the explanations of the lowest price: what takes more mistakes explains no more."""
    found = list(found)
    lowest = min((explanation.hypothesis.price for explanation in found), default=0)
    return [explanation for explanation in found if explanation.hypothesis.price == lowest]


def closest(
    found: Iterable[Explanation[Change]], factor: float, least: float = 0.0
) -> list[Explanation[Change]]:
    """Return the explanations that leave least, best first: those within a factor of the best cannot be told from it.

    Parameters
    ----------
    found : explanations.
    factor : by which what they leave may differ.
    least : below this, what is left says nothing of an explanation.
    """
    ordered = sorted(found, key=lambda explanation: explanation.left)
    if not ordered:
        return []
    bound = factor * max(ordered[0].left, least)
    return [explanation for explanation in ordered if explanation.left <= bound]
