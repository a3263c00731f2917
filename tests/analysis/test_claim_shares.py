"""Shares of claims over many runs: the rule of the verdict, which runs decide, and the way to a file and back."""

from __future__ import annotations

from collections import ChainMap
from pathlib import Path

import numpy as np
import pytest

from rotor_mbs.analysis.claim_records import ClaimStudy, count_of_rows, records_of, shipped_claims, stored_claims
from rotor_mbs.analysis.claim_shares import ClaimShare, ClaimShares, SampledRuns, marks
from rotor_mbs.analysis.published import Condition, Published, TrajectoryNumber, published
from rotor_mbs.runs.read import open_results
from rotor_mbs.runs.records import write_records
from rotor_mbs.solution.status import code_of

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


def runs(values: list[float], status: str = "ok", drift: float = 1e-3) -> SampledRuns:
    """Runs in which the rotor turns steadily by `values` rad; the first ended and gained as it says."""
    time = np.linspace(0.0, 1.0, 11)
    angles = np.zeros((len(values), 11, 2))
    angles[:, :, 0] = np.outer(values, time)
    codes = np.array([code_of(status), *[code_of("ok")] * (len(values) - 1)], np.int8)
    return SampledRuns(time, angles, np.zeros_like(angles), codes, np.array([drift, *[1e-3] * (len(values) - 1)]))


TURN = TrajectoryNumber("a", "angle", 0, "range")
OTHER = TrajectoryNumber("b", "angle", 0, "range")


def claim(*tests: Condition) -> Published:
    return Published(id="c", figure="5", kind="claim", quote="«»", statement="A claim.", tests=tests)


def marks_of(item: Published, **scenes: SampledRuns) -> str:
    by_scene = (scenes[one.scene].values([one]) for one in (TURN, OTHER) if one.scene in scenes)
    return marks(item, (dict(ChainMap(*values)) for values in zip(*by_scene, strict=True)))


def test_a_run_is_compared_with_the_run_of_the_same_number() -> None:
    larger = claim(Condition(of=TURN, relation=">", than=OTHER))
    assert marks_of(larger, a=runs([1.0, 2.0, 3.0]), b=runs([2.0, 1.0, 2.0])) == "nyy"


@pytest.mark.parametrize(
    ("status", "drift", "mark"),
    [
        ("ok", 999.0, "y"),
        ("inaccurate", 1.0, "y"),
        ("ok", 1001.0, "-"),
        ("ok", np.inf, "-"),
        ("ok", np.nan, "-"),
        ("solver_failed", 0.0, "-"),
        ("diverged", 0.0, "-"),
        ("timed_out", 0.0, "-"),
    ],
)
def test_a_run_that_broke_off_or_gained_a_thousandfold_energy_decides_nothing(
    status: str, drift: float, mark: str
) -> None:
    assert marks_of(claim(Condition(of=TURN, relation=">", bound=0.5)), a=runs([1.0, 1.0], status, drift)) == f"{mark}y"


def test_a_claim_about_two_scenes_fails_where_one_of_them_fails_and_the_other_decides_nothing() -> None:
    both = claim(Condition(of=TURN, relation="<", bound=1.5), Condition(of=OTHER, relation="<", bound=1.5))
    broken = runs([1.0, 1.0], "solver_failed")
    assert marks_of(both, a=broken, b=runs([2.0, 1.0])) == "ny"
    assert marks_of(both, a=broken, b=runs([1.0, 1.0])) == "-y"


def test_the_study_comes_back_from_a_file_as_it_was(tmp_path: Path) -> None:
    shipped = stored_claims()
    assert shipped is not None
    study = ClaimStudy(ClaimShares((share("-yn"), share("yyy", 10.0)), 1e-15, 2), shipped.numbers)
    write_records(tmp_path / "claims.h5", records_of(study, 1, {"python": "3"}))
    with open_results(tmp_path / "claims.h5") as results:
        found = stored_claims(results)
        assert list(results.scenes) == []
        assert results.root["claims/numbers/angle"].attrs["units"] == "rad"
        assert results.root["claims/shares/duration"].attrs["units"] == "s"
    assert found is not None
    assert found.shares == study.shares
    assert repr(found.numbers) == repr(study.numbers)  # NaN does not equal itself


def test_the_shipped_study_has_every_claim_and_number() -> None:
    assert shipped_claims().exists()
    study = stored_claims()
    assert study is not None
    assert study.shares.claims == [item.id for item in published() if not item.is_number]
    assert study.shares.methods == [PRINTED, CLOSED_FORM]
    assert study.shares.durations == [8.0, 10.0, 12.0]
    assert len(study.shares.shares) == len(study.shares.claims) * 2 * 3
    assert all(len(one.moved) >= 100 and set(one.marks) <= set("yn-") for one in study.shares.shares)
    assert study.numbers.numbers == [item.id for item in published() if item.is_number]


def test_the_findings_count_the_claims_as_the_shipped_study_does() -> None:
    study = stored_claims()
    assert study is not None
    findings = " ".join((Path(__file__).parents[2] / "docs/findings.md").read_text().split())
    printed, corrected = (study.shares.count(method) for method in (PRINTED, CLOSED_FORM))
    assert printed["fails"] == 0
    assert (
        f"**Of the paper's {len(study.shares.claims)} claims in words** {printed['holds']} hold in the printed model "
        f"whatever the rounding and the length of the run, and {printed['undecided']} are undecided; in the corrected "
        f"model {corrected['holds']} hold, {corrected['fails']} fail and {corrected['undecided']} are undecided"
    ) in findings


def test_all_numbers_come_out_under_the_papers_tolerances_and_for_12_s_alone() -> None:
    study = stored_claims()
    assert study is not None
    trials = study.numbers
    assert trials.durations_of_all(trials.usual.gravity_row) == [trials.usual.duration] == [12.0]
    assert [one for one in trials.with_tolerances() if trials.reproduces_all(one)] == [trials.usual]
    findings = (Path(__file__).parents[2] / "docs/findings.md").read_text()
    assert "for {} of {} ways of writing that row".format(*count_of_rows(trials, 12.0)) in findings
    assert [count_of_rows(trials, duration)[0] for duration in (8.0, 9.0, 10.0, 11.0, 13.0)] == [0] * 5
