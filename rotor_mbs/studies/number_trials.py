"""The paper's numbers by the printed equations for other durations, tolerances and ways of writing the row of (56)."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace

from rotor_mbs.analysis.number_trials import Conditions, GravityRowText, NumberTrial, NumberTrials, trial
from rotor_mbs.analysis.published import Published, published
from rotor_mbs.analysis.run_selection import PRINTED
from rotor_mbs.analysis.trajectory_numbers import measure
from rotor_mbs.errors import RotorError
from rotor_mbs.execution.pool import run_tasks
from rotor_mbs.methods.catalogue import find_method
from rotor_mbs.methods.solve import solve
from rotor_mbs.models.printed.gravity_rows import DEFAULT_ROW, GRAVITY_ROWS
from rotor_mbs.scenario.catalogue import find_scenes
from rotor_mbs.scenario.scene import Scene

DURATIONS = (8.0, 9.0, 10.0, 11.0, 12.0, 13.0)  # s
TOLERANCES = ((1e-5, 1e-9), (1e-6, 1e-8), (1e-6, 1e-9), (1e-6, 1e-10), (1e-7, 1e-9), (1e-8, 1e-9))
_AT_REST = "paper/fig05"
_TIMEOUT_S = 600.0


@dataclass(frozen=True)
class Trial:
    """A scene under conditions, for the numbers that are read off it."""

    scene: Scene
    conditions: Conditions
    items: tuple[Published, ...]
    remainder: float


def number_trials(
    rows: Sequence[str] = tuple(GRAVITY_ROWS),
    durations: Sequence[float] = DURATIONS,
    tolerances: Sequence[tuple[float, float]] = TOLERANCES,
    *,
    workers: int = 0,
) -> NumberTrials:
    """All published numbers for every row and duration, and for every pair of tolerances with the usual ones.

    Parameters
    ----------
    rows
        Ways of writing the first row of (56), names of `gravity_rows.GRAVITY_ROWS`.
    durations
        s, of all runs.
    tolerances
        (relative, absolute) of ode45, tried for the usual row and the duration of Fig. 5.
    workers
        Parallel processes; 0 for none.
    """
    items = [item for item in published() if item.of is not None]
    scenes = {scene.name: scene for scene in find_scenes(sorted({name for item in items for name in item.scenes}))}
    defaults = find_method(PRINTED).defaults
    usual = Conditions(
        DEFAULT_ROW,
        scenes[_AT_REST].duration,
        float(str(defaults["relative_tolerance"])),
        float(str(defaults["absolute_tolerance"])),
    )
    tried = [replace(usual, gravity_row=row, duration=duration) for row in rows for duration in durations]
    tried += [replace(usual, relative_tolerance=pair[0], absolute_tolerance=pair[1]) for pair in tolerances]
    remainders = {row: _remainder(scenes[_AT_REST], row) for row in rows}
    tasks = [
        Trial(scene, one, tuple(item for item in items if name in item.scenes), remainders[one.gravity_row])
        for one in dict.fromkeys(tried)
        for name, scene in scenes.items()
    ]
    found: dict[tuple[Conditions, str], NumberTrial] = {}
    for task, numbers in _results(tasks, workers):
        found |= {(task.conditions, one.number): one for one in numbers}
    in_order = (found[conditions, item.id] for conditions in dict.fromkeys(tried) for item in items)
    texts = (GravityRowText(row, GRAVITY_ROWS[row].formula, GRAVITY_ROWS[row].is_of_56) for row in rows)
    return NumberTrials(tuple(in_order), usual, tuple(texts))


def perform(task: Trial) -> list[NumberTrial]:
    """The numbers of one run."""
    settings = {
        "gravity_row": task.conditions.gravity_row,
        "relative_tolerance": task.conditions.relative_tolerance,
        "absolute_tolerance": task.conditions.absolute_tolerance,
    }
    run = solve(PRINTED, replace(task.scene, duration=task.conditions.duration), settings).trajectory
    return [
        trial(item, task.conditions, measure(run, item.of), task.remainder)
        for item in task.items
        if item.of is not None
    ]


def _results(tasks: Sequence[Trial], workers: int) -> Iterator[tuple[Trial, list[NumberTrial]]]:
    if not workers:
        yield from ((task, perform(task)) for task in tasks)
        return
    for finished in run_tasks(perform, tasks, workers, _TIMEOUT_S):
        if finished.value is None:
            raise finished.error or RotorError(f"{finished.task.scene.name}: {finished.message}")
        yield finished.task, finished.value


def _remainder(scene: Scene, row: str) -> float:
    """N m, of the row at the start of the scene."""
    mass, (c, _, d) = scene.blades[0].mass, scene.blades[0].centre_of_mass
    cosines = [math.cos(angle) for angle in scene.initial_angles[1:]]
    return GRAVITY_ROWS[row].moment(mass, c, d, scene.gravity, scene.initial_angles[0], *cosines)
