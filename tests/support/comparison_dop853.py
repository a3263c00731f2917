"""DOP853 as others would use it, to measure the closed form's Taylor method against: SciPy on NumPy, and compiled by
numba. For comparison only; imports nothing of the models.

Source of the pair: E. Hairer, S. P. Norsett, G. Wanner, Solving Ordinary Differential Equations I, 2nd ed., 1993, II.5;
its coefficients are taken from the SciPy that is installed.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any

import numpy as np
from numpy.typing import NDArray

from rotor_mbs.scenario.scene import Scene

Array = NDArray[np.float64]


def straightforward(scene: Scene) -> Callable[[float, Array], Array]:
    """The equations of motion with a mass matrix and its solution, as one writes them down with NumPy.

    Point-mass blades at (c, 0, d), massless hub, no torque, springs or dampers: M(q) q̈ = h(q, q̇).
    """
    blades = len(scene.blades)
    mass = scene.blades[0].mass
    c, _, d = scene.blades[0].centre_of_mass
    g = scene.gravity
    phases = np.array(scene.phases)

    def derivative(_time: float, state: Array) -> Array:
        q, qd = state[: 1 + blades], state[1 + blades :]
        spin, rates = qd[0], qd[1:]
        s, cos = np.sin(q[1:]), np.cos(q[1:])
        sin_phi, cos_phi = np.sin(q[0] + phases), np.cos(q[0] + phases)
        M = np.zeros((1 + blades, 1 + blades))
        M[0, 0] = np.sum(mass * (d**2 + c**2 * cos**2))
        M[0, 1:] = M[1:, 0] = -mass * c * d * s
        M[np.arange(1, 1 + blades), np.arange(1, 1 + blades)] = mass * c**2
        h = np.zeros(1 + blades)
        h[0] = np.sum(
            2.0 * mass * c**2 * s * cos * spin * rates
            + mass * c * d * cos * rates**2
            + mass * g * (d * sin_phi + c * cos * cos_phi)
        )
        h[1:] = -mass * c**2 * s * cos * spin**2 - mass * g * c * s * sin_phi
        return np.concatenate([qd, np.linalg.solve(M, h)])

    return derivative


def compiled(scene: Scene) -> Callable[[float, Array, Array], Array]:
    """solve(rtol, times, y0) -> (times, state): DOP853 and the arrowhead solved by hand, compiled by numba.

    Step control and dense output as in SciPy (three more stages where a step holds a sample).
    """
    import numba
    from scipy.integrate._ivp import dop853_coefficients as pair

    a = np.ascontiguousarray(pair.A[:12, :12])
    b, e3, e5 = pair.B.copy(), pair.E3.copy(), pair.E5.copy()
    more, dense = np.ascontiguousarray(pair.A[13:16, :16]), pair.D.copy()
    n = len(scene.blades)
    c, _, d = scene.blades[0].centre_of_mass
    g = scene.gravity
    cos_phase, sin_phase = np.cos(np.array(scene.phases)), np.sin(np.array(scene.phases))

    @numba.njit
    def derivative(y: Any, out: Any) -> None:
        sq, cq, spin = math.sin(y[0]), math.cos(y[0]), y[n + 1]
        schur, moment = 0.0, 0.0
        for i in range(n):
            s, cos, rate = math.sin(y[1 + i]), math.cos(y[1 + i]), y[n + 2 + i]
            sin_phi = sq * cos_phase[i] + cq * sin_phase[i]
            cos_phi = cq * cos_phase[i] - sq * sin_phase[i]
            alone = -s * cos * spin * spin - g / c * s * sin_phi
            schur += (c * c + d * d) * cos * cos
            moment += (
                2.0 * c * c * s * cos * spin * rate
                + c * d * cos * rate * rate
                + g * (d * sin_phi + c * cos * cos_phi)
                + c * d * s * alone
            )
            out[1 + i] = rate
            out[n + 2 + i] = alone
        out[0] = spin
        out[n + 1] = moment / schur
        for i in range(n):
            out[n + 2 + i] += d / c * math.sin(y[1 + i]) * out[n + 1]

    @numba.njit
    def interpolate(x: float, h: float, before: Any, after: Any, k: Any, f: Any, out: Any) -> None:
        for i in range(len(before)):
            delta = after[i] - before[i]
            f[0], f[1] = delta, h * k[0, i] - delta
            f[2] = 2.0 * delta - h * (k[12, i] + k[0, i])
            for j in range(4):
                total = 0.0
                for stage in range(16):
                    total += dense[j, stage] * k[stage, i]
                f[3 + j] = h * total
            value = 0.0
            for j in range(7):
                value = (value + f[6 - j]) * (x if j % 2 == 0 else 1.0 - x)
            out[i] = before[i] + value

    @numba.njit
    def solve(rtol: float, times: Any, start: Any) -> Any:
        m = 2 * n + 2
        y, k, stage, after, f = start.copy(), np.zeros((16, m)), np.zeros(m), np.zeros(m), np.zeros(7)
        out = np.zeros((len(times), m))
        out[0] = start
        atol, t, h, sample, end = 0.01 * rtol, 0.0, 1e-3, 1, times[-1]
        derivative(y, k[0])
        while t < end:
            h = min(h, end - t)
            for j in range(1, 12):
                for i in range(m):
                    total = 0.0
                    for earlier in range(j):
                        total += a[j, earlier] * k[earlier, i]
                    stage[i] = y[i] + h * total
                derivative(stage, k[j])
            error3, error5 = 0.0, 0.0
            for i in range(m):
                total = x3 = x5 = 0.0
                for j in range(12):
                    total += b[j] * k[j, i]
                    x3 += e3[j] * k[j, i]
                    x5 += e5[j] * k[j, i]
                after[i] = y[i] + h * total
                scale = atol + rtol * max(abs(y[i]), abs(after[i]))
                error3 += (x3 / scale) ** 2
                error5 += (x5 / scale) ** 2
            norm = h * error5 / math.sqrt((error5 + 0.01 * error3) * m) if error5 > 0.0 else 0.0
            if norm <= 1.0:
                derivative(after, k[12])
                reached = end if end - t <= h else t + h
                if times[sample] <= reached:
                    for j in range(3):
                        for i in range(m):
                            total = 0.0
                            for earlier in range(13 + j):
                                total += more[j, earlier] * k[earlier, i]
                            stage[i] = y[i] + h * total
                        derivative(stage, k[13 + j])
                    while sample < len(times) and times[sample] <= reached:
                        interpolate((times[sample] - t) / h, h, y, after, k, f, out[sample])
                        sample += 1
                t = reached
                y[:] = after
                k[0] = k[12]
            factor = 10.0 if norm == 0.0 else min(10.0, max(0.2, 0.9 * norm ** (-0.125)))
            h *= factor if norm <= 1.0 else min(1.0, factor)
        return out

    return solve  # type: ignore[no-any-return]
