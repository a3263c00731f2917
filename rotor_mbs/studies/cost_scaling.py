"""How cost grows: run time against the number of blades and against the duration, per method, at one setting each.

The sizes of a study are the rungs of its ladders: they are timed like a bench, and dear sizes are left out likewise.
"""

from __future__ import annotations

import time
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from rotor_mbs.analysis.work_precision import growth_exponent
from rotor_mbs.execution.servant import Servant, last_core
from rotor_mbs.methods import catalogue
from rotor_mbs.scenario.catalogue import find_scenes
from rotor_mbs.scenario.scene import Scene
from rotor_mbs.solution.record import Trajectory
from rotor_mbs.solution.status import STATUSES
from rotor_mbs.store.records import COST_SCALING, Record
from rotor_mbs.studies.bench_points import Findings, judge_all, rows, time_points
from rotor_mbs.studies.bench_work import Point, TimingProcess, only_time

BLADES = (1, 2, 3, 6, 12, 24, 48)
DURATIONS = (1.0, 10.0, 60.0, 600.0, 3600.0)


@dataclass(frozen=True)
class Study:
    """kind: what grows; scenes: by size."""

    kind: str
    scenes: Mapping[float, Scene]


def studies() -> tuple[Study, Study]:
    """Blades: like the paper's Fig. 8, every blade pitched a little, for the second in which no error has grown much.
    Duration: one blade with its pitch at rest, a plain pendulum, which is regular for ever (Fig. 3)."""
    many = find_scenes(["paper/fig08"])[0]
    one = find_scenes(["paper/fig03"])[0]
    return (
        Study("blades", {float(n): _with_blades(many, n) for n in BLADES}),
        Study("duration", {t: replace(one, duration=t, samples=round(10 * t) + 1) for t in DURATIONS}),
    )


def _with_blades(scene: Scene, count: int) -> Scene:
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


@dataclass(frozen=True)
class _MakeProcess:
    """Makes the timing process of a study."""

    study: Study
    methods: tuple[str, ...]

    def __call__(self) -> TimingProcess:
        only_time(self.methods)
        return TimingProcess(self._scene_of)

    def _scene_of(self, point: Point) -> tuple[Scene, Trajectory | None]:
        return self.study.scenes[point.setting], None


def measure_growth(study: Study, methods: Sequence[str], repeats: int, budget_s: float) -> list[Record]:
    """A curve per method over the sizes: run times, and energy drift as its measure of error."""
    chosen = {
        method.name: method.cost_scaling
        for method in catalogue.methods()
        if method.cost_scaling is not None and (not methods or method.name in methods)
    }
    points = [
        [Point(name, name, i, size, tuple(sorted(settings.items()))) for i, size in enumerate(study.scenes)]
        for name, settings in chosen.items()
    ]
    found = Findings()
    with Servant(_MakeProcess(study, tuple(chosen)), last_core()) as servant:
        timings = time_points(servant, points, repeats, budget_s, found)
        judge_all(servant, timings, found, budget_s)
    started = time.strftime("%Y-%m-%dT%H:%M:%S")
    return [
        _curve(study, name, settings, rows(of_method, timings, found), started)
        for (name, settings), of_method in zip(chosen.items(), points, strict=True)
    ]


def _curve(
    study: Study, name: str, settings: Mapping[str, object], found: Sequence[Mapping[str, Any]], started: str
) -> Record:
    arrays = {key: np.array([row[key] for row in found]) for key in found[0] if key != "message"}
    arrays["simulated_s"] = np.array([study.scenes[size].duration for size in arrays["setting"]])
    attributes: dict[str, Any] = {
        "method": name,
        "setting_kind": study.kind,
        "settings": str(dict(settings)),
        "messages": [str(row["message"]) for row in found],
        "started": started,
    }
    ok = arrays["status"] == STATUSES.index("ok")
    rate = arrays["run_time_s"] / arrays["simulated_s"]
    if (exponent := growth_exponent(arrays["setting"][ok], rate[ok])) is not None:
        attributes["exponent"] = exponent
    return Record("bench", f"{COST_SCALING}/{study.kind}", name, attributes, arrays)
