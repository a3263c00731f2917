"""Paths of the blade tips in space, seen obliquely with equal scales. From plain arrays."""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from rotor_mbs.report.core import canvas
from rotor_mbs.report.core.canvas import Panels
from rotor_mbs.report.core.looks import GREY, coordinate_look
from rotor_mbs.solution.trajectory import Array

_AZIMUTH, _ELEVATION = np.radians((-62.0, 14.0))  # of the direction from which paths are seen


def paths(tip: Array) -> Panels:
    """The paths of `tip` (n, blades, 3) m."""
    panels = canvas.panels((4.1,), "")
    draw_paths(panels.axes[0], tip)
    return panels


def draw_paths(axes: Any, tip: Array) -> None:
    """The paths of `tip` (n, blades, 3) m with the blades at the start (dashed) and at the end (solid), and the shaft.

    Axes of a stated length give the scale.
    """
    reach = 1.04 * float(np.linalg.norm(tip, axis=2).max())
    axes.set(xlim=(-0.95 * reach, 0.95 * reach), ylim=(-1.02 * reach, 1.02 * reach), aspect="equal")
    axes.set_axis_off()
    angle = np.linspace(0.0, 2.0 * np.pi, 37)
    ring = reach * np.stack([np.sin(angle), 0.0 * angle, np.cos(angle)], axis=1)
    axes.plot(*projected(ring).T, color="#dddddd", linewidth=0.7)
    axes.plot(*projected(np.array([[0.0, 0.0, 0.0], [0.0, -0.3 * reach, 0.0]])).T, color=GREY, linewidth=3.0)
    _draw_scale(axes, reach)
    for blade in range(tip.shape[1]):
        colour = coordinate_look(blade + 1).colour
        path = projected(tip[:, blade])
        axes.plot(*path.T, color=colour, linewidth=0.8)
        for end, dashes, fill in ((path[0], (0, (3, 2)), "white"), (path[-1], "-", colour)):
            axes.plot((0.0, end[0]), (0.0, end[1]), color=colour, linestyle=dashes, linewidth=1.6)
            axes.plot(*end[:, None], marker="o", markersize=4, markeredgecolor=colour, markerfacecolor=fill)


def _draw_scale(axes: Any, reach: float) -> None:
    """Axes x, y and z in a corner, and their length."""
    ten = 10.0 ** math.floor(math.log10(reach))
    length = next(step * ten for step in (5.0, 2.0, 1.0, 0.5, 0.2) if reach >= 3.0 * step * ten)
    corner = np.array([-0.88, -0.86]) * reach
    for end, name in zip(projected(length * np.eye(3)), "xyz", strict=True):
        axes.plot(*np.stack([corner, corner + end]).T, color=GREY, linewidth=0.8)
        axes.text(*(corner + 1.2 * end), name, color=GREY, ha="center", va="center", fontsize="small")
    axes.text(*(corner - [0.0, 0.12 * reach]), f"{length:g} m", color=GREY, ha="left", va="center", fontsize="small")


def projected(points: Array) -> Array:
    """Points (n, 3) as seen from far away, from above and to the side: (n, 2), to the right and up, in m."""
    right = np.array([-np.sin(_AZIMUTH), np.cos(_AZIMUTH), 0.0])
    level = np.array([np.cos(_AZIMUTH), np.sin(_AZIMUTH), 0.0])
    up = np.array([0.0, 0.0, np.cos(_ELEVATION)]) - np.sin(_ELEVATION) * level
    seen: Array = points @ np.stack([right, up], axis=1)
    return seen
