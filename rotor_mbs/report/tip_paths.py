"""Compute the lines in a picture of the tips' paths, in a parallel projection."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from rotor_mbs.report.looks import GREY, RING, coordinate_look
from rotor_mbs.solution.quantities import Array

_AZIMUTH, _ELEVATION = np.radians((-62.0, 14.0))  # direction from which the rotor is seen


class Line(NamedTuple):
    """A line of the picture.

    points : (n, 2) positions in the picture, to the right and up, m.
    colour : colour such as "#0072b2".
    width : width of the line, points.
    label : name of the line in a legend. Only the paths have one; other lines have "".
    dashed : whether the line is dashed.
    end : mark at the last point: "hollow", "filled", or "" for none.
    """

    points: Array
    colour: str
    width: float
    label: str = ""
    dashed: bool = False
    end: str = ""


class Picture(NamedTuple):
    """The paths of the tips, the blades at the start and at the end, shaft, axes and a scale.

    reach : radius around the hub that contains all paths, m.
    lines : lines in the order in which they are drawn.
    texts : (position, text) of each text: the names of the three axes, then their length.
    """

    reach: float
    lines: list[Line]
    texts: list[tuple[Array, str]]


def picture_of(tip: Array, tilt: float = 0.0) -> Picture:
    """Return the picture of the paths of the tips.

    Parameters
    ----------
    tip : (n, blades, 3) positions of the tips, m, base frame.
    tilt : tilt of the shaft, rad.
    """
    reach = 1.04 * float(np.linalg.norm(tip, axis=2).max())
    angle = np.linspace(0.0, 2.0 * np.pi, 37)
    ring = reach * np.stack([np.sin(angle), 0.0 * angle, np.cos(angle)], axis=1)
    shaft = np.array([[0.0, 0.0, 0.0], [0.0, -0.3 * reach, 0.0]])
    if tilt:
        turn = np.array(
            [[1.0, 0.0, 0.0], [0.0, np.cos(tilt), -np.sin(tilt)], [0.0, np.sin(tilt), np.cos(tilt)]]
        )
        ring, shaft = ring @ turn.T, shaft @ turn.T
    lines = [Line(projected(ring), RING, 0.7), Line(projected(shaft), GREY, 3.0)]
    texts = []
    ten = 10.0 ** math.floor(math.log10(reach))
    # The axes are the scale of the picture. Their length is the largest number that is at most a
    # third of the reach and is 1, 2 or 5 times a power of ten.
    length = next(step * ten for step in (5.0, 2.0, 1.0, 0.5, 0.2) if reach >= 3.0 * step * ten)
    corner = np.array([-0.88, -0.86]) * reach
    for end, name in zip(projected(length * np.eye(3)), "xyz", strict=True):
        lines.append(Line(np.stack([corner, corner + end]), GREY, 0.8))
        texts.append((corner + 1.2 * end, name))
    texts.append((corner - [0.0, 0.12 * reach], f"{length:g} m"))
    for blade in range(tip.shape[1]):
        colour, path = coordinate_look(blade + 1).colour, projected(tip[:, blade])
        lines.append(Line(path, colour, 0.8, f"blade {blade + 1}"))
        at_start, at_end = (np.stack([np.zeros(2), end]) for end in (path[0], path[-1]))
        lines.append(Line(at_start, colour, 1.6, dashed=True, end="hollow"))
        lines.append(Line(at_end, colour, 1.6, end="filled"))
    return Picture(reach, lines, texts)


def projected(points: Array) -> Array:
    """Project points onto the plane of the picture, seen from the side and from above.

    Parameters
    ----------
    points : (n, 3) m, base frame.

    Returns
    -------
    (n, 2) ndarray
        Positions in the picture, to the right and up, m.
    """
    right = np.array([-np.sin(_AZIMUTH), np.cos(_AZIMUTH), 0.0])
    level = np.array([np.cos(_AZIMUTH), np.sin(_AZIMUTH), 0.0])
    up = np.array([0.0, 0.0, np.cos(_ELEVATION)]) - np.sin(_ELEVATION) * level
    seen: Array = points @ np.stack([right, up], axis=1)
    return seen
