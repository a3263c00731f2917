"""The rotor by Kane's method: SymPy derives the equations of hub and one blade, LSODA integrates
their sum over blades.

    pip install sympy scipy        # tried with sympy 1.14.0
    rotor-mbs run paper/fig11 -m ./kane.py

Kane's equations are sums over bodies: those of each blade are derived once, with its numbers as
symbols.
"""

import functools
from dataclasses import dataclass

import numpy as np
import sympy as sm
import sympy.physics.mechanics as me
from scipy.integrate import solve_ivp

from rotor_mbs.errors import MethodRefusal
from rotor_mbs.methods.base import Method, Settings
from rotor_mbs.methods.settings import number
from rotor_mbs.scenario.accuracy_bounds import Bound
from rotor_mbs.scenario.time_table import intervals
from rotor_mbs.solution.trajectory import Integration, Trajectory, sample_times


@dataclass(frozen=True)
class Tolerance(Settings):
    relative_tolerance: float = number(1e-12, at_least=2.3e-14, at_most=1e-2, doc="of a step")


@functools.cache
def of_a_blade():
    """(numbers, place, g, q, p, u, v) -> 2 x 2 mass matrix and forces of the rotor and one pitch,
    without loads."""
    q, p, u, v = me.dynamicsymbols("q p u v")
    g, tilt, phase, cone, m, x, y, z, *inertia = sm.symbols(
        "g tilt phase cone m x y z xx yy zz xy xz yz"
    )
    base, shaft, hub, azimuth, root, blade = (
        me.ReferenceFrame(name) for name in ("N", "S", "H", "A", "R", "B")
    )
    shaft.orient_axis(base, base.x, tilt)
    hub.orient_axis(shaft, shaft.y, q)
    hub.set_ang_vel(shaft, u * shaft.y)
    azimuth.orient_axis(hub, hub.y, phase)
    root.orient_axis(azimuth, azimuth.x, -cone)
    blade.orient_axis(root, root.z, p)
    blade.set_ang_vel(root, v * root.z)
    origin = me.Point("O")
    origin.set_vel(base, 0)
    centre = origin.locatenew("C", x * blade.x + y * blade.y + z * blade.z)
    centre.v2pt_theory(origin, base, blade)
    xx, yy, zz, xy, xz, yz = inertia
    body = me.RigidBody(
        "blade", centre, blade, m, (me.inertia(blade, xx, yy, zz, xy, yz, xz), centre)
    )
    kane = me.KanesMethod(base, q_ind=[q, p], u_ind=[u, v], kd_eqs=[q.diff() - u, p.diff() - v])
    kane.kanes_equations([body], [(centre, -m * g * base.z)])
    numbers = ((m, x, y, z, *inertia), (tilt, phase, cone), g, q, p, u, v)
    return sm.lambdify(numbers, [kane.mass_matrix, kane.forcing], cse=True)


class Solver:
    def __init__(self, scene, settings):
        if not all(blade.has_pitch_inertia for blade in scene.blades):
            raise MethodRefusal(
                "kane: blades without inertia about the pitch axis are not supported"
            )
        self.scene, self.tolerance, self.of_a_blade = (
            scene,
            settings.relative_tolerance,
            of_a_blade(),
        )
        self.numbers = [
            (blade.mass, *blade.centre_of_mass, *blade.inertia) for blade in scene.blades
        ]
        cones = [blade.cone for blade in scene.blades]
        self.places = [
            (scene.shaft_tilt, phase, cone) for phase, cone in zip(scene.phases, cones, strict=True)
        ]
        self.stiffness = np.array([stiffness for stiffness, _ in scene.bearings])
        self.damping = np.array(scene.dampings)

    def derivative(self, t, state, part):
        (q, *pitches), (u, *rates) = np.split(state, 2)
        # the rotor's torque, then torque and rest angle of each pitch
        loads = np.array(part.loads_at(t))
        forces = np.append(loads[0], loads[1::2] + self.stiffness * (loads[2::2] - pitches))
        forces -= self.damping * state[len(forces) :]
        mass = np.zeros((len(forces), len(forces)))
        mass[0, 0] = self.scene.hub_inertia
        for i, (numbers, place) in enumerate(zip(self.numbers, self.places, strict=True)):
            matrix, force = self.of_a_blade(
                numbers, place, self.scene.gravity, q, pitches[i], u, rates[i]
            )
            both = np.array([0, 1 + i])
            mass[np.ix_(both, both)] += matrix
            forces[both] += np.ravel(force)
        return np.concatenate([[u], rates, np.linalg.solve(mass, forces)])

    def integrate(self):
        y, scene = np.array(self.scene.initial_angles + self.scene.initial_rates), self.scene
        self.states, tolerances = [y], {"rtol": self.tolerance, "atol": 0.01 * self.tolerance}
        for stop in intervals(scene.load_segments, scene.samples, every_sample=False):
            inside = np.linspace(stop.start, stop.end, stop.sample_intervals + 1)[1:]
            span = stop.start, stop.end
            run = solve_ivp(
                self.derivative, span, y, "LSODA", inside, args=(stop.segment,), **tolerances
            )
            self.states += [*run.y.T[: len(inside) - (not stop.ends_at_sample)]]
            if not run.success:
                return Integration(False, run.message, run.t[-1] if len(run.t) else stop.start)
            y = run.y[:, -1]
        return Integration(True, "", scene.duration)

    def observe(self):
        return Trajectory(
            sample_times(self.scene)[: len(self.states)],
            *np.split(np.array(self.states), 2, axis=1),
        )


METHOD = Method(
    name="lsoda",
    label="Kane, LSODA",
    build=Solver,
    settings=Tolerance,
    distributions=("sympy",),
    bounds=(Bound("defect", "lsoda", 1e-9, "interpolated between LSODA's steps"),),
)
