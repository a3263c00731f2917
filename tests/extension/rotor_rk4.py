"""A method from another package: rigid blades with their own mass matrix, by the classical
Runge-Kutta method."""

from dataclasses import dataclass

import numpy as np

from rotor_mbs.errors import MethodRefusal
from rotor_mbs.methods.base import BuiltItem, Method, Settings, step_ladder
from rotor_mbs.methods.settings import number
from rotor_mbs.scenario.accuracy_bounds import Bound
from rotor_mbs.solution.trajectory import Integration, RunBlock, Trajectory

NAMES = ("tip", "kinetic_energy", "potential_energy", "work")


@dataclass(frozen=True)
class Rk4Settings(Settings):
    step: float = number(2e-3, unit="s", above=0.0, doc="time step")


class Solver:
    def __init__(self, scene, settings):
        interval = scene.duration / (scene.samples - 1)
        self.scene, self.time = scene, np.linspace(0.0, scene.duration, scene.samples)
        self.steps = int(np.ceil(interval / settings.step - 1e-9))
        self.h, self.n, self.phases = (
            interval / self.steps,
            1 + len(scene.blades),
            np.array(scene.phases),
        )
        self.m, r = (
            np.array([b.mass for b in scene.blades]),
            np.array([b.centre_of_mass for b in scene.blades]),
        )
        tensors = np.array([b.inertia for b in scene.blades])[:, [[0, 3, 4], [3, 1, 5], [4, 5, 2]]]
        steiner = (r**2).sum(axis=1)[:, None, None] * np.eye(3) - r[:, :, None] * r[:, None, :]
        self.r, self.J = r, tensors + self.m[:, None, None] * steiner  # kg m² about the hub centre

    def mass(self, theta):
        # the shaft in each blade's frame
        a = np.stack([np.sin(theta), np.cos(theta), 0.0 * theta], axis=1)
        M = np.diag(
            [self.scene.hub_inertia + np.einsum("bi,bij,bj->", a, self.J, a), *self.J[:, 2, 2]]
        )
        M[0, 1:] = M[1:, 0] = np.einsum("bi,bi->b", a, self.J[:, 2])
        return M, a

    def points(self, q, theta, r):
        turn, (x, y, z) = q + self.phases, r.T
        u, v = np.cos(theta) * x - np.sin(theta) * y, np.sin(theta) * x + np.cos(theta) * y
        return np.stack(
            [u * np.cos(turn) + z * np.sin(turn), v, z * np.cos(turn) - u * np.sin(turn)], axis=-1
        )

    def derivative(self, y):
        q, theta, w, v = y[0], y[1 : self.n], y[self.n], y[self.n + 1 :]
        M, a = self.mass(theta)
        da, place = np.stack([a[:, 1], -a[:, 0], a[:, 2]], axis=1), self.points(q, theta, self.r)
        coriolis, weight = np.einsum("bi,bij,bj->b", da, self.J, a), self.m * self.scene.gravity
        rotor = (
            weight @ place[:, 0]
            - (2.0 * w * v * coriolis + v**2 * np.einsum("bi,bi->b", da, self.J[:, 2])).sum()
        )
        pitch = w**2 * coriolis - weight * np.sin(q + self.phases) * place[:, 1]
        return np.concatenate([y[self.n :], np.linalg.solve(M, [rotor, *pitch])])

    def integrate(self):
        y = np.array(self.scene.initial_angles + self.scene.initial_rates)
        self.states, f, h = [y], self.derivative, self.h
        for _ in self.time[1:]:
            for _ in range(self.steps):
                k = [f(y)]
                for share in (0.5, 0.5, 1.0):
                    k.append(f(y + share * h * k[-1]))
                y = y + h / 6.0 * (k[0] + 2.0 * k[1] + 2.0 * k[2] + k[3])
            self.states.append(y)
        return Integration(True, "", float(self.time[-1]), self.steps * (len(self.time) - 1))

    def observe(self):
        angles, rates = np.split(np.array(self.states), 2, axis=1)
        tip = self.points(
            angles[:, :1], angles[:, 1:], np.array([b.tip for b in self.scene.blades])
        )
        potential = self.points(angles[:, :1], angles[:, 1:], self.r)[:, :, 2] @ (
            self.m * self.scene.gravity
        )
        kinetic = np.array(
            [0.5 * v @ self.mass(q[1:])[0] @ v for q, v in zip(angles, rates, strict=True)]
        )
        energies = {"kinetic_energy": kinetic, "potential_energy": potential, "work": 0.0 * kinetic}
        return Trajectory(self.time, angles, rates, tip=tip, **energies)


def solve_many(scenes, settings):
    """Runs of many scenes, for sweeps."""
    solvers = [Solver(scene, settings) for scene in scenes]
    integrations, runs = (
        [solver.integrate() for solver in solvers],
        [solver.observe() for solver in solvers],
    )
    arrays = {
        name: np.stack([run.get(name) for run in runs])
        for name in ("time", "angles", "rates", *NAMES)
    }
    return RunBlock(arrays.pop("time"), arrays, integrations, [len(run.time) for run in runs])


def items(scene):
    pitches = all(b.has_pitch_inertia for b in scene.blades)
    if (
        scene.has_tilt_or_cone
        or scene.has_damping
        or scene.has_torque
        or any(scene.bearing_stiffness)
        or not pitches
    ):
        raise MethodRefusal(
            "outside/rk4 has no springs, dampers, torque, tilt, cone, or pitch without inertia"
        )
    return [BuiltItem("equation", label) for label in scene.coordinate_labels]


METHOD = Method(
    name="outside/rk4",
    label="from outside, RK4",
    settings=Rk4Settings,
    build=Solver,
    items=items,
    order=4,
    fixed_step=True,
    ladders=(step_ladder(6),),
    solve_many=solve_many,
    bounds=(
        Bound("defect", "outside/rk4", 1e-6, "order 4"),
        Bound("energy", "outside/rk4", 1e-6, "order 4"),
    ),
)
