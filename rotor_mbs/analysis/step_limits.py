"""The theory of step limits: stability functions of the fixed-step methods and the fastest modes of a stiff rotor.

Knows numbers only; no run. Stability: |R(hλ)| <= 1 for every eigenvalue λ (Hairer & Wanner, Solving Ordinary
Differential Equations II, IV.2).
"""

from __future__ import annotations

import cmath
import math
from collections.abc import Sequence

# Coefficients of R(z), from z⁰ up. RK44: the exponential to order 4. RK67: to order 6, and of Butcher's seventh stage
# b7 a76 a65 a54 a43 a32 a21 = -1/2160 (J. C. Butcher, J. Austral. Math. Soc. 4 (1964), 179-194).
STABILITY_FUNCTIONS: dict[str, Sequence[float]] = {
    "exudyn_tree/rk44": (1, 1, 1 / 2, 1 / 6, 1 / 24),
    "exudyn_tree/rk67": (1, 1, 1 / 2, 1 / 6, 1 / 24, 1 / 120, 1 / 720, -1 / 2160),
}


def oscillator_modes(inertia: float, stiffness: float, damping: float) -> tuple[complex, complex]:
    """λ in 1/s of J θ̈ + d θ̇ + k θ = 0 (kg m², N m/rad, N m s/rad)."""
    root = cmath.sqrt(damping * damping - 4.0 * inertia * stiffness)
    return (-damping + root) / (2.0 * inertia), (-damping - root) / (2.0 * inertia)


def largest_stable_step(method: str, modes: Sequence[complex], window: float, growth: float) -> float:
    """s: where the first stretch of steps ends on which no mode grows more than `growth`-fold in `window` s.

    Growth within a window, not |R| <= 1 itself, is what a run can show: RK67 has |R| > 1 on the whole imaginary axis,
    by so little at small steps that nothing comes of it. By scan and bisection.
    """
    coefficients = STABILITY_FUNCTIONS[method]
    fastest = max(abs(mode) for mode in modes)

    def stable(h: float) -> bool:
        largest = max(abs(_polynomial(coefficients, h * mode)) for mode in modes)
        return window / h * math.log(largest) <= math.log(growth)

    width = 0.01 / fastest
    step = width
    while stable(step + width):
        step += width
    low, high = step, step + width
    while high - low > 1e-6 / fastest:
        middle = 0.5 * (low + high)
        low, high = (middle, high) if stable(middle) else (low, middle)
    return low


def _polynomial(coefficients: Sequence[float], z: complex) -> complex:
    value = 0j
    for coefficient in reversed(coefficients):
        value = value * z + coefficient
    return value
