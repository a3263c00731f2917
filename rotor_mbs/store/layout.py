"""The names, units and dimensions of a results file: the contract, as a table. Knows no file library.

    /                          format, format_version, versions, platform, created
    /paper/fig05               a scene: title, figures, blades, scene_toml, scene_hash
    /paper/fig05/reference     the reference
    /paper/fig05/lagrange/taylor   a run: model / integrator
Each run's group holds its own dimension scales beside its data.
"""

from __future__ import annotations

from typing import NamedTuple

FORMAT = "rotor_mbs"
FORMAT_VERSION = 1
CONVENTIONS = "CF-1.11"
REFERENCE = "reference"


class Quantity(NamedTuple):
    """A dataset: its dimensions (names of scales in the same group), unit, and what it is."""

    dimensions: tuple[str, ...]
    units: str
    long_name: str


SCALES = {
    "time": Quantity(("time",), "s", "time"),
    "coordinate": Quantity(("coordinate",), "1", "joint coordinate: 0 rotor, i pitch of blade i"),
    "blade": Quantity(("blade",), "1", "blade number, from 1"),
    "axis": Quantity(("axis",), "1", "axis of the base frame: 0 x, 1 y (shaft), 2 z (up)"),
    "refined_time": Quantity(("refined_time",), "s", "time of the integrator's own output points"),
}

QUANTITIES = {
    "angles": Quantity(("time", "coordinate"), "rad", "rotor angle and pitch angles, unwrapped"),
    "rates": Quantity(("time", "coordinate"), "rad/s", "rotor rate and pitch rates"),
    "tip": Quantity(("time", "blade", "axis"), "m", "path of each blade's tip in the base frame"),
    "kinetic_energy": Quantity(("time",), "J", "kinetic energy"),
    "potential_energy": Quantity(("time",), "J", "potential energy of gravity (zero at the shaft) and springs"),
    "work": Quantity(("time",), "J", "work of the torque less what the dampers took"),
    "energy_error": Quantity(("time",), "J", "total energy less work, less its value at the start"),
    "constraint_error": Quantity(("time",), "m", "largest position gap in a joint"),
    "angle_error": Quantity(("time",), "rad", "largest angle error against the reference, over the coordinates"),
    "angle_uncertainty": Quantity(("time",), "rad", "difference of two quad precision runs, largest over the angles"),
    "error_growth": Quantity(("time",), "1", "largest growth of a small error of the initial state"),
    "refined_angles": Quantity(("refined_time", "coordinate"), "rad", "angles at the integrator's own output points"),
    "refined_rates": Quantity(("refined_time", "coordinate"), "rad/s", "rates at the integrator's own output points"),
}
