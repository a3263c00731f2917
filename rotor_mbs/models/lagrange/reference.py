"""Compute the reference: the closed form in quad precision, its error bound, and error growth.

The bound follows from two runs with different tolerances. The module also computes the reference at
chosen times, and defines the closed form with terms left out or with blades at other azimuths.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from fractions import Fraction
from typing import Any

import numpy as np
from numpy.typing import NDArray

from rotor_mbs.models.lagrange import closed_form
from rotor_mbs.models.lagrange.closed_form import Accelerations
from rotor_mbs.models.lagrange.hamilton import resting_pitches
from rotor_mbs.models.lagrange.heyoka_adapter import is_available
from rotor_mbs.models.lagrange.ode_solvers import OdeSolver, scipy_integrator
from rotor_mbs.models.lagrange.parameters import Number, rate_units, rotor_form
from rotor_mbs.models.lagrange.samples import quad_loads
from rotor_mbs.models.lagrange.taylor import Propagation
from rotor_mbs.scenario.scene import Scene
from rotor_mbs.solution.defects import row_blocks
from rotor_mbs.solution.trajectory import Array, Integration, Trajectory, sample_times

# The uncertainty is this many times the sum of the difference of two runs and of rounding. The
# difference shows truncation errors and the rounding of each step. It does not show errors that
# both runs share: the rounded coefficients, and the rounding of a motion that both integrate in the
# same way (a uniform rotation). Compared with runs of 180 bits and a tolerance of 1e-42, the error
# of the shipped scenes is at most 5.0 times the sum (paper/fig15-100kNm).
SAFETY = 10.0

_QUAD_EPSILON = 2.0**-112  # relative rounding error of quad precision


# Relative and absolute tolerances of DOP853, which replaces heyoka if that is not installed. SciPy
# allows a relative tolerance of at least 100 eps. The second run has tolerances a hundred times
# larger. Its difference from the first run shows the truncation error.
_TIGHTEST = (2.3e-14, 1e-16)
_LOOSER = (2.3e-12, 1e-14)
_DOUBLE_EPSILON = float(np.finfo(float).eps)
# Change (rad or rad/s) of the initial state for a difference quotient: far above round-off, and so
# small that the difference of two trajectories grows linearly.
_PERTURBATION = 1e-9


class ReferenceSolver:
    """Compute the reference of a scene by two runs, with its error bound and the error growth.

    The samples are those of the first run. By default its tolerance is a thousandth of that of the
    second run (a hundredth without heyoka). Therefore the difference of the two runs is the
    truncation error of the second run, which is larger than that of the first.

    Parameters
    ----------
    scene : the scene.
    runs : two solvers with the sample times of the scene, the more accurate one first.
    epsilon : relative rounding error of the solvers' arithmetic.
    """

    def __init__(
        self, scene: Scene, runs: Sequence[Propagation | OdeSolver], epsilon: float
    ) -> None:
        self._scene, self._runs, self._epsilon = scene, runs, epsilon
        self._difference = np.zeros(1)  # (n,) rad, see `_angle_difference`

    def integrate(self) -> Integration:
        """Integrate both runs, and return the report of the first, with a failure of either run."""
        best, check = (run.integrate() for run in self._runs)
        self._difference = self._angle_difference()
        # A million states in quad precision take 130 MB. Only those of the first run are kept.
        self._runs[1].states = self._runs[1].states[:1].copy()
        failed = best if not best.success else check
        return replace(
            best, success=failed.success, message=failed.message, out_of_time=failed.out_of_time
        )

    def _angle_difference(self) -> Array:
        """Return the largest difference between both runs' angles at each sample, (n,) rad."""
        best, check = (run.states for run in self._runs)
        angles = slice(len(self._scene.moving_coordinates))
        difference = np.empty(min(len(best), len(check)))
        for rows in row_blocks(len(difference)):
            both = np.abs((best[rows] - check[rows])[:, angles])
            difference[rows] = both.astype(float).max(axis=1)
        return difference

    def observe(self) -> Trajectory:
        """Return the samples of the first run, with its uncertainty and the growth of errors."""
        rows = len(self._difference)
        best = self._runs[0].states[:rows]
        self._runs[0].states = best
        result = self._runs[0].observe()
        if self._scene.wants("loads") and best.dtype != np.float64:
            result.quantities |= quad_loads(self._scene, result.time, best)
        result.quantities["angle_uncertainty"] = uncertainty(
            self._difference, result.angles, self._epsilon
        )
        # The growth is computed up to the last sample only. If the time limit ended the run, the
        # rest may take too long.
        if rows > 1:
            reached = replace(self._scene, duration=float(result.time[-1]), samples=rows)
            result.quantities["error_growth"] = error_growth(reached, result.time)
        else:
            result.quantities["error_growth"] = np.ones(rows)
        return result


def uncertainty(difference: Array, angles: Array, epsilon: float) -> Array:
    """Return a bound on the error of the reference's angles at each sample, (n,) rad.

    The bound is `SAFETY` times a sum of two terms: the difference of the two runs, and the rounding
    of the largest angle, because both runs may round equally. At each sample the largest sum up to
    this sample counts, because the runs may agree by chance. The bound does not include the
    rounding of the result to doubles.

    Parameters
    ----------
    difference : (n,) rad, largest difference between the angles of the two runs.
    angles : (n, 1 + blades) rad, angles of the first run.
    epsilon : relative rounding error of the runs' arithmetic.
    """
    largest = np.maximum(np.abs(angles).max(axis=1), 1.0)
    return np.asarray(SAFETY * np.maximum.accumulate(difference + epsilon * largest))


def build(scene: Scene, settings: Any) -> ReferenceSolver:
    """Return the solver of the reference.

    It integrates in quad precision by heyoka, or in doubles by DOP853 if heyoka is not installed.
    With DOP853 the uncertainty is larger by many orders of magnitude.

    Parameters
    ----------
    scene : the scene.
    settings : `ReferenceSettings` with the tolerances of the runs in quad precision.
    """
    if not is_available():
        runs = _in_doubles(scene, _TIGHTEST, ends_at_samples=True), _in_doubles(scene, _LOOSER)
        return ReferenceSolver(scene, runs, _DOUBLE_EPSILON)
    best, check = _in_quad(scene, settings.tolerance), _in_quad(scene, settings.check_tolerance)
    return ReferenceSolver(scene, [best, check], _QUAD_EPSILON)


def _in_quad(scene: Scene, tolerance: float, times: Array | None = None) -> Propagation:
    return Propagation(scene, quad=True, tol=tolerance, compact_mode=True, times=times)


def _in_doubles(
    scene: Scene,
    tolerances: tuple[float, float],
    times: Array | None = None,
    *,
    ends_at_samples: bool = False,
) -> OdeSolver:
    integrator = scipy_integrator("DOP853", *tolerances, ends_at_samples=ends_at_samples)
    return OdeSolver(scene, integrator, times)


def error_growth(scene: Scene, times: Array | None = None) -> Array:
    """Return the largest factor by which a small error of the initial state has grown, (samples,).

    It is the largest singular value of the state transition matrix for angles in rad and rates in
    `rate_units`. Pitches that stay at rest by symmetry are left out of the matrix. The growth is
    infinite from the first sample on at which the matrix overflows.

    Parameters
    ----------
    scene : the scene.
    times : (samples,) s, sample times; by default those of the scene.
    """
    if not is_available():
        times = sample_times(scene) if times is None else times
        return _largest_growth(scene, _matrices_by_quotients(scene, times))

    # The matrices of a million samples take half a gigabyte. Only the growth is kept.
    def growth_of(states: Array) -> Array:
        matrices = _matrices_in(states, scene)
        return _largest_growth(scene, matrices)[: len(matrices), None]

    propagation = Propagation(
        scene, variational=True, compact_mode=True, times=times, keep=growth_of
    )
    propagation.integrate()
    growth = np.full(scene.samples, np.inf)
    growth[: len(propagation.states)] = propagation.states[:, 0]
    return growth


def _transition_matrices(scene: Scene, times: Array) -> Array:
    """Return the state transition matrices from the start to each sample.

    They are computed by heyoka, or by difference quotients if heyoka is not installed.

    Parameters
    ----------
    scene : the scene.
    times : (samples,) s, sample times.

    Returns
    -------
    ndarray, shape (n, 2k, 2k)
        Matrices of the k coordinates that move, at the n samples that the integration reaches.
    """
    return (
        _variational_matrices(scene, times)
        if is_available()
        else _matrices_by_quotients(scene, times)
    )


def _variational_matrices(scene: Scene, times: Array | None = None) -> Array:
    """Return the state transition matrices by heyoka's variational equations."""
    propagation = Propagation(scene, variational=True, compact_mode=True, times=times)
    propagation.integrate()
    return _matrices_in(propagation.states, scene)


def _matrices_in(states: Array, scene: Scene) -> Array:
    """Return the state transition matrices in the states of a variational integration.

    A variational state has the state itself, then the matrix row by row. The result is a view.
    """
    count = 2 * len(scene.moving_coordinates)
    return np.asarray(states.reshape(-1, 1 + count, count)[:, 1:])


def _matrices_by_quotients(scene: Scene, times: Array) -> Array:
    """Return the state transition matrices by difference quotients of runs.

    Each of the runs has a small change in one variable of the initial state.

    Parameters
    ----------
    scene : the scene.
    times : (samples,) s, sample times.

    Returns
    -------
    ndarray, shape (n, 2k, 2k)
        Matrices of the k coordinates that move. A column is infinite at samples that the changed
        run did not reach.
    """
    moving = scene.moving_coordinates

    def states(start: Scene) -> Array:
        run = _in_doubles(start, _TIGHTEST, times)
        run.integrate()
        return run.states[:, : 2 * len(moving)]

    here, columns = states(scene), []
    for name, i in itertools.product(("initial_angles", "initial_rates"), moving):
        start = list(getattr(scene, name))
        start[i] += _PERTURBATION
        changed: dict[str, Any] = {name: tuple(start)}
        near = states(replace(scene, **changed))
        rows = min(len(near), len(here))
        column = np.full_like(here, np.inf)
        column[:rows] = (near[:rows] - here[:rows]) / _PERTURBATION
        columns.append(column)
    return np.stack(columns, axis=-1)


def _largest_growth(scene: Scene, matrices: Array) -> Array:
    """Return the growth of errors, (samples,), from the state transition matrices.

    It is infinite at samples whose matrix is not finite, and at samples without a matrix.

    Parameters
    ----------
    scene : the scene.
    matrices : (n, 2k, 2k) matrices at the first n samples.
    """
    growth = np.full(max(scene.samples, len(matrices)), np.inf)
    free = free_variables(scene)
    for rows in row_blocks(len(matrices)):
        finite = np.isfinite(matrices[rows]).all(axis=(1, 2))
        scaled = _in_units(scene, matrices[rows][finite])[:, free[:, None], free]
        growth[rows][finite] = np.linalg.norm(scaled, ord=2, axis=(1, 2))
    return growth


def free_variables(scene: Scene) -> NDArray[np.int64]:
    """Return the indices of the state variables, except those of pitches at rest by symmetry.

    The state has the angles, then the rates, of the coordinates that move.
    """
    moving, resting = scene.moving_coordinates, resting_pitches(scene)
    free = np.array([i for i, coordinate in enumerate(moving) if coordinate not in resting])
    return np.concatenate([free, len(moving) + free])


def _in_units(scene: Scene, matrices: Array) -> Array:
    """Return state transition matrices, (n, 2k, 2k), for rates in `rate_units`."""
    units = np.concatenate([np.ones(matrices.shape[1] // 2), rate_units(scene)])
    return np.asarray(matrices * units / units[:, None])


# Tolerance of `reference_at`. An error of this size that grows 1e10-fold is still below the
# rounding of doubles.
_QUAD_TOLERANCE = 1e-30


@dataclass(frozen=True)
class TimedReference:
    """Hold the reference of a scene at chosen times.

    Attributes
    ----------
    trajectory : time, angles, rates and error_growth, up to the last time that the integration
        reached.
    growth : (n, 2 (1 + blades)) for angles, then rates, the largest factor by which the error of
        the variable may exceed that of the initial state. The factors are the 2-norms of the rows
        of the state transition matrix; 1 for a pitch that is fixed or at rest by symmetry.
    units : (2 (1 + blades),) rad or rad/s, units of the variables in these norms.
    """

    trajectory: Trajectory
    growth: Array
    units: Array


def reference_at(scene: Scene, times: Array) -> TimedReference:
    """Compute the reference at chosen times, without interpolation.

    It is integrated in quad precision by heyoka, or by DOP853 at its tightest tolerance if heyoka
    is not installed.

    Parameters
    ----------
    scene : the scene.
    times : (n,) s, increasing from 0 to the duration.
    """
    if is_available():
        run: Propagation | OdeSolver = _in_quad(scene, _QUAD_TOLERANCE, times)
    else:
        run = _in_doubles(scene, _TIGHTEST, times, ends_at_samples=True)
    run.integrate()
    trajectory, matrices = run.observe(), _transition_matrices(scene, times)
    rows, moving, count = len(trajectory.time), scene.moving_coordinates, len(scene.initial_angles)
    trajectory.quantities["error_growth"] = _largest_growth(scene, matrices)[:rows]
    columns = np.array([*moving, *(count + i for i in moving)])
    free = free_variables(scene)
    units, growth = np.ones(2 * count), np.ones((rows, 2 * count))
    units[[count + i for i in moving]] = rate_units(scene)
    # The growth is infinite where the matrices overflow, or end before the motion does.
    growth[:, columns[free]] = np.inf
    known = min(rows, len(matrices))
    with np.errstate(all="ignore"):
        scaled = _in_units(scene, matrices[:known])[:, free[:, None], free]
        norms = np.linalg.norm(scaled, axis=2)
    growth[np.ix_(np.arange(known), columns[free])] = np.where(np.isfinite(norms), norms, np.inf)
    return TimedReference(trajectory, growth, units)


def with_azimuths(scene: Scene, azimuths: Sequence[float]) -> Accelerations:
    """Return the function that computes the accelerations with blades at other mounting angles.

    Parameters
    ----------
    scene : the rotor.
    azimuths : (blades,) rad, mounting angles about the shaft that replace `Scene.phases`.
    """
    phases = [(Fraction(math.cos(azimuth)), Fraction(math.sin(azimuth))) for azimuth in azimuths]
    form = rotor_form(scene, phases=phases)
    return lambda angles, rates, _form, *rest: closed_form.accelerations(angles, rates, form, *rest)


def combined_equations(*parts: tuple[float, float, float]) -> Accelerations:
    """Return the function that adds up the closed form's accelerations at several scaled rates.

    Parameters
    ----------
    parts : for each term of the sum its weight, the factor of the rotor's rate, and the factor of
        the pitches' rates.
    """

    def equations(angles: Sequence[Number], rates: Sequence[Number], *rest: Any) -> list[Number]:
        total: Any = 0.0
        for weight, spin, pitch in parts:
            scaled = [spin * rates[0], *(pitch * rate for rate in rates[1:])]
            total = total + weight * np.array(closed_form.accelerations(angles, scaled, *rest))
        return list(total)

    return equations


# Equations without one kind of term, for data that may lack the term. The moments of dampers are
# linear in the rates, all other terms with rates are products of two rates. Therefore sums of
# accelerations, computed with some rates set to zero or reversed, leave out one kind of product.
# The equations need not be written a second time.
REDUCED_EQUATIONS: Mapping[str, Accelerations] = {
    "Coriolis terms (products of rotor rate and pitch rate)": combined_equations(
        (1.0, 1, 0), (1.0, 0, 1), (-1.0, 0, 0)
    ),
    "centrifugal terms (square of the rotor rate)": combined_equations(
        (1.0, 1, 1), (-0.5, 1, 0), (-0.5, -1, 0), (1.0, 0, 0)
    ),
    "squares of the pitch rates": combined_equations(
        (1.0, 1, 1), (-0.5, 0, 1), (-0.5, 0, -1), (1.0, 0, 0)
    ),
    "terms with products of rates": combined_equations((0.5, 1, 1), (-0.5, -1, -1), (1.0, 0, 0)),
}
