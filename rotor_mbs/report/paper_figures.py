"""How the paper's figures are drawn, upon given axes.

Knows runs by their arrays. The same drawing serves a page (one picture a model) and a manuscript (one figure in all).
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from rotor_mbs.analysis import methods
from rotor_mbs.report import texts
from rotor_mbs.report.core import canvas
from rotor_mbs.report.names import COLOURS, GREY, coordinate_look
from rotor_mbs.report.plots.time_histories import set_range, thin
from rotor_mbs.store.read import StoredRun, StoredScene

Array = NDArray[Any]
_BINS = 130  # stretches of a curve: a highest and a lowest point each
_VIEW = np.radians((-62.0, 14.0))  # azimuth and elevation from which paths are seen


def columns(scene: StoredScene) -> dict[str, StoredRun]:
    """What stands side by side, by heading: as printed, the right model, Exudyn; those that have samples."""
    exudyn = [
        run for name, run in methods.right_runs(scene).items()
        if methods.model_of(name).startswith("exudyn") and methods.has_samples(run)
    ]  # fmt: skip
    runs = {
        texts.PRINTED_COLUMN: methods.printed_run(scene),
        texts.RIGHT_COLUMN: methods.right_run(scene),
        texts.EXUDYN_COLUMN: next(iter(sorted(exudyn, key=lambda run: not run.method.startswith("exudyn_tree"))), None),
    }
    found: dict[str, StoredRun] = {}
    for heading, run in runs.items():
        if run is not None and run not in found.values() and "angles" in run and "rates" in run:
            found[heading] = run
    return found


def draw_motion(axes: Sequence[Any], run: StoredRun) -> None:
    """(a) position upon the first axes, (b) velocity upon the second: every coordinate."""
    for one, name in zip(axes, ("angles", "rates"), strict=True):
        values = run.array(name)
        for column, curve in enumerate(values.T):
            colour, line = coordinate_look(column)
            one.plot(*thin(run.array("time"), curve, _BINS), color=colour, linestyle=line)
        set_range(one, values)
    _label(axes)


def draw_torques(axes: Sequence[Any], runs: Mapping[str, StoredRun]) -> None:
    """The rotor's position and velocity for each torque (label -> run)."""
    for one, name in zip(axes, ("angles", "rates"), strict=True):
        for place, run in enumerate(runs.values()):
            curve = run.array(name)[:, 0]
            colour, line = torque_look(place)
            one.plot(*thin(run.array("time"), curve, _BINS), color=colour, linestyle=line)
        set_range(one, np.concatenate([run.array(name)[:, :1] for run in runs.values()]))
    _label(axes)


def torque_look(place: int) -> tuple[str, str]:
    return COLOURS[place % len(COLOURS)], ("-", "--", "-.", ":")[place % 4]


def _label(axes: Sequence[Any]) -> None:
    axes[0].set_title(texts.PART_A, loc="left")
    axes[0].tick_params(labelbottom=False)
    axes[0].set_ylabel(texts.ANGLE_AXIS)
    axes[1].set_title(texts.PART_B, loc="left")
    axes[1].set(xlabel=texts.TIME_AXIS, ylabel=texts.RATE_AXIS)


def draw_paths(axes: Any, tip: Array) -> None:
    """The tips' paths (n, blades, 3) as seen obliquely, the wire frame at the start dashed, at the end full."""
    reach = 1.04 * float(np.linalg.norm(tip, axis=2).max())
    canvas.flat_space(axes, 0.9 * reach, 1.0 * reach)
    turned = np.linspace(0.0, 2.0 * np.pi, 73)
    ring = reach * np.stack([np.sin(turned), 0.0 * turned, np.cos(turned)], axis=1)
    axes.plot(*seen(ring).T, color="#dddddd", linewidth=0.7)
    axes.plot(*seen(np.array([[0.0, 0.0, 0.0], [0.0, -0.3 * reach, 0.0]])).T, color=GREY, linewidth=3.0)
    for blade in range(tip.shape[1]):
        colour, _ = coordinate_look(blade + 1)
        path = seen(tip[:, blade])
        axes.plot(*_sparse(path, 0.004 * reach).T, color=colour, linewidth=0.8)
        for end, dashes, fill in ((path[0], (0, (3, 2)), "white"), (path[-1], "-", colour)):
            axes.plot((0.0, end[0]), (0.0, end[1]), color=colour, linestyle=dashes, linewidth=1.6)
            axes.plot(*end[:, None], marker="o", markersize=4, markeredgecolor=colour, markerfacecolor=fill)


def seen(points: Array) -> Array:
    """(n, 2) m of (n, 3): across and up, from far away, slightly above and to the side."""
    azimuth, elevation = _VIEW
    right = np.array([-np.sin(azimuth), np.cos(azimuth), 0.0])
    up = np.array([-np.sin(elevation) * np.cos(azimuth), -np.sin(elevation) * np.sin(azimuth), np.cos(elevation)])
    projected: Array = points @ np.stack([right, up], axis=1)
    return projected


def _sparse(path: Array, step: float) -> Array:
    """Points at least `step` m apart, the last one always."""
    kept = [0]
    for i in range(1, len(path)):
        if np.hypot(*(path[i] - path[kept[-1]])) >= step:
            kept.append(i)
    return path[[*kept, len(path) - 1]]
