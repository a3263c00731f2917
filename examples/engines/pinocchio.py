"""The rotor in Pinocchio: its articulated-body algorithm, over time by SciPy's DOP853 or by its own
`integrate`.

    pip install pin scipy          # tried with pin 4.1.0
    rotor-mbs run paper/fig11 -m ./pinocchio.py

`pinocchio/dop853` restarts at every sample and leaves round-off; `pinocchio/euler`, semi-implicit,
is of order 1.
"""

from dataclasses import dataclass

import numpy as np
import pinocchio as pin
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


class Solver:
    def __init__(self, scene, settings):
        if not all(blade.has_pitch_inertia for blade in scene.blades):
            raise MethodRefusal(
                "pinocchio: blades without inertia about the pitch axis are not supported"
            )
        self.scene, self.settings = scene, settings
        self.model = model = pin.Model()
        model.gravity.linear = np.array([0.0, 0.0, -scene.gravity])
        tilt = pin.SE3(pin.utils.rotate("x", scene.shaft_tilt), np.zeros(3))
        shaft = model.addJoint(0, pin.JointModelRY(), tilt, "shaft")
        hub = pin.Inertia(0.0, np.zeros(3), np.diag([0.0, scene.hub_inertia, 0.0]))
        model.appendBodyToJoint(shaft, hub, pin.SE3.Identity())
        for phase, blade in zip(scene.phases, scene.blades, strict=True):
            place = pin.SE3(
                pin.utils.rotate("y", phase) @ pin.utils.rotate("x", -blade.cone), np.zeros(3)
            )
            hinge = model.addJoint(shaft, pin.JointModelRZ(), place, f"blade at {phase}")
            body = pin.Inertia(blade.mass, np.array(blade.centre_of_mass), blade.inertia_tensor)
            model.appendBodyToJoint(hinge, body, pin.SE3.Identity())
        self.data = model.createData()
        self.stiffness = np.array([0.0, *(stiffness for stiffness, _ in scene.bearings)])
        self.damping = np.array(scene.dampings)

    def acceleration(self, t, q, v, part):
        # the rotor's torque, then torque and rest angle of each pitch
        loads = np.array(part.loads_at(t))
        torque, rest = np.append(loads[0], loads[1::2]), np.append(0.0, loads[2::2])
        torque += self.stiffness * (rest - q) - self.damping * v
        return pin.aba(self.model, self.data, q, v, torque)

    def advance(self, q, v, stop):
        """From one stop to the next by DOP853."""

        def derivative(t, y):
            return np.append(y[len(q) :], self.acceleration(t, *np.split(y, 2), stop.segment))

        y, span, tolerance = (
            np.append(q, v),
            (stop.start, stop.end),
            self.settings.relative_tolerance,
        )
        run = solve_ivp(derivative, span, y, "DOP853", rtol=tolerance, atol=0.01 * tolerance)
        return *np.split(run.y[:, -1], 2), "" if run.success else run.message

    def integrate(self):
        scene = self.scene
        q, v = np.array(scene.initial_angles), np.array(scene.initial_rates)
        self.states = [(q, v)]
        for stop in intervals(scene.load_segments, scene.samples, every_sample=True):
            q, v, message = self.advance(q, v, stop)
            if message or not (np.isfinite(q).all() and np.isfinite(v).all()):
                return Integration(False, message or "not finite", stop.start)
            if stop.ends_at_sample:
                self.states.append((q, v))
        return Integration(True, "", self.scene.duration)

    def observe(self):
        return Trajectory(
            sample_times(self.scene)[: len(self.states)], *np.array(self.states).transpose(1, 0, 2)
        )


class Euler(Solver):
    def advance(self, q, v, stop):
        count = int(np.ceil((stop.end - stop.start) / self.settings.step * (1.0 - 1e-9)))
        h = (stop.end - stop.start) / count
        for i in range(count):
            v = v + h * self.acceleration(stop.start + (i + 0.5) * h, q, v, stop.segment)
            q = pin.integrate(self.model, q, h * v)
        return q, v, ""


METHODS = [
    Method(
        name="dop853",
        label="Pinocchio, DOP853",
        build=Solver,
        settings=Tolerance,
        distributions=("pin",),
        bounds=(Bound("defect", "dop853", 1e-11, "round-off at its tolerance"),),
    ),
    Method(
        name="euler",
        label="Pinocchio, semi-implicit Euler",
        build=Euler,
        settings=Step,
        order=1,
        fixed_step=True,
        distributions=("pin",),
        bounds=(Bound("defect", "euler", 1e-3, "order 1 at its default step"),),
    ),
]
