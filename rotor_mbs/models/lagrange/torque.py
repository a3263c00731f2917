"""A torque over time as stretches on which it is linear: no integrator steps over a kink. Knows the scene only."""

from __future__ import annotations

import itertools
from fractions import Fraction
from typing import NamedTuple

from rotor_mbs.scenario.scene import Scene


class Stretch(NamedTuple):
    """From `start` to `end` (s) the torque is offset + slope·t (N m, N m/s; exact)."""

    start: float
    end: float
    offset: Fraction
    slope: Fraction


def stretches(scene: Scene) -> list[Stretch]:
    """The whole duration, cut where the torque has a kink or a jump; one stretch where it is constant."""
    table = [(Fraction(t), Fraction(torque)) for t, torque in scene.rotor_torque]
    if scene.has_constant_torque:
        return [Stretch(0.0, scene.duration, table[0][1] if table else Fraction(0), Fraction(0))]
    end = Fraction(scene.duration)
    rows = [(Fraction(0), table[0][1]), *table, (max(end, table[-1][0]), table[-1][1])]
    pieces = []
    for (t0, torque0), (t1, torque1) in itertools.pairwise(rows):
        if t0 < min(t1, end):
            slope = (torque1 - torque0) / (t1 - t0)
            pieces.append(Stretch(float(t0), float(min(t1, end)), torque0 - slope * t0, slope))
    return pieces
