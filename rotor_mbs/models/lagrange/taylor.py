"""lagrange/taylor: the closed form by heyoka's adaptive Taylor method, double precision."""

from __future__ import annotations

from typing import Any

import numpy as np

from rotor_mbs.models.lagrange import samples
from rotor_mbs.models.lagrange.heyoka_adapter import array_of, heyoka
from rotor_mbs.models.lagrange.system import Propagation, build_system, compiled, initial_state, set_parameters
from rotor_mbs.scenario.scene import Scene
from rotor_mbs.solution.record import Integration, Item, Trajectory

# Unrolled code is twice as fast as compact code, but its compile time grows with the number of blades.
_UNROLLED_BLADES = 4


class TaylorSolver:
    """Holds the compiled integrator and the samples of its last run."""

    def __init__(self, scene: Scene, tolerance: float) -> None:
        engine = heyoka()
        self._scene = scene
        system = build_system(scene)
        pars = array_of(system.parameters.values, quad=False)
        initial = array_of(initial_state(scene, system), quad=False)
        compact = len(scene.blades) > _UNROLLED_BLADES
        integrator = compiled(
            ("double", tolerance, system.structure),
            lambda: engine.taylor_adaptive(
                system.equations, state=initial, tol=tolerance, compact_mode=compact, high_accuracy=True
            ),
        )
        set_parameters(integrator, pars)
        self._moving = system.moving
        self._times = np.linspace(0.0, scene.duration, scene.samples)
        self._propagation = Propagation(integrator, system, initial, self._times)

    def integrate(self) -> Integration:
        return self._propagation.run()

    def observe(self) -> Trajectory:
        states = self._propagation.states
        return samples.trajectory(self._scene, self._times[: len(states)], states, self._moving)


def items(scene: Scene) -> list[Item]:
    """Raises MethodRefusal where heyoka is not installed, before anything is built."""
    heyoka()
    return samples.items(scene)


def build(scene: Scene, settings: Any) -> TaylorSolver:
    """Raises MethodRefusal where heyoka is not installed."""
    return TaylorSolver(scene, settings.tolerance)
