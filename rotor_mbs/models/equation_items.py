"""What the models that are equations list as built for a scene: the printed ones and the closed form."""

from __future__ import annotations

from typing import TYPE_CHECKING

from rotor_mbs.methods.base import BuiltItem

if TYPE_CHECKING:
    from rotor_mbs.scenario.scene import Scene


def equation_items(scene: Scene, sources: tuple[str, str] = ("", "")) -> list[BuiltItem]:
    """The equations and terms of the scene; sources: where the rotor's and a pitch's come from."""
    moving = scene.moving_coordinates
    built = [BuiltItem("equation", scene.coordinate_labels[i], sources[i > 0]) for i in moving]
    built += [
        BuiltItem("term", f"blade {i} fixed", "its pitch has no inertia")
        for i in range(1, 1 + len(scene.blades))
        if i not in moving
    ]
    optional = {
        "hub inertia": scene.hub_inertia != 0.0,
        "gravity": scene.gravity != 0.0,
        "rotor torque": scene.has_torque,
        "pitch torque": any(scene.pitch_torque),
        "bearing stiffness": any(scene.bearing_stiffness),
        "bearing rest angle": any(scene.pitch_load(i - 1)[1] for i in moving[1:]),
        "bearing damping": any(scene.bearing_damping),
        "shaft damping": scene.shaft_damping != 0.0,
    }
    built += [BuiltItem("term", name) for name, there in optional.items() if there]
    return built + [BuiltItem("output", name) for name in scene.outputs]
