"""The engine's systems as solvers: one run, or three for Richardson extrapolation in the time step.

Steps h, h/2, h/4 eliminate the terms of h² and h⁴. The trapezoidal rule
becomes of sixth order. Generalized-α keeps its small term of h³: eliminated in place of h⁴, errors on paper/fig11
before its horizon were 8e-6 rad, for 3e-7.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from rotor_mbs.errors import InputError, MethodRefusal
from rotor_mbs.methods.base import BuiltItem, Solver
from rotor_mbs.models.exudyn import chain, geometry, sensor_samples, tree
from rotor_mbs.models.exudyn.geometry import Part
from rotor_mbs.models.exudyn.moments import Loads
from rotor_mbs.models.exudyn.schemes import Scheme, SchemeSettings
from rotor_mbs.scenario.scene import Scene
from rotor_mbs.scenario.time_table import Segment, intervals
from rotor_mbs.solution.quantities import BUILT_IN
from rotor_mbs.solution.trajectory import Array, Integration, Trajectory

Reading = Callable[[Scene, Sequence[Segment], Callable[[str], Array]], Trajectory]

# The engine takes a run as ended within 1e-10 s of its end, whatever the step.
_SHORTEST_INTERVAL = 1e-8
_MAX_STEPS = 1e9
REFINEMENTS = (1, 2, 4)

# The uncertainty is this many times the sum of three: the distance of two extrapolations, from (h, h/2) and from
# (h/2, h/4); what Newton's method leaves, which no step reduces; rounding. In scenes of the paper and of `check` the
# error is at most 0.72 of it (fig08 with a tolerance of 1e-12), with the default settings 0.10 before the horizon.
SAFETY = 4.0

# Angles are calculated from rotation matrices: some units in the last place of the largest angle.
_ROUNDING = 10.0 * float(np.finfo(float).eps)

# What a run is judged by without a reference: sizes without a sign, whose errors no step's power describes.
_DISTANCES = {quantity.name for quantity in BUILT_IN if quantity.judgement and not quantity.judgement.with_reference}


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
            "multipliers start wrong, and those of newmark_index2 stay so"
        )

    def build(refinement: int = 1) -> Solver:
        loads = Loads(scene)
        parts, finer = chain.parts(scene, loads, settings.node), replace(scheme, refinement=refinement)
        # Its angles are unwrapped from row to row, so rows are kept between samples.
        return MultibodySolver(scene, parts, loads, finer, sensor_samples.chain_trajectory, rows_between=True)

    if settings.extrapolation == "richardson":
        return ExtrapolatedSolver(build, settings.newton_relative_tolerance)
    return build()


def _scheme(scene: Scene, settings: SchemeSettings) -> Scheme:
    if scene.duration / (scene.samples - 1) < _SHORTEST_INTERVAL:
        raise MethodRefusal(f"Exudyn cannot resolve samples less than {_SHORTEST_INTERVAL:g} s apart")
    scheme = settings.scheme()
    if scheme.step is not None and scene.duration / scheme.step > _MAX_STEPS:
        raise InputError(f"setting step: {scheme.step:g} s makes more than {_MAX_STEPS:g} steps")
    return scheme


class ExtrapolatedSolver:
    """Three runs; `build` takes how many steps take the place of each, `tolerance` is that of Newton's residual."""

    def __init__(self, build: Callable[[int], Solver], tolerance: float) -> None:
        self._runs = [build(refinement) for refinement in REFINEMENTS]
        self._tolerance = tolerance
        self._integrated = 0

    def integrate(self) -> Integration:
        self._integrated = 0
        total = Integration(True, steps=0, rhs_evaluations=0, time_reached=float("inf"))
        for run in self._runs:
            part = run.integrate()
            self._integrated += 1
            total.steps = (total.steps or 0) + (part.steps or 0)
            total.rhs_evaluations = (total.rhs_evaluations or 0) + (part.rhs_evaluations or 0)
            total.time_reached = min(total.time_reached, part.time_reached)
            if not part.success:
                total = replace(total, success=False, message=part.message, out_of_time=part.out_of_time)
                break
        return total

    def observe(self) -> Trajectory:
        """As far as the shortest run got; the initial state alone where a run was not begun."""
        runs = [run.observe() for run in self._runs[: self._integrated]]
        rows = min(len(run.time) for run in runs)
        if len(runs) < len(self._runs):
            rows, runs = 1, [*runs, runs[-1], runs[-1]][: len(self._runs)]
        cut = []
        for run in runs:
            arrays = {"time": run.time, "angles": run.angles, "rates": run.rates, **run.quantities}
            cut.append(Trajectory(**{name: values[:rows] for name, values in arrays.items()}))
        return extrapolated(cut, self._tolerance)


def extrapolated(runs: list[Trajectory], tolerance: float) -> Trajectory:
    """Every quantity of runs with steps h, h/2, h/4 extrapolated to step zero; distances such as the joints' gaps are
    the finest run's. `tolerance` is relative, of Newton's residual."""
    coarse, middle, fine = runs
    distance = np.abs(
        _eliminated(middle.angles, fine.angles, 4.0) - _eliminated(coarse.angles, middle.angles, 4.0)
    ).max(axis=1)
    largest = np.maximum(np.abs(fine.angles).max(axis=1), 1.0)
    names = {"angles", "rates", *fine.quantities} - _DISTANCES
    arrays = {}
    for name in names:
        first, second, third = (getattr(run, name) for run in runs)
        arrays[name] = _eliminated(_eliminated(first, second, 4.0), _eliminated(second, third, 4.0), 16.0)
    arrays["angle_uncertainty"] = SAFETY * np.maximum.accumulate(distance + (tolerance + _ROUNDING) * largest)
    return fine.replace(**arrays)


def _eliminated(coarse: Array, fine: Array, ratio: float) -> Array:
    return fine + (fine - coarse) / (ratio - 1.0)
