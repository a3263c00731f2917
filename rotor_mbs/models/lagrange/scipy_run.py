"""lagrange/dop853 and lagrange/radau: the closed form on plain floats, by SciPy's solve_ivp. Knows no heyoka."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from types import MappingProxyType

import numpy as np

from rotor_mbs.models.lagrange import closed_form, samples
from rotor_mbs.models.lagrange.parameters import RotorForm, rotor_form
from rotor_mbs.models.lagrange.torque import Stretch, stretches
from rotor_mbs.scenario.scene import Scene
from rotor_mbs.trajectory.record import Array, Integration, Item, Trajectory

RightHandSide = Callable[[float, Array], Sequence[float]]


class ScipySolver:
    """solve_ivp over the scene, one call per stretch of the torque."""

    def __init__(self, scene: Scene, scipy_name: str, relative_tolerance: float, absolute_tolerance: float) -> None:
        from scipy.integrate import solve_ivp

        self._solve_ivp = solve_ivp
        self._scene = scene
        self._scipy_name = scipy_name
        self._tolerances = {"rtol": relative_tolerance, "atol": absolute_tolerance}
        form = rotor_form(scene)
        self._moving = (0, *(1 + i for i in form.moving))
        self._stretches = stretches(scene)
        self._has_work = scene.wants("energy") and (len(self._stretches) > 1 or scene.has_damping)
        self._functions = [right_hand_side(form, piece, with_work=self._has_work) for piece in self._stretches]
        columns = list(self._moving)
        start = [np.array(scene.initial_angles)[columns], np.array(scene.initial_rates)[columns]]
        self._initial = np.concatenate([*start, np.zeros(int(self._has_work))])
        self._times = np.linspace(0.0, scene.duration, scene.samples)
        self._states: Array = self._initial[None, :]

    def integrate(self) -> Integration:
        state, rows = self._initial, [self._initial[None, :]]
        steps, evaluations, success, message = 0, 0, True, ""
        for piece, function in zip(self._stretches, self._functions, strict=True):
            inside = self._times[(self._times > piece.start) & (self._times <= piece.end)]
            with np.errstate(all="ignore"):
                result = self._solve_ivp(
                    function, (piece.start, piece.end), state, self._scipy_name, dense_output=True, **self._tolerances
                )
            steps += len(result.t) - 1
            evaluations += result.nfev
            success, message = result.success, "" if result.success else f"SciPy: {result.message}"
            rows.append(result.sol(inside[inside <= result.t[-1]]).T)
            state = result.y[:, -1]
            if not success:
                break
        states = np.concatenate(rows)
        finite = np.isfinite(states).all(axis=1)
        self._states = states[: len(finite) if finite.all() else int(np.argmin(finite))]
        reached = float(self._times[max(len(self._states) - 1, 0)])
        return Integration(bool(success), message, reached, steps, evaluations)

    def observe(self) -> Trajectory:
        return samples.trajectory(self._scene, self._times[: len(self._states)], self._states, self._moving)


def right_hand_side(form: RotorForm, piece: Stretch, *, with_work: bool) -> RightHandSide:
    """d/dt of (angles, rates[, work]) on plain floats: for a handful of blades faster than arrays."""
    count = 1 + len(form.blades)
    offset, slope = float(piece.offset), float(piece.slope)

    def derivative(time: float, state: Array) -> Sequence[float]:
        values = state.tolist()
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


class ScipyMethod:
    """A solver of solve_ivp as a method."""

    def __init__(self, scipy_name: str, relative_tolerance: float, absolute_tolerance: float) -> None:
        self._scipy_name = scipy_name
        self.DEFAULTS: Mapping[str, object] = MappingProxyType(
            {"relative_tolerance": relative_tolerance, "absolute_tolerance": absolute_tolerance}
        )

    def items(self, scene: Scene) -> list[Item]:
        return samples.items(scene)

    def build(self, scene: Scene, settings: Mapping[str, object]) -> ScipySolver:
        tolerances = (float(str(settings[key])) for key in ("relative_tolerance", "absolute_tolerance"))
        return ScipySolver(scene, self._scipy_name, *tolerances)


dop853 = ScipyMethod("DOP853", 3e-14, 1e-16)
radau = ScipyMethod("Radau", 1e-8, 1e-11)
