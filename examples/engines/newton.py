"""The rotor in Newton: its Featherstone solver on the CPU, semi-implicit Euler of order 1 in single
precision.

pip install newton             # tried with newton 1.8.0
rotor-mbs run paper/fig11 -m ./newton.py
"""

from dataclasses import dataclass

import newton
import numpy as np
import warp

from rotor_mbs.errors import MethodRefusal
from rotor_mbs.methods.base import Method, Settings
from rotor_mbs.methods.settings import step
from rotor_mbs.scenario.accuracy_bounds import Bound
from rotor_mbs.scenario.time_table import intervals
from rotor_mbs.solution.trajectory import Integration, Trajectory, sample_times


@dataclass(frozen=True)
class Step(Settings):
    step: float = step(1e-3)


def turn(axis, angle):
    return warp.quat_from_axis_angle(warp.vec3(*axis), angle)


class Solver:
    def __init__(self, scene, settings):
        if not all(blade.has_pitch_inertia for blade in scene.blades):
            raise MethodRefusal(
                "newton: blades without inertia about the pitch axis are not supported"
            )
        self.scene, self.step = scene, settings.step
        builder = newton.ModelBuilder(gravity=(0.0, 0.0, -scene.gravity))
        # A body needs a mass, which on the shaft has no effect.
        hub = builder.add_link(
            mass=1.0, inertia=warp.mat33(scene.hub_inertia * np.eye(3)), lock_inertia=True
        )
        tilt = warp.transform((0.0, 0.0, 0.0), turn((1.0, 0.0, 0.0), scene.shaft_tilt))
        joints = [
            builder.add_joint_revolute(
                -1, hub, parent_xform=tilt, axis=(0.0, 1.0, 0.0), armature=0.0
            )
        ]
        for phase, blade in zip(scene.phases, scene.blades, strict=True):
            inertia = warp.mat33(blade.inertia_tensor)
            body = builder.add_link(
                com=blade.centre_of_mass, inertia=inertia, mass=blade.mass, lock_inertia=True
            )
            turned = turn((0.0, 1.0, 0.0), phase) * turn((1.0, 0.0, 0.0), -blade.cone)
            place = warp.transform((0.0, 0.0, 0.0), turned)
            joints.append(
                builder.add_joint_revolute(
                    hub, body, parent_xform=place, axis=(0.0, 0.0, 1.0), armature=0.0
                )
            )
        builder.add_articulation(joints)
        self.model = builder.finalize(device="cpu")
        self.solver = newton.solvers.SolverFeatherstone(self.model, angular_damping=0.0)
        self.stiffness = np.array([0.0, *(stiffness for stiffness, _ in scene.bearings)])
        self.damping = np.array(scene.dampings)

    def integrate(self):
        scene, control = self.scene, self.model.control()
        states, forces = [self.model.state(), self.model.state()], control.joint_f
        q, v = np.array(scene.initial_angles), np.array(scene.initial_rates)
        states[0].joint_q.assign(q.astype(np.float32))
        states[0].joint_qd.assign(v.astype(np.float32))
        newton.eval_fk(self.model, states[0].joint_q, states[0].joint_qd, states[0])
        self.states = [np.append(q, v)]
        for stop in intervals(scene.load_segments, scene.samples, every_sample=True):
            count = int(np.ceil((stop.end - stop.start) / self.step * (1.0 - 1e-9)))
            h = (stop.end - stop.start) / count
            for i in range(count):
                loads = np.array(stop.segment.loads_at(stop.start + (i + 0.5) * h))
                torque, rest = np.append(loads[0], loads[1::2]), np.append(0.0, loads[2::2])
                forces.assign(
                    (torque + self.stiffness * (rest - q) - self.damping * v).astype(np.float32)
                )
                self.solver.step(*states, control, None, h)
                states.reverse()
                q, v = (
                    array.numpy().astype(float) for array in (states[0].joint_q, states[0].joint_qd)
                )
            if stop.ends_at_sample:
                self.states.append(np.append(q, v))
        return Integration(bool(np.isfinite(self.states[-1]).all()), "", scene.duration)

    def observe(self):
        states = np.array(self.states)
        states = states[: np.append(np.isfinite(states).all(axis=1), False).argmin()]
        return Trajectory(sample_times(self.scene)[: len(states)], *np.split(states, 2, axis=1))


BOUND = Bound(
    "defect", "featherstone", 3e-3, "order 1 at its default step: seen 1.1e-3 in 0.02 s of fig11"
)
METHOD = Method(
    name="featherstone",
    label="Newton, Featherstone",
    build=Solver,
    settings=Step,
    order=1,
    fixed_step=True,
    distributions=("newton",),
    bounds=(BOUND,),
)
