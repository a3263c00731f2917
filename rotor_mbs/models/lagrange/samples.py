"""From states of the closed form to a trajectory: fixed pitches, tip path, energies. Knows no integrator."""

from __future__ import annotations

import numpy as np

from rotor_mbs.models.lagrange import closed_form
from rotor_mbs.models.lagrange.parameters import rotor_form
from rotor_mbs.scenario.scene import Scene
from rotor_mbs.solution.record import Array, Item, Trajectory


def trajectory(scene: Scene, time: Array, states: Array, moving: tuple[int, ...]) -> Trajectory:
    """What the scene asks for.

    time (n,) s; states (n, 2·len(moving)) or with the work in J as one more column; moving: the columns of
    the angles that the state holds.
    """
    count = len(moving)
    columns = list(moving)
    angles = np.tile(np.array(scene.initial_angles, dtype=float), (len(time), 1))
    rates = np.zeros_like(angles)
    angles[:, columns] = states[:, :count]
    rates[:, columns] = states[:, count : 2 * count]
    result = Trajectory(time, angles, rates)
    if scene.wants("tip"):
        paths = [
            closed_form.point_path(angles[:, 0] + phase, angles[:, 1 + i], blade.tip, np.sin, np.cos)
            for i, (blade, phase) in enumerate(zip(scene.blades, scene.phases, strict=True))
        ]
        result.tip = np.ascontiguousarray(np.array([np.broadcast_arrays(*path) for path in paths]).transpose(2, 0, 1))
    if scene.wants("energy"):
        form = rotor_form(scene)
        with np.errstate(over="ignore", invalid="ignore"):  # of rates like 1e200; the judgement sees what is not finite
            result.kinetic_energy, result.potential_energy = closed_form.energies(
                list(angles[:, columns].T), list(rates[:, columns].T), form, np.sin, np.cos
            )
        result.work = states[:, 2 * count] if states.shape[1] > 2 * count else _constant_work(scene, angles)
    return result


def _constant_work(scene: Scene, angles: Array) -> Array:
    """Of a constant torque: τ·(q2 - q2(0)), exact."""
    return scene.torque_at(0.0) * (angles[:, 0] - scene.initial_angles[0])


def items(scene: Scene) -> list[Item]:
    """The equations and terms the closed form has for this scene."""
    form = rotor_form(scene)
    built = [Item("equation", "rotor")]
    built += [Item("equation", f"pitch {i + 1}") for i in form.moving]
    built += [
        Item("term", f"blade {i + 1} fixed", "its pitch has no inertia")
        for i in range(len(scene.blades))
        if i not in form.moving
    ]
    optional = {
        "hub inertia": scene.hub_inertia != 0.0,
        "gravity": scene.gravity != 0.0,
        "rotor torque": scene.has_torque,
        "bearing stiffness": any(scene.bearing_stiffness),
        "bearing damping": any(scene.bearing_damping),
        "shaft damping": scene.shaft_damping != 0.0,
    }
    built += [Item("term", name) for name, there in optional.items() if there]
    built += [Item("output", name) for name in scene.outputs]
    return built
