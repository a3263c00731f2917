"""Check in the tests of other projects that a trajectory agrees with a scene's reference."""

from __future__ import annotations

import os
from typing import Any

from rotor_mbs.api.comparisons import DataComparison, compare
from rotor_mbs.scenario.catalogue import scene_of
from rotor_mbs.scenario.keys import as_float
from rotor_mbs.scenario.scene import Scene


def assert_agrees(
    time: Any,
    angles: Any,
    *,
    scene: Scene | str | os.PathLike[str],
    rates: Any = None,
    tolerance: float = 1e-6,
) -> DataComparison:
    """Raise AssertionError if a trajectory does not agree with the reference of a scene.

    Its message is the table of the comparison.

    Parameters
    ----------
    time : (n,) s, increasing; any times within the scene's duration, including its start and end.
    angles : (n, 1 + blades) rad: rotor, then the pitch of each blade, unwrapped.
    scene : the name of a shipped scene, a TOML file, or a `Scene`.
    rates : (n, 1 + blades) rad/s; optional.
    tolerance : bound on interval defects, and on errors divided by the error growth (rad).

    Returns
    -------
    DataComparison

    Raises
    ------
    InputError
        For arrays that cannot be compared: other shapes, times that do not increase, numbers that
        are not finite.
    TypeError
        If `scene` is neither a scene nor text nor a path, or the tolerance no number.

    Examples
    --------
    >>> import rotor_mbs as rm
    >>> from rotor_mbs.testing import assert_agrees
    >>> run = rm.run(rm.scene("paper/fig03"), "exudyn_tree/rk67")
    >>> assert_agrees(run.time, run.angles, scene="paper/fig03").status
    'ok'
    """
    arrays = {"time": time, "angles": angles} | ({} if rates is None else {"rates": rates})
    found = compare(arrays, scene_of(scene), tolerance=as_float(tolerance))
    if not found.agrees:
        raise AssertionError(str(found))
    return found
