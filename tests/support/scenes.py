"""Scenes for tests: the shipped ones by name, changed where a test wants, and a rotor of general rigid blades."""

from __future__ import annotations

import functools
import math
from dataclasses import replace
from typing import Any

from rotor_mbs.scenario.catalogue import find_scenes, only_scene
from rotor_mbs.scenario.scene import Scene

PAPER = tuple(scene.name.removeprefix("paper/") for scene in find_scenes(["paper"]))
MASS, OFFSET, ARM, GRAVITY = 15000.0, math.hypot(0.08, 0.03), 15.42, 9.8


_shipped = functools.cache(only_scene)


def paper(name: str, **changes: Any) -> Scene:
    """A scene of the paper, with `changes` in place of its own values."""
    return replace(_shipped(f"paper/{name}"), **changes)


def general(**changes: Any) -> Scene:
    """Three different rigid blades of full inertia on a heavy hub, sprung and moving: nothing is zero or equal."""
    scene = replace(
        _shipped("check/general"), name="general", text="", duration=4.0, samples=401,
        rotor_torque=(), shaft_damping=0.0, bearing_damping=(0.0,) * 3, bearing_stiffness=(2.0e4, 1.5e4, 3.0e4),
        initial_angles=(0.3, 0.2, -0.4, 0.6), initial_rates=(0.5, -0.3, 0.2, 0.4),
    )  # fmt: skip
    return replace(scene, **changes)
