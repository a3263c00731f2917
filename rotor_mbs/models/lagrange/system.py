"""The closed form as a symbolic system of heyoka, and one propagation of it over the sample times."""

from __future__ import annotations

import copy
from collections.abc import Callable
from dataclasses import dataclass
from fractions import Fraction
from typing import Any

import numpy as np

from rotor_mbs.methods import time_limit as deadline
from rotor_mbs.models.lagrange import closed_form
from rotor_mbs.models.lagrange.heyoka_adapter import Parameters, array_of, failure, heyoka
from rotor_mbs.models.lagrange.parameters import (
    RotorForm,
    TorqueSegment,
    rotor_form,
    torque_segments,
    work_is_integrated,
)
from rotor_mbs.scenario.scene import Scene
from rotor_mbs.solution.record import Array, Integration


@dataclass
class EquationSystem:
    """First-order equations of a scene.

    equations   [(symbol, right-hand side)]: angles, rates, and the work where it is not known in closed form
    parameters  their numbers; the last two are the torque's offset and slope where the torque is not constant
    moving      column in `angles` of each state angle: 0, then 1 + number of each blade whose pitch moves
    """

    equations: list[tuple[Any, Any]]
    parameters: Parameters
    moving: tuple[int, ...]
    has_work: bool
    segments: list[TorqueSegment]
    has_constant_torque: bool

    @property
    def structure(self) -> tuple[int, ...]:
        return (*self.parameters.structure, len(self.equations), self.has_constant_torque)


def build_system(scene: Scene) -> EquationSystem:
    """The closed form of the scene in heyoka's symbols. Raises MethodRefusal where heyoka is not installed."""
    engine = heyoka()
    parameters = Parameters()
    form, torque = equation_numbers(scene, parameters)
    segments = torque_segments(scene)
    has_work = work_is_integrated(scene)
    count = 1 + len(form.blades)
    names = [f"q{i}" for i in range(count)] + [f"w{i}" for i in range(count)]
    symbols = engine.make_vars(*names)
    angles, rates = symbols[:count], symbols[count:]
    found = closed_form.accelerations(angles, rates, form, torque, engine.sin, engine.cos)
    equations = [*zip(angles, rates, strict=True), *zip(rates, found, strict=True)]
    if has_work:
        equations.append((engine.make_vars("work"), closed_form.power(rates, form, torque)))
    moving = (0, *(1 + i for i in form.moving))
    return EquationSystem(equations, parameters, moving, has_work, segments, scene.has_constant_torque)


def equation_numbers(scene: Scene, parameters: Parameters) -> tuple[RotorForm, Any]:
    """Form, and torque in N m; takes the scene's numbers into `parameters`, in the order that integrators have them."""
    form = rotor_form(scene, parameters)
    first = torque_segments(scene)[0]
    if scene.has_constant_torque:
        return form, parameters(first.offset)
    return form, parameters.own(first.offset) + parameters.own(first.slope) * heyoka().time


def initial_state(scene: Scene, system: EquationSystem) -> list[Fraction]:
    """The scene's doubles, exact, in the order of the equations."""
    columns = system.moving
    values = [scene.initial_angles[i] for i in columns] + [scene.initial_rates[i] for i in columns]
    return [Fraction(value) for value in values] + [Fraction(0)] * system.has_work


_compiled: dict[tuple[object, ...], Any] = {}


def compiled(key: tuple[object, ...], make: Callable[[], Any]) -> Any:
    """An integrator of its own for the caller, compiled once per process and structure."""
    if key not in _compiled:
        _compiled[key] = make()
    return copy.deepcopy(_compiled[key])


def set_parameters(integrator: Any, values: Any) -> None:
    """Those that the equations of motion use; the ones after them belong to energies alone."""
    integrator.pars[:] = values[: len(integrator.pars)]


class Propagation:
    """One integrator, one initial state, one row of sample times (s); run as often as wanted.

    The state at the samples is in `states` ((n, variables), cut before the first row that is not finite).
    """

    def __init__(self, integrator: Any, system: EquationSystem, initial: Any, times: Array) -> None:
        self._integrator = integrator
        self._initial = initial
        self._times = times
        self._segments = [_SegmentGrid(segment, times, initial.dtype) for segment in system.segments]
        self._torque = None if system.has_constant_torque else len(system.parameters.values) - 2
        self.states = initial[None, :]

    def run(self) -> Integration:
        integrator = self._integrator
        integrator.time = self._initial.dtype.type(0)
        integrator.state[:] = self._initial
        rows = [self._initial[None, :]]
        steps, message = 0, ""
        # Asked after every step, it costs a quarter of the run: only where there is a limit.
        callback = _within_time if deadline.is_set() else None
        for segment in self._segments:
            if self._torque is not None:
                integrator.pars[self._torque :] = segment.torque
            with deadline.polled():
                outcome, _, _, taken, _, states = integrator.propagate_grid(segment.grid, callback=callback)
            steps += taken
            rows.append(states[1 : 1 + segment.samples])
            message = deadline.message() if deadline.is_over() else failure(outcome)
            if message:
                break
        states = np.concatenate(rows)
        finite = np.isfinite(states.astype(float, copy=False))
        self.states = states if finite.all() else states[: int(np.argmin(finite.all(axis=1)))]
        reached = float(self._times[max(len(self.states) - 1, 0)])
        return Integration(not message, message, reached, steps, out_of_time=message == deadline.message())


def _within_time(_integrator: Any) -> bool:
    return not deadline.is_over()


class _SegmentGrid:
    """The times at which a segment is stopped at: its start, the samples inside, and its end."""

    def __init__(self, segment: TorqueSegment, times: Array, dtype: Any) -> None:
        inside = times[(times > segment.start) & (times <= segment.end)]
        self.samples = len(inside)
        end = [] if len(inside) and inside[-1] == segment.end else [segment.end]
        self.grid = np.array([segment.start, *inside, *end]).astype(dtype)
        self.torque = array_of([segment.offset, segment.slope], quad=dtype != np.float64)
