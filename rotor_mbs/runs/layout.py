"""The groups of a results file. Knows no file library; the arrays of a run are declared in `solution.quantities`.

    /                          format, format_version, versions, platform, created
    /paper/fig05               a scene: title, figures, blades, scene_toml, scene_hash
    /paper/fig05/reference     the reference
    /paper/fig05/lagrange/taylor   a run: model / integrator
Each run's group contains its own dimension scales beside its data.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, NamedTuple

FORMAT = "rotor_mbs"
FORMAT_VERSION = 1
CONVENTIONS = "CF-1.11, ACDD-1.3"
# What every file is about: the attribute `keywords` of the ACDD conventions.
KEYWORDS = "multibody dynamics, wind turbine rotor, Euler-Lagrange equations, model verification"

# The attribute with the key of a run or a record (`Case.key`).
KEY_ATTRIBUTE = "run_hash"

# The attribute with the hash of all that decides a sweep's numbers, which only the dataset of a sweep has.
SWEEP_IDENTITY = "sweep_identity"

# The attribute with the time limit, in s, of a run that it ended.
LIMIT = "time_limit_s"

# The attribute, equal for all records of a scene that one case writes: older ones of the same study go when they come.
TOGETHER = "written_together"


class Column(NamedTuple):
    """A dataset: its dimensions (names of scales in the same group), units, and what it is."""

    dimensions: tuple[str, ...]
    units: str
    long_name: str


def key_of(attributes: Mapping[str, Any]) -> str:
    """The key of a stored run or record, the content hash of what decides it; "" where it has none."""
    return str(attributes.get(KEY_ATTRIBUTE, ""))
