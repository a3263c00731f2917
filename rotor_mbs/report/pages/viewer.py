"""The data of the viewer on a scene's page: the bodies, and each model's angles at equally spaced times.

Angles are turns in 16 bits (1e-4 rad, a pixel at the tip on any screen). Between frames the viewer goes the shorter
way round: a coordinate may turn half a revolution from one to the next. `templates/viewer.js` draws.
"""

from __future__ import annotations

import base64
import json
import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from markupsafe import Markup
from numpy.typing import NDArray

from rotor_mbs.analysis.rehydrate import scene_of
from rotor_mbs.report.core.looks import coordinate_look
from rotor_mbs.scenario.scene import Scene
from rotor_mbs.store.read import StoredRun, StoredScene

Array = NDArray[Any]
FRAMES = 361
_VISIBLE = 0.1  # of the longest blade
_TURN = 65536  # values of 16 bits


@dataclass(frozen=True)
class Viewer:
    """For the template. data: JSON, safe inside a script element; models: their names, in the order of the data.

    magnified: how many times the tip's distance from the pitch axis is drawn at first; None where it has none.
    """

    data: Markup
    models: Sequence[str]
    magnified: int | None


def viewer(stored: StoredScene, runs: Mapping[str, StoredRun]) -> Viewer | None:
    """runs: at most two, by the name to be shown. None where the scene's bodies or the angles are not known."""
    scene = scene_of(stored)
    if scene is None:
        return None
    moves = {name: found for name, run in runs.items() if (found := _motion(run, 1 + len(scene.blades))) is not None}
    if not moves:
        return None
    end = max(float(time[-1]) for time, _ in moves.values())
    if end <= 0.0:
        return None
    step = end / (FRAMES - 1)
    data = {
        "step": step,
        "colours": [coordinate_look(i + 1).colour for i in range(len(scene.blades))],
        "blades": [
            {"phase": phase, "tip": blade.tip, "mass": blade.centre_of_mass}
            for phase, blade in zip(scene.phases, scene.blades, strict=True)
        ],
        "models": [{"name": name, "angles": packed(*move, step)} for name, move in moves.items()],
    }
    return Viewer(script_json(data), list(moves), magnification(scene))


def magnification(scene: Scene) -> int | None:
    """How many times a tip's distance from its pitch axis is drawn, so that it is a tenth of the blade; at least 1.

    None where every tip lies on its axis: its pitch cannot be seen.
    """
    offset = max(math.hypot(*blade.tip[:2]) for blade in scene.blades)
    if not offset:
        return None
    length = max(math.hypot(*blade.tip) for blade in scene.blades)
    return max(1, round(_VISIBLE * length / offset))


def packed(time: Array, angles: Array, step: float) -> str:
    """Base64 of (frames, coordinates) unsigned 16 bit, little end first: the angle at 0, step, 2 step ... in turns."""
    frames = math.floor(float(time[-1]) / step + 1e-9) + 1
    at = np.minimum(np.arange(frames) * step, time[-1])
    values = np.stack([np.interp(at, time, column) for column in angles.T], axis=1)
    turns = np.round(values / (2.0 * np.pi) * _TURN) % _TURN
    return base64.b64encode(turns.astype("<u2").tobytes()).decode("ascii")


def script_json(data: object) -> Markup:
    """JSON in which no character can end a script element or begin a comment."""
    text = json.dumps(data, separators=(",", ":"), ensure_ascii=True, allow_nan=False)
    for sign in "<>&":
        text = text.replace(sign, f"\\u{ord(sign):04x}")
    return Markup(text)


def _motion(run: StoredRun, coordinates: int) -> tuple[Array, Array] | None:
    """Time and angles up to the first sample that is not finite; None where they cannot be drawn."""
    if "time" not in run or "angles" not in run:
        return None
    time, angles = run.array("time"), run.array("angles")
    if angles.ndim != 2 or angles.shape[1] != coordinates or len(time) != len(angles):
        return None
    good = np.isfinite(time) & np.isfinite(angles).all(axis=1)
    count = len(good) if good.all() else int(good.argmin())
    return (time[:count], angles[:count]) if count >= 2 else None
