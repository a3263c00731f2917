"""Integrate the closed form in plain floats by SciPy's solvers or MATLAB's ode45."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence

import numpy as np

from rotor_mbs.methods import time_limit
from rotor_mbs.methods.base import MAX_STEPS
from rotor_mbs.methods.time_limit import OutOfTimeError, raise_if_over
from rotor_mbs.models import ode45 as matlab
from rotor_mbs.models.lagrange import closed_form, samples
from rotor_mbs.models.lagrange.closed_form import load_values
from rotor_mbs.models.lagrange.parameters import changing_rests, rotor_form
from rotor_mbs.models.lagrange.samples import (
    Advance,
    at_constant_rests,
    loads_at_start,
    over_segments,
)
from rotor_mbs.models.ode45 import RightHandSide
from rotor_mbs.scenario.scene import Scene
from rotor_mbs.scenario.time_table import Segment
from rotor_mbs.solution.trajectory import Array, Integration, Trajectory, sample_times

# A function (right-hand side, start, end, state at the start, sample times inside) that returns an
# Advance.
Integrator = Callable[[RightHandSide, float, float, Array, Array], Advance]


class OdeSolver:
    """Integrate a scene by calling an integrator once for each segment of the loads.

    Parameters
    ----------
    scene : the scene.
    integrator : result of `scipy_integrator` or `ode45_integrator`.
    times : (n,) s, sample times; by default those of the scene.
    """

    def __init__(self, scene: Scene, integrator: Integrator, times: Array | None = None) -> None:
        self._scene, self._integrator = scene, integrator
        self._form = rotor_form(scene)
        self._segments = scene.load_segments
        self._work_unit = work_unit(scene) if scene.work_needs_path else 0.0
        columns = scene.moving_coordinates
        start = [np.array(scene.initial_angles)[columns], np.array(scene.initial_rates)[columns]]
        self._initial = np.concatenate([*start, np.zeros(int(self._work_unit > 0.0))])
        self._times = sample_times(scene) if times is None else times
        self.states: Array = self._initial[None, :]

    def integrate(self) -> Integration:
        """Integrate from the initial state to the end, or to the first failure."""
        self.states, integration = over_segments(
            self._times, self._segments, self._initial, self.advance
        )
        return integration

    def advance(self, segment: Segment, state: Array, times: Array) -> Advance:
        """Integrate over one segment of the loads.

        Parameters
        ----------
        segment : the segment.
        state : (variables,) state at the start of the segment.
        times : (k,) s, sample times in the segment.
        """
        return self._integrator(
            self.right_hand_side(segment), segment.start, segment.end, state, times
        )

    def right_hand_side(self, segment: Segment) -> RightHandSide:
        """Return the function that computes the time derivative of the state in one segment.

        The state has the angles, the rates and, if it is integrated, the work in `work_unit`. The
        function computes in plain floats, which is faster than arrays for a few blades.

        Parameters
        ----------
        segment : the segment, whose loads act.
        """
        form, work_unit = self._form, self._work_unit
        count = 1 + len(form.blades)
        changing, pitches = changing_rests(self._scene), self._scene.moving_coordinates[1:]
        constant = None if any(segment.slopes) else load_values(segment.values, pitches)

        def derivative(time: float, state: Sequence[float]) -> list[float]:
            """Return the derivative of `state` at `time` (s); NaN if it is not defined."""
            values = state.tolist() if isinstance(state, np.ndarray) else state
            angles, rates = values[:count], values[count : 2 * count]
            loads = constant or load_values(segment.loads_at(time), pitches)
            try:
                accelerations = closed_form.accelerations(
                    angles, rates, form, loads, math.sin, math.cos
                )
            except (ZeroDivisionError, ValueError, OverflowError):
                # The mass matrix is singular, or the state has diverged. The result is NaN, as it
                # would be in the arithmetic of arrays.
                return [math.nan] * len(values)
            if not work_unit:
                return [*rates, *accelerations]
            power = closed_form.power(rates, form, at_constant_rests(changing, loads))
            return [*rates, *accelerations, power / work_unit]

        return derivative

    def observe(self) -> Trajectory:
        """Return the samples of the last integration, with the work in J."""
        states = self.states.copy()
        if self._work_unit:
            states[:, -1] *= self._work_unit
        return samples.trajectory(self._scene, self._times, states)


def work_unit(scene: Scene) -> float:
    """Return the unit, in J, of the work as a variable of the integration.

    The unit is the largest power of two that is not above the sum of the scene's initial kinetic
    energy, its weights' moments and its rotor torque, but at least 1 J. If the work were in J, the
    absolute tolerance could be far below the rounding of the work.

    Parameters
    ----------
    scene : the scene.
    """
    form, columns = rotor_form(scene), scene.moving_coordinates
    angles, rates = (
        [values[i] for i in columns] for values in (scene.initial_angles, scene.initial_rates)
    )
    kinetic, _ = closed_form.energies(
        angles, rates, form, loads_at_start(scene), math.sin, math.cos
    )
    weights = sum(
        blade.mass * scene.gravity * math.hypot(*blade.centre_of_mass) for blade in scene.blades
    )
    torques = max((abs(torque) for _, torque in scene.rotor_torque), default=0.0)
    size = kinetic + weights + torques
    return 2.0 ** max(math.floor(math.log2(size)), 0) if 0.0 < size < math.inf else 1.0


# Largest number of evaluations within one step, including all attempts. SciPy shortens a step at
# time 0 up to 460 times, with 12 evaluations each. More evaluations are an endless loop. It occurs,
# for example, if the derivative overflows and the size of the first step is NaN.
MAX_STEP_EVALUATIONS = 100_000
# After every _OUTLOOK_STEPS steps the number of steps of the whole segment is estimated. The run
# ends if the estimate is more than _OUTLOOK_SHARE times the allowed number.
_OUTLOOK_STEPS = 2_000
_OUTLOOK_SHARE = 10.0


def scipy_integrator(
    name: str,
    relative_tolerance: float,
    absolute_tolerance: float,
    max_steps: float = MAX_STEPS,
    *,
    ends_at_samples: bool = False,
) -> Integrator:
    """Return an integrator that takes the steps of one of SciPy's solvers.

    At the time limit it returns the samples computed so far. It fails after `max_steps` steps, or
    earlier if an estimate shows that it would need many more.

    Parameters
    ----------
    name : name of the class in `scipy.integrate`, such as "DOP853".
    relative_tolerance, absolute_tolerance : tolerances of the local error; the absolute one in rad
        and rad/s.
    max_steps : largest number of steps in one segment of the loads.
    ends_at_samples : whether a step ends at every sample, so that samples are as accurate as the
        steps. Otherwise samples are computed by the solver's interpolant, which is less accurate.
    """
    import scipy.integrate

    solver_type = getattr(scipy.integrate, name)

    def advance(
        function: RightHandSide, start: float, end: float, state: Array, times: Array
    ) -> Advance:
        """Integrate `function` from `state` at `start` (s) to `end`, with samples at `times`."""
        in_step = 0  # number of evaluations in the present step

        def watched(time: float, values: Sequence[float]) -> list[float]:
            nonlocal in_step
            raise_if_over()  # checked at every evaluation, because one step may try many sizes
            in_step += 1
            if in_step > MAX_STEP_EVALUATIONS:
                raise ValueError("no step is small enough")
            slope = function(time, values)
            # Only the derivative at the start is checked: the first one, before the solver exists.
            if solver is None and in_step == 1 and not all(map(math.isfinite, slope)):
                raise ValueError("the derivative of the state is not finite")
            return slope

        rows, steps, message, solver = [np.empty((0, len(state)))], 0, "", None
        stops = times.tolist() if ends_at_samples else []
        if not stops or stops[-1] < end:
            stops.append(end)
        stops.reverse()  # `pop` returns the next stop
        with np.errstate(all="ignore"), time_limit.samples_kept_at_limit():
            try:
                solver = solver_type(
                    watched,
                    start,
                    state,
                    stops.pop(),
                    rtol=relative_tolerance,
                    atol=absolute_tolerance,
                )
                done = 0
                while solver.status == "running":
                    in_step = 0
                    reason = solver.step()
                    if solver.status == "failed":
                        message = f"SciPy: {reason}"
                        break
                    steps += 1
                    reached = int(np.searchsorted(times, solver.t, side="right"))
                    if reached > done:
                        if ends_at_samples:
                            rows.append(solver.y[None, :])
                        else:
                            rows.append(solver.dense_output()(times[done:reached]).T)
                        done = reached
                    # At a sample the solver continues to the next stop. A new solver would have to
                    # find its step size again.
                    if solver.status == "finished" and stops:
                        solver.t_bound, solver.status = stops.pop(), "running"
                    if solver.status == "running" and _is_too_long(
                        steps, max_steps, (solver.t - start) / (end - start)
                    ):
                        raise ValueError(f"more than {max_steps:g} steps")
            except OutOfTimeError:
                message = time_limit.MESSAGE
            # SciPy's linear algebra also raises these errors, for values that are not finite.
            except (ValueError, np.linalg.LinAlgError) as exc:
                message = f"SciPy: {exc}"
        last, evaluations = (state, 0) if solver is None else (solver.y, solver.nfev)
        return Advance(np.concatenate(rows), last, steps, evaluations, message)

    return advance


def _is_too_long(steps: int, max_steps: float, share: float) -> bool:
    """Return whether a segment takes too many steps, or would take too many by an estimate.

    Parameters
    ----------
    steps : number of steps so far.
    max_steps : number of steps allowed in the segment.
    share : part of the segment's duration that is integrated so far.
    """
    is_seen = steps % _OUTLOOK_STEPS == 0 and steps > _OUTLOOK_SHARE * max_steps * share
    return steps >= max_steps or is_seen


def ode45_integrator(relative_tolerance: float, absolute_tolerance: float) -> Integrator:
    """Return an integrator that takes the steps of MATLAB's ode45.

    Each segment is integrated from time 0 of its own. At the time limit the samples of the segment
    are lost.

    Parameters
    ----------
    relative_tolerance, absolute_tolerance : tolerances of the local error; the absolute one in rad
        and rad/s.
    """

    def advance(
        function: RightHandSide, start: float, end: float, state: Array, times: Array
    ) -> Advance:
        """Integrate `function` from `state` at `start` (s) to `end`, with samples at `times`."""

        def watched(time: float, values: Sequence[float]) -> list[float]:
            raise_if_over()  # needed in threads, because no signal interrupts them
            return function(start + time, values)

        result = matlab.ode45(
            watched, end - start, state.tolist(), relative_tolerance, absolute_tolerance
        )
        reached = result.time[-1]
        inside = np.minimum(times - start, end - start)
        last = result.at(result.time[-1:])[0]
        return Advance(
            result.at(inside[inside <= reached]),
            last,
            result.steps,
            result.evaluations,
            result.message,
        )

    return advance
