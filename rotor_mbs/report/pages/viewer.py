"""Compute the data that `templates/viewer.js` draws: bodies, and angles at equally spaced times."""

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

# So many that a page can be sent by mail; a run with fewer samples has a frame for each.
MAX_FRAMES = 2401
# rad from a frame to the next; beyond it the page says that it interpolates.
_COARSE = 0.5 * math.pi
_DECIMALS = 4  # of an angle in rad: a pixel at the tip on any screen
_VISIBLE = 0.1  # share of the longest blade's length


def viewer(stored: StoredScene, runs: Mapping[str, StoredRun]) -> dict[str, Any] | None:
    """Return the data of the moving rotor for the template; None without angles of any run.

    Parameters
    ----------
    stored : the scene, with the bodies.
    runs : at most two, by the name to be shown. A run without finite angles for two samples is left
        out, and what follows its first sample that is not finite.

    Returns
    -------
    dict or None
        data (JSON for the script), models (names), magnified (see `magnification`), notes.
    """
    scene = stored.scene
    moves: dict[str, tuple[Array, Array]] = {}
    for name, run in runs.items():
        time, angles = run.get("time"), run.get("angles")
        if time is None or angles is None or angles.shape != (len(time), 1 + len(scene.blades)):
            continue
        good = np.isfinite(time) & np.isfinite(angles).all(axis=1)
        # Samples up to the first one that is not finite.
        count = len(good) if good.all() else int(good.argmin())
        if count >= 2:
            moves[name] = time[:count], angles[:count]
    if not moves:
        return None
    # Both runs have frames at the same times, up to the end of the longer one.
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
    """Return the angles at 0, step, 2 step, ... s, interpolated between samples.

    Parameters
    ----------
    time : (n,) s.
    angles : (n, coordinates) rad.
    step : from a frame to the next, s.

    Returns
    -------
    (frames, coordinates) ndarray
        Angles, rad.
    """
    # The quotient may lie below a whole number by its rounding alone; the last time is then limited
    # to that of the last sample.
    count = math.floor(float(time[-1]) / step + 1e-9) + 1
    at = np.minimum(np.arange(count) * step, time[-1])
    return np.stack([np.interp(at, time, column) for column in angles.T], axis=1)


def magnification(scene: Scene) -> int | None:
    """Return the factor by which distances of the tips from their pitch axes are magnified.

    The largest is drawn as a tenth of the longest blade, and never smaller than it is. None: the
    tips lie on the axes.
    """
    offset = max(math.hypot(*blade.tip[:2]) for blade in scene.blades)
    if not offset:
        return None
    length = max(math.hypot(*blade.tip) for blade in scene.blades)
    return max(1, round(_VISIBLE * length / offset))
