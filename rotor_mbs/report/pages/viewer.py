"""Compute the data of the animation: blades, and angles at equally spaced times.

The script `templates/viewer.js` draws them.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any

import numpy as np

from rotor_mbs.report.files import script_json
from rotor_mbs.report.looks import coordinate_look, name_of_colour, with_capital
from rotor_mbs.report.numbers import with_unit
from rotor_mbs.runs.read import StoredRun, StoredScene
from rotor_mbs.scenario.scene import Scene
from rotor_mbs.solution.trajectory import Array

# Largest number of frames. It limits the size of a page, so that the page can be sent by mail. A
# run with fewer samples has as many frames as samples.
MAX_FRAMES = 2401
# If an angle changes by more than this (rad) from a frame to the next, the page says that the
# animation interpolates.
_COARSE = 0.5 * math.pi
_DECIMALS = 4  # decimals of angles in rad: the error at the tip is below a pixel on any screen
# The largest distance of a tip from its pitch axis is drawn as this share of the longest blade.
_VISIBLE = 0.1


def viewer(stored: StoredScene, runs: Mapping[str, StoredRun]) -> dict[str, Any] | None:
    """Return the data of the animation for the template; None if no run has angles.

    Parameters
    ----------
    stored : the scene, with the blades.
    runs : at most two runs, by the names that are shown. The samples of a run from its first sample
        that is not finite on are left out. A run with fewer than two other samples is left out.

    Returns
    -------
    dict or None
        "data" (JSON for the script), "models" (names), "magnified" (see `magnification`), and
        "notes" (texts).
    """
    scene = stored.scene
    moves: dict[str, tuple[Array, Array]] = {}
    for name, run in runs.items():
        time, angles = run.get("time"), run.get("angles")
        if time is None or angles is None or angles.shape != (len(time), 1 + len(scene.blades)):
            continue
        good = np.isfinite(time) & np.isfinite(angles).all(axis=1)
        # Number of samples before the first one that is not finite.
        count = len(good) if good.all() else int(good.argmin())
        if count >= 2:
            moves[name] = time[:count], angles[:count]
    if not moves:
        return None
    # The frames of both runs have the same step, which divides the time of the longer run equally.
    longest = max((time for time, _ in moves.values()), key=lambda time: float(time[-1]))
    if longest[-1] <= 0.0:
        return None
    step = float(longest[-1]) / (min(len(longest), MAX_FRAMES) - 1)
    frames = {name: angles_at(*move, step) for name, move in moves.items()}
    data = {
        "step": step,
        "tilt": scene.shaft_tilt,
        "colours": [
            name_of_colour(coordinate_look(i + 1).colour) for i in range(len(scene.blades))
        ],
        "blades": [
            {"phase": phase, "cone": blade.cone, "tip": blade.tip, "mass": blade.centre_of_mass}
            for phase, blade in zip(scene.phases, scene.blades, strict=True)
        ],
        "models": [
            {"name": name, "frames": angles.round(_DECIMALS).tolist()}
            for name, angles in frames.items()
        ],
    }
    notes = []
    for name, angles in frames.items():
        largest = float(np.abs(np.diff(angles, axis=0)).max(initial=0.0))
        if largest > _COARSE:
            turned = (
                f"{with_capital(name)} turns by up to {with_unit(largest, 'rad')} from one frame "
                "to the next"
            )
            notes.append(f"{turned}: the animation interpolates linearly in between.")
    return {
        "data": script_json(data),
        "models": list(moves),
        "magnified": magnification(scene),
        "notes": notes,
    }


def angles_at(time: Array, angles: Array, step: float) -> Array:
    """Return the angles at 0, step, 2 step, ... s, linearly interpolated between samples.

    Parameters
    ----------
    time : (n,) times of the samples, s.
    angles : (n, coordinates) rad.
    step : time from a frame to the next, s.

    Returns
    -------
    (frames, coordinates) ndarray
        Angles, rad.
    """
    # The quotient may be slightly below a whole number because of rounding. A small number is added
    # before it is rounded down. The last frame might then be later than the last sample. Its time
    # is therefore limited.
    count = math.floor(float(time[-1]) / step + 1e-9) + 1
    at = np.minimum(np.arange(count) * step, time[-1])
    return np.stack([np.interp(at, time, column) for column in angles.T], axis=1)


def magnification(scene: Scene) -> int | None:
    """Return the factor by which the distances of the tips from their pitch axes are magnified.

    With this factor the largest distance is a tenth of the length of the longest blade. The factor
    is at least 1. None is returned if all tips are on the axes.
    """
    offset = max(math.hypot(*blade.tip[:2]) for blade in scene.blades)
    if not offset:
        return None
    length = max(math.hypot(*blade.tip) for blade in scene.blades)
    return max(1, round(_VISIBLE * length / offset))
