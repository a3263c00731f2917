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
from rotor_mbs.models.lagrange.ensemble_samples import Block
from rotor_mbs.models.lagrange.heyoka_adapter import Parameters, array_of, failure, heyoka
from rotor_mbs.models.lagrange.parameters import RotorForm, rotor_form
from rotor_mbs.models.lagrange.system import build_system, set_parameters
from rotor_mbs.models.lagrange.torque import stretches
from rotor_mbs.scenario.scene import Scene
from rotor_mbs.trajectory.record import Array, Integration

# Unrolled code is fastest, but its compile time grows with the number of blades (and with the lanes).
_UNROLLED_BLADES = 4


class _Ready(threading.local):
    """Compiled integrators, which hold a state: each thread has its own."""

    def __init__(self) -> None:
        self.integrators: dict[tuple[tuple[int, ...], float], Any] = {}


_ready = _Ready()


@dataclass(frozen=True)
class _Machine:
    """What runs of one machine share: the equations' structure, their numbers, and the energies' coefficients."""

    structure: tuple[int, ...]
    parameters: Array
    form: RotorForm
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
        group, first = [scenes[i] for i in numbers], machines[numbers[0]]
        if not first.is_smooth:
            for i in numbers:
                ensemble_samples.put_single(block, i, _single(scenes[i], tolerance))
            continue
        parameters = np.stack([machines[i].parameters for i in numbers], axis=1)
        states, words = _propagate(group, first, parameters, tolerance)
        forms = [machines[i].form for i in numbers]
        ensemble_samples.put_states(block, numbers, group, forms, first.moving, states, words)
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
    form = rotor_form(scene, parameters)
    torque = stretches(scene)[0].offset
    parameters(torque)
    has_work = scene.wants("energy") and scene.has_damping
    equations = 2 * (1 + len(form.blades)) + has_work
    return _Machine(
        (*parameters.structure, equations),
        array_of(parameters.values, quad=False),
        rotor_form(scene),
        (0, *(1 + i for i in form.moving)),
        scene.has_constant_torque,
    )


def _groups(machines: Sequence[_Machine]) -> Iterator[list[int]]:
    """Numbers of the runs of each structure, in order."""
    found: dict[tuple[object, ...], list[int]] = {}
    for i, machine in enumerate(machines):
        found.setdefault((machine.structure, machine.moving, machine.is_smooth), []).append(i)
    yield from found.values()


def _single(scene: Scene, tolerance: float) -> Any:
    """A torque that changes is integrated piece by piece, which runs in one batch would do at different times."""
    return solve("lagrange/taylor", taylor, scene, {"tolerance": tolerance})


def _compiled(structure: tuple[int, ...], tolerance: float, example: Scene) -> Any:
    """The integrator of this structure, compiled once per machine (engine's cache on disk), made once per thread."""
    cache = _ready.integrators
    if (structure, tolerance) not in cache:
        engine = heyoka()
        system = build_system(example)
        compact = len(example.blades) > _UNROLLED_BLADES
        state = np.zeros((len(system.equations), lanes()))
        with one_at_a_time("rotor_mbs-heyoka"):
            cache[structure, tolerance] = engine.taylor_adaptive_batch(
                system.equations, state=state, tol=tolerance, compact_mode=compact, high_accuracy=True
            )
    return cache[structure, tolerance]


def _propagate(
    scenes: Sequence[Scene], machine: _Machine, parameters: Array, tolerance: float
) -> tuple[Array, list[Integration]]:
    """States (variables, runs, samples), NaN after a run broke off, and the engine's word on each run."""
    integrator = _compiled(machine.structure, tolerance, _without_start(scenes[0]))
    initial = _initial(scenes, machine.moving, integrator.state.shape[0])
    times = np.linspace(0.0, np.array([scene.duration for scene in scenes]), scenes[0].samples)
    states = np.empty((len(initial), len(scenes), scenes[0].samples))
    words: list[Integration] = []
    width = integrator.state.shape[1]
    for first in range(0, len(scenes), width):
        runs = list(range(first, min(first + width, len(scenes))))
        told = _batch(integrator, times, parameters, initial, runs, states)
        if any(word.message for word in told):
            # One lane's failure ends all lanes: each runs again with itself alone in every lane.
            told = [_batch(integrator, times, parameters, initial, [run], states)[0] for run in runs]
        words += told
    return states, words


def _batch(
    integrator: Any, times: Array, parameters: Array, initial: Array, runs: Sequence[int], states: Array
) -> list[Integration]:
    """One integration of up to as many runs as there are lanes, into `states`; spare lanes repeat the last one."""
    width = integrator.state.shape[1]
    padded = [*runs, *[runs[-1]] * (width - len(runs))]
    integrator.set_time(np.zeros(width))
    integrator.state[:] = initial[:, padded]
    set_parameters(integrator, parameters[:, padded])
    found = integrator.propagate_grid(times[:, padded])[1]
    filled = states[:, runs[0] : runs[-1] + 1]
    filled[:] = found.transpose(1, 2, 0)[:, : len(runs)]
    if not np.isfinite(filled).all():
        broken = np.maximum.accumulate(~np.isfinite(filled).all(axis=0), axis=1)
        filled[:, broken] = np.nan
    words = []
    for result in integrator.propagate_res[: len(runs)]:
        message = failure(result[0])
        words.append(Integration(not message, message, 0.0, int(result[3])))
    return words


def _initial(scenes: Sequence[Scene], moving: tuple[int, ...], variables: int) -> Array:
    columns = list(moving)
    initial = np.zeros((variables, len(scenes)))
    initial[: len(columns)] = np.array([scene.initial_angles for scene in scenes]).T[columns]
    initial[len(columns) : 2 * len(columns)] = np.array([scene.initial_rates for scene in scenes]).T[columns]
    return initial
