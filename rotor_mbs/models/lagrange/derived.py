"""Tips and energies of many states at once: the closed form's own text, compiled for the lanes of the processor.

A tenth of the time that NumPy takes for the same formulas, which would be a quarter of a run of the batch integrator.
"""

from __future__ import annotations

from dataclasses import dataclass
from fractions import Fraction
from typing import Any

import numpy as np

from rotor_mbs.models.lagrange import closed_form
from rotor_mbs.models.lagrange.heyoka_adapter import Parameters, array_of, heyoka
from rotor_mbs.models.lagrange.parameters import RotorForm, rotor_form
from rotor_mbs.scenario.scene import Scene
from rotor_mbs.trajectory.record import Array


@dataclass(frozen=True)
class Numbers:
    """What tips and energies are made of beside the state: the scene's numbers, then the pitches that are held.

    values   (parameters,), without the held pitches, which differ from run to run
    structure   scenes that agree in it share their compiled code
    """

    values: Array
    structure: tuple[int, ...]


def numbers_of(scene: Scene) -> Numbers:
    """Of a scene and all others that differ in their starts alone."""
    parameters = Parameters()
    _symbols(scene, parameters)
    asked = (scene.wants("tip"), scene.wants("energy"))
    return Numbers(array_of(parameters.values, quad=False), (*parameters.structure, *asked))


class Derived:
    """The compiled code for scenes like `example`.

    tip_rows   of the result: three for each blade's tip, x y z in m; then kinetic and potential energy in J, where
               the scene asks for them
    """

    def __init__(self, example: Scene, *, compact: bool) -> None:
        engine = heyoka()
        parameters = Parameters()
        form, points = _symbols(example, parameters)
        count = 1 + len(form.blades)
        symbols = engine.make_vars(*[f"q{i}" for i in range(count)], *[f"w{i}" for i in range(count)])
        angles, rates = symbols[:count], symbols[count:]
        moving = dict(zip(form.moving, angles[1:], strict=True))
        found: list[Any] = []
        for i, (point, phase) in enumerate(zip(points, example.phases, strict=True) if points else ()):
            pitch = moving[i] if i in moving else parameters.own(Fraction(0))
            found += closed_form.point_path(angles[0] + phase, pitch, point, engine.sin, engine.cos)
        self.tip_rows = len(found)
        if example.wants("energy"):
            found += closed_form.energies(angles, rates, form, engine.sin, engine.cos)
        self._function = engine.cfunc([engine.expression(0.0) + one for one in found], symbols, compact_mode=compact)
        self._numbers = self._spread = np.empty((0, 0))

    def __call__(self, states: Array, numbers: Array) -> Array:
        """(rows, runs, samples) of states (variables, runs, samples), rad and rad/s, and numbers (parameters, runs).

        There must be as many runs as the processor has lanes: what is left over would be rounded by other instructions.
        """
        _, runs, samples = states.shape
        numbers, inputs = numbers[: self._function.nparams], states[: self._function.nvars]
        if self._spread.shape[1] != runs * samples or not np.array_equal(numbers, self._numbers):
            self._numbers, self._spread = numbers, np.repeat(numbers, samples, axis=1)
        found: Array = self._function(inputs.reshape(len(inputs), -1), pars=self._spread, batch_parallel=False)
        return found.reshape(-1, runs, samples)


def _symbols(scene: Scene, parameters: Parameters) -> tuple[RotorForm, list[list[Any]]]:
    """The form, and the tips' points, in parameters."""
    form = rotor_form(scene, parameters)
    points = [[parameters(Fraction(x)) for x in blade.tip] for blade in scene.blades] if scene.wants("tip") else []
    return form, points
