"""The suite itself: a killed worker, a hung run, the map and its pages; scenes that say what they
stress."""

from __future__ import annotations

import re
from dataclasses import replace
from pathlib import Path

import pytest
from support.commands import rotor_mbs

from rotor_mbs.report.build import write_report
from rotor_mbs.report.pages.stability import ranking
from rotor_mbs.runs.read import read_records
from rotor_mbs.scenario.catalogue import find_scenes
from rotor_mbs.solution.status import STATUSES
from rotor_mbs.studies.run import run_scenes
from rotor_mbs.studies.stability import (
    OUTCOMES,
    STEPS,
    SuiteRun,
    complete_ladders,
    suite_runs,
    suite_table,
)

SCENES = ("stiff/bearing-1e8-damping-100", "extreme/light-1e-8", "extreme/rate-1e200")


@pytest.mark.full
def test_no_run_of_ours_claims_success_and_the_pages_have_every_outcome(tmp_path: Path) -> None:
    pytest.importorskip("heyoka")
    ended = rotor_mbs("stability", *SCENES, "-o", tmp_path / "stability.h5", "--timeout", "1")
    assert ended.status == 0, ended.err
    found = suite_runs(tmp_path / "stability.h5")
    assert {cell.scene for cell in found} == set(SCENES)
    ours = [cell for cell in found if cell.method.startswith("lagrange")]
    assert not [cell for cell in ours if cell.false_success]
    # Exudyn's explicit methods on the overdamped bearing
    assert [cell for cell in found if cell.false_success]
    assert not [
        cell for cell in found if cell.status == "ok" and cell.scene == "extreme/rate-1e200"
    ]
    # A fault of this package would be stored as a run that failed, with the exception's name before
    # its text.
    assert not [cell for cell in found if re.match(r"\w+Error: ", cell.message)]

    folder = tmp_path / "stability-report"
    page = (folder / "index.html").read_text(encoding="utf-8")
    for symbol, words in {OUTCOMES[cell.outcome] for cell in found}:
        assert words in page
        assert symbol in page
    for scene in SCENES:
        assert "# Stresses" in (folder / (scene.replace("/", "-") + ".html")).read_text(
            encoding="utf-8"
        )
    assert [row[0] for row in suite_table(found).rows] == list(
        dict.fromkeys(cell.method for cell in found)
    )


@pytest.mark.nightly
def test_a_run_of_which_only_the_energy_is_known_is_unchecked(tmp_path: Path) -> None:
    """A needle sampled at its two ends, 100 s apart: between them errors grow until nothing is
    known of the motion."""
    pytest.importorskip("heyoka")
    path = tmp_path / "needle.h5"
    (one,) = find_scenes(["extreme/needle-fig05-1e-15"])
    short = replace(one, samples=2, duration=100.0)
    run_scenes(
        [short],
        {one.name: ["lagrange/taylor"]},
        path,
        workers=0,
        timeout_s=60.0,
        settings={"tolerance": 1e-15},
    )
    (cell,) = suite_runs(path)
    assert (cell.status, cell.outcome) == ("unchecked", "unchecked")
    assert cell.message.startswith("rows 100 s apart")
    assert cell.message.endswith(
        "in 1 interval a defect of 0.01 rad would not be seen; set a larger number of `samples` in the "
        "scene"
    )
    assert suite_table([cell]).rows == [("lagrange/taylor", "0 of 1", "0")]
    page = write_report(path, tmp_path / "report").read_text(encoding="utf-8")
    assert cell.message in page


def made_run(method: str, outcome: str, scene: str = "stiff/a", **facts: bool) -> SuiteRun:
    status = "inaccurate" if outcome == "smaller_step" else outcome
    known = {"false_success": False, "has_reference": True} | facts
    return SuiteRun(scene, method, status, outcome, "", **known, step=None)


def test_runs_are_counted_by_folder() -> None:
    runs = [
        made_run("a", "ok"),
        made_run("a", "smaller_step", "stiff/b"),
        made_run("a", "diverged", "extreme/feather-1", false_success=True),
        # no motion exists: not counted
        made_run("a", "singular", "extreme/passage-1", has_reference=False),
        made_run("b", "ok"),
        made_run("printed/ode45", "completed"),
        made_run("printed/ode45", "diverged"),
    ]
    table = suite_table(runs)
    assert table.head == ("method", "stiff", "extreme", "reported as success")
    printed = ("printed/ode45", "1 of 2 completed", "", "0")
    assert table.rows == [("a", "1+1 of 2", "0 of 1", "1"), ("b", "1 of 1", "", "0"), printed]
    # the map shows whatever a stored run can have
    assert {*STATUSES} - {"left_out", "worker_died"} <= {*OUTCOMES}


def test_all_methods_that_are_ok_on_the_fewest_scenes_are_named() -> None:
    methods = ["lagrange/taylor", "exudyn_tree/rk67", "mujoco/rk4"]
    outcomes = ("ok", "smaller_step", "diverged")
    runs = [made_run(*run) for run in zip(methods, outcomes, strict=True)]
    _, fewest = map(str, ranking(runs, methods))
    assert fewest == "The fewest: Exudyn tree, RK67; MuJoCo, RK4, 0 of 1 each."
    _, fewest = map(str, ranking([*runs, made_run("mujoco/rk4", "ok", "stiff/b")], methods))
    assert fewest == "The fewest: Exudyn tree, RK67, 0 of 1."


@pytest.mark.full
def test_an_interrupted_suite_goes_on_where_it_stopped(tmp_path: Path) -> None:
    """Each row is stored when it is computed; what is there is not computed again."""
    path, name = tmp_path / "s.h5", "extreme/light-1e-2"
    scenes, methods = (
        find_scenes([name]),
        ["exudyn_tree/generalized_alpha", "exudyn_tree/rk67", "exudyn_tree/rk44"],
    )
    run_scenes(scenes, {name: methods}, path, workers=0, timeout_s=60.0)

    def interrupt(*_: object) -> None:
        raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        complete_ladders(scenes, {name: methods}, path, 0, interrupt)
    begun = {record.method for record in read_records(path, STEPS)}
    assert len(begun) in (1, 2)  # one more may have ended
    assert {outcome.method for outcome in complete_ladders(scenes, {name: methods}, path, 0)} == {
        *methods
    } - begun
    assert complete_ladders(scenes, {name: methods}, path, 0) == []
    assert [file.name for file in tmp_path.iterdir()] == ["s.h5"]
