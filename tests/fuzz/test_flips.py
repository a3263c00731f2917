"""Files with one bit flipped, this program's and others: a verdict or a line, never a crash, a hang or a wrong value.

The long form (1,000 files): `pytest -m nightly tests/fuzz/test_flips.py`.
"""

from __future__ import annotations

from pathlib import Path

import pytest
from support.flips import FOREIGN, OWN, faults_of_flips, prepare
from support.fuzzing import tried


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("flips")
    prepare(path)
    return path


@pytest.mark.parametrize(
    "count", [pytest.param(5, marks=pytest.mark.full), pytest.param(125, marks=pytest.mark.nightly)]
)
@pytest.mark.parametrize("name", [*OWN, *FOREIGN])
def test_a_flipped_bit(name: str, count: int, folder: Path) -> None:
    outcomes, faults = faults_of_flips(name, folder, 0, count)
    print(f"{name}: {tried(outcomes, faults)}")
    assert not faults, tried(outcomes, faults)
