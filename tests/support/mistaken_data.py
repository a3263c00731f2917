"""Data of another program with one mistake each, written without a look at how `compare` searches.

    python tests/support/mistaken_data.py FOLDER [-o docs/mistakes-tried.md] [--data NAME,NAME]

computes the data of every scene by equations of its own (Newton's and Euler's laws, projected on
the joints), writes FOLDER/NAME.csv and the scenes, compares each file, keeps the result in
FOLDER/NAME.json (what is there already is not computed again), and writes the document's tables.
"""

from __future__ import annotations

import argparse
import copy
import itertools
import json
import re
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy import integrate, interpolate, signal

import rotor_mbs as rm

Array = NDArray[np.float64]
Scene = dict[str, Any]


# ---- scenes ------------------------------------------------------------------------------------

MASSES = [800.0, 900.0, 1000.0, 850.0]
CENTRES = [[0.3, -0.15, 5.0], [0.25, 0.2, 5.3], [-0.3, 0.1, 5.6], [0.2, 0.1, 5.2]]
INERTIAS = [
    [4000.0, 4100.0, 300.0, 30.0, -40.0, 25.0],
    [4050.0, 3900.0, 320.0, -35.0, 45.0, -30.0],
    [4200.0, 4150.0, 340.0, 40.0, 35.0, 20.0],
    [3900.0, 4000.0, 310.0, 20.0, -30.0, -25.0],
]


def general_blades(count: int, cones: Sequence[float] | None = None) -> list[dict[str, Any]]:
    """Return different blades with full inertia tensors.

    Parameters
    ----------
    count : int
        Number of blades.
    cones : sequence of float, optional
        Cone of each blade in rad.

    Returns
    -------
    list of dict
        Tables `[[blade]]` of a scene.
    """
    blades = []
    for i in range(count):
        blade = {"mass": MASSES[i], "centre_of_mass": CENTRES[i], "inertia": INERTIAS[i]}
        if cones is not None:
            blade["cone"] = cones[i]
        blades.append(blade)
    return blades


def paper_scene(angles: list[float], rates: list[float], samples: int) -> Scene:
    """Return a rotor of the paper, three point masses, from its initial state, over 3 s."""
    blade = {"mass": 15000.0, "centre_of_mass": [0.08544003745317531, 0.0, 15.42]}
    return {
        "blades": 3,
        "gravity": 9.8,
        "duration": 3.0,
        "samples": samples,
        "blade": [copy.deepcopy(blade) for _ in range(3)],
        "initial": {"angles": angles, "rates": rates},
    }


def nrel_scene() -> Scene:
    """Return the NREL 5-MW rotor with a stepped pitch command on stiff bearings."""
    inertia = [11776047 - 17740 * 20.475**2 + 9484, 11776047 - 17740 * 20.475**2 + 18731]
    blade = {
        "mass": 17740.0,
        "centre_of_mass": [0.1, 0.0, 1.5 + 20.475],
        "inertia": [*inertia, 9484 + 18731, 0.0, 0.0, 0.0],
    }
    torque = 97 * 43093.55
    speed = 12.1 * np.pi / 30
    return {
        "blades": 3,
        "gravity": 9.80665,
        "duration": 1.5,
        "samples": 301,
        "blade": [copy.deepcopy(blade) for _ in range(3)],
        "hub": {"inertia": 115926 + 97**2 * 534.116},
        "initial": {"angles": [0.0, 0.0, 0.0, 0.0], "rates": [speed, 0.0, 0.0, 0.0]},
        "torque": {"rotor": torque},
        "bearing": {
            "stiffness": 971.35e6,
            "damping": 206e3,
            "rest": [
                [0.5, 0.0],
                [0.5, float(np.radians(2))],
                [1.0, float(np.radians(2))],
                [1.2, 0.0],
            ],
        },
        "shaft": {"damping": torque / speed},
    }


SCENES: dict[str, Scene] = {
    "one": {
        "blades": 1,
        "gravity": 9.81,
        "duration": 3.0,
        "samples": 301,
        "blade": general_blades(1),
        "hub": {"inertia": 3000.0},
        "initial": {"angles": [0.9, 0.3], "rates": [0.4, -0.2]},
        "bearing": {"stiffness": 6000.0, "damping": 200.0, "rest": 0.1},
        "shaft": {"damping": 500.0},
    },
    "point_masses": paper_scene(
        [np.pi / 6, np.pi / 4, np.pi / 6, np.pi / 2], [np.pi / 10, 0, 0, 0], 301
    ),
    "tumbling": paper_scene([0.6, 0.5, 0.0, 0.2], [0.0, -1.0, 1.0, -0.8], 301),
    "two": {
        "blades": 2,
        "gravity": 9.81,
        "duration": 4.0,
        "samples": 401,
        "blade": [
            {
                "mass": 800.0,
                "centre_of_mass": [float(np.hypot(0.3, 0.1)), 0.0, 5.2],
                "inertia": [4000.0, 4100.0, 300.0, 0.0, -40.0, 0.0],
            }
            for _ in range(2)
        ],
        "hub": {"inertia": 5000.0},
        "initial": {"angles": [np.pi / 6, 0.1, -0.2], "rates": [0.0, 0.0, 0.0]},
        "torque": {"rotor": [[0.0, 0.0], [1.0, 4e4], [1.0, 2e4]]},
        "bearing": {"stiffness": 2e4, "damping": [30.0, 50.0]},
        "shaft": {"damping": 200.0},
    },
    "three": {
        "blades": 3,
        "gravity": 9.81,
        "duration": 2.0,
        "samples": 401,
        "blade": general_blades(3),
        "hub": {"inertia": 5000.0},
        "initial": {"angles": [0.6, 0.1, -0.2, 0.3], "rates": [1.5, -0.3, 0.5, 0.0]},
        "torque": {
            "rotor": 8000.0,
            "pitch": [
                700.0,
                [[0.2, 0.0], [0.6, 1500.0], [0.6, -900.0]],
                [[0.0, 0.0], [1.5, 800.0]],
            ],
        },
        "bearing": {
            "stiffness": [6000.0, 5000.0, 8000.0],
            "damping": [300.0, 500.0, 400.0],
            "rest": [
                0.2,
                [[0.4, 0.0], [1.0, 0.25]],
                [[0.5, 0.1], [0.5, -0.3], [0.9, -0.3], [1.2, 0.4]],
            ],
        },
        "shaft": {"damping": 4000.0},
    },
    "free": {
        "blades": 3,
        "gravity": 9.81,
        "duration": 3.0,
        "samples": 301,
        "blade": general_blades(3),
        "hub": {"inertia": 8000.0},
        "initial": {"angles": [0.2, 0.6, -0.4, 1.0], "rates": [1.0, 0.5, 0.0, -0.3]},
    },
    "four": {
        "blades": 4,
        "gravity": 9.81,
        "duration": 2.0,
        "samples": 201,
        "blade": general_blades(4, [-0.06, -0.06, -0.06, -0.06]),
        "hub": {"inertia": 5000.0, "radius": 1.2, "mass": 2000.0},
        "initial": {"angles": [0.7, 0.2, -0.4, 0.5, 0.9], "rates": [1.2, -0.3, 0.5, 0.0, 0.8]},
        "torque": {"rotor": [[0.0, 1e4], [1.0, 4e4]], "pitch": [900.0, 0.0, 0.0, -500.0]},
        "bearing": {
            "stiffness": [2e4, 1.5e4, 1e4, 3e4],
            "damping": [300.0, 200.0, 100.0, 400.0],
            "rest": [0.1, [[0.0, 0.0], [1.0, 0.3]], 0.0, -0.2],
        },
        "shaft": {"damping": 4000.0, "tilt": -0.09},
    },
    "nrel": nrel_scene(),
    "tilted": {
        "blades": 3,
        "gravity": 9.80665,
        "duration": 4.0,
        "samples": 201,
        "blade": [
            {
                "mass": 1200.0,
                "centre_of_mass": [0.2, 0.05, 6.0],
                "inertia": [9000.0, 9100.0, 200.0, 0.0, 30.0, -50.0],
            }
            for _ in range(3)
        ],
        "hub": {"inertia": 2000.0},
        "initial": {"angles": [0.0, 0.2, 0.2, 0.2], "rates": [1.0, 0.0, 0.0, 0.0]},
        "torque": {"rotor": 2e4},
        "bearing": {"stiffness": 3000.0, "damping": 80.0},
        "shaft": {"damping": 1e4, "tilt": 0.1},
    },
    "coned": {
        "blades": 2,
        "gravity": 9.81,
        "duration": 3.0,
        "samples": 301,
        "blade": general_blades(2, [0.15, 0.15]),
        "hub": {"inertia": 3000.0},
        "initial": {"angles": [0.3, -0.3, 0.6], "rates": [2.0, 0.0, 0.4]},
        "bearing": {"stiffness": [4000.0, 5000.0], "damping": [150.0, 100.0]},
    },
    "loads": {
        "blades": 3,
        "gravity": 9.81,
        "duration": 2.0,
        "samples": 201,
        "blade": general_blades(3),
        "hub": {"inertia": 5000.0, "radius": 1.0, "mass": 3000.0},
        "initial": {"angles": [0.3, 0.2, 0.1, -0.3], "rates": [1.8, 0.2, 0.0, -0.4]},
        "torque": {"rotor": [[0.0, 0.0], [2.0, 3e4]]},
        "bearing": {"stiffness": 2e4, "damping": [400.0, 300.0, 200.0], "rest": 0.05},
        "shaft": {"damping": 3000.0},
    },
}


def scene_text(scene: Mapping[str, Any], *, title: str, loads: bool) -> str:
    """Return a scene as the text of a TOML file."""
    outputs = ["angles", "rates", "loads"] if loads else ["angles", "rates"]
    top = {"title": title, "outputs": outputs}
    top.update({key: value for key, value in scene.items() if not isinstance(value, (dict, list))})
    lines = [f"{key} = {json.dumps(value)}" for key, value in top.items()]
    for blade in scene["blade"]:
        lines += ["", "[[blade]]"]
        lines += [f"{key} = {json.dumps(value)}" for key, value in blade.items()]
    for name in ("hub", "initial", "torque", "bearing", "shaft"):
        if name in scene:
            lines += ["", f"[{name}]"]
            lines += [f"{key} = {json.dumps(value)}" for key, value in scene[name].items()]
    return "\n".join(lines) + "\n"


# ---- loads over time ---------------------------------------------------------------------------


def is_table(value: Any) -> bool:
    """Tell whether a value of a scene is a table of rows [t, value]."""
    return (
        isinstance(value, list)
        and bool(value)
        and isinstance(value[0], list)
        and (len(value[0]) == 2 and not isinstance(value[0][0], list))
    )


def per_blade(value: Any, blades: int) -> list[Any]:
    """Return a value of a scene for each blade."""
    if isinstance(value, list) and not is_table(value):
        return value
    return [value] * blades


def value_at(value: Any, time: float, *, before: bool) -> float:
    """Return a number or table at a time; at a jump its value `before` or after it."""
    if not isinstance(value, list):
        return float(value)
    times = [row[0] for row in value]
    values = [row[1] for row in value]
    k = int(np.searchsorted(times, time, side="left" if before else "right"))
    if k == 0:
        return float(values[0])
    if k == len(times):
        return float(values[-1])
    part = (time - times[k - 1]) / (times[k] - times[k - 1])
    return float(values[k - 1] + part * (values[k] - values[k - 1]))


def slope_at(value: Any, time: float, *, before: bool) -> float:
    """Return the slope of a number or table at a time, `before` or after a kink."""
    if not isinstance(value, list):
        return 0.0
    times = [row[0] for row in value]
    k = int(np.searchsorted(times, time, side="left" if before else "right"))
    if k in (0, len(times)):
        return 0.0
    return float((value[k][1] - value[k - 1][1]) / (times[k] - times[k - 1]))


# ---- equations of motion -----------------------------------------------------------------------


def turn_x(angle: float) -> Array:
    """Return the rotation matrix about x."""
    c, s = np.cos(angle), np.sin(angle)
    return np.array([[1.0, 0.0, 0.0], [0.0, c, -s], [0.0, s, c]])


def turn_y(angle: float) -> Array:
    """Return the rotation matrix about y."""
    c, s = np.cos(angle), np.sin(angle)
    return np.array([[c, 0.0, s], [0.0, 1.0, 0.0], [-s, 0.0, c]])


def turn_z(angle: float) -> Array:
    """Return the rotation matrix about z."""
    c, s = np.cos(angle), np.sin(angle)
    return np.array([[c, -s, 0.0], [s, c, 0.0], [0.0, 0.0, 1.0]])


def dot(a: Array, b: Array) -> Array:
    """Return the scalar products of rows."""
    return np.add.reduce(a * b, axis=-1)


def cross(a: Array, b: Array) -> Array:
    """Return the vector products of rows; `np.cross` takes ten times as long for few rows."""
    first = a[..., [1, 2, 0]] * b[..., [2, 0, 1]]
    return np.asarray(first - a[..., [2, 0, 1]] * b[..., [1, 2, 0]])


def times_rows(matrices: Array, rows: Array) -> Array:
    """Return the product of each matrix with its row."""
    return np.asarray((matrices @ rows[:, :, None])[:, :, 0])


@dataclass
class Rotor:
    """Equations of motion of a scene, with mistakes.

    Parameters
    ----------
    scene : dict
        A scene.
    mistakes : frozenset of str
        Names of the mistakes in the equations.
    """

    scene: Scene
    mistakes: frozenset[str] = frozenset()

    def __post_init__(self) -> None:
        """Collect the parameters into arrays by blade."""
        scene = self.scene
        blades = scene["blade"]
        count = len(blades)
        self.count = count
        self.mass = np.array([blade["mass"] for blade in blades])
        self.centre = np.array([blade["centre_of_mass"] for blade in blades])
        self.inertia = np.zeros((count, 3, 3))
        for i, blade in enumerate(blades):
            xx, yy, zz, xy, xz, yz = blade.get("inertia", [0.0] * 6)
            self.inertia[i] = [[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]]
        self.cone = [blade.get("cone", 0.0) for blade in blades]
        hub = scene.get("hub", {})
        self.hub_inertia = hub.get("inertia", 0.0)
        self.hub_radius = hub.get("radius", 0.0)
        self.hub_mass = hub.get("mass", 0.0)
        shaft = scene.get("shaft", {})
        self.tilt = turn_x(shaft.get("tilt", 0.0))
        self.shaft_damping = shaft.get("damping", 0.0)
        bearing = scene.get("bearing", {})
        self.stiffness = np.array(per_blade(bearing.get("stiffness", 0.0), count), dtype=float)
        self.damping = np.array(per_blade(bearing.get("damping", 0.0), count), dtype=float)
        self.rest = per_blade(bearing.get("rest", 0.0), count)
        torque = scene.get("torque", {})
        self.rotor_torque = torque.get("rotor", 0.0)
        self.pitch_torque = per_blade(torque.get("pitch", 0.0), count)
        self.weight = scene["gravity"] * np.array(scene.get("down", [0.0, 0.0, -1.0]))
        self.sense = -1.0 if "azimuths_reversed" in self.mistakes else 1.0

    def kinks(self) -> list[float]:
        """Return the times at which a load has a kink or jump."""
        times: set[float] = set()
        for value in [self.rotor_torque, *self.rest, *self.pitch_torque]:
            if isinstance(value, list):
                times.update(row[0] for row in value)
        return sorted(times)

    def geometry(self, angles: Array) -> tuple[Array, Array, Array, Array, Array]:
        """Return rotations, shaft axis, pitch axes, centres of mass and inertias in the base."""
        turns = np.empty((self.count, 3, 3))
        for i in range(self.count):
            azimuth = angles[0] + self.sense * 2 * np.pi * i / self.count
            lean, pitch = turn_x(-self.cone[i]), turn_z(angles[1 + i])
            inner = pitch @ lean if "cone_after_pitch" in self.mistakes else lean @ pitch
            turns[i] = self.tilt @ turn_y(azimuth) @ inner
        axis = self.tilt[:, 1]
        if "cone_after_pitch" in self.mistakes:
            pitch_axes = np.array(
                [
                    self.tilt @ turn_y(angles[0] + 2 * np.pi * i / self.count) @ [0.0, 0.0, 1.0]
                    for i in range(self.count)
                ]
            )
        else:
            pitch_axes = turns[:, :, 2]
        centres = times_rows(turns, self.centre)
        inertias = turns @ self.inertia @ np.swapaxes(turns, 1, 2)
        return turns, axis, pitch_axes, centres, inertias

    def inertial(
        self, geometry: tuple[Array, ...], rate: float, pitch_rates: Array, accelerations: Array
    ) -> tuple[Array, Array]:
        """Return m a and d(J ω)/dt about the centre of mass of each blade."""
        _, axis, pitch_axes, centres, inertias = geometry
        omega = rate * axis + pitch_rates[:, None] * pitch_axes
        turning = (pitch_rates * rate)[:, None] * cross(axis, pitch_axes)
        alpha = accelerations[0] * axis + accelerations[1:, None] * pitch_axes + turning
        motion = cross(alpha, centres) + cross(omega, cross(omega, centres))
        spin = times_rows(inertias, omega)
        moment = times_rows(inertias, alpha)
        if "no_gyroscopic" not in self.mistakes:
            moment = moment + cross(omega, spin)
        return self.mass[:, None] * motion, moment

    def bias(
        self, geometry: tuple[Array, ...], rate: float, pitch_rates: Array
    ) -> tuple[Array, Array]:
        """Return the velocity terms of the rotor's and the pitches' equations by blade."""
        _, axis, pitch_axes, centres, _ = geometry
        force, moment = self.inertial(geometry, rate, pitch_rates, np.zeros(1 + self.count))
        rotor = dot(force, cross(axis, centres)) + moment @ axis
        pitch = dot(force, cross(pitch_axes, centres)) + dot(moment, pitch_axes)
        return rotor, pitch

    def mistaken_bias(
        self, geometry: tuple[Array, ...], rate: float, pitch_rates: Array
    ) -> tuple[Array, Array]:
        """Return the velocity terms with the mistakes in their parts."""
        mistakes = self.mistakes
        still = np.zeros(self.count)
        rotor, pitch = self.bias(geometry, rate, pitch_rates)
        if not mistakes:
            return rotor, pitch
        from_rotor = self.bias(geometry, rate, still)
        from_pitch = self.bias(geometry, 0.0, pitch_rates)
        coriolis = rotor - from_rotor[0] - from_pitch[0]
        if "no_coriolis" in mistakes:
            rotor = rotor - coriolis
        if "half_coriolis" in mistakes:
            rotor = rotor - 0.5 * coriolis
        if "coriolis_sign" in mistakes:
            rotor = rotor - 2 * coriolis
        if "no_pitch_rate_squared" in mistakes:
            rotor = rotor - from_pitch[0]
        if "no_centrifugal" in mistakes:
            pitch = pitch - from_rotor[1]
        if "double_centrifugal" in mistakes:
            pitch = pitch + from_rotor[1]
        if "centrifugal_sign" in mistakes:
            pitch = pitch - 2 * from_rotor[1]
        return rotor, pitch

    def bearing_moments(self, time: float, angles: Array, rates: Array, before: bool) -> Array:
        """Return the moments of springs and dampers on the blades."""
        rest = np.array([value_at(value, time, before=before) for value in self.rest])
        deflection = angles[1:] - rest
        if "sine_spring" in self.mistakes:
            deflection = np.sin(deflection)
        speed = rates[1:]
        if "damper_of_error" in self.mistakes:
            speed = speed - [slope_at(value, time, before=before) for value in self.rest]
        if "quadratic_damper" in self.mistakes:
            speed = speed * np.abs(speed)
        return -self.stiffness * deflection - self.damping * speed

    def pitch_torques(self, time: float, before: bool) -> Array:
        """Return the pitch torques."""
        return np.array([value_at(value, time, before=before) for value in self.pitch_torque])

    def accelerations(self, time: float, state: Array, before: bool = False) -> Array:
        """Return the accelerations of rotor and pitches at a state (angles, rates)."""
        mistakes = self.mistakes
        angles, rates = state[: 1 + self.count], state[1 + self.count :]
        geometry = self.geometry(angles)
        _, axis, pitch_axes, centres, inertias = geometry
        by_rotor, by_pitch = cross(axis, centres), cross(pitch_axes, centres)
        rotor_mass = self.mass * dot(by_rotor, by_rotor) + dot(inertias @ axis, axis[None, :])
        coupling = self.mass * dot(by_rotor, by_pitch) + dot(inertias @ axis, pitch_axes)
        pitch_mass = self.mass * dot(by_pitch, by_pitch)
        pitch_mass += dot(pitch_axes, times_rows(inertias, pitch_axes))
        if "no_coupling" in mistakes:
            coupling = 0.0 * coupling
        if "coupling_sign" in mistakes:
            coupling = -coupling
        rotor_bias, pitch_bias = self.mistaken_bias(geometry, rates[0], rates[1:])
        weights = self.mass[:, None] * self.weight
        pitch_weight = dot(weights, by_pitch)
        if "no_pitch_weight" in mistakes:
            pitch_weight = 0.0 * pitch_weight
        rotor_weight = dot(weights, by_rotor)
        if "weight_at_axis" in mistakes:
            on_axis = self.centre[:, 2, None] * pitch_axes
            rotor_weight = dot(weights, cross(axis, on_axis))
        actuator = self.bearing_moments(time, angles, rates, before)
        pitch_torque = self.pitch_torques(time, before)
        rotor_side = (
            value_at(self.rotor_torque, time, before=before) - self.shaft_damping * rates[0]
        )
        if "torque_reacts" in mistakes:
            rotor_side -= np.sum(pitch_torque)
        if "dampers_react" in mistakes:
            rotor_side += np.sum(self.damping * rates[1:])
        pitch_side = actuator + pitch_torque + pitch_weight - pitch_bias
        rotor_side += np.sum(rotor_weight - rotor_bias)
        reduced = self.hub_inertia + np.sum(rotor_mass - coupling**2 / pitch_mass)
        rotor = (rotor_side - np.sum(coupling / pitch_mass * pitch_side)) / reduced
        return np.concatenate([[rotor], (pitch_side - coupling * rotor) / pitch_mass])

    def slope(self, time: float, state: Array, before: bool = False) -> Array:
        """Return the derivative of a state."""
        rates = state[1 + self.count :]
        return np.concatenate([rates, self.accelerations(time, state, before)])

    def initial_state(self) -> Array:
        """Return the initial angles and rates."""
        initial = self.scene["initial"]
        return np.array([*initial["angles"], *initial["rates"]], dtype=float)

    def times(self) -> Array:
        """Return the times of the samples."""
        return np.linspace(0.0, self.scene["duration"], self.scene["samples"])

    def loads(self, times: Array, states: Array) -> dict[str, Array]:
        """Return the loads at states by Newton's and Euler's laws.

        Parameters
        ----------
        times : ndarray, shape (n,)
            Times in s.
        states : ndarray, shape (n, 2 + 2 blades)
            Angles and rates.

        Returns
        -------
        dict of ndarray
            Loads by the names of docs/loads.md.
        """
        rows: dict[str, list[Array]] = {name: [] for name in LOADS}
        mistakes = self.mistakes
        for time, state in zip(times, states, strict=True):
            angles, rates = state[: 1 + self.count], state[1 + self.count :]
            geometry = self.geometry(angles)
            turns, axis, _, centres, _ = geometry
            accelerations = self.accelerations(time, state, before=time > 0)
            if "loads_without_accelerations" in mistakes:
                accelerations = 0.0 * accelerations
            force, moment = self.inertial(geometry, rates[0], rates[1:], accelerations)
            if "loads_without_centrifugal" in mistakes:
                still = np.zeros(self.count)
                force, moment = self.inertial(geometry, 0.0, still, accelerations)
            if "loads_static" in mistakes:
                force, moment = 0.0 * force, 0.0 * moment
            if "loads_without_inertia_moment" in mistakes:
                moment = 0.0 * moment
            weights = self.mass[:, None] * self.weight
            if "loads_without_weight" not in mistakes:
                force = force - weights
            apex = cross(centres, force) + moment
            if "moment_about_centre_of_mass" in mistakes:
                apex = moment
            root_force = np.einsum("nji,nj->ni", turns, force)
            root_moment = np.einsum("nji,nj->ni", turns, apex)
            if "moment_about_apex" not in mistakes:
                root_moment -= cross(np.array([0.0, 0.0, self.hub_radius]), root_force)
            hub_weight = 0.0 if "loads_without_weight" in mistakes else self.hub_mass
            shaft_force = force.sum(axis=0) - hub_weight * self.weight
            torque = value_at(self.rotor_torque, time, before=time > 0)
            along = self.hub_inertia * accelerations[0] - torque
            if "shaft_moment_with_torque" in mistakes:
                along += torque
            if "shaft_moment_without_hub" in mistakes:
                along -= self.hub_inertia * accelerations[0]
            shaft_moment = apex.sum(axis=0) + along * axis
            actuator = self.bearing_moments(time, angles, rates, before=time > 0)
            actuator = actuator + self.pitch_torques(time, before=time > 0)
            values = [root_force, root_moment, shaft_force, shaft_moment, actuator]
            for name, value in zip(LOADS, values, strict=True):
                rows[name].append(value)
        return {name: np.array(values) for name, values in rows.items()}


LOADS = (
    "blade_root_force",
    "blade_root_moment",
    "shaft_force",
    "shaft_moment",
    "pitch_actuator_moment",
)


# ---- integration -------------------------------------------------------------------------------


def integrate_exactly(rotor: Rotor, tolerance: float = 1e-12, method: str = "DOP853") -> Array:
    """Return the states at the samples, integrated from kink to kink of the loads."""
    times = rotor.times()
    end = times[-1]
    bounds = [0.0, *[time for time in rotor.kinks() if 0 < time < end], end]
    states = np.empty((len(times), 2 * (1 + rotor.count)))
    state = rotor.initial_state()
    states[0] = state
    for start, stop in itertools.pairwise(bounds):

        def slope(time: float, y: Array, start: float = start, stop: float = stop) -> Array:
            # At both ends the loads of this interval, not those beyond a jump.
            return rotor.slope(time, y, before=time - start > 0.5 * (stop - start))

        inside = (times > start + 1e-12) & (times <= stop + 1e-12)
        points = np.append(np.minimum(times[inside], stop), stop)
        solution = integrate.solve_ivp(
            slope,
            (start, stop),
            state,
            method,
            rtol=tolerance,
            atol=tolerance,
            dense_output=False,
            t_eval=np.unique(points),
        )
        states[inside] = solution.y.T[: np.count_nonzero(inside)]
        state = solution.y[:, -1]
    return states


def integrate_adaptively(rotor: Rotor, method: str, relative: float, absolute: float) -> Array:
    """Return the states of one of SciPy's methods with loose tolerances, across all kinks."""
    times = rotor.times()
    solution = integrate.solve_ivp(
        rotor.slope,
        (0.0, times[-1]),
        rotor.initial_state(),
        method,
        times,
        rtol=relative,
        atol=absolute,
    )
    return solution.y.T


Step = Callable[[Rotor, float, Array, float], Array]


def integrate_by_steps(rotor: Rotor, step: Step, steps: int, dtype: Any = float) -> Array:
    """Return the states of a method of a constant step, `steps` of them between two samples."""
    times = rotor.times()
    h = (times[1] - times[0]) / steps
    state = rotor.initial_state().astype(dtype)
    states = [state]
    for k in range((len(times) - 1) * steps):
        state = step(rotor, k * h, state, h).astype(dtype)
        if (k + 1) % steps == 0:
            states.append(state)
    return np.array(states, dtype=float)


def euler(rotor: Rotor, time: float, y: Array, h: float) -> Array:
    """Return the state after an explicit Euler step."""
    return y + h * rotor.slope(time, y)


def symplectic_euler(rotor: Rotor, time: float, y: Array, h: float) -> Array:
    """Return the state after a semi-implicit Euler step."""
    n = 1 + rotor.count
    rates = y[n:] + h * rotor.accelerations(time, y)
    return np.concatenate([y[:n] + h * rates, rates])


def heun(rotor: Rotor, time: float, y: Array, h: float) -> Array:
    """Return the state after a step of Heun's method."""
    k1 = rotor.slope(time, y)
    return y + h / 2 * (k1 + rotor.slope(time + h, y + h * k1))


def rk4(rotor: Rotor, time: float, y: Array, h: float) -> Array:
    """Return the state after a step of the classical Runge-Kutta method."""
    k1 = rotor.slope(time, y)
    k2 = rotor.slope(time + h / 2, y + h / 2 * k1)
    k3 = rotor.slope(time + h / 2, y + h / 2 * k2)
    k4 = rotor.slope(time + h, y + h * k3)
    return y + h / 6 * (k1 + 2 * k2 + 2 * k3 + k4)


def rk4_held(rotor: Rotor, time: float, y: Array, h: float) -> Array:
    """Return the state after a Runge-Kutta step with the loads of its start."""
    k1 = rotor.slope(time, y)
    k2 = rotor.slope(time, y + h / 2 * k1)
    k3 = rotor.slope(time, y + h / 2 * k2)
    k4 = rotor.slope(time, y + h * k3)
    return y + h / 6 * (k1 + 2 * k2 + 2 * k3 + k4)


def implicit_euler(rotor: Rotor, time: float, y: Array, h: float) -> Array:
    """Return the state after an implicit Euler step, solved by iteration."""
    new = y + h * rotor.slope(time, y)
    for _ in range(12):
        new = y + h * rotor.slope(time + h, new)
    return new


def trapezoidal(rotor: Rotor, time: float, y: Array, h: float) -> Array:
    """Return the state after a step of the trapezoidal rule, solved by iteration."""
    first = rotor.slope(time, y)
    new = y + h * first
    for _ in range(12):
        new = y + h / 2 * (first + rotor.slope(time + h, new))
    return new


# ---- data --------------------------------------------------------------------------------------


@dataclass
class Data:
    """Results of a program: times in s, angles in rad, rates in rad/s and loads."""

    time: Array
    angles: Array
    rates: Array | None
    loads: dict[str, Array] = field(default_factory=dict)

    def write(self, path: Path, decimals: str, degrees: bool) -> None:
        """Write the data as CSV."""
        factor, unit = (180 / np.pi, "deg") if degrees else (1.0, "rad")
        names, columns = ["time [s]"], [self.time]
        blades = self.angles.shape[1] - 1
        joints = ["rotor", *[f"pitch {i + 1}" for i in range(blades)]]
        for k, joint in enumerate(joints):
            names.append(f"{joint} [{unit}]")
            columns.append(self.angles[:, k] * factor)
        if self.rates is not None:
            for k, joint in enumerate(joints):
                names.append(f"{joint} rate [{unit}/s]")
                columns.append(self.rates[:, k] * factor)
        for name, values in self.loads.items():
            unit = "N" if name.endswith("force") else "N m"
            if name == "pitch_actuator_moment":
                labels = [f"{name}_{i + 1}" for i in range(blades)]
            elif name.startswith("shaft"):
                labels = [f"{name}_{axis}" for axis in "xyz"]
            else:
                labels = [f"{name}_{i + 1}_{axis}" for i in range(blades) for axis in "xyz"]
            names += [f"{label} [{unit}]" for label in labels]
            columns += list(values.reshape(len(values), -1).T)
        lines = [",".join(names)]
        for row in zip(*columns, strict=True):
            lines.append(",".join(decimals % value for value in row))
        path.write_text("\n".join(lines) + "\n", encoding="utf-8")

    def take(self, rows: Any) -> Data:
        """Return some rows of the data."""
        loads = {name: values[rows] for name, values in self.loads.items()}
        rates = None if self.rates is None else self.rates[rows]
        return Data(self.time[rows], self.angles[rows], rates, loads)


# ---- mistakes ----------------------------------------------------------------------------------


@dataclass(frozen=True)
class Mistake:
    """A file of data with a mistake.

    Parameters
    ----------
    scene : str
        Name of the scene.
    text : str
        The mistake in words.
    edit : callable, optional
        Changes the scene that the program computes.
    equations : tuple of str
        Mistakes in the equations or in the computation of the loads.
    solve : callable, optional
        Integrates; by default DOP853 with a tolerance of 1e-12.
    export : callable, optional
        Changes the data.
    loads : bool
        Whether the data have loads.
    rates : bool
        Whether the data have rates.
    decimals : str
        Format of the numbers.
    degrees : bool
        Whether angles are written in degrees.
    """

    scene: str
    text: str
    edit: Callable[[Scene], None] | None = None
    equations: tuple[str, ...] = ()
    solve: Callable[[Rotor], Array] | None = None
    export: Callable[[Data], Data | None] | None = None
    loads: bool = False
    rates: bool = True
    decimals: str = "%.17g"
    degrees: bool = False


def set_at(path: str, value: Any) -> Callable[[Scene], None]:
    """Return an edit that sets a key, `table.key`."""

    def edit(scene: Scene) -> None:
        *tables, key = path.split(".")
        place = scene
        for table in tables:
            place = place.setdefault(table, {})
        place[key] = value

    return edit


def scale_at(path: str, factor: float) -> Callable[[Scene], None]:
    """Return an edit that multiplies a value, a list or the values of tables."""

    def scaled(value: Any) -> Any:
        if is_table(value):
            return [[time, factor * number] for time, number in value]
        if isinstance(value, list):
            return [scaled(entry) for entry in value]
        return factor * value

    def edit(scene: Scene) -> None:
        table, key = path.split(".")
        scene[table][key] = scaled(scene[table][key])

    return edit


def tables_at(path: str, change: Callable[[list[list[float]]], list[list[float]]]) -> Any:
    """Return an edit that changes all tables of a value."""

    def changed(value: Any) -> Any:
        if is_table(value):
            return change(value)
        if isinstance(value, list):
            return [changed(entry) for entry in value]
        return value

    def edit(scene: Scene) -> None:
        table, key = path.split(".")
        scene[table][key] = changed(scene[table][key])

    return edit


def each_blade(change: Callable[[dict[str, Any]], None]) -> Callable[[Scene], None]:
    """Return an edit of all blades."""

    def edit(scene: Scene) -> None:
        for blade in scene["blade"]:
            change(blade)

    return edit


def reorder(path: str, order: Sequence[int]) -> Callable[[Scene], None]:
    """Return an edit that gives the values of blades to others."""

    def edit(scene: Scene) -> None:
        table, key = path.split(".")
        values = per_blade(scene[table][key], scene["blades"])
        scene[table][key] = [values[i] for i in order]

    return edit


def products(sign: Sequence[float]) -> Callable[[dict[str, Any]], None]:
    """Return a change of a blade's products of inertia."""

    def change(blade: dict[str, Any]) -> None:
        inertia = blade["inertia"]
        blade["inertia"] = inertia[:3] + [a * b for a, b in zip(sign, inertia[3:], strict=True)]

    return change


def steiner(sign: float) -> Callable[[dict[str, Any]], None]:
    """Return a change of a blade's inertia by the Steiner term about the apex."""

    def change(blade: dict[str, Any]) -> None:
        x, y, z = blade["centre_of_mass"]
        terms = [y * y + z * z, x * x + z * z, x * x + y * y, -x * y, -x * z, -y * z]
        mass = blade["mass"]
        blade["inertia"] = [
            a + sign * mass * b for a, b in zip(blade["inertia"], terms, strict=True)
        ]

    return change


def swap_xx_yy(blade: dict[str, Any]) -> None:
    """Exchange the moments of inertia about x and y."""
    xx, yy, *others = blade["inertia"]
    blade["inertia"] = [yy, xx, *others]


def move_centre(change: Callable[[float, float, float], list[float]]) -> Any:
    """Return a change of a blade's centre of mass."""

    def edit(blade: dict[str, Any]) -> None:
        blade["centre_of_mass"] = change(*blade["centre_of_mass"])

    return edit


def hold_rows(table: list[list[float]]) -> list[list[float]]:
    """Return a table with each value held until the next row."""
    rows = [table[0]]
    for (_, value), (time, after) in itertools.pairwise(table):
        rows += [[time, value], [time, after]]
    return rows


def samples_of_table(step: float, end: float) -> Callable[[list[list[float]]], list[list[float]]]:
    """Return a change that holds a table over a controller's cycle."""

    def change(table: list[list[float]]) -> list[list[float]]:
        rows: list[list[float]] = []
        for k in range(round(end / step)):
            value = value_at(table, k * step, before=False)
            if rows and rows[-1][1] == value:
                continue
            if rows:
                rows.append([k * step, rows[-1][1]])
            rows.append([k * step, value])
        return rows

    return change


def shift_rows(delay: float) -> Callable[[list[list[float]]], list[list[float]]]:
    """Return a change that delays a table."""
    return lambda table: [[time + delay, value] for time, value in table]


def extend_rows(table: list[list[float]]) -> list[list[float]]:
    """Return a table that goes on with its last slope, unless it ends with a jump."""
    (t1, v1), (t2, v2) = table[-2:]
    if t1 == t2:
        return table
    return [*table, [t2 + 10.0, v2 + (v2 - v1) / (t2 - t1) * 10.0]]


def smooth_jumps(table: list[list[float]]) -> list[list[float]]:
    """Return a table whose jumps are ramps from the row before (the first row is dropped)."""
    is_before_jump = [row[0] == after[0] for row, after in itertools.pairwise(table)]
    return [
        row for row, left_out in zip(table, [*is_before_jump, False], strict=True) if not left_out
    ]


# ---- exports -----------------------------------------------------------------------------------


def swap(column: str, i: int, j: int) -> Callable[[Data], None]:
    """Return an export that exchanges two columns of an array."""

    def export(data: Data) -> None:
        values = getattr(data, column)
        values[:, [i, j]] = values[:, [j, i]]

    return export


def swap_joints(i: int, j: int) -> Callable[[Data], None]:
    """Return an export that exchanges two joints, angles and rates."""

    def export(data: Data) -> None:
        for values in (data.angles, data.rates):
            if values is not None:
                values[:, [i, j]] = values[:, [j, i]]

    return export


def gradient_rates(data: Data) -> None:
    """Replace the rates by central differences of the angles."""
    data.rates = np.gradient(data.angles, data.time, axis=0)


def backward_rates(data: Data) -> None:
    """Replace the rates by backward differences of the angles; the first row stays."""
    assert data.rates is not None
    data.rates[1:] = np.diff(data.angles, axis=0) / np.diff(data.time)[:, None]


def forward_rates(data: Data) -> None:
    """Replace the rates by forward differences of the angles; the last row stays."""
    assert data.rates is not None
    data.rates[:-1] = np.diff(data.angles, axis=0) / np.diff(data.time)[:, None]


def late(data: Data) -> None:
    """Write the angles and rates of the row before; the first row twice."""
    for values in (data.angles, data.rates):
        if values is not None:
            values[1:] = values[:-1].copy()


def late_channel(column: str, k: int, rows: int = 1) -> Callable[[Data], None]:
    """Return an export that has one channel late."""

    def export(data: Data) -> None:
        values = getattr(data, column)[:, k]
        values[rows:] = values[:-rows].copy()

    return export


def times_one_step_on(data: Data) -> Data:
    """Label each row with the end of its step: the initial state is at h."""
    step = data.time[1]
    return Data(data.time + step, data.angles, data.rates, data.loads)


def first_row_lost(data: Data) -> Data:
    """Leave out the first row and begin the times at 0."""
    kept = data.take(slice(1, None))
    kept.time = kept.time - kept.time[0]
    return kept


def row_lost_times_renumbered(data: Data) -> Data:
    """Leave out a row in the middle and number the times on."""
    n = len(data.time)
    kept = data.take([k for k in range(n) if k != n // 3])
    kept.time = data.time[:-1]
    return kept


def resample(kind: str, every: int) -> Callable[[Data], None]:
    """Return an export that interpolates between each `every`-th row."""

    def export(data: Data) -> None:
        coarse = data.time[::every]
        for values in (data.angles, data.rates):
            if values is None:
                continue
            if kind == "linear":
                for k in range(values.shape[1]):
                    values[:, k] = np.interp(data.time, coarse, values[::every, k])
            else:
                values[:] = interpolate.CubicSpline(coarse, values[::every])(data.time)

    return export


def low_pass(data: Data) -> None:
    """Smooth all channels by a Butterworth filter, forwards and backwards."""
    b, a = signal.butter(2, 0.1)
    for values in (data.angles, data.rates):
        if values is not None:
            values[:] = signal.filtfilt(b, a, values, axis=0)


def lag(constant: float) -> Callable[[Data], None]:
    """Return an export with a first-order lag in all channels."""

    def export(data: Data) -> None:
        step = data.time[1] - data.time[0]
        part = 1 - np.exp(-step / constant)
        for values in (data.angles, data.rates):
            if values is not None:
                for k in range(1, len(values)):
                    values[k] = values[k - 1] + part * (values[k] - values[k - 1])

    return export


def moving_average(data: Data) -> None:
    """Average all channels over three rows; the ends stay."""
    for values in (data.angles, data.rates):
        if values is not None:
            values[1:-1] = (values[:-2] + values[1:-1] + values[2:]) / 3


def interval_means(data: Data) -> None:
    """Write the mean of each interval at its end; the first row stays."""
    for values in (data.angles, data.rates):
        if values is not None:
            values[1:] = 0.5 * (values[1:] + values[:-1])


def hold(every: int) -> Callable[[Data], None]:
    """Return an export that repeats each `every`-th row."""

    def export(data: Data) -> None:
        rows = (np.arange(len(data.time)) // every) * every
        for values in (data.angles, data.rates):
            if values is not None:
                values[:] = values[rows]

    return export


def hold_rates(every: int) -> Callable[[Data], None]:
    """Return an export that repeats each `every`-th row of the rates alone."""

    def export(data: Data) -> None:
        assert data.rates is not None
        rows = (np.arange(len(data.time)) // every) * every
        data.rates[:] = data.rates[rows]

    return export


def clip(k: int, low: float, high: float) -> Callable[[Data], None]:
    """Return an export that clips an angle."""

    def export(data: Data) -> None:
        data.angles[:, k] = np.clip(data.angles[:, k], low, high)

    return export


def add_to(column: str, k: int, offset: float, first: int = 0) -> Callable[[Data], None]:
    """Return an export with an offset in one channel, from a row on."""

    def export(data: Data) -> None:
        getattr(data, column)[first:, k] += offset

    return export


def scale(column: str, k: Any, factor: float) -> Callable[[Data], None]:
    """Return an export with a factor in channels."""

    def export(data: Data) -> None:
        getattr(data, column)[:, k] *= factor

    return export


def noise(size: float) -> Callable[[Data], None]:
    """Return an export with noise in all channels but the first row."""

    def export(data: Data) -> None:
        random = np.random.default_rng(7)
        for values in (data.angles, data.rates):
            if values is not None:
                values[1:] += size * random.standard_normal(values[1:].shape)

    return export


def half_precision(data: Data) -> None:
    """Round all channels to 16 bits."""
    data.angles = data.angles.astype(np.float16).astype(float)
    if data.rates is not None:
        data.rates = data.rates.astype(np.float16).astype(float)


def encoder(k: int, counts: int) -> Callable[[Data], None]:
    """Return an export of an angle by the counts of an encoder."""

    def export(data: Data) -> None:
        size = 2 * np.pi / counts
        data.angles[:, k] = np.floor(data.angles[:, k] / size) * size

    return export


def clock(factor: float) -> Callable[[Data], Data]:
    """Return an export with a clock that runs fast."""
    return lambda data: Data(factor * data.time, data.angles, data.rates, data.loads)


def single_precision_clock(data: Data) -> Data:
    """Sum the times in single precision."""
    step = np.float32(data.time[1])
    times = np.cumsum(np.full(len(data.time), step, dtype=np.float32), dtype=np.float32) - step
    return Data(times.astype(float), data.angles, data.rates, data.loads)


def pitch_from_start(data: Data) -> None:
    """Write the pitches from their initial values."""
    data.angles[:, 1:] -= data.angles[0, 1:]


def absolute_rates(data: Data) -> None:
    """Write the spin of a blade about its pitch axis with the rotor's rate added."""
    assert data.rates is not None
    data.rates[:, 1:] += data.rates[:, :1]


def spike(k: int, size: float) -> Callable[[Data], None]:
    """Return an export with one wrong value."""

    def export(data: Data) -> None:
        data.angles[len(data.time) // 2, k] += size

    return export


def mean_of_pitches(data: Data) -> None:
    """Write the collective pitch, the mean, for all blades."""
    data.angles[:, 1:] = data.angles[:, 1:].mean(axis=1, keepdims=True)
    if data.rates is not None:
        data.rates[:, 1:] = data.rates[:, 1:].mean(axis=1, keepdims=True)


def load_factor(name: str, factor: float) -> Callable[[Data], None]:
    """Return an export with a factor in one kind of load, or all that begin so."""

    def export(data: Data) -> None:
        for key in data.loads:
            if key.startswith(name):
                data.loads[key] = factor * data.loads[key]

    return export


def load_late(name: str) -> Callable[[Data], None]:
    """Return an export with loads a row late."""

    def export(data: Data) -> None:
        for key, values in data.loads.items():
            if key.startswith(name):
                values[1:] = values[:-1].copy()

    return export


def swap_axes(name: str, i: int, j: int) -> Callable[[Data], None]:
    """Return an export with two components of a load exchanged."""

    def export(data: Data) -> None:
        values = data.loads[name]
        values[..., [i, j]] = values[..., [j, i]]

    return export


def swap_blades(name: str, i: int, j: int) -> Callable[[Data], None]:
    """Return an export with the loads of two blades exchanged."""

    def export(data: Data) -> None:
        values = data.loads[name]
        values[:, [i, j]] = values[:, [j, i]]

    return export


def in_coned_frame(name: str, sign: float = 1.0) -> Callable[[Data], None]:
    """Return an export of a root load that does not pitch with the blade."""

    def export(data: Data) -> None:
        values = data.loads[name]
        c, s = np.cos(data.angles[:, 1:]), sign * np.sin(data.angles[:, 1:])
        x, y = values[..., 0].copy(), values[..., 1].copy()
        values[..., 0], values[..., 1] = c * x - s * y, s * x + c * y

    return export


def in_rotor_frame(name: str) -> Callable[[Data], None]:
    """Return an export of a shaft load in axes that turn with the rotor (no tilt)."""

    def export(data: Data) -> None:
        values = data.loads[name]
        c, s = np.cos(data.angles[:, 0]), np.sin(data.angles[:, 0])
        x, z = values[:, 0].copy(), values[:, 2].copy()
        values[:, 0], values[:, 2] = c * x - s * z, s * x + c * z

    return export


def in_shaft_frame(tilt: float) -> Callable[[Data], None]:
    """Return an export of the shaft's loads in the tilted frame."""

    def export(data: Data) -> None:
        for key in ("shaft_force", "shaft_moment"):
            data.loads[key] = data.loads[key] @ turn_x(tilt)

    return export


def add_load(name: str, factor: float) -> Callable[[Data], None]:
    """Return an export whose actuator moment lacks a damper's share."""

    def export(data: Data) -> None:
        assert data.rates is not None
        data.loads[name] = data.loads[name] + factor * data.rates[:, 1:]

    return export


def both(*exports: Callable[[Data], Data | None]) -> Callable[[Data], Data]:
    """Return exports one after the other."""

    def export(data: Data) -> Data:
        for change in exports:
            data = change(data) or data
        return data

    return export


def no_blade_products(scene: Scene) -> None:
    """Drop the products of inertia."""
    each_blade(products([0.0, 0.0, 0.0]))(scene)


def heavier_blade(factor: float, i: int) -> Callable[[Scene], None]:
    """Return an edit of the mass of one blade."""

    def edit(scene: Scene) -> None:
        scene["blade"][i]["mass"] *= factor

    return edit


def first_blade_for_all(scene: Scene) -> None:
    """Give all blades the mass, centre and inertia of blade 1."""
    scene["blade"] = [copy.deepcopy(scene["blade"][0]) for _ in scene["blade"]]


def stepper(step: Step, steps: int, dtype: Any = float) -> Callable[[Rotor], Array]:
    """Return an integration by constant steps."""
    return lambda rotor: integrate_by_steps(rotor, step, steps, dtype)


def adaptive(method: str, relative: float, absolute: float) -> Callable[[Rotor], Array]:
    """Return an integration by a method of SciPy."""
    return lambda rotor: integrate_adaptively(rotor, method, relative, absolute)


def drop_key(path: str) -> Callable[[Scene], None]:
    """Return an edit that removes a key."""

    def edit(scene: Scene) -> None:
        table, key = path.split(".")
        del scene[table][key]

    return edit


DEGREE = np.pi / 180
G_UP = [0.0, 0.0, 1.0]

RIGHT: dict[str, Mistake] = {
    f"right_{scene}": Mistake(scene, "none", loads=scene in ("four", "nrel", "loads"))
    for scene in SCENES
}

EQUATIONS: dict[str, Mistake] = {
    "e01": Mistake("free", "gyroscopic moments ω x J ω dropped", equations=("no_gyroscopic",)),
    "e02": Mistake(
        "tumbling", "Coriolis term of the rotor's equation dropped", equations=("no_coriolis",)
    ),
    "e03": Mistake(
        "point_masses",
        "centrifugal term of the pitch equations dropped",
        equations=("no_centrifugal",),
    ),
    "e04": Mistake(
        "three",
        "centrifugal term of the pitch equations with the wrong sign",
        equations=("centrifugal_sign",),
    ),
    "e05": Mistake(
        "free",
        "factor 2 of the Coriolis term of the rotor's equation missing",
        equations=("half_coriolis",),
    ),
    "e06": Mistake(
        "three", "products of inertia with opposite sign", edit=each_blade(products([-1, -1, -1]))
    ),
    "e07": Mistake(
        "two", "product of inertia xz with opposite sign", edit=each_blade(products([1, -1, 1]))
    ),
    "e08": Mistake("free", "products of inertia dropped", edit=no_blade_products, rates=False),
    "e09": Mistake("two", "Steiner's terms counted twice", edit=each_blade(steiner(1.0))),
    "e10": Mistake(
        "one", "moments of inertia about x and y exchanged", edit=each_blade(swap_xx_yy)
    ),
    "e11": Mistake("three", "gravity of 9.8 in place of 9.81", edit=set_at("gravity", 9.8)),
    "e12": Mistake("two", "gravity upwards", edit=set_at("down", G_UP)),
    "e13": Mistake(
        "tilted", "gravity along the shaft's horizontal, +y", edit=set_at("down", [0.0, 1.0, 0.0])
    ),
    "e14": Mistake(
        "point_masses", "gravity along +x of the base", edit=set_at("down", [1.0, 0.0, 0.0])
    ),
    "e15": Mistake("free", "no gravity", edit=set_at("gravity", 0.0)),
    "e16": Mistake("one", "weight missing in the pitch equation", equations=("no_pitch_weight",)),
    "e17": Mistake("two", "pitch dampers react on the rotor", equations=("dampers_react",)),
    "e18": Mistake(
        "loads", "rest angle of the springs ignored", edit=drop_key("bearing.rest"), decimals="%.9g"
    ),
    "e19": Mistake("three", "pitch torques one blade on", edit=reorder("torque.pitch", [2, 0, 1])),
    "e20": Mistake(
        "three", "pitch torques in the opposite sense", edit=scale_at("torque.pitch", -1.0)
    ),
    "e21": Mistake(
        "two", "rotor torque in the opposite sense", edit=scale_at("torque.rotor", -1.0)
    ),
    "e22": Mistake(
        "four",
        "torque and command tables held, not interpolated",
        edit=both(tables_at("torque.rotor", hold_rows), tables_at("bearing.rest", hold_rows)),
    ),
    "e23": Mistake(
        "nrel", "pitch command 0.1 s late", edit=tables_at("bearing.rest", shift_rows(0.1))
    ),
    "e24": Mistake(
        "three",
        "pitch command converted to rad a second time",
        edit=scale_at("bearing.rest", DEGREE),
        degrees=True,
    ),
    "e25": Mistake(
        "one", "spring stiffness taken as N m/deg", edit=scale_at("bearing.stiffness", 180 / np.pi)
    ),
    "e26": Mistake(
        "free", "blades numbered against the sense of rotation", equations=("azimuths_reversed",)
    ),
    "e27": Mistake("two", "hub inertia forgotten", edit=drop_key("hub.inertia")),
    "e28": Mistake("free", "blade 2 is 1 % heavier", edit=heavier_blade(1.01, 1)),
    "e29": Mistake(
        "tilted",
        "centre of mass at half its distance",
        edit=each_blade(move_centre(lambda x, y, z: [x, y, z / 2])),
    ),
    "e30": Mistake("tilted", "tilt missing", edit=drop_key("shaft.tilt")),
    "e31": Mistake(
        "tilted", "tilt with opposite sign", edit=scale_at("shaft.tilt", -1.0), decimals="%.10g"
    ),
    "e32": Mistake("coned", "cone missing", edit=each_blade(lambda blade: blade.pop("cone"))),
    "e33": Mistake(
        "coned",
        "cone with opposite sign",
        edit=each_blade(lambda blade: blade.update(cone=-blade["cone"])),
    ),
    "e34": Mistake(
        "four",
        "cone and tilt both missing",
        edit=both(drop_key("shaft.tilt"), each_blade(lambda blade: blade.pop("cone"))),
    ),
    "e35": Mistake("one", "shaft damper missing", edit=drop_key("shaft.damping")),
    "e36": Mistake("three", "pitch dampers missing", edit=drop_key("bearing.damping"), rates=False),
    "e37": Mistake(
        "two", "pitch dampers with opposite sign", edit=scale_at("bearing.damping", -1.0)
    ),
    "e38": Mistake("three", "pitch torques react on the rotor", equations=("torque_reacts",)),
    "e39": Mistake("three", "all blades are blade 1", edit=first_blade_for_all),
    "e40": Mistake(
        "free",
        "y of the centres of mass with opposite sign",
        edit=each_blade(move_centre(lambda x, y, z: [x, -y, z])),
    ),
    "e41": Mistake(
        "two", "rotor torque 1000 times too small (kN m)", edit=scale_at("torque.rotor", 1e-3)
    ),
    "e42": Mistake(
        "two",
        "blades as point masses",
        edit=each_blade(lambda blade: blade.update(inertia=[0.0] * 6)),
    ),
    "e43": Mistake(
        "three",
        "command and torque tables extrapolated after their last row",
        edit=tables_at("torque.pitch", extend_rows),
    ),
    "e44": Mistake(
        "four",
        "hub radius added to the centres of mass",
        edit=each_blade(move_centre(lambda x, y, z: [x, y, z + 1.2])),
    ),
    "e45": Mistake(
        "nrel",
        "damper on the pitch error, its rate less the command's",
        equations=("damper_of_error",),
    ),
    "e46": Mistake(
        "one", "spring moment by the sine of the deflection", equations=("sine_spring",)
    ),
    "e47": Mistake(
        "loads",
        "stiffness in the springs of blade 1 alone",
        edit=set_at("bearing.stiffness", [2e4, 0.0, 0.0]),
    ),
    "e48": Mistake(
        "free",
        "coupling of rotor and pitches in the mass matrix dropped",
        equations=("no_coupling",),
    ),
    "e49": Mistake(
        "point_masses",
        "weights of the blades on the pitch axes in the rotor's equation",
        equations=("weight_at_axis",),
    ),
    "e50": Mistake(
        "coned",
        "cone applied outside the pitch: the blade leans after it has pitched",
        equations=("cone_after_pitch",),
    ),
    "e51": Mistake(
        "two",
        "jump of the rotor torque as a ramp from the row before",
        edit=tables_at("torque.rotor", smooth_jumps),
    ),
    "e52": Mistake(
        "four",
        "rotor torque held over a controller's cycle of 0.05 s",
        edit=tables_at("torque.rotor", samples_of_table(0.05, 2.0)),
    ),
    "e53": Mistake(
        "point_masses",
        "centrifugal term twice (factor 1/2 missing)",
        equations=("double_centrifugal",),
        degrees=True,
        decimals="%.10f",
    ),
    "e54": Mistake("three", "dampers quadratic in the rate", equations=("quadratic_damper",)),
}

INTEGRATION: dict[str, Mistake] = {
    "i01": Mistake("point_masses", "explicit Euler with a step of 1 ms", solve=stepper(euler, 10)),
    "i02": Mistake(
        "two", "semi-implicit Euler with a step of 1 ms", solve=stepper(symplectic_euler, 10)
    ),
    "i03": Mistake(
        "nrel", "RK4 with a step of 5 ms on a spring of 188 rad/s", solve=stepper(rk4, 1)
    ),
    "i04": Mistake(
        "tumbling", "RK45 with default tolerances (1e-3, 1e-6)", solve=adaptive("RK45", 1e-3, 1e-6)
    ),
    "i05": Mistake("loads", "state in single precision", solve=stepper(rk4, 2, np.float32)),
    "i06": Mistake("free", "implicit Euler with a step of 2 ms", solve=stepper(implicit_euler, 5)),
    "i07": Mistake("coned", "trapezoidal rule with a step of 10 ms", solve=stepper(trapezoidal, 1)),
    "i08": Mistake(
        "two", "RK45 (1e-6) across the jump of the torque", solve=adaptive("RK45", 1e-6, 1e-9)
    ),
    "i09": Mistake("four", "torques held over each step of 10 ms", solve=stepper(rk4_held, 1)),
    "i10": Mistake("one", "Heun's method with a step of 10 ms", solve=stepper(heun, 1)),
}

EXPORT: dict[str, Mistake] = {
    "x01": Mistake("three", "pitch columns 1 and 2 exchanged", export=swap_joints(1, 2)),
    "x02": Mistake("free", "rates of pitches 2 and 3 exchanged", export=swap("rates", 2, 3)),
    "x03": Mistake("point_masses", "rates by central differences", export=gradient_rates),
    "x04": Mistake("two", "rates by backward differences", export=backward_rates),
    "x05": Mistake("tilted", "rates by forward differences", export=forward_rates),
    "x06": Mistake("coned", "all channels a row late", export=late),
    "x07": Mistake(
        "free",
        "times are those of the ends of the steps: initial state at h",
        export=times_one_step_on,
    ),
    "x08": Mistake("one", "first row lost, times from 0", export=first_row_lost),
    "x09": Mistake("three", "a row lost, times numbered on", export=row_lost_times_renumbered),
    "x10": Mistake(
        "point_masses", "resampled linearly from every fifth row", export=resample("linear", 5)
    ),
    "x11": Mistake(
        "free", "resampled by a spline from every tenth row", export=resample("spline", 10)
    ),
    "x12": Mistake("two", "smoothed by a Butterworth filter in both directions", export=low_pass),
    "x13": Mistake("coned", "first-order lag of 20 ms in all channels", export=lag(0.02)),
    "x14": Mistake("free", "moving average of three rows", export=moving_average),
    "x15": Mistake("one", "means of the intervals", export=interval_means),
    "x16": Mistake("loads", "every second row held", export=hold(2)),
    "x17": Mistake(
        "point_masses", "pitch 3 clipped to 90 degrees", export=clip(3, -np.pi / 2, np.pi / 2)
    ),
    "x18": Mistake(
        "two",
        "rotor angle 0.5 degrees off (offset of a sensor)",
        export=add_to("angles", 0, 0.5 * DEGREE),
    ),
    "x19": Mistake(
        "free", "pitch 2 0.01 rad off from the middle on", export=add_to("angles", 2, 0.01, 150)
    ),
    "x20": Mistake(
        "loads",
        "pitch rates in deg/s, named rad/s",
        export=scale("rates", slice(1, None), 180 / np.pi),
    ),
    "x21": Mistake(
        "tilted", "rotor rate in rpm, named rad/s", export=scale("rates", 0, 30 / np.pi)
    ),
    "x22": Mistake("three", "noise of 1e-5", export=noise(1e-5)),
    "x23": Mistake("coned", "rounded to 16 bits", export=half_precision),
    "x24": Mistake("free", "rotor by an encoder of 4096 counts", export=encoder(0, 4096)),
    "x25": Mistake("two", "pitch 1 a row late", export=both(late_channel("angles", 1))),
    "x26": Mistake("three", "clock 0.1 % fast", export=clock(1.001)),
    "x27": Mistake(
        "one", "clock summed in single precision", export=single_precision_clock, solve=None
    ),
    "x28": Mistake("loads", "pitches from their initial values", export=pitch_from_start),
    "x29": Mistake("free", "pitch rates with the rotor rate added", export=absolute_rates),
    "x30": Mistake("two", "one wrong value of the rotor angle", export=spike(0, 1e-3)),
    "x31": Mistake("three", "the mean pitch for all blades", export=mean_of_pitches),
    "x32": Mistake(
        "free",
        "pitches with opposite sense",
        export=both(scale("angles", slice(1, None), -1.0), scale("rates", slice(1, None), -1.0)),
    ),
    "x33": Mistake(
        "tilted", "rotor with opposite sense, angle alone", export=scale("angles", 0, -1.0)
    ),
    "x34": Mistake("point_masses", "rates held over four rows", export=hold_rates(4)),
    "x35": Mistake("loads", "times in ms, named s", export=clock(1000.0)),
    "x36": Mistake(
        "point_masses",
        "rotor late by two rows, no rates in the file",
        export=late_channel("angles", 0, 2),
        rates=False,
    ),
    "x37": Mistake(
        "free",
        "resampled linearly from every second row, no rates in the file",
        export=resample("linear", 2),
        rates=False,
    ),
    "x38": Mistake(
        "nrel", "first-order lag of 5 ms, no rates in the file", export=lag(0.005), rates=False
    ),
}

LOAD_MISTAKES: dict[str, Mistake] = {
    "l01": Mistake(
        "loads",
        "root loads of the blade on the hub (opposite sign)",
        loads=True,
        export=load_factor("blade_root", -1.0),
    ),
    "l02": Mistake(
        "loads",
        "root forces that do not pitch with the blade",
        loads=True,
        export=in_coned_frame("blade_root_force"),
    ),
    "l03": Mistake(
        "loads", "root moments about the apex", loads=True, equations=("moment_about_apex",)
    ),
    "l04": Mistake("four", "loads without weight", loads=True, equations=("loads_without_weight",)),
    "l05": Mistake(
        "loads",
        "loads without accelerations",
        loads=True,
        equations=("loads_without_accelerations",),
    ),
    "l06": Mistake("nrel", "loads a row late", loads=True, export=load_late("")),
    "l07": Mistake(
        "loads",
        "weight of the hub missing in the shaft's force",
        loads=True,
        export=lambda data: data.loads["shaft_force"].__setitem__(
            (slice(None), 2), data.loads["shaft_force"][:, 2] - 3000 * 9.81
        ),
    ),
    "l08": Mistake(
        "four", "shaft loads in the tilted frame", loads=True, export=in_shaft_frame(-0.09)
    ),
    "l09": Mistake(
        "loads",
        "shaft force in axes that turn with the rotor",
        loads=True,
        export=in_rotor_frame("shaft_force"),
    ),
    "l10": Mistake(
        "four",
        "root moments without the moments of inertia J α + ω x J ω",
        loads=True,
        equations=("loads_without_inertia_moment",),
    ),
    "l11": Mistake(
        "loads",
        "shaft moment with the torque of the rotor",
        loads=True,
        equations=("shaft_moment_with_torque",),
    ),
    "l12": Mistake(
        "loads",
        "actuator moment without the damper",
        loads=True,
        export=lambda data: data.loads.__setitem__(
            "pitch_actuator_moment",
            data.loads["pitch_actuator_moment"]
            + np.array([400.0, 300.0, 200.0]) * data.rates[:, 1:],
        ),
    ),
    "l13": Mistake(
        "four", "loads in kN and kN m, named N and N m", loads=True, export=load_factor("", 1e-3)
    ),
    "l14": Mistake(
        "loads",
        "x and y of the root moments exchanged",
        loads=True,
        export=swap_axes("blade_root_moment", 0, 1),
    ),
    "l15": Mistake(
        "four",
        "root moments of blades 2 and 3 exchanged",
        loads=True,
        export=swap_blades("blade_root_moment", 1, 2),
    ),
    "l16": Mistake("four", "static loads: weight alone", loads=True, equations=("loads_static",)),
    "l17": Mistake(
        "nrel",
        "root moments about the centres of mass",
        loads=True,
        equations=("moment_about_centre_of_mass",),
    ),
    "l18": Mistake(
        "loads",
        "shaft moment without the hub's inertia",
        loads=True,
        equations=("shaft_moment_without_hub",),
    ),
}

MISTAKES: dict[str, Mistake] = {**EQUATIONS, **INTEGRATION, **EXPORT, **LOAD_MISTAKES}
ALL: dict[str, Mistake] = {**RIGHT, **MISTAKES}


def make_data(mistake: Mistake) -> Data:
    """Return the data of a mistake."""
    scene = copy.deepcopy(SCENES[mistake.scene])
    if mistake.edit is not None:
        mistake.edit(scene)
    rotor = Rotor(scene, frozenset(mistake.equations))
    states = (mistake.solve or integrate_exactly)(rotor)
    times = rotor.times()
    width = 1 + rotor.count
    loads = rotor.loads(times, states) if mistake.loads else {}
    rates = states[:, width:].copy() if mistake.rates else None
    data = Data(times, states[:, :width].copy(), rates, loads)
    if mistake.export is not None:
        data = mistake.export(data) or data
    return data


def write_files(name: str, folder: Path) -> tuple[Path, Path]:
    """Write the data of a mistake and its scene, and return their paths."""
    mistake = ALL[name]
    folder.mkdir(parents=True, exist_ok=True)
    suffix = "-loads" if mistake.loads else ""
    scene = folder / f"{mistake.scene}{suffix}.toml"
    text = scene_text(SCENES[mistake.scene], title=mistake.scene, loads=mistake.loads)
    scene.write_text(text, encoding="utf-8")
    path = folder / f"{name}.csv"
    make_data(mistake).write(path, mistake.decimals, mistake.degrees)
    return path, scene


# ---- comparison and table ----------------------------------------------------------------------

# What a named cause has to say, written when the data had been compared: each of the causes of a
# file has to match. Equivalent causes are right; "" where no cause is known.
NAMED: dict[str, str] = {
    "e01": "gyroscopic moments .* about the blades' centres",
    "e02": "^without the Coriolis",
    "e03": "^without the centrifugal",
    "e04": "^opposite sign of the centrifugal",
    "e05": "^half of the Coriolis",
    "e06": "^products of inertia with opposite sign",
    "e07": "^products of inertia with opposite sign",
    "e08": "^products of inertia .* ignored",
    "e09": "inertia about the root used as inertia about the centre of mass",
    "e10": r"moments of inertia about x and y exchanged|inertia.* off by .* and blade.inertia\[[01]\]",
    "e11": "^gravity of 9.8 ",
    "e12": r"gravity along \+z",
    "e13": r"gravity along \+y",
    "e14": r"gravity along \+x",
    "e15": "^gravity of 0 ",
    "e16": "without gravity in the equations of the pitches",
    "e17": "^dampers of the bearings with reactions on the rotor",
    "e18": "^without the rest angles of the springs",
    "e19": "torque.pitch of the previous blade at each blade",
    "e20": "opposite sign of the pitch torques",
    "e21": "opposite sign of the torque of the rotor",
    "e22": "^ramps of loads held",
    "e23": "late by 0.1 s|load that is wrong or missing from t = ",
    "e24": "rest angles .* rad taken as degrees",
    "e25": "stiffness .* per rad taken as per degree",
    "e26": "^blades numbered in the opposite sense",
    "e27": "^without the hub's inertia",
    "e28": r"^blade\[1\].mass off by \+1 %",
    "e29": "^centre of mass at half",
    "e30": "^without the tilt",
    "e31": "^tilt of the shaft with opposite sign",
    "e32": "^without the cone",
    "e33": "^cone of the blades with opposite sign",
    "e34": "^without the tilt of the shaft and the cone of the blades",
    "e35": "^without the damper of the shaft",
    "e36": "^without the dampers of the bearings",
    "e37": "^opposite sign of the dampers",
    "e38": "^pitch torques with reactions",
    "e39": "^numbers of blade 1 at all blades",
    "e40": r"centre_of_mass\[1\] with opposite sign",
    "e41": "torque of the rotor in kN m taken as N m",
    "e42": "as point masses",
    "e43": "load that is wrong or missing from t = 1.5.* on the pitch 3",
    "e44": "hub.radius added",
    "e45": "rate less that of the rest angle",
    "e46": "springs by the sine",
    "e47": "a spring at blade 1 alone",
    "e48": "^without the coupling of rotor and pitches",
    # Of three equal blades the weights on the pitch axes cancel in the rotor's equation.
    "e49": "on the pitch axes in the rotor's equation alone|^without gravity in the rotor's equation",
    "e51": "load that is wrong or missing from t = .* to 1 s: .* on the rotor",
    "e52": "torque of the rotor held over a cycle of 5 rows",
    "e53": "^twice the centrifugal",
    "e54": "quadratic in the rate",
    "i01": "^explicit Euler method with a step of 0.001 s",
    "i02": "^semi-implicit Euler method with a step of 0.001 s",
    "i06": "^implicit Euler method with a step of 0.002 s",
    "i07": "^trapezoidal rule with a step of 0.01 s",
    "i09": "^loads held from each row",
    "i10": "^Heun's method with a step of 0.01 s",
    "x01": "exchanged: pitch 1 is pitch 2, pitch 2 is pitch 1",
    "x02": "exchanged: pitch 2 rate is pitch 3 rate",
    "x03": "differences of the angles over two intervals",
    "x04": "differences of the angles, the mean over the interval before",
    "x05": "differences of the angles, the mean over the interval after",
    "x06": "constant lag of 0.01 s, 1 rows",
    "x07": "constant lag of 0.01 s, 1 rows",
    "x08": "constant lag of -0.01 s, 1 rows",
    "x09": "a row omitted and the others renumbered",
    "x10": "interpolated linearly between every 5 rows",
    "x11": "interpolated by a cubic spline between every 10 rows",
    "x13": "filter of first order, time constant 0.02 s",
    "x14": "mean of 3 rows around",
    "x15": "mean of 2 rows up to",
    "x16": "every row is held for 2 rows",
    "x17": "^pitch 3: limited to at most 1.5708",
    "x18": "^rotor: zero off by 0.00872665",
    "x19": "pitch 2 is stored from another zero",
    "x20": "rate: deg/s taken as rad/s",
    "x21": "^rotor rate: rpm taken as rad/s",
    "x22": "scatter from row to row, standard deviation 1.0e-05",
    "x23": "half precision",
    "x24": "^rotor: .* 4096 a turn",
    "x25": "^pitch 1: a row late",
    "x26": "clock that is 0.1 % fast",
    "x27": "single precision|clock that is 7.168e-05 % slow",
    "x28": "^pitch .: zero off by",
    "x29": "rate: with the rotor's rate added",
    "x30": "a single wrong row: row 201",
    "x31": "mean of the pitches",
    "x32": "sign reversed",
    "x33": "^rotor: sign reversed",
    "x34": "rate: every number is held for 4 rows",
    "x35": "time in ms taken as s",
    "x36": "^rotor: 2 rows late",
    "x37": "interpolated linearly between every 2 rows",
    "x38": "filter of first order, time constant 0.005 s",
    "l01": "sign reversed",
    "l02": "in the (rotor|coned) frame",
    "l03": "about the apex in place of the root",
    "l04": "without the weight",
    "l05": "without the accelerations",
    "l06": "blade root .*a row late",
    "l07": "without the hub's weight",
    "l08": "in the shaft frame",
    "l09": "^shaft force x, shaft force z: in the rotor frame",
    "l10": "without the inertia of the blades about their centres of mass",
    "l11": "with the torque on the rotor in it",
    "l12": "pitch actuator moment.*without the dampers",
    "l13": "kN taken as N",
    "l14": "exchanged: blade root moment 1 x is blade root moment 1 y",
    "l15": "exchanged: blade root moment 2 is blade root moment 3, blade root moment 3 is blade",
    "l16": "of the weight alone",
    "l17": "about the centre of mass in place of the root",
    "l18": "^shaft moment y: without the inertia of the hub",
}
# Differences below the tolerance of 1e-6 rad, which no verdict has to refuse.
TOO_SMALL = {"i05"}


def verdict_of(name: str, status: str, causes: Sequence[str]) -> str:
    """Return what a comparison is worth: right, none, WRONG, OK or small.

    Parameters
    ----------
    name : of a mistake, or of right data.
    status : of the comparison.
    causes : that are named.

    Returns
    -------
    str
        "right" if all causes say the mistake, and for right data if it is `ok` without a cause;
        "none" without a cause; "WRONG" if one is false; "OK" if the mistake is `ok`; "small" if
        that is right, since the difference is below the tolerance.
    """
    pattern = None if name in RIGHT else NAMED.get(name, "")
    verdict = judged(pattern, status, causes)
    return "small" if verdict == "OK" and name in TOO_SMALL else verdict


def judged(pattern: str | None, status: str, causes: Sequence[str]) -> str:
    """Return what a comparison is worth, by what a cause has to say; None for right data."""
    if pattern is None:
        return "right" if status == "ok" and not causes else "WRONG"
    if any(not pattern or not re.search(pattern, cause) for cause in causes):
        return "WRONG"
    if status == "ok":
        return "OK"
    return "right" if causes else "none"


def compared(name: str, folder: Path) -> dict[str, Any]:
    """Return status and causes of a comparison, from FOLDER/NAME.json if they are there."""
    kept = folder / f"{name}.json"
    if not kept.exists():
        comparison = rm.compare(*map(str, write_files(name, folder)))
        result = {"status": comparison.status, "likely": list(comparison.likely)}
        kept.write_text(json.dumps(result, indent=1), encoding="utf-8")
    result = json.loads(kept.read_text(encoding="utf-8"))
    return dict(result)


def table(folder: Path, names: Sequence[str]) -> str:
    """Return the document's table of the comparisons of some data.

    Parameters
    ----------
    folder : keeps the comparisons.
    names : of the data.

    Returns
    -------
    str
        Counts, and a table in Markdown.
    """
    rows, verdicts = [], []
    for name in names:
        result = compared(name, folder)
        verdict = verdict_of(name, result["status"], result["likely"])
        causes = []
        for cause in result["likely"]:
            channels, colon, text = cause.rpartition(": ")
            if len(channels) > _MAX_CHANNELS:
                channels = channels[:_MAX_CHANNELS].rpartition(", ")[0] + ", ..."
            causes.append(channels + colon + text)
        cause = "; ".join(causes) or "no cause found"
        if name not in RIGHT:
            verdicts.append(verdict)
            mistake = ALL[name]
            text = f"{mistake.scene} | {mistake.text}"
            rows.append(f"| {name} | {text} | {result['status']} | {cause} | {verdict} |")
    right = [name for name in names if name in RIGHT]
    wrong = [name for name in right if verdict_of(name, **_arguments(folder, name)) != "right"]
    lines = [
        f"{len(verdicts)} mistakes: {verdicts.count('right')} named, {verdicts.count('none')} "
        f"without a cause, {verdicts.count('WRONG')} with a wrong one,",
        f"{verdicts.count('OK')} `ok`, {verdicts.count('small')} too small to be refused. Of "
        f"{len(right)} right data {len(wrong)} are refused or have a cause.",
        "",
        "| data | scene | mistake | status | causes | judged |",
        "|---|---|---|---|---|---|",
        *rows,
    ]
    return "\n".join(lines) + "\n"


_MAX_CHANNELS = 60  # characters of the channels' names in the table


def _arguments(folder: Path, name: str) -> dict[str, Any]:
    """Return status and causes of a comparison by their names in `verdict_of`."""
    result = compared(name, folder)
    return {"status": result["status"], "causes": result["likely"]}


def main(arguments: Sequence[str] | None = None) -> None:
    """Compare the data, and print the table or write it into the document."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0] if __doc__ else "")
    parser.add_argument("folder", type=Path)
    parser.add_argument("-o", "--output", type=Path, help="the document whose table is replaced")
    parser.add_argument("--data", help="names, separated by commas (default: all)")
    options = parser.parse_args(arguments)
    names = options.data.split(",") if options.data else list(ALL)
    options.folder.mkdir(parents=True, exist_ok=True)
    text = table(options.folder, names)
    if options.output is None:
        print(text, end="")
        return
    head = options.output.read_text(encoding="utf-8").partition(MARKER)[0]
    options.output.write_text(f"{head}{MARKER}\n\n{text}", encoding="utf-8")


MARKER = "<!-- tables -->"

if __name__ == "__main__":
    main()
