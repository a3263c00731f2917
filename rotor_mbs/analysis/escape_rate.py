"""How fast a pitch may leave zero in a scene, from its stored text. Must not know runs."""

from __future__ import annotations

import math

from rotor_mbs.errors import InputError
from rotor_mbs.scenario.scene_file import parse_scene
from rotor_mbs.store.read import StoredScene


def escape_rate(stored: StoredScene) -> float | None:
    """1/s: sqrt(g/c) of the fastest blade, a pendulum about its pitch axis that stands upside down (below the shaft).

    A point mass at distance c from the pitch axis under gravity g; a spring changes it. None for blades with inertia
    of their own, for bearings with springs or dampers, and where nothing makes the pitch unstable.
    """
    try:
        scene = parse_scene(stored.attributes["scene_toml"], "scene")
    except (KeyError, InputError):
        return None  # a text of another version: the rate is an extra, the page goes without
    arms = [arm for blade in scene.blades if (arm := math.hypot(*blade.centre_of_mass[:2])) > 0.0]
    is_rigid = not all(blade.is_point_mass for blade in scene.blades)
    if is_rigid or scene.bearing_stiffness or scene.bearing_damping or scene.gravity <= 0.0 or not arms:
        return None
    return math.sqrt(scene.gravity / min(arms))
