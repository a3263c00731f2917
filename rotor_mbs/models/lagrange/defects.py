"""Compute the interval defects of a run by integrating the closed form from sample to sample.

The integration stops at kinks and jumps of the loads, so that these cause no error.
"""

from __future__ import annotations

import functools
import math
from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from rotor_mbs.errors import InputError
from rotor_mbs.methods.time_limit import raise_if_over
from rotor_mbs.models.lagrange import closed_form
from rotor_mbs.models.lagrange.closed_form import Accelerations, load_values
from rotor_mbs.models.lagrange.hamilton import resting_pitches
from rotor_mbs.models.lagrange.heyoka_adapter import is_available
from rotor_mbs.models.lagrange.ode_solvers import OdeSolver, scipy_integrator
from rotor_mbs.models.lagrange.parameters import pitch_weight, rate_units, rotor_form
from rotor_mbs.models.lagrange.samples import loads_at, loads_over_time, sampled_loads
from rotor_mbs.models.lagrange.singularity import least_inertia_shares
from rotor_mbs.models.lagrange.taylor import Propagation, is_compact
from rotor_mbs.scenario.scene import Scene
from rotor_mbs.scenario.time_table import Segment, values_before
from rotor_mbs.solution.defects import BLOCK_ROWS, Defects, row_blocks
from rotor_mbs.solution.metrics import ANGLE_LIMIT
from rotor_mbs.solution.trajectory import Array, Trajectory

# Largest number of steps in one interval, by heyoka and by DOP853. A stiff bearing of 1e12 N m/rad
# takes some 600 and 900 steps, a minute of chaotic motion 2,900 and 8,400. Samples far from any
# motion would need an unlimited number. If an interval needs more steps, its samples count as no
# motion of this rotor.
_MAX_STEPS_TAYLOR = 5_000
_MAX_STEPS_DOP853 = 10_000
# One interval that needs too many steps decides the status, and more such intervals do not change
# it. Therefore each of them halves the number of steps that the next intervals may take, but not
# below this number. If all samples are far from a motion, the total number of steps is then little
# more than that of one interval.
_FEWEST_STEPS = 50
_TAYLOR = 2.0**-52  # tolerance of heyoka
# Relative and absolute tolerance of DOP853. SciPy allows hardly a smaller relative one.
_DOP853 = (2.3e-14, 1e-16)
_EVALUATIONS_PER_STEP = 12  # evaluations of each step that DOP853 tries, accepted or not
# Angle (rad) by which the fastest coordinate may advance in one Runge-Kutta step of order 4. The
# relative error of the transition matrices is then about 1e-5.
_RADIANS_PER_STEP = 0.25
# The relative error is larger if rates change within an interval. The state that the Runge-Kutta
# steps reach then differs from the more accurate one of `interval_ends`. If the difference is at
# most this (rad and rate units), the relative error of the matrices is at most 4e-4 in the paper's
# motions.
_ROUGH_END = 3e-5
# Largest number of Runge-Kutta steps in an interval. Integrating every interval by itself is always
# more accurate, and is faster if an interval needs more than about 75 Runge-Kutta steps.
_MAX_RUNGE_KUTTA_STEPS = 32
# Number of rows in the window from whose angles the rates of a row are computed. A window of two
# rows would have no residual and would not reduce noise.
FIT_ROWS = 5
_FIT_ROUNDS = 12  # largest number of Gauss-Newton corrections
# A correction of the rates times the sample interval (rad) at which they have converged: the error
# that remains is of the order of its square.
_STANDS_STILL = 1e-9
# The rows are near enough if the first correction of the finite differences, times the sample
# interval, has at most this median (rad) over the rows. Up to this value correct data of the
# paper's motions always converged; from 0.8 on some did not.
_NEAR = 0.5
_SIDE = 1e-9  # distance from the ends of an interval at which loads are evaluated, in steps
_UNIT_ROUNDOFF = 2.0**-53
# Smallest share of its inertia with which a rotor is not singular. The error of an interval with a
# singular rotor is unknown.
_SMALLEST_SHARE = 1e-30
# Difference (rad and rate units) of the difference quotients. Rounding and curvature then change
# the entries of a matrix by a share of about 1e-8.
_DIFFERENCE = 1e-7
# Difference that is tried next, if errors grow so much that the first one is larger than
# _SMALL_AT_END (rad and rate units) at the end of the interval.
_SMALL_DIFFERENCE = 1e-11
_SMALL_AT_END = 0.1


def interval_defects(
    scene: Scene,
    time: Array,
    angles: Array,
    rates: Array,
    rounding: Array | None = None,
    time_rounding: Array | None = None,
) -> Defects:
    """Compute the interval defects of samples, which may be those of a run or other data.

    The closed form is integrated by heyoka at its tightest tolerance, or by SciPy's DOP853 if
    heyoka is not installed.

    Parameters
    ----------
    scene : the rotor and its loads.
    time : (n,) s, increasing, within the scene's duration.
    angles, rates : (n, 1 + blades) rad and rad/s.
    rounding : (2 + 2 blades,) or (n, 2 + 2 blades) rad, then rad/s, half a unit in the last digit
        of angles, then rates; by default that of doubles.
    time_rounding : (n,) s, half a unit in the last digit of the times; by default that of doubles.

    Returns
    -------
    Defects
        The defects of the n - 1 intervals.
    """
    moving = scene.moving_coordinates
    states = np.hstack([angles[:, moving], rates[:, moving]])
    half = len(moving)
    ends = interval_ends(scene, time[:-1], time[1:], states[:-1])
    # In the closed form a fixed pitch keeps its angle and rate.
    angle_defects, rate_defects = angles[:-1] - angles[1:], rates[:-1] - rates[1:]
    angle_defects[:, moving] = ends[:, :half] - states[1:, :half]
    rate_defects[:, moving] = ends[:, half:] - states[1:, half:]
    units = np.full(angles.shape[1], 1.0)
    units[moving] = rate_units(scene)
    if len(time) > 1:
        units = np.maximum(units, 1.0 / float(np.median(np.diff(time))))
    loads = sampled_loads(scene, time, angles, rates) if scene.wants("loads") else {}
    last_digits = _UNIT_ROUNDOFF * np.abs(states)
    if rounding is not None:
        count = angles.shape[1]
        last_digits = np.maximum(
            last_digits, rounding[..., [*moving, *(count + i for i in moving)]]
        )
    if time_rounding is None:
        time_rounding = _UNIT_ROUNDOFF * np.abs(time)
    # The time of a row is rounded, too. Its rounding, times the rate of change of a variable, is an
    # error of this variable.
    last_digits = last_digits + time_rounding[:, None] * rates_of_change(scene, time, states)
    shares = least_inertia_shares(scene, angles)
    start = np.concatenate(
        [np.array(scene.initial_angles)[moving], np.array(scene.initial_rates)[moving]]
    )
    return Defects(
        time=time,
        angles=angle_defects,
        rates=rate_defects,
        rate_units=units,
        find_transitions=functools.partial(_transitions_in, scene, time, states, ends),
        moving=tuple(moving),
        resting=resting_pitches(scene),
        states=states,
        rounding=last_digits,
        conditioning=1.0
        / np.sqrt(np.maximum(np.minimum(shares[:-1], shares[1:]), _SMALLEST_SHARE)),
        start=start,
        growth_units=np.concatenate([np.ones(half), rate_units(scene)]),
        own_loads=Trajectory(time, angles, rates, **loads),
        precision=_TAYLOR if is_available() else _DOP853[0],
    )


def rates_of_change(scene: Scene, time: Array, states: Array) -> Array:
    """Return the magnitude of the time derivative of each variable at the given states.

    At a jump of a load it is the larger of the values before and after the jump.

    Parameters
    ----------
    scene : the rotor and its loads.
    time : (n,) s.
    states : (n, m) angles (rad), then rates (rad/s), of the coordinates that move.

    Returns
    -------
    ndarray, shape (n, m)
        rad/s, then rad/s².
    """
    half = states.shape[1] // 2
    form, changes = rotor_form(scene), np.zeros(states.shape)
    changes[:, :half] = np.abs(states[:, half:])
    for rows in row_blocks(len(time)):
        angles, rates = list(states[rows, :half].T), list(states[rows, half:].T)
        sides = [loads_at(scene, time[rows])]
        if not scene.has_constant_loads:
            before = values_before(scene.load_segments, time[rows])
            sides.append(load_values(list(before), scene.moving_coordinates[1:]))
        with np.errstate(all="ignore"):
            for loads in sides:
                accelerations = closed_form.accelerations(
                    angles, rates, form, loads, np.sin, np.cos
                )
                for i, values in enumerate(accelerations):
                    changes[rows, half + i] = np.maximum(changes[rows, half + i], np.abs(values))
    return changes


@dataclass(frozen=True)
class FittedRates:
    """Hold rates that were computed from angles, and the derivatives of the rates by the angles.

    Attributes
    ----------
    rates : (n, 1 + blades) rad/s.
    sensitivity : (n, half, FIT_ROWS half) 1/s, derivatives of the rates by the angles in the window
        of their row; `half` is the number of coordinates that move.
    windows : (n,) first row of the window of each row.
    """

    rates: Array
    sensitivity: Array
    windows: NDArray[np.int64]

    def rounding(self, rounding: Array) -> Array:
        """Return the errors of the rates, (n, half) rad/s, that rounded angles cause.

        Parameters
        ----------
        rounding : (n, half) rad, largest rounding errors of the angles of the coordinates that
            move.
        """
        of_window = np.hstack([rounding[self.windows + row] for row in range(FIT_ROWS)])
        return np.asarray(np.einsum("kij,kj->ki", np.abs(self.sensitivity), of_window))


def fitted_rates(scene: Scene, time: Array, angles: Array) -> FittedRates:
    """Compute the rates of data that have angles only, by fits of the closed form to five rows.

    The rates of a row follow from the angles in a window of five rows. The unknowns of a fit are
    the state at the first row of its window, from which transition matrices give the states at the
    other rows. The fits are solved by Gauss-Newton corrections, which begin with finite differences
    of the angles, and end when the rates no longer change.

    Parameters
    ----------
    scene : the rotor and its loads.
    time : (n,) s, increasing.
    angles : (n, 1 + blades) rad.

    Raises
    ------
    InputError
        If there are fewer rows than a window has, an angle is over `ANGLE_LIMIT`, errors grow
        without bound from one row to the next, or the rows are so far apart that the rates do not
        converge from finite differences. No error is raised if the rows are near enough, but no
        motion passes through some of them. The rates of these rows do not converge, those of the
        other rows do.
    """
    count = len(time)
    if count < FIT_ROWS:
        raise InputError(f"{count} rows; allowed: at least {FIT_ROWS} to compute rates from angles")
    if not np.abs(angles).max() <= ANGLE_LIMIT:
        raise InputError(
            f"angles over {ANGLE_LIMIT:g} rad: their rounding errors are too large to compute rates"
        )
    moving = scene.moving_coordinates
    half = len(moving)
    rates = np.zeros_like(angles)
    rates[:, moving] = np.gradient(angles[:, moving], time, axis=0, edge_order=2)
    firsts = np.arange(count - FIT_ROWS + 1)
    middle = FIT_ROWS // 2
    # A row is in the middle of its window. Rows near the start or the end have the first or the
    # last window.
    windows = np.clip(np.arange(count) - middle, 0, len(firsts) - 1)
    places = np.arange(count) - windows
    step = float(np.median(np.diff(time)))
    scale = np.concatenate([np.ones(half), np.full(half, 1.0 / step)])
    before, is_near = np.inf, False
    for _ in range(_FIT_ROUNDS):
        states = np.hstack([angles[:, moving], rates[:, moving]])
        ends = interval_ends(scene, time[:-1], time[1:], states[:-1])
        transitions = _transitions(scene, time, states, ends)
        jumps = ends - states[1:]
        # In each row of a window the motion deviates from the state of the data by
        # matrix @ (deviation at the first row) + offset. The least squares minimize the deviations
        # of the angles.
        matrices = [np.broadcast_to(np.eye(2 * half), (len(firsts), 2 * half, 2 * half))]
        offsets = [np.zeros((len(firsts), 2 * half))]
        for row in range(FIT_ROWS - 1):
            matrix = transitions[firsts + row]
            matrices.append(matrix @ matrices[-1])
            offsets.append(np.einsum("kij,kj->ki", matrix, offsets[-1]) + jumps[firsts + row])
        design = np.concatenate([matrix[:, :half] * scale for matrix in matrices], axis=1)
        residual = np.concatenate([offset[:, :half] for offset in offsets], axis=1)
        if not (np.isfinite(design).all() and np.isfinite(residual).all()):
            raise InputError(
                "the rates cannot be computed from the angles: errors grow without bound between "
                "the rows"
            )
        inverse = np.linalg.pinv(design)
        at_first = -np.einsum("kij,kj->ki", inverse, residual) * scale
        all_rows = np.stack(
            [
                np.einsum("kij,kj->ki", m, at_first) + offset
                for m, offset in zip(matrices, offsets, strict=True)
            ]
        )
        correction = all_rows[places, windows, half:]
        rates[:, moving] += correction
        changes = step * np.abs(correction).max(axis=1)
        change, usual = float(changes.max()), float(np.median(changes))
        if before == np.inf:  # the first round
            is_near = usual <= _NEAR
        if change <= _STANDS_STILL:
            break
        # If the largest correction does not decrease, stop in two cases. Either most rows have
        # converged, and the other rows fit no motion. Or the finite differences were too far away.
        if not change < before and (usual <= _STANDS_STILL or not is_near):
            break
        before = change
    if is_near or change <= _STANDS_STILL:
        at_rows = np.stack(matrices)[places, windows, half:] * scale
        return FittedRates(rates, at_rows @ inverse[windows], windows)
    raise InputError(
        "the rates cannot be computed from the angles: the rows are too far apart for this motion"
    )


def interval_ends(
    scene: Scene, begins: Array, ends: Array, states: Array, integration: _Integration | None = None
) -> Array:
    """Integrate the closed form from each row of states to the end of its interval.

    Parameters
    ----------
    scene : the rotor and its loads.
    begins, ends : (n,) s, start and end of the interval of each row, increasing.
    states : (n, m) rad, then rad/s, angles, then rates, of the coordinates that move, at `begins`.
    integration : result of `_integration_of` for this scene, if several calls share it; by default
        it is built here.

    Returns
    -------
    ndarray, shape (n, m)
        States at `ends`. A row is NaN if its end is not reached within the allowed number of steps.
    """
    segments = scene.load_segments
    advance, max_steps = integration or _integration_of(scene, states.shape[1])
    reached_states = states.astype(float)
    # All states are checked here at once. In the loop the check would take as long as a step.
    is_finite = np.asarray(np.isfinite(states).all(axis=1))
    place = 0
    for k, (state, begin, end) in enumerate(
        zip(states, begins.tolist(), ends.tolist(), strict=True)
    ):
        raise_if_over()
        reached = begin
        while place + 1 < len(segments) and segments[place].end <= reached:
            place += 1
        part, steps, is_there = place, 0, bool(is_finite[k])
        while reached < end and is_there:
            # Data may extend beyond the scene's end. The last segment's loads apply there.
            until = min(segments[part].end, end) if part + 1 < len(segments) else end
            state, taken = advance(segments[part], reached, until, state, max_steps)
            reached, part, steps = until, part + 1, steps + taken
            if reached < end:
                is_there = bool(np.isfinite(state).all())
        reached_states[k] = state
        # The reason is at _FEWEST_STEPS.
        if steps >= _FEWEST_STEPS and not np.isfinite(state).all():
            max_steps = max(max_steps // 2, _FEWEST_STEPS)
    reached_states[~np.isfinite(reached_states).all(axis=1)] = np.nan
    return reached_states


# A function (segment, start, end, state at the start, largest number of steps) that returns the
# state at the end, NaN if the end is not reached, and the number of steps.
_Advance = Callable[[Segment, float, float, Array, int], tuple[Array, int]]
# An integration, and the largest number of steps that it may take in an interval.
_Integration = tuple[_Advance, int]


def _integration_of(scene: Scene, count: int) -> _Integration:
    """Return the function that integrates over an interval, and its largest number of steps.

    The function integrates by heyoka, or by DOP853 if heyoka is not installed.

    Parameters
    ----------
    scene : the rotor and its loads.
    count : number of variables, angles and rates of the coordinates that move.
    """
    if is_available():
        return _advance_by_taylor(scene, count), _MAX_STEPS_TAYLOR
    return _advance_by_dop853(scene), _MAX_STEPS_DOP853


def _advance_by_taylor(scene: Scene, count: int) -> _Advance:
    """Return a function that integrates over a part of a segment by heyoka's Taylor method.

    Parameters
    ----------
    scene : the rotor and its loads.
    count : number of variables, angles and rates of the coordinates that move.
    """
    propagation = Propagation(
        scene, tol=_TAYLOR, compact_mode=is_compact(scene), high_accuracy=True
    )
    integrator = propagation.integrator
    state = integrator.state
    has_work = len(state) > count
    entered: list[Segment] = []

    def advance(
        segment: Segment, start: float, end: float, values: Array, max_steps: int
    ) -> tuple[Array, int]:
        if not entered or entered[-1] is not segment:
            entered[:] = [segment]
            propagation.set_segment(segment)
        integrator.time = start
        state[:count] = values
        if has_work:
            state[count:] = 0.0
        _, _, _, steps, *_ = integrator.propagate_until(end, max_steps=max_steps)
        # The end is not reached after too many steps, or after a state that is not finite. Both are
        # returned as NaN.
        if integrator.time != end:
            state[:count] = np.nan
        return state[:count].copy(), steps

    return advance


def _advance_by_dop853(scene: Scene) -> _Advance:
    """Return a function that integrates over a part of a segment by SciPy's DOP853.

    Parameters
    ----------
    scene : the rotor and its loads. The work is not integrated, whatever its outputs are.
    """
    solver = OdeSolver(
        replace(scene, outputs=("angles", "rates")), scipy_integrator("DOP853", *_DOP853)
    )

    def advance(
        segment: Segment, start: float, end: float, values: Array, max_steps: int
    ) -> tuple[Array, int]:
        integrator = scipy_integrator("DOP853", *_DOP853, max_steps)
        function = solver.right_hand_side(Segment(start, end, segment.linear_loads))
        part = integrator(function, start, end, values, np.empty(0))
        raise_if_over()  # otherwise an interval cut by the time limit would count as no motion
        end_state = np.full(len(values), np.nan) if part.message else part.end
        return end_state, (part.evaluations or 0) // _EVALUATIONS_PER_STEP

    return advance


def _transitions_in(scene: Scene, time: Array, states: Array, ends: Array, rows: slice) -> Array:
    """Return the state transition matrices of a slice of the intervals, (k, m, m).

    Parameters
    ----------
    scene, time, states, ends : see `_transitions`.
    rows : slice of the intervals; neither its start nor its end is None or negative.
    """
    samples = slice(rows.start, rows.stop + 1)
    return _transitions(scene, time[samples], states[samples], ends[rows])


def _transitions(scene: Scene, time: Array, states: Array, ends: Array) -> Array:
    """Return the state transition matrices of the intervals.

    Parameters
    ----------
    scene : the rotor and its loads.
    time : (n,) s, sample times.
    states : (n, m) angles, then rates, of the coordinates that move, at the samples.
    ends : (n - 1, m) states that `interval_ends` computes from them.

    Returns
    -------
    ndarray, shape (n - 1, m, m)
        Matrices with a relative error of mostly 1e-5, and at most 5e-4. A matrix is infinite if the
        end of its interval is not finite, or if errors grow too much for difference quotients.
    """
    count = states.shape[1]
    units = np.concatenate([np.ones(count // 2), rate_units(scene)])
    transitions = np.full((len(ends), count, count), np.inf)
    is_finite = np.asarray(np.isfinite(ends).all(axis=1))
    is_rough = is_finite.copy()
    for start in range(0, len(ends), BLOCK_ROWS):
        rows = start + np.flatnonzero(is_finite[start : start + BLOCK_ROWS])
        lengths = time[rows + 1] - time[rows]
        steps = (
            explicit_steps(scene, lengths, states[rows], _MAX_RUNGE_KUTTA_STEPS)
            if len(rows)
            else None
        )
        if steps is not None:
            matrices, quick = _quick_transitions(scene, time, states, rows, units, steps)
            is_near = (np.abs(quick - ends[rows]) / units <= _ROUGH_END).all(axis=1)
            is_near &= np.isfinite(matrices).all(axis=(1, 2))
            transitions[rows[is_near]] = matrices[is_near]
            is_rough[rows[is_near]] = False
    # For intervals in which Runge-Kutta steps would be too many or too inaccurate, take difference
    # quotients of the more accurate `interval_ends`.
    rows = np.flatnonzero(is_rough)
    for difference in (_DIFFERENCE, _SMALL_DIFFERENCE):
        if len(rows):
            matrices, is_linear = _difference_transitions(
                scene, time, states, ends, rows, difference * units
            )
            transitions[rows[is_linear]] = matrices[is_linear]
            rows = rows[~is_linear]
    transitions[~np.isfinite(transitions).all(axis=(1, 2))] = np.inf
    return transitions


def _difference_transitions(
    scene: Scene,
    time: Array,
    states: Array,
    ends: Array,
    rows: NDArray[np.int64],
    differences: Array,
) -> tuple[Array, NDArray[np.bool_]]:
    """Compute transition matrices of intervals by difference quotients of their ends.

    Parameters
    ----------
    scene : the rotor and its loads.
    time, states, ends : see `_transitions`.
    rows : (k,) numbers of the samples at which the intervals begin.
    differences : (m,) rad, then rad/s, changes of the variables at the start of an interval.

    Returns
    -------
    matrices : ndarray, shape (k, m, m)
        The difference quotients. They are valid only if `is_linear` is True.
    is_linear : ndarray of bool, shape (k,)
        Whether no difference has grown above `_SMALL_AT_END` at the end of the interval. Larger
        differences do not grow linearly.
    """
    count = states.shape[1]
    units = differences / differences[0]
    matrices = np.empty((len(rows), count, count))
    integration = _integration_of(scene, count)
    is_linear = np.ones(len(rows), dtype=bool)
    with np.errstate(all="ignore"):
        for i in range(count):
            moved = states[rows]
            moved[:, i] += differences[i]
            change = moved[:, i] - states[rows, i]  # the difference after rounding
            moved_ends = interval_ends(scene, time[rows], time[rows + 1], moved, integration)
            away = moved_ends - ends[rows]
            matrices[:, :, i] = away / change[:, None]
            is_linear &= ~(np.abs(away / units) > _SMALL_AT_END).any(axis=1)
    return matrices, is_linear


def _quick_transitions(
    scene: Scene, time: Array, states: Array, rows: NDArray[np.int64], units: Array, steps: int
) -> tuple[Array, Array]:
    """Compute transition matrices of intervals by Runge-Kutta steps of order 4.

    Parameters
    ----------
    scene : the rotor and its loads.
    time, states : see `_transitions`.
    rows : (k,) numbers of the samples at which the intervals begin.
    units : (m,) rad, then rad/s, units of the variables.
    steps : number of steps in each interval.

    Returns
    -------
    matrices : ndarray, shape (k, m, m)
    ends : ndarray, shape (k, m)
        The states that the Runge-Kutta steps reach at the ends of the intervals.
    """
    count = states.shape[1]
    # The array has the shape (m, 1 + m, k). For every interval it holds the state at the start, and
    # m states of which each differs in one variable.
    moved = np.repeat(states[rows].T[:, None, :], 1 + count, axis=1)
    for i in range(count):
        moved[i, 1 + i] += _DIFFERENCE * units[i]
    with np.errstate(all="ignore"):
        moved = quick_ends(scene, time[rows], time[rows + 1], moved, steps)
        columns = (moved[:, 1:] - moved[:, :1]) / (_DIFFERENCE * units[:, None])
    return columns.transpose(2, 0, 1), moved[:, 0].T


def explicit_steps(scene: Scene, intervals: Array, states: Array, most: int) -> int | None:
    """Return the number of Runge-Kutta steps that each interval needs, or None if above `most`.

    In one step of the longest interval, the largest rate or pitch frequency may advance by at most
    0.25 rad.

    Parameters
    ----------
    scene : the rotor.
    intervals : (n,) s, lengths of the intervals.
    states : (n, m) angles, then rates, of the coordinates that move, at the starts of the
        intervals.
    most : largest number of steps allowed.
    """
    half = states.shape[1] // 2
    fastest = float(np.max(np.where(np.isfinite(states[:, half:]), np.abs(states[:, half:]), 0.0)))
    for blade in rotor_form(scene).blades:
        moment = blade.stiffness + pitch_weight(blade)
        fastest = max(
            fastest, math.sqrt(moment / blade.pitch_inertia), blade.damping / blade.pitch_inertia
        )
    steps = fastest * float(intervals.max()) / _RADIANS_PER_STEP
    return max(math.ceil(steps), 1) if steps <= most else None


def runge_kutta_step(
    derivative: Callable[[Array, Array], Array], time: Array, state: Array, h: Array
) -> Array:
    """Return the state after a step of the classical Runge-Kutta method of order 4."""
    k1 = derivative(time, state)
    k2 = derivative(time + 0.5 * h, state + 0.5 * h * k1)
    k3 = derivative(time + 0.5 * h, state + 0.5 * h * k2)
    k4 = derivative(time + h, state + h * k3)
    return np.asarray(state + h / 6.0 * (k1 + 2.0 * k2 + 2.0 * k3 + k4))


def quick_ends(
    scene: Scene,
    begins: Array,
    ends: Array,
    states: Array,
    steps: int,
    equations: Accelerations | None = None,
    step: Callable[..., Array] | None = None,
) -> Array:
    """Compute the states at the ends of all intervals at once, by Runge-Kutta steps of order 4.

    The difference of the results of two calls has a relative error of about 1e-5. The error is
    larger if rates change within an interval.

    Parameters
    ----------
    scene : the rotor and its loads.
    begins, ends : (n,) s, start and end of each interval.
    states : (m, ..., n) angles, then rates, of the coordinates that move, at `begins`.
    steps : number of steps in each interval.
    equations : function that computes the accelerations; by default the closed form's.
    step : function step(derivative, t, state, h) of another method; by default `runge_kutta_step`.

    Returns
    -------
    ndarray, shape (m, ..., n)
        States at `ends`.
    """
    step = step or runge_kutta_step
    form, half = rotor_form(scene), len(states) // 2
    equations = equations or closed_form.accelerations
    h = (ends - begins) / steps

    # If a load jumps at the start or end of an interval, take its value inside the interval.
    earliest, latest = begins + _SIDE * h, ends - _SIDE * h
    loads_inside = loads_over_time(scene)

    def derivative(at: Array, state: Array) -> Array:
        angles, rates = list(state[:half]), list(state[half:])
        loads = loads_inside(np.clip(at, earliest, latest))
        accelerations = equations(angles, rates, form, loads, np.sin, np.cos)
        change = np.empty(state.shape)
        change[:half] = state[half:]
        for i, row in enumerate(accelerations):  # a row may be one number for all intervals
            change[half + i] = row
        return change

    with np.errstate(all="ignore"):
        for number in range(steps):
            at = begins + number * h
            states = step(derivative, at, states, h)
    return states
