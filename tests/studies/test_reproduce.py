"""The main job on every scene of the paper: all right methods ok, the published numbers and the errata as charged."""

from __future__ import annotations

from pathlib import Path

import pytest
from support.commands import rotor_mbs
from support.scenes import PAPER

from rotor_mbs.methods.catalogue import is_corrected
from rotor_mbs.runs.read import open_results


@pytest.mark.full
def test_every_scene_by_every_model_and_all_right_ones_ok(tmp_path: Path) -> None:
    """The printed equations gain more than a thousandth of all energy in most figures, the right ones at most 1e-9."""
    pytest.importorskip("heyoka")
    ended = rotor_mbs("reproduce", "-o", tmp_path)
    assert ended.status == 0, ended.err
    right = ("lagrange/taylor", "exudyn_tree/rk67")
    with open_results(tmp_path / "results.h5") as results:
        assert set(results.scenes) == {f"paper/{name}" for name in PAPER}
        printed_drifts = []
        for scene in results.scenes.values():
            assert scene.reference is not None
            assert {run.status for run in scene.runs.values() if is_corrected(run.method)} == {"ok"}
            drift = {name: run.attributes.get("energy_drift_max", 0.0) for name, run in scene.methods.items()}
            assert max(drift[name] for name in right) <= 1e-9
            printed_drifts.append(drift["printed/ode45"])
    assert sum(drift > 1e-3 for drift in printed_drifts) > len(printed_drifts) / 2
    index = (tmp_path / "report" / "index.html").read_text()
    assert 'Published numbers reproduced</th><td class="n">4 of 4</td>' in index
    assert len(list((tmp_path / "report").glob("*.html"))) == len(PAPER) + 5
    assert rotor_mbs("check", tmp_path / "results.h5").status == 0
