"""A point of a bench whose worker process is killed: asked again of a new one; twice, and its curve is not stored."""

from __future__ import annotations

import os
import signal
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest
from support.scenes import paper

from rotor_mbs.methods.catalogue import ladders
from rotor_mbs.runs.results import extend_file
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
    if (key := f"{point.curve.rpartition(' ')[2]}:{task}") in left:
        left.remove(key)
        kills.write_text(" ".join(left))
        os.kill(os.getpid(), signal.SIGKILL)
    return ask(request)


@pytest.mark.full
def test_a_point_whose_process_dies_is_tried_again_and_after_that_not_stored(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    kills = tmp_path / "kills"
    kills.write_text("once:prepare twice:judge twice:judge")
    monkeypatch.setenv(KILLS, str(kills))
    monkeypatch.setattr(bench, "ask", ask_dying)
    (ladder,) = ladders(["lagrange/ode45"])
    short = replace(ladder, values=(1e-3,))
    curves = [bench.Curve(SCENE, replace(short, variant=f" {name}"), {}) for name in ("once", "twice", "never")]
    points = [bench.points_of(curve.ladder, 0.05) for curve in curves]
    measured = bench.measure_points({own[0]: (SCENE, None) for own in points}, points, 2, 60.0)
    assert kills.read_text() == ""
    file = extend_file(tmp_path / "b.h5", [bench.bench_table(curves)])
    for curve, own in zip(curves, points, strict=True):
        lost = measured.lost(own)
        if curve.ladder.variant == " twice":
            assert lost.endswith("and again when it was tried alone")
        else:
            assert not lost
            outcome = bench.store_curve(file, curve, measured.rows(own), {})
            assert (outcome.status, outcome.message) == ("ok", "1 points, 0 failed, 0 left out")
    assert [bench.is_measured(file, curve) for curve in curves] == [True, False, True]
