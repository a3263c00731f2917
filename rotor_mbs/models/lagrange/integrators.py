"""Integrators for the closed form on plain floats: SciPy's by name, MATLAB's ode45. Loads SciPy when asked for it."""

from __future__ import annotations

import numpy as np

from rotor_mbs.models import ode45 as matlab
from rotor_mbs.models.lagrange.plain import Advance, Integrator, RightHandSide
from rotor_mbs.trajectory.record import Array


def scipy_integrator(name: str, relative_tolerance: float, absolute_tolerance: float) -> Integrator:
    """solve_ivp's method `name`, samples by its own interpolant."""
    from scipy.integrate import solve_ivp

    def advance(function: RightHandSide, start: float, end: float, state: Array, times: Array) -> Advance:
        with np.errstate(all="ignore"):
            result = solve_ivp(
                function,
                (start, end),
                state,
                name,
                dense_output=True,
                rtol=relative_tolerance,
                atol=absolute_tolerance,
            )
            states = result.sol(times[times <= result.t[-1]]).T
        message = "" if result.success else f"SciPy: {result.message}"
        return Advance(states, result.y[:, -1], len(result.t) - 1, result.nfev, message)

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
