"""Describe the engine's time integrations as data, and declare their settings.

A scheme names a solver of the engine and its options; a user chooses the settings.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace

from rotor_mbs.methods.settings import Settings, choice, number, step

_END_ACCELERATIONS = "explicit.computeEndOfStepAccelerations"


@dataclass(frozen=True)
class Scheme:
    """Describe a time integration of the engine.

    Attributes
    ----------
    solver : the engine's name of the scheme.
    stages : number of evaluations in a step; 0 for an implicit scheme.
    options : values by dotted path below the engine's settings of a time integration.
    step : s, the largest step; None if the scheme chooses its step.
    trial_steps : for a scheme that chooses its step: trials within one integration interval after
        which the run is given up (the engine itself repeats a rejected smallest step for ever).
    """

    solver: str
    stages: int
    options: Mapping[str, object] = field(default_factory=dict)
    step: float | None = None
    trial_steps: int = 0

    def with_accelerations(self) -> Scheme:
        """Return this scheme with accelerations at the end of every step.

        An implicit scheme computes them anyway, and is returned unchanged.
        """
        return (
            replace(self, options={**self.options, _END_ACCELERATIONS: True})
            if self.stages
            else self
        )

    @property
    def lacks_initial_accelerations(self) -> bool:
        """Return whether the scheme lacks the accelerations at the start that it must report."""
        return bool(self.options.get(_END_ACCELERATIONS))


# The state needs the evaluations of the stages only: one more at the end of a step would serve the
# accelerations alone.
_EXPLICIT = {_END_ACCELERATIONS: False, "explicit.useLieGroupIntegration": False}


@dataclass(frozen=True)
class Rk44Settings(Settings):
    """Classical Runge-Kutta, order 4."""

    step: float = step(2.5e-4)

    def scheme(self) -> Scheme:
        """Return the time integration with these settings."""
        return Scheme("RK44", 4, _EXPLICIT, self.step)


@dataclass(frozen=True)
class Rk67Settings(Settings):
    """Butcher's seven stages, order 6."""

    step: float = step(6.7e-4)

    def scheme(self) -> Scheme:
        """Return the time integration with these settings."""
        return Scheme("RK67", 7, _EXPLICIT, self.step)


@dataclass(frozen=True)
class Dopri5Settings(Settings):
    """Dormand-Prince 5(4) with the engine's step control.

    The control divides the error by absolute + relative · max(x, x_new), without taking magnitudes.
    This divisor vanishes at x = -absolute/relative. Therefore the default of `relative_tolerance`
    is 0.
    """

    relative_tolerance: float = number(
        0.0, at_least=0.0, doc="relative tolerance of the local error"
    )
    absolute_tolerance: float = number(
        1e-11, above=0.0, doc="absolute tolerance of the local error, rad and rad/s"
    )
    trial_steps: int = number(
        10_000, at_least=1, doc="largest number of trial steps between two samples"
    )

    def scheme(self) -> Scheme:
        """Return the time integration with these settings."""
        options = {
            **_EXPLICIT,
            "automaticStepSize": True,
            "relativeTolerance": self.relative_tolerance,
            "absoluteTolerance": self.absolute_tolerance,
            "minimumStepSize": 1e-14,
            "stepSizeMaxIncrease": 5.0,
        }
        return Scheme("DOPRI5", 7, options, None, self.trial_steps)


@dataclass(frozen=True)
class NewtonSettings(Settings):
    """The trapezoidal rule (Newmark), constraints at velocity level (index 2), order 2."""

    step: float = step(2.5e-4)
    newton_relative_tolerance: float = number(
        1e-8, above=0.0, doc="relative tolerance of Newton's residual"
    )
    newton_absolute_tolerance: float = number(
        1e-10, above=0.0, doc="absolute tolerance of Newton's residual"
    )

    def scheme(self) -> Scheme:
        """Return the time integration with these settings."""
        return self._implicit(
            {"generalizedAlpha.useNewmark": True, "generalizedAlpha.useIndex2Constraints": True}
        )

    def _implicit(self, options: Mapping[str, object]) -> Scheme:
        """Return the implicit scheme with options of its own."""
        # One Jacobian in each step costs less than the iterations that an old one takes.
        newton = {
            "newton.relativeTolerance": self.newton_relative_tolerance,
            "newton.absoluteTolerance": self.newton_absolute_tolerance,
            "newton.modifiedNewtonJacUpdatePerStep": True,
        }
        return Scheme("GeneralizedAlpha", 0, {**newton, **options}, self.step)


@dataclass(frozen=True)
class AlphaSettings(NewtonSettings):
    """Generalized-alpha, constraints at position level (index 3), order 2."""

    spectral_radius: float = number(
        0.9, at_least=0.0, at_most=1.0, doc="1: no numerical damping, 0: largest"
    )

    def scheme(self) -> Scheme:
        """Return the time integration with these settings."""
        return self._implicit({"generalizedAlpha.spectralRadius": self.spectral_radius})


_NODE = choice(
    "euler_parameters",
    ("euler_parameters", "rotation_vector"),
    doc="coordinates of a body's rotation",
)


@dataclass(frozen=True)
class ChainAlphaSettings(AlphaSettings):
    """Generalized-alpha for the chain."""

    step: float = step(5e-4)
    node: str = _NODE


@dataclass(frozen=True)
class ChainNewmarkSettings(NewtonSettings):
    """The trapezoidal rule for the chain."""

    node: str = _NODE


# Tolerance of Newton's method, as a share of the setting `tolerance`, and its lower limit: rounding
# errors prevent a smaller residual.
_NEWTON_SHARE, _LEAST_NEWTON_TOLERANCE = 0.1, 1e-12


@dataclass(frozen=True)
class ExtrapolatedSettings(Settings):
    """The trapezoidal rule, extrapolated within every sample interval.

    Its constraints are at velocity level (index 2).
    """

    tolerance: float = number(
        3e-8,
        above=0.0,
        at_most=1e-2,
        unit="rad",
        doc="tolerance for the estimated error of each interval",
    )

    @property
    def newton_relative_tolerance(self) -> float:
        """Return the relative tolerance of Newton's residual."""
        return max(_NEWTON_SHARE * self.tolerance, _LEAST_NEWTON_TOLERANCE)

    def scheme(self) -> Scheme:
        """Return the trapezoidal rule that is extrapolated."""
        # The engine's Jacobian leaves out that the directions of the constraints turn. Therefore
        # Newton's method converges only linearly, with a new Jacobian as with an old one. Each step
        # has one Jacobian, and gets no other as long as the residual decreases.
        options = {
            "generalizedAlpha.useNewmark": True,
            "generalizedAlpha.useIndex2Constraints": True,
            "newton.relativeTolerance": self.newton_relative_tolerance,
            "newton.absoluteTolerance": 1e-10,
            "newton.modifiedNewtonJacUpdatePerStep": True,
            "newton.maxModifiedNewtonIterations": 40,
            "newton.maxIterations": 40,
            "newton.modifiedNewtonContractivity": 2.0,
        }
        return Scheme("GeneralizedAlpha", 0, options)


SchemeSettings = Rk44Settings | Rk67Settings | Dopri5Settings | NewtonSettings
ChainSettings = ChainAlphaSettings | ChainNewmarkSettings
