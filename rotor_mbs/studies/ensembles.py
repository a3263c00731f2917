"""Ensembles beyond the horizon: where no single run can be compared, two methods must have the same distributions.

Of starts drawn around the scene's own, each method runs its own draw: paired starts would make the samples depend on
each other. Angles, rates, kinetic energy and the tips' offsets at the end of the runs are compared.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, replace
from statistics import NormalDist

import numpy as np

from rotor_mbs.methods.solve import solve
from rotor_mbs.scenario.scene import Scene
from rotor_mbs.solution.trajectory import Array

# rad: half the width of the uniform distribution of every angle at the start.
SPREAD = 1e-3

# Probability that a comparison fails, in any channel, although both methods are right. Machines round differently, so
# that beyond the horizon every machine draws anew.
SIGNIFICANCE = 1e-5
_SHARES = (0.1, 0.5, 0.9)  # of the quantiles


@dataclass(frozen=True)
class ChannelDistance:
    """How far two ensembles are apart in one channel at the end; 1 is as large as chance allows.

    distance   Kolmogorov and Smirnov's, over the critical one
    mean       difference of the means, over the critical one
    quantiles  (3,) largest differences of the quantiles 10 %, 50 %, 90 %, of the channel's standard deviation
    """

    channel: str
    distance: float
    mean: float
    quantiles: Array


def compare_ensembles(
    scene: Scene,
    first: str,
    second: str,
    sizes: tuple[int, int],
    settings: Mapping[str, object],
    samples: int = 2,
) -> Iterator[ChannelDistance]:
    """Two methods on starts of their own; settings, samples: of the second method, in place of its defaults."""
    other = ensemble(scene, second, sizes[1], 2, settings, samples)
    yield from compare_samples(ensemble(scene, first, sizes[0], 1), other)


def compare_samples(one: Mapping[str, Array], other: Mapping[str, Array]) -> Iterator[ChannelDistance]:
    """The distances of all channels; one, other: arrays (runs,) by the channel's name. NaN where a value is.

    Critical is what samples of one distribution exceed with the probability `SIGNIFICANCE` in any channel: of the
    distance by Smirnov's limit for many values (Ann. Math. Stat. 19, 1948), of the means in standard errors.
    """
    from scipy.stats import ks_2samp  # late: it takes a second to load

    significance = SIGNIFICANCE / (2 * len(one))
    for channel, values in one.items():
        others, n, m = other[channel], len(values), len(other[channel])
        critical = math.sqrt(0.5 * math.log(2.0 / significance) * (n + m) / (n * m))
        error = math.sqrt(float(values.var(ddof=1)) / n + float(others.var(ddof=1)) / m)
        means = float(abs(values.mean() - others.mean())) / error if error else 0.0
        quantiles = np.abs(np.quantile(values, _SHARES) - np.quantile(others, _SHARES))
        yield ChannelDistance(
            channel,
            float(ks_2samp(values, others, method="asymp").statistic) / critical,
            means / NormalDist().inv_cdf(1.0 - 0.5 * significance),
            quantiles / (values.std() or 1.0),
        )


def ensemble(
    scene: Scene,
    method: str,
    count: int,
    seed: int,
    settings: Mapping[str, object] | None = None,
    samples: int = 2,
) -> dict[str, Array]:
    """By channel, (count,) values at the end of runs from starts around the scene's; NaN of a run that broke off.

    samples   of a run: an adaptive method of Exudyn tries the interval between two as its first step
    """
    random = np.random.default_rng(seed)
    base = replace(scene, samples=samples, outputs=("angles", "rates", "tip", "energy"))
    rows = []
    for offset in random.uniform(-SPREAD, SPREAD, (count, len(scene.initial_angles))):
        angles = tuple(float(angle) for angle in np.array(scene.initial_angles) + offset)
        run = solve(method, replace(base, initial_angles=angles), settings or {})
        end = np.array([*run.angles[-1], run.rates[-1, 0], run.kinetic_energy[-1], *run.tip[-1, :, 1]])
        rows.append(end if len(run.time) == samples else np.full_like(end, np.nan))
    tips = [f"tip {blade + 1} along the shaft" for blade in range(len(scene.blades))]
    names = [*scene.coordinate_labels, "rotor rate", "kinetic energy", *tips]
    return dict(zip(names, np.array(rows).T, strict=True))
