"""The study of claims on the pages: verdicts by shares, the headline, the numbers under other conditions."""

from __future__ import annotations

from rotor_mbs.analysis.claim_study import ClaimShare, ClaimShares, claim_study
from rotor_mbs.analysis.claims import Claim, ClaimResult
from rotor_mbs.analysis.published import published
from rotor_mbs.report.pages import claim_tables

PRINTED, CLOSED_FORM = "printed/ode45", "lagrange/taylor"
CLAIMS = [item for item in published() if not item.is_number]


def shares(printed: dict[str, str]) -> ClaimShares:
    """Of ten runs over 8 and 10 s; by the closed form every claim fails."""
    found = []
    for duration in (8.0, 10.0):
        for claim, marks in printed.items():
            found += [ClaimShare(claim, PRINTED, duration, marks), ClaimShare(claim, CLOSED_FORM, duration, 11 * "n")]
    return ClaimShares(tuple(found), 1e-15, 10)


def test_verdicts_of_claims_are_those_of_the_shares() -> None:
    first, second = CLAIMS[:2]
    study = shares({first.id: 11 * "y", second.id: "n" + 6 * "y" + 2 * "n" + 2 * "-"})
    rows = claim_tables.claim_table(
        [Claim(item, ClaimResult(True), ClaimResult(None)) for item in CLAIMS[:3]], study
    ).rows
    cells = [[cell if isinstance(cell, str) else cell.text for cell in row[2:]] for row in rows]
    assert cells == [["holds", "fails"], ["undecided", "fails"], ["holds", "–"]]  # the third one: of the stored run
    notes = [cell.note.replace("\N{NO-BREAK SPACE}", " ") for cell in rows[1][2:] if not isinstance(cell, str)]
    assert notes[0] == "75 % and 75 % of 8 deciding runs over 8 and 10 s"
    assert notes[1] == "0 % and 0 % of 10 deciding runs over 8 and 10 s"


def test_the_headline_counts_what_holds_whatever_the_rounding_and_the_duration() -> None:
    study = shares({CLAIMS[0].id: 11 * "y", CLAIMS[1].id: 11 * "y", CLAIMS[2].id: 6 * "y" + 5 * "n"})
    sentence = claim_tables.headline(study)
    assert "in the printed model 2 hold whatever the rounding and the duration and 1 are undecided" in sentence
    assert "in the corrected model 3 fail (10 runs each" in sentence


def test_the_numbers_stand_in_tables_by_duration_tolerances_and_way_of_writing() -> None:
    study = claim_study()
    assert study is not None
    by_duration, by_tolerance, by_row = claim_tables.trial_tables(study.numbers)
    good = [
        [not isinstance(cell, str) and cell.tone == "good" for cell in row[-4:]] for row in by_duration.rows
    ]  # fmt: skip
    assert [all(row) for row in good] == [False, False, False, False, True, False]
    assert sum(all(not isinstance(c, str) and c.tone == "good" for c in row[-4:]) for row in by_tolerance.rows) == 1
    assert len(by_row.rows) == 12
    assert "8 of 11 ways of writing the printed row give all 4 numbers" in claim_tables.trial_note(study.numbers)
    assert "for 8 of 11 ways of writing one row of (56)" in claim_tables.numbers_headline(study.numbers)
