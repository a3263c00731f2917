"""How cost grows: run time against the number of blades and against the duration, per method, at one setting each.

The sizes of a study are the rungs of its curves: they are timed like a bench, and expensive
sizes are left out likewise.
"""

from __future__ import annotations

import time
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import replace
from itertools import chain
from pathlib import Path
from typing import Any

import numpy as np

from rotor_mbs.analysis.work_precision import cost_exponent
from rotor_mbs.methods.catalogue import methods as all_methods
from rotor_mbs.runs.case import Case
from rotor_mbs.runs.layout import KEY_ATTRIBUTE
from rotor_mbs.runs.records import COST_SCALING, Record
from rotor_mbs.runs.results_file import ResultsStore
from rotor_mbs.runs.runner import Job, OnProgress, Outcome, Result, execute, ignore_progress
from rotor_mbs.scenario.catalogue import find_scenes
from rotor_mbs.scenario.scene import Scene
from rotor_mbs.solution.status import code_of
from rotor_mbs.studies.bench import BENCH, SOURCES, arrays_of, measure_points, store_curve
from rotor_mbs.studies.bench_worker import Point

_BLADES = (1, 2, 3, 6, 12, 24, 48, 96)
_DURATIONS = (1.0, 10.0, 60.0, 600.0, 3600.0)  # s
# An hour of simulated time, or 96 blades, costs what several scenes do.
_BUDGETS = 3.0


def cost_studies() -> dict[str, tuple[Scene, dict[float, Scene]]]:
    """By what grows, the scene that is varied, and the scenes by size.

    Blades: like the paper's Fig. 8, every blade pitched a little, for the second in which no error has grown much.
    Duration: one blade with its pitch at rest, a plain pendulum, whose motion stays regular (Fig. 3).
    """
    many, one = find_scenes(["paper/fig08"])[0], find_scenes(["paper/fig03"])[0]
    by_duration = {t: replace(one, duration=t, samples=round(10 * t) + 1) for t in _DURATIONS}
    return {"blades": (many, {float(n): with_blades(many, n) for n in _BLADES}), "duration": (one, by_duration)}


def with_blades(scene: Scene, count: int) -> Scene:
    """The scene with so many blades like its first, each at a pitch of its own, for one second."""
    pitches = tuple(0.1 + 0.2 * np.sin(1.0 + i) for i in range(count))
    return replace(
        scene,
        duration=1.0,
        samples=11,
        blades=scene.blades[:1] * count,
        initial_angles=(0.0, *(float(pitch) for pitch in pitches)),
        initial_rates=(0.0,) * (1 + count),
        bearing_stiffness=(),
        bearing_damping=(),
        text="",
    )


def run_cost_scaling(
    methods: Sequence[str],
    output: Path,
    *,
    repeats: int,
    budget_s: float,
    on_progress: OnProgress = ignore_progress,
) -> list[Outcome]:
    """A curve per method and study into the results file: run times, and energy drift as the measure of error.

    methods     of those that declare settings for this study; all of them where none is named
    budget_s    s, of a scene of a bench; a study takes three times that
    """
    options = {"repeats": repeats, "budget_s": _BUDGETS * budget_s}
    chosen = [m for m in all_methods() if m.cost_scaling is not None and (not methods or m.name in methods)]
    cases = [
        Case(
            base, method.name, method.cost_scaling or {}, f"cost with {kind}",
            {**options, "kind": kind, "sizes": list(scenes)}, sources=(*SOURCES, "studies/cost_scaling.py"),
        )
        for kind, (base, scenes) in cost_studies().items()
        for method in chosen
    ]  # fmt: skip
    return execute(cases, _time_by_study, ResultsStore(output), on_progress)


def _time_by_study(waves: Iterable[Sequence[Job]]) -> Iterator[tuple[Job, Result]]:
    jobs = list(chain.from_iterable(waves))
    for kind, (_, scenes) in cost_studies().items():
        points = {job: _points(job.case, scenes) for job in jobs if job.case.options["kind"] == kind}
        scene_of = {point: (scenes[point.setting], None) for curve in points.values() for point in curve}
        if points:
            measured = measure_points(scene_of, list(points.values()), jobs[0].case.options)
            started = time.strftime("%Y-%m-%dT%H:%M:%S")
            for job, own in points.items():
                yield job, measured.lost(own) or store_curve(job, _curve(scenes, job.case, started, measured.rows(own)))


def _points(case: Case, sizes: Iterable[float]) -> list[Point]:
    return [Point(case.method, case.method, size, tuple(sorted(case.settings.items()))) for size in sizes]


def _curve(scenes: Mapping[float, Scene], case: Case, started: str, rows: Sequence[Mapping[str, Any]]) -> Record:
    arrays, kind = arrays_of(rows), case.options["kind"]
    arrays["simulated_s"] = np.array([scenes[size].duration for size in arrays["setting"]])
    attributes: dict[str, Any] = {
        "method": case.method,
        "setting_kind": kind,
        "settings": str(dict(case.settings)),
        "messages": [str(row["message"]) for row in rows],
        "started": started,
        "scene_hash": case.scene_hash,
        KEY_ATTRIBUTE: case.key,
    }
    ok = arrays["status"] == code_of("ok")
    rate = arrays["run_time_s"] / arrays["simulated_s"]
    if (exponent := cost_exponent(arrays["setting"][ok], rate[ok])) is not None:
        attributes["exponent"] = exponent
    return Record(BENCH, f"{COST_SCALING}/{kind}", case.method, attributes, arrays)
