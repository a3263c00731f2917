"""Find the periodic motion of a rotor that turns under gravity, and its linear stability.

In the periodic motion at a mean speed, the state repeats itself after each period, except that the
rotor is one turn further. The eigenvalues of the state transition matrix over one period are the
Floquet multipliers. The module needs heyoka.
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

# Limits of the mismatch: the difference between the states at the end and at the start of a turn,
# in rad for angles and in shares of the speed for rates. Newton's method ends below _CLOSED. Its
# best state counts as periodic up to _ACCEPTED. Rounding does not allow more in general: a
# multiplier of 1e9 amplifies rounding errors of 1e-16 to 1e-7.
_CLOSED = 1e-13
_ACCEPTED = 1e-9
_MAX_CORRECTIONS = 12  # largest number of Newton steps
# Largest number of integration steps in a turn: a constant, plus a number for each oscillation of
# the stiffest bearing, which takes about two steps. A rotor that has left the periodic motion would
# take more and more steps.
_STEPS, _STEPS_PER_OSCILLATION = 500, 10
_MOST_STEPS = 10**9  # these steps take days: a turn that may need more is not begun
# Mismatch (rad, or shares of the speed) above which Newton's method is given up.
_LOST = 20.0


@dataclass(frozen=True)
class Turn:
    """Hold a periodic motion over one turn, and the growth of small deviations over the turn.

    The state has the angles, then the rates, of the n coordinates that move.
    """

    speed: float  # rad/s, mean speed of the rotor over the turn
    start: Array  # (2n,) rad, then rad/s, state at the start of the turn
    # N m, constant torque on the rotor; its work in a turn is the energy that the dampers dissipate
    torque: float
    transition: Array  # (2n, 2n) state transition matrix over the turn
    # (2n,) derivative, by the state at the start, of the energy minus the work of the torques,
    # which the motion conserves; zero if the rotor has dampers
    gradient: Array
    flow: Array  # (2n,) time derivative of the state at the start
    # ∫ tr A dt over the turn, where A is the derivative of the state's time derivative by the
    # state. It equals the logarithm of the determinant of `transition`, but is computed
    # independently of `transition`.
    trace_integral: float
    # largest difference between the states at the end and the start, apart from the turn of the
    # rotor; rad for angles, shares of the speed for rates
    mismatch: float
    message: str = ""  # why no periodic motion was found; "" if one was found


def periodic_turn(scene: Scene, speed: float, guess: Turn | None = None) -> Turn:
    """Find the periodic motion of a rotor at a mean speed, by Newton's method.

    The unknowns are the torque and the state at the start of a turn. The rotor angle of this state
    is no unknown: it is the initial rotor angle of the scene.

    Parameters
    ----------
    scene : the rotor. Its pitch torques and rest angles keep their values of t = 0.
    speed : rad/s, not 0; negative if the rotor turns in the other direction.
    guess : the periodic motion at a speed nearby, with which Newton's method begins; by default
        steady rotation without gravity.

    Returns
    -------
    Turn
        The periodic motion. If none was found, `message` says why, and all numbers except the speed
        are NaN.

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
                # Compute `Turn.gradient` and `Turn.flow`.
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
            # The columns of the Jacobian belong to the torque and to the state without the rotor
            # angle. They have different units. Each column is therefore scaled to length one.
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
    """Integrate the closed form, and the derivatives of its state by initial state and torque."""

    def __init__(self, scene: Scene) -> None:
        """Compile the equations, or take those compiled for a scene of the same structure.

        Parameters
        ----------
        scene : the rotor. Its pitch torques and rest angles keep their values of t = 0.
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
        state : (2n,) state at the start of the turn, angles (rad), then rates (rad/s).
        torque : N m, torque on the rotor.
        period : s, duration of the turn.

        Returns
        -------
        end : ndarray, shape (2n,)
            State at the end of the turn.
        derivatives : ndarray, shape (2n, 2n + 1)
            Derivatives of `end` by the state at the start, then by the torque.
        trace : float
            ∫ tr A dt, see `Turn.trace_integral`.

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
