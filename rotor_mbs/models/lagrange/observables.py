"""Tips and energies of many states at once: the closed form's own text, compiled for the lanes of the processor.

A tenth of the time that NumPy takes for the same formulas, which would be a quarter of a run with 1,001 samples.
"""

from __future__ import annotations

from fractions import Fraction
from typing import Any

import numpy as np

from rotor_mbs.models.lagrange import closed_form
from rotor_mbs.models.lagrange.heyoka_adapter import Parameters, heyoka
from rotor_mbs.models.lagrange.system import equation_numbers, is_compact, state_symbols
from rotor_mbs.scenario.scene import Scene
from rotor_mbs.solution.record import Array

_AT_ONCE = 1024  # samples of a run; bounds what the numbers take, which are needed once for every sample


def tip_numbers(scene: Scene, parameters: Parameters) -> list[list[Any]]:
    """(blades, 3) its tips in m, numbers that come after those of the equations; [] where none are asked for."""
    if not scene.wants("tip"):
        return []
    return [[parameters(Fraction(x)) for x in blade.tip] for blade in scene.blades]


class CompiledObservables:
    """The code for scenes with the numbers' structure of `example`. Raises MethodRefusal where heyoka is not installed.

    Source: `closed_form.point_path` and `closed_form.energies`, evaluated in symbols.
    """

    def __init__(self, example: Scene) -> None:
        engine = heyoka()
        parameters = Parameters()
        form, _ = equation_numbers(example, parameters)
        points = tip_numbers(example, parameters)
        angles, rates = state_symbols(form)
        moving = dict(zip(example.moving_coordinates, angles, strict=True))
        pitches = [moving[i] if i in moving else parameters.own(Fraction(0)) for i in range(1, 1 + len(example.blades))]
        found: list[Any] = []
        for i, point in enumerate(points):
            azimuth = angles[0] + example.phases[i]
            found += closed_form.point_path(azimuth, pitches[i], point, engine.sin, engine.cos)
        if example.wants("energy"):
            found += closed_form.energies(angles, rates, form, engine.sin, engine.cos)
        # Where all terms of a row vanish, the closed form gives the number zero: the engine asks for an expression.
        rows = [engine.expression(0.0) + row for row in found]
        self._function = engine.cfunc(rows, [*angles, *rates], compact_mode=is_compact(example)) if rows else None

    def __call__(self, states: Array, numbers: Array) -> Array:
        """(rows, runs, samples): x y z in m of each blade's tip, then kinetic and potential energy in J, as far as the
        scene asks for them.

        states    (variables, runs, samples): angles and rates that move, rad and rad/s
        numbers   (parameters, runs): of equations and tips, then the pitches that are fixed
        The runs must fill the processor's lanes, once or more: what is left over is rounded by other instructions.
        """
        _, runs, samples = states.shape
        if self._function is None:
            return np.empty((0, runs, samples))
        pieces = [self._evaluated(states[:, :, i : i + _AT_ONCE], numbers) for i in range(0, samples, _AT_ONCE)]
        return pieces[0] if len(pieces) == 1 else np.concatenate(pieces, axis=2)

    def _evaluated(self, states: Array, numbers: Array) -> Array:
        assert self._function is not None
        inputs, numbers = states[: self._function.nvars], numbers[: self._function.nparams]
        spread = np.broadcast_to(numbers[:, :, None], (*numbers.shape, states.shape[2]))  # anew for every sample
        found: Array = self._function(_in_rows(inputs), pars=_in_rows(spread), batch_parallel=False)
        return found.reshape(-1, *states.shape[1:])


def _in_rows(values: Array) -> Array:
    """(rows, runs · samples) of (rows, runs, samples)."""
    return np.ascontiguousarray(values).reshape(len(values), -1)
