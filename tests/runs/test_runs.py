"""Runs into a results file: what is stored stays, what was lost is tried again, and nothing but
what was asked for."""

from __future__ import annotations

import json
import resource
from collections.abc import Sequence
from pathlib import Path
from unittest.mock import patch

import h5py
import numpy as np
import pytest
from support.commands import rotor_mbs
from support.scenes import paper
from support.stored import Made, damage, rotor, store

import rotor_mbs as rm
from rotor_mbs.analysis.text_tables import run_row
from rotor_mbs.errors import StoreError
from rotor_mbs.methods.catalogue import find_method
from rotor_mbs.methods.time_limit import OutOfTimeError
from rotor_mbs.models.lagrange.defects import interval_defects
from rotor_mbs.processes.pool import SerialPool
from rotor_mbs.runs.read import open_results
from rotor_mbs.runs.rows import Rows
from rotor_mbs.runs.runner import RunOutcome
from rotor_mbs.runs.table import TableFile
from rotor_mbs.runs.versions import code_digest, row_versions
from rotor_mbs.scenario.catalogue import find_scenes
from rotor_mbs.studies.run import RunTask, run_scenes

SCENE = paper("fig08")
METHODS = ("lagrange/dop853", "exudyn_tree/rk67", "lagrange/ode45")
REFERENCE, FIRST = f"{SCENE.name}/reference", f"{SCENE.name}/{METHODS[0]}"


def blank(task: RunTask) -> Rows:
    """A row without samples in place of a run."""
    return task.failed("ok", task.request.method)


def run(path: Path, methods: Sequence[str] = METHODS, **options: object) -> list[RunOutcome]:
    given = {"workers": 0, "timeout_s": 60.0, "perform": blank, **options}
    with patch.object(RunTask, "perform", given.pop("perform")):
        return run_scenes([SCENE], {SCENE.name: methods}, path, **given)  # type: ignore[arg-type]


def made(outcomes: Sequence[RunOutcome]) -> list[str]:
    return [run.method for run in outcomes if run.is_computed and run.is_stored]


def stored(path: Path) -> list[str]:
    file = TableFile(path)
    return [label for label in list(file.tables["runs"].runs) if file.place(label).is_stored]


# What a file has


def test_only_what_was_asked_for_is_stored(tmp_path: Path) -> None:
    scene = find_scenes(["check/held"])[0].replace(outputs=["tip"])
    run_scenes([scene], {scene.name: METHODS[:1]}, tmp_path / "r.h5", workers=0, timeout_s=60.0)
    with open_results(tmp_path / "r.h5") as results:
        by_dop853, exact = (
            results.scenes[scene.name].runs[name] for name in (METHODS[0], "reference")
        )
        assert set(by_dop853.names) == {"time", "blade", "axis", "coordinate", "tip"}
        # which other runs are judged by
        assert {"angles", "rates", "error_growth"} <= set(exact.names)
    with h5py.File(tmp_path / "r.h5") as file:
        assert "kinetic_energy" not in file[scene.name]


def test_names_and_units_keep_the_contract(results: Path) -> None:
    with h5py.File(results) as file:
        assert file.attrs["format"] == "rotor_mbs"
        assert file.attrs["format_version"] == 3
        assert file.attrs["Conventions"].startswith("CF-")
        scene, runs = file["paper/fig11"], file["runs"]
        units = {
            "angles": "rad",
            "rates": "rad/s",
            "tip": "m",
            "kinetic_energy": "J",
            "work": "J",
            "time": "s",
        }
        assert {name: scene[name].attrs["units"] for name in units} == units
        assert {"title", "figures", "blades", "scene_toml", "scene_hash"} <= set(scene.attrs)
        columns = (
            "scene method_name status message settings samples time_reached time_limit_s steps "
            "rhs_evaluations setup_time_s run_time_s run_time_min_s repeats angle_error_max "
            "energy_drift_max horizon_s rotor_angle_max engine_success engine_message versions "
            "crc32"
        )
        assert set(columns.split()) <= set(runs)
        of_scene = runs["scene"].asstr()[()] == "paper/fig11"
        # in the table of the scene, too, so that one group is enough
        for name in ("status", "samples"):
            np.testing.assert_array_equal(scene[name][()], runs[name][of_scene])


def test_a_row_that_is_taken_back_is_missing_in_both_tables(tmp_path: Path) -> None:
    path = tmp_path / "r.h5"
    run(path, perform=RunTask.perform)
    TableFile(path).place(FIRST).mark_missing([0])
    with h5py.File(path) as file:
        table = file[SCENE.name]
        assert table["run"].asstr()[table["status"][()] == -1].tolist() == [METHODS[0]]
        assert file["runs/run"].asstr()[file["runs/status"][()] == -1].tolist() == [FIRST]
    run(path, perform=RunTask.perform)
    with h5py.File(path) as file:
        assert (file[f"{SCENE.name}/status"][()] == 0).all()


# What a call computes


def test_references_come_first_and_what_is_stored_is_skipped(tmp_path: Path) -> None:
    path = tmp_path / "r.h5"
    first = run(path, METHODS[:2])
    assert made(first)[0] == "reference"
    assert sorted(made(first)) == sorted(["reference", *METHODS[:2]])
    assert first[-1].share == 1.0
    assert made(run(path)) == [METHODS[2]]
    before = path.read_bytes()
    again = run(path)
    assert [outcome.is_computed for outcome in again] == [False] * 4
    assert path.read_bytes() == before
    assert [entry.name for entry in tmp_path.iterdir()] == ["r.h5"]


def without_memory(task: RunTask) -> Rows:
    if task.request.method == "reference":
        raise MemoryError("no room")
    return blank(task)


def test_runs_whose_reference_was_not_computed_are_not_computed(tmp_path: Path) -> None:
    outcomes = run(tmp_path / "r.h5", perform=without_memory)
    assert not any(outcome.is_stored for outcome in outcomes)
    assert [outcome.status for outcome in outcomes] == [
        "worker_died",
        *["no_reference"] * 3,
    ]
    assert stored(tmp_path / "r.h5") == []
    assert len(made(run(tmp_path / "r.h5"))) == 4


def test_an_interrupted_call_goes_on_where_it_stopped(tmp_path: Path) -> None:
    def interrupt(done: int, total: int, _outcome: RunOutcome) -> None:
        assert total == 4
        if done == 2:
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        run(tmp_path / "r.h5", on_progress=interrupt)
    kept = stored(tmp_path / "r.h5")
    assert len(kept) in (2, 3)  # one more may have ended
    assert len(made(run(tmp_path / "r.h5"))) == 4 - len(kept)


class Remote(SerialPool):
    """Workers that do not see the file: what they return is written by this process."""

    shares_disk = False


def test_workers_that_do_not_share_the_disk_store_the_same(tmp_path: Path) -> None:
    run(tmp_path / "remote.h5", workers=Remote())
    run(tmp_path / "local.h5")
    for label in stored(tmp_path / "local.h5"):
        rows = [
            TableFile(tmp_path / name).place(label).read() for name in ("remote.h5", "local.h5")
        ]
        assert all(rows[0][name].tobytes() == rows[1][name].tobytes() for name in rows[0])
    assert len(stored(tmp_path / "remote.h5")) == 4


@pytest.mark.parametrize("column", ["angles", "status"])
def test_a_damaged_row_is_computed_again_by_the_same_command(tmp_path: Path, column: str) -> None:
    """Of a reference, with all runs that were judged by it."""
    path = tmp_path / "r.h5"
    run(path)
    before = path.read_bytes()
    damage(path, FIRST, column)
    assert made(run(path)) == [METHODS[0]]
    assert path.read_bytes() == before
    damage(path, REFERENCE, column)
    assert sorted(made(run(path))) == sorted(["reference", *METHODS])


def test_a_run_that_a_shorter_limit_ended_is_computed_again(tmp_path: Path) -> None:
    def slow(task: RunTask) -> Rows:
        return (
            task.failed("timed_out", "too slow")
            if task.request.method == METHODS[0]
            else blank(task)
        )

    run(tmp_path / "r.h5", perform=slow, timeout_s=5.0)
    with open_results(tmp_path / "r.h5") as results:
        # nobody knows how long it took
        assert run_row(results.scenes[SCENE.name].runs[METHODS[0]])[-1] == ""
    again = run(tmp_path / "r.h5", perform=slow, timeout_s=5.0)
    assert made(again) == []
    failed = [run for run in again if run.has_failed]
    assert [(run.label, run.status, run.message) for run in failed] == [
        (f"{SCENE.name} {METHODS[0]}", "timed_out", "too slow")
    ]
    assert made(run(tmp_path / "r.h5", timeout_s=4.0)) == []
    assert made(run(tmp_path / "r.h5", timeout_s=6.0)) == [METHODS[0]]


def test_the_time_reached_is_that_of_the_last_sample(tmp_path: Path) -> None:
    """As the message has it, whatever the engine says: of a reference, the slower of its two runs
    has the last one."""
    path = store(tmp_path / "r.h5", [Made(SCENE, "reference", rotor(np.sin), until=0.5)])
    with open_results(path) as results:
        run = results.scenes[SCENE.name].runs["reference"]
        assert run.attributes["time_reached"] == run.array("time")[-1] > 0.0


def test_a_shipped_reference_that_was_not_read_in_time_is_read_again(tmp_path: Path) -> None:
    """But not one that ends early itself: it has no limit."""

    def slow(task: RunTask) -> Rows:
        return (
            task.failed("timed_out", "too slow")
            if task.request.method == "reference"
            else blank(task)
        )

    def short(task: RunTask) -> Rows:
        return {**slow(task), "time_limit_s": np.array([np.nan])}

    run(tmp_path / "r.h5", METHODS[:1], perform=slow, timeout_s=5.0)
    assert made(run(tmp_path / "r.h5", METHODS[:1], timeout_s=4.0)) == []
    assert made(run(tmp_path / "r.h5", METHODS[:1], perform=short, timeout_s=6.0)) == [
        "reference",
        METHODS[0],
    ]
    assert made(run(tmp_path / "r.h5", METHODS[:1], timeout_s=7.0)) == []


def test_a_shipped_reference_that_was_not_judged_in_time_is_judged_again(tmp_path: Path) -> None:
    scene, path = find_scenes(["paper/fig08"])[0], tmp_path / "r.h5"

    def references(timeout_s: float) -> list[tuple[str, str]]:
        ended = run_scenes([scene], {scene.name: ()}, path, workers=0, timeout_s=timeout_s)
        return [(run.method, run.status) for run in ended if run.is_computed]

    with patch("rotor_mbs.studies.run.judge", side_effect=OutOfTimeError("over the time limit")):
        assert references(5.0) == [("reference", "timed_out")]
    assert references(4.0) == []
    assert references(6.0) == [("reference", "ok")]


# Versions


def test_a_row_says_what_computed_it(results: Path) -> None:
    with open_results(results) as file:
        versions = json.loads(file.scenes["paper/fig11"].runs["exudyn_tree/rk67"].known["versions"])
    assert versions == row_versions(find_method("exudyn_tree/rk67"))
    assert {"rotor_mbs", "python", "numpy", "exudyn", "code"} <= set(versions)
    assert "heyoka" not in versions  # which this method does not use


@pytest.mark.parametrize(
    ("text", "is_other"),
    [
        ("STEP = 0.2\n", True),
        ('"""What it is.\n\nAnd more."""\n\n\nSTEP = 0.1\n', False),
        ('STEP = 0.1\nNAME = "# no comment"\n', True),
    ],
)
def test_a_plug_in_whose_code_is_corrected_is_run_again(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, text: str, is_other: bool
) -> None:
    """Under the same version; a comment or a docstring changes nothing."""
    source = tmp_path / "plug_in.py"
    source.write_text("STEP = 0.1\n")
    monkeypatch.setitem(find_method(METHODS[0]).__dict__, "sources", (source,))
    code_digest.cache_clear()
    run(tmp_path / "r.h5")
    source.write_text(text)
    code_digest.cache_clear()
    assert made(run(tmp_path / "r.h5")) == [METHODS[0]] * is_other


# A disk that is full


def test_a_full_disk_is_one_line_and_what_was_stored_stays(tmp_path: Path) -> None:
    """A limit on the size of files stops one from growing, as a full disk does."""
    path = tmp_path / "r.h5"
    run(path, METHODS[:1])
    before = path.read_bytes()
    limits = resource.getrlimit(resource.RLIMIT_FSIZE)
    resource.setrlimit(resource.RLIMIT_FSIZE, (len(before), limits[1]))
    try:
        with pytest.raises(StoreError, match="cannot be written: File too large"):
            run(path)
        ended = rotor_mbs(
            "run", "paper/fig08", "-m", METHODS[0], "-m", METHODS[1], "-o", path, "-j", "1"
        )
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, limits)
    assert ended.status != 0
    assert ended.err.count("\n") == 1
    assert path.read_bytes() == before
    assert [entry.name for entry in tmp_path.iterdir()] == ["r.h5"]


def test_the_defect_of_every_interval_is_stored_with_its_run(results: Path) -> None:
    """At the end of the interval, and as a quantity of a `Run`; the largest is the metric of that
    name."""
    with open_results(results) as opened:
        for scene in opened.scenes.values():
            for stored in scene.runs.values():
                sizes = stored.array("defect")
                samples = (stored.array(name) for name in ("time", "angles", "rates"))
                assert np.isnan(sizes[0])
                assert (
                    sizes[1:].tobytes() == interval_defects(scene.scene, *samples).sizes.tobytes()
                )
    short = SCENE.replace(duration=0.1, samples=11)
    computed = rm.run(short, "lagrange/dop853")
    assert computed.defect[1:].max() == computed.metrics["defect_max"]
    assert computed.to_xarray().defect.attrs["units"] == "rad"
    assert "defect" not in rm.run(short.replace(outputs=["angles"]), "lagrange/dop853").quantities
