"""Bounds files: what is accepted, which entry counts, and that every error is reported with line, key and rule."""

from __future__ import annotations

from pathlib import Path

import pytest

from rotor_mbs.errors import InputError
from rotor_mbs.scenario.accuracy_bounds import Bound, read_bounds, shipped_bounds

BAD = {
    'value = 1\nreason = "x"\nunit = "m"': (6, "unit: unknown key"),
    'value = -1e-9\nreason = "x"': (4, "value: -1e-09 is out of range"),
    'reason = "x"': (1, "value: is missing; allowed: a number from 0"),
    'value = 1\nreason = " "': (5, "reason: is empty; allowed: a sentence"),
}


@pytest.mark.parametrize("text", BAD)
def test_an_error_is_one_line(tmp_path: Path, text: str) -> None:
    own, (line, message) = tmp_path / "own.toml", BAD[text]
    own.write_text(f'[[bound]]\ncheck = "tip"\nmethod = "*"\n{text}\n')
    with pytest.raises(InputError, match=rf"bound\[0\]\.{message}") as caught:
        read_bounds(own)
    (problem,) = caught.value.problems
    assert problem.startswith(f"{own}:{line}: bound[0].")


@pytest.mark.parametrize("text", ["bound = 3", "[[bounds]]\n", ""])
def test_a_file_of_another_kind_is_refused(tmp_path: Path, text: str) -> None:
    own = tmp_path / "own.toml"
    own.write_text(text)
    with pytest.raises(InputError) as caught:
        read_bounds(own)
    assert all(problem.startswith(str(own)) for problem in caught.value.problems)


def test_entries_in_front_count_first_and_the_shipped_ones_stay(tmp_path: Path) -> None:
    own = tmp_path / "own.toml"
    own.write_text('[[bound]]\ncheck = "energy"\nmethod = "mine/*"\nvalue = 1e-3\nreason = "explicit method"\n')
    bounds = shipped_bounds().with_entries(read_bounds(own))
    assert bounds.of("energy", "mine/euler") == Bound("energy", "mine/*", 1e-3, "explicit method")
    brought = Bound("energy", "mine/euler", 1e-4, "of the method")
    bounds = shipped_bounds().with_entries([brought])
    assert bounds.of("energy", "mine/euler") == brought
    assert bounds.of("energy", "lagrange/taylor") == shipped_bounds().of("energy", "lagrange/taylor")
