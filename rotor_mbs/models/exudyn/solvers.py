"""The engine's systems as solvers."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any

import numpy as np

from rotor_mbs.errors import MethodRefusal
from rotor_mbs.methods.base import BuiltItem, Solver
from rotor_mbs.models.exudyn import chain, geometry, sensor_samples, tree
from rotor_mbs.models.exudyn.extrapolation import ExtrapolatedSolver
from rotor_mbs.models.exudyn.geometry import Part
from rotor_mbs.models.exudyn.moments import Loads
from rotor_mbs.models.exudyn.schemes import ExtrapolatedSettings, Scheme, SchemeSettings
from rotor_mbs.scenario.scene import Scene
from rotor_mbs.scenario.time_table import Segment, intervals
from rotor_mbs.solution.trajectory import Array, Integration, Trajectory

Reading = Callable[[Scene, Sequence[Segment], Callable[[str], Array]], Trajectory]

# The engine takes a run as ended within 1e-10 s of its end, whatever the step.
_SHORTEST_INTERVAL = 1e-8


def tree_items(scene: Scene) -> list[BuiltItem]:
    return geometry.items(tree.parts(scene, Loads(scene)))


def chain_items(scene: Scene) -> list[BuiltItem]:
    return geometry.items(chain.parts(scene, Loads(scene)))


class MultibodySolver:
    """See `methods.base.Solver`; `reading` makes the trajectory from recorded rows, for which it may need
    `rows_between` samples. Raises MethodRefusal, with the engine's reason, where the engine does not take the parts."""

    def __init__(
        self,
        scene: Scene,
        parts: Sequence[Part],
        loads: Loads,
        scheme: Scheme,
        reading: Reading,
        rows_between: bool,
    ) -> None:

        self._scene, self._loads, self._scheme, self._reading = scene, loads, scheme, reading
        self._rows_between = rows_between
        self._intervals = intervals(loads.segments, scene.samples, every_sample=scheme.step is None)
        from rotor_mbs.models.exudyn.adapter import System  # late: to list what is built needs no engine

        self.system = System(parts)

    def integrate(self) -> Integration:
        return self.system.integrate(self._scheme, self._intervals, self._rows_between, self._loads.enter)

    def observe(self) -> Trajectory:
        # A diverging state may overflow in its energies; the rows are cut where they stop being finite.
        with np.errstate(over="ignore", invalid="ignore"):
            return self._reading(self._scene, self._loads.segments, self.system.rows)


def build_tree(scene: Scene, settings: SchemeSettings) -> Solver:

    scheme, loads = _scheme(scene, settings), Loads(scene)
    if scene.wants("loads"):
        scheme = scheme.with_accelerations()
    between = scene.wants("energy") and scene.work_needs_path
    return MultibodySolver(scene, tree.parts(scene, loads), loads, scheme, sensor_samples.tree_trajectory, between)


def build_chain(scene: Scene, settings: Any) -> Solver:

    scheme = _scheme(scene, settings)
    if scene.wants("loads") and settings.node == "rotation_vector":
        raise MethodRefusal(
            "exudyn_chain: loads need the setting node = euler_parameters: with rotation_vector the engine's "
            "first multipliers are wrong, and those of newmark_index2 remain wrong"
        )

    loads = Loads(scene)
    parts = chain.parts(scene, loads, settings.node)
    # Its angles are unwrapped from row to row, so rows are kept between samples.
    return MultibodySolver(scene, parts, loads, scheme, sensor_samples.chain_trajectory, rows_between=True)


def build_extrapolated(scene: Scene, settings: ExtrapolatedSettings) -> Solver:

    return ExtrapolatedSolver(scene, _scheme(scene, settings), settings.tolerance)


def _scheme(scene: Scene, settings: SchemeSettings | ExtrapolatedSettings) -> Scheme:
    if scene.duration / (scene.samples - 1) < _SHORTEST_INTERVAL:
        raise MethodRefusal(f"Exudyn cannot resolve samples less than {_SHORTEST_INTERVAL:g} s apart")
    return settings.scheme()
