"""Scenes for tests: the shipped ones by name, changed where a test wants, and a rotor of general rigid blades."""

from __future__ import annotations

import functools
import math
from dataclasses import replace
from typing import Any

from rotor_mbs.scenario.catalogue import find_scenes
from rotor_mbs.scenario.scene import Blade, Scene

PAPER = tuple(scene.name.removeprefix("paper/") for scene in find_scenes(["paper"]))
MASS, OFFSET, ARM, GRAVITY = 15000.0, math.hypot(0.08, 0.03), 15.42, 9.8


@functools.cache
def _shipped(name: str) -> Scene:
    return find_scenes([f"paper/{name}"])[0]


def paper(name: str, **changes: Any) -> Scene:
    """A scene of the paper, with `changes` in place of its own values."""
    return replace(_shipped(name), **changes)


def general(**changes: Any) -> Scene:
    """Three different rigid blades of full inertia on a heavy hub, sprung and moving: nothing is zero or equal."""
    blades = tuple(
        Blade(
            800.0 + 100.0 * i,
            (0.4 - 0.1 * i, 0.15 * i - 0.2, 5.0 + 0.3 * i),
            (4000.0 + 50.0 * i, 4100.0, 300.0 + 20.0 * i, 30.0, -40.0 + 5.0 * i, 25.0),
            (0.5, 0.1, 11.0),
        )
        for i in range(3)
    )
    scene = Scene(
        name="general",
        title="three different blades",
        figures=(),
        gravity=9.81,
        duration=4.0,
        samples=401,
        outputs=("angles", "rates", "tip", "energy"),
        blades=blades,
        hub_inertia=5000.0,
        initial_angles=(0.3, 0.2, -0.4, 0.6),
        initial_rates=(0.5, -0.3, 0.2, 0.4),
        bearing_stiffness=(2.0e4, 1.5e4, 3.0e4),
        bearing_damping=(0.0, 0.0, 0.0),
    )
    return replace(scene, **changes)
