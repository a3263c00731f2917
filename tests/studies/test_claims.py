"""The study of claims: the same seed gives the same table, and the shipped table is what the program computes."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from rotor_mbs.analysis.claim_records import ClaimStudy, NumberTrial, stored_claims
from rotor_mbs.analysis.published import published
from rotor_mbs.scenario.catalogue import find_scenes
from rotor_mbs.studies.claims import SPREAD, claim_shares, moved_starts, number_trials

ITEMS = {item.id: item for item in published()}


@pytest.fixture(scope="module")
def shipped() -> ClaimStudy:
    study = stored_claims()
    assert study is not None
    return study


def test_starts_are_moved_by_rounding_alone_and_the_first_is_as_given() -> None:
    (scene,) = find_scenes(["paper/fig11"])
    starts = np.array(moved_starts(scene, 8.0, 50, 3).design.rows(0, 51))
    assert starts[0].tolist() == list(scene.initial_angles)
    moves = np.abs(starts - starts[0])
    assert 0.0 < moves.max() <= SPREAD * 1.3  # rounded to a unit in the last place of an angle
    assert (moves > 0.0).any(axis=1)[1:].all()


def test_starts_follow_from_the_seed() -> None:
    (scene,) = find_scenes(["paper/fig08"])
    first, again, fewer, other = (
        moved_starts(scene, 8.0, runs, seed).design.rows(0, runs + 1) for runs, seed in ((5, 1), (5, 1), (3, 1), (5, 2))
    )
    assert np.array_equal(first, again)
    assert np.array_equal(first[:4], fewer)
    assert not np.array_equal(first, other)


def prefixes(study: ClaimStudy, names: list[str], duration: float, runs: int) -> list[str]:
    shares = [one for one in study.shares.shares if one.claim in names and one.duration == duration]
    return [one.marks[: runs + 1] for one in shares]


def test_the_same_seed_gives_the_shipped_table_again(tmp_path: Path, shipped: ClaimStudy) -> None:
    names = ["fig03-rotor-constant", "fig03-pitch-grows", "fig08-rotor-small"]
    found = claim_shares(tmp_path / "s", items=[ITEMS[name] for name in names], durations=[8.0], runs=2, workers=0)
    assert [one.marks for one in found.shares] == prefixes(shipped, names, 8.0, 2)


@pytest.mark.full
@pytest.mark.parametrize("duration", [8.0, 10.0, 12.0])
def test_the_first_runs_of_every_claim_are_those_of_the_shipped_table(
    tmp_path: Path, shipped: ClaimStudy, duration: float
) -> None:
    found = claim_shares(tmp_path / "s", durations=[duration], runs=3, workers=2)
    assert [one.marks for one in found.shares] == prefixes(shipped, shipped.shares.claims, duration, 3)


@pytest.mark.parametrize("row", ["multiplied_in", "factor_outside"])
def test_numbers_are_those_of_the_shipped_table(shipped: ClaimStudy, row: str) -> None:
    found = number_trials([row, "multiplied_in"], [12.0], [])

    def plain(trial: NumberTrial) -> tuple[object, ...]:
        return trial.number, trial.conditions, trial.reproduced, trial.remainder, round(trial.value, 6)

    expected = [one for one in shipped.numbers.trials if one.conditions in found.conditions]
    assert sorted(map(plain, found.trials)) == sorted(map(plain, expected))
