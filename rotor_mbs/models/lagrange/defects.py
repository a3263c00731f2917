"""Compute interval defects by the closed form, from each sample of a run to the next one.

They are exact at jumps of the loads.
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

# Of one interval, by heyoka and by DOP853. A stiff bearing of 1e12 N m/rad takes some 600 and 900,
# a minute of chaos 2,900 and 8,400; samples far from any motion would need an unlimited number. An
# interval that needs more is taken for no motion of this rotor.
_MAX_STEPS_TAYLOR = 5_000
_MAX_STEPS_DOP853 = 10_000
# One such interval decides the status, and more of them do not change it. So each halves the number
# of steps that the next may take, down to this one: samples that are all far from a motion take
# little more than one interval's steps.
_FEWEST_STEPS = 50
_TAYLOR = 2.0**-52  # tolerance
_DOP853 = (2.3e-14, 1e-16)  # tolerances, the tightest that SciPy takes
_EVALUATIONS_PER_STEP = 12  # of DOP853, whether a step is kept or tried again
# Runge-Kutta steps of order 4 over a quarter of a radian leave a share of about 1e-5 of the
# transition matrices.
_RADIANS_PER_STEP = 0.25
# Where rates change within an interval, they leave more. This shows in their state at the end,
# compared with the more accurate one of `interval_ends`: in the paper's motions, up to this
# distance (rad and rate units) the matrices are right to a share of 4e-4.
_ROUGH_END = 3e-5
# Of an interval. Beyond some 75 steps the integration of every interval by itself is faster, and
# always more accurate.
_MAX_RUNGE_KUTTA_STEPS = 32
# Rows of a window in which rates are found from angles: two would leave no residual, and would not
# reduce noise.
FIT_ROWS = 5
_FIT_ROUNDS = 12
_STANDS_STILL = 1e-9  # rad in an interval: the remaining error is the square of it
# rad in an interval, median of the rows: where the first correction of the finite differences is at
# most this, right data of the paper's motions always converged; from 0.8 on some did not.
_NEAR = 0.5
_SIDE = 1e-9  # of a step
_UNIT_ROUNDOFF = 2.0**-53
# Below this share of its inertia a rotor is singular, and nothing is known of the interval.
_SMALLEST_SHARE = 1e-30
# rad and rate units: rounding and curvature are a share of 1e-8 or so of a matrix's entries
_DIFFERENCE = 1e-7
# Where errors grow so much that such a difference is not small any more at the end of the interval,
# this smaller one is tried.
_SMALL_DIFFERENCE = 1e-11
_SMALL_AT_END = 0.1  # rad and rate units


def interval_defects(
    scene: Scene,
    time: Array,
    angles: Array,
    rates: Array,
    rounding: Array | None = None,
    time_rounding: Array | None = None,
) -> Defects:
    """Compute the defects of samples, of a run or of other data, against the closed form.

    Parameters
    ----------
    scene : the rotor and its loads.
    time : (n,) s, increasing, within the scene's duration.
    angles, rates : (n, 1 + blades) rad and rad/s.
    rounding : (2 + 2 blades,), or for each row: half a unit in the last digit of angles, then
        rates; that of doubles where left out.
    time_rounding : (n,) s, likewise.

    Returns
    -------
    Defects
        Of n - 1 intervals. By heyoka at its tightest, or by SciPy's DOP853 where that is not
        installed.
    """
    moving = scene.moving_coordinates
    states = np.hstack([angles[:, moving], rates[:, moving]])
    half = len(moving)
    ends = interval_ends(scene, time[:-1], time[1:], states[:-1])
    # Pitches that are fixed keep their angles and rates.
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
    # The time of a row is rounded, too: times the rate of change that is an error of the state.
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
    """Return |dy/dt| of each variable at states; at a jump of a load, the larger of both sides.

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
    """Hold rates that were computed from angles, and their sensitivity to these.

    Attributes
    ----------
    rates : (n, 1 + blades) rad/s.
    sensitivity : (n, half, FIT_ROWS half) 1/s, of the rate of each of the `half` coordinates that
        move, by each angle of its window.
    windows : (n,) first row of the window of each row.
    """

    rates: Array
    sensitivity: Array
    windows: NDArray[np.int64]

    def rounding(self, rounding: Array) -> Array:
        """Return the rounding of the rates, (n, half) rad/s, that follows from that of the angles.

        Parameters
        ----------
        rounding : (n, half) rad, of the angles of the coordinates that move.
        """
        of_window = np.hstack([rounding[self.windows + row] for row in range(FIT_ROWS)])
        return np.asarray(np.einsum("kij,kj->ki", np.abs(self.sensitivity), of_window))


def fitted_rates(scene: Scene, time: Array, angles: Array) -> FittedRates:
    """Compute the rates of data that have angles only, by a fit of the closed form to five rows.

    Gauss-Newton least squares over the state at the first row of every window, which the transition
    matrices carry through the window. It begins with finite differences of the angles, and ends
    when the rates no longer change.

    Parameters
    ----------
    scene : the rotor and its loads.
    time : (n,) s, increasing.
    angles : (n, 1 + blades) rad.

    Raises
    ------
    InputError
        If there are fewer rows than a window has, an angle is over `ANGLE_LIMIT`, the motion is too
        stiff to carry a state from row to row, or the rows are so far apart that the rates do not
        converge from finite differences. If the rates do not converge although the rows are near,
        no motion passes through some of them: then nothing is raised, and the rates of the others
        are found.
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
    # The window of a row is the one in whose middle it is, or near an end the first or last one.
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
        # Deviations from the data's own states: in each row of a window, matrix @ (deviation at the
        # first row) + offset. The least squares make those of the angles small.
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
        # Without progress, end where most rows have converged and the others fit no motion, or
        # where the finite differences were too far away.
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
    states : (n, m) angles, then rates, of the coordinates that move.
    integration : of this scene, to be used in several calls; built here where left out.

    Returns
    -------
    ndarray, shape (n, m)
        States at `ends`; NaN where the end is not reached, or would take more steps than any motion
        of the rotor.
    """
    segments = scene.load_segments
    advance, max_steps = integration or _integration_of(scene, states.shape[1])
    reached_states = states.astype(float)
    # Not asked of each state in the loop, where it would take as long as a step.
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
            # Data may go on after the scene's end, with the last loads.
            until = min(segments[part].end, end) if part + 1 < len(segments) else end
            state, taken = advance(segments[part], reached, until, state, max_steps)
            reached, part, steps = until, part + 1, steps + taken
            if reached < end:
                is_there = bool(np.isfinite(state).all())
        reached_states[k] = state
        # See _FEWEST_STEPS.
        if steps >= _FEWEST_STEPS and not np.isfinite(state).all():
            max_steps = max(max_steps // 2, _FEWEST_STEPS)
    reached_states[~np.isfinite(reached_states).all(axis=1)] = np.nan
    return reached_states


# (segment, start, end, state at the start, most steps) -> state at the end, NaN where it is not
# reached; steps taken
_Advance = Callable[[Segment, float, float, Array, int], tuple[Array, int]]
_Integration = tuple[_Advance, int]  # and the most steps that it may take in an interval


def _integration_of(scene: Scene, count: int) -> _Integration:
    """Return the integration from sample to sample: by heyoka, or by DOP853 without it.

    Parameters
    ----------
    scene : the rotor and its loads.
    count : number of variables, angles and rates of the coordinates that move.
    """
    if is_available():
        return _advance_by_taylor(scene, count), _MAX_STEPS_TAYLOR
    return _advance_by_dop853(scene), _MAX_STEPS_DOP853


def _advance_by_taylor(scene: Scene, count: int) -> _Advance:
    """Return an integration over parts of segments by the compiled code of lagrange/taylor.

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
        if integrator.time != end:  # too many steps, or not finite: what comes after it is neither
            state[:count] = np.nan
        return state[:count].copy(), steps

    return advance


def _advance_by_dop853(scene: Scene) -> _Advance:
    """Return an integration over parts of segments by SciPy's DOP853.

    Parameters
    ----------
    scene : the rotor and its loads; its outputs are reduced to angles and rates.
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
        raise_if_over()  # else the interval would count as one of no motion
        end_state = np.full(len(values), np.nan) if part.message else part.end
        return end_state, (part.evaluations or 0) // _EVALUATIONS_PER_STEP

    return advance


def _transitions_in(scene: Scene, time: Array, states: Array, ends: Array, rows: slice) -> Array:
    """Return the state transition matrices of a slice of the intervals, (k, m, m).

    Parameters
    ----------
    scene, time, states, ends : as of `_transitions`.
    rows : of the intervals; it begins and ends at whole numbers.
    """
    samples = slice(rows.start, rows.stop + 1)
    return _transitions(scene, time[samples], states[samples], ends[rows])


def _transitions(scene: Scene, time: Array, states: Array, ends: Array) -> Array:
    """Return the state transition matrices of the intervals.

    Parameters
    ----------
    scene : the rotor and its loads.
    time : (n,) s, of the samples.
    states : (n, m) at the samples, angles, then rates, of the coordinates that move.
    ends : (n - 1, m) where `interval_ends` gets from them.

    Returns
    -------
    ndarray, shape (n - 1, m, m)
        Right to a share of 5e-4, mostly of 1e-5; infinite where an end is not finite.
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
    # Where explicit steps are too long or too rough: differences of ends that the integrator of the
    # defects computes.
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
    time, states, ends : as of `_transitions`.
    rows : (k,) the samples at which the intervals begin.
    differences : (m,) by how much each variable is moved.

    Returns
    -------
    matrices : ndarray, shape (k, m, m) Where errors have grown to the size of the motion, a matrix
        says only that they grow no more.
    is_linear : ndarray of bool, shape (k,)
        Whether every moved end is next to the interval's own.
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
            change = moved[:, i] - states[rows, i]  # as it is rounded
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
    time, states : as of `_transitions`.
    rows : (k,) the samples at which the intervals begin.
    units : (m,) what counts as 1 in each variable.
    steps : number of steps in each interval.

    Returns
    -------
    matrices : ndarray, shape (k, m, m)
    ends : ndarray, shape (k, m)
        The states that the same steps reach.
    """
    count = states.shape[1]
    # (m, 1 + directions, k): the state of every interval, as it is and moved by a difference in
    # every direction.
    moved = np.repeat(states[rows].T[:, None, :], 1 + count, axis=1)
    for i in range(count):
        moved[i, 1 + i] += _DIFFERENCE * units[i]
    with np.errstate(all="ignore"):
        moved = quick_ends(scene, time[rows], time[rows + 1], moved, steps)
        columns = (moved[:, 1:] - moved[:, :1]) / (_DIFFERENCE * units[:, None])
    return columns.transpose(2, 0, 1), moved[:, 0].T


def explicit_steps(scene: Scene, intervals: Array, states: Array, most: int) -> int | None:
    """Return how many Runge-Kutta steps an interval needs, or None if more than `most`.

    The fastest rate or pitch frequency advances by at most 0.25 rad in a step of the longest
    interval.

    Parameters
    ----------
    scene : the rotor.
    intervals : (n,) s, their lengths.
    states : (n, m) at their starts, angles, then rates, of the coordinates that move.
    most : the largest number of steps that is allowed.
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

    Differences of two calls are right to a share of some 1e-5, except where rates change within an
    interval.

    Parameters
    ----------
    scene : the rotor and its loads.
    begins, ends : (n,) s.
    states : (m, ..., n) at `begins`, angles, then rates, of the coordinates that move.
    steps : number of steps in each interval.
    equations : the accelerations to integrate; the closed form's where left out.
    step : another method, called as step(derivative, t, state, h).

    Returns
    -------
    ndarray, shape (m, ..., n)
    """
    step = step or runge_kutta_step
    form, half = rotor_form(scene), len(states) // 2
    equations = equations or closed_form.accelerations
    h = (ends - begins) / steps

    # At a jump of a load at the end of an interval, take the value inside the interval.
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
