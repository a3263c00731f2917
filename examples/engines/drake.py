"""The rotor in Drake's MultibodyPlant, by its error-controlled Runge-Kutta and Radau schemes, or as
a discrete plant.

    pip install drake              # tried with drake 1.51.1
    rotor-mbs run paper/fig11 -m ./drake.py

Springs, dampers and the hub's inertia (an actuator's rotor) are the plant's own; loads over time
come by its port.
"""

from dataclasses import dataclass
from functools import partial

import numpy as np
from pydrake.math import RigidTransform, RotationMatrix
from pydrake.multibody.plant import MultibodyPlant
from pydrake.multibody.tree import (
    FixedOffsetFrame,
    RevoluteJoint,
    RevoluteSpring,
    RotationalInertia,
    SpatialInertia,
)
from pydrake.systems.analysis import ResetIntegratorFromFlags, Simulator
from pydrake.systems.framework import DiagramBuilder, LeafSystem

from rotor_mbs.errors import MethodRefusal
from rotor_mbs.methods.base import Method, Settings
from rotor_mbs.methods.settings import number, step
from rotor_mbs.scenario.accuracy_bounds import Bound
from rotor_mbs.scenario.time_table import intervals
from rotor_mbs.solution.trajectory import Integration, Trajectory, sample_times


@dataclass(frozen=True)
class Accuracy(Settings):
    accuracy: float = number(1e-9, above=0.0, at_most=1e-1, doc="of a step; rk5 reaches 1e-13")


@dataclass(frozen=True)
class Step(Settings):
    step: float = step(1e-4)


class Loads(LeafSystem):
    def __init__(self, stiffness):
        super().__init__()
        self.stiffness = stiffness
        self.DeclareVectorOutputPort(
            "forces", 1 + len(stiffness), self.calculate, {self.time_ticket()}
        )

    def calculate(self, context, output):
        # the rotor's torque; of each pitch torque, rest angle
        loads = np.array(self.part.loads_at(context.get_time()))
        output.SetFromVector(np.append(loads[0], loads[1::2] + self.stiffness * loads[2::2]))


class Solver:
    def __init__(self, scheme, scene, settings):
        if not all(blade.has_pitch_inertia for blade in scene.blades):
            raise MethodRefusal(
                "drake: blades without inertia about the pitch axis are not supported"
            )
        self.scene, builder, interval = (
            scene,
            DiagramBuilder(),
            scene.duration / (scene.samples - 1),
        )
        period = 0.0 if scheme else interval / np.ceil(interval / settings.step * (1.0 - 1e-9))
        self.plant = plant = builder.AddSystem(MultibodyPlant(period))
        plant.mutable_gravity_field().set_gravity_vector([0.0, 0.0, -scene.gravity])
        hub = plant.AddRigidBody("hub", SpatialInertia.Zero())
        turn = RigidTransform(RotationMatrix.MakeXRotation(scene.shaft_tilt))
        tilt = plant.AddFrame(FixedOffsetFrame("tilt", plant.world_frame(), turn))
        shaft = RevoluteJoint("shaft", tilt, hub.body_frame(), [0.0, 1.0, 0.0], scene.shaft_damping)
        motor = plant.AddJointActuator("motor", plant.AddJoint(shaft))
        motor.set_default_rotor_inertia(scene.hub_inertia)
        motor.set_default_gear_ratio(1.0)
        for i, (phase, blade) in enumerate(zip(scene.phases, scene.blades, strict=True)):
            centre, inertia = np.array(blade.centre_of_mass), RotationalInertia(*blade.inertia)
            body = plant.AddRigidBody(
                str(i), SpatialInertia.MakeFromCentralInertia(blade.mass, centre, inertia)
            )
            root = RigidTransform(
                RotationMatrix.MakeYRotation(phase) @ RotationMatrix.MakeXRotation(-blade.cone)
            )
            place, (stiffness, damping) = (
                FixedOffsetFrame(f"root {i}", hub.body_frame(), root),
                scene.bearings[i],
            )
            joint = RevoluteJoint(
                f"pitch {i}", plant.AddFrame(place), body.body_frame(), [0.0, 0.0, 1.0], damping
            )
            plant.AddForceElement(RevoluteSpring(plant.AddJoint(joint), 0.0, stiffness))
        plant.Finalize()
        self.loads = builder.AddSystem(
            Loads(np.array([stiffness for stiffness, _ in scene.bearings]))
        )
        builder.Connect(
            self.loads.get_output_port(), plant.get_applied_generalized_force_input_port()
        )
        self.simulator, self.settings, self.scheme = (
            Simulator(builder.Build()),
            settings,
            (scheme, interval),
        )

    def integrate(self):
        context, scene, self.loads.part = self.simulator.get_mutable_context(), self.scene, None
        context.SetTime(0.0)
        if self.scheme[0]:  # a new one: it keeps its step and its Jacobian
            ResetIntegratorFromFlags(self.simulator, *self.scheme).set_target_accuracy(
                self.settings.accuracy
            )
        inside = self.plant.GetMyMutableContextFromRoot(context)
        self.plant.SetPositionsAndVelocities(
            inside, np.array(scene.initial_angles + scene.initial_rates)
        )
        self.states = [self.plant.GetPositionsAndVelocities(inside)]
        for stop in intervals(scene.load_segments, scene.samples, every_sample=True):
            if self.loads.part is not stop.segment:
                self.loads.part = stop.segment
                self.simulator.Initialize()
            self.simulator.AdvanceTo(stop.end)
            if stop.ends_at_sample:
                self.states.append(self.plant.GetPositionsAndVelocities(inside))
        return Integration(True, "", scene.duration)

    def observe(self):
        return Trajectory(
            sample_times(self.scene)[: len(self.states)],
            *np.split(np.array(self.states), 2, axis=1),
        )


METHODS = [
    Method(
        name=name,
        label=f"Drake, {name}",
        build=partial(Solver, scheme),
        settings=Accuracy if scheme else Step,
        order=None if scheme else 1,
        fixed_step=not scheme,
        bounds=(Bound("defect", name, bound, "seen"),),
        distributions=("drake",),
    )
    for name, scheme, bound in (
        ("rk3", "runge_kutta3", 1e-6),
        ("rk5", "runge_kutta5", 1e-6),
        ("radau3", "radau3", 1e-5),
        ("discrete", "", 1e-3),
    )
]
