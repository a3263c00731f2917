"""Scenes for tests: the shipped ones by name, changed where a test wants; and rotors made by
hand."""

from __future__ import annotations

import functools
import math
from dataclasses import replace
from typing import Any

from rotor_mbs.scenario.catalogue import find_scenes, only_scene
from rotor_mbs.scenario.scene import Blade, Scene

PAPER_SCENES = tuple(scene.name.removeprefix("paper/") for scene in find_scenes(["paper"]))
MASS, OFFSET, ARM, GRAVITY = 15000.0, math.hypot(0.08, 0.03), 15.42, 9.8

shipped = functools.cache(only_scene)


def paper(name: str, **changes: Any) -> Scene:
    """A scene of the paper, with `changes` in place of its own values."""
    return replace(shipped(f"paper/{name}"), **changes)


def general(**changes: Any) -> Scene:
    """Three different rigid blades of full inertia on a heavy hub, sprung and moving: nothing is
    zero or equal."""
    scene = replace(
        shipped("check/general"),
        name="general",
        text="",
        duration=4.0,
        samples=401,
        rotor_torque=(),
        shaft_damping=0.0,
        bearing_damping=(0.0,) * 3,
        bearing_stiffness=(2.0e4, 1.5e4, 3.0e4),
        initial_angles=(0.3, 0.2, -0.4, 0.6),
        initial_rates=(0.5, -0.3, 0.2, 0.4),
    )
    return replace(scene, **changes)


# Rotors made by hand

PAPER_BLADE = Blade(MASS, (OFFSET, 0.0, ARM), (0.0,) * 6, (OFFSET, 0.0, 33.38))
STOUT = Blade(100.0, (0.3, -0.2, 4.0), (30.0, 40.0, 25.0, 3.0, -4.0, 5.0), (0.3, 0.1, 8.0))
SLIM = Blade(80.0, (-0.1, 0.25, 3.0), (20.0, 22.0, 9.0, -2.0, 1.0, 2.0), (0.3, 0.1, 6.0))
AXIAL = Blade(50.0, (0.0, 0.0, 3.0), (12.0, 12.0, 7.0, 0.0, 0.0, 0.0), (0.2, 0.0, 6.0))
ALL = ("angles", "rates", "tip", "energy")


def make_scene(
    angles, rates, blades=None, gravity=9.8, duration=1.0, samples=101, outputs=ALL, **more
) -> Scene:
    """A scene with as many of the paper's blades as there are pitch angles, unless told
    otherwise."""
    return Scene(
        name="test",
        title="test",
        figures=(),
        gravity=gravity,
        duration=duration,
        samples=samples,
        outputs=outputs,
        blades=blades or (PAPER_BLADE,) * (len(angles) - 1),
        hub_inertia=more.pop("hub_inertia", 0.0),
        initial_angles=tuple(map(float, angles)),
        initial_rates=tuple(map(float, rates)),
        **more,
    )


# Every load at once, constant, with ramps and with jumps between samples, on unlike blades of full
# inertia.
MIXED = make_scene(
    [0.3, 0.4, -0.2, 1.0],
    [1.0, 0.5, -0.3, 0.2],
    (STOUT, SLIM, STOUT),
    duration=1.6,
    samples=161,
    hub_inertia=500.0,
    bearing_stiffness=(2000.0, 3000.0, 100.0),
    bearing_damping=(5.0, 8.0, 1.0),
    shaft_damping=200.0,
    rotor_torque=((0.1234, 0.0), (0.777, 2000.0), (0.777, -1000.0), (1.5, -1000.0), (1.5, 500.0)),
    pitch_torque=(((0.0, 40.0),), ((0.2, 0.0), (0.55, 90.0), (0.55, -60.0)), ()),
    bearing_rest=(
        ((0.0, 0.2),),
        ((0.4, 0.0), (0.9, 0.3)),
        ((0.777, 0.1), (0.777, -0.5), (1.3, 0.4)),
    ),
)
