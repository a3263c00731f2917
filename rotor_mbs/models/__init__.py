"""Define what `printed` and `lagrange` share: settings of ode45, and a list of a scene's equations.

Importing this module does not load NumPy.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

from rotor_mbs.methods.base import BuiltItem
from rotor_mbs.methods.settings import Settings, number

if TYPE_CHECKING:
    from rotor_mbs.scenario.scene import Scene


@dataclass(frozen=True)
class Ode45Settings(Settings):
    """Settings of MATLAB's ode45."""

    relative_tolerance: float = number(1e-6, above=0.0, doc="relative tolerance of the local error")
    absolute_tolerance: float = number(
        1e-9, above=0.0, doc="absolute tolerance of the local error, rad and rad/s"
    )


def equation_items(scene: Scene, sources: tuple[str, str] = ("", "")) -> list[BuiltItem]:
    """Return the equations, terms and outputs of a scene, as `show --build` lists them.

    Parameters
    ----------
    scene : the rotor, its loads and outputs.
    sources : source of the rotor's equation, and source of the pitches' equations, as texts that
        are listed beside the equations; "" lists no source.
    """
    moving = scene.moving_coordinates
    of_rotor, of_pitch = sources
    built = []
    for coordinate in moving:
        source = of_pitch if coordinate else of_rotor
        built.append(BuiltItem("equation", scene.coordinate_labels[coordinate], source))
    for coordinate in range(1, 1 + len(scene.blades)):
        if coordinate not in moving:
            built.append(BuiltItem("term", f"blade {coordinate} fixed", "its pitch has no inertia"))
    optional = {
        "hub inertia": scene.hub_inertia != 0.0,
        "gravity": scene.gravity != 0.0,
        "shaft tilt": scene.shaft_tilt != 0.0,
        "blade cone": any(blade.cone for blade in scene.blades),
        "hub radius": scene.wants("loads") and scene.hub_radius != 0.0,
        "hub mass": scene.wants("loads") and scene.hub_mass != 0.0,
        "rotor torque": scene.has_torque,
        "pitch torque": any(scene.pitch_torque),
        "bearing stiffness": any(scene.bearing_stiffness),
        "bearing rest angle": any(scene.pitch_loads[i - 1][1] for i in moving[1:]),
        "bearing damping": any(scene.bearing_damping),
        "shaft damping": scene.shaft_damping != 0.0,
    }
    built += [BuiltItem("term", name) for name, there in optional.items() if there]
    return built + [BuiltItem("output", name) for name in scene.outputs]
