"""Integrate the rotor in MuJoCo from sample to sample, compute its outputs, and linearize it.

No other module imports MuJoCo.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, NamedTuple

import mujoco
import numpy as np

from rotor_mbs.errors import MethodRefusal
from rotor_mbs.methods import time_limit
from rotor_mbs.models.mujoco import mjcf
from rotor_mbs.scenario.scene import Scene
from rotor_mbs.scenario.time_table import (
    Interval,
    Segment,
    intervals,
    is_constant,
    steps_and_rows,
    values_at,
)
from rotor_mbs.solution.quantities import named_loads
from rotor_mbs.solution.trajectory import (
    Array,
    Integration,
    Linearization,
    Trajectory,
    all_coordinates,
    finite_samples,
    limit_at_zero,
    sample_times,
    scene_at,
)

# The engine is a compiled module, and is not type-checked. Without a handler of warnings it writes
# its warnings to a file in the working folder.
_engine: Any = mujoco
_engine.set_mju_user_warning(lambda _message: None)

# The engine's warnings about positions, velocities and accelerations that are huge or not finite.
_BAD_STATE_WARNINGS = (
    _engine.mjtWarning.mjWARN_BADQPOS,
    _engine.mjtWarning.mjWARN_BADQVEL,
    _engine.mjtWarning.mjWARN_BADQACC,
)

# Largest number of steps in one call of the engine. Such a call takes a few hundredths of a second.
# Neither signals nor the time limit are checked during a call.
_PORTION = 10_000


@dataclass
class Poses:
    """Hold the motion of all bodies and sites at n states.

    The world body is left out.

    Attributes
    ----------
    centre : (n, bodies, 3) m, centres of mass in the world frame.
    velocity : (n, bodies, 3) m/s, velocities of the centres of mass, along the principal axes.
    spin : (n, bodies, 3) rad/s, angular velocities, along the principal axes.
    site : (n, sites, 3) m, positions of the sites in the world frame.
    acceleration : (n, coordinates) rad/s², accelerations of the coordinates.
    frame : (n, bodies, 3, 3) rotations from the body's frame to the world frame.
    wrench : (n, bodies, 6) moment (N m) about the world's origin, then force (N), that the body's
        parent exerts on the body, in the world frame.
    """

    centre: Array
    velocity: Array
    spin: Array
    site: Array
    acceleration: Array
    frame: Array
    wrench: Array


class Engine:
    """Hold the compiled model of a scene, and its state.

    Masses and moments of inertia that are `mjcf.LEAST` in the text are zero in the model.
    """

    def __init__(self, scene: Scene, integrator: str, step: float) -> None:
        """Compile the model.

        Parameters
        ----------
        scene, integrator, step : as for `mjcf.model`.

        Raises
        ------
        MethodRefusal
            If MuJoCo rejects the model. The message has MuJoCo's reason.
        """
        try:
            self._model = _engine.MjModel.from_xml_string(
                mjcf.text(mjcf.model(scene, integrator, step))
            )
        except ValueError as exc:
            raise MethodRefusal(
                f"MuJoCo rejected this model: {' '.join(str(exc).split())[:300]}"
            ) from exc
        for values in (self._model.body_mass, self._model.body_inertia):
            values[values <= mjcf.LEAST] = 0.0
        self._data = _engine.MjData(self._model)
        self.masses: Array = np.array(self._model.body_mass[1:])
        self.moments: Array = np.array(self._model.body_inertia[1:])

    def start(self, angles: Sequence[float], rates: Sequence[float]) -> None:
        """Set the initial state, and clear what is left of an earlier run.

        Parameters
        ----------
        angles, rates : (coordinates,) rad and rad/s.
        """
        _engine.mj_resetData(self._model, self._data)
        self._data.qpos[:], self._data.qvel[:] = angles, rates

    def advance(
        self, step: float, steps: int, loads: Sequence[float], slopes: Sequence[float]
    ) -> tuple[int, str]:
        """Take equal steps from the present state.

        Parameters
        ----------
        step : s.
        steps : number of steps.
        loads, slopes : (actuators,) activation of each actuator at the start (N m or rad), and its
            slope (N m/s or rad/s).

        Returns
        -------
        taken : int
            Number of steps taken.
        message : str
            The reason if not all steps were taken: the time limit, or a state that is not finite.
            Otherwise "".
        """
        model, data = self._model, self._data
        model.opt.timestep = step
        # The engine integrates activations with the state, so that a load is right at every stage
        # of a step.
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
                        last = data.warning[warning].lastinfo
                        return taken, f"MuJoCo: {_engine.mju_warningText(warning, last)}"
                return taken, "MuJoCo: the state is not finite"
        return taken, ""

    @property
    def state(self) -> tuple[Array, Array]:
        """Return angles and rates, (coordinates,) rad and rad/s: the engine's own arrays."""
        return self._data.qpos, self._data.qvel

    def poses(self, angles: Array, rates: Array, loads: Array) -> Poses:
        """Return the motion of bodies and sites at given states.

        Parameters
        ----------
        angles, rates : (n, coordinates) rad and rad/s.
        loads : (n, actuators) activations, N m or rad.
        """
        rows = [self._pose(*state) for state in zip(angles, rates, loads, strict=True)]
        fields = [np.array(values) for values in zip(*rows, strict=True)]
        return Poses(*fields)

    def _pose(self, angles: Array, rates: Array, loads: Array) -> tuple[Array, ...]:
        """Return the fields of `Poses` at one state.

        Parameters
        ----------
        angles, rates : (coordinates,) rad and rad/s.
        loads : (actuators,) activations, N m or rad.
        """
        model, data = self._model, self._data
        data.qpos[:], data.qvel[:], data.act[:] = angles, rates, loads
        _engine.mj_forward(model, data)
        motion = np.empty((model.nbody - 1, 6))
        for body, velocity in enumerate(motion, start=1):
            _engine.mj_objectVelocity(model, data, _engine.mjtObj.mjOBJ_BODY, body, velocity, 1)
        # These arrays are copied, because the engine overwrites them at the next state.
        centres, sites = data.xipos[1:].copy(), data.site_xpos.copy()
        accelerations = data.qacc.copy()
        frames = data.xmat[1:].reshape(-1, 3, 3).copy()
        # The engine's moments are about the centre of mass of a body's whole tree. They are changed
        # to moments about the world's origin.
        _engine.mj_rnePostConstraint(model, data)
        wrench = np.array(data.cfrc_int[1:])
        wrench[:, :3] += np.cross(data.subtree_com[model.body_rootid[1:]], wrench[:, 3:])
        velocities, spins = motion[:, 3:], motion[:, :3]
        return centres, velocities, spins, sites, accelerations, frames, wrench


# Steps of the central difference quotients in `linearize`, rad and rad/s. The error of a quotient
# is a power series of the square of the step.
_STEPS = (1e-3, 2e-3, 4e-3, 8e-3)

# Number of evaluations of the equations of motion in a step, by integrator.
_STAGES = {"rk4": 4, "implicitfast": 1, "implicit": 1}


class _Row(NamedTuple):
    """Hold a state of the run.

    At a kink or jump of a load there are two rows: one with the segment before it, and one with the
    segment after it.

    Attributes
    ----------
    time : s.
    angles, rates : (coordinates,) rad and rad/s.
    segment : the segment with the loads.
    is_sample : whether the row is a sample.
    """

    time: float
    angles: Array
    rates: Array
    segment: Segment
    is_sample: bool


class MujocoSolver:
    """Integrate a scene by one of MuJoCo's integrators; see `methods.base.Solver`."""

    def __init__(self, scene: Scene, integrator: str, step: float) -> None:
        """Build the model.

        Parameters
        ----------
        scene : the run.
        integrator : a key of `mjcf.INTEGRATORS`.
        step : s, the largest time step.

        Raises
        ------
        MethodRefusal
            If MuJoCo rejects the model.
        """
        self._scene, self._step, self._stages = scene, step, _STAGES[integrator]
        self._moving = scene.moving_coordinates
        self._loads = mjcf.loads_of(scene)
        self._intervals = intervals(scene.load_segments, scene.samples, every_sample=True)
        self._rows_between = scene.work_needs_path
        self._rows: list[_Row] = []
        self.engine = Engine(scene, integrator, step)

    def integrate(self) -> Integration:
        """Integrate from the initial state to the end, or to the first failure."""
        self._rows = []
        initial_angles, initial_rates = self._scene.initial_angles, self._scene.initial_rates
        self.engine.start(
            [initial_angles[i] for i in self._moving], [initial_rates[i] for i in self._moving]
        )
        self._keep(0.0, self._intervals[0].segment, is_sample=True)
        steps, message = 0, ""
        with time_limit.samples_kept_at_limit():
            for interval in self._intervals:
                if interval.segment is not self._rows[-1].segment:
                    self._keep(interval.start, interval.segment, is_sample=False)
                taken, message = self._advance(interval)
                steps += taken
                if message:
                    break
        out_of_time = message == time_limit.MESSAGE
        return Integration(
            not message, message, self._rows[-1].time, steps, steps * self._stages, out_of_time
        )

    def _advance(self, interval: Interval) -> tuple[int, str]:
        """Integrate over one interval.

        Parameters
        ----------
        interval : the interval, on which all loads are linear.

        Returns
        -------
        taken : int
            Number of steps taken.
        message : str
            The reason if the end of the interval was not reached; otherwise "".
        """
        span, segment = interval.end - interval.start, interval.segment
        steps, count = steps_and_rows(span, self._step, self._rows_between)
        slopes = [load.control(segment) for load in self._loads]
        total = 0
        for row in range(1, count + 1):
            loads = self._activations(segment, interval.start + span * (row - 1) / count)
            taken, message = self.engine.advance(span / steps, steps // count, loads, slopes)
            total += taken
            if message:
                return total, message
            time = interval.end if row == count else interval.start + span * row / count
            self._keep(time, segment, interval.ends_at_sample and row == count)
        return total, ""

    def _activations(self, segment: Segment, time: float) -> list[float]:
        """Return the activations of all actuators (N m or rad) at a time (s) of a segment."""
        return [load.activation(segment, time) for load in self._loads]

    def _keep(self, time: float, segment: Segment, is_sample: bool) -> None:
        """Keep the engine's state as a row."""
        angles, rates = self.engine.state
        self._rows.append(_Row(time, angles.copy(), rates.copy(), segment, is_sample))

    def observe(self) -> Trajectory:
        """Return the samples of the last integration."""
        scene, rows = self._scene, self._rows
        angles, rates = (
            np.array([row.angles for row in rows]),
            np.array([row.rates for row in rows]),
        )
        at = [i for i, row in enumerate(rows) if row.is_sample]
        fields: dict[str, Array] = {}
        fields["angles"], fields["rates"] = all_coordinates(scene, angles[at], rates[at])
        # The energies of a diverging state may overflow. The samples end before the first that is
        # not finite.
        with np.errstate(over="ignore", invalid="ignore"):
            if {"tip", "energy", "loads"} & set(scene.outputs):
                values = np.array([self._activations(row.segment, row.time) for row in rows])
                poses = self.engine.poses(angles, rates, values)
            if scene.wants("tip"):
                fields["tip"] = poses.site[at]
            if scene.wants("energy"):
                masses, moments = self.engine.masses, self.engine.moments
                twice = masses[:, None] * poses.velocity**2 + moments * poses.spin**2
                # Potential energy of the weights: zero at the height of the apex.
                weights = scene.gravity * (poses.centre[:, :, 2] @ masses)
                springs, of_rests = _springs(scene, fields["angles"])
                work = self._work(angles, rates, poses.acceleration, values)
                fields["kinetic_energy"] = 0.5 * twice.sum(axis=(1, 2))[at]
                fields["potential_energy"] = weights[at] + springs
                fields["work"] = work[at] + of_rests
            if scene.wants("loads"):
                for name, loads in self._root_loads(poses, values).items():
                    fields[name] = loads[at]
        return finite_samples(scene, fields)

    def _root_loads(self, poses: Poses, values: Array) -> dict[str, Array]:
        """Return the loads at roots and shaft in all rows, by name of the quantity.

        The loads are what the parent of each body exerts on the body. The shaft moment is without
        the rotor torque. The moment of a pitch actuator is the root moment about the pitch axis.

        Parameters
        ----------
        poses : motion and loads of the bodies in all rows.
        values : (rows, actuators) activations, N m or rad.
        """
        moment, force = poses.wrench[:, :, :3], poses.wrench[:, :, 3:]
        # Force and moment of each blade in its own frame. The first body, the hub, is left out.
        root_forces = np.einsum("nbij,nbi->bnj", poses.frame, force)[1:]
        root_moments = np.einsum("nbij,nbi->bnj", poses.frame, moment)[1:]
        if self._scene.hub_radius:  # the moments are changed from the apex to the root
            root_moments = root_moments - np.cross([0.0, 0.0, self._scene.hub_radius], root_forces)
        shaft_moment = moment[:, 0].copy()
        if self._scene.has_torque:
            torque = values[:, 0]  # the first load of `mjcf.loads_of`
            if self._scene.shaft_tilt:
                # along the hub's own y axis
                shaft_moment -= torque[:, None] * poses.frame[:, 0, :, 1]
            else:
                shaft_moment[:, 1] -= torque
        has_hinge = np.isin(np.arange(1, 1 + len(self._scene.blades)), self._moving)
        actuators = np.where(has_hinge, root_moments[:, :, 2].T, 0.0)
        return named_loads(
            zip(root_forces, root_moments, strict=True), force[:, 0], shaft_moment, actuators
        )

    def _work(self, angles: Array, rates: Array, accelerations: Array, values: Array) -> Array:
        """Compute the work of the actuators minus the energy that the dampers dissipate, (rows,) J.

        If loads are constant and there are no dampers, the work is torque times angle. Otherwise
        the power P is integrated from row to row by ∫ P dt ≈ h (P₀ + P₁)/2 + h² (P₀' - P₁')/12.
        This quadrature is of order 4, like rk4, the integrator of the highest order here.

        Parameters
        ----------
        angles, rates, accelerations : (rows, coordinates) rad, rad/s and rad/s².
        values : (rows, actuators) activations, N m or rad.
        """
        columns = [self._moving.index(load.coordinate) for load in self._loads]
        gains = np.array([load.gain for load in self._loads])
        torques = gains * values
        if not self._scene.work_needs_path:
            turned = angles[:, columns] - angles[:1, columns]
            return np.asarray((torques * turned).sum(axis=1))
        dampings = np.array(self._scene.dampings)[self._moving]
        controls = [[load.control(row.segment) for load in self._loads] for row in self._rows]
        slopes = gains * np.array(controls).reshape(values.shape)
        power = (torques * rates[:, columns]).sum(axis=1)
        power = power - (dampings * rates**2).sum(axis=1)
        # Time derivative of the power.
        change = (slopes * rates[:, columns] + torques * accelerations[:, columns]).sum(axis=1)
        change -= 2.0 * (dampings * rates * accelerations).sum(axis=1)
        # Where two segments meet, two rows have the same time. The time between them is zero.
        h = np.diff([row.time for row in self._rows])
        trapezoids = 0.5 * h * (power[1:] + power[:-1])
        parts = trapezoids + h * h / 12.0 * (change[:-1] - change[1:])
        return np.concatenate([[0.0], np.cumsum(parts)])


def _springs(scene: Scene, angles: Array) -> tuple[Array, Array]:
    """Compute the energy of the springs, and the work of rest angles that actuators leave out.

    The work of a rest angle r that changes is -∫ k (θ - r) dr. The work of its actuator is
    ∫ k r dθ. The difference of the two is the change of ½ k r (r - 2θ).

    Parameters
    ----------
    scene : the rotor.
    angles : (n, 1 + blades) rad, at the first n samples.

    Returns
    -------
    energy : ndarray, shape (n,)
        Energy of the springs, J.
    work : ndarray, shape (n,)
        Work to be added to that of the actuators, J.
    """
    energy, work = np.zeros((2, len(angles)))
    for number in scene.moving_coordinates[1:]:
        stiffness, _ = scene.bearings[number - 1]
        _, table = scene.pitch_loads[number - 1]
        if stiffness:
            rest = values_at(table, sample_times(scene)[: len(angles)])
            energy += 0.5 * (stiffness * (angles[:, number] - rest) ** 2)
            if not is_constant(table):
                moved = 0.5 * stiffness * rest * (rest - 2.0 * angles[:, number])
                work += moved - moved[0]
    return energy, work


def linearize(
    scene: Scene, angles: Sequence[float] | Array, speed: float, torque: float
) -> Linearization:
    """Linearize the model by difference quotients of the engine's accelerations.

    Parameters
    ----------
    scene : the rotor. Its loads have their values at t = 0.
    angles : (1 + blades,) rad.
    speed : rate of the rotor, rad/s.
    torque : constant torque on the rotor, N m.

    Raises
    ------
    MethodRefusal
        If MuJoCo rejects the model.
    """
    state = scene_at(scene, angles, speed, torque)
    columns = state.moving_coordinates
    engine = Engine(state, "rk4", 1e-3)
    initial_angles, initial_rates = np.array(state.initial_angles), np.array(state.initial_rates)
    here = np.concatenate([initial_angles[columns], initial_rates[columns]])
    n = len(columns)
    first = state.load_segments[0]
    loads = np.array([load.activation(first, first.start) for load in mjcf.loads_of(state)])

    def accelerations(states: Array) -> Array:
        applied = np.tile(loads, (len(states), 1))
        return engine.poses(states[:, :n], states[:, n:], applied).acceleration

    unit = np.eye(2 * n)
    quotients = []
    for step in _STEPS:
        difference = accelerations(here + step * unit) - accelerations(here - step * unit)
        quotients.append(difference.T / (2.0 * step))
    slopes = limit_at_zero(quotients, 4.0)
    return Linearization(-slopes[:, :n], -slopes[:, n:], accelerations(here[None])[0])
