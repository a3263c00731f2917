"""The tables at the end of commands: what stands in them is what is stored."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
from support.stored import Made, rotor, store

from rotor_mbs.analysis.run_tables import bench_table, method_table, run_table
from rotor_mbs.runs.read import open_results
from rotor_mbs.runs.records import Record
from rotor_mbs.scenario.catalogue import find_scenes

SCENE = find_scenes(["paper/fig05"])[0]
GOOD, BAD = "lagrange/dop853", "exudyn_tree/rk67"


def stored(tmp_path: Path, *, scenes: int = 1) -> Path:
    runs = []
    for i in range(scenes):
        scene = replace(SCENE, name=f"paper/s{i}")
        runs += [Made(scene, "reference", rotor(np.sin), versions={"frozen_with": "1.0"})]
        runs += [Made(scene, GOOD, rotor(lambda t: np.sin(t) + 1e-9), attributes={"defect_max": 3e-12})]
        runs += [Made(scene, BAD, rotor(lambda t: np.sin(t) + 0.25), attributes={"status": "inaccurate"})]
    return store(tmp_path / "r.h5", runs)


def test_a_row_for_each_run_with_its_status_error_drift_and_time(tmp_path: Path) -> None:
    with open_results(stored(tmp_path)) as results:
        table = run_table(results.scenes, {"paper/s0": [GOOD, BAD], "not there": [GOOD]})
    assert table.rows == [
        ("paper/s0", "reference", "ok", "", "", "0.0e+00", "read"),  # shipped, and no error against itself
        ("paper/s0", GOOD, "ok", "3.0e-12", "1.0e-09", "0.0e+00", "0.002"),
        ("paper/s0", BAD, "inaccurate", "", "2.5e-01", "0.0e+00", "0.002"),
    ]


def test_many_runs_are_a_row_for_each_method_with_the_largest_of_those_that_are_ok(tmp_path: Path) -> None:
    with open_results(stored(tmp_path, scenes=14)) as results:
        table = run_table(results.scenes, {name: [GOOD, BAD] for name in results.scenes})
        runs = [run for scene in results.scenes.values() for run in scene.methods.values()]
        assert method_table(runs).rows == table.rows
    assert table.rows == [
        (GOOD, "14 of 14 ok", "3.0e-12", "1.0e-09", "0.0e+00", "0.002"),
        (BAD, "0 of 14 ok", "", "", "", "0.002"),
    ]


def test_a_bench_curve_has_its_smallest_error_and_the_times_to_given_ones() -> None:
    arrays = {
        "angle_error_max": np.array([1e-2, 1e-4, np.nan]),
        "run_time_s": np.array([1.0, 10.0, 20.0]),
        "status": np.array([0, 0, 2]),
    }
    (row,) = bench_table([Record("bench", "paper/fig05", GOOD, arrays=arrays)]).rows
    assert row[:4] == ("paper/fig05", GOOD, "2 of 3", "1.0e-04")
    assert float(row[4]) == np.round(10**0.5, 2)  # halfway between the two, in logarithms
    assert row[5:] == ("", "")
