"""Integrators for the closed form on plain floats: SciPy's by name, MATLAB's ode45. Loads SciPy when asked for it."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from rotor_mbs.methods import time_limit as deadline
from rotor_mbs.methods.time_limit import OutOfTimeError
from rotor_mbs.models import ode45 as matlab
from rotor_mbs.models.lagrange.ode_solvers import Advance, Integrator, RightHandSide
from rotor_mbs.solution.record import Array


def scipy_integrator(name: str, relative_tolerance: float, absolute_tolerance: float) -> Integrator:
    """SciPy's solver `name`, step by step, samples by its own interpolant; asks for the time limit between steps."""
    import scipy.integrate

    solver_type = getattr(scipy.integrate, name)

    def advance(function: RightHandSide, start: float, end: float, state: Array, times: Array) -> Advance:
        def watched(time: float, values: Sequence[float]) -> list[float]:
            if deadline.is_over():  # a step may try ever smaller sizes without end
                raise OutOfTimeError
            return function(time, values)

        rows, steps, message, solver = [np.empty((0, len(state)))], 0, "", None
        with np.errstate(all="ignore"), deadline.polled():
            try:
                solver = solver_type(watched, start, state, end, rtol=relative_tolerance, atol=absolute_tolerance)
                done = 0
                while solver.status == "running":
                    said = solver.step()
                    if solver.status == "failed":
                        message = f"SciPy: {said}"
                        break
                    steps += 1
                    reached = int(np.searchsorted(times, solver.t, side="right"))
                    if reached > done:
                        rows.append(solver.dense_output()(times[done:reached]).T)
                        done = reached
            except OutOfTimeError:
                message = deadline.words()
            except (ValueError, np.linalg.LinAlgError) as exc:  # of its linear algebra, on what is not finite
                message = f"SciPy: {exc}"
        last, evaluations = (state, 0) if solver is None else (solver.y, solver.nfev)
        return Advance(np.concatenate(rows), last, steps, evaluations, message)

    return advance


def ode45_integrator(relative_tolerance: float, absolute_tolerance: float) -> Integrator:
    """MATLAB's ode45; its clock starts at zero on every stretch."""

    def advance(function: RightHandSide, start: float, end: float, state: Array, times: Array) -> Advance:
        result = matlab.ode45(
            lambda t, y: function(start + t, y), end - start, state.tolist(), relative_tolerance, absolute_tolerance
        )
        reached = result.time[-1]
        inside = np.minimum(times - start, end - start)
        last = result.at(result.time[-1:])[0]
        return Advance(result.at(inside[inside <= reached]), last, result.steps, result.evaluations, result.message)

    return advance
