"""The model linearized from the engine's accelerations, by central differences extrapolated to a step of none."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from rotor_mbs.models.mujoco import mjcf
from rotor_mbs.models.mujoco.adapter import Engine
from rotor_mbs.scenario.scene import Scene
from rotor_mbs.solution.linearization import Linearization, limit_at_zero, scene_at
from rotor_mbs.solution.trajectory import Array

# rad, rad/s: the steps. The error is a power series of the step's square: each takes two orders of it away.
_STEPS = (1e-3, 2e-3, 4e-3, 8e-3)


def linearize(scene: Scene, angles: Sequence[float] | Array, speed: float, torque: float) -> Linearization:
    """About `angles` (1 + blades,) rad, the rotor turning at `speed` rad/s under `torque` N m.

    Raises MethodRefusal, with the engine's reason, where the engine does not take the scene.
    """
    state = scene_at(scene, angles, speed, torque)
    columns = state.moving_coordinates
    engine = Engine(mjcf.text(mjcf.model(state, "rk4", 1e-3)), mjcf.LEAST)
    here = np.concatenate([np.array(values)[columns] for values in (state.initial_angles, state.initial_rates)])
    n = len(columns)
    loads = np.array(mjcf.load_segments(state)[0].values)

    def accelerations(states: Array) -> Array:
        return engine.poses(states[:, :n], states[:, n:], np.tile(loads, (len(states), 1))).acceleration

    unit = np.eye(2 * n)
    quotients = [(accelerations(here + h * unit) - accelerations(here - h * unit)).T / (2.0 * h) for h in _STEPS]
    found = limit_at_zero(quotients, 4.0)
    return Linearization(-found[:, :n], -found[:, n:], accelerations(here[None])[0])
