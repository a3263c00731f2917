"""The closed form integrated with 180 bits at tolerance 1e-42: the true motion, as far as quad precision can tell."""

from __future__ import annotations

from fractions import Fraction
from typing import Any

import numpy as np

from rotor_mbs.models.lagrange.heyoka_adapter import heyoka
from rotor_mbs.models.lagrange.parameters import changing_loads, load_segments
from rotor_mbs.models.lagrange.taylor import build_system, set_parameters
from rotor_mbs.scenario.scene import Scene

_BITS = 180
_TOLERANCE = "1e-42"


def moving_angles(scene: Scene) -> Any:
    """(samples, coordinates that move) rad, numbers of 180 bits."""
    (equations, parameters), columns = build_system(scene), scene.moving_coordinates
    count, kind = len(columns), {"fp_type": heyoka().real, "tol": heyoka().real(_TOLERANCE, _BITS)}
    values = [*(scene.initial_angles[i] for i in columns), *(scene.initial_rates[i] for i in columns)]
    start = _numbers([*values, *[0.0] * (len(equations) - 2 * count)])
    integrator = heyoka().taylor_adaptive(equations, state=start, compact_mode=True, **kind)
    set_parameters(integrator, _numbers(parameters.values))
    times, rows = np.linspace(0.0, scene.duration, scene.samples), [start[None, :]]
    for segment in load_segments(scene):
        if numbers := [number for i in changing_loads(scene) for number in segment.lines[i]]:
            integrator.pars[-len(numbers) :] = _numbers(numbers)
        inside = times[(times > segment.start) & (times <= segment.end)]
        end = [] if len(inside) and inside[-1] == segment.end else [segment.end]
        states = integrator.propagate_grid(_numbers([segment.start, *inside, *end]))[-1]
        rows.append(states[1 : 1 + len(inside)])
    return np.concatenate(rows)[:, :count]


def distance(angles: Any, exact: Any) -> Any:
    """(n,) rad: largest over the coordinates, of doubles or quad numbers from numbers of 180 bits."""
    real = heyoka().real
    wide = np.array([[real(value, _BITS) for value in row] for row in angles])
    return np.abs((wide - exact).astype(float)).max(axis=1)


def _numbers(values: Any) -> Any:
    real = heyoka().real
    fractions = [Fraction(value) for value in values]
    return np.array([real(str(f.numerator), _BITS) / real(str(f.denominator), _BITS) for f in fractions])
