"""A scene as plain numbers: what every model gets, and all it gets. Knows no model and no file format."""

from __future__ import annotations

import math
from dataclasses import dataclass

OUTPUTS = ("angles", "rates", "tip", "energy")


@dataclass(frozen=True, slots=True)
class Blade:
    """One rigid blade, in its own frame: origin on the shaft axis, z along the pitch axis.

    mass            kg, > 0
    centre_of_mass  (3,) m
    inertia         (6,) kg m², tensor elements xx yy zz xy xz yz about the centre of mass (xy = -∫xy dm)
    tip             (3,) m, the point whose path is drawn
    """

    mass: float
    centre_of_mass: tuple[float, float, float]
    inertia: tuple[float, float, float, float, float, float]
    tip: tuple[float, float, float]

    @property
    def is_point_mass(self) -> bool:
        return not any(self.inertia)

    @property
    def has_pitch_inertia(self) -> bool:
        """Whether the blade resists pitching at all: Jzz about the pitch axis is not exactly zero (paper, Fig. 4b)."""
        x, y, _ = self.centre_of_mass
        return x != 0.0 or y != 0.0 or self.inertia[2] != 0.0


@dataclass(frozen=True, slots=True)
class Scene:
    """A rotor and what happens to it. Blade i hangs at phase 2π(i-1)/len(blades) about the shaft (+y); z is up.

    initial_angles, initial_rates   (1 + blades,) rad, rad/s: rotor, then a pitch per blade
    rotor_torque                    ((t, τ), ...) s, N m: linear between, held outside; () where there is none;
                                    two rows with equal t are a jump
    bearing_stiffness, _damping     (blades,) N m/rad, N m s/rad, about pitch 0
    shaft_damping                   N m s/rad
    text                            the TOML text it was read from
    """

    name: str
    title: str
    figures: tuple[str, ...]
    gravity: float
    duration: float
    samples: int
    outputs: tuple[str, ...]
    blades: tuple[Blade, ...]
    hub_inertia: float
    initial_angles: tuple[float, ...]
    initial_rates: tuple[float, ...]
    rotor_torque: tuple[tuple[float, float], ...] = ()
    bearing_stiffness: tuple[float, ...] = ()
    bearing_damping: tuple[float, ...] = ()
    shaft_damping: float = 0.0
    text: str = ""

    @property
    def phases(self) -> tuple[float, ...]:
        """(blades,) rad: the angle about the shaft at which each blade is mounted."""
        return tuple(2.0 * math.pi * i / len(self.blades) for i in range(len(self.blades)))

    @property
    def has_torque(self) -> bool:
        return any(torque != 0.0 for _, torque in self.rotor_torque)

    @property
    def has_constant_torque(self) -> bool:
        return len({torque for _, torque in self.rotor_torque}) <= 1

    @property
    def has_damping(self) -> bool:
        return self.shaft_damping != 0.0 or any(self.bearing_damping)

    @property
    def coordinate_labels(self) -> tuple[str, ...]:
        return ("rotor", *(f"pitch {i + 1}" for i in range(len(self.blades))))

    def wants(self, output: str) -> bool:
        return output in self.outputs

    def torque_at(self, time: float) -> float:
        """Rotor torque in N m at `time` in s; at a jump, the value after it."""
        if not self.rotor_torque:
            return 0.0
        before = None
        for row in self.rotor_torque:
            if row[0] > time:
                if before is None:
                    return row[1]
                (t0, tau0), (t1, tau1) = before, row
                return tau0 + (tau1 - tau0) * (time - t0) / (t1 - t0)
            before = row
        return self.rotor_torque[-1][1]
