"""The largest stable step of an explicit method, seen on runs and by its stability function.

|R(hλ)| <= 1 for the stability function R and every eigenvalue λ (Hairer & Wanner, Solving Ordinary Differential
Equations II, IV.2).
"""

from __future__ import annotations

import cmath
import math
from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from numpy.polynomial import Polynomial

from rotor_mbs.methods.solve import solve
from rotor_mbs.scenario.scene import Scene

# A window of so many radians of the fastest mode; a pitch this many times its start has grown, not swung.
_WINDOW_RADIANS = 5e3
_GROWTH = 100.0
_INTERVALS = 10

RK44 = Polynomial([1, 1, 1 / 2, 1 / 6, 1 / 24])  # R(z) of the classical Runge-Kutta method
METHOD = "exudyn_tree/rk44"


def step_limit(scene: Scene) -> dict[str, float]:
    """The largest stable step of rk44 by bisection on what becomes of the pitches, beside that of the theory."""
    # Of a pitch about zero, the rotor fixed: gravity and rotation are negligible beside such a spring.
    inertias = [(blade.pitch_inertia, *scene.bearing(i)) for i, blade in enumerate(scene.blades)]
    modes = [mode for numbers in inertias for mode in oscillator_modes(*numbers)]
    window = _WINDOW_RADIANS / max(abs(mode) for mode in modes)
    short = replace(scene, duration=window, samples=_INTERVALS + 1, outputs=("angles", "rates"))
    theory = largest_stable_step(RK44, modes, window, _GROWTH)
    low = max(1, int(0.5 * window / theory / _INTERVALS))  # steps per interval: too few, enough
    high = 4 * low + 1
    if not _stays(short, high) or _stays(short, low):
        stable = float("nan")
    else:
        while high - low > 1:
            middle = (low + high) // 2
            low, high = (low, middle) if _stays(short, middle) else (middle, high)
        stable = window / (_INTERVALS * high)
    return {
        "largest_stable_step_s": stable,
        "theory_s": theory,
        "fastest_mode_per_s": max(abs(mode) for mode in modes),
        "mode_damping_ratio": min(1.0, *(abs(mode.real) / abs(mode) for mode in modes)),
    }


def _stays(scene: Scene, steps: int) -> bool:
    """Whether every pitch keeps within `_GROWTH` times the largest one at the start, to the end."""
    step = scene.duration / (_INTERVALS * steps)
    run = solve(METHOD, scene, {"step": step}, time_limit_s=20.0)
    pitches = np.abs(run.trajectory.angles[:, 1:])
    complete = len(pitches) == scene.samples
    return complete and float(pitches.max()) <= _GROWTH * max(map(abs, scene.initial_angles[1:]))


def oscillator_modes(inertia: float, stiffness: float, damping: float) -> tuple[complex, complex]:
    """λ in 1/s of J θ̈ + d θ̇ + k θ = 0 (kg m², N m/rad, N m s/rad)."""
    root = cmath.sqrt(damping * damping - 4.0 * inertia * stiffness)
    return (-damping + root) / (2.0 * inertia), (-damping - root) / (2.0 * inertia)


def largest_stable_step(
    stability_function: Polynomial, modes: Sequence[complex], window: float, growth: float
) -> float:
    """s: where the first range of steps ends on which no mode grows more than `growth`-fold in `window` s.

    Growth within a window, not |R| <= 1 itself, is what a run can show.
    """
    steps = np.arange(1.0, 1e5) * 1e-4 / max(abs(mode) for mode in modes)
    largest = np.abs(stability_function(np.outer(modes, steps))).max(axis=0)
    grows = window / steps * np.log(largest) > math.log(growth)
    return float(steps[np.argmax(grows) - 1])
