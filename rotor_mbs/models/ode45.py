"""Solve differential equations as MATLAB's ode45 does, with the same step control.

The method is the Runge-Kutta pair of orders 5 and 4 by Dormand and Prince. In a chaotic problem the
digits of the result depend on the step sizes. Therefore the step control follows ode45 exactly.

[DP]  J. R. Dormand, P. J. Prince: A family of embedded Runge-Kutta formulae. J. Comput. Appl. Math.
      6 (1980), 19-26.
[SR]  L. F. Shampine, M. W. Reichelt: The MATLAB ODE Suite. SIAM J. Sci. Comput. 18 (1997), 1-22.
[JSS] J. C. Jimenez, A. Sotolongo, J. M. Sanchez-Bornot: Locally Linearized Runge Kutta method of
      Dormand and Prince. Appl. Math. Comput. 247 (2014), 589-606; its Table 2 lists the interpolant
      of ode45.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from fractions import Fraction

import numpy as np

from rotor_mbs.solution.trajectory import Array

RightHandSide = Callable[[float, Sequence[float]], list[float]]

F = Fraction
# [DP] Table 2, RK5(4)7M: nodes c, and rows 2 to 7 of the matrix A. The last row of A is also the
# row of weights b of order 5, with which the step is made. So the last stage of a step is the first
# stage of the next step.
NODES = (F(0), F(1, 5), F(3, 10), F(4, 5), F(8, 9), F(1), F(1))
STAGES = (
    (F(1, 5),),
    (F(3, 40), F(9, 40)),
    (F(44, 45), F(-56, 15), F(32, 9)),
    (F(19372, 6561), F(-25360, 2187), F(64448, 6561), F(-212, 729)),
    (F(9017, 3168), F(-355, 33), F(46732, 5247), F(49, 176), F(-5103, 18656)),
    (F(35, 384), F(0), F(500, 1113), F(125, 192), F(-2187, 6784), F(11, 84)),
)
# Weights of order 5 minus weights of order 4.
ERROR = (F(71, 57600), F(0), F(-71, 16695), F(71, 1920), F(-17253, 339200), F(22, 525), F(-1, 40))
# [JSS] Table 2: weight of stage i in y(t + s h) is h Σ_j INTERPOLANT[i][j] s^(j+1).
INTERPOLANT = (
    (F(1), F(-183, 64), F(37, 12), F(-145, 128)),
    (F(0), F(0), F(0), F(0)),
    (F(0), F(1500, 371), F(-1000, 159), F(1000, 371)),
    (F(0), F(-125, 32), F(125, 12), F(-375, 64)),
    (F(0), F(9477, 3392), F(-729, 106), F(25515, 6784)),
    (F(0), F(-11, 7), F(11, 3), F(-55, 28)),
    (F(0), F(3, 2), F(-4), F(5, 2)),
)

_POWER = 1.0 / 5.0  # one over the order of the formula that makes the step
_C2, _C3, _C4, _C5 = (float(node) for node in NODES[1:5])
(
    (_A21,),
    (_A31, _A32),
    (_A41, _A42, _A43),
    (_A51, _A52, _A53, _A54),
    (_A61, _A62, _A63, _A64, _A65),
    (_B1, _, _B3, _B4, _B5, _B6),
) = ([float(weight) for weight in row] for row in STAGES)
_E1, _, _E3, _E4, _E5, _E6, _E7 = (float(weight) for weight in ERROR)
_INTERPOLANT: Array = np.array([[float(weight) for weight in row] for row in INTERPOLANT])


@dataclass(frozen=True, slots=True)
class Ode45Result:
    """Hold the k accepted steps with their stages, from which `at` interpolates the solution.

    Attributes
    ----------
    time : (k + 1,) times of the start and of the end of every step.
    state : (k + 1, n) states at these times.
    stages : (k, 7, n) the seven derivatives computed in every step.
    success : whether the end time was reached.
    message : why the end time was not reached; "" if it was.
    evaluations : number of evaluations of the right-hand side.
    """

    time: Array
    state: Array
    stages: Array
    success: bool
    message: str
    evaluations: int

    @property
    def steps(self) -> int:
        """Return the number of accepted steps."""
        return len(self.time) - 1

    def at(self, times: Array) -> Array:
        """Return the states at the given times by the pair's quartic interpolant, (m, n).

        Parameters
        ----------
        times : (m,) times in any order.

        Raises
        ------
        ValueError
            If a time is before the start or after the last time reached.
        """
        if np.any(times < self.time[0]) or np.any(times > self.time[-1]):
            raise ValueError(f"the solution covers [{self.time[0]:g}, {self.time[-1]:g}] only")
        if self.steps == 0:
            return np.repeat(self.state, len(times), axis=0)
        step = np.clip(np.searchsorted(self.time, times, side="right") - 1, 0, self.steps - 1)
        h = self.time[step + 1] - self.time[step]
        s = (times - self.time[step]) / h
        weights = s[:, None] ** np.arange(1, 5) @ _INTERPOLANT.T  # (len(times), 7)
        value: Array = self.state[step] + h[:, None] * np.einsum(
            "ts,tsn->tn", weights, self.stages[step]
        )
        # At the end of the last step return the stored state. The interpolant would round it.
        at_end = s == 1.0
        value[at_end] = self.state[step[at_end] + 1]
        return value

    def refined(self) -> tuple[Array, Array]:
        """Return times and states as ode45 does by default: the start, then four times per step.

        The four times are equally spaced, and the last of them is the end of the step.

        Returns
        -------
        time : ndarray, shape (4 k + 1,)
        state : ndarray, shape (4 k + 1, n)
        """
        fractions = np.arange(4) / 4
        inner = self.time[:-1, None] + np.diff(self.time)[:, None] * fractions
        time = np.append(inner.ravel(), self.time[-1])
        state = self.at(time)
        state[::4] = self.state
        return time, state


def ode45(
    f: RightHandSide,
    t_end: float,
    initial_state: Sequence[float],
    rel_tol: float = 1e-3,
    abs_tol: float = 1e-6,
) -> Ode45Result:
    """Solve y' = f(t, y) from t = 0 to `t_end`, in plain floats.

    Parameters
    ----------
    f : function (t, y) -> y', (n,). It returns NaN if y' is not defined.
    t_end : end time, above 0.
    initial_state : (n,) state at t = 0.
    rel_tol, abs_tol : tolerances of the local error. The error of a component is divided by the
        magnitude of the component, or by abs_tol / rel_tol if that is larger.

    Returns
    -------
    Ode45Result
        The accepted steps. If a step would have to be shorter than 16 units in the last place of t,
        the integration ends there, and `success` is False.
    """
    threshold = abs_tol / rel_tol
    t, y = 0.0, [float(value) for value in initial_state]
    k1 = f(t, y)
    times, states, stages = [t], [y], []
    evaluations = 1
    h_max = 0.1 * t_end
    h = first_step(y, k1, h_max, rel_tol, threshold)
    done, message = False, ""
    while not done:
        h_min = smallest_step(t)
        h = min(h_max, max(h_min, h))
        if done := 1.1 * h >= t_end - t:
            # The last step is lengthened or shortened so that it ends at t_end. The subtraction has
            # no rounding error, because t is larger than t_end / 2.
            h = t_end - t
        failed_here = False
        while True:
            y_new, k, error = _attempt(f, t, y, k1, h, threshold)
            evaluations += 6
            if error <= rel_tol:
                break
            if h <= h_min:
                message = (
                    f"Failure at t={t:e}. Unable to meet integration tolerances without reducing "
                    f"the step size below the smallest value allowed ({h_min:e}) at time t."
                )
                break
            # If the last step fails, it becomes shorter and no longer reaches t_end.
            h, done = max(h_min, after_failure(h, error, rel_tol, failed_here)), False
            failed_here = True
        if message:
            break
        t, y, k1 = t + h, y_new, k[6]  # the last stage is the first stage of the next step
        times.append(t)
        states.append(y)
        stages.append(k)
        if not failed_here:
            h = _after_success(h, error, rel_tol)
    kept = np.array(stages).reshape(len(stages), 7, len(y))
    return Ode45Result(np.array(times), np.array(states), kept, not message, message, evaluations)


def smallest_step(t: float) -> float:
    """Return the smallest step that ode45 takes at time t: 16 units in the last place of t."""
    return 16.0 * math.ulp(t)


def first_step(
    y: Sequence[float], k1: Sequence[float], h_max: float, rel_tol: float, threshold: float
) -> float:
    """Return the first step that ode45 tries: h_max, or less if the state changes fast there.

    Parameters
    ----------
    y, k1 : (n,) state and its derivative at the start.
    h_max : largest step allowed.
    rel_tol : relative tolerance of the local error.
    threshold : smallest magnitude by which the error of a component is divided.
    """
    slope = max(abs(rate) / max(abs(value), threshold) for value, rate in zip(y, k1, strict=True))
    rate_of_change = 1.25 * slope / rel_tol**_POWER
    return 1.0 / rate_of_change if h_max * rate_of_change > 1.0 else h_max


def _after_success(h: float, error: float, rel_tol: float) -> float:
    """Return the size of the step that follows an accepted step, from the error of that step.

    It is at most five times the accepted step.

    Parameters
    ----------
    h : size of the accepted step.
    error : relative error of the accepted step.
    rel_tol : relative tolerance of the local error.
    """
    shrink = 1.25 * (error / rel_tol) ** _POWER
    return h / shrink if shrink > 0.2 else 5.0 * h


def after_failure(h: float, error: float, rel_tol: float, failed_before: bool) -> float:
    """Return the size of the step to try again from the same time, after a step failed.

    A step fails if its error is above the tolerance. After the first failure at a time the new size
    follows from the error. After every further failure at this time the size is halved.

    Parameters
    ----------
    h : size of the step that failed.
    error : relative error of the step that failed.
    rel_tol : relative tolerance of the local error.
    failed_before : whether a longer step from this time had failed before.
    """
    return 0.5 * h if failed_before else h * max(0.1, 0.8 * (rel_tol / error) ** _POWER)


def _attempt(
    f: RightHandSide, t: float, y: list[float], k1: list[float], h: float, threshold: float
) -> tuple[list[float], tuple[list[float], ...], float]:
    """Compute one step of the pair, and its error.

    Lists of floats are twice as fast as NumPy arrays for the few equations of a rotor.

    Parameters
    ----------
    f : right-hand side.
    t, y : time and state (n,) at the start of the step.
    k1 : (n,) derivative at the start of the step.
    h : size of the step.
    threshold : smallest magnitude by which the error of a component is divided.

    Returns
    -------
    y_new : list of float
        State at the end of the step.
    stages : tuple of list of float
        The seven derivatives.
    error : float
        Largest relative error of a component; inf if an error is not finite.
    """
    k2 = f(t + _C2 * h, [a + h * (_A21 * p) for a, p in zip(y, k1, strict=True)])
    k3 = f(t + _C3 * h, [a + h * (_A31 * p + _A32 * q) for a, p, q in zip(y, k1, k2, strict=True)])
    k4 = f(
        t + _C4 * h,
        [
            a + h * (_A41 * p + _A42 * q + _A43 * r)
            for a, p, q, r in zip(y, k1, k2, k3, strict=True)
        ],
    )
    k5 = f(
        t + _C5 * h,
        [
            a + h * (_A51 * p + _A52 * q + _A53 * r + _A54 * u)
            for a, p, q, r, u in zip(y, k1, k2, k3, k4, strict=True)
        ],
    )
    k6 = f(
        t + h,
        [
            a + h * (_A61 * p + _A62 * q + _A63 * r + _A64 * u + _A65 * v)
            for a, p, q, r, u, v in zip(y, k1, k2, k3, k4, k5, strict=True)
        ],
    )
    y_new = [
        a + h * (_B1 * p + _B3 * r + _B4 * u + _B5 * v + _B6 * w)
        for a, p, r, u, v, w in zip(y, k1, k3, k4, k5, k6, strict=True)
    ]
    k7 = f(t + h, y_new)
    ratios = [
        abs(_E1 * p + _E3 * r + _E4 * u + _E5 * v + _E6 * w + _E7 * x)
        / max(abs(a), abs(b), threshold)
        for a, b, p, r, u, v, w, x in zip(y, y_new, k1, k3, k4, k5, k6, k7, strict=True)
    ]
    # The sum is finite only if every ratio is finite. `max` alone can overlook a NaN.
    error = h * max(ratios) if math.isfinite(sum(ratios)) else math.inf
    return y_new, (k1, k2, k3, k4, k5, k6, k7), error
