"""The closed form linearized, and its steady states: equilibrium at rest, steady rotation without gravity."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace
from typing import Any, NamedTuple

import numpy as np

from rotor_mbs.errors import InputError
from rotor_mbs.models.lagrange import closed_form, hamilton
from rotor_mbs.models.lagrange.closed_form import Function, LoadValues
from rotor_mbs.models.lagrange.parameters import RotorForm, rotor_form
from rotor_mbs.models.lagrange.samples import loads_at_start
from rotor_mbs.scenario.scene import Scene
from rotor_mbs.solution.trajectory import Array, Linearization

# rad: a step of Newton's method below this is followed by three more, and the state is found.
_SMALL_STEP = 1e-6
_MAX_STEPS = 200


def slopes(function: Function, values: Sequence[float] | Array) -> Array:
    """(n,) derivatives of an analytic function of n numbers, (m, n) of one that returns m, by an imaginary step: no
    difference is taken, so that they are exact to rounding."""
    step = 1e-30
    moved = np.asarray(values)[:, None] + 1j * step * np.eye(len(values))  # each number over all directions
    return np.asarray(np.imag(function(list(moved))) / step)


def linearize(
    scene: Scene, angles: Sequence[float] | Array, rates: Sequence[float] | Array, torque: float
) -> Linearization:
    """The closed form linearized in `scene.moving_coordinates` at (1 + blades,) rad and rad/s, `torque` N m on the
    rotor, other loads as at t = 0. Raises ZeroDivisionError at the singular configuration."""
    form, columns, loads = rotor_form(scene), scene.moving_coordinates, loads_at_start(scene, torque)
    n = len(columns)
    state = [*(float(angles[i]) for i in columns), *(float(rates[i]) for i in columns)]

    def accelerations(state: Sequence[Any], sin: Function, cos: Function) -> list[Any]:
        return closed_form.accelerations(state[:n], state[n:], form, loads, sin, cos)

    residual = np.array(accelerations(state, math.sin, math.cos))  # first: a float's division by zero raises
    derivatives = slopes(lambda state: accelerations(state, np.sin, np.cos), state)
    return Linearization(-derivatives[:, :n], -derivatives[:, n:], residual)


def holding_torque(scene: Scene, speed: float) -> float:
    """N m on the rotor that keeps its `speed` (rad/s) against the shaft's damper."""
    return scene.shaft_damping * speed


def steady_rotation(scene: Scene, speed: float) -> Array:
    """(1 + blades,) rad: angles at which the rotor turns steadily at `speed` rad/s, no gravity acting: stationary
    points of V - ½ Ω² a - Σ τ θ, downhill from the scene's initial pitches, kept where they are stationary already,
    stable or not. Raises InputError where there is none within 200 steps."""
    return _stationary(replace(scene, gravity=0.0), speed)


def equilibrium(scene: Scene) -> Array:
    """(1 + blades,) rad: angles at which the rotor rests without a torque, found as by `steady_rotation`."""
    return _stationary(scene, 0.0)


class _Potential(NamedTuple):
    """V - T, and its derivatives by the angles."""

    value: float  # J
    slope: Array  # (n,) N m
    curvature: Array  # (n, n) N m/rad


def _stationary(scene: Scene, speed: float) -> Array:
    """Newton's method with the absolute eigenvalues of the Hessian, and a step halved until it goes downhill."""
    form, columns, loads = rotor_form(scene), scene.moving_coordinates, loads_at_start(scene)
    angles = np.array(scene.initial_angles, dtype=float)
    free = slice(None) if scene.gravity else slice(1, None)  # without gravity any rotor angle will do
    changed = columns[free]
    for _ in range(_MAX_STEPS):
        potential = _amended_potential(form, angles[columns], speed, loads)
        step = _newton_step(form, potential, free, downhill=True)
        if np.abs(step).max(initial=0.0) < _SMALL_STEP:
            for _ in range(3):
                potential = _amended_potential(form, angles[columns], speed, loads)
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
            if _is_lower(_amended_potential(form, trial[columns], speed, loads), potential, step, free):
                break
        angles = trial
    raise InputError(f"{scene.name}: no steady state at {speed:g} rad/s found in {_MAX_STEPS} steps from its start")


def _is_lower(trial: _Potential, start: _Potential, step: Array, free: slice) -> bool:
    """Whether a step went downhill, also where rounding hides by how much: the approximate Wolfe condition of W. W.
    Hager and H. Zhang, SIAM J. Optim. 16 (2005) 170-192."""
    allowed = start.value + 1e-12 * abs(start.value)
    return trial.value <= allowed and bool(trial.slope[free] @ step <= -0.8 * (start.slope[free] @ step))


def _amended_potential(form: RotorForm, angles: Array, speed: float, loads: LoadValues) -> _Potential:
    """The pitches at rest, their constant torques in V, the rotor turning at `speed` rad/s without its torque."""
    rates = [speed, *(0.0 for _ in form.blades)]

    def value(angles: Any) -> Any:
        kinetic, potential = closed_form.energies(angles, rates, form, loads, np.sin, np.cos)
        return potential - np.dot(loads.pitches, angles[1:]) - kinetic

    def forces(angles: Any) -> list[Any]:
        return hamilton.forces(angles, rates, form, loads, np.sin, np.cos)

    return _Potential(value(angles), slopes(value, angles), -slopes(forces, angles))


def _newton_step(form: RotorForm, potential: _Potential, free: slice, *, downhill: bool) -> Array:
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
