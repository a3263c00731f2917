"""The closed form on plain floats, for integrators that are written for any right-hand side. Knows no heyoka."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from typing import NamedTuple

import numpy as np

from rotor_mbs.methods import time_limit as deadline
from rotor_mbs.models.lagrange import closed_form, samples
from rotor_mbs.models.lagrange.parameters import RotorForm, rotor_form
from rotor_mbs.models.lagrange.torque import Stretch, stretches
from rotor_mbs.scenario.scene import Scene
from rotor_mbs.solution.record import Array, Integration, Trajectory

RightHandSide = Callable[[float, Sequence[float]], list[float]]


class Advance(NamedTuple):
    """An integrator's way over one stretch: states at the samples it reached, where it ended, what it cost and said.

    message is "" where the end of the stretch was reached.
    """

    states: Array  # (samples reached, variables)
    end: Array  # (variables,)
    steps: int
    evaluations: int
    message: str


# (right-hand side, start, end, state at the start, sample times inside) -> Advance
Integrator = Callable[[RightHandSide, float, float, Array, Array], Advance]


class OdeSolver:
    """Any integrator over the scene, one call per stretch of the torque."""

    def __init__(self, scene: Scene, integrator: Integrator) -> None:
        self._scene = scene
        self._integrator = integrator
        form = rotor_form(scene)
        self._moving = (0, *(1 + i for i in form.moving))
        self._stretches = stretches(scene)
        has_work = scene.wants("energy") and (len(self._stretches) > 1 or scene.has_damping)
        self._functions = [right_hand_side(form, piece, with_work=has_work) for piece in self._stretches]
        columns = list(self._moving)
        start = [np.array(scene.initial_angles)[columns], np.array(scene.initial_rates)[columns]]
        self._initial = np.concatenate([*start, np.zeros(int(has_work))])
        self._times = np.linspace(0.0, scene.duration, scene.samples)
        self._states: Array = self._initial[None, :]

    def integrate(self) -> Integration:
        state, rows = self._initial, [self._initial[None, :]]
        steps, evaluations, message = 0, 0, ""
        for piece, function in zip(self._stretches, self._functions, strict=True):
            inside = self._times[(self._times > piece.start) & (self._times <= piece.end)]
            way = self._integrator(function, piece.start, piece.end, state, inside)
            steps, evaluations = steps + way.steps, evaluations + way.evaluations
            rows.append(way.states)
            state, message = way.end, way.message
            if message:
                break
        states = np.concatenate(rows)
        finite = np.isfinite(states).all(axis=1)
        self._states = states[: len(finite) if finite.all() else int(np.argmin(finite))]
        reached = float(self._times[max(len(self._states) - 1, 0)])
        return Integration(not message, message, reached, steps, evaluations, message == deadline.words())

    def observe(self) -> Trajectory:
        return samples.trajectory(self._scene, self._times[: len(self._states)], self._states, self._moving)


def right_hand_side(form: RotorForm, piece: Stretch, *, with_work: bool) -> RightHandSide:
    """d/dt of (angles, rates[, work]) on plain floats: for a handful of blades faster than arrays."""
    count = 1 + len(form.blades)
    offset, slope = float(piece.offset), float(piece.slope)

    def derivative(time: float, state: Sequence[float]) -> list[float]:
        values = state.tolist() if isinstance(state, np.ndarray) else state
        angles, rates = values[:count], values[count : 2 * count]
        torque = offset + slope * time
        try:
            found = closed_form.accelerations(angles, rates, form, torque, math.sin, math.cos)
        except (ZeroDivisionError, ValueError, OverflowError):
            # A singular mass matrix, or a state that has run away: not a number, as array arithmetic would say.
            return [math.nan] * len(values)
        work = [closed_form.power(rates, form, torque)] if with_work else []
        return [*rates, *found, *work]

    return derivative
