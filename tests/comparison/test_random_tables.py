"""The same numbers have the same verdict, whatever names, formats, precision, units and order of
rows they have."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from support import references
from support.random_tables import random_table
from support.scenes import paper

import rotor_mbs as rm
from rotor_mbs.comparison import data as comparison_data
from rotor_mbs.comparison.formats import read_in_worker

SCENE = paper("fig11", duration=0.3, samples=31)
WRONG = 1.05  # factor of angles and rates of the first pitch


@pytest.mark.parametrize(
    "seeds",
    [
        range(8),
        pytest.param(range(25), marks=pytest.mark.full),
        pytest.param(range(25, 2025), marks=pytest.mark.nightly),
    ],
    ids=["8", "25", "2000"],
)
def test_the_same_numbers_have_the_same_verdict(
    seeds: range, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Read in this process: a process for each file would take most of the time."""
    monkeypatch.setattr(
        comparison_data,
        "read_table",
        lambda path, group, scene: read_in_worker((Path(path), group, scene)),
    )
    exact = references.reference("paper/fig11")
    time, angles, rates = exact.time[:31], exact.angles[:31], exact.rates[:31]
    problems = []
    for seed in seeds:
        is_wrong, has_rates = seed % 3 == 0, seed % 4 != 1
        factor = np.where(is_wrong, [1.0, WRONG, 1.0, 1.0], 1.0)
        table = random_table(
            tmp_path, seed, time, angles * factor, rates * factor if has_rates else None
        )
        try:
            compared = rm.compare(table.data, SCENE)
        except rm.InputError as exc:
            problems.append(f"{table.text}: {exc}")
            continue
        verdict = compared.verdict
        is_as_expected = (
            verdict.status == ("inaccurate" if is_wrong else "ok")
            and len(verdict.channels) == (8 if has_rates else 4)
            and {name.partition(" [")[0] for name in verdict.unused} == set(table.others)
        )
        if is_wrong:
            is_as_expected &= any("pitch 1" in text for text in verdict.likely)
        else:
            is_as_expected &= not verdict.likely
        if not is_as_expected:
            problems.append(
                f"{table.text}: {verdict.status} {verdict.message} {verdict.likely} "
                f"{dict(verdict.unused)}"
            )
    assert problems == []
