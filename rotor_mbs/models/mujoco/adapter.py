"""The one place that imports MuJoCo: compiles a model, advances it, reads poses and velocities."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import mujoco
import numpy as np

from rotor_mbs.errors import MethodRefusal
from rotor_mbs.methods import time_limit
from rotor_mbs.solution.trajectory import Array

# The engine's types are compiled. Without this, it writes its warnings to a file in the working folder.
_engine: Any = mujoco
_engine.set_mju_user_warning(lambda _message: None)

# Of positions, velocities and accelerations that are not finite or huge.
_BAD_STATE_WARNINGS = (
    _engine.mjtWarning.mjWARN_BADQPOS,
    _engine.mjtWarning.mjWARN_BADQVEL,
    _engine.mjtWarning.mjWARN_BADQACC,
)

# Steps in one call, a few hundredths of a second: the engine looks for no signal and no time limit in between.
_PORTION = 10_000


@dataclass
class Poses:
    """Every body and site at n states, world frame; world body left out."""

    centre: Array  # (n, bodies, 3) m, centres of mass
    velocity: Array  # (n, bodies, 3) m/s, of the centres of mass
    spin: Array  # (n, bodies, 3) rad/s, along the principal axes
    site: Array  # (n, sites, 3) m
    acceleration: Array  # (n, coordinates) rad/s²
    frame: Array  # (n, bodies, 3, 3) body's frame to world frame
    # (n, bodies, 6) N m and N, world frame: moment about its origin and force of a body's parent on the body
    wrench: Array


class Engine:
    """A compiled model and its state; masses and moments of `least` or less are then set to zero. Raises MethodRefusal,
    with MuJoCo's reason, where it does not take the model."""

    def __init__(self, mjcf: str, least: float) -> None:
        try:
            self._model = _engine.MjModel.from_xml_string(mjcf)
        except ValueError as exc:
            raise MethodRefusal(f"MuJoCo does not take this model: {' '.join(str(exc).split())[:300]}") from exc
        for values in (self._model.body_mass, self._model.body_inertia):
            values[values <= least] = 0.0
        self._data = _engine.MjData(self._model)
        self.masses: Array = np.array(self._model.body_mass[1:])
        self.moments: Array = np.array(self._model.body_inertia[1:])

    def start(self, angles: Sequence[float], rates: Sequence[float]) -> None:
        """To the initial state, (coordinates,) rad and rad/s; nothing of an earlier run is left."""
        _engine.mj_resetData(self._model, self._data)
        self._data.qpos[:], self._data.qvel[:] = angles, rates

    def advance(self, step: float, steps: int, loads: Sequence[float], slopes: Sequence[float]) -> tuple[int, str]:
        """Takes equal steps of `step` s, each actuator's activation (N m or rad) at the start and its slope per s
        given; the steps taken, and why it ended before all were: time limit, a state that is not finite, ""."""
        model, data = self._model, self._data
        model.opt.timestep = step
        if loads:
            data.act[:], data.ctrl[:] = loads, slopes
        taken = 0
        while taken < steps:
            if time_limit.is_over():
                return taken, time_limit.MESSAGE
            portion = min(steps - taken, _PORTION)
            _engine.mj_step(model, data, nstep=portion)
            taken += portion
            if not (np.isfinite(data.qpos).all() and np.isfinite(data.qvel).all()):
                for warning in _BAD_STATE_WARNINGS:
                    if data.warning[warning].number:
                        return taken, f"MuJoCo: {_engine.mju_warningText(warning, data.warning[warning].lastinfo)}"
                return taken, "MuJoCo: the state is not finite"
        return taken, ""

    @property
    def state(self) -> tuple[Array, Array]:
        return self._data.qpos, self._data.qvel

    def poses(self, angles: Array, rates: Array, loads: Array) -> Poses:
        """At given states, (n, coordinates) rad and rad/s, (n, actuators) N m or rad."""
        rows = [self._pose(*state) for state in zip(angles, rates, loads, strict=True)]
        return Poses(*map(np.array, zip(*rows, strict=True)))

    def _pose(self, angles: Array, rates: Array, loads: Array) -> tuple[Array, ...]:
        model, data = self._model, self._data
        data.qpos[:], data.qvel[:], data.act[:] = angles, rates, loads
        _engine.mj_forward(model, data)
        motion = np.empty((model.nbody - 1, 6))
        for body, velocity in enumerate(motion, start=1):
            _engine.mj_objectVelocity(model, data, _engine.mjtObj.mjOBJ_BODY, body, velocity, 1)
        centres, sites = data.xipos[1:].copy(), data.site_xpos.copy()
        accelerations, frames = data.qacc.copy(), data.xmat[1:].reshape(-1, 3, 3).copy()
        # The engine gives moments about the centre of mass of a body's whole tree.
        _engine.mj_rnePostConstraint(model, data)
        wrench = np.array(data.cfrc_int[1:])
        wrench[:, :3] += np.cross(data.subtree_com[model.body_rootid[1:]], wrench[:, 3:])
        return centres, motion[:, 3:], motion[:, :3], sites, accelerations, frames, wrench
