"""The errata: found by code, and compared with the hand-written file and the shipped table."""

from __future__ import annotations

import tomllib

import pytest
from support.gravity_rows import value
from support.printed_entries import (
    NAMES,
    TOLERANCE,
    check_errata,
    printed_entries,
    random_states,
    right_entries,
)

import rotor_mbs as rm
from rotor_mbs.analysis.published import checked_entries
from rotor_mbs.models.printed import literal
from rotor_mbs.scenario.catalogue import REFERENCES

STATES = random_states(2020, 5)


@pytest.fixture(scope="module")
def found():
    return check_errata(STATES)


def test_the_file_says_what_the_code_finds(found):
    """No entry is unexplained, and each erratum is in its equations and no others."""
    written = {
        one["id"]: one for one in tomllib.loads((REFERENCES / "errata.toml").read_text())["erratum"]
    }
    assert tuple(written) == NAMES
    assert all(off <= TOLERANCE or explanation for off, explanation in found.values())
    for name in NAMES:
        equations = {
            equation for (equation, _), (_, explanation) in found.items() if name in explanation
        }
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
        assert value(entry.printed, names) == pytest.approx(
            float(printed.get(key, 0)), rel=TOLERANCE, abs=TOLERANCE
        )
        assert value(entry.right, names) == pytest.approx(
            float(right[key]), rel=TOLERANCE, abs=TOLERANCE
        )


def test_agreement_is_clear_cut(found):
    # Identities agree to a few units of rounding, faults differ in the first digits: nothing lies
    # between.
    assert max(off for off, _ in found.values() if off <= TOLERANCE) < 1e-14
    assert min(off for off, _ in found.values() if off > TOLERANCE) > 1e-2


# Slips of the machine reading. The published crest of Fig. 11, 2.7315 rad, decides against those
# that a run shows.


_H_1, _GRAVITY = literal.h_1, literal.gravity_three  # as taken


def _terms_of_blade_3_as_read(
    m, c, d, s2, c2, s3, c3, s4, c4, s5, c5, w23, w24, w25, w33, w44, w55
):
    """(52) with the terms of blade 3 as they stand in the text: a bracket cut short, and that of d
    twice."""
    root3 = literal.ROOT3
    others = _H_1(m, c, d, s2, c2, s3, c3, s4, c4, s5, c5, w23, w24, w25, w33, w44, 0.0)
    of_c = (1 + root3) / 4 * s2**2 + (2 + 2 * root3) / 4 * s2 * c2
    of_d = (1 - root3) / 4 * s2**2 - (2 - 2 * root3) / 4 * s2 * c2
    bracket = c * c5 * of_c - d * of_d + (3 - root3) / 4 * c2**2
    bracket += -d * (of_d + (3 + root3) / 4 * c2**2) - c * s5
    return others + c * m * c5 * bracket * w55


def _negative_pitch_row_of_blade_1(*symbols):
    shaft, pitch_1, pitch_2, pitch_3 = _GRAVITY(*symbols)
    return shaft, -pitch_1, pitch_2, pitch_3


def _one_pitch_row_for_blades_2_and_3(m, c, g, s2, c2, s3, c3, s4, c4, s5, c5):
    shaft, pitch_1, _, _ = _GRAVITY(m, c, g, s2, c2, s3, c3, s4, c4, s5, c5)
    return shaft, pitch_1, 0.0, c * m * g * (-s2 / 2 + literal.ROOT3 / 2 * c2) * s5


READINGS = {
    ("(52)", "the terms of blade 3"): ("h_1", _terms_of_blade_3_as_read),
    ("(56)", "pitch of blade 1"): ("gravity_three", _negative_pitch_row_of_blade_1),
    ("(56)", "pitches of blades 2 and 3"): ("gravity_three", _one_pitch_row_for_blades_2_and_3),
}


def test_every_slip_that_a_run_can_show_is_run():
    slips = tomllib.loads((REFERENCES / "errata.toml").read_text())["slip"]
    shown = {
        (slip["equation"], slip["entry"]) for slip in slips if not slip["effect"].startswith("none")
    }
    assert shown == READINGS.keys()


CREST = 2.7315  # rad, of Fig. 11, as published


def test_the_published_crest_comes_out_of_what_is_taken():
    run = rm.run("paper/fig11", "printed/ode45")
    assert run.metrics["rotor_angle_max"] == pytest.approx(CREST, abs=5.1e-5)


@pytest.mark.parametrize(
    "slip",
    [
        pytest.param(slip, marks=() if slip[0] == "(52)" else pytest.mark.full, id=" ".join(slip))
        for slip in READINGS
    ],
)
def test_the_published_crest_does_not_come_out_of_a_slip(slip, monkeypatch):
    """The motion is chaotic, so that any other equations miss it by far more than the 5e-5 rad of
    its last digit."""
    monkeypatch.setattr(literal, *READINGS[slip])
    read = rm.run("paper/fig11", "printed/ode45")
    assert abs(read.metrics["rotor_angle_max"] - CREST) > 0.1
    assert (read.status == "completed") == (slip[1] == "pitches of blades 2 and 3")
