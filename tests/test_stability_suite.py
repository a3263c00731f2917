"""The suite itself: a killed worker, a hung run, the map and its pages; scenes that say what they stress."""

from __future__ import annotations

import os
import signal
import time
from pathlib import Path

import pytest

from rotor_mbs.analysis.stability import OUTCOMES, advice, cells, in_words, reached_by, unreached
from rotor_mbs.cli import main
from rotor_mbs.runner.pool import run_tasks
from rotor_mbs.scenario.catalogue import find_scenes
from rotor_mbs.store.stability import Record, read_records, write_records

SCENES = ("stiff/bearing-1e8-damping-100", "extreme/light-1e-8", "extreme/rate-1e200")


def test_there_are_enough_scenes_and_each_says_what_it_stresses() -> None:
    found = find_scenes(["stiff", "extreme"])
    assert len(found) >= 30
    for scene in found:
        assert scene.text.startswith("# Stresses: "), scene.name
        assert "# Oracle: " in scene.text, scene.name


@pytest.fixture(scope="module")
def suite(tmp_path_factory: pytest.TempPathFactory) -> Path:
    pytest.importorskip("heyoka")
    path = tmp_path_factory.mktemp("suite") / "stability.h5"
    assert main(["stability", *SCENES, "-o", str(path), "--timeout", "3"]) == 0
    return path


@pytest.mark.slow
def test_no_run_of_ours_claims_success(suite: Path) -> None:
    found = cells(suite)
    assert {cell.scene for cell in found} == set(SCENES)
    ours = [cell for cell in found if cell.method.startswith("lagrange")]
    assert not [cell for cell in ours if cell.false_success]
    assert [cell for cell in found if cell.false_success]  # Exudyn's explicit methods on the overdamped bearing
    assert not [cell for cell in found if cell.status == "ok" and cell.scene == "extreme/rate-1e200"]
    assert not unreached(found)
    assert reached_by(found, "extreme/light-1e-8") == "lagrange/taylor"


@pytest.mark.slow
def test_the_map_and_its_pages(suite: Path) -> None:
    folder = suite.with_name("stability-report")
    page = (folder / "index.html").read_text(encoding="utf-8")
    for cell in cells(suite):
        symbol, words = OUTCOMES[cell.outcome]
        assert words in page
        assert symbol in page
    for scene in SCENES:
        own = (folder / (scene.replace("/", "-") + ".html")).read_text(encoding="utf-8")
        assert "# Stresses" in own
    for one in advice(cells(suite)):
        assert one.method in in_words(one)


def test_records_come_back_as_they_were(tmp_path: Path) -> None:
    path = tmp_path / "r.h5"
    write_records(path, [Record("limits", "stiff/x/exudyn_tree/rk44", {"theory_s": 0.25})])
    (back,) = read_records(path)
    assert (back.kind, back.scene, back.method) == ("limits", "stiff/x", "exudyn_tree/rk44")
    assert back.attributes["theory_s"] == 0.25


def _work(task: int) -> int:
    if task == 1:
        os.kill(os.getpid(), signal.SIGKILL)
    if task == 2:
        time.sleep(60.0)
    return task


def test_a_killed_worker_and_a_hung_one_cost_their_own_run_alone() -> None:
    start = time.monotonic()
    ended = {finished.task: finished for finished in run_tasks(_work, [0, 1, 2, 3, 4], 2, 2.0)}
    assert time.monotonic() - start < 30.0
    assert {task for task, finished in ended.items() if finished.value == task} == {0, 3, 4}
    assert ended[1].failure == "worker_died"
    assert ended[2].failure == "timed_out"
