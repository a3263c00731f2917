"""The study of claims: the rule of the verdict on shares of many runs, and what reference/claims.json says."""

from __future__ import annotations

from pathlib import Path

import pytest

from rotor_mbs.analysis.claim_study import ClaimShare, ClaimShares, claim_study
from rotor_mbs.analysis.claims import STATISTICS
from rotor_mbs.analysis.published import Published, conditions, published
from rotor_mbs.scenario.catalogue import find_scenes

PRINTED, CLOSED_FORM = "printed/ode45", "lagrange/taylor"


def share(marks: str, duration: float = 8.0) -> ClaimShare:
    return ClaimShare("c", PRINTED, duration, marks)


@pytest.mark.parametrize(
    ("moved", "verdict"),
    [
        (95 * "y" + 5 * "n", "holds"),
        (94 * "y" + 6 * "n", "undecided"),
        (5 * "y" + 95 * "n", "fails"),
        (6 * "y" + 94 * "n", "undecided"),
        (50 * "y" + 50 * "-", "holds"),  # of those that decide
        (49 * "y" + 51 * "-", "undecided"),  # too few decide
        (100 * "-", "undecided"),
    ],
)
@pytest.mark.parametrize("as_given", "yn-")
def test_a_claim_holds_or_fails_only_where_nearly_all_runs_say_so(moved: str, verdict: str, as_given: str) -> None:
    assert share(as_given + moved).verdict == verdict  # the start as given does not count


def test_a_claim_holds_only_where_it_does_for_every_duration() -> None:
    yes, no, half = share("y" * 9, 8.0), share("n" * 9, 10.0), share("y" * 5 + "n" * 4, 12.0)

    def verdict(*shares: ClaimShare) -> str:
        return ClaimShares(shares, 1e-15, 8).verdict(yes.claim, yes.method)

    assert verdict(yes, share("n" + 8 * "y", 10.0)) == "holds"
    assert verdict(no, share("y" + 8 * "n", 12.0)) == "fails"
    assert [verdict(*found) for found in ([yes, no], [yes, half], [no, half])] == ["undecided"] * 3
    assert verdict() == ""


def test_the_shipped_study_has_every_claim_and_number() -> None:
    study = claim_study()
    assert study.shares.claims == [item.id for item in published() if not item.is_number]
    assert study.shares.methods == [PRINTED, CLOSED_FORM]
    assert study.shares.durations == [8.0, 10.0, 12.0]
    assert len(study.shares.shares) == len(study.shares.claims) * 2 * 3
    assert all(len(one.moved) >= 100 and set(one.marks) <= set("yn-") for one in study.shares.shares)
    assert study.numbers.numbers == [item.id for item in published() if item.is_number]


def test_the_findings_count_the_claims_as_the_shipped_study_does() -> None:
    study = claim_study()
    findings = " ".join((Path(__file__).parents[2] / "docs/findings.md").read_text().split())
    printed, corrected = (study.shares.count(method) for method in (PRINTED, CLOSED_FORM))
    assert printed["fails"] == 0
    assert (
        f"**Of the paper's {len(study.shares.claims)} claims in words** {printed['holds']} hold in the printed model "
        f"whatever the rounding and the length of the run, and {printed['undecided']} are undecided; in the corrected "
        f"model {corrected['holds']} hold, {corrected['fails']} fail and {corrected['undecided']} are undecided"
    ) in findings


def test_all_numbers_come_out_under_the_papers_tolerances_and_for_12_s_alone() -> None:
    study = claim_study()
    trials = study.numbers
    assert trials.durations_of_all(trials.usual.gravity_row) == [trials.usual.duration] == [12.0]
    assert [tried for tried in trials.with_tolerances() if trials.reproduces_all(tried)] == [trials.usual]
    findings = (Path(__file__).parents[2] / "docs/findings.md").read_text()
    durations = [trials.durations_of_all(row) for row in trials.rows_of_56]
    count = sum(12.0 in reproducing for reproducing in durations)
    assert f"for {count} of {len(durations)} ways of writing that row" in findings
    assert not any(duration in reproducing for duration in (8.0, 9.0, 10.0, 11.0, 13.0) for reproducing in durations)


# reference/published.toml


def test_the_four_published_numbers() -> None:
    numbers = {(one.of.scene, one.of.statistic): one.value for one in published() if one.is_number}
    assert numbers == {
        ("paper/fig11", "max"): 2.7315,
        ("paper/fig05", "min"): 0.5127,
        ("paper/fig05", "max"): 0.5273,
        ("paper/fig05", "max_abs"): 0.0458,
    }


def test_ids_are_unique() -> None:
    assert len({one.id for one in published()}) == len(published())


@pytest.mark.parametrize("one", published(), ids=lambda one: one.id)
def test_what_is_measured_exists(one: Published) -> None:
    # A number that is rounding error is said to be so in the conditions, by its figure.
    assert not one.rounding or "likelier reading" in conditions()[f"fig{int(one.figure):02d}"]
    for asked in [one.of, *(side for test in one.tests for side in (test.of, test.than))]:
        if asked is not None:
            assert len(find_scenes([asked.scene])) == 1
            assert asked.coordinate in range(4)
            assert asked.statistic in STATISTICS
