"""The rotor in DART: its forward dynamics by SciPy's DOP853, or as its World steps, by
semi-implicit Euler.

pip install dartpy scipy       # tried with dartpy 6.20.0, whose wheel has no variational integrator
rotor-mbs run paper/fig11 -m ./dart.py
"""

from dataclasses import dataclass

import dartpy as dart
import numpy as np
from scipy.integrate import solve_ivp

from rotor_mbs.errors import MethodRefusal
from rotor_mbs.methods.base import Method, Settings
from rotor_mbs.methods.settings import number, step
from rotor_mbs.scenario.accuracy_bounds import Bound
from rotor_mbs.scenario.time_table import intervals
from rotor_mbs.solution.trajectory import Integration, Trajectory, sample_times


@dataclass(frozen=True)
class Tolerance(Settings):
    relative_tolerance: float = number(3e-14, at_least=2.3e-14, at_most=1e-2, doc="of a step")


@dataclass(frozen=True)
class Step(Settings):
    step: float = step(1e-4)


def turned(about_y, about_x):
    place = dart.math.Isometry3()
    place.set_rotation(dart.math.eulerYXZToMatrix([about_y, about_x, 0.0]))
    return place


class Solver:
    def __init__(self, scene, settings):
        if not all(blade.has_pitch_inertia for blade in scene.blades):
            raise MethodRefusal(
                "dart: blades without inertia about the pitch axis are not supported"
            )
        self.scene, self.settings, self.rotor = scene, settings, dart.dynamics.Skeleton("rotor")
        shaft, hub = self.rotor.createRevoluteJointAndBodyNodePair()
        shaft.setAxis([0.0, 1.0, 0.0])
        shaft.setTransformFromParentBodyNode(turned(0.0, scene.shaft_tilt))
        hub.setInertia(dart.dynamics.Inertia(1.0, np.zeros(3), scene.hub_inertia * np.eye(3)))
        for phase, blade in zip(scene.phases, scene.blades, strict=True):
            hinge, body = self.rotor.createRevoluteJointAndBodyNodePair(hub)
            hinge.setAxis([0.0, 0.0, 1.0])
            hinge.setTransformFromParentBodyNode(turned(phase, -blade.cone))
            body.setInertia(
                dart.dynamics.Inertia(
                    blade.mass, np.array(blade.centre_of_mass), blade.inertia_tensor
                )
            )
        self.world = dart.simulation.World()
        self.world.setGravity([0.0, 0.0, -scene.gravity])
        self.world.addSkeleton(self.rotor)
        self.stiffness = np.array([0.0, *(stiffness for stiffness, _ in scene.bearings)])
        self.damping = np.array(scene.dampings)

    def put(self, t, q, v, part):
        # the rotor's torque, then torque and rest angle of each pitch
        loads = np.array(part.loads_at(t))
        torque, rest = np.append(loads[0], loads[1::2]), np.append(0.0, loads[2::2])
        self.rotor.setPositions(q)
        self.rotor.setVelocities(v)
        self.rotor.setForces(torque + self.stiffness * (rest - q) - self.damping * v)

    def derivative(self, t, y, part):
        self.put(t, *np.split(y, 2), part)
        self.rotor.computeForwardDynamics()
        return np.append(y[len(y) // 2 :], self.rotor.getAccelerations())

    def advance(self, y, stop):
        span, tolerance = (stop.start, stop.end), self.settings.relative_tolerance
        run = solve_ivp(
            self.derivative,
            span,
            y,
            "DOP853",
            args=(stop.segment,),
            rtol=tolerance,
            atol=0.01 * tolerance,
        )
        return run.y[:, -1] if run.success else np.nan * y

    def integrate(self):
        y, scene = np.array(self.scene.initial_angles + self.scene.initial_rates), self.scene
        self.states = [y]
        for stop in intervals(scene.load_segments, scene.samples, every_sample=True):
            y = self.advance(y, stop)
            if stop.ends_at_sample:
                self.states.append(y)
        return Integration(bool(np.isfinite(y).all()), "", scene.duration)

    def observe(self):
        return Trajectory(
            sample_times(self.scene)[: len(self.states)],
            *np.split(np.array(self.states), 2, axis=1),
        )


class World(Solver):
    def advance(self, y, stop):
        count = int(np.ceil((stop.end - stop.start) / self.settings.step * (1.0 - 1e-9)))
        h = (stop.end - stop.start) / count
        self.world.setTimeStep(h)
        for i in range(count):
            self.put(stop.start + (i + 0.5) * h, *np.split(y, 2), stop.segment)
            self.world.step()
            y = np.append(self.rotor.getPositions(), self.rotor.getVelocities())
        return y


METHODS = [
    Method(
        name="dop853",
        label="DART, DOP853",
        build=Solver,
        settings=Tolerance,
        distributions=("dartpy",),
        bounds=(Bound("defect", "dop853", 1e-12, "round-off"),),
    ),
    Method(
        name="world",
        label="DART, World",
        build=World,
        settings=Step,
        order=1,
        fixed_step=True,
        distributions=("dartpy",),
        bounds=(Bound("defect", "world", 1e-3, "order 1"),),
    ),
]
