"""One moment of a rotor as lines on a plane: seen as the paper's pictures see it. Knows no file format."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from rotor_mbs.analysis.kinematics import tip_paths
from rotor_mbs.report.paper_figures import seen
from rotor_mbs.scenario.scene import Scene

Array = NDArray[Any]


@dataclass(frozen=True)
class Wires:
    """A run at equally spaced times, projected, in m.

    axis, edge, root   (frames, blades, 2): the pitch axis' end, the tip, and the tip's offset at the hub
    reach              m from the hub to the farthest tip
    ended              the frame after the last that the run has
    """

    axis: Array
    edge: Array
    root: Array
    reach: float
    ended: int


def wires(scene: Scene, time: Array, angles: Array, at: Array, magnified: float) -> Wires:
    """At the times `at` (s); distances from the pitch axis are drawn `magnified` times."""
    moved = np.stack([np.interp(at, time, column) for column in angles.T], axis=1)
    reach = max(float(np.linalg.norm(blade.tip)) for blade in scene.blades)
    near = np.searchsorted(at, time[-1], side="right")
    return Wires(
        _points(scene, moved, 0.0, 1.0), _points(scene, moved, magnified, 1.0), _points(scene, moved, magnified, 0.06),
        reach, int(near),
    )  # fmt: skip


def _points(scene: Scene, angles: Array, across: float, along: float) -> Array:
    """(frames, blades, 2) of each blade's tip, its offset `across` times and its length `along` times as large."""
    blades = tuple(
        replace(blade, tip=(across * blade.tip[0], across * blade.tip[1], along * blade.tip[2]))
        for blade in scene.blades
    )
    paths = tip_paths(replace(scene, blades=blades), angles)
    return seen(paths.reshape(-1, 3)).reshape(*paths.shape[:2], 2)
