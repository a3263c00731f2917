"""Linearize the closed form, and find its steady states.

A steady state is an equilibrium at rest, or steady rotation without gravity.
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

# If a step of the search would be shorter than this (rad), three plain Newton steps end the search.
_SMALL_STEP = 1e-6
_MAX_STEPS = 200  # largest number of steps of the search
# A difference of moments counts as rounding if it is at most this share of the weights' moments, or
# of the largest moment that balances a pitch torque.
_ROUNDING = 1e-12
# Coordinates that a search may change, among those that move: all, or all except the rotor.
_ALL, _PITCHES = slice(None), slice(1, None)


def slopes(function: Function, values: Sequence[float] | Array) -> Array:
    """Return the derivatives of an analytic function by complex steps.

    They are exact except for rounding, because no numbers that are nearly equal are subtracted.

    Parameters
    ----------
    function : analytic function of a list of n numbers, which returns one number or m numbers.
    values : (n,) numbers at which the derivatives are computed.

    Returns
    -------
    ndarray, shape (n,) or (m, n)
    """
    step = 1e-30
    # Row i has number i for the n directions. Only direction i changes it.
    moved = np.asarray(values)[:, None] + 1j * step * np.eye(len(values))
    return np.asarray(np.imag(function(list(moved))) / step)


def linearize(
    scene: Scene, angles: Sequence[float] | Array, rates: Sequence[float] | Array, torque: float
) -> Linearization:
    """Linearize the closed form about a state, in the coordinates that move.

    Parameters
    ----------
    scene : the rotor. Its loads, except the rotor torque, keep their values of t = 0.
    angles, rates : (1 + blades,) rad and rad/s, the state.
    torque : N m, rotor torque that replaces that of the scene.

    Returns
    -------
    Linearization
        Stiffness and damping divided by the mass matrix, and the accelerations at the state.

    Raises
    ------
    ZeroDivisionError
        If the mass matrix is singular at this state.
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

    # Computed on floats, and before the derivatives, because a division by zero raises an error for
    # floats, but not for arrays.
    residual = np.array(accelerations(state, math.sin, math.cos))
    derivatives = slopes(lambda state: accelerations(state, np.sin, np.cos), state)
    return Linearization(-derivatives[:, :n], -derivatives[:, n:], residual)


def holding_torque(scene: Scene, speed: float) -> float:
    """Return the rotor torque (N m) that balances the shaft's damper at a speed (rad/s)."""
    return scene.shaft_damping * speed


def steady_rotation(scene: Scene, speed: float) -> Array:
    """Return the angles at which the rotor turns steadily without gravity.

    The pitches are a stationary point of V - ½ Ω² Σ A - Σ Q θ, with the symbols of `closed_form`
    and the pitch torques Q. The search goes downhill from the scene's initial pitches. If these are
    stationary, they are returned, even if they are unstable. The rotor keeps its initial angle.

    Parameters
    ----------
    scene : the rotor. Its pitch torques and rest angles keep their values of t = 0.
    speed : rad/s, speed of the rotor.

    Returns
    -------
    ndarray, shape (1 + blades,)
        rad.

    Raises
    ------
    InputError
        If a pitch torque is larger than gravity, rotation and spring can balance, if no steady
        state is found within 200 steps, or if rounding of the energies makes the state inaccurate.
    """
    still = replace(scene, gravity=0.0)
    return _checked(still, speed, _stationary(still, speed, _PITCHES))


def equilibrium(scene: Scene) -> Array:
    """Return the angles at which the rotor rests without a rotor torque.

    The search is that of `steady_rotation`. A balanced rotor (`is_balanced`) keeps its initial
    angle. For any other rotor the search also changes the rotor angle.

    Parameters
    ----------
    scene : the rotor and gravity. Its pitch torques and rest angles keep their values of t = 0.

    Returns
    -------
    ndarray, shape (1 + blades,)
        rad.

    Raises
    ------
    InputError
        In the same cases as `steady_rotation`.
    """
    if not scene.gravity:
        return steady_rotation(scene, 0.0)
    try:
        angles = _stationary(scene, 0.0, _PITCHES)
    except _NotFoundError:  # an equilibrium may exist at another rotor angle
        angles = None
    if angles is None or not is_balanced(scene, angles):
        angles = _stationary(scene, 0.0, _ALL)
    return _checked(scene, 0.0, angles)


def is_balanced(scene: Scene, angles: Sequence[float] | Array) -> bool:
    """Return whether a rotor under gravity can rest at any rotor angle.

    It can if two torques are zero up to rounding: the torque of the weights on the rotor at
    `angles`, and its change to first order if the rotor is turned and the pitches follow. Equal
    blades on bearing springs may fail the second condition. Their pitches change as the rotor
    turns, and their weights balance only to third order in these changes. On stiff bearings the
    remaining torque is below rounding. On soft bearings the rotor has a preferred angle.

    Parameters
    ----------
    scene : Scene
        The rotor and gravity, which is not 0.
    angles : sequence of float
        (1 + blades,) rad, angles at which the pitches are in equilibrium.
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
    """Return the sum of all weights' moments, divided by the rotor's inertia, in 1/s².

    If the weights do not balance, the stiffness of the rotor has this magnitude. If they balance,
    rounding errors of the stiffness are relative to it.

    Parameters
    ----------
    scene : the rotor and gravity.
    angles : (1 + blades,) rad, angles at which the rotor's inertia is computed.
    """
    form, loads = rotor_form(scene), loads_at_start(scene)
    moving = [float(angles[column]) for column in scene.moving_coordinates]
    # At a rotor rate of 1 rad/s the kinetic energy is half the rotor's inertia.
    turning = [1.0] + [0.0] * len(form.blades)
    half_inertia, _ = closed_form.energies(moving, turning, form, loads, math.sin, math.cos)
    weights = _weights(form)
    return weights / (2.0 * half_inertia) if weights else 0.0


class _NotFoundError(InputError):
    """Report that no steady state was found."""


def _shown(speed: float) -> str:
    """Return a rotor speed (rad/s) as text in rad/s, and in rpm if it is not 0."""
    rpm = f" ({speed * 30.0 / math.pi:.4g} rpm)" if speed else ""
    return f"{speed:g} rad/s{rpm}"


class _Potential(NamedTuple):
    """Hold the amended potential V - T, and its derivatives by the n angles."""

    value: float  # J
    slope: Array  # (n,) N m, first derivatives
    curvature: Array  # (n, n) N m/rad, second derivatives


def _stationary(scene: Scene, speed: float, free: slice) -> Array:
    """Return the angles at which the forces on the free coordinates are zero.

    The search starts at the scene's initial angles. It is Newton's method with the absolute values
    of the Hessian's eigenvalues. Each step is halved until it goes downhill.

    Parameters
    ----------
    scene : the rotor and gravity. Its loads keep their values of t = 0.
    speed : rad/s, speed of the rotor.
    free : the coordinates that the search may change, `_ALL` or `_PITCHES`.

    Returns
    -------
    ndarray, shape (1 + blades,)
        rad.

    Raises
    ------
    InputError
        If a pitch torque is too large, or (`_NotFoundError`) if no such angles are found within
        `_MAX_STEPS` steps.
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
    """Check that gravity and rotation can balance the torque on each pitch without a spring.

    Parameters
    ----------
    scene : the scene, whose name and coordinates an error names.
    form : coefficients of the rotor.
    speed : rad/s, speed of the rotor.
    loads : loads at t = 0.

    Raises
    ------
    InputError
        If they cannot balance it.
    """
    columns = scene.moving_coordinates[1:]
    for column, blade, torque in zip(columns, form.blades, loads.pitches, strict=True):
        # Sum of the largest moment of the weight, and Ω² times a bound of ½ ∂A/∂θ, which is
        # ½ half_slope_sc sin 2θ + half_slope_cs cos 2θ, plus slope_s s + slope_c c with a cone.
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

    The search evaluates energies. Their rounding may hide differences that the accelerations show.

    Parameters
    ----------
    scene, speed : see `steady_rotation`.
    angles : (1 + blades,) rad, the result of the search.

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
    """Return whether a step went downhill, even if the decrease is smaller than rounding errors.

    This is the approximate Wolfe condition of W. W. Hager and H. Zhang, SIAM J. Optim. 16 (2005)
    170-192.

    Parameters
    ----------
    trial, start : amended potential after and before the step.
    step : (free coordinates,) rad.
    free : the coordinates that the step changes.
    """
    allowed = start.value + 1e-12 * abs(start.value)
    return trial.value <= allowed and bool(
        trial.slope[free] @ step <= -0.8 * (start.slope[free] @ step)
    )


def _amended_potential(
    form: RotorForm, angles: Array, speed: float, loads: LoadValues
) -> _Potential:
    """Return the amended potential for pitches at rest in a rotor that turns at constant speed.

    V contains the potential of the constant pitch torques. The rotor torque is left out.

    Parameters
    ----------
    form : coefficients of the rotor.
    angles : (n,) rad, angles of the coordinates that move.
    speed : rad/s, speed of the rotor.
    loads : loads at t = 0.
    """
    rates = [speed, *(0.0 for _ in form.blades)]

    def value(angles: Any) -> Any:
        kinetic, potential = closed_form.energies(angles, rates, form, loads, np.sin, np.cos)
        return potential - np.dot(loads.pitches, angles[1:]) - kinetic

    def forces(angles: Any) -> list[Any]:
        return hamilton.forces(angles, rates, form, loads, np.sin, np.cos)

    return _Potential(value(angles), slopes(value, angles), -slopes(forces, angles))


def _newton_step(form: RotorForm, potential: _Potential, free: slice, *, downhill: bool) -> Array:
    """Return a Newton step -H⁻¹ g of the free coordinates, (free coordinates,) rad.

    No component is larger than 0.5 rad. The step has no component in directions without stiffness,
    such as the angle of a balanced rotor.

    Parameters
    ----------
    form : coefficients of the rotor. Rounding errors are relative to its weights.
    potential : amended potential, with gradient g and Hessian H.
    free : the coordinates that the step changes.
    downhill : whether the eigenvalues of H are replaced by their absolute values.
    """
    gradient, hessian = potential.slope[free], potential.curvature[free, free]
    # H is scaled to a diagonal of ±1, so that eigenvalues of soft and stiff coordinates can be
    # compared. A diagonal element below `least` is only a rounding error, and is scaled by `least`.
    least = max(1e-9 * _weights(form), 1e-300)
    scale = 1.0 / np.sqrt(np.maximum(np.abs(np.diag(hessian)), least))
    values, vectors = np.linalg.eigh(hessian * scale * scale[:, None])
    # A smaller eigenvalue is a rounding error of weights that balance. No step is taken there.
    stiff = np.abs(values) > 1e-4
    divisors = np.where(stiff, np.abs(values) if downhill else values, np.inf)
    components = vectors.T @ (scale * gradient) / divisors
    step = -scale * (vectors @ components)
    longest = np.abs(step).max(initial=0.0)
    return np.asarray(step if longest < 0.5 else step * (0.5 / longest))


def _weights(form: RotorForm) -> float:
    """Return the sum of the magnitudes of all weights' moments about rotor and pitch axes, N m."""
    moments = [abs(float(weight)) for weight, _, _ in form.fixed]
    for blade in form.blades:
        weights = blade.lean or blade
        moments += [abs(weights.weight_x), abs(weights.weight_y), abs(blade.weight_z)]
    return float(sum(moments))
