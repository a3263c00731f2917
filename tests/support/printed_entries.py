"""Every printed entry of the paper's matrices and equations by name, compared between three
sources.

A value is found by (equation, entry): ("(8)", "row 2 column 4"), ("(52)", "q̇2 q̇3"). The sources:
the formulas as printed, the paper's derivation with chosen errata, and derivatives of (3) alone.
"""

from __future__ import annotations

import inspect
import math
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from itertools import combinations
from typing import Any

import numpy as np

from rotor_mbs.models.printed import derivation, literal
from rotor_mbs.models.printed.derivation import BladeTerms, Errata, blade_terms
from rotor_mbs.solution.trajectory import Array

Key = tuple[str, str]
Entries = dict[Key, Any]

MATRICES: tuple[tuple[str, str], ...] = (
    ("(8)", "u32"),
    ("(9)", "u33"),
    ("(16)", "u32_2"),
    ("(17)", "u32_3"),
    ("(18)", "u33_2"),
    ("(19)", "u33_3"),
)
_MASS_THREE = (
    ("(42)", "(43)", "(44)", "(45)"),
    ("(46)", "(47)", "(39)", "(39)"),
    ("(48)", "(40)", "(49)", "(40)"),
    ("(50)", "(41)", "(41)", "(51)"),
)
_RATE_ROWS = (
    ("(29)", "h2"),
    ("(30)", "h3"),
    ("(52)", "h_1"),
    ("(53)", "h_2"),
    ("(54)", "h_3"),
    ("(55)", "h_4"),
)
_PITCHES = (3, 4, 5)
_PITCH_ROWS = ("(53)", "(54)", "(55)")
_RATES = {"w22": "q̇2²"}
for _i in _PITCHES:
    _RATES |= {f"w2{_i}": f"q̇2 q̇{_i}", f"w{_i}{_i}": f"q̇{_i}²", f"w{_i}": f"q̇{_i}"}


@dataclass(frozen=True, slots=True)
class State:
    """Angles q2..q5 (rad), mass (kg), place c, d (m) of the mass point, gravity (m/s²)."""

    angles: tuple[float, float, float, float]
    m: float
    c: float
    d: float
    g: float

    @property
    def names(self) -> dict[str, float]:
        """The state under the names of the printed symbols."""
        names = {"m": self.m, "c": self.c, "d": self.d, "g": self.g, "root3": math.sqrt(3.0)}
        for number, angle in enumerate(self.angles, start=2):
            names |= {f"s{number}": math.sin(angle), f"c{number}": math.cos(angle)}
        return names

    @property
    def blades(self) -> list[tuple[float, float]]:
        """(q2 of the blade, pitch) by (34)-(36)."""
        return [(self.angles[0] + 2.0 * math.pi * i / 3.0, self.angles[1 + i]) for i in range(3)]


def printed_entries(names: Mapping[str, Any]) -> Entries:
    """Every entry as printed, for `State.names`."""
    entries: Entries = {}
    for equation, name in MATRICES:
        entries |= _matrix_entries(equation, _call(getattr(derivation, name), names))
    entries |= _mass_entries((("(25)",) * 2,) * 2, _call(literal.mass_one, names))
    entries |= _mass_entries(_MASS_THREE, _call(literal.mass_three, names))
    for equation, name in _RATE_ROWS:
        row = getattr(literal, name)
        entries |= {(equation, rates): value for rates, value in _rate_coefficients(row, names)}
    entries |= _gravity_entries("(32)", _call(literal.gravity_one, names))
    entries |= _gravity_entries("(56)", _call(literal.gravity_three, names))
    return entries


def derived_entries(state: State, errata: Errata) -> Entries:
    """The entries by the paper's derivation with the chosen errata in."""
    names = state.names
    entries: Entries = {}
    for equation, name in MATRICES:
        entries |= _matrix_entries(
            equation, _call(getattr(derivation, name), {**names, "errata": errata})
        )
    terms = [
        blade_terms(q2, q3, state.m, state.c, state.d, state.g, errata) for q2, q3 in state.blades
    ]
    return entries | assembled_entries(terms, errata.e3)


def right_entries(state: State) -> Entries:
    """The entries from (3) alone: derivatives of the matrix, of the kinetic and of the potential
    energy.

    For a point mass at p(q), T = ½ m ṗ·ṗ and V = m g p_z, Lagrange's equations are Σ_j m p_i·p_j
    q̈_j + Σ_jk m p_i·p_jk q̇_j q̇_k + m g p_i,z, where indices of p are derivatives.
    """
    entries: Entries = {}
    for (equation, _), matrix in zip(
        MATRICES, derivatives_of_a3(*state.blades[0], state), strict=True
    ):
        entries |= _matrix_entries(equation, matrix)
    return entries | assembled_entries(
        [_right_terms(q2, q3, state) for q2, q3 in state.blades], first_power=False
    )


def derivatives_of_a3(q2: float, q3: float, state: State) -> tuple[Array, ...]:
    """Derivatives of (3) by q2, q3, q2 q2, q2 q3, q3 q2, q3 q3: the right (8), (9), (16)-(19).

    In each angle (3) is a + b cos q + e sin q, and of such a function (f(q + π/2) - f(q - π/2))/2
    is the derivative itself: no step to choose, no truncation error, and it can be taken again.
    """
    quarter = math.pi / 2.0

    def a3(q2: float, q3: float) -> Array:
        return np.array(
            derivation.a3(math.sin(q2), math.cos(q2), math.sin(q3), math.cos(q3), state.c, state.d),
            float,
        )

    def by_q2(f: Callable[[float, float], Array]) -> Callable[[float, float], Array]:
        return lambda q2, q3: (f(q2 + quarter, q3) - f(q2 - quarter, q3)) / 2.0

    def by_q3(f: Callable[[float, float], Array]) -> Callable[[float, float], Array]:
        return lambda q2, q3: (f(q2, q3 + quarter) - f(q2, q3 - quarter)) / 2.0

    u32, u33 = by_q2(a3), by_q3(a3)
    return tuple(u(q2, q3) for u in (u32, u33, by_q2(u32), by_q3(u32), by_q2(u33), by_q3(u33)))


def assembled_entries(terms: Sequence[BladeTerms], first_power: bool) -> Entries:
    """(25), (29), (30), (32) of the first blade and (39)-(56) of three; first_power: E3 is in."""
    one = terms[0]
    entries = _mass_entries((("(25)",) * 2,) * 2, ((one.d_22, one.d_23), (one.d_23, one.d_33)))
    entries |= {
        ("(29)", "q̇2²"): one.h_2_22,
        ("(29)", "q̇2 q̇3"): one.h_2_23,
        ("(29)", "q̇3²"): one.h_2_33,
    }
    entries |= {
        ("(30)", "q̇2²"): one.h_3_22,
        ("(30)", "q̇2 q̇3"): one.h_3_23,
        ("(30)", "q̇3²"): one.h_3_33,
    }
    entries |= _gravity_entries("(32)", (one.gravity_2, one.gravity_3))
    mass: list[list[Any]] = [[0] * 4 for _ in range(4)]
    mass[0][0] = sum(blade.d_22 for blade in terms)
    entries["(52)", "q̇2²"] = sum(blade.h_2_22 for blade in terms)
    for i, (blade, row, number) in enumerate(
        zip(terms, _PITCH_ROWS, _PITCHES, strict=True), start=1
    ):
        mass[0][i] = mass[i][0] = blade.d_23
        mass[i][i] = blade.d_33
        entries["(52)", f"q̇2 q̇{number}"], entries["(52)", f"q̇{number}²"] = (
            blade.h_2_23,
            blade.h_2_33,
        )
        entries[row, "q̇2²"], entries[row, f"q̇2 q̇{number}"] = blade.h_3_22, blade.h_3_23
        entries[row, f"q̇{number}"] = blade.h_3_33 if first_power else 0
        entries[row, f"q̇{number}²"] = 0 if first_power else blade.h_3_33
    gravity = (sum(blade.gravity_2 for blade in terms), *(blade.gravity_3 for blade in terms))
    return entries | _mass_entries(_MASS_THREE, mass) | _gravity_entries("(56)", gravity)


def _right_terms(q2: float, q3: float, state: State) -> BladeTerms:
    m, g = state.m, state.g
    p2, p3, p22, p23, _, p33 = (matrix[:3, 3] for matrix in derivatives_of_a3(q2, q3, state))
    return BladeTerms(
        d_22=m * float(p2 @ p2),
        d_23=m * float(p2 @ p3),
        d_33=m * float(p3 @ p3),
        h_2_22=m * float(p2 @ p22),
        h_2_23=2.0 * m * float(p2 @ p23),
        h_2_33=m * float(p2 @ p33),
        h_3_22=m * float(p3 @ p22),
        h_3_23=2.0 * m * float(p3 @ p23),
        h_3_33=m * float(p3 @ p33),
        gravity_2=m * g * float(p2[2]),
        gravity_3=m * g * float(p3[2]),
    )


def _call(formula: Callable[..., Any], names: Mapping[str, Any]) -> Any:
    """The formula at the symbols it names in its signature."""
    return formula(
        **{name: names[name] for name in inspect.signature(formula).parameters if name in names}
    )


def _rate_coefficients(
    row: Callable[..., Any], names: Mapping[str, Any]
) -> Iterator[tuple[str, Any]]:
    """The row is linear in its products of rates: each one's coefficient is the row where it is 1
    and the rest 0."""
    products = [name for name in inspect.signature(row).parameters if name in _RATES]
    for product in products:
        yield _RATES[product], _call(row, {**names, **dict.fromkeys(products, 0), product: 1})


def _matrix_entries(equation: str, matrix: Any) -> Entries:
    return {
        (equation, f"row {i} column {j}"): value
        for i, row in enumerate(matrix, start=1)
        for j, value in enumerate(row, start=1)
    }


def _mass_entries(equations: Sequence[Sequence[str]], matrix: Any) -> Entries:
    return {
        (equation, f"D({i},{j})"): value
        for i, (labels, row) in enumerate(zip(equations, matrix, strict=True), start=1)
        for j, (equation, value) in enumerate(zip(labels, row, strict=True), start=1)
    }


def _gravity_entries(equation: str, rows: Sequence[Any]) -> Entries:
    return {(equation, f"C({i})"): value for i, value in enumerate(rows, start=1)}


# Lengths, mass and gravity are drawn of order one: rounding is some 1e-16, a wrong formula some
# 1e-1.
TOLERANCE = 1e-12
NAMES = ("E1", "E2", "E3")


def check_errata(states: Sequence[State]) -> dict[Key, tuple[float, str]]:
    """Every entry of (8), (9), (16)-(19), (25), (29), (30), (32), (39)-(56), in the order of the
    equations: how far the print is from what is right, and the errata that explain it, as "E1, E2";
    "" where it agrees or nothing does."""
    printed = [printed_entries(state.names) for state in states]
    right = [right_entries(state) for state in states]
    derived = {
        subset: [
            derived_entries(state, Errata(*(name in subset for name in NAMES))) for state in states
        ]
        for size in range(len(NAMES) + 1)  # the fewest first
        for subset in combinations(NAMES, size)
    }
    found = {}
    for key in sorted(right[0], key=_place):
        off = difference(key, printed, right)
        explanation: tuple[str, ...] = ()
        if off > TOLERANCE and difference(key, derived[()], right) <= TOLERANCE:
            fits = (
                subset
                for subset in derived
                if difference(key, printed, derived[subset]) <= TOLERANCE
            )
            explanation = next(fits, ())
        found[key] = off, ", ".join(explanation)
    return found


def random_states(seed: int, count: int) -> list[State]:
    """States with angles anywhere and constants of order one: an identity holds for all of them or
    is none."""
    rng = np.random.default_rng(seed)
    return [
        State(tuple(rng.uniform(-np.pi, np.pi, 4).tolist()), *rng.uniform(0.5, 2.0, 4).tolist())
        for _ in range(count)
    ]


def difference(key: Key, first: Sequence[Entries], second: Sequence[Entries]) -> float:
    """The largest over the states, of the entry's size or of 1."""
    pairs = [
        (float(a.get(key, 0)), float(b.get(key, 0))) for a, b in zip(first, second, strict=True)
    ]
    return max(abs(a - b) / max(1.0, abs(a), abs(b)) for a, b in pairs)


def _place(key: Key) -> tuple[int, str]:
    equation, entry = key
    return int(equation.strip("()")), entry
