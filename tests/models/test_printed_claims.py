"""reference/published.toml: the four numbers of the paper; claims about scenes and statistics that exist."""

from __future__ import annotations

import pytest

from rotor_mbs.analysis.claims import STATISTICS
from rotor_mbs.analysis.published import conditions, published
from rotor_mbs.scenario.catalogue import find_scenes


def test_the_four_published_numbers():
    numbers = {(one.of.scene, one.of.statistic): one.value for one in published() if one.is_number}
    assert numbers == {
        ("paper/fig11", "max"): 2.7315,
        ("paper/fig05", "min"): 0.5127,
        ("paper/fig05", "max"): 0.5273,
        ("paper/fig05", "max_abs"): 0.0458,
    }


def test_ids_are_unique():
    assert len({one.id for one in published()}) == len(published())


@pytest.mark.parametrize("one", published(), ids=lambda one: one.id)
def test_what_is_measured_exists(one):
    # A number that is rounding error is said to be so in the conditions, by its figure.
    assert not one.rounding or "likelier reading" in conditions()[f"fig{int(one.figure):02d}"]
    for asked in [one.of, *(side for test in one.tests for side in (test.of, test.than))]:
        if asked is not None:
            assert len(find_scenes([asked.scene])) == 1
            assert asked.coordinate in range(4)
            assert asked.statistic in STATISTICS
