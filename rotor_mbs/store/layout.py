"""The groups of a results file. Knows no file library; the arrays of a run are declared in `solution.quantities`.

    /                          format, format_version, versions, platform, created
    /paper/fig05               a scene: title, figures, blades, scene_toml, scene_hash
    /paper/fig05/reference     the reference
    /paper/fig05/lagrange/taylor   a run: model / integrator
Each run's group contains its own dimension scales beside its data.
"""

from __future__ import annotations

from typing import NamedTuple

FORMAT = "rotor_mbs"
FORMAT_VERSION = 1
CONVENTIONS = "CF-1.11"
REFERENCE = "reference"


class Column(NamedTuple):
    """A dataset: its dimensions (names of scales in the same group), units, and what it is."""

    dimensions: tuple[str, ...]
    units: str
    long_name: str
