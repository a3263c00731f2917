"""Whether stored data are those of the method they are stored under: copies, settings, steps."""

from __future__ import annotations

import itertools
import math
from collections.abc import Iterator, Mapping

import numpy as np

from rotor_mbs.errors import InputError
from rotor_mbs.methods.catalogue import look_up
from rotor_mbs.runs.read import StoredRun, StoredScene
from rotor_mbs.scenario.accuracy_bounds import expected_settings
from rotor_mbs.scenario.scene import Scene

# Of a column's largest value: below it a column is a straight line, which methods of any kind may give exactly.
_STRAIGHT = 1e-12
# Few samples of a short motion may be rounded alike by two methods that are right: fig11 over 0.1 s, 6 samples.
_FEWEST = 100


def copies(scene: StoredScene) -> Iterator[tuple[StoredRun, str, str]]:
    """(run, other method, array and column) of every column that two runs of a scene have bit for bit.

    Methods round differently, so that equal bits are a copy. Columns that are zero, constant or a straight line do not
    count, nor short ones; nor two runs by MATLAB's ode45, whose steps are the same where an erratum has no effect.
    """
    columns = {name: _bent_columns(run) for name, run in scene.runs.items()}
    for first, second in itertools.combinations(scene.runs, 2):
        if first.endswith("/ode45") and second.endswith("/ode45"):
            continue
        for place in sorted(columns[first].keys() & columns[second].keys()):
            if columns[first][place] == columns[second][place]:
                yield scene.runs[second], first, f"{place[0]} {place[1]}"


def _bent_columns(run: StoredRun) -> dict[tuple[str, int], bytes]:
    columns = {}
    for name in ("angles", "rates"):
        values = run.array(name) if name in run else np.empty((0, 0))
        if values.ndim == 2 and values.dtype.kind == "f" and len(values) >= _FEWEST:
            for i, column in enumerate(values.T):
                if np.abs(np.diff(column, 2)).max() > _STRAIGHT * np.abs(column).max():
                    columns[name, i] = column.tobytes()
    return columns


def settings_faults(run: StoredRun) -> list[str]:
    """What is wrong with the stored settings: each of the method's must be there, none else, each within its range."""
    method = look_up(run.method)
    if method is None:
        return []
    stored = run.settings
    faults = [f"{name} is missing" for name in method.defaults if name not in stored]
    try:
        method.settings.of(method.name, stored)
    except InputError as exc:
        faults += exc.problems
    return faults


def steps_off(scene: Scene, run: StoredRun, name: str) -> tuple[float, str] | None:
    """(relative, text) how far the number of steps is from what settings and duration make it; None where not known.

    A fixed step is shortened to fit the interval between samples. Of an adaptive method the number is known where the
    scene's is on file, for the settings on file; `name` is that of the shipped scene, "" for any other.
    """
    method, steps = look_up(run.method), run.attributes.get("steps")
    if method is None or steps is None or len(run.array("time")) < scene.samples:
        return None
    if method.fixed_step and "step" in run.settings:
        interval = scene.duration / (scene.samples - 1)
        expected = (scene.samples - 1) * math.ceil(interval / float(run.settings["step"]) - 1e-9)
    else:
        known = expected_settings().get(run.method)
        if known is None or name not in known["steps"] or not same_settings(run.settings, known["settings"]):
            return None
        expected = known["steps"][name]
    return abs(float(steps) / expected - 1.0), f"{steps} steps, {expected} by settings and duration"


def same_settings(settings: Mapping[str, object], expected: Mapping[str, object]) -> bool:
    """Compare settings; one that is not there is None, which TOML has no word for."""
    return all(settings.get(name) == expected.get(name) for name in {**settings, **expected})
