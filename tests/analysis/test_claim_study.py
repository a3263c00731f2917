"""The study of claims: its files are what `support.make_claims` computes, and what the findings say
of them."""

from __future__ import annotations

import json
from pathlib import Path

import pytest
from support import make_claims
from support.make_claims import (
    DURATIONS,
    FILE,
    METHODS,
    STATISTICS,
    Conditions,
    numbers_of,
    trials_under,
)

from rotor_mbs.analysis.published import Published, claim_study, conditions, published
from rotor_mbs.runs.design import COLUMNS
from rotor_mbs.scenario.catalogue import REFERENCES, find_scenes

RUNS = json.loads(FILE.read_text(encoding="utf-8"))
FINDINGS = " ".join((Path(__file__).parents[2] / "docs/findings.md").read_text().split())


def test_the_shipped_study_has_every_claim_and_number() -> None:
    study = claim_study()
    assert list(study.verdicts) == [item.id for item in published() if not item.is_number]
    assert len(RUNS["shares"]) == len(study.verdicts) * len(METHODS) * len(DURATIONS)
    assert all(
        len(share["marks"]) > 100 and set(share["marks"]) <= set("yn-") for share in RUNS["shares"]
    )


def test_the_files_are_written_as_they_are_shipped() -> None:
    """But for the versions that the runs were made with."""
    made = json.loads(
        make_claims.runs_as_json(RUNS["shares"], RUNS["trials"], RUNS["runs"], RUNS["seed"])
    )
    assert made | {"made_with": RUNS["made_with"]} == RUNS
    assert make_claims.verdicts_as_json(RUNS) == (REFERENCES / "claims.json").read_text(
        encoding="utf-8"
    )


def test_the_findings_count_the_claims_as_the_shipped_study_does() -> None:
    study = claim_study()
    printed, corrected = (
        {verdict: study.count(method, verdict) for verdict in ("holds", "fails", "undecided")}
        for method in METHODS
    )
    assert printed["fails"] == 0
    assert (
        f"**Of the paper's {len(study.verdicts)} qualitative claims** {printed['holds']} hold in "
        f"the printed model independently of rounding and duration, and {printed['undecided']} are "
        f"undecided; in the corrected model {corrected['holds']} hold, {corrected['fails']} fail "
        f"and {corrected['undecided']} are undecided"
    ) in FINDINGS


def test_all_numbers_come_out_under_the_papers_tolerances_and_for_12_s_alone() -> None:
    trials, usual = trials_under(RUNS), Conditions(**RUNS["usual"])
    reproducing = [
        tried for tried, numbers in trials.items() if all(trial["reproduced"] for trial in numbers)
    ]
    assert {tried for tried in reproducing if tried.gravity_row == usual.gravity_row} == {usual}
    rows_of_56 = [row["name"] for row in RUNS["rows"] if row["is_of_56"]]
    of_56 = [tried for tried in reproducing if tried.gravity_row in rows_of_56]
    assert {tried.duration for tried in of_56} == {usual.duration} == {12.0}
    assert f"({len(of_56)} of {len(rows_of_56)} ways of writing that row)" in FINDINGS


@pytest.mark.parametrize("item", published(), ids=lambda item: item.id)
def test_what_is_measured_exists(item: Published) -> None:
    # A number that is rounding error is said to be so in the conditions, by its figure.
    assert not item.rounding or "most probable form" in conditions()[f"fig{int(item.figure):02d}"]
    if item.is_number:
        assert item.metric in COLUMNS
        assert len(find_scenes([item.scene])) == 1
        return
    assert item.scenes == {asked.scene for asked in numbers_of(item)}
    for asked in numbers_of(item):
        assert len(find_scenes([asked.scene])) == 1
        assert asked.coordinate in range(4)
        assert asked.statistic in STATISTICS


@pytest.mark.parametrize(
    ("names", "duration", "runs"),
    [
        (["fig03-rotor-constant", "fig03-pitch-grows"], 8.0, 2),
        *(pytest.param([], duration, 3, marks=pytest.mark.nightly) for duration in DURATIONS),
    ],
)
def test_the_first_runs_are_those_of_the_shipped_table(
    names: list[str], duration: float, runs: int
) -> None:
    pytest.importorskip("heyoka")
    items = [item for item in published() if not names or item.id in names]
    computed = make_claims.claim_shares(items, [duration], runs)
    shipped = {
        (share["claim"], share["method"], share["duration"]): share["marks"]
        for share in RUNS["shares"]
    }
    assert computed
    for share in computed:
        marks = shipped[share["claim"], share["method"], share["duration"]]
        assert share["marks"] == marks[: runs + 1], share


@pytest.mark.full
@pytest.mark.parametrize("row", ["multiplied_in", "factor_outside", "summed_over_blades"])
def test_numbers_are_those_of_the_shipped_table(row: str) -> None:
    trials = trials_under(RUNS)
    for tried, computed in trials_under(
        {"trials": make_claims.number_trials([row], [12.0], [])}
    ).items():
        for trial, shipped in zip(computed, trials[tried], strict=True):
            assert trial == shipped | {"value": pytest.approx(shipped["value"], rel=0.0, abs=5e-7)}
