"""The engine's time integrations as data: which solver, which options, and the settings a user may choose.

Knows no engine and no model.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, field

from rotor_mbs.errors import InputError

Settings = Mapping[str, object]


@dataclass(frozen=True)
class Scheme:
    """A time integration: the engine's name of the solver, its stages (0: implicit), its options by dotted path.

    step is the largest step in s, or None where the scheme chooses its own; it is then given up after `trial_steps`
    trials within one leg (the engine itself repeats a rejected smallest step for ever).
    """

    solver: str
    stages: int
    options: Mapping[str, object] = field(default_factory=dict)
    step: float | None = None
    trial_steps: int = 0


# Stage evaluations are all that is needed: one more at the end of a step would only serve to print accelerations.
_EXPLICIT = {"explicit.computeEndOfStepAccelerations": False, "explicit.useLieGroupIntegration": False}


def rk44(settings: Settings) -> Scheme:
    """Classical Runge-Kutta, order 4."""
    return Scheme("RK44", 4, _EXPLICIT, _number(settings, "step"))


def rk67(settings: Settings) -> Scheme:
    """Butcher's seven stages, order 6."""
    return Scheme("RK67", 7, _EXPLICIT, _number(settings, "step"))


def dopri5(settings: Settings) -> Scheme:
    """Dormand-Prince 5(4) with the engine's step control.

    The engine scales the error by absolute + relative · max(x, x_new) and takes no magnitude of x: the scale vanishes
    at x = -absolute/relative, where a step may be refused for ever, or, where it is exactly zero, accepted whatever
    its error. With a relative tolerance of 0 both signs of x are treated alike, which is why that is the default.
    """
    options = {
        **_EXPLICIT,
        "automaticStepSize": True,
        "relativeTolerance": _number(settings, "relative_tolerance", zero_allowed=True),
        "absoluteTolerance": _number(settings, "absolute_tolerance"),
        "minimumStepSize": 1e-14,
        "stepSizeMaxIncrease": 5.0,
    }
    return Scheme("DOPRI5", 7, options, None, round(_number(settings, "trial_steps")))


def generalized_alpha(settings: Settings) -> Scheme:
    """Generalized-alpha, constraints at position level (index 3), order 2."""
    radius = _number(settings, "spectral_radius", zero_allowed=True)
    if radius > 1.0:
        raise InputError(f"setting spectral_radius: {radius!r} is above 1; allowed: 0 to 1")
    options = {**_newton(settings), "generalizedAlpha.spectralRadius": radius}
    return Scheme("GeneralizedAlpha", 0, options, _number(settings, "step"))


def newmark_index2(settings: Settings) -> Scheme:
    """The trapezoidal rule, constraints at velocity level (index 2), order 2."""
    options = {
        **_newton(settings),
        "generalizedAlpha.useNewmark": True,
        "generalizedAlpha.useIndex2Constraints": True,
    }
    return Scheme("GeneralizedAlpha", 0, options, _number(settings, "step"))


def _newton(settings: Settings) -> dict[str, object]:
    """Newton's tolerances; one Jacobian in each step costs less than the iterations that an old one takes."""
    return {
        "newton.relativeTolerance": _number(settings, "newton_relative_tolerance"),
        "newton.absoluteTolerance": _number(settings, "newton_absolute_tolerance"),
        "newton.modifiedNewtonJacUpdatePerStep": True,
    }


def _number(settings: Settings, name: str, *, zero_allowed: bool = False) -> float:
    value = settings[name]
    if isinstance(value, (int, float)) and not isinstance(value, bool) and math.isfinite(value):
        number = float(value)
        if number > 0.0 or (zero_allowed and number == 0.0):
            return number
    allowed = "a finite number, 0 or above" if zero_allowed else "a finite number above 0"
    raise InputError(f"setting {name}: {value!r} is not allowed; allowed: {allowed}")
