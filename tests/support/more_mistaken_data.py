"""A third set of data of another program with one mistake each, in other scenes.

    python tests/support/more_mistaken_data.py FOLDER [NAME ...]

computes and compares the data as `mistaken_data` does, keeps the results in FOLDER/NAME.json, and
prints a line for each and their counts. The set was written before the search was looked at.
"""

from __future__ import annotations

import copy
import json
import sys
import time
from collections import Counter
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy import signal

sys.path.insert(0, str(Path(__file__).parents[1]))

import rotor_mbs as rm
from support import mistaken_data as base
from support.mistaken_data import (
    Data,
    Mistake,
    Rotor,
    Scene,
    cross,
    dot,
    each_blade,
    scale_at,
    set_at,
    steiner,
    tables_at,
    times_rows,
    turn_x,
    turn_y,
    turn_z,
    value_at,
)

Array = NDArray[np.float64]

# ---- scenes ------------------------------------------------------------------------------------

LIKE_BLADE = {
    "mass": 410.0,
    "centre_of_mass": [0.12, -0.08, 3.4],
    "inertia": [980.0, 1010.0, 60.0, 8.0, -14.0, 22.0],
}
SCENES: dict[str, Scene] = {
    # One blade with a counterweight, tilted and coned upwind.
    "single": {
        "blades": 1,
        "gravity": 9.81,
        "duration": 2.5,
        "samples": 251,
        "blade": [{**LIKE_BLADE, "cone": 0.08}],
        "hub": {"inertia": 2500.0, "radius": 0.6, "mass": 700.0},
        "initial": {"angles": [0.5, -0.25], "rates": [2.2, 0.4]},
        "torque": {"rotor": 600.0, "pitch": [[[0.0, 0.0], [0.7, 90.0], [0.7, -60.0]]]},
        "bearing": {"stiffness": 2400.0, "damping": 35.0, "rest": 0.15},
        "shaft": {"damping": 150.0, "tilt": 0.07},
    },
    # Two unlike blades, a stepped generator torque and ramps of the commands.
    "pair": {
        "blades": 2,
        "gravity": 9.80665,
        "duration": 3.0,
        "samples": 301,
        "blade": [
            {**LIKE_BLADE, "cone": 0.05},
            {
                "mass": 450.0,
                "centre_of_mass": [-0.1, 0.09, 3.2],
                "inertia": [1040.0, 990.0, 72.0, -12.0, 16.0, -18.0],
                "cone": 0.05,
            },
        ],
        "hub": {"inertia": 1400.0},
        "initial": {"angles": [1.1, 0.3, -0.4], "rates": [1.6, 0.0, 0.7]},
        "torque": {"rotor": [[0.0, 2000.0], [0.8, 5000.0], [1.505, 5000.0], [1.505, 1000.0]]},
        "bearing": {
            "stiffness": [3000.0, 2500.0],
            "damping": [60.0, 45.0],
            "rest": [[[0.2, 0.0], [1.2, 0.3]], [[0.2, 0.0], [1.2, -0.2]]],
        },
        "shaft": {"damping": 900.0},
    },
    # Three like blades, tilt, cone, hub: a turbine of 20 kW.
    "trio": {
        "blades": 3,
        "gravity": 9.80665,
        "duration": 2.0,
        "samples": 201,
        "blade": [{**LIKE_BLADE, "cone": -0.05} for _ in range(3)],
        "hub": {"inertia": 900.0, "radius": 0.5, "mass": 820.0},
        "initial": {"angles": [0.25, 0.1, -0.3, 0.4], "rates": [2.6, 0.2, -0.5, 0.0]},
        "torque": {"rotor": [[0.0, 1000.0], [2.0, 7000.0]], "pitch": [120.0, 0.0, -80.0]},
        "bearing": {"stiffness": 2000.0, "damping": [50.0, 40.0, 30.0], "rest": 0.05},
        "shaft": {"damping": 700.0, "tilt": -0.08},
    },
    # Four unlike blades, free bearings but for dampers.
    "quad": {
        "blades": 4,
        "gravity": 9.81,
        "duration": 2.4,
        "samples": 241,
        "blade": base.general_blades(4),
        "hub": {"inertia": 6000.0, "radius": 0.9, "mass": 1500.0},
        "initial": {"angles": [0.4, 0.5, -0.6, 0.8, 0.1], "rates": [1.3, 0.4, 0.0, -0.5, 0.9]},
        "torque": {"rotor": 9000.0},
        "bearing": {"stiffness": 0.0, "damping": [150.0, 250.0, 50.0, 350.0]},
        "shaft": {"damping": 1200.0},
    },
    # A model in the laboratory, without tilt, cone and loads over time.
    "small": {
        "blades": 3,
        "gravity": 9.81,
        "duration": 1.0,
        "samples": 501,
        "blade": [
            {
                "mass": 0.21,
                "centre_of_mass": [0.012, 0.004, 0.26],
                "inertia": [1.6e-3, 1.7e-3, 2.2e-4, 1e-5, -2e-5, 4e-5],
            }
            for _ in range(3)
        ],
        "hub": {"inertia": 4e-3},
        "initial": {"angles": [0.0, 0.35, 0.3, 0.25], "rates": [9.0, 0.0, 1.0, -2.0]},
        "torque": {"rotor": 0.4},
        "bearing": {"stiffness": 0.2, "damping": 1e-3},
        "shaft": {"damping": 0.02},
    },
    # Point masses as in the paper, with a torque on one pitch.
    "points": {
        "blades": 3,
        "gravity": 9.8,
        "duration": 2.5,
        "samples": 251,
        "blade": [{"mass": 12000.0, "centre_of_mass": [0.3, 0.0, 12.0]} for _ in range(3)],
        "initial": {"angles": [0.1, 0.8, -0.5, 0.4], "rates": [0.6, -0.4, 0.3, 0.0]},
        "torque": {"pitch": [0.0, 4000.0, 0.0]},
    },
}

# ---- equations with mistakes -------------------------------------------------------------------


class Machine(Rotor):
    """Equations of motion by a mass matrix and right-hand side, with other mistakes than Rotor's."""

    def matrix(self, geometry: tuple[Array, ...]) -> Array:
        """Return the mass matrix at a geometry."""
        _, axis, pitch_axes, centres, inertias = geometry
        by_rotor, by_pitch = cross(axis, centres), cross(pitch_axes, centres)
        rotor = self.mass * dot(by_rotor, by_rotor) + dot(inertias @ axis, axis[None, :])
        coupling = self.mass * dot(by_rotor, by_pitch) + dot(inertias @ axis, pitch_axes)
        pitch = self.mass * dot(by_pitch, by_pitch)
        pitch += dot(pitch_axes, times_rows(inertias, pitch_axes))
        if "coupling_of_blade_1" in self.mistakes:
            coupling[1:] = 0.0
        if "coupling_without_products" in self.mistakes:
            coupling = self.mass * dot(by_rotor, by_pitch)
        matrix = np.diag([self.hub_inertia + rotor.sum(), *pitch])
        matrix[0, 1:] = matrix[1:, 0] = coupling
        return matrix

    def at_rotor_zero(self, pitches: Array) -> tuple[Array, ...]:
        """Return the geometry at a rotor angle of 0, which the mass matrix does not depend on."""
        return self.geometry(np.array([0.0, *pitches]))

    def velocity_terms(self, geometry: tuple[Array, ...], rates: Array) -> tuple[float, Array]:
        """Return the velocity terms of the rotor's and the pitches' equations."""
        mistakes = self.mistakes
        rotor, pitch = self.bias(geometry, rates[0], rates[1:])
        if "half_gyroscopic" in mistakes:
            without = Rotor(self.scene, frozenset(["no_gyroscopic"]))
            others = without.bias(geometry, rates[0], rates[1:])
            rotor, pitch = (rotor + others[0]) / 2, (pitch + others[1]) / 2
        from_rotor = self.bias(geometry, rates[0], 0.0 * rates[1:])
        from_pitch = self.bias(geometry, 0.0, rates[1:])
        if "rotor_without_pitch_squares" in mistakes:
            rotor = rotor - from_pitch[0]
        if "coriolis_of_blade_1_sign" in mistakes:
            coriolis = rotor - from_rotor[0] - from_pitch[0]
            rotor = rotor - 2.0 * coriolis * (np.arange(self.count) == 0)
        return float(rotor.sum()), pitch

    def accelerations(self, time: float, state: Array, before: bool = False) -> Array:
        """Return the accelerations of rotor and pitches at a state (angles, rates)."""
        mistakes = self.mistakes
        angles, rates = state[: 1 + self.count], state[1 + self.count :]
        geometry = self.geometry(angles)
        _, axis, pitch_axes, centres, _ = geometry
        weights = self.mass[:, None] * self.weight
        rotor_weight = dot(weights, cross(axis, centres))
        pitch_weight = dot(weights, cross(pitch_axes, centres))
        if "pitch_weight_sign" in mistakes:
            pitch_weight = -pitch_weight
        if "no_rotor_weight" in mistakes:
            rotor_weight = 0.0 * rotor_weight
        rotor_bias, pitch_bias = self.velocity_terms(geometry, rates)
        torque = value_at(self.rotor_torque, time, before=before)
        drag = self.shaft_damping * rates[0]
        if "quadratic_shaft_damper" in mistakes:
            drag *= abs(rates[0])
        pitch_torque = self.pitch_torques(time, before)
        if "pitch_torque_by_cosine" in mistakes:
            pitch_torque = pitch_torque * np.cos(angles[1:])
        actuator = self.bearing_moments(time, angles, rates, before)
        if "cubic_spring" in mistakes:
            rest = np.array([value_at(value, time, before=before) for value in self.rest])
            deflection = angles[1:] - rest
            actuator = actuator - self.stiffness * deflection**3
        if "friction" in mistakes:
            actuator = actuator - 60.0 * np.tanh(rates[1:] / 0.05)
        if "damper_on_sum" in mistakes:
            actuator = actuator - self.damping * rates[0]
        right = np.array(
            [
                torque - drag + rotor_weight.sum() - rotor_bias,
                *(actuator + pitch_torque + pitch_weight - pitch_bias),
            ]
        )
        if "matrix_at_start" in mistakes:
            matrix = self.matrix(self.at_rotor_zero(self.scene["initial"]["angles"][1:]))
        else:
            matrix = self.matrix(geometry)
        if "rotor_inertia_at_zero_pitch" in mistakes:
            matrix[0, 0] = self.matrix(self.at_rotor_zero(np.zeros(self.count)))[0, 0]
        return np.asarray(np.linalg.solve(matrix, right))

    def geometry(self, angles: Array) -> tuple[Array, Array, Array, Array, Array]:
        """Return the geometry, of blades at wrong azimuths if that is a mistake."""
        if "azimuths_1324" not in self.mistakes:
            return super().geometry(angles)
        order = [0, 2, 1, 3]
        turns = np.empty((self.count, 3, 3))
        for i in range(self.count):
            azimuth = angles[0] + 2 * np.pi * order[i] / self.count
            turns[i] = self.tilt @ turn_y(azimuth) @ turn_x(-self.cone[i]) @ turn_z(angles[1 + i])
        centres = times_rows(turns, self.centre)
        inertias = turns @ self.inertia @ np.swapaxes(turns, 1, 2)
        return turns, self.tilt[:, 1], turns[:, :, 2], centres, inertias


# ---- edits of the scene ------------------------------------------------------------------------


def both(*edits: Callable[[Any], Any]) -> Callable[[Any], Any]:
    """Return edits or exports one after the other."""

    def edit(value: Any) -> Any:
        for change in edits:
            value = change(value) or value
        return value

    return edit


def scale_blades(key: str, factor: float) -> Callable[[Scene], None]:
    """Return an edit of a number of all blades."""

    def change(blade: dict[str, Any]) -> None:
        blade[key] = factor * blade[key]

    return each_blade(change)


def transport_from_root(scene: Scene) -> None:
    """Transport the blades' inertia by the distance from the root, not from the apex."""
    radius = scene["hub"]["radius"]
    for blade in scene["blade"]:
        x, y, z = blade["centre_of_mass"]
        steiner(-1.0)(blade)
        blade["centre_of_mass"] = [x, y, z - radius]
        steiner(1.0)(blade)
        blade["centre_of_mass"] = [x, y, z]


def exchange_blades(i: int, j: int) -> Callable[[Scene], None]:
    """Return an edit that exchanges the blades' numbers."""

    def edit(scene: Scene) -> None:
        blades = scene["blade"]
        blades[i], blades[j] = blades[j], blades[i]

    return edit


def copy_blade(source: int, target: int) -> Callable[[Scene], None]:
    """Return an edit that gives a blade another's numbers."""

    def edit(scene: Scene) -> None:
        scene["blade"][target] = copy.deepcopy(scene["blade"][source])

    return edit


def smooth_ramps(table: list[list[float]]) -> list[list[float]]:
    """Return a table whose ramps are smooth steps."""
    (t1, v1), (t2, v2) = table
    parts = np.linspace(0.0, 1.0, 41)
    return [[t1 + p * (t2 - t1), v1 + (3 * p**2 - 2 * p**3) * (v2 - v1)] for p in parts.tolist()]


# ---- integration -------------------------------------------------------------------------------


def midpoint(rotor: Rotor, time: float, y: Array, h: float) -> Array:
    """Return the state after a step of the explicit midpoint rule."""
    return np.asarray(y + h * rotor.slope(time + h / 2, y + h / 2 * rotor.slope(time, y)))


def velocity_verlet(rotor: Rotor, time: float, y: Array, h: float) -> Array:
    """Return the state after a step of Verlet's method, rates of half a step in the forces."""
    n = 1 + rotor.count
    half = y[n:] + h / 2 * rotor.accelerations(time, y)
    angles = y[:n] + h * half
    rates = half + h / 2 * rotor.accelerations(time + h, np.concatenate([angles, half]))
    return np.concatenate([angles, rates])


def rk4_wrong_stage(rotor: Rotor, time: float, y: Array, h: float) -> Array:
    """Return the state after a Runge-Kutta step whose last stage is at half the step."""
    k1 = rotor.slope(time, y)
    k2 = rotor.slope(time + h / 2, y + h / 2 * k1)
    k3 = rotor.slope(time + h / 2, y + h / 2 * k2)
    k4 = rotor.slope(time + h / 2, y + h / 2 * k3)
    return np.asarray(y + h / 6 * (k1 + 2 * k2 + 2 * k3 + k4))


def adams_bashforth(rotor: Rotor) -> Array:
    """Return the states of the two-step method of Adams and Bashforth, begun by Euler's."""
    times = rotor.times()
    h = times[1] - times[0]
    states = [rotor.initial_state()]
    last = rotor.slope(0.0, states[0])
    states.append(states[0] + h * last)
    for instant in times[1:-1]:
        slope = rotor.slope(instant, states[-1])
        states.append(states[-1] + h * (1.5 * slope - 0.5 * last))
        last = slope
    return np.array(states)


def by_steps(step: base.Step, steps: int = 1) -> Callable[[Rotor], Array]:
    """Return a solver of constant steps."""
    return lambda rotor: base.integrate_by_steps(rotor, step, steps)


# ---- exports -----------------------------------------------------------------------------------


def wrapped(data: Data) -> None:
    """Write the rotor's angle from -180 to 180 degrees."""
    data.angles[:, 0] = (data.angles[:, 0] + np.pi) % (2 * np.pi) - np.pi


def copy_joint(data: Data) -> None:
    """Write pitch 1 for pitch 2, angle and rate."""
    assert data.rates is not None
    data.angles[:, 2], data.rates[:, 2] = data.angles[:, 1], data.rates[:, 1]


def rows_lost(data: Data) -> Data:
    """Leave out 40 rows, and close the gap in the times."""
    n = len(data.time)
    kept = data.take([k for k in range(n) if not 90 <= k < 130])
    kept.time = data.time[: n - 40]
    return kept


def jitter(data: Data) -> Data:
    """Write times that scatter by a tenth of a step about those of the rows."""
    random = np.random.default_rng(11)
    step = data.time[1]
    noise = step * random.uniform(-0.1, 0.1, len(data.time))
    noise[0] = 0.0
    return Data(data.time + noise, data.angles, data.rates, data.loads)


def late_start(data: Data) -> Data:
    """Leave out the first 30 rows, and count the times from there."""
    kept = data.take(slice(30, None))
    kept.time = kept.time - kept.time[0]
    return kept


def ended_early(data: Data) -> None:
    """Repeat the state at 80 % of the run up to its end."""
    k = int(0.8 * len(data.time))
    data.angles[k:] = data.angles[k]
    assert data.rates is not None
    data.rates[k:] = data.rates[k]


def stuck_for_a_while(data: Data) -> None:
    """Repeat pitch 1 for 15 rows: its sensor failed."""
    data.angles[100:115, 1] = data.angles[100, 1]


def half_step_rates(data: Data) -> None:
    """Write the rates of half a step before, as leapfrog methods have them."""
    assert data.rates is not None
    data.rates[1:] = 0.5 * (data.rates[1:] + data.rates[:-1])


def nearest_rows(every: int) -> Callable[[Data], None]:
    """Return an export of the nearest of each `every`-th row."""

    def export(data: Data) -> None:
        n = len(data.time)
        rows = np.minimum(
            np.round(np.arange(n) / every).astype(int) * every, (n - 1) // every * every
        )
        data.angles[:] = data.angles[rows]
        assert data.rates is not None
        data.rates[:] = data.rates[rows]

    return export


def filter_rates(constant: float) -> Callable[[Data], None]:
    """Return an export with a first-order lag of the rotor's rate alone."""

    def export(data: Data) -> None:
        assert data.rates is not None
        part = 1 - np.exp(-(data.time[1] - data.time[0]) / constant)
        values = data.rates[:, 0]
        for k in range(1, len(values)):
            values[k] = values[k - 1] + part * (values[k] - values[k - 1])

    return export


def spikes(data: Data) -> None:
    """Put five outliers into the rotor's angle."""
    for k in (37, 80, 121, 155, 190):
        data.angles[k, 0] += 0.08 * (-1) ** k


def steps_of(column: str, joints: slice, size: float) -> Callable[[Data], None]:
    """Return an export rounded to the steps of a converter."""

    def export(data: Data) -> None:
        values = getattr(data, column)
        values[:, joints] = np.round(values[:, joints] / size) * size

    return export


def block_means(data: Data) -> Data:
    """Average each 4 rows, at the time of the first of them."""
    n = len(data.time) // 4 * 4
    assert data.rates is not None
    angles = data.angles[:n].reshape(n // 4, 4, -1).mean(axis=1)
    rates = data.rates[:n].reshape(n // 4, 4, -1).mean(axis=1)
    return Data(data.time[:n:4].copy(), angles, rates)


def gyro_rates(cone: float) -> Callable[[Data], None]:
    """Return an export of the rates that a gyroscope along the pitch axis measures."""

    def export(data: Data) -> None:
        assert data.rates is not None
        data.rates[:, 1:] += data.rates[:, :1] * np.sin(cone)

    return export


def factor_of(column: str, joints: Any, factor: float) -> Callable[[Data], None]:
    """Return an export with a factor in columns."""
    return base.scale(column, joints, factor)


def load_part(name: str, part: Any, factor: float) -> Callable[[Data], None]:
    """Return an export with a factor in a part of a load."""

    def export(data: Data) -> None:
        data.loads[name][part] *= factor

    return export


def in_base_frame(scene: str, names: Sequence[str]) -> Callable[[Data], None]:
    """Return an export of root loads in the base frame."""
    rotor = Rotor(SCENES[scene])

    def export(data: Data) -> None:
        for k, angles in enumerate(data.angles):
            turns = rotor.geometry(angles)[0]
            for name in names:
                data.loads[name][k] = times_rows(turns, data.loads[name][k])

    return export


def in_rotor_frame(scene: str) -> Callable[[Data], None]:
    """Return an export of root loads in the frame without pitch and cone."""
    cones = Rotor(SCENES[scene]).cone

    def export(data: Data) -> None:
        for k, angles in enumerate(data.angles):
            for i, cone in enumerate(cones):
                turn = turn_x(-cone) @ turn_z(angles[1 + i])
                for name in ("blade_root_force", "blade_root_moment"):
                    data.loads[name][k, i] = turn @ data.loads[name][k, i]

    return export


def shaft_in_rotating_frame(tilt: float) -> Callable[[Data], None]:
    """Return an export of the shaft's moment in axes that turn with the rotor, tilted."""

    def export(data: Data) -> None:
        for k, angles in enumerate(data.angles):
            turn = turn_x(tilt) @ turn_y(angles[0])
            data.loads["shaft_moment"][k] = turn.T @ data.loads["shaft_moment"][k]

    return export


def moment_arm_sign(radius: float) -> Callable[[Data], None]:
    """Return an export of root moments moved from the apex to the other side."""

    def export(data: Data) -> None:
        arm = np.array([0.0, 0.0, radius])
        data.loads["blade_root_moment"] += 2.0 * cross(arm, data.loads["blade_root_force"])

    return export


def without_blade(scene: str, blade: int) -> Callable[[Data], None]:
    """Return an export of a shaft force without one blade's."""
    rotor = Rotor(SCENES[scene])

    def export(data: Data) -> None:
        for k, angles in enumerate(data.angles):
            turn = rotor.geometry(angles)[0][blade]
            data.loads["shaft_force"][k] -= turn @ data.loads["blade_root_force"][k, blade]

    return export


def weight_again(scene: str, factor: float, tilted: bool = False) -> Callable[[Data], None]:
    """Return an export of root forces with more weight, or with weight along the tilted z."""
    rotor = Rotor(SCENES[scene])

    def export(data: Data) -> None:
        for k, angles in enumerate(data.angles):
            turns = rotor.geometry(angles)[0]
            for i in range(rotor.count):
                weight = rotor.mass[i] * rotor.weight
                added = weight - rotor.tilt @ weight if tilted else -factor * weight
                data.loads["blade_root_force"][k, i] += turns[i].T @ added

    return export


def hub_weight(change: float) -> Callable[[Data], None]:
    """Return an export with a force added to the shaft's along z."""

    def export(data: Data) -> None:
        data.loads["shaft_force"][:, 2] += change

    return export


def cycle_loads(data: Data) -> None:
    """Write the root loads of the next blade."""
    for name in ("blade_root_force", "blade_root_moment"):
        data.loads[name] = np.roll(data.loads[name], 1, axis=1)


def hold_loads(data: Data) -> None:
    """Repeat each second row of the loads."""
    rows = np.arange(len(data.time)) // 2 * 2
    for name, values in data.loads.items():
        data.loads[name] = values[rows]


def smooth_loads(data: Data) -> None:
    """Smooth the loads by a filter of second order."""
    b, a = signal.butter(2, 0.1)
    for name, values in data.loads.items():
        data.loads[name] = signal.filtfilt(b, a, values, axis=0)


def actuator_without_torque(scene: str) -> Callable[[Data], None]:
    """Return an export of the actuator's moment by spring and damper alone."""
    rotor = Rotor(SCENES[scene])

    def export(data: Data) -> None:
        for k, instant in enumerate(data.time):
            torques = rotor.pitch_torques(instant, instant > 0)
            data.loads["pitch_actuator_moment"][k] -= torques

    return export


# ---- the set -----------------------------------------------------------------------------------

RIGHT: dict[str, Mistake] = {
    "right_single": Mistake("single", "all digits, loads", loads=True),
    "right_pair": Mistake("pair", "all digits"),
    "right_trio": Mistake("trio", "all digits, loads", loads=True),
    "right_quad": Mistake("quad", "all digits, angles alone", rates=False),
    "right_small": Mistake("small", "all digits, in degrees", degrees=True),
    "right_points": Mistake("points", "all digits"),
    "right_single_6": Mistake("single", "6 digits", decimals="%.5e"),
    "right_pair_9": Mistake("pair", "9 digits, angles alone", decimals="%.9g", rates=False),
    "right_trio_7": Mistake("trio", "7 decimals, in degrees", decimals="%.7f", degrees=True),
    "right_quad_loads_8": Mistake("quad", "8 digits, loads", decimals="%.8g", loads=True),
    "right_small_5": Mistake("small", "5 decimals, in degrees", decimals="%.5f", degrees=True),
    "right_points_8": Mistake("points", "8 decimals, angles alone", decimals="%.8f", rates=False),
}

EQUATIONS: dict[str, Mistake] = {
    "e01": Mistake("single", "parallel axis theorem forgotten", edit=each_blade(steiner(-1.0))),
    "e02": Mistake("quad", "inertia moved by the distance from the root", edit=transport_from_root),
    "e03": Mistake("single", "half of ω x J ω", equations=("half_gyroscopic",)),
    "e04": Mistake(
        "points",
        "weight in the pitch equations with opposite sign",
        equations=("pitch_weight_sign",),
    ),
    "e05": Mistake("pair", "no weight in the rotor's equation", equations=("no_rotor_weight",)),
    "e06": Mistake(
        "trio",
        "Coriolis term of blade 1 with opposite sign",
        equations=("coriolis_of_blade_1_sign",),
    ),
    "e07": Mistake(
        "trio",
        "squares of the pitch rates missing in the rotor's equation",
        equations=("rotor_without_pitch_squares",),
    ),
    "e08": Mistake(
        "quad", "mass matrix: coupling of blade 1 alone", equations=("coupling_of_blade_1",)
    ),
    "e09": Mistake(
        "pair",
        "mass matrix: coupling without the products of inertia",
        equations=("coupling_without_products",),
    ),
    "e10": Mistake(
        "small", "rotor's inertia as at zero pitch", equations=("rotor_inertia_at_zero_pitch",)
    ),
    "e11": Mistake("pair", "mass matrix of the initial angles", equations=("matrix_at_start",)),
    "e12": Mistake(
        "pair", "dampers of the bearings per degree", edit=scale_at("bearing.damping", 180 / np.pi)
    ),
    "e13": Mistake("trio", "shaft damper with opposite sign", edit=scale_at("shaft.damping", -1.0)),
    "e14": Mistake("quad", "quadratic shaft damper", equations=("quadratic_shaft_damper",)),
    "e15": Mistake("single", "rest angle with opposite sign", edit=set_at("bearing.rest", -0.15)),
    "e16": Mistake("small", "spring with a cubic term", equations=("cubic_spring",)),
    "e17": Mistake("quad", "friction in the bearings", equations=("friction",)),
    "e18": Mistake("trio", "gravity of 9.81 in place of 9.80665", edit=set_at("gravity", 9.81)),
    "e19": Mistake("single", "gravity in ft/s^2", edit=set_at("gravity", 32.174)),
    "e20": Mistake("trio", "masses in lb taken as kg", edit=scale_blades("mass", 2.2046226)),
    "e21": Mistake("quad", "blades 2 and 3 exchanged", edit=exchange_blades(1, 2)),
    "e22": Mistake("quad", "azimuths in the order 1, 3, 2, 4", equations=("azimuths_1324",)),
    "e23": Mistake("quad", "blade 4 is blade 3", edit=copy_blade(2, 3)),
    "e24": Mistake("pair", "hub inertia 20 % too high", edit=scale_at("hub.inertia", 1.2)),
    "e25": Mistake(
        "single",
        "x of the centre of mass with opposite sign",
        edit=each_blade(base.move_centre(lambda x, y, z: [-x, y, z])),
    ),
    "e26": Mistake(
        "small",
        "x and y of the centre of mass exchanged",
        edit=each_blade(base.move_centre(lambda x, y, z: [y, x, z])),
    ),
    "e27": Mistake(
        "pair", "rotor torque 0.25 s late", edit=tables_at("torque.rotor", base.shift_rows(0.25))
    ),
    "e28": Mistake(
        "pair",
        "rotor torque held from row to row of its table",
        edit=tables_at("torque.rotor", base.hold_rows),
    ),
    "e29": Mistake(
        "trio", "rotor torque times an efficiency of 0.944", edit=scale_at("torque.rotor", 0.944)
    ),
    "e30": Mistake("pair", "commands in the opposite sense", edit=scale_at("bearing.rest", -1.0)),
    "e31": Mistake(
        "pair", "commands by smooth steps", edit=tables_at("bearing.rest", smooth_ramps)
    ),
    "e32": Mistake(
        "points", "pitch torque by the cosine of the pitch", equations=("pitch_torque_by_cosine",)
    ),
    "e33": Mistake(
        "trio",
        "initial rotor rate in rpm taken as rad/s",
        edit=set_at("initial.rates", [2.6 * np.pi / 30, 0.2, -0.5, 0.0]),
    ),
    "e34": Mistake(
        "pair",
        "cone of the second blade missing",
        edit=lambda scene: scene["blade"][1].pop("cone") and None,
    ),
    "e35": Mistake("trio", "dampers on the absolute spin", equations=("damper_on_sum",)),
}

INTEGRATION: dict[str, Mistake] = {
    "i01": Mistake("single", "explicit midpoint rule, step of 10 ms", solve=by_steps(midpoint)),
    "i02": Mistake("points", "velocity Verlet, step of 10 ms", solve=by_steps(velocity_verlet)),
    "i03": Mistake("small", "implicit Euler, step of 2 ms", solve=by_steps(base.implicit_euler)),
    "i04": Mistake(
        "pair", "RK4 with a wrong last stage, step of 10 ms", solve=by_steps(rk4_wrong_stage)
    ),
    "i05": Mistake("quad", "Adams-Bashforth of order 2, step of 10 ms", solve=adams_bashforth),
    "i06": Mistake(
        "trio",
        "RK23 with default tolerances",
        solve=lambda rotor: base.integrate_adaptively(rotor, "RK23", 1e-3, 1e-6),
    ),
    "i07": Mistake(
        "pair", "RK4, step of 10 ms across the jump at 1.505 s", solve=by_steps(base.rk4)
    ),
}

EXPORTS: dict[str, Mistake] = {
    "x01": Mistake("small", "rotor angle from -180 to 180 degrees", export=wrapped),
    "x02": Mistake(
        "trio",
        "rotor angle in revolutions, named rad",
        export=factor_of("angles", 0, 1 / (2 * np.pi)),
    ),
    "x03": Mistake(
        "quad", "pitch rates with opposite sign", export=factor_of("rates", slice(1, None), -1.0)
    ),
    "x04": Mistake(
        "pair",
        "pitches in degrees, named rad",
        export=factor_of("angles", slice(1, None), 180 / np.pi),
    ),
    "x05": Mistake(
        "trio",
        "pitch 2 with opposite sign",
        export=both(factor_of("angles", 2, -1.0), factor_of("rates", 2, -1.0)),
    ),
    "x06": Mistake("trio", "pitch 1 in the columns of pitch 2", export=copy_joint),
    "x07": Mistake("quad", "40 rows lost, times closed up", export=rows_lost),
    "x08": Mistake("points", "times that scatter by a tenth of a step", export=jitter),
    "x09": Mistake("single", "the first 30 rows left out, times from 0", export=late_start),
    "x10": Mistake("trio", "the last state repeated from 80 % on", export=ended_early),
    "x11": Mistake("single", "pitch 1 stuck for 15 rows", export=stuck_for_a_while),
    "x12": Mistake("pair", "rates of half a step before", export=half_step_rates),
    "x13": Mistake("quad", "nearest of each third row", export=nearest_rows(3)),
    "x14": Mistake("small", "rotor rate by a filter of 50 ms", export=filter_rates(0.05)),
    "x15": Mistake("points", "five outliers in the rotor angle", export=spikes),
    "x16": Mistake(
        "single",
        "pitch in steps of 0.1 degrees",
        export=steps_of("angles", slice(1, None), np.radians(0.1)),
    ),
    "x17": Mistake("small", "means of 4 rows", export=block_means),
    "x18": Mistake("trio", "rates of a gyroscope on the blade", export=gyro_rates(-0.05)),
    "x19": Mistake(
        "quad", "a gear of 1.001 in the rotor angle", export=factor_of("angles", 0, 1.001)
    ),
    "x20": Mistake(
        "pair",
        "rotor angle from another zero, 90 degrees",
        export=base.add_to("angles", 0, np.pi / 2),
    ),
}

LOADS: dict[str, Mistake] = {
    "l01": Mistake(
        "trio",
        "root loads in the base frame",
        loads=True,
        export=in_base_frame("trio", ["blade_root_force", "blade_root_moment"]),
    ),
    "l02": Mistake(
        "trio",
        "root loads in the rotor frame, neither coned nor pitched",
        loads=True,
        export=in_rotor_frame("trio"),
    ),
    "l03": Mistake(
        "quad",
        "root moments moved to the wrong side of the apex",
        loads=True,
        export=moment_arm_sign(0.9),
    ),
    "l04": Mistake(
        "single",
        "shaft moment in the rotating frame",
        loads=True,
        export=shaft_in_rotating_frame(0.07),
    ),
    "l05": Mistake(
        "trio", "shaft force without blade 3", loads=True, export=without_blade("trio", 2)
    ),
    "l06": Mistake(
        "quad", "root forces with twice the weight", loads=True, export=weight_again("quad", 1.0)
    ),
    "l07": Mistake(
        "trio",
        "weight of the blades along the tilted z",
        loads=True,
        export=weight_again("trio", 0.0, tilted=True),
    ),
    "l08": Mistake(
        "single",
        "hub's weight with opposite sign",
        loads=True,
        export=hub_weight(-2 * 700.0 * 9.81),
    ),
    "l09": Mistake("quad", "root loads of the next blade", loads=True, export=cycle_loads),
    "l10": Mistake(
        "single",
        "actuator moment without the torque",
        loads=True,
        export=actuator_without_torque("single"),
    ),
    "l11": Mistake(
        "trio",
        "actuator moment with opposite sign",
        loads=True,
        export=base.load_factor("pitch_actuator_moment", -1.0),
    ),
    "l12": Mistake(
        "quad",
        "z of the root forces in kN, named N",
        loads=True,
        export=load_part("blade_root_force", np.s_[:, :, 2], 1e-3),
    ),
    "l13": Mistake("trio", "every second row of the loads held", loads=True, export=hold_loads),
    "l14": Mistake("single", "loads by a Butterworth filter", loads=True, export=smooth_loads),
    "l15": Mistake(
        "quad",
        "root loads without centrifugal forces",
        loads=True,
        equations=("loads_without_centrifugal",),
    ),
}

MISTAKES: dict[str, Mistake] = {**EQUATIONS, **INTEGRATION, **EXPORTS, **LOADS}
ALL: dict[str, Mistake] = {**RIGHT, **MISTAKES}


# What a named cause has to say, written when the data had been compared, see `mistaken_data.NAMED`;
# of what has no entry no cause is known.
NAMED: dict[str, str] = {
    "e01": "without Steiner's share",
    "e02": "^inertia moved by the distance from the root",
    "e03": "^half of the gyroscopic moments .* about the blades' centres",
    "e04": "^opposite sign of gravity in the equations of the pitches",
    "e05": "^without gravity in the rotor's equation",
    "e07": "^without the squares of the pitch rates",
    "e12": "damping of the bearings per rad taken as per degree",
    "e13": "^opposite sign of the damper of the shaft",
    "e14": "^damper of the shaft quadratic",
    "e15": r"bearing.rest off by -0.3 rad|^opposite sign of the rest angles",
    "e18": "^gravity of 9.81 ",
    "e19": "^gravity of 32.174 ",
    "e20": "^masses of the blades in lb taken as kg",
    "e21": "^numbers of blades 3 and 2 exchanged",
    "e22": "^azimuths of blades 2 and 3 exchanged",
    "e23": "^numbers of blade 3 at blade 4",
    "e24": r"^hub.inertia off by \+20 %",
    "e25": r"centre_of_mass\[0\] with opposite sign",
    "e26": "^x and y of the centres of mass exchanged",
    "e27": "wrong or missing from t = .* on the rotor",
    "e28": "wrong or missing from t = .* on the rotor|^torque of the rotor held from row to row",
    "e29": "^torque.rotor off by -5.6 %",
    "e30": "^opposite sign of the rest angles",
    "e31": "wrong or missing from t = 0.2 to 1.2 s: .* on the pitch 1 .* on the pitch 2",
    "e33": "^another initial state",
    "e34": r"^blade\[1\].cone off by -0.05 rad|^numbers of blade 1 at",
    "e35": "^dampers of the bearings that see the rotor's rate",
    "i01": "^explicit midpoint rule with a step of 0.01 s",
    "i02": "^velocity Verlet method with a step of 0.01 s",
    "i03": "^implicit Euler method with a step of 0.002 s",
    "i07": "load of one interval, before t = 1.51 s",
    "x01": "^rotor: wrapped",
    "x02": "^rotor: turns taken as rad",
    "x03": "rate: sign reversed",
    "x04": "^pitch 1, pitch 2: degrees taken as rad",
    "x05": "^pitch 2, pitch 2 rate: sign reversed",
    "x06": "pitch 2 is pitch 1",
    "x07": "another state after t = 0.9 s",
    "x09": "constant lag of -0.3 s, 30 rows",
    "x10": "late by 0.0099 s more in each of 40 intervals from t = 1.6 to 2 s",
    "x11": "from t = 1 to 1.15 s, largest in the pitch 1",
    "x12": "rate: mean of 2 rows up to",
    "x13": "every row is held for 3 rows",
    "x14": "^rotor rate: smoothed by a filter of first order, time constant 0.05 s",
    "x15": "^a single wrong row: row (38|81|122|156|191)",
    "x16": "rounded to steps of 0.00174533 rad",
    "x17": "mean of 4 samples of the interval after",
    "x19": "^rotor: too large by a factor of 1.001",
    "x20": "^rotor: zero off by 1.5708",
    "l01": "in the base frame",
    "l02": "in the rotor frame",
    "l03": r"about the point \(0, 0, -1.8\)",
    "l04": "^shaft moment.*in the rotor frame",
    "l06": "with twice the weight",
    "l09": "exchanged: blade root force 1 is blade root force 4",
    "l10": "^pitch actuator moment 1: without the pitch torques",
    "l11": "^pitch actuator moment.*sign reversed",
    "l12": "^blade root force 1 z, .*kN taken as N",
    "l13": "every row is held for 2 rows",
    "l15": "without the forces of the rates",
}


def make_data(mistake: Mistake) -> Data:
    """Return the data of a mistake."""
    scene = copy.deepcopy(SCENES[mistake.scene])
    if mistake.edit is not None:
        mistake.edit(scene)
    rotor = Machine(scene, frozenset(mistake.equations))
    states = (mistake.solve or base.integrate_exactly)(rotor)
    width = 1 + rotor.count
    loads = rotor.loads(rotor.times(), states) if mistake.loads else {}
    rates = states[:, width:].copy() if mistake.rates else None
    data = Data(rotor.times(), states[:, :width].copy(), rates, loads)
    if mistake.export is not None:
        data = mistake.export(data) or data
    return data


def compared(name: str, folder: Path) -> dict[str, Any]:
    """Return status, causes and notes of a comparison, from FOLDER/NAME.json if it is there."""
    kept = folder / f"{name}.json"
    if not kept.exists():
        mistake = ALL[name]
        folder.mkdir(parents=True, exist_ok=True)
        scene = folder / f"{mistake.scene}{'-loads' if mistake.loads else ''}.toml"
        text = base.scene_text(SCENES[mistake.scene], title=mistake.scene, loads=mistake.loads)
        scene.write_text(text, encoding="utf-8")
        path = folder / f"{name}.csv"
        if not path.exists():
            make_data(mistake).write(path, mistake.decimals, mistake.degrees)
        start = time.perf_counter()
        comparison = rm.compare(str(path), str(scene))
        result = {
            "status": comparison.status,
            "likely": list(comparison.likely),
            "message": comparison.message,
            "seconds": round(time.perf_counter() - start, 1),
        }
        kept.write_text(json.dumps(result, indent=1), encoding="utf-8")
    return dict(json.loads(kept.read_text(encoding="utf-8")))


def verdict_of(name: str, status: str, causes: Sequence[str]) -> str:
    """Return what a comparison is worth, see `mistaken_data.verdict_of`."""
    pattern = None if name in RIGHT else NAMED.get(name, "")
    return base.judged(pattern, status, causes)


def main() -> None:
    """Compare the data and print what is said of them."""
    folder, names = Path(sys.argv[1]), sys.argv[2:] or list(ALL)
    counts = Counter[str]()
    for name in names:
        result = compared(name, folder)
        verdict = verdict_of(name, result["status"], result["likely"])
        if name in MISTAKES:
            counts[verdict] += 1
        causes = "; ".join(result["likely"]) or "no cause found"
        text = f"{ALL[name].scene} | {ALL[name].text}"
        print(f"| {name} | {text} | {result['status']} | {causes} | {verdict} |", flush=True)
    print(dict(counts))


if __name__ == "__main__":
    main()
