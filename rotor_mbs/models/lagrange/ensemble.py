"""Many runs of lagrange/taylor at once: heyoka's batch integrator, one run per SIMD lane, one compile per structure.

A run's numbers do not depend on its neighbours in the other lanes, so that any partition of a sweep gives the same
bits. Runs in one process and one thread: processes are the parallelism.
"""

from __future__ import annotations

import functools
import threading
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from rotor_mbs.methods.solve import solve
from rotor_mbs.models.lagrange import ensemble_samples
from rotor_mbs.models.lagrange.ensemble_samples import Block
from rotor_mbs.models.lagrange.heyoka_adapter import Parameters, array_of, failure, heyoka, one_at_a_time
from rotor_mbs.models.lagrange.observables import CompiledObservables, tip_numbers
from rotor_mbs.models.lagrange.system import build_system, equation_numbers, set_parameters
from rotor_mbs.scenario.scene import Scene
from rotor_mbs.solution.record import Array, Integration

# rad. From 1e14 on a vector's sines are found in another way, which rounds those of the other lanes otherwise, too.
_HUGE = 1e13

# Samples of all runs side by side: what is worked on stays near the processor.
_AT_ONCE = 4096

# Unrolled code is fastest, but its compile time grows with the number of blades (and with the lanes).
_UNROLLED_BLADES = 4


class _Ready(threading.local):
    """Compiled code, which holds a state: each thread has its own."""

    def __init__(self) -> None:
        self.integrators: dict[tuple[tuple[int, ...], float], Any] = {}
        self.observables: dict[tuple[int, ...], CompiledObservables] = {}


_ready = _Ready()


@dataclass(frozen=True)
class _RotorNumbers:
    """What runs of one rotor share.

    numbers     (parameters,) of the equations, then of the tips
    equations, observables   structures: rotors that agree in them share compiled code
    moving      columns of the angles that move
    """

    numbers: Array
    equations: tuple[int, ...]
    observables: tuple[int, ...]
    moving: tuple[int, ...]
    is_smooth: bool


def lanes() -> int:
    """Runs side by side: one vector register's. Two are a fifth slower, and take three times as long to compile."""
    return int(heyoka().recommended_simd_size())


def solve_many(scenes: Sequence[Scene], tolerance: float) -> Block:
    """Runs of all `scenes`, which have the same number of blades and samples and the same outputs.

    Raises MethodRefusal where heyoka is not installed. A run that breaks off is in the result, cut and with its reason.
    """
    rotors = _all_numbers(scenes)
    block = ensemble_samples.empty_block(scenes)
    for numbers in _groups(rotors):
        if rotors[numbers[0]].is_smooth:
            alike = [scenes[i] for i in numbers], [rotors[i] for i in numbers]
            _propagate(block, _group(numbers, *alike, tolerance))
            continue
        for i in numbers:
            ensemble_samples.put_single(block, i, _single(scenes[i], tolerance))
    return block


def _all_numbers(scenes: Sequence[Scene]) -> list[_RotorNumbers]:
    """Of every scene; scenes of one rotor share one."""
    found: dict[tuple[object, ...], _RotorNumbers] = {}
    rotors = []
    for scene in scenes:
        key = scene.rotor_key
        if key not in found:
            found[key] = _rotor_numbers(_without_start(scene))
        rotors.append(found[key])
    return rotors


def _without_start(scene: Scene) -> Scene:
    zeros = (0.0,) * len(scene.initial_angles)
    return replace(scene, initial_angles=zeros, initial_rates=zeros, duration=1.0, samples=2, title="", name="")


@functools.lru_cache(maxsize=512)
def _rotor_numbers(scene: Scene) -> _RotorNumbers:
    parameters = Parameters()
    form, _ = equation_numbers(scene, parameters)
    has_work = scene.wants("energy") and scene.has_damping
    equations = (*parameters.structure, 2 * (1 + len(form.blades)) + has_work)
    tip_numbers(scene, parameters)
    return _RotorNumbers(
        array_of(parameters.values, quad=False),
        equations,
        (*parameters.structure, scene.wants("tip"), scene.wants("energy")),
        (0, *(1 + i for i in form.moving)),
        scene.has_constant_torque,
    )


def _groups(rotors: Sequence[_RotorNumbers]) -> Iterator[list[int]]:
    """Numbers of the runs of each structure, in order."""
    found: dict[tuple[object, ...], list[int]] = {}
    for i, rotor in enumerate(rotors):
        key = (rotor.equations, rotor.observables, rotor.moving, rotor.is_smooth)
        found.setdefault(key, []).append(i)
    yield from found.values()


def _single(scene: Scene, tolerance: float) -> Any:
    """A torque that changes is integrated segment by segment, which runs in one batch would do at different times."""
    return solve("lagrange/taylor", scene, {"tolerance": tolerance})


def _integrator(structure: tuple[int, ...], tolerance: float, example: Scene) -> Any:
    """The integrator of this structure, compiled once per computer (engine's cache on disk), made once per thread."""
    cache = _ready.integrators
    if (structure, tolerance) not in cache:
        engine = heyoka()
        system = build_system(example)
        state = np.zeros((len(system.equations), lanes()))
        with one_at_a_time("rotor_mbs-heyoka"):
            cache[structure, tolerance] = engine.taylor_adaptive_batch(
                system.equations, state=state, tol=tolerance, compact_mode=_is_compact(example), high_accuracy=True
            )
    return cache[structure, tolerance]


def _observables(structure: tuple[int, ...], example: Scene) -> CompiledObservables:
    """The same for tips and energies, which compile fast: no process waits for another."""
    cache = _ready.observables
    if structure not in cache:
        cache[structure] = CompiledObservables(example, compact=_is_compact(example))
    return cache[structure]


def _is_compact(scene: Scene) -> bool:
    return len(scene.blades) > _UNROLLED_BLADES


@dataclass(frozen=True)
class _Group:
    """Runs of one structure, and the compiled code for them.

    places, scenes   of each run, in the block
    moving      columns of the angles that move
    initial     (variables, k) state; times: (samples, k) s
    numbers     (parameters, k) of the rotor, then the pitches that are fixed
    """

    integrator: Any
    observables: CompiledObservables
    places: list[int]
    scenes: list[Scene]
    moving: tuple[int, ...]
    initial: Array
    times: Array
    numbers: Array

    def solve(self, columns: Sequence[int]) -> tuple[Array, list[Integration]]:
        """(variables, columns, samples) states, and the engine's status of each; they fill the lanes in turn."""
        width = self.integrator.state.shape[1]
        initial, times, numbers = self.initial[:, columns], self.times[:, columns], self.numbers[:, columns]
        states = np.empty((len(initial), len(columns), len(times)))
        integrations = []
        for i in range(0, len(columns), width):
            lanes = slice(i, i + width)
            self.integrator.set_time(np.zeros(width))
            self.integrator.state[:] = initial[:, lanes]
            set_parameters(self.integrator, numbers[:, lanes])
            states[:, lanes] = self.integrator.propagate_grid(times[:, lanes])[1].transpose(1, 2, 0)
            for result in self.integrator.propagate_res:
                message = failure(result[0])
                integrations.append(Integration(not message, message, 0.0, int(result[3])))
        states[:, :, 0] = initial  # which a run that fails in its first step has, too
        return states, integrations

    def put(self, block: Block, columns: Sequence[int], states: Array, integrations: Sequence[Integration]) -> None:
        """The runs of the first len(integrations) columns into the block, with their tips and energies."""
        found = self.observables(states, self.numbers[:, columns])
        runs = len(integrations)
        places, scenes = [self.places[i] for i in columns[:runs]], [self.scenes[i] for i in columns[:runs]]
        ensemble_samples.put(block, places, scenes, self.moving, states[:, :runs], found[:, :runs], integrations)


def _propagate(block: Block, group: _Group) -> None:
    """All its runs into the block."""
    width = group.integrator.state.shape[1]
    runs = len(group.scenes)
    at_once = max(_AT_ONCE // len(group.times) // width, 1) * width
    for start in range(0, runs, at_once):
        columns = list(range(start, min(start + at_once, runs)))
        padded = columns + [columns[-1]] * (-len(columns) % width)
        states, integrations = group.solve(padded)
        group.put(block, padded, states, integrations[: len(columns)])
        affected = {i // width for i in np.flatnonzero(~_are_independent(states, integrations)).tolist()}
        for i in [i for i in range(len(columns)) if i // width in affected]:
            # One lane's failure ends all lanes: each runs again with itself alone in every lane.
            alone = [columns[i]] * width
            states, integrations = group.solve(alone)
            states[:, np.maximum.accumulate(~np.isfinite(states).all(axis=0), axis=1)] = np.nan
            group.put(block, alone, states, integrations[:1])


def _are_independent(states: Array, integrations: Sequence[Integration]) -> NDArray[np.bool_]:
    """(columns,) whether a run can have had no effect on another lane's."""
    sizes = np.maximum(states.max(axis=2), -states.min(axis=2))  # NaN where a sample is
    angles = sizes[: len(sizes) // 2]
    independent = (angles < _HUGE).all(axis=0) & np.isfinite(sizes).all(axis=0)
    found: NDArray[np.bool_] = independent & np.array([integration.success for integration in integrations])
    return found


def _group(places: list[int], scenes: list[Scene], rotors: Sequence[_RotorNumbers], tolerance: float) -> _Group:
    """Of runs whose rotors have one structure."""
    first = rotors[0]
    example = _without_start(scenes[0])
    integrator = _integrator(first.equations, tolerance, example)
    moving = list(first.moving)
    fixed = [i for i in range(len(scenes[0].initial_angles)) if i not in moving]
    angles = np.array([scene.initial_angles for scene in scenes]).T
    rates = np.array([scene.initial_rates for scene in scenes]).T
    initial = np.zeros((integrator.state.shape[0], len(scenes)))
    initial[: 2 * len(moving)] = np.concatenate([angles[moving], rates[moving]])
    times = np.linspace(0.0, np.array([scene.duration for scene in scenes]), scenes[0].samples)
    numbers = np.concatenate([np.stack([rotor.numbers for rotor in rotors], axis=1), angles[fixed]])
    observables = _observables(first.observables, example)
    return _Group(integrator, observables, places, scenes, first.moving, initial, times, numbers)
