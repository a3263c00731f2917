"""Find the periodic motion of a rotor that turns under gravity, and its linear stability.

At a mean speed the rotor is one turn further after each period. The eigenvalues of the state
transition matrix over one turn are the Floquet multipliers. Needs heyoka.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from fractions import Fraction
from typing import Any

import numpy as np

from rotor_mbs.errors import InputError
from rotor_mbs.models.lagrange import closed_form
from rotor_mbs.models.lagrange.closed_form import load_values
from rotor_mbs.models.lagrange.heyoka_adapter import Parameters, array_of, failure, heyoka
from rotor_mbs.models.lagrange.linearization import (
    holding_torque,
    linearize,
    slopes,
    steady_rotation,
)
from rotor_mbs.models.lagrange.parameters import rotor_form
from rotor_mbs.models.lagrange.samples import loads_at_start
from rotor_mbs.models.lagrange.taylor import compiled, state_symbols
from rotor_mbs.scenario.scene import Scene
from rotor_mbs.scenario.time_table import value_at
from rotor_mbs.solution.trajectory import Array

# What is left of a turn's mismatch, in rad and in shares of the speed: Newton's method ends at the
# first, and its best state counts as periodic below the second. (A multiplier of 1e9 amplifies the
# rounding of 1e-16 to 1e-7.)
_CLOSED = 1e-13
_ACCEPTED = 1e-9
_MAX_CORRECTIONS = 12
# Of the integrator: a turn of a stiff bearing takes about two steps for each of its oscillations; a
# rotor that has left the periodic motion takes more and more.
_STEPS, _STEPS_PER_OSCILLATION = 500, 10
_MOST_STEPS = 10**9  # days of computing: a turn that may take more is not begun
# rad, or shares of the speed: from a mismatch above this Newton's method is given up.
_LOST = 20.0


@dataclass(frozen=True)
class Turn:
    """Hold a motion that repeats itself after a turn, and the growth of deviations over it."""

    speed: float  # rad/s, of the rotor, averaged over the turn
    # (2n,) angles in rad and rates in rad/s at its start, of the coordinates that move
    start: Array
    torque: float  # N m on the rotor, constant: what the dampers take in a turn is put in by it
    transition: Array  # (2n, 2n) state transition matrix over the turn
    # (2n,) derivative at the start of what the motion keeps, energy less the torque's work; zero
    # where dampers take energy
    gradient: Array
    flow: Array  # (2n,) time derivative of the state at the start
    # ∫ tr A dt over the turn, A the derivative of the state's rate by the state: the logarithm of
    # the determinant of `transition`, computed without it
    trace_integral: float
    # largest difference between end and start: rad, and rates as shares of the speed
    mismatch: float
    message: str = ""  # why no periodic motion was found; "" where it was


def periodic_turn(scene: Scene, speed: float, guess: Turn | None = None) -> Turn:
    """Find the periodic motion of a rotor at a mean speed, by Newton's method.

    The unknowns are the torque and the state at the start, except for the rotor angle, which
    remains the scene's initial one.

    Parameters
    ----------
    scene : the rotor; its pitch torques and rest angles as at t = 0.
    speed : rad/s, not 0; below 0 the rotor turns the other way.
    guess : a motion at a speed nearby; steady rotation without gravity where left out.

    Returns
    -------
    Turn
        Its `message` says why, if no such motion was found; all numbers but the speed are NaN then.

    Raises
    ------
    MethodRefusal
        If heyoka is not installed.
    """
    try:
        system = _Variational(scene)
        n = system.coordinates
        if guess is None:
            angles = steady_rotation(scene, speed)[scene.moving_coordinates]
            state, torque = (
                np.concatenate([angles, [speed], np.zeros(n - 1)]),
                holding_torque(scene, speed),
            )
        else:
            state, torque = guess.start * np.repeat([1.0, speed / guess.speed], n), guess.torque
        units = np.repeat([1.0, speed], n)
        period = 2.0 * math.pi / abs(speed)
        shift = np.zeros(2 * n)
        shift[0] = math.copysign(2.0 * math.pi, speed)
        form, constant_loads = rotor_form(scene), loads_at_start(scene)

        def energy(state: Sequence[Any]) -> Any:
            return sum(
                closed_form.energies(state[:n], state[n:], form, constant_loads, np.sin, np.cos)
            )

        best: Turn | None = None
        for _ in range(_MAX_CORRECTIONS):
            end, derivatives, trace = system.propagate(state, torque, period)
            by_state, by_torque = derivatives[:, :-1], derivatives[:, -1]
            residual = (end - state - shift) / units
            mismatch = float(np.abs(residual).max())
            if best is None or mismatch < best.mismatch:
                # Gradient of energy less the torques' work, zero where dampers act; and the state's
                # time derivative.
                loads, gradient = loads_at_start(scene, torque), slopes(energy, state)
                gradient[:n] -= [torque, *loads.pitches]
                gradient = np.zeros(2 * n) if scene.has_damping else gradient
                angles, rates = state[:n].tolist(), state[n:].tolist()
                accelerations = closed_form.accelerations(
                    angles, rates, form, loads, math.sin, math.cos
                )
                flow = np.array([*rates, *accelerations])
                best = Turn(speed, state, torque, by_state, gradient, flow, trace, mismatch)
            if mismatch < _CLOSED or mismatch > _LOST:
                break
            # The unknowns: the torque, and the state without the rotor's angle, which is fixed.
            # They differ in units: each column is scaled to length one.
            jacobian = (
                np.column_stack([by_torque, (by_state - np.eye(2 * n))[:, 1:]]) / units[:, None]
            )
            sizes = np.maximum(np.linalg.norm(jacobian, axis=0), 1e-300)
            change = np.linalg.lstsq(jacobian / sizes, -residual, rcond=1e-13)[0] / sizes
            torque, state = torque + change[0], state + np.concatenate([[0.0], change[1:]])
        if best is None or best.mismatch > _ACCEPTED:
            left = math.inf if best is None else best.mismatch
            raise InputError(
                f"no periodic motion found: the state changes by {left:.3g} rad in a revolution"
            )
    except InputError as exc:
        size = 2 * len(scene.moving_coordinates)
        nothing, matrix = np.full(size, np.nan), np.full((size, size), np.nan)
        return Turn(
            speed, nothing, math.nan, matrix, nothing, nothing, math.nan, math.nan, str(exc)
        )
    return best


class _Variational:
    """Integrate the closed form with its first variational equations by state and torque."""

    def __init__(self, scene: Scene) -> None:
        """Compile the equations, or take what is compiled for a scene of the same structure.

        Parameters
        ----------
        scene : the rotor; its pitch torques and rest angles as at t = 0.
        """
        engine = heyoka()
        parameters = Parameters()
        form = rotor_form(scene, parameters)
        parameters.structure.append(int(scene.has_tilt_or_cone))
        self.coordinates = 1 + len(form.blades)
        pitch_loads = [
            parameters(Fraction(value_at(table, 0.0))) for table in scene.load_tables[1:]
        ]
        torque = parameters.own(Fraction(0))
        angles, rates = state_symbols(form)
        loads = load_values([torque, *pitch_loads], scene.moving_coordinates[1:])
        accelerations = closed_form.accelerations(
            angles, rates, form, loads, engine.sin, engine.cos
        )
        symbols = [*angles, *rates]
        equations = [*zip(symbols, [*rates, *accelerations], strict=True)]

        def make() -> object:
            diagonal = zip(accelerations, rates, strict=True)
            trace = engine.sum([engine.diff(acceleration, rate) for acceleration, rate in diagonal])
            system = engine.var_ode_sys(equations, args=[*symbols, torque], order=1).sys
            system.append((engine.make_vars("trace"), trace))
            return engine.taylor_adaptive(system, state=np.zeros(len(system)), compact_mode=True)

        self._integrator = compiled(("turn", tuple(parameters.structure)), make, self)
        self._values = array_of(parameters.values, quad=False)
        still = linearize(scene, scene.initial_angles, [0.0] * len(scene.initial_angles), 0.0)
        self._frequency = math.sqrt(np.abs(still.stiffness).max())

    def propagate(self, state: Array, torque: float, period: float) -> tuple[Array, Array, float]:
        """Integrate the state and its derivatives over one turn.

        Parameters
        ----------
        state : (2n,) at the start, angles (rad), then rates (rad/s).
        torque : N m on the rotor.
        period : s.

        Returns
        -------
        end : ndarray, shape (2n,)
        derivatives : ndarray, shape (2n, 2n + 1)
            Of the end by the initial state, then by the torque.
        trace : float
            ∫ tr A dt, as in `Turn.trace_integral`.

        Raises
        ------
        InputError
            If the turn takes too many steps, or the engine fails.
        """
        count, integrator = len(state), self._integrator
        integrator.pars[:] = [*self._values[:-1], torque][: len(integrator.pars)]
        integrator.time = 0.0
        integrator.state[:] = np.concatenate([state, np.eye(count, count + 1).ravel(), [0.0]])
        oscillations = self._frequency * period / (2.0 * math.pi)
        expected_steps = _STEPS + _STEPS_PER_OSCILLATION * oscillations
        if not expected_steps <= _MOST_STEPS:
            what = f"a turn of {period:.3g} s takes more than {_MOST_STEPS} steps"
            raise InputError(f"no periodic motion found: {what}")
        max_steps = int(expected_steps)
        message = failure(integrator.propagate_until(period, max_steps=max_steps)[0])
        if "step_limit" in message:
            message = f"no periodic motion found: a turn takes more than {max_steps} steps"
        if message:
            raise InputError(message)
        result = np.array(integrator.state)
        return result[:count], result[count:-1].reshape(count, count + 1), float(result[-1])
