"""What the printed methods accept of a scene: one, three or more point masses alike, and nothing else that acts."""

from __future__ import annotations

from dataclasses import dataclass

from rotor_mbs.errors import MethodRefusal
from rotor_mbs.scenario.scene import Scene


@dataclass(frozen=True, slots=True)
class PointMassRotor:
    """The printed symbols of a scene: blades alike, each a mass m (kg) at (c, 0, d) (m); gravity g (m/s²).

    phases   (blades,) rad
    tip      (3,) m, the point whose path is drawn, seen from the mass in the directions of the blade frame
    """

    m: float
    c: float
    d: float
    g: float
    phases: tuple[float, ...]
    tip: tuple[float, float, float]

    @property
    def pitches_move(self) -> bool:
        """c = 0 takes the inertia out of (47): the pitch is then fixed (Fig. 4b)."""
        return self.c != 0.0


def point_mass_rotor(method: str, scene: Scene, blade_counts: tuple[int, ...] = ()) -> PointMassRotor:
    """Raises MethodRefusal, in one sentence, where the printed equations have no place for what the scene holds."""
    blade = scene.blades[0]
    x, y, z = blade.centre_of_mass
    refusals = {
        f"{method} is printed for {' or '.join(map(str, blade_counts))} blades, the scene has {len(scene.blades)}": (
            bool(blade_counts) and len(scene.blades) not in blade_counts
        ),
        f"{method} needs blades that are all alike": any(other != blade for other in scene.blades),
        f"{method} needs point-mass blades: no inertia about the centre of mass": not blade.is_point_mass,
        f"{method} needs the centre of mass in the blade's x-z plane: y = 0, not {y:g}": y != 0.0,
        f"{method} has no hub inertia: it must be 0, not {scene.hub_inertia:g}": scene.hub_inertia != 0.0,
        f"{method} has no bearing stiffness or damping: they must be 0": (
            any(scene.bearing_stiffness) or any(scene.bearing_damping)
        ),
        f"{method} has no shaft damping: it must be 0, not {scene.shaft_damping:g}": scene.shaft_damping != 0.0,
    }
    for sentence, refused in refusals.items():
        if refused:
            raise MethodRefusal(sentence)
    tip = (blade.tip[0] - x, blade.tip[1] - y, blade.tip[2] - z)
    return PointMassRotor(blade.mass, x, z, scene.gravity, scene.phases, tip)
