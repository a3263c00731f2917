"""The errata: found by code, and compared with the hand-written file and the shipped table."""

from __future__ import annotations

import tomllib

import pytest
from support.gravity_rows import value
from support.printed_entries import NAMES, TOLERANCE, check_errata, printed_entries, random_states, right_entries

from rotor_mbs.analysis.published import checked_entries
from rotor_mbs.scenario.catalogue import REFERENCES

STATES = random_states(2020, 5)


@pytest.fixture(scope="module")
def found():
    return check_errata(STATES)


def test_the_file_says_what_the_code_finds(found):
    """No entry is unexplained, and each erratum is in its equations and no others."""
    written = {one["id"]: one for one in tomllib.loads((REFERENCES / "errata.toml").read_text())["erratum"]}
    assert tuple(written) == NAMES
    assert all(off <= TOLERANCE or explanation for off, explanation in found.values())
    for name in NAMES:
        equations = {equation for (equation, _), (_, explanation) in found.items() if name in explanation}
        assert equations == {*written[name]["stands_in"], *written[name]["reaches"]}


def test_the_table_of_entries_is_what_the_code_finds(found):
    table = checked_entries()
    assert [(entry.equation, entry.entry) for entry in table] == list(found)
    for entry, (off, explanation) in zip(table, found.values(), strict=True):
        assert (entry.agrees, entry.explained_by) == (off <= TOLERANCE, explanation), entry
        assert entry.difference == pytest.approx(off, abs=1e-14)


@pytest.mark.parametrize("state", STATES, ids=range(len(STATES)))
def test_the_formulas_of_the_table_have_the_values_of_the_entries(state):
    """As printed, and right by derivatives of (3)."""
    names = {**state.names, "q2": state.angles[0], "√3": state.names["root3"]}
    printed, right = printed_entries(state.names), right_entries(state)
    for entry in checked_entries():
        key = entry.equation, entry.entry
        assert value(entry.printed, names) == pytest.approx(float(printed.get(key, 0)), rel=TOLERANCE, abs=TOLERANCE)
        assert value(entry.right, names) == pytest.approx(float(right[key]), rel=TOLERANCE, abs=TOLERANCE)


def test_agreement_is_clear_cut(found):
    # Identities agree to a few units of rounding, faults differ in the first digits: nothing lies between.
    assert max(off for off, _ in found.values() if off <= TOLERANCE) < 1e-14
    assert min(off for off, _ in found.values() if off > TOLERANCE) > 1e-2
