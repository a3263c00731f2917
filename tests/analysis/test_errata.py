"""The errata: found by code, and held against the hand-written file and the shipped table."""

from __future__ import annotations

import tomllib
from pathlib import Path

import pytest
from support.printed_entries import NAMES, check_errata

from rotor_mbs.analysis.published import checked_entries

REFERENCE = Path(__file__).parents[2] / "reference" / "errata.toml"


@pytest.fixture(scope="module")
def checks():
    return check_errata()


@pytest.fixture(scope="module")
def written():
    with REFERENCE.open("rb") as file:
        return {erratum["id"]: erratum for erratum in tomllib.load(file)["erratum"]}


def test_the_file_says_what_the_code_finds(checks, written):
    """No entry unexplained, each erratum in its equations and no others."""
    assert tuple(written) == NAMES
    assert all(check.agrees or check.explained_by for check in checks)
    for name in NAMES:
        equations = {check.equation for check in checks if name in check.explained_by}
        assert equations == {*written[name]["stands_in"], *written[name]["reaches"]}


def test_the_table_of_entries_is_what_the_code_finds(checks):
    table = checked_entries()
    assert [entry._replace(difference=0.0) for entry in table] == [entry._replace(difference=0.0) for entry in checks]
    assert [entry.difference for entry in table] == pytest.approx([entry.difference for entry in checks], abs=1e-14)


def test_agreement_is_clear_cut(checks):
    # Identities agree to a few units of rounding, faults differ in the first digits: nothing lies between.
    assert max(check.difference for check in checks if check.agrees) < 1e-14
    assert min(check.difference for check in checks if not check.agrees) > 1e-2
