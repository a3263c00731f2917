"""The six methods of this package: two models, each with its integrators, under the names used everywhere.

Listing what a method builds needs no engine; the engine is loaded when a system is built.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field

from rotor_mbs.errors import InputError, MethodRefusal
from rotor_mbs.methods.base import Method, Solver
from rotor_mbs.models.exudyn import blueprint, chain, readings, schemes, tree
from rotor_mbs.models.exudyn.energy import work_needs_rows
from rotor_mbs.models.exudyn.timetable import RotorTorque
from rotor_mbs.scenario.scene import Scene
from rotor_mbs.solution.record import Item

# The engine takes a run as ended within 1e-10 s of its end, whatever the step.
_SHORTEST_INTERVAL = 1e-8
_MOST_STEPS = 1e9


@dataclass
class TreeMethod:
    """The kinematic tree with one integrator."""

    scheme: Callable[[schemes.Settings], schemes.Scheme]
    DEFAULTS: Mapping[str, object] = field(default_factory=dict)

    def items(self, scene: Scene) -> list[Item]:
        return blueprint.items(tree.parts(scene, RotorTorque(scene)))

    def build(self, scene: Scene, settings: Mapping[str, object]) -> Solver:
        from rotor_mbs.models.exudyn.solver import MultibodySolver

        scheme = _checked(self.scheme, self.DEFAULTS, scene, settings)
        torque = RotorTorque(scene)
        between = scene.wants("energy") and work_needs_rows(scene)
        parts = tree.parts(scene, torque)
        return MultibodySolver(scene, parts, torque, scheme, readings.tree_trajectory, between)


@dataclass
class ChainMethod:
    """The chain of rigid bodies with one integrator."""

    scheme: Callable[[schemes.Settings], schemes.Scheme]
    DEFAULTS: Mapping[str, object] = field(default_factory=dict)

    def items(self, scene: Scene) -> list[Item]:
        return blueprint.items(chain.parts(scene, RotorTorque(scene), str(self.DEFAULTS["node"])))

    def build(self, scene: Scene, settings: Mapping[str, object]) -> Solver:
        from rotor_mbs.models.exudyn.solver import MultibodySolver

        scheme = _checked(self.scheme, self.DEFAULTS, scene, settings)
        node = {**self.DEFAULTS, **settings}["node"]
        if node not in chain.NODES:
            raise InputError(f"setting node: {node!r} is not known; allowed: {', '.join(chain.NODES)}")
        torque = RotorTorque(scene)
        parts = chain.parts(scene, torque, str(node))
        # Its angles are unwrapped from row to row, so rows are kept between samples.
        return MultibodySolver(scene, parts, torque, scheme, readings.chain_trajectory, rows_between=True)


def _checked(
    make: Callable[[schemes.Settings], schemes.Scheme],
    defaults: Mapping[str, object],
    scene: Scene,
    settings: Mapping[str, object],
) -> schemes.Scheme:
    """The scheme. Raises InputError for a wrong setting, MethodRefusal for a scene the engine cannot sample."""
    unknown = [name for name in settings if name not in defaults]
    if unknown:
        raise InputError([f"setting {name}: not known here; allowed: {', '.join(defaults)}" for name in unknown])
    if scene.duration / (scene.samples - 1) < _SHORTEST_INTERVAL:
        raise MethodRefusal(f"Exudyn cannot tell samples less than {_SHORTEST_INTERVAL:g} s apart")
    scheme = make({**defaults, **settings})
    if scheme.step is not None and scene.duration / scheme.step > _MOST_STEPS:
        raise InputError(f"setting step: {scheme.step:g} s makes more than {_MOST_STEPS:g} steps")
    return scheme


_NEWTON = {"newton_relative_tolerance": 1e-8, "newton_absolute_tolerance": 1e-10}

METHODS: dict[str, Method] = {
    "exudyn_tree/rk44": TreeMethod(schemes.rk44, {"step": 2.5e-4}),
    "exudyn_tree/rk67": TreeMethod(schemes.rk67, {"step": 6.7e-4}),
    "exudyn_tree/dopri5": TreeMethod(
        schemes.dopri5, {"relative_tolerance": 0.0, "absolute_tolerance": 1e-11, "trial_steps": 10_000}
    ),
    "exudyn_tree/generalized_alpha": TreeMethod(
        schemes.generalized_alpha, {"step": 2.5e-4, "spectral_radius": 0.9, **_NEWTON}
    ),
    "exudyn_chain/generalized_alpha": ChainMethod(
        schemes.generalized_alpha, {"step": 5e-4, "spectral_radius": 0.9, "node": "euler_parameters", **_NEWTON}
    ),
    "exudyn_chain/newmark_index2": ChainMethod(
        schemes.newmark_index2, {"step": 2.5e-4, "node": "euler_parameters", **_NEWTON}
    ),
}
