"""A right engine by Newton and Euler, written without a look at the package's models;
`broken_engines` breaks it."""

from dataclasses import dataclass

import numpy as np

from rotor_mbs.errors import MethodRefusal
from rotor_mbs.methods.base import Method
from rotor_mbs.methods.settings import Settings, number
from rotor_mbs.solution.trajectory import Integration, Trajectory


@dataclass(frozen=True)
class Step(Settings):
    step: float = number(1e-3, unit="s", above=0.0, doc="time step")


class Rotor:
    def __init__(self, scene, settings):
        if not all(blade.has_pitch_inertia for blade in scene.blades):
            raise MethodRefusal("needs inertia about the pitch axes")
        if scene.has_tilt_or_cone or scene.hub_mass or scene.hub_radius:
            raise MethodRefusal("knows upright rotors alone")
        self.scene, self.step = scene, settings.step
        self.N = len(scene.blades)
        self.phase = np.array(scene.phases)
        self.m = np.array([b.mass for b in scene.blades])
        self.r = np.array([b.centre_of_mass for b in scene.blades])
        self.tip = np.array([b.tip for b in scene.blades])
        self.J = np.zeros((self.N, 3, 3))
        for i, b in enumerate(scene.blades):
            r = self.r[i]
            self.J[i] = np.array(b.inertia_tensor) + b.mass * (r @ r * np.eye(3) - np.outer(r, r))
        self.k = np.array([pair[0] for pair in scene.bearings])
        self.d = np.array([pair[1] for pair in scene.bearings])
        self.g = scene.gravity
        self.D = scene.shaft_damping
        self.time = np.linspace(0.0, scene.duration, scene.samples)
        self.start = np.array([*scene.initial_angles, *scene.initial_rates, 0.0])

    def loads(self, part, t):
        a = np.array(part.loads_at(t))
        return a[0], a[1::2], a[2::2]

    def weight(self, turn, th):
        """m g in each blade's frame."""
        w = self.m * self.g
        gx = w * np.sin(turn)
        gz = -w * np.cos(turn)
        return np.stack([np.cos(th) * gx, -np.sin(th) * gx, gz], axis=1)

    def dynamics(self, t, y, part):
        N, J = self.N, self.J
        q, th, w, v = y[0], y[1 : N + 1], y[N + 1], y[N + 2 : 2 * N + 2]
        tau, torque, rest = self.loads(part, t)
        s, c = np.sin(th), np.cos(th)
        a = np.stack([s, c, 0 * s], axis=1)
        omega = np.stack([w * s, w * c, v], axis=1)
        alpha0 = np.stack([w * v * c, -w * v * s, 0 * s], axis=1)
        Ja = (J @ a[:, :, None])[:, :, 0]
        M = np.zeros((N + 1, N + 1))
        M[0, 0] = self.scene.hub_inertia + np.sum(a * Ja)
        for i in range(N):
            M[0, i + 1] = M[i + 1, 0] = Ja[i, 2]
            M[i + 1, i + 1] = J[i, 2, 2]
        L = (J @ omega[:, :, None])[:, :, 0]
        n = (J @ alpha0[:, :, None])[:, :, 0] + np.cross(omega, L)
        n -= np.cross(self.r, self.weight(q + self.phase, th))
        act = torque + self.k * (rest - th) - self.d * v
        f = np.empty(N + 1)
        f[0] = tau - self.D * w - np.sum(a * n)
        f[1:] = act - n[:, 2]
        acc = np.linalg.solve(M, f)
        slope = self.rest_rate(part)
        power = (
            tau * w
            - self.D * w**2
            + np.sum(torque * v - self.d * v**2)
            - np.sum(self.k * (th - rest) * slope)
        )
        return np.concatenate([y[N + 1 : 2 * N + 2], acc, [power]])

    def rest_rate(self, part):
        span = part.end - part.start
        if span <= 0:
            return np.zeros(self.N)
        return (self.loads(part, part.end)[2] - self.loads(part, part.start)[2]) / span

    def rk(self, t, y, h, part):
        f = self.dynamics
        k1 = f(t, y, part)
        k2 = f(t + h / 2, y + h / 2 * k1, part)
        k3 = f(t + h / 2, y + h / 2 * k2, part)
        k4 = f(t + h, y + h * k3, part)
        return y + h / 6 * (k1 + 2 * k2 + 2 * k3 + k4)

    def advance(self, a, b, y, part):
        count = max(1, int(np.ceil((b - a) / self.step - 1e-9)))
        h = (b - a) / count
        for i in range(count):
            y = self.rk(a + i * h, y, h, part)
        return y

    def integrate(self):
        y, parts = self.start.copy(), list(self.scene.load_segments)
        self.rows, self.before, self.after = [y.copy()], [parts[0]], [parts[0]]
        i, tiny, N = 1, 1e-12 * self.scene.duration, self.N
        for n, part in enumerate(parts):
            if n:
                old, new = self.loads(parts[n - 1], part.start)[2], self.loads(part, part.start)[2]
                th = y[1 : N + 1]
                y[-1] += 0.5 * np.sum(self.k * ((th - new) ** 2 - (th - old) ** 2))
                if abs(self.time[len(self.rows) - 1] - part.start) <= tiny:
                    self.rows[-1], self.after[-1] = y.copy(), part
            t = part.start
            while i < len(self.time) and self.time[i] <= part.end + tiny:
                y = self.advance(t, self.time[i], y, part)
                t = self.time[i]
                self.rows.append(y.copy())
                self.before.append(part)
                self.after.append(part)
                i += 1
            if part.end - t > tiny:
                y = self.advance(t, part.end, y, part)
        return Integration(True, "", float(self.time[len(self.rows) - 1]))

    def to_base(self, turn, th, p):
        """Vectors of the blades' frames in the base."""
        x = np.cos(th) * p[:, 0] - np.sin(th) * p[:, 1]
        y = np.sin(th) * p[:, 0] + np.cos(th) * p[:, 1]
        z = p[:, 2]
        return np.stack(
            [np.cos(turn) * x + np.sin(turn) * z, y, -np.sin(turn) * x + np.cos(turn) * z], axis=1
        )

    def observe(self):
        N, J = self.N, self.J
        names = (
            "tip",
            "kinetic_energy",
            "potential_energy",
            "work",
            "blade_root_force",
            "blade_root_moment",
            "shaft_force",
            "shaft_moment",
            "pitch_actuator_moment",
        )
        out = {name: [] for name in names}
        for t, y, before, after in zip(self.time, self.rows, self.before, self.after):  # noqa: B905
            q, th, w, v = y[0], y[1 : N + 1], y[N + 1], y[N + 2 : 2 * N + 2]
            turn = q + self.phase
            s, c = np.sin(th), np.cos(th)
            a = np.stack([s, c, 0 * s], axis=1)
            omega = np.stack([w * s, w * c, v], axis=1)
            L = (J @ omega[:, :, None])[:, :, 0]
            out["tip"].append(self.to_base(turn, th, self.tip))
            out["kinetic_energy"].append(
                0.5 * np.sum(omega * L) + 0.5 * self.scene.hub_inertia * w**2
            )
            height = self.to_base(turn, th, self.r)[:, 2]
            rest = self.loads(after, t)[2]
            out["potential_energy"].append(
                np.sum(self.m * self.g * height) + 0.5 * np.sum(self.k * (th - rest) ** 2)
            )
            out["work"].append(y[-1])
            acc = self.dynamics(t, y, before)[N + 1 : 2 * N + 2]
            tau, torque, rest = self.loads(before, t)
            alpha = np.stack([w * v * c, -w * v * s, 0 * s], axis=1) + acc[0] * a
            alpha[:, 2] += acc[1:]
            accel = np.cross(alpha, self.r) + np.cross(omega, np.cross(omega, self.r))
            weight = self.weight(turn, th)
            force = self.m[:, None] * accel - weight
            moment = (
                (J @ alpha[:, :, None])[:, :, 0] + np.cross(omega, L) - np.cross(self.r, weight)
            )
            shaft = self.to_base(turn, th, moment).sum(axis=0)
            shaft[1] += self.scene.hub_inertia * acc[0] - tau
            out["blade_root_force"].append(force)
            out["blade_root_moment"].append(moment)
            out["shaft_force"].append(self.to_base(turn, th, force).sum(axis=0))
            out["shaft_moment"].append(shaft)
            out["pitch_actuator_moment"].append(torque + self.k * (rest - th) - self.d * v)
        rows = np.array(self.rows)
        time = self.time[: len(rows)]
        kept = {}
        for name, values in out.items():
            kept[name] = np.array(values)
        asked = self.scene.outputs
        if "loads" not in asked:
            for name in names[4:]:
                del kept[name]
        angles, rates = rows[:, : N + 1], rows[:, N + 1 : 2 * N + 2]
        return Trajectory(time, angles, rates, **kept)


METHOD = Method(
    name="rk4", label="Runge-Kutta by hand", build=Rotor, settings=Step, order=4, fixed_step=True
)
