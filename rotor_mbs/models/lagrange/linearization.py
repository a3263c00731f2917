"""Linearize the closed form, and find its steady states.

These are the equilibrium at rest, and steady rotation without gravity.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace
from typing import Any, NamedTuple

import numpy as np

from rotor_mbs.errors import InputError
from rotor_mbs.models.lagrange import closed_form, hamilton
from rotor_mbs.models.lagrange.closed_form import Function, LoadValues
from rotor_mbs.models.lagrange.parameters import RotorForm, pitch_weight, rotor_form
from rotor_mbs.models.lagrange.samples import loads_at_start
from rotor_mbs.scenario.scene import Scene
from rotor_mbs.solution.trajectory import Array, Linearization

# rad: a step of Newton's method below this is followed by three more, and the state is found.
_SMALL_STEP = 1e-6
_MAX_STEPS = 200
# Share of the weights' moments, and of a torque, that is taken for their rounding.
_ROUNDING = 1e-12
# Of the coordinates that move: all, or all but the rotor.
_ALL, _PITCHES = slice(None), slice(1, None)


def slopes(function: Function, values: Sequence[float] | Array) -> Array:
    """Return the derivatives of an analytic function, exact to rounding, by an imaginary step.

    The complex-step derivative takes no difference of close numbers.

    Parameters
    ----------
    function : of n numbers, of which it returns one number or m.
    values : (n,) where the derivatives are taken.

    Returns
    -------
    ndarray, shape (n,) or (m, n)
    """
    step = 1e-30
    # Row i: number i in each of the n directions, of which direction i changes it.
    moved = np.asarray(values)[:, None] + 1j * step * np.eye(len(values))
    return np.asarray(np.imag(function(list(moved))) / step)


def linearize(
    scene: Scene, angles: Sequence[float] | Array, rates: Sequence[float] | Array, torque: float
) -> Linearization:
    """Linearize the closed form about a state, in the coordinates that move.

    Parameters
    ----------
    scene : the rotor; its other loads as at t = 0.
    angles, rates : (1 + blades,) rad and rad/s.
    torque : N m on the rotor, in place of the scene's.

    Returns
    -------
    Linearization
        Stiffness and damping divided by the mass matrix, and the accelerations at the state.

    Raises
    ------
    ZeroDivisionError
        At the singular configuration.
    """
    form, columns, loads = (
        rotor_form(scene),
        scene.moving_coordinates,
        loads_at_start(scene, torque),
    )
    n = len(columns)
    state = [*(float(angles[i]) for i in columns), *(float(rates[i]) for i in columns)]

    def accelerations(state: Sequence[Any], sin: Function, cos: Function) -> list[Any]:
        return closed_form.accelerations(state[:n], state[n:], form, loads, sin, cos)

    # On floats, and first: their division by zero raises, that of arrays does not.
    residual = np.array(accelerations(state, math.sin, math.cos))
    derivatives = slopes(lambda state: accelerations(state, np.sin, np.cos), state)
    return Linearization(-derivatives[:, :n], -derivatives[:, n:], residual)


def holding_torque(scene: Scene, speed: float) -> float:
    """Return the torque (N m) that keeps the rotor's `speed` (rad/s) against the shaft's damper."""
    return scene.shaft_damping * speed


def steady_rotation(scene: Scene, speed: float) -> Array:
    """Return the angles at which the rotor turns steadily without gravity.

    Finds a stationary point of V - ½ Ω² a - Σ τ θ, downhill from the scene's initial pitches. These
    are kept where they are stationary already, stable or not. The rotor keeps its initial angle.

    Parameters
    ----------
    scene : the rotor; its pitch torques and rest angles as at t = 0.
    speed : rad/s, of the rotor.

    Returns
    -------
    ndarray, shape (1 + blades,)
        rad.

    Raises
    ------
    InputError
        If a pitch torque is larger than all that can balance it, no such state is found within
        200 steps, or rounding of the energies hides it.
    """
    still = replace(scene, gravity=0.0)
    return _checked(still, speed, _stationary(still, speed, _PITCHES))


def equilibrium(scene: Scene) -> Array:
    """Return the angles at which the rotor rests without a torque, found as by `steady_rotation`.

    A balanced rotor (`is_balanced`) keeps its initial angle. Any other rotor turns downhill as
    well, from the initial angles.

    Parameters
    ----------
    scene : the rotor and gravity; its pitch torques and rest angles as at t = 0.

    Returns
    -------
    ndarray, shape (1 + blades,)
        rad.

    Raises
    ------
    InputError
        As `steady_rotation`.
    """
    if not scene.gravity:
        return steady_rotation(scene, 0.0)
    try:
        angles = _stationary(scene, 0.0, _PITCHES)
    except _NotFoundError:  # at another rotor angle there may be one
        angles = None
    if angles is None or not is_balanced(scene, angles):
        angles = _stationary(scene, 0.0, _ALL)
    return _checked(scene, 0.0, angles)


def is_balanced(scene: Scene, angles: Sequence[float] | Array) -> bool:
    """Return whether gravity gives a rotor at rest no preferred angle.

    It has none if the rotor's torque is zero at `angles`, and remains zero to first order where the
    rotor is turned and the pitches follow: both up to the rounding of the weights that balance.
    Bearing springs move the pitches of equal blades once a turn, so that their weights balance to
    third order of the deflection only: on stiff bearings that is rounding, on soft ones the rotor
    has a preferred angle.

    Parameters
    ----------
    scene : Scene
        With gravity.
    angles : sequence of float
        (1 + blades,) rad, at which the pitches are in equilibrium.
    """
    form = rotor_form(scene)
    angles = np.asarray(angles, dtype=float)[scene.moving_coordinates]
    potential = _amended_potential(form, angles, 0.0, loads_at_start(scene))
    curvature = potential.curvature
    following = np.linalg.lstsq(curvature[1:, 1:], -curvature[1:, 0], rcond=1e-12)[0]
    change_of_torques = curvature @ np.concatenate([[1.0], following])
    allowed = _ROUNDING * _weights(form)
    return bool(abs(potential.slope[0]) <= allowed and np.abs(change_of_torques).max() <= allowed)


def weight_stiffness(scene: Scene, angles: Sequence[float] | Array) -> float:
    """Return the moments of all weights about the shaft, divided by the rotor's inertia, in 1/s².

    This is the size of the stiffness of a rotor whose weights do not balance, and the unit of
    rounding where they do.

    Parameters
    ----------
    scene : the rotor and gravity.
    angles : (1 + blades,) rad, at which the rotor's inertia is taken.
    """
    form, loads = rotor_form(scene), loads_at_start(scene)
    moving = [float(angles[column]) for column in scene.moving_coordinates]
    turning = [1.0] + [0.0] * len(form.blades)  # at 1 rad/s the kinetic energy is half the inertia
    half_inertia, _ = closed_form.energies(moving, turning, form, loads, math.sin, math.cos)
    weights = _weights(form)
    return weights / (2.0 * half_inertia) if weights else 0.0


class _NotFoundError(InputError):
    """Report that no steady state was found."""


def _shown(speed: float) -> str:
    """Return a rotor speed in rad/s, and in rpm, as text."""
    rpm = f" ({speed * 30.0 / math.pi:.4g} rpm)" if speed else ""
    return f"{speed:g} rad/s{rpm}"


class _Potential(NamedTuple):
    """Hold V - T, and its derivatives by the angles."""

    value: float  # J
    slope: Array  # (n,) N m
    curvature: Array  # (n, n) N m/rad


def _stationary(scene: Scene, speed: float, free: slice) -> Array:
    """Return the angles at which the forces on the free coordinates are zero.

    Newton's method with the absolute eigenvalues of the Hessian, and a step halved until it goes
    downhill.

    Parameters
    ----------
    scene : the rotor, its loads as at t = 0, and gravity; its initial angles are the start.
    speed : rad/s, of the rotor.
    free : the coordinates to be changed, among those that move: `_ALL` or `_PITCHES`.

    Returns
    -------
    ndarray, shape (1 + blades,)
        rad.

    Raises
    ------
    InputError
        If a pitch torque is too large, or nothing is found within `_MAX_STEPS` steps
        (`_NotFoundError`).
    """
    form, columns, loads = rotor_form(scene), scene.moving_coordinates, loads_at_start(scene)
    _refuse_large_torques(scene, form, speed, loads)
    angles = np.array(scene.initial_angles, dtype=float)
    changed = columns[free]
    for _ in range(_MAX_STEPS):
        potential = _amended_potential(form, angles[columns], speed, loads)
        step = _newton_step(form, potential, free, downhill=True)
        if np.abs(step).max(initial=0.0) < _SMALL_STEP:
            for _ in range(3):
                potential = _amended_potential(form, angles[columns], speed, loads)
                angles[changed] += _newton_step(form, potential, free, downhill=False)
            return angles
        trial = angles.copy()
        for halving in range(30):
            trial[changed] = angles[changed] + 0.5**halving * step
            if _is_lower(
                _amended_potential(form, trial[columns], speed, loads), potential, step, free
            ):
                break
        angles = trial
    message = f"no steady state at {_shown(speed)} found in {_MAX_STEPS} steps from its start"
    raise _NotFoundError(f"{scene.name}: {message}")


def _refuse_large_torques(scene: Scene, form: RotorForm, speed: float, loads: LoadValues) -> None:
    """Check that no pitch torque exceeds what gravity and rotation can balance without a spring.

    Parameters
    ----------
    scene : gives names to the error.
    form : coefficients of the rotor.
    speed : rad/s, of the rotor.
    loads : at t = 0.

    Raises
    ------
    InputError
        If a pitch has no spring and a larger torque.
    """
    columns = scene.moving_coordinates[1:]
    for column, blade, torque in zip(columns, form.blades, loads.pitches, strict=True):
        # The largest values over the pitch of x s + y c and of ½ ∂A/∂θ = ½ half_slope_sc sin 2θ +
        # half_slope_cs cos 2θ
        largest = pitch_weight(blade)
        slope = math.hypot(0.5 * blade.half_slope_sc, blade.half_slope_cs)
        if blade.lean:
            slope += math.hypot(blade.lean.slope_s, blade.lean.slope_c)
        largest += speed * speed * slope
        if not blade.stiffness and abs(torque) > (1.0 + _ROUNDING) * largest:
            balance = "nothing balances it"
            if largest:
                balance = f"gravity and rotation balance at most {largest:g} N m"
            raise InputError(
                f"{scene.name}: no steady state at {_shown(speed)}: a torque of {torque:g} N m "
                f"acts on pitch {column}, which has no spring, and {balance}"
            )


def _checked(scene: Scene, speed: float, angles: Array) -> Array:
    """Return the angles of a steady state, after a check that the accelerations vanish there.

    The accelerations keep differences that the rounding of the energies hides.

    Parameters
    ----------
    scene, speed : as of `steady_rotation`.
    angles : (1 + blades,) rad.

    Raises
    ------
    InputError
        If an acceleration is too large.
    """
    rates = [speed] + [0.0] * len(scene.blades)
    linear = linearize(scene, angles, rates, holding_torque(scene, speed))
    scale = max(np.abs(linear.stiffness).max(), weight_stiffness(scene, angles))
    if np.abs(linear.residual).max() > 1e-9 * scale:
        what = f"the steady state at {_shown(speed)} is not resolved"
        raise InputError(f"{scene.name}: {what}: rounding of the energies")
    return angles


def _is_lower(trial: _Potential, start: _Potential, step: Array, free: slice) -> bool:
    """Return whether a step went downhill, also where rounding hides by how much.

    This is the approximate Wolfe condition of W. W. Hager and H. Zhang, SIAM J. Optim. 16 (2005)
    170-192.

    Parameters
    ----------
    trial, start : after and before the step.
    step : (free,) rad.
    free : the coordinates that the step changes.
    """
    allowed = start.value + 1e-12 * abs(start.value)
    return trial.value <= allowed and bool(
        trial.slope[free] @ step <= -0.8 * (start.slope[free] @ step)
    )


def _amended_potential(
    form: RotorForm, angles: Array, speed: float, loads: LoadValues
) -> _Potential:
    """Return V - T, slope and curvature for pitches at rest while the rotor turns without torque.

    The constant torques of the pitches are in V.

    Parameters
    ----------
    form : coefficients of the rotor.
    angles : (n,) rad, of the coordinates that move.
    speed : rad/s, of the rotor.
    loads : at t = 0, of which the pitches' torques and rest angles count.
    """
    rates = [speed, *(0.0 for _ in form.blades)]

    def value(angles: Any) -> Any:
        kinetic, potential = closed_form.energies(angles, rates, form, loads, np.sin, np.cos)
        return potential - np.dot(loads.pitches, angles[1:]) - kinetic

    def forces(angles: Any) -> list[Any]:
        return hamilton.forces(angles, rates, form, loads, np.sin, np.cos)

    return _Potential(value(angles), slopes(value, angles), -slopes(forces, angles))


def _newton_step(form: RotorForm, potential: _Potential, free: slice, *, downhill: bool) -> Array:
    """Return a Newton step -H⁻¹ g of the free coordinates, (free,) rad, of at most 0.5 rad.

    Directions without stiffness, such as that of a rotor that nothing holds, are not changed.

    Parameters
    ----------
    form : coefficients of the rotor, whose weights are the unit of rounding.
    potential : its gradient g and Hessian H.
    free : the coordinates to be changed.
    downhill : whether absolute eigenvalues are taken, |H| for H.
    """
    gradient, hessian = potential.slope[free], potential.curvature[free, free]
    # Scaled to a diagonal of ±1, so that the eigenvalues of soft and stiff coordinates compare. A
    # diagonal element that is only rounding of the weights counts as `least`.
    least = max(1e-9 * _weights(form), 1e-300)
    scale = 1.0 / np.sqrt(np.maximum(np.abs(np.diag(hessian)), least))
    values, vectors = np.linalg.eigh(hessian * scale * scale[:, None])
    stiff = np.abs(values) > 1e-4  # else it is the rounding of weights that balance: no step
    divisors = np.where(stiff, np.abs(values) if downhill else values, np.inf)
    components = vectors.T @ (scale * gradient) / divisors
    step = -scale * (vectors @ components)
    longest = np.abs(step).max(initial=0.0)
    return np.asarray(step if longest < 0.5 else step * (0.5 / longest))


def _weights(form: RotorForm) -> float:
    """Return the sum of the moments of all weights about the axes, N m, as if each acted alone."""
    moments = [abs(float(weight)) for weight, _, _ in form.fixed]
    for blade in form.blades:
        weights = blade.lean or blade
        moments += [abs(weights.weight_x), abs(weights.weight_y), abs(blade.weight_z)]
    return float(sum(moments))
