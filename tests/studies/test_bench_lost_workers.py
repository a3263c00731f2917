"""A point of a bench whose worker process is killed: asked again of a new one; twice, and its curve is not stored."""

from __future__ import annotations

import os
import signal
from pathlib import Path
from typing import Any

import pytest
from rotor_mbs.runs.case import Case
from support.scenes import paper

from rotor_mbs.runs.records import Record
from rotor_mbs.runs.runner import Job
from rotor_mbs.studies import bench
from rotor_mbs.studies.bench_worker import Point, ask

# Of the environment: the file that says which tasks of which curve kill the process, each once.
KILLS = "rotor_mbs_kills"
SCENE = paper("fig05", duration=0.1, samples=3)


def ask_dying(request: tuple[str, Point]) -> Any:
    """As the timing worker answers."""
    task, point = request
    kills = Path(os.environ[KILLS])
    left = kills.read_text().split()
    if (key := f"{point.curve}:{task}") in left:
        left.remove(key)
        kills.write_text(" ".join(left))
        os.kill(os.getpid(), signal.SIGKILL)
    return ask(request)


def point(curve: str) -> Point:
    return Point(curve, "lagrange/ode45", 1e-3, (("absolute_tolerance", 1e-3), ("relative_tolerance", 1e-3)))


def _record(rows: list[dict[str, Any]]) -> Record:
    return Record("bench", "s", "c", {"setting_kind": "tolerance", "messages": [""]}, bench.arrays_of(rows))


def test_a_point_whose_process_dies_is_tried_again_and_after_that_not_stored(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    kills = tmp_path / "kills"
    kills.write_text("once:prepare twice:judge twice:judge")
    monkeypatch.setenv(KILLS, str(kills))
    monkeypatch.setattr(bench, "ask", ask_dying)
    curves = {name: [point(name)] for name in ("once", "twice", "never")}
    scenes = {points[0]: (SCENE, None) for points in curves.values()}
    found = bench.measure_points(scenes, list(curves.values()), {"budget_s": 60.0, "repeats": 2})
    assert kills.read_text() == ""
    for name, points in curves.items():
        job = Job(Case(SCENE, points[0].method), tmp_path / f"{name}.h5")
        result = found.lost(points) or bench.store_curve(job, _record(found.rows(points)))
        if name == "twice":
            assert result.status == "worker_died"
            assert result.message.endswith("and again when it was tried alone")
        else:
            assert (result.status, result.message) == ("ok", "1 points, 0 failed, 0 left out")
        assert job.part.exists() == (result.status == "ok")
