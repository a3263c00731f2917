"""The closed form in double precision at chosen times: as it is, with terms left out, or with blades elsewhere."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from fractions import Fraction
from typing import Any

import numpy as np

from rotor_mbs.models.lagrange import closed_form
from rotor_mbs.models.lagrange.heyoka_adapter import is_available
from rotor_mbs.models.lagrange.ode_solvers import Accelerations, OdeSolver, scipy_integrator
from rotor_mbs.models.lagrange.parameters import Number, rotor_form
from rotor_mbs.models.lagrange.taylor import Propagation
from rotor_mbs.scenario.scene import Scene
from rotor_mbs.solution.trajectory import Array, Trajectory

_TAYLOR = 2.0**-52
_DOP853 = (1e-12, 1e-14)


def motion_at(scene: Scene, times: Array, equations: Accelerations | None = None) -> Trajectory:
    """The motion at `times`, (n,) s, increasing from 0 up to the duration at most; fewer rows where it ends early. By
    `equations` in place of the closed form, one of `LEFT_OUT` or of `at_azimuths`, where they are given."""
    if equations is None and is_available():
        # Compact: a scene of another structure is compiled anew, and is mostly run a few times.
        run = Propagation(scene, times=times, tol=_TAYLOR, compact_mode=True, high_accuracy=True)
        run.integrate()
        return run.observe()
    solver = OdeSolver(scene, scipy_integrator("DOP853", *_DOP853), times, equations)
    solver.integrate()
    return solver.observe()


def at_azimuths(scene: Scene, azimuths: Sequence[float]) -> Accelerations:
    """The closed form with each blade at another angle about the shaft than `Scene.phases`: (blades,) rad."""
    form = rotor_form(scene, phases=[(Fraction(math.cos(angle)), Fraction(math.sin(angle))) for angle in azimuths])
    return lambda angles, rates, _form, *rest: closed_form.accelerations(angles, rates, form, *rest)


def _sum(*parts: tuple[float, float, float]) -> Accelerations:
    """The sum of (weight, factor of the rotor's rate, factor of the pitches' rates)."""

    def equations(angles: Sequence[Number], rates: Sequence[Number], *rest: Any) -> list[Number]:
        total = np.zeros(len(rates))
        for weight, spin, pitch in parts:
            parted = [spin * rates[0], *(pitch * rate for rate in rates[1:])]
            total += weight * np.array(closed_form.accelerations(angles, parted, *rest))
        return total.tolist()

    return equations


# The accelerations are linear in the dampers' moments and quadratic in the rates otherwise; with one kind of rate at a
# time, and with rates reversed, each kind of product is taken out without another text of the equations.
LEFT_OUT: Mapping[str, Accelerations] = {
    "Coriolis terms (products of rotor rate and pitch rate)": _sum((1.0, 1, 0), (1.0, 0, 1), (-1.0, 0, 0)),
    "centrifugal terms (square of the rotor rate)": _sum((1.0, 1, 1), (-0.5, 1, 0), (-0.5, -1, 0), (1.0, 0, 0)),
    "terms with products of rates": _sum((0.5, 1, 1), (-0.5, -1, -1), (1.0, 0, 0)),
}
