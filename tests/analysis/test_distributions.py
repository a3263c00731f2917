"""Kolmogorov and Smirnov's distance, its critical value, and the difference of means."""

from __future__ import annotations

import math

import numpy as np
import pytest

from rotor_mbs.analysis.distributions import (
    critical_distance,
    critical_mean_difference,
    largest_distance,
    mean_difference,
)


def test_distance_is_scipys() -> None:
    stats = pytest.importorskip("scipy.stats")
    random = np.random.default_rng(3)
    for n, m, shift in ((7, 5, 0.0), (200, 90, 0.3), (50, 50, 2.0)):
        one, other = random.normal(size=n), random.normal(shift, size=m).round(1)  # with values that are equal
        assert largest_distance(one, other) == pytest.approx(stats.ks_2samp(one, other).statistic, abs=1e-12)


def test_critical_values_are_exceeded_as_often_as_they_say() -> None:
    """1000 comparisons of equal distributions at 5 %: 50 ± 21, three standard deviations; Smirnov's limit errs low."""
    random = np.random.default_rng(4)
    pairs = [(random.normal(size=120), random.normal(size=80)) for _ in range(1000)]
    distant = sum(largest_distance(*pair) > critical_distance(120, 80, 0.05) for pair in pairs)
    unlike = sum(mean_difference(*pair) > critical_mean_difference(0.05) for pair in pairs)
    assert 20 <= distant <= 71
    assert 29 <= unlike <= 71


def test_a_run_that_broke_off_is_no_agreement() -> None:
    assert math.isnan(largest_distance(np.array([1.0, math.nan]), np.array([1.0, 2.0])))
    assert mean_difference(np.ones(3), np.ones(4)) == 0.0
