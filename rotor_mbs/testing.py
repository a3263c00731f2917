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

    The message of the error is the text of the comparison, with its table.

    Parameters
    ----------
    time : (n,) s, increasing, from the start to the end of the scene, with any spacing.
    angles : (n, 1 + blades) rad: rotor, then the pitch of each blade, unwrapped.
    scene : the name of a shipped scene, a TOML file, or a `Scene`.
    rates : (n, 1 + blades) rad/s; optional.
    tolerance : bound (rad) on interval defects, and on errors divided by the error growth.

    Returns
    -------
    DataComparison

    Raises
    ------
    InputError
        For arrays that cannot be compared: other shapes, times that do not increase, numbers that
        are not finite.
    TypeError
        If `scene` is neither a scene nor text nor a path, or `tolerance` is not a number.

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
