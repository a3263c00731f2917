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

from rotor_mbs.models.base import solve
from rotor_mbs.models.lagrange import ensemble_samples, taylor
from rotor_mbs.models.lagrange.compile_lock import one_at_a_time
from rotor_mbs.models.lagrange.derived import Derived, tip_numbers
from rotor_mbs.models.lagrange.ensemble_samples import Block
from rotor_mbs.models.lagrange.heyoka_adapter import Parameters, array_of, failure, heyoka
from rotor_mbs.models.lagrange.system import build_system, equation_numbers, set_parameters
from rotor_mbs.scenario.scene import Scene
from rotor_mbs.trajectory.record import Array, Integration

# rad. From 1e14 on a vector's sines are found in another way, which rounds those of the other lanes otherwise, too.
_HUGE = 1e13

# Unrolled code is fastest, but its compile time grows with the number of blades (and with the lanes).
_UNROLLED_BLADES = 4


class _Ready(threading.local):
    """Compiled code, which holds a state: each thread has its own."""

    def __init__(self) -> None:
        self.integrators: dict[tuple[tuple[int, ...], float], Any] = {}
        self.derived: dict[tuple[int, ...], Derived] = {}


_ready = _Ready()


@dataclass(frozen=True)
class _Machine:
    """What runs of one machine share.

    numbers     (parameters,) of the equations, then of the tips
    equations, derived   structures: machines that agree in them share compiled code
    moving      columns of the angles that move
    """

    numbers: Array
    equations: tuple[int, ...]
    derived: tuple[int, ...]
    moving: tuple[int, ...]
    is_smooth: bool


def lanes() -> int:
    """Runs side by side: one vector register's. Two are a fifth slower, and take three times as long to compile."""
    return int(heyoka().recommended_simd_size())


def solve_many(scenes: Sequence[Scene], tolerance: float) -> Block:
    """Runs of all `scenes`, which have the same number of blades and samples and the same outputs.

    Raises MethodRefusal where heyoka is not installed. A run that breaks off is in the result, cut and with its reason.
    """
    machines = _machines(scenes)
    block = ensemble_samples.empty_block(scenes)
    for numbers in _groups(machines):
        if machines[numbers[0]].is_smooth:
            _propagate(block, [(i, scenes[i], machines[i]) for i in numbers], tolerance)
            continue
        for i in numbers:
            ensemble_samples.put_single(block, i, _single(scenes[i], tolerance))
    return block


def _machines(scenes: Sequence[Scene]) -> list[_Machine]:
    """Of every scene; scenes that differ in their starts alone share one, and are seen to do so without much ado."""
    found: dict[tuple[object, ...], _Machine] = {}
    machines = []
    for scene in scenes:
        key = (id(scene.blades), scene.gravity, scene.hub_inertia, scene.rotor_torque,
               scene.bearing_stiffness, scene.bearing_damping, scene.shaft_damping)  # fmt: skip
        if key not in found:
            found[key] = _machine(_without_start(scene))
        machines.append(found[key])
    return machines


def _without_start(scene: Scene) -> Scene:
    zeros = (0.0,) * len(scene.initial_angles)
    return replace(scene, initial_angles=zeros, initial_rates=zeros, duration=1.0, samples=2, title="", name="")


@functools.lru_cache(maxsize=512)
def _machine(scene: Scene) -> _Machine:
    parameters = Parameters()
    form, _ = equation_numbers(scene, parameters)
    has_work = scene.wants("energy") and scene.has_damping
    equations = (*parameters.structure, 2 * (1 + len(form.blades)) + has_work)
    tip_numbers(scene, parameters)
    return _Machine(
        array_of(parameters.values, quad=False),
        equations,
        (*parameters.structure, scene.wants("tip"), scene.wants("energy")),
        (0, *(1 + i for i in form.moving)),
        scene.has_constant_torque,
    )


def _groups(machines: Sequence[_Machine]) -> Iterator[list[int]]:
    """Numbers of the runs of each structure, in order."""
    found: dict[tuple[object, ...], list[int]] = {}
    for i, machine in enumerate(machines):
        key = (machine.equations, machine.derived, machine.moving, machine.is_smooth)
        found.setdefault(key, []).append(i)
    yield from found.values()


def _single(scene: Scene, tolerance: float) -> Any:
    """A torque that changes is integrated piece by piece, which runs in one batch would do at different times."""
    return solve("lagrange/taylor", taylor, scene, {"tolerance": tolerance})


def _integrator(structure: tuple[int, ...], tolerance: float, example: Scene) -> Any:
    """The integrator of this structure, compiled once per machine (engine's cache on disk), made once per thread."""
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


def _derived(structure: tuple[int, ...], example: Scene) -> Derived:
    """The same for tips and energies, which compile so fast that nobody need wait for another process."""
    cache = _ready.derived
    if structure not in cache:
        cache[structure] = Derived(example, compact=_is_compact(example))
    return cache[structure]


def _is_compact(scene: Scene) -> bool:
    return len(scene.blades) > _UNROLLED_BLADES


@dataclass(frozen=True)
class _Starts:
    """What differs between the runs of a group, a column for each.

    initial   (variables, k) state; times: (samples, k) s
    numbers   (parameters, k) of the machine, then the pitches that are held
    """

    initial: Array
    times: Array
    numbers: Array


def _propagate(block: Block, group: Sequence[tuple[int, Scene, _Machine]], tolerance: float) -> None:
    """Runs of one structure into the block: (place in it, scene, machine) of each."""
    _, first, machine = group[0]
    example = _without_start(first)
    integrator = _integrator(machine.equations, tolerance, example)
    derived = _derived(machine.derived, example)
    width = integrator.state.shape[1]
    starts = _starts(group, integrator.state.shape[0])
    for i in range(0, len(group), width):
        columns = list(range(i, min(i + width, len(group))))
        batches = [_batch(integrator, starts, columns)]
        if not batches[0].is_tame:
            # One lane's failure ends all lanes: each runs again with itself alone in every lane.
            batches = [_batch(integrator, starts, [column]) for column in columns]
        for batch in batches:
            found = derived(batch.states, starts.numbers[:, batch.columns])
            for lane, word in enumerate(batch.words):
                place, scene, _ = group[batch.columns[lane]]
                states = batch.states[:, lane]
                ensemble_samples.put_lane(block, place, scene, machine.moving, states, found[:, lane], word)


@dataclass(frozen=True)
class _Batch:
    """One integration.

    columns   of the runs, one per lane; spare lanes repeat the last
    states    (variables, lanes, samples), NaN after a run broke off
    words     the engine's word on each run
    is_tame   whether no lane can have had an effect on another
    """

    columns: list[int]
    states: Array
    words: list[Integration]
    is_tame: bool


def _batch(integrator: Any, starts: _Starts, runs: Sequence[int]) -> _Batch:
    """Up to as many runs as there are lanes."""
    width = integrator.state.shape[1]
    columns = [*runs, *[runs[-1]] * (width - len(runs))]
    initial = starts.initial[:, columns]
    integrator.set_time(np.zeros(width))
    integrator.state[:] = initial
    set_parameters(integrator, starts.numbers[:, columns])
    states = np.ascontiguousarray(integrator.propagate_grid(starts.times[:, columns])[1].transpose(1, 2, 0))
    states[:, :, 0] = initial  # which a run that fails in its first step has, too
    angles = states[: len(states) // 2]
    is_tame = bool(np.isfinite(states).all() and max(angles.max(), -angles.min()) < _HUGE)
    if not is_tame:
        states[:, np.maximum.accumulate(~np.isfinite(states).all(axis=0), axis=1)] = np.nan
    words = []
    for result in integrator.propagate_res[: len(runs)]:
        message = failure(result[0])
        words.append(Integration(not message, message, 0.0, int(result[3])))
        is_tame = is_tame and not message
    return _Batch(columns, states, words, is_tame)


def _starts(group: Sequence[tuple[int, Scene, _Machine]], variables: int) -> _Starts:
    scenes, machines = [scene for _, scene, _ in group], [machine for _, _, machine in group]
    moving = list(machines[0].moving)
    held = [i for i in range(len(scenes[0].initial_angles)) if i not in moving]
    angles = np.array([scene.initial_angles for scene in scenes]).T
    rates = np.array([scene.initial_rates for scene in scenes]).T
    initial = np.zeros((variables, len(group)))
    initial[: 2 * len(moving)] = np.concatenate([angles[moving], rates[moving]])
    times = np.linspace(0.0, np.array([scene.duration for scene in scenes]), scenes[0].samples)
    numbers = np.stack([machine.numbers for machine in machines], axis=1)
    return _Starts(initial, times, np.concatenate([numbers, angles[held]]))
