"""reference/claims.json is what `support.make_claims` computes: its first runs, and the numbers of two rows."""

from __future__ import annotations

import json

import numpy as np
import pytest
from support import make_claims
from support.make_claims import SPREAD, claim_shares, decides, marks, moved_starts, number_trials
from support.scenes import paper

from rotor_mbs.analysis.claim_study import NumberTrial, claim_study
from rotor_mbs.analysis.published import Condition, Published, TrajectoryNumber, published
from rotor_mbs.scenario.catalogue import reference_folder

TURN, OTHER = (TrajectoryNumber(scene, "angle", 0, "range") for scene in "ab")


def claim(*tests: Condition) -> Published:
    return Published(id="c", figure="5", kind="claim", quote="«»", statement="A claim.", tests=tests)


def test_starts_are_moved_by_rounding_alone_and_the_first_is_as_given() -> None:
    scene = paper("fig11")
    starts = moved_starts(scene, 50, 3)
    assert starts[0].tolist() == list(scene.initial_angles)
    moves = np.abs(starts - starts[0])
    assert 0.0 < moves.max() <= SPREAD * 1.3  # rounded to a unit in the last place of an angle
    assert (moves > 0.0).any(axis=1)[1:].all()
    assert np.array_equal(starts[:4], moved_starts(scene, 3, 3))
    assert not np.array_equal(starts, moved_starts(scene, 50, 2))


@pytest.mark.parametrize(
    ("status", "drift", "expected"),
    [
        ("ok", 999.0, True),
        ("inaccurate", 1.0, True),
        ("ok", 1001.0, False),
        ("ok", np.inf, False),
        ("ok", np.nan, False),
        ("solver_failed", 0.0, False),
        ("diverged", 0.0, False),
        ("timed_out", 0.0, False),
    ],
)
def test_a_run_that_broke_off_or_gained_a_thousandfold_energy_decides_nothing(
    status: str, drift: float, expected: bool
) -> None:
    assert decides(status, drift) is expected


def test_a_run_is_compared_with_the_run_of_the_same_number() -> None:
    larger = claim(Condition(of=TURN, relation=">", than=OTHER))
    assert marks(larger, [{TURN: 1.0, OTHER: 2.0}, {TURN: 2.0, OTHER: 1.0}, {TURN: 3.0}]) == "ny-"
    both = claim(Condition(of=TURN, relation="<", bound=1.5), Condition(of=OTHER, relation="<", bound=1.5))
    assert marks(both, [{OTHER: 2.0}, {OTHER: 1.0}, {TURN: 1.0, OTHER: 1.0}]) == "n-y"


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
        for share in claim_study().shares.shares
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
    shipped = [trial for trial in claim_study().numbers.trials if trial.conditions in conditions]
    assert sorted(map(plain, computed)) == sorted(map(plain, shipped))


def test_the_file_is_written_as_it_is_shipped() -> None:
    """But for the versions that it was made with."""
    study = claim_study()
    made = json.loads(make_claims.as_json(study.shares.shares, study.numbers.trials, study.shares.runs, 2020))
    shipped = json.loads((reference_folder() / "claims.json").read_text(encoding="utf-8"))
    assert made | {"made_with": shipped["made_with"]} == shipped
