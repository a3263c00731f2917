"""Richardson extrapolation in the time step: steps h, h/2, h/4 eliminate the terms of h² and h⁴. The trapezoidal rule
becomes of sixth order. Generalized-α keeps its small term of h³: eliminated in place of h⁴, errors on paper/fig11
before its horizon were 8e-6 rad, for 3e-7."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np

from rotor_mbs.methods.base import Solver
from rotor_mbs.solution.quantities import BUILT_IN
from rotor_mbs.solution.trajectory import Array, Integration, Trajectory

REFINEMENTS = (1, 2, 4)

# The uncertainty is this many times the sum of three: the distance of two extrapolations, from (h, h/2) and from
# (h/2, h/4); what Newton's method leaves, which no step reduces; rounding. In scenes of the paper and of `check` the
# error is at most 0.72 of it (fig08 with a tolerance of 1e-12), with the default settings 0.10 before the horizon.
SAFETY = 4.0

# Angles are calculated from rotation matrices: some units in the last place of the largest angle.
_ROUNDING = 10.0 * float(np.finfo(float).eps)

# What a run is judged by without a reference: sizes without a sign, whose errors no step's power describes.
_DISTANCES = {quantity.name for quantity in BUILT_IN if quantity.judgement and not quantity.judgement.with_reference}


class ExtrapolatedSolver:
    """Three runs; `build` takes how many steps take the place of each, `tolerance` is that of Newton's residual."""

    def __init__(self, build: Callable[[int], Solver], tolerance: float) -> None:
        self._runs = [build(refinement) for refinement in REFINEMENTS]
        self._tolerance = tolerance
        self._integrated = 0

    def integrate(self) -> Integration:
        """All runs, from coarse to fine; steps and evaluations are their sums."""
        self._integrated = 0
        total = Integration(True, steps=0, rhs_evaluations=0, time_reached=float("inf"))
        for run in self._runs:
            part = run.integrate()
            self._integrated += 1
            total.steps = (total.steps or 0) + (part.steps or 0)
            total.rhs_evaluations = (total.rhs_evaluations or 0) + (part.rhs_evaluations or 0)
            total.time_reached = min(total.time_reached, part.time_reached)
            if not part.success:
                total = replace(total, success=False, message=part.message, out_of_time=part.out_of_time)
                break
        return total

    def observe(self) -> Trajectory:
        """As far as the shortest run got; the initial state alone where a run was not begun."""
        runs = [run.observe() for run in self._runs[: self._integrated]]
        rows = min(len(run.time) for run in runs)
        if len(runs) < len(self._runs):
            rows, runs = 1, [*runs, runs[-1], runs[-1]][: len(self._runs)]
        cut = []
        for run in runs:
            arrays = {"time": run.time, "angles": run.angles, "rates": run.rates, **run.quantities}
            cut.append(Trajectory(**{name: values[:rows] for name, values in arrays.items()}))
        return extrapolated(cut, self._tolerance)


def extrapolated(runs: list[Trajectory], tolerance: float) -> Trajectory:
    """Every quantity of runs with steps h, h/2, h/4 extrapolated to step zero; distances such as the joints' gaps are
    the finest run's. `tolerance` is relative, of Newton's residual."""
    coarse, middle, fine = runs
    distance = np.abs(
        _eliminated(middle.angles, fine.angles, 4.0) - _eliminated(coarse.angles, middle.angles, 4.0)
    ).max(axis=1)
    largest = np.maximum(np.abs(fine.angles).max(axis=1), 1.0)
    names = {"angles", "rates", *fine.quantities} - _DISTANCES
    arrays = {}
    for name in names:
        first, second, third = (getattr(run, name) for run in runs)
        arrays[name] = _eliminated(_eliminated(first, second, 4.0), _eliminated(second, third, 4.0), 16.0)
    arrays["angle_uncertainty"] = SAFETY * np.maximum.accumulate(distance + (tolerance + _ROUNDING) * largest)
    return fine.replace(**arrays)


def _eliminated(coarse: Array, fine: Array, ratio: float) -> Array:
    """The result without the error that two results have in this ratio."""
    return fine + (fine - coarse) / (ratio - 1.0)
