"""Exact derivatives of the closed form, evaluated with numbers that carry them, and its steady states: equilibrium at
rest, steady rotation without gravity."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from rotor_mbs.errors import InputError
from rotor_mbs.models.lagrange import closed_form
from rotor_mbs.models.lagrange.closed_form import LoadValues
from rotor_mbs.models.lagrange.parameters import RotorForm, rotor_form
from rotor_mbs.models.lagrange.samples import loads_at_start
from rotor_mbs.scenario.scene import Scene
from rotor_mbs.solution.trajectory import Array, Linearization

# rad: a step of Newton's method below this is followed by three more, and the state is found.
_SMALL_STEP = 1e-6
_MAX_STEPS = 200


@dataclass(frozen=True, slots=True)
class Jet:
    """A number with its partial derivatives: slope (k,) of first order, curvature (k, k) of second order."""

    value: float
    slope: Array
    curvature: Array

    @classmethod
    def variables(cls, values: Sequence[float] | Array) -> list[Jet]:
        unit, zero = np.eye(len(values)), np.zeros((len(values), len(values)))
        return [cls(float(value), unit[k], zero) for k, value in enumerate(values)]

    def __add__(self, other: Any) -> Jet:
        if isinstance(other, Jet):
            return Jet(self.value + other.value, self.slope + other.slope, self.curvature + other.curvature)
        return Jet(self.value + other, self.slope, self.curvature)

    def __neg__(self) -> Jet:
        return Jet(-self.value, -self.slope, -self.curvature)

    def __sub__(self, other: Any) -> Jet:
        return self.__add__(-other)

    def __rsub__(self, other: Any) -> Jet:
        return (-self).__add__(other)

    def __mul__(self, other: Any) -> Jet:
        if not isinstance(other, Jet):
            return Jet(self.value * other, self.slope * other, self.curvature * other)
        cross = np.outer(self.slope, other.slope)
        curvature = self.value * other.curvature + other.value * self.curvature + cross + cross.T
        return Jet(self.value * other.value, self.value * other.slope + other.value * self.slope, curvature)

    def __truediv__(self, other: Any) -> Jet:
        if not isinstance(other, Jet):
            return Jet(self.value / other, self.slope / other, self.curvature / other)
        return self * other.function(1.0 / other.value, -1.0 / other.value**2, 2.0 / other.value**3)

    __radd__ = __add__
    __rmul__ = __mul__

    def function(self, value: float, first: float, second: float) -> Jet:
        """f of this number, by its value and its first two derivatives there."""
        curvature = first * self.curvature + second * np.outer(self.slope, self.slope)
        return Jet(value, first * self.slope, curvature)


def sine(x: Jet) -> Jet:
    s, c = math.sin(x.value), math.cos(x.value)
    return x.function(s, c, -s)


def cosine(x: Jet) -> Jet:
    s, c = math.sin(x.value), math.cos(x.value)
    return x.function(c, -s, -c)


def linearize(
    scene: Scene, angles: Sequence[float] | Array, rates: Sequence[float] | Array, torque: float
) -> Linearization:
    """The closed form linearized in `scene.moving_coordinates` at (1 + blades,) rad and rad/s, `torque` N m on the
    rotor, other loads as at t = 0. Raises ZeroDivisionError at the singular configuration."""
    form, columns = rotor_form(scene), scene.moving_coordinates
    n = len(columns)
    state = Jet.variables([*(angles[i] for i in columns), *(rates[i] for i in columns)])
    loads = loads_at_start(scene, torque)
    accelerations = closed_form.accelerations(state[:n], state[n:], form, loads, sine, cosine)
    slopes = np.array([jet.slope for jet in accelerations])
    return Linearization(-slopes[:, :n], -slopes[:, n:], np.array([jet.value for jet in accelerations]))


def holding_torque(scene: Scene, speed: float) -> float:
    """N m on the rotor that keeps its `speed` (rad/s) against the shaft's damper."""
    return scene.shaft_damping * speed


def steady_rotation(scene: Scene, speed: float) -> Array:
    """(1 + blades,) rad: angles at which the rotor turns steadily at `speed` rad/s, no gravity acting: stationary
    points of V - ½ Ω² a - Σ τ θ, downhill from the scene's initial pitches, kept where they are stationary already,
    stable or not. Raises InputError where there is none within 200 steps."""
    return _stationary(replace(scene, gravity=0.0), speed, fixed_rotor=True)


def equilibrium(scene: Scene) -> Array:
    """(1 + blades,) rad: angles at which the rotor rests without a torque, found as by `steady_rotation`."""
    return _stationary(scene, 0.0, fixed_rotor=scene.gravity == 0.0)


def _stationary(scene: Scene, speed: float, *, fixed_rotor: bool) -> Array:
    """Newton's method with the absolute eigenvalues of the Hessian, and a step halved until it goes downhill."""
    form, columns, loads = rotor_form(scene), scene.moving_coordinates, loads_at_start(scene)
    angles = np.array(scene.initial_angles, dtype=float)
    free = slice(1, None) if fixed_rotor else slice(None)
    changed = columns[free]
    for _ in range(_MAX_STEPS):
        potential = amended_potential(form, angles[columns], speed, loads)
        step = _newton_step(form, potential, free, downhill=True)
        if np.abs(step).max(initial=0.0) < _SMALL_STEP:
            for _ in range(3):
                potential = amended_potential(form, angles[columns], speed, loads)
                angles[changed] += _newton_step(form, potential, free, downhill=False)
            # The accelerations must say so, too: they keep differences that the energies' rounding hides.
            linear = linearize(scene, angles, [speed, *(0.0 for _ in scene.blades)], holding_torque(scene, speed))
            if np.abs(linear.residual).max() > 1e-9 * np.abs(linear.stiffness).max():
                raise InputError(
                    f"{scene.name}: the steady state at {speed:g} rad/s is not resolved: rounding of the energies"
                )
            return angles
        trial = angles.copy()
        for halving in range(30):
            trial[changed] = angles[changed] + 0.5**halving * step
            if _is_lower(amended_potential(form, trial[columns], speed, loads), potential, step, free):
                break
        angles = trial
    raise InputError(f"{scene.name}: no steady state at {speed:g} rad/s found in {_MAX_STEPS} steps from its start")


def _is_lower(trial: Jet, start: Jet, step: Array, free: slice) -> bool:
    """Whether a step went downhill, also where rounding hides by how much: the approximate Wolfe condition of W. W.
    Hager and H. Zhang, SIAM J. Optim. 16 (2005) 170-192."""
    allowed = start.value + 1e-12 * abs(start.value)
    return trial.value <= allowed and bool(trial.slope[free] @ step <= -0.8 * (start.slope[free] @ step))


def amended_potential(form: RotorForm, angles: Sequence[float] | Array, speed: float, loads: LoadValues) -> Jet:
    """V - T in J, with its derivatives by the angles: the pitches at rest, their constant torques in V, the rotor
    turning at `speed` rad/s without its torque."""
    variables = Jet.variables(list(angles))
    rates = [speed, *(0.0 for _ in form.blades)]
    kinetic, potential = closed_form.energies(variables, rates, form, loads, sine, cosine)
    for pitch, torque in zip(variables[1:], loads.pitches, strict=True):
        potential = potential - torque * pitch
    return potential - kinetic  # type: ignore[no-any-return]


def _newton_step(form: RotorForm, potential: Jet, free: slice, *, downhill: bool) -> Array:
    """(free,) rad: -H⁻¹ g, with |H| where `downhill`; at most 0.5 rad, none where nothing holds the rotor."""
    gradient, hessian = potential.slope[free], potential.curvature[free, free]
    weights = []
    for blade in form.blades:
        weights += [abs(blade.weight_x), abs(blade.weight_y), abs(blade.weight_z)]
    weights += [abs(float(weight)) for weight, _, _ in form.fixed]
    least = max(1e-9 * sum(weights), 1e-300)
    scale = 1.0 / np.sqrt(np.maximum(np.abs(np.diag(hessian)), least))
    values, vectors = np.linalg.eigh(hessian * scale * scale[:, None])
    stiff = np.abs(values) > 1e-4  # else it is the rounding of weights that balance
    divisors = np.where(stiff, np.abs(values) if downhill else values, np.inf)
    components = vectors.T @ (scale * gradient) / divisors
    step = -scale * (vectors @ components)
    longest = np.abs(step).max(initial=0.0)
    return np.asarray(step if longest < 0.5 else step * (0.5 / longest))
