"""Which outputs a scene may ask for: the built-in ones and those of installed packages. Must not import a package.

A package adds an output by an entry point of the group "rotor_mbs.quantities"; the entry point's name is the output's.
"""

from __future__ import annotations

import functools
from importlib.metadata import entry_points

from rotor_mbs.scenario.scene import OUTPUTS

ENTRY_POINT_GROUP = "rotor_mbs.quantities"


@functools.cache
def known_outputs() -> tuple[str, ...]:
    """The built-in outputs, then the names of all entry points of the group "rotor_mbs.quantities", sorted."""
    added = {point.name for point in entry_points(group=ENTRY_POINT_GROUP)}
    return (*OUTPUTS, *sorted(added - set(OUTPUTS)))


def is_known_output(name: str) -> bool:
    """Whether a scene may ask for it; installed packages are searched only for what is not built in."""
    return name in OUTPUTS or name in known_outputs()
