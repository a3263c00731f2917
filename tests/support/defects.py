"""Interval defects made by hand, for tests of what is made of them."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from rotor_mbs.solution.defects import Defects
from rotor_mbs.solution.trajectory import Trajectory


def made_defects(sizes: Sequence[float], **changes: Any) -> Defects:
    """Intervals of 0.01 s and one coordinate, with defects of its angle (rad), in which no error
    grows."""
    count, nothing = len(sizes), np.zeros((1, 1))
    fields: dict[str, Any] = {
        "time": 0.01 * np.arange(count + 1.0),
        "angles": np.array(sizes)[:, None],
        "rates": np.zeros((count, 1)),
        "rate_units": np.ones(1),
        "moving": (0,),
        "resting": (),
        "states": np.zeros((count + 1, 2)),
        "rounding": np.zeros((count + 1, 2)),
        "conditioning": np.ones(count),
        "start": np.zeros(2),
        "growth_units": np.ones(2),
        "own_loads": Trajectory(nothing[0], nothing, nothing),
    }
    transitions = changes.pop("transitions", np.tile(np.eye(2), (count, 1, 1)))
    return Defects(find_transitions=lambda rows: transitions[rows], **(fields | changes))
