"""The suite itself: a killed worker, a hung run, the map and its pages; scenes that say what they stress."""

from __future__ import annotations

import re
from dataclasses import replace
from pathlib import Path

import pytest
from support.commands import rotor_mbs

from rotor_mbs.analysis.stability import OUTCOMES, advice_lines, reached_by, suite_runs, unreached
from rotor_mbs.report.build import write_report
from rotor_mbs.report.pages.stability import NOT_COMPARED
from rotor_mbs.runs.records import read_records
from rotor_mbs.scenario.catalogue import find_scenes
from rotor_mbs.studies.run import Outcome, run_scenes
from rotor_mbs.studies.stability import SYMMETRY, complete_studies

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
    ended = rotor_mbs("stability", *SCENES, "-o", path, "--timeout", "3")
    assert ended.status == 0, ended.err
    return path


@pytest.mark.full
def test_no_run_of_ours_claims_success(suite: Path) -> None:
    found = suite_runs(suite)
    assert {cell.scene for cell in found} == set(SCENES)
    ours = [cell for cell in found if cell.method.startswith("lagrange")]
    assert not [cell for cell in ours if cell.false_success]
    assert [cell for cell in found if cell.false_success]  # Exudyn's explicit methods on the overdamped bearing
    assert not [cell for cell in found if cell.status == "ok" and cell.scene == "extreme/rate-1e200"]
    # A fault of this package would be stored as a run that failed, with the exception's name before its text.
    assert not [cell for cell in found if re.match(r"\w+Error: ", cell.message)]
    assert not unreached(found)
    assert reached_by(found, "extreme/light-1e-8") == "lagrange/taylor"


@pytest.mark.full
def test_the_map_and_its_pages(suite: Path) -> None:
    folder = suite.with_name("stability-report")
    page = (folder / "index.html").read_text(encoding="utf-8")
    for cell in suite_runs(suite):
        symbol, words = OUTCOMES[cell.outcome]
        assert words in page
        assert symbol in page
    for scene in SCENES:
        own = (folder / (scene.replace("/", "-") + ".html")).read_text(encoding="utf-8")
        assert "# Stresses" in own
    named = [line.partition(": ")[0] for line in advice_lines(suite_runs(suite))]
    assert named == list(dict.fromkeys(cell.method for cell in suite_runs(suite)))


@pytest.mark.full
def test_a_run_judged_by_its_energy_alone_says_so(tmp_path: Path) -> None:
    """A needle sampled at its two ends: the horizon is before the second, where doubles have lost the motion."""
    pytest.importorskip("heyoka")
    path = tmp_path / "needle.h5"
    (one,) = find_scenes(["extreme/needle-fig05-1e-15"])
    run_scenes([replace(one, samples=2)], {one.name: ["lagrange/taylor"]}, path, workers=0, timeout_s=60.0,
               settings={"tolerance": 1e-15})  # fmt: skip
    (cell,) = suite_runs(path)
    assert (cell.status, cell.outcome) == ("ok", "energy_alone")
    assert cell.message == "judged by its energy alone: the horizon is before the second sample"
    assert cell.angle_error is None
    assert not cell.reaches_target
    assert reached_by([cell], one.name) is None
    assert advice_lines([cell])[0].startswith("lagrange/taylor: holds on 1 of 1 (1 by its energy alone)")
    page = write_report(path, tmp_path / "report").read_text(encoding="utf-8")
    assert cell.message in page
    assert NOT_COMPARED in page
    assert "closed form, Taylor: holds on 1 of 1 (1 by its energy alone); use for “on a needle”" in page
    own = (tmp_path / "report" / "extreme-needle-fig05-1e-15.html").read_text(encoding="utf-8")
    assert cell.message in own
    assert "lagrange/taylor, tolerance = 10⁻¹⁵" in own.replace("<wbr>", "")


def test_an_interrupted_suite_goes_on_where_it_stopped(tmp_path: Path) -> None:
    """Each row is stored when it is computed; what is there is not computed again."""
    path, name = tmp_path / "s.h5", "extreme/zero-gravity"
    scenes, methods = find_scenes([name]), ["lagrange/ode45", "exudyn_tree/rk67", "exudyn_tree/rk44"]
    run_scenes(scenes, {name: methods}, path, workers=0, timeout_s=60.0)

    def interrupt(done: int, total: int, _outcome: Outcome) -> None:
        assert (done, total) == (1, 3)
        raise KeyboardInterrupt

    def stored() -> set[str]:
        return {record.method for record in read_records(path, SYMMETRY)}

    with pytest.raises(KeyboardInterrupt):
        complete_studies(scenes, {name: methods}, path, 0, interrupt)
    begun = stored()
    assert 1 <= len(begun) <= 2
    made = complete_studies(scenes, {name: methods}, path, 0)
    assert {outcome.method for outcome in made} == {*methods} - begun
    assert all(outcome.is_stored for outcome in made)
    assert complete_studies(scenes, {name: methods}, path, 0) == []
    assert complete_studies(scenes, {name: methods[:1]}, path, 0) == []  # of one method alone: the others' stay
    assert stored() == {*methods}
    assert [file.name for file in tmp_path.iterdir()] == ["s.h5"]
