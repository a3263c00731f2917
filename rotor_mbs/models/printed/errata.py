"""The errata found by code: every printed entry against derivatives of (3), at random states. Knows no scene."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import combinations

import numpy as np

from rotor_mbs.models.printed.entries import (
    SYMBOLS,
    Entries,
    Key,
    State,
    derived_entries,
    printed_entries,
    right_entries,
    right_formulas,
)
from rotor_mbs.models.printed.matrices import Errata

# Lengths, mass and gravity are drawn of order one: rounding is some 1e-16, a wrong formula some 1e-1.
TOLERANCE = 1e-12
NAMES = ("E1", "E2", "E3")


@dataclass(frozen=True, slots=True)
class CheckedEntry:
    """One printed entry against its derivative.

    printed, right   formulas; a term that is not there is 0
    difference       the largest of |printed - right| / max(1, |printed|, |right|) over the states
    explained_by     the fewest errata with which the paper's derivation gives what is printed, where without any it
                     gives what is right, as "E1, E2"; "" where the entry agrees, and where nothing explains it
    """

    equation: str
    entry: str
    printed: str
    right: str
    difference: float
    agrees: bool
    explained_by: str


def check_errata(seed: int = 2020, states: int = 5) -> list[CheckedEntry]:
    """Every entry of (8), (9), (16)-(19), (25), (29), (30), (32), (39)-(56), in the order of the equations."""
    drawn = random_states(seed, states)
    printed = [printed_entries(state.names) for state in drawn]
    right = [right_entries(state) for state in drawn]
    derived = {
        subset: [derived_entries(state, Errata(*(name in subset for name in NAMES))) for state in drawn]
        for size in range(len(NAMES) + 1)  # the fewest first
        for subset in combinations(NAMES, size)
    }
    printed_text, right_text = printed_entries(SYMBOLS), right_formulas()
    checks = []
    for key in sorted(right[0], key=_place):
        difference = _difference(key, printed, right)
        agrees = difference <= TOLERANCE
        checks.append(
            CheckedEntry(
                *key,
                printed=str(printed_text.get(key, 0)),
                right=str(right_text[key]),
                difference=difference,
                agrees=agrees,
                explained_by="" if agrees else ", ".join(_explanation(key, printed, right, derived)),
            )
        )
    return checks


def random_states(seed: int, count: int) -> list[State]:
    """States with angles anywhere and constants of order one: an identity holds for all of them or is none."""
    rng = np.random.default_rng(seed)
    return [
        State(tuple(rng.uniform(-np.pi, np.pi, 4).tolist()), *rng.uniform(0.5, 2.0, 4).tolist()) for _ in range(count)
    ]


def _explanation(
    key: Key, printed: Sequence[Entries], right: Sequence[Entries], derived: dict[tuple[str, ...], list[Entries]]
) -> tuple[str, ...]:
    if _difference(key, derived[()], right) > TOLERANCE:
        return ()
    return next((subset for subset in derived if _difference(key, printed, derived[subset]) <= TOLERANCE), ())


def _difference(key: Key, first: Sequence[Entries], second: Sequence[Entries]) -> float:
    pairs = [(float(a.get(key, 0)), float(b.get(key, 0))) for a, b in zip(first, second, strict=True)]
    return max(abs(a - b) / max(1.0, abs(a), abs(b)) for a, b in pairs)


def _place(key: Key) -> tuple[int, str]:
    equation, entry = key
    return int(equation.strip("()")), entry
