"""The main job as one command: every scene, every model, one file, one report; and a second time, nothing to do."""

from __future__ import annotations

import re
import subprocess
import sys
import tomllib
from pathlib import Path

import pytest
from support.scenes import PAPER

from rotor_mbs.analysis.published import checked_entries
from rotor_mbs.methods.catalogue import is_corrected
from rotor_mbs.runs.read import open_results
from rotor_mbs.scenario.catalogue import reference_folder

pytestmark = pytest.mark.full
METHODS = {"printed/ode45", "lagrange/taylor", "exudyn_tree/rk67", "exudyn_chain/generalized_alpha"}


def reproduce(folder: Path) -> str:
    done = subprocess.run(
        [sys.executable, "-m", "rotor_mbs", "reproduce", "-o", folder], capture_output=True, text=True, check=True
    )
    return done.stdout


@pytest.fixture(scope="module")
def reproduced(tmp_path_factory: pytest.TempPathFactory) -> Path:
    pytest.importorskip("heyoka")
    folder = tmp_path_factory.mktemp("reproduced")
    reproduce(folder)
    return folder


def test_every_scene_by_every_model_and_all_right_ones_ok(reproduced: Path) -> None:
    with open_results(reproduced / "results.h5") as results:
        assert set(results.scenes) == {f"paper/{name}" for name in PAPER}
        for scene in results.scenes.values():
            assert set(scene.methods) >= METHODS
            assert scene.reference is not None
            assert {run.status for run in scene.runs.values() if is_corrected(run.method)} == {"ok"}


def test_the_printed_model_makes_energy_and_the_right_ones_do_not(reproduced: Path) -> None:
    """In most of the paper's figures, more than a thousandth of all energy; the right models at most 1e-9."""
    with open_results(reproduced / "results.h5") as results:
        made = [scene.runs["printed/ode45"].attributes["energy_drift_max"] for scene in results.scenes.values()]
        kept = [
            scene.runs[method].attributes["energy_drift_max"]
            for scene in results.scenes.values()
            for method in ("lagrange/taylor", "exudyn_tree/rk67")
        ]
    assert sum(drift > 1e-3 for drift in made) > len(made) / 2
    assert max(kept) <= 1e-9


def test_the_errata_are_those_that_the_paper_is_charged_with() -> None:
    charged = tomllib.loads((reference_folder() / "errata.toml").read_text())["erratum"]
    checks = checked_entries()
    assert {check.equation for check in checks if not check.agrees} == {
        equation for erratum in charged for equation in (*erratum["stands_in"], *erratum["reaches"])
    }
    assert all(check.explained_by for check in checks if not check.agrees)


def test_the_report_says_what_was_found(reproduced: Path) -> None:
    index = (reproduced / "report" / "index.html").read_text()
    assert 'Published numbers reproduced</th><td class="n">4 of 4</td>' in index
    pages = list((reproduced / "report").glob("*.html"))
    assert len(pages) == len(PAPER) + 5  # index, errata, the figures one by one, the bench and its scene
    for page in pages:
        assert not re.search(r'(?:src|href)="(?:https?:)?//', page.read_text())


def test_a_second_time_nothing_is_made_anew(reproduced: Path) -> None:
    before = {path: path.stat().st_mtime_ns for path in reproduced.rglob("*") if path.is_file()}
    assert "nothing to do" in reproduce(reproduced)
    assert {path: path.stat().st_mtime_ns for path in reproduced.rglob("*") if path.is_file()} == before
