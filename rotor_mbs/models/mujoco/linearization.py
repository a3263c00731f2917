"""The model linearized from the engine's accelerations, by central differences extrapolated to a step of none."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from rotor_mbs.models.mujoco import mjcf
from rotor_mbs.models.mujoco.adapter import Engine
from rotor_mbs.models.mujoco.timetable import segments
from rotor_mbs.scenario.scene import Scene
from rotor_mbs.solution.linearization import Linearization
from rotor_mbs.solution.trajectory import Array

# rad, rad/s: the steps. The error is a power series of the step's square: each takes two orders of it away.
_STEPS = (1e-3, 2e-3, 4e-3, 8e-3)


def linearize(scene: Scene, angles: Sequence[float] | Array, speed: float, torque: float) -> Linearization:
    """About `angles` (1 + blades,) rad, the rotor turning at `speed` rad/s under `torque` N m.

    Raises MethodRefusal, with the engine's reason, where the engine does not take the scene.
    """
    state = replace(
        scene,
        initial_angles=tuple(float(angle) for angle in angles),
        initial_rates=(speed, *(0.0 for _ in scene.blades)),
        rotor_torque=((0.0, torque),) if torque else (),
        outputs=("angles",),
    )
    columns = list(mjcf.moving(state))
    engine = Engine(mjcf.text(mjcf.model(state, "rk4", 1e-3)), mjcf.LEAST)
    here = np.concatenate([np.array(values)[columns] for values in (state.initial_angles, state.initial_rates)])
    n = len(columns)
    loads = np.array(segments(state)[0].at(0.0))

    def accelerations(states: Array) -> Array:
        return engine.poses(states[:, :n], states[:, n:], np.tile(loads, (len(states), 1))).acceleration

    unit = np.eye(2 * n)
    quotients = [(accelerations(here + h * unit) - accelerations(here - h * unit)).T / (2.0 * h) for h in _STEPS]
    for power in range(1, len(_STEPS)):
        weight = 4.0**power
        quotients = [(weight * quotients[k] - quotients[k + 1]) / (weight - 1.0) for k in range(len(quotients) - 1)]
    return Linearization(-quotients[0][:, :n], -quotients[0][:, n:], accelerations(here[None])[0])
