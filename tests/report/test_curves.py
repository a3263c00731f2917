"""Columns of a page: what a script decodes is what was stored, each column once."""

from __future__ import annotations

import base64

import numpy as np
import pytest

from rotor_mbs.report.curves import CurveStore
from rotor_mbs.report.elements import Curve, Horizontal, Plot
from rotor_mbs.report.looks import coordinate_look

TIME = np.linspace(0.0, 10.0, 1001)
AXIS = Horizontal("time", "s", "t", 0.0, 10.0)


def decoded(store: CurveStore) -> np.ndarray:
    return np.frombuffer(base64.b64decode(store.text()), "<f4")


def test_columns_are_found_where_they_are_said_to_be() -> None:
    store = CurveStore()
    places = [store.add(values) for values in (TIME, np.sin(TIME), np.cos(TIME[:7]))]
    numbers = decoded(store)
    for place, values in zip(places, (TIME, np.sin(TIME), np.cos(TIME[:7])), strict=True):
        first, count = place["at"]
        # Half a unit in the last place of single precision.
        np.testing.assert_allclose(
            numbers[first : first + count], values, rtol=2.0**-24, atol=1e-30
        )


def test_a_column_is_stored_once() -> None:
    store = CurveStore()
    first, again = store.add(TIME), store.add(TIME.copy())
    assert first == again
    assert store.size == len(decoded(store)) == len(TIME)


def test_gaps_stay_and_what_is_too_large_for_single_precision_is_the_largest() -> None:
    store = CurveStore()
    store.add([np.nan, np.inf, 1e300, 1.0])
    numbers = decoded(store)
    assert np.isnan(numbers[:2]).all()
    assert 1e38 < numbers[2] < np.inf


def test_values_far_from_zero_keep_eight_digits_of_their_range() -> None:
    """A rotor angle after 1e5 turns: single precision has steps of 0.06 rad there."""
    angle = 6.3e5 + 0.1 * np.sin(TIME)
    store = CurveStore()
    place = store.add(angle)
    np.testing.assert_allclose(decoded(store).astype(float) + place["from"], angle, atol=1e-8)
    assert "from" not in store.add(np.full(5, 3.0))  # of a constant there is nothing to gain


def test_rows_of_a_table_follow_each_other() -> None:
    table = np.stack([np.sin(TIME), np.cos(TIME), TIME])
    store = CurveStore()
    store.add([1.0, 2.0])
    first, count, stride = store.add(table)["at"]
    for run, row in enumerate(table):
        start = first + run * stride
        np.testing.assert_allclose(decoded(store)[start : start + count], row, rtol=1e-7)


def test_of_long_columns_every_kth_sample_is_stored_and_jumps_stay_where_they_are() -> None:
    long, short = np.linspace(0.0, 1.0, 4001), np.array([0.0, 1.0])
    store = CurveStore(every=3)
    assert store.add(long)["at"] == [0, 1334]
    assert store.add(short)["at"][1] == 2
    curve = Curve("one", coordinate_look(1), long, long, breaks=[1000, 3000])
    described = Plot("x", "", AXIS, [curve]).described(store)["curves"][0]
    x = decoded(store)[: described["x"]["at"][1]]
    for place, jump in zip(described["breaks"], (1000, 3000), strict=True):
        assert x[place - 1] < long[jump] <= x[place]


@pytest.mark.parametrize("values", [[], np.empty((3, 0))])
def test_nothing_is_nothing(values: np.ndarray) -> None:
    store = CurveStore()
    store.add(values)
    assert (store.size, store.text()) == (0, "")
