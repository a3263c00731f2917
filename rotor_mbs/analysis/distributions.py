"""Whether two samples can come from one distribution: Kolmogorov and Smirnov's distance, the difference of means."""

from __future__ import annotations

import math
from statistics import NormalDist

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]


def largest_distance(one: Array, other: Array) -> float:
    """Largest difference of the two empirical distribution functions, of (n,) and (m,) values; NaN where a value is.

    >>> largest_distance(np.array([1.0, 2.0]), np.array([3.0, 4.0, 5.0]))
    1.0
    >>> largest_distance(np.array([1.0, 3.0]), np.array([2.0, 4.0]))
    0.5
    """
    values = np.concatenate([one, other])
    if not np.isfinite(values).all():
        return math.nan
    shares = [np.searchsorted(np.sort(sample), values, side="right") / len(sample) for sample in (one, other)]
    return float(np.abs(shares[0] - shares[1]).max())


def critical_distance(n: int, m: int, significance: float) -> float:
    """The distance that samples of n and m values from one distribution exceed with that probability.

    Smirnov's limit for large samples, of smaller ones a little too large: N. Smirnov, Ann. Math. Stat. 19 (1948).

    >>> round(critical_distance(100, 100, 0.05), 3)
    0.192
    """
    return math.sqrt(0.5 * math.log(2.0 / significance) * (n + m) / (n * m))


def mean_difference(one: Array, other: Array) -> float:
    """Difference of the means of (n,) and (m,) values, in its standard errors."""
    error = math.sqrt(float(one.var(ddof=1)) / len(one) + float(other.var(ddof=1)) / len(other))
    return float(abs(one.mean() - other.mean())) / error if error else 0.0


def critical_mean_difference(significance: float) -> float:
    """In standard errors: what is exceeded with that probability, to either side, by means of many values.

    >>> round(critical_mean_difference(0.05), 2)
    1.96
    """
    return NormalDist().inv_cdf(1.0 - 0.5 * significance)
