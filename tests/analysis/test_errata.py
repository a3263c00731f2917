"""The errata: found by code, held against the hand-written file, and against other ways to the same derivatives."""

from __future__ import annotations

import functools
import math
import re
import tomllib
from pathlib import Path

import numpy as np
import pytest
from support import printed_entries as entries
from support.printed_entries import NAMES, TOLERANCE, check_errata, random_states
from support.symbols import Symbol

from rotor_mbs.analysis.published import checked_entries
from rotor_mbs.models.printed import derivation, literal

REFERENCE = Path(__file__).parents[2] / "reference" / "errata.toml"


@pytest.fixture(scope="module")
def checks():
    return check_errata()


@pytest.fixture(scope="module")
def written():
    with REFERENCE.open("rb") as file:
        return {erratum["id"]: erratum for erratum in tomllib.load(file)["erratum"]}


def equations_of(checks, name):
    return {check.equation for check in checks if name in check.explained_by}


def holds(checks, written):
    """Whether the code finds what the file says: no entry unexplained, each erratum in its equations and no others."""
    return all(check.agrees or check.explained_by for check in checks) and all(
        equations_of(checks, name) == {*written[name]["stands_in"], *written[name]["reaches"]} for name in NAMES
    )


def test_the_file_says_what_the_code_finds(checks, written):
    assert tuple(written) == NAMES
    assert holds(checks, written)


def test_the_table_of_entries_is_what_the_code_finds(checks):
    table = checked_entries()
    assert [entry._replace(difference=0.0) for entry in table] == [entry._replace(difference=0.0) for entry in checks]
    assert [entry.difference for entry in table] == pytest.approx([entry.difference for entry in checks], abs=1e-14)


def test_every_equation_is_checked(checks):
    expected = [8, 9, 16, 17, 18, 19, 25, 29, 30, 32, *range(39, 57)]
    assert sorted({int(check.equation.strip("()")) for check in checks}) == expected
    assert len({(check.equation, check.entry) for check in checks}) == len(checks)


def test_agreement_is_clear_cut(checks):
    # Identities agree to a few units of rounding, faults differ in the first digits: nothing lies between.
    assert max(check.difference for check in checks if check.agrees) < 1e-14
    assert min(check.difference for check in checks if not check.agrees) > 1e-2


def test_where_the_faults_stand(checks):
    rows = {(check.equation, check.entry): check for check in checks}
    at_fault = {
        key for key, check in rows.items() if not check.agrees and key[0] in ("(8)", "(9)", "(17)", "(18)", "(19)")
    }
    assert at_fault == {("(8)", "row 2 column 4"), ("(17)", "row 2 column 4"), ("(19)", "row 1 column 4")}
    assert (rows["(8)", "row 2 column 4"].printed, rows["(8)", "row 2 column 4"].right) == ("c c3", "0")
    assert (rows["(19)", "row 1 column 4"].printed, rows["(19)", "row 1 column 4"].right) == ("-c s2 c3", "-c c2 c3")
    assert rows["(52)", "q̇2 q̇3"].printed == "-3 c² m s3 c3"
    assert rows["(52)", "q̇2 q̇3"].right == "-2 c² m s3 c3"


def test_other_states_find_the_same(checks):
    again = check_errata(seed=7, states=3)
    assert [(c.equation, c.entry, c.explained_by) for c in again] == [
        (c.equation, c.entry, c.explained_by) for c in checks
    ]


@pytest.mark.parametrize(
    ("module", "name", "row", "column"),
    [
        (derivation, "u32", 0, 3),
        (derivation, "u33", 2, 1),
        (derivation, "u32_2", 2, 3),
        (derivation, "u32_3", 0, 0),
        (derivation, "u33_2", 2, 3),
        (derivation, "u33_3", 0, 3),
        (derivation, "a3", 1, 3),
        (literal, "mass_one", 0, 1),
        (literal, "mass_three", 2, 0),
        (literal, "gravity_one", 1, None),
        (literal, "gravity_three", 3, None),
    ],
)
def test_one_altered_entry_is_found(monkeypatch, written, module, name, row, column):
    printed = getattr(module, name)

    @functools.wraps(printed)  # keeps the signature, by which the check names its arguments
    def altered(*args, **kwargs):
        value = [list(r) if isinstance(r, tuple) else r for r in printed(*args, **kwargs)]
        if column is None:
            value[row] = value[row] * 1.01
        else:
            value[row][column] = value[row][column] * 1.01 + 0.01
        return value

    monkeypatch.setattr(module, name, altered)
    assert not holds(check_errata(), written)


@pytest.mark.parametrize("name", ["h2", "h3", "h_1", "h_2", "h_3", "h_4"])
def test_one_altered_row_is_found(monkeypatch, written, name):
    printed = getattr(literal, name)

    @functools.wraps(printed)
    def altered(**kwargs):
        return printed(**kwargs) * 1.01

    monkeypatch.setattr(literal, name, altered)
    assert not holds(check_errata(), written)


def test_derivatives_of_a3_against_the_complex_step():
    # Im f(q + ih)/h: no difference is taken, so h can be so small that nothing is cut off.
    h = 1e-30
    for state in random_states(1, 5):
        q2, q3 = state.angles[:2]

        def a3(q2, q3, state=state):
            return np.array(derivation.a3(np.sin(q2), np.cos(q2), np.sin(q3), np.cos(q3), state.c, state.d), complex)

        by_turns = entries.derivatives_of_a3(q2, q3, state)
        np.testing.assert_allclose(by_turns[0], a3(q2 + 1j * h, q3).imag / h, atol=1e-14)
        np.testing.assert_allclose(by_turns[1], a3(q2, q3 + 1j * h).imag / h, atol=1e-14)
        second = {2: (1j * h, 0.0, 0), 3: (0.0, 1j * h, 0), 4: (1j * h, 0.0, 1), 5: (0.0, 1j * h, 1)}
        for place, (d2, d3, first) in second.items():
            # The first derivative by a difference of complex steps: 1e-5 squared is cut off.
            e2, e3 = ((1e-5, 0.0), (0.0, 1e-5))[first]
            forward, back = a3(q2 + e2 + d2, q3 + e3 + d3).imag / h, a3(q2 - e2 + d2, q3 - e3 + d3).imag / h
            np.testing.assert_allclose(by_turns[place], (forward - back) / 2e-5, atol=1e-9)


def test_right_formulas_give_the_right_numbers():
    for state in random_states(2, 5):
        names = state.names
        terms = []
        for i, (q2, q3) in enumerate(state.blades):
            s3, c3 = names[f"s{3 + i}"], names[f"c{3 + i}"]
            assert (s3, c3) == (math.sin(q3), math.cos(q3))
            m, c, d, g = state.m, state.c, state.d, state.g
            terms.append(entries.right_closed_form(m, c, d, g, math.sin(q2), math.cos(q2), s3, c3))
        closed, right = entries.assembled_entries(terms, first_power=False), entries.right_entries(state)
        for key, value in closed.items():
            assert value == pytest.approx(right[key], abs=TOLERANCE)


def evaluated(text, names):
    """The number that a printed text stands for."""
    powers = str.maketrans("⁰¹²³⁴⁵⁶⁷⁸⁹", "0123456789")
    text = re.sub("[⁰¹²³⁴⁵⁶⁷⁸⁹]+", lambda found: "**" + found.group().translate(powers), text)
    text = text.replace("√3", "root3").replace(" + ", "+").replace(" - ", "-").replace(" ", "*")
    return eval(text, {"__builtins__": {}}, names)


def test_texts_are_what_is_computed():
    texts = entries.printed_entries(entries.SYMBOLS)
    for state in random_states(3, 3):
        numbers = entries.printed_entries(state.names)
        assert texts.keys() == numbers.keys()
        for key, text in texts.items():
            assert evaluated(str(text), state.names) == pytest.approx(numbers[key], abs=TOLERANCE)


def test_symbols_bracket_what_needs_it():
    a, b, c = Symbol("a"), Symbol("b"), Symbol("c")
    assert str(-a * b + 2 * c**2) == "-a b + 2 c²"
    assert str(a * (b - c) / 4) == "a (b - c)/4"
    assert str(a - (b - c)) == "a - (b - c)"
    assert str(a - (-b)) == "a + b"
    assert str(a * -b) == "a (-b)"
    assert str((a + b) ** 2 / (a * b)) == "(a + b)²/(a b)"
    assert str(1 - a) == "1 - a"
    assert (a * 0, 0 * a, str(1 * a), str(a * -1), str(0 - a), str(0 + a)) == (0, 0, "a", "-a", "-a", "a")
