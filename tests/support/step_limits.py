"""The largest stable step of an explicit method, seen on runs and by its stability function.

|R(hλ)| <= 1 for the stability function R and every eigenvalue λ (Hairer & Wanner, Solving Ordinary Differential
Equations II, IV.2).
"""

from __future__ import annotations

import cmath
import math
from collections.abc import Callable, Sequence
from dataclasses import replace

import numpy as np

from rotor_mbs.methods.solve import solve
from rotor_mbs.methods.time_limit import time_limit
from rotor_mbs.scenario.scene import Scene

# A window of so many radians of the fastest mode; a pitch this many times its start has grown, not swung.
_WINDOW_RADIANS = 5e3
_GROWTH = 100.0
_INTERVALS = 10


def stability_polynomial(*coefficients: float) -> Callable[[complex], complex]:
    """R(z) of an explicit Runge-Kutta method, from its coefficients of z⁰ up."""

    def stability_function(z: complex) -> complex:
        value = 0j
        for coefficient in reversed(coefficients):
            value = value * z + coefficient
        return value

    return stability_function


RK44 = stability_polynomial(1, 1, 1 / 2, 1 / 6, 1 / 24)
FUNCTIONS = {
    "exudyn_tree/rk44": RK44,
    # To order 6 the exponential's; of the seventh stage b7 a76 a65 a54 a43 a32 a21 = -1/2160
    # (J. C. Butcher, J. Austral. Math. Soc. 4 (1964), 179-194).
    "exudyn_tree/rk67": stability_polynomial(1, 1, 1 / 2, 1 / 6, 1 / 24, 1 / 120, 1 / 720, -1 / 2160),
    "mujoco/rk4": RK44,
}


def step_limit(scene: Scene, method: str) -> dict[str, float]:
    """The largest stable step by bisection on what becomes of the pitches, beside that of the theory."""
    function = FUNCTIONS[method]
    # Of a pitch about zero, the rotor fixed: gravity and rotation are negligible beside such a spring.
    inertias = [(blade.pitch_inertia, *scene.bearing(i)) for i, blade in enumerate(scene.blades)]
    modes = [mode for numbers in inertias for mode in oscillator_modes(*numbers)]
    window = _WINDOW_RADIANS / max(abs(mode) for mode in modes)
    short = replace(scene, duration=window, samples=_INTERVALS + 1, outputs=("angles", "rates"))
    theory = largest_stable_step(function, modes, window, _GROWTH)
    low = max(1, int(0.5 * window / theory / _INTERVALS))  # steps per interval: too few, enough
    high = 4 * low + 1
    if not _stays(short, method, high) or _stays(short, method, low):
        stable = float("nan")
    else:
        while high - low > 1:
            middle = (low + high) // 2
            low, high = (low, middle) if _stays(short, method, middle) else (middle, high)
        stable = window / (_INTERVALS * high)
    return {
        "largest_stable_step_s": stable,
        "theory_s": theory,
        "fastest_mode_per_s": max(abs(mode) for mode in modes),
        "mode_damping_ratio": min(1.0, *(abs(mode.real) / abs(mode) for mode in modes)),
    }


def _stays(scene: Scene, method: str, steps: int) -> bool:
    """Whether every pitch keeps within `_GROWTH` times the largest one at the start, to the end."""
    step = scene.duration / (_INTERVALS * steps)
    with time_limit(20.0):
        run = solve(method, scene, {"step": step})
    pitches = np.abs(run.trajectory.angles[:, 1:])
    complete = len(pitches) == scene.samples
    return complete and float(pitches.max()) <= _GROWTH * max(map(abs, scene.initial_angles[1:]))


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
