"""The search for causes: what explains a difference, which of several is named, and no more than
asked is tried."""

from __future__ import annotations

import math

import pytest

from rotor_mbs.comparison.hypotheses import Explanation, Hypothesis, cheapest, closest, explanations

HYPOTHESES = [
    Hypothesis(f"{left:g}", left, price)
    for left, price in ((0.5, 2), (0.1, 1), (0.2, 1), (math.nan, 1))
]


def left(change: float) -> float:
    return change


def texts(explained: list[Explanation[float]]) -> list[str]:
    return [explanation.text for explanation in explained]


def test_what_leaves_no_more_than_is_allowed_explains() -> None:
    assert texts(list(explanations(HYPOTHESES, left, 0.2))) == ["0.1", "0.2"]
    # Without a bound all but what explains nothing.
    assert texts(list(explanations([*HYPOTHESES, Hypothesis("inf", math.inf)], left))) == [
        "0.5",
        "0.1",
        "0.2",
    ]


def test_the_first_explanation_ends_the_search() -> None:
    tried = []

    def recorded(change: float) -> float:
        tried.append(change)
        return change

    assert next(explanations(HYPOTHESES, recorded, 0.3)).text == "0.1"
    assert tried == [0.5, 0.1]


def test_the_cheapest_are_named_and_those_that_cannot_be_told_from_the_best() -> None:
    explained = list(explanations(HYPOTHESES, left))
    assert texts(cheapest(explained)) == ["0.1", "0.2"]
    assert texts(closest(explained, 3.0, 0.0)) == ["0.1", "0.2"]
    # What is as small as a right one may leave says nothing.
    assert texts(closest(explained, 3.0, 0.2)) == ["0.1", "0.2", "0.5"]
    assert cheapest([]) == closest([], 3.0, 0.2) == []


@pytest.mark.parametrize("price", [0, 3])
def test_nothing_wrong_is_cheaper_than_any_mistake(price: int) -> None:
    explained = explanations([*HYPOTHESES, Hypothesis("other", 0.3, price)], left)
    assert texts(cheapest(explained)) == (["other"] if price == 0 else ["0.1", "0.2"])
