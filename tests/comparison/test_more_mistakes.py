"""A third set of data with one mistake each, in other scenes than the first two."""

from __future__ import annotations

from pathlib import Path

import pytest
from support.more_mistaken_data import ALL, NAMED, RIGHT, compared, verdict_of


@pytest.mark.nightly
@pytest.mark.parametrize("name", list(ALL))
def test_every_cause_is_right(name: str, tmp_path: Path) -> None:
    result = compared(name, tmp_path)
    verdict = verdict_of(name, result["status"], result["likely"])
    assert verdict == ("right" if name in NAMED or name in RIGHT else "none"), result["likely"]
