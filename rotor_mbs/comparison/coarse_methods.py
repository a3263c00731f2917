"""Define integration methods of constant step whose own error may explain a difference."""

from __future__ import annotations

from collections.abc import Callable, Iterator

import numpy as np

from rotor_mbs.models.lagrange.defects import runge_kutta_step
from rotor_mbs.solution.trajectory import Array

Derivative = Callable[[Array, Array], Array]
# A function step(derivative, t, y, h) that returns y at t + h.
Step = Callable[[Derivative, Array, Array, Array], Array]

# Largest number of iterations in an implicit step. They converge fast, because a step is short
# compared with the motion.
_ITERATIONS = 12
_STEPS = (1, 2, 4, 5, 10, 20, 25, 50, 100)  # numbers of steps from row to row that are tried


def _euler(derivative: Derivative, time: Array, state: Array, h: Array) -> Array:
    """Return the state after an explicit Euler step."""
    return state + h * derivative(time, state)


def _semi_implicit_euler(derivative: Derivative, time: Array, state: Array, h: Array) -> Array:
    """Return the state after an Euler step of the rates, then of the angles with the new rates."""
    half = len(state) // 2
    rates = state[half:] + h * derivative(time, state)[half:]
    return np.concatenate([state[:half] + h * rates, rates])


def _implicit_euler(derivative: Derivative, time: Array, state: Array, h: Array) -> Array:
    """Return the state after an implicit Euler step, solved by iteration."""
    end = _euler(derivative, time, state, h)
    return _iterated(lambda end: state + h * derivative(time + h, end), end)


def _heun(derivative: Derivative, time: Array, state: Array, h: Array) -> Array:
    """Return the state after a step of Heun's method of order 2."""
    first = derivative(time, state)
    return state + 0.5 * h * (first + derivative(time + h, state + h * first))


def _midpoint(derivative: Derivative, time: Array, state: Array, h: Array) -> Array:
    """Return the state after a step of the explicit midpoint rule."""
    middle = state + 0.5 * h * derivative(time, state)
    return state + h * derivative(time + 0.5 * h, middle)


def _trapezoidal(derivative: Derivative, time: Array, state: Array, h: Array) -> Array:
    """Return the state after a step of the trapezoidal rule, solved by iteration."""
    first = derivative(time, state)
    return _iterated(
        lambda end: state + 0.5 * h * (first + derivative(time + h, end)), state + h * first
    )


def _iterated(following: Callable[[Array], Array], end: Array) -> Array:
    """Return the state at the end of an implicit step, by fixed-point iteration.

    Parameters
    ----------
    following : function that computes the next iterate from the last one.
    end : estimate of the state, from which the iteration begins.
    """
    for _ in range(_ITERATIONS):
        before, end = end, following(end)
        if np.array_equal(before, end):  # further iterations would change nothing
            break
    return end


def _velocity_verlet(derivative: Derivative, time: Array, state: Array, h: Array) -> Array:
    """Return the state after a step of the velocity Verlet method, with rates at half the step."""
    half = len(state) // 2
    rates = state[half:] + 0.5 * h * derivative(time, state)[half:]
    angles = state[:half] + h * rates
    accelerations = derivative(time + h, np.concatenate([angles, rates]))[half:]
    return np.concatenate([angles, rates + 0.5 * h * accelerations])


# Step of each method, and the largest number of its steps from row to row that is tried.
_METHODS: dict[str, tuple[Step, int]] = {
    "explicit Euler method": (_euler, 100),
    "semi-implicit Euler method": (_semi_implicit_euler, 100),
    "implicit Euler method": (_implicit_euler, 20),
    "Heun's method": (_heun, 20),
    "explicit midpoint rule": (_midpoint, 20),
    "trapezoidal rule": (_trapezoidal, 20),
    "velocity Verlet method": (_velocity_verlet, 20),
    "classical Runge-Kutta method": (runge_kutta_step, 4),
}


def coarse_methods(interval: float) -> Iterator[tuple[str, Step, int]]:
    """Yield methods with steps so long that their errors may cause a difference.

    Parameters
    ----------
    interval : s, time between two rows of the data.

    Yields
    ------
    str, Step, int
        Name and step size of a method in words, its step function, and the number of steps from row
        to row.
    """
    for name, (step, most) in _METHODS.items():
        for count in _STEPS:
            if count <= most:
                yield f"{name} with a step of {interval / count:.6g} s", step, count
