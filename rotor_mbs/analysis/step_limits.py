"""The theory of step limits: from a stability function and the fastest modes of a stiff rotor to a step.

Knows numbers only; no run. Stability: |R(hλ)| <= 1 for every eigenvalue λ (Hairer & Wanner, Solving Ordinary
Differential Equations II, IV.2).
"""

from __future__ import annotations

import cmath
import math
from collections.abc import Callable, Sequence


def oscillator_modes(inertia: float, stiffness: float, damping: float) -> tuple[complex, complex]:
    """λ in 1/s of J θ̈ + d θ̇ + k θ = 0 (kg m², N m/rad, N m s/rad)."""
    root = cmath.sqrt(damping * damping - 4.0 * inertia * stiffness)
    return (-damping + root) / (2.0 * inertia), (-damping - root) / (2.0 * inertia)


def largest_stable_step(
    stability_function: Callable[[complex], complex], modes: Sequence[complex], window: float, growth: float
) -> float:
    """s: where the first range of steps ends on which no mode grows more than `growth`-fold in `window` s.

    Growth within a window, not |R| <= 1 itself, is what a run can show: RK67 has |R| > 1 on the whole imaginary axis,
    by so little at small steps that nothing comes of it. By scan and bisection.
    """
    fastest = max(abs(mode) for mode in modes)

    def stable(h: float) -> bool:
        largest = max(abs(stability_function(h * mode)) for mode in modes)
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
