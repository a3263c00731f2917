"""reference/published.toml: written in its own vocabulary, about scenes that exist, quoting what the paper says."""

from __future__ import annotations

import tomllib
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]
with (ROOT / "reference" / "published.toml").open("rb") as file:
    FILE = tomllib.load(file)
PUBLISHED, CONDITIONS = FILE["published"], FILE["conditions"]

STATISTICS = {"min", "max", "max_abs", "range", "max_abs_change", "net_change", "reversals", "growth", "swing_ratio"}


def measures(entry):
    yield from [entry["of"]] if "of" in entry else []
    for test in entry.get("tests", []):
        yield from [test[side] for side in ("of", "than") if side in test]


def test_the_four_published_numbers():
    numbers = {(e["of"][0], e["of"][3]): e["value"] for e in PUBLISHED if e["kind"] == "number"}
    assert numbers == {
        ("paper/fig11", "max"): 2.7315,
        ("paper/fig05", "min"): 0.5127,
        ("paper/fig05", "max"): 0.5273,
        ("paper/fig05", "max_abs"): 0.0458,
    }


def test_ids_are_unique():
    assert len({entry["id"] for entry in PUBLISHED}) == len(PUBLISHED)


@pytest.mark.parametrize("entry", PUBLISHED, ids=lambda entry: entry["id"])
def test_vocabulary(entry):
    expected = {"number": {"of", "value", "decimals"}, "claim": {"statement", "tests"}}[entry["kind"]]
    assert entry.keys() - {"rounding"} == {"id", "figure", "kind", "quote"} | expected
    # A number that is rounding error is said to be so in the conditions, by its figure.
    assert not entry.get("rounding") or "likelier reading" in CONDITIONS[f"fig{int(entry['figure']):02d}"]
    for scene, quantity, coordinate, statistic in measures(entry):
        assert (ROOT / "scenarios" / f"{scene}.toml").is_file()
        assert quantity in ("angle", "rate")
        assert coordinate in range(4)
        assert statistic in STATISTICS
    for test in entry.get("tests", []):
        other = {"<": {"bound", "than"}, ">": {"bound", "than"}, "opposite": {"than"}}
        assert len(test.keys() & other[test["relation"]]) == 1
        assert test.keys() <= {"of", "relation", "bound", "than"}
