"""The viewer's data: what a browser reads is what was stored, small, and harmless."""

from __future__ import annotations

import json
import re
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from support.scenes import paper
from support.stored import Made, rotor, store

from rotor_mbs.report.build import write_report
from rotor_mbs.report.pages.viewer import MAX_FRAMES, script_json, viewer
from rotor_mbs.runs.read import open_results

FIG11 = paper("fig11", samples=301)
TURNING = rotor(lambda t: 40.0 * t, lambda t: -7.0 * t + 1.0, np.cos, np.sin)


def viewer_of(folder: Path, run: Made) -> dict:  # type: ignore[type-arg]
    """What the viewer of a file with this run has."""
    with open_results(store(folder / "r.h5", [run])) as opened:
        scene = opened.scenes[run.scene.name]
        made = viewer(scene, dict(scene.runs))
    assert made is not None
    return made


def test_angles_are_those_of_the_run_to_a_ten_thousandth_of_a_radian_over_any_number_of_turns(tmp_path: Path) -> None:
    data = json.loads(str(viewer_of(tmp_path, Made(FIG11, "reference", TURNING))["data"]))
    np.testing.assert_allclose(data["models"][0]["frames"], TURNING(np.linspace(0.0, 10.0, 301)), atol=0.5001e-4)


@pytest.mark.parametrize(("samples", "frames"), [(301, 301), (5001, MAX_FRAMES)])
def test_a_frame_for_each_sample_but_no_more_than_fit_a_page(tmp_path: Path, samples: int, frames: int) -> None:
    made = viewer_of(tmp_path, Made(paper("fig11", samples=samples), "reference", TURNING))
    assert len(json.loads(str(made["data"]))["models"][0]["frames"]) == frames


@pytest.mark.parametrize(("rate", "noted"), [(4.0, ""), (400.0, "turns by up to 13 rad from one frame to the next")])
def test_a_motion_too_fast_for_the_frames_is_stated(tmp_path: Path, rate: float, noted: str) -> None:
    notes = viewer_of(tmp_path, Made(FIG11, "reference", rotor(lambda t: rate * t)))["notes"]
    assert bool(notes) == bool(noted)
    assert noted in "".join(notes).replace("\N{NO-BREAK SPACE}", " ")


def test_a_page_holds_both_models_thinned_and_small(tmp_path: Path) -> None:
    runs = [Made(FIG11, "reference", TURNING), Made(FIG11, "printed/ode45", TURNING, until=0.5)]
    folder = write_report(store(tmp_path / "r.h5", runs), tmp_path / "out").parent
    text = (folder / "paper-fig11.html").read_text(encoding="utf-8")
    (shown,) = re.findall(r'<script type="application/json">(.*?)</script>', text, re.S)
    data = json.loads(shown)
    assert [model["name"] for model in data["models"]] == ["as printed, ode45", "reference, quad precision"]
    counts = [len(model["frames"]) for model in data["models"]]
    assert counts[1] == 301  # every sample
    # The printed run stops at 149/300 of 10 s: its frames do, too.
    assert (counts[0] - 1) * data["step"] == pytest.approx(10.0 * 149 / 300, abs=data["step"])
    assert data["blades"][1]["tip"] == list(FIG11.blades[1].tip)
    assert len(shown) < 15_000
    (script,) = (script for script in re.findall(r"<script>(.*?)</script>", text, re.S) if "viewer" in script)
    assert len(script.encode()) < 40_000


def test_a_run_is_drawn_up_to_its_first_sample_that_is_not_finite(tmp_path: Path) -> None:
    broken = rotor(lambda t: np.where(t > 4.0, np.nan, t))
    made = viewer_of(tmp_path, Made(replace(FIG11, outputs=("angles",)), "lagrange/taylor", broken))
    data = json.loads(str(made["data"]))
    assert (len(data["models"][0]["frames"]) - 1) * data["step"] == pytest.approx(4.0, abs=0.05)


def test_data_cannot_end_the_script_element() -> None:
    evil = "</script><script>alert(1)</script><!-- &amp;"
    text = str(script_json({"name": evil}))
    assert not set("<>&") & set(text)
    assert json.loads(text) == {"name": evil}
