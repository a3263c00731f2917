"""The study of claims: its files are what `support.make_claims` computes, and what the findings say of them."""

from __future__ import annotations

import json
from pathlib import Path

import pytest
from support import make_claims
from support.claim_study import (
    FILE,
    STATISTICS,
    NumberTrial,
    claim_runs,
    numbers_of,
)
from support.make_claims import claim_shares, number_trials

from rotor_mbs.analysis.published import Published, claim_study, conditions, published
from rotor_mbs.scenario.catalogue import find_scenes, reference_folder

PRINTED, CLOSED_FORM = "printed/ode45", "lagrange/taylor"


def test_the_shipped_study_has_every_claim_and_number() -> None:
    study = claim_runs()
    assert study.shares.claims == [item.id for item in published() if not item.is_number]
    assert study.shares.methods == [PRINTED, CLOSED_FORM]
    assert study.shares.durations == [8.0, 10.0, 12.0]
    assert len(study.shares.shares) == len(study.shares.claims) * 2 * 3
    assert all(len(one.moved) >= 100 and set(one.marks) <= set("yn-") for one in study.shares.shares)
    assert study.numbers.numbers == [item.id for item in published() if item.is_number] == claim_study().numbers


def test_the_findings_count_the_claims_as_the_shipped_study_does() -> None:
    study = claim_study()
    findings = " ".join((Path(__file__).parents[2] / "docs/findings.md").read_text().split())
    printed, corrected = (
        {verdict: study.count(method, verdict) for verdict in ("holds", "fails", "undecided")}
        for method in (PRINTED, CLOSED_FORM)
    )
    assert printed["fails"] == 0
    assert (
        f"**Of the paper's {len(study.verdicts)} qualitative claims** {printed['holds']} hold in the printed model "
        f"independently of rounding and duration, and {printed['undecided']} are undecided; in the corrected "
        f"model {corrected['holds']} hold, {corrected['fails']} fail and {corrected['undecided']} are undecided"
    ) in findings


def test_all_numbers_come_out_under_the_papers_tolerances_and_for_12_s_alone() -> None:
    trials = claim_runs().numbers
    assert trials.durations_of_all(trials.usual.gravity_row) == [trials.usual.duration] == [12.0]
    assert [tried for tried in trials.with_tolerances() if trials.reproduces_all(tried)] == [trials.usual]
    findings = (Path(__file__).parents[2] / "docs/findings.md").read_text()
    durations = [trials.durations_of_all(row) for row in trials.rows_of_56]
    count = sum(12.0 in reproducing for reproducing in durations)
    assert f"({count} of {len(durations)} ways of writing that row)" in " ".join(findings.split())
    assert not any(duration in reproducing for duration in (8.0, 9.0, 10.0, 11.0, 13.0) for reproducing in durations)


@pytest.mark.parametrize("one", published(), ids=lambda one: one.id)
def test_what_is_measured_exists(one: Published) -> None:
    # A number that is rounding error is said to be so in the conditions, by its figure.
    assert not one.rounding or "most probable form" in conditions()[f"fig{int(one.figure):02d}"]
    assert one.scenes == {asked.scene for asked in numbers_of(one)}
    for asked in numbers_of(one):
        assert len(find_scenes([asked.scene])) == 1
        assert asked.coordinate in range(4)
        assert asked.statistic in STATISTICS


@pytest.mark.parametrize(
    ("names", "duration", "runs"),
    [
        (["fig03-rotor-constant", "fig03-pitch-grows"], 8.0, 2),
        *(pytest.param([], duration, 3, marks=pytest.mark.full) for duration in (8.0, 10.0, 12.0)),
    ],
)
def test_the_first_runs_are_those_of_the_shipped_table(names: list[str], duration: float, runs: int) -> None:
    pytest.importorskip("heyoka")
    items = [item for item in published() if not names or item.id in names]
    computed = {(share.claim, share.method): share.marks for share in claim_shares(items, [duration], runs)}
    shipped = {
        (share.claim, share.method): share.marks[: runs + 1]
        for share in claim_runs().shares.shares
        if share.duration == duration and (share.claim, share.method) in computed
    }
    assert computed == shipped
    assert computed


@pytest.mark.full
@pytest.mark.parametrize("row", ["multiplied_in", "factor_outside", "summed_over_blades"])
def test_numbers_are_those_of_the_shipped_table(row: str) -> None:
    def plain(trial: NumberTrial) -> tuple[object, ...]:
        return trial.number, trial.conditions, trial.reproduced, trial.remainder, round(trial.value, 6)

    computed = number_trials([row], [12.0], [])
    conditions = {trial.conditions for trial in computed}
    shipped = [trial for trial in claim_runs().numbers.trials if trial.conditions in conditions]
    assert sorted(map(plain, computed)) == sorted(map(plain, shipped))


def test_the_files_are_written_as_they_are_shipped() -> None:
    """But for the versions that the runs were made with."""
    study = claim_runs()
    made = json.loads(make_claims.runs_as_json(study.shares.shares, study.numbers.trials, study.shares.runs, 2020))
    shipped = json.loads(FILE.read_text(encoding="utf-8"))
    assert made | {"made_with": shipped["made_with"]} == shipped
    verdicts = (reference_folder() / "claims.json").read_text(encoding="utf-8")
    assert make_claims.verdicts_as_json(study) == verdicts
