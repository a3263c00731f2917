"""What is the same and what is not between the models of a scene, in numbers. Knows no sentence and draws nothing."""

from __future__ import annotations

import math
from dataclasses import dataclass
from fractions import Fraction
from typing import Any

import numpy as np
from numpy.typing import NDArray

from rotor_mbs.report import texts
from rotor_mbs.report.pages import scene_tables as metrics
from rotor_mbs.report.pages.viewer import scene_of
from rotor_mbs.report.paper_figures import columns
from rotor_mbs.store.read import StoredRun, StoredScene

Array = NDArray[Any]
SEEN = 0.05  # rad: what one sees in a figure of the paper's size
_STILL = 1e-9  # rad: rounding, not motion


@dataclass(frozen=True)
class Facts:
    """Of a scene; None where the file cannot tell.

    seen_apart    s, the first time at which the printed angles are SEEN away from the right ones; inf: never
    largest       rad, how far they get
    ended         s, when the printed run broke off
    right_still   whether no blade of the right model pitches
    printed_pitch rad, the largest pitch of the printed model
    gain          J that the printed model makes out of nothing
    exudyn        rad, Exudyn from the right model, up to `until` (s)
    """

    seen_apart: float | None
    largest: float | None
    ended: float | None
    right_still: bool
    printed_pitch: float | None
    gain: float | None
    exudyn: float | None
    until: float


def facts(scene: StoredScene) -> Facts:
    runs = columns(scene)
    printed, right, exudyn = (
        runs.get(name) for name in (texts.PRINTED_COLUMN, texts.RIGHT_COLUMN, texts.EXUDYN_COLUMN)
    )
    horizon = metrics.horizon(scene)
    seen_apart = largest = ended = gain = pitch = near = None
    until = math.inf if horizon is None else horizon
    if printed is not None:
        gain = metrics.metric(printed, "energy_gain_J")
        pitch = float(np.abs(printed.array("angles")[:, 1:]).max(initial=0.0))
        if printed.status not in ("ok", "inaccurate"):
            ended = float(printed.array("time")[-1])
    if printed is not None and right is not None:
        gap = _gap(printed, right)
        largest = float(gap.max())
        apart = np.flatnonzero(gap > SEEN)
        seen_apart = float(printed.array("time")[apart[0]]) if len(apart) else math.inf
    if exudyn is not None and right is not None:
        gap = _gap(exudyn, right)
        time = exudyn.array("time")[: len(gap)]
        until = min(until, float(time[-1]))
        near = float(gap[time <= until].max(initial=0.0))
    still = right is not None and bool(np.abs(right.array("angles")[:, 1:]).max(initial=0.0) < _STILL)
    return Facts(seen_apart, largest, ended, still, pitch, gain, near, until)


def _gap(one: StoredRun, other: StoredRun) -> Array:
    n = min(len(one.array("time")), len(other.array("time")))
    found: Array = np.abs(one.array("angles")[:n] - other.array("angles")[:n]).max(axis=1)
    return found


def conditions(stored: StoredScene, *, with_torque: bool = True) -> str:
    """What a caption says: start, torque, gravity, duration; "" where the stored text is no scene."""
    scene = scene_of(stored)
    if scene is None:
        return ""
    angles, rates = (", ".join(in_pi(x) for x in values) for values in (scene.initial_angles, scene.initial_rates))
    torque = scene.torque_at(0.0) if scene.has_constant_torque else None
    if not with_torque:
        torque = 0.0
    return texts.conditions(angles, rates, torque, scene.gravity, scene.duration)


def in_pi(value: float) -> str:
    """11π/12 where it is a simple part of π, else four digits."""
    part = Fraction(value / math.pi).limit_denominator(12)
    if value and abs(float(part) * math.pi - value) < 1e-12:
        top = {1: "π", -1: "−π"}.get(part.numerator, f"{part.numerator}π".replace("-", "−"))
        return top if part.denominator == 1 else f"{top}/{part.denominator}"
    return f"{value:.4g}".replace("-", "−")
