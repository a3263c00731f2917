"""Which rows of a sweep tell whether all of them make scenes. Knows the schema's rules, no file."""

from __future__ import annotations

from collections.abc import Iterator
from typing import TYPE_CHECKING

import numpy as np

from rotor_mbs.scenario.keys import parse_key

if TYPE_CHECKING:  # pydantic behind variants takes 0.2 s; the sweep itself asks this module
    from rotor_mbs.scenario.sweep import Sweep
    from rotor_mbs.scenario.variants import Variants

# Keys whose rule is an interval of its own: if the ends of an axis keep it, all values between them do.
_INTERVALS = ("initial", "gravity", "hub", "shaft", "bearing")
_ROWS_AT_ONCE = 4096


def telling_rows(sweep: Sweep) -> Iterator[tuple[int, Variants, tuple[float, ...]]]:
    """(axis, its variants alone, a row) enough to find every fault: the ends of each axis, and where numbers are bound
    to one another (inertias, torque tables) all rows."""
    from rotor_mbs.scenario.variants import Variants

    tables = {**sweep.tables, "outputs": list(sweep.outputs) or ["angles"]}
    for i, axis in enumerate(sweep.design.axes):
        alone = Variants(sweep.name, tables, [axis.key])
        values = sweep.design.values[i]
        for value in dict.fromkeys((float(values.min()), float(values.max()))):
            yield i, alone, (value,)
    bound = [i for i, key in enumerate(sweep.keys) if not _is_interval(key)]
    if bound:
        together = sweep.variants()
        for first in range(0, sweep.design.count, _ROWS_AT_ONCE):
            rows = sweep.design.rows(first, min(first + _ROWS_AT_ONCE, sweep.design.count))
            chosen = np.unique(rows[:, bound], axis=0, return_index=True)[1]
            for row in rows[np.sort(chosen)]:
                yield bound[0], together, tuple(row.tolist())


def _is_interval(key: str) -> bool:
    path = parse_key(key)
    is_constant_torque = path == ("torque", "rotor")
    return path[0] in _INTERVALS or path[-1] == "mass" or "tip" in path or is_constant_torque
