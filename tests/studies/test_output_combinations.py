"""Whatever outputs a scene file may ask for: it runs, is checked, reported and swept."""

from __future__ import annotations

import itertools
from pathlib import Path

import pytest
from support.commands import rotor_mbs
from support.scenes import paper

from rotor_mbs.runs.read import open_results
from rotor_mbs.scenario.scene import OUTPUTS, scene_toml

ARRAYS = ("angles", "rates", "tip")
ALL = [chosen for count in range(1, 1 + len(OUTPUTS)) for chosen in itertools.combinations(OUTPUTS, count)]


@pytest.mark.full
def test_every_combination_runs_is_checked_and_reported(tmp_path: Path) -> None:
    folder, results = tmp_path / "scenes", tmp_path / "r.h5"
    folder.mkdir()
    for chosen in ALL:
        scene = paper("fig11", samples=6, duration=0.1, outputs=chosen)
        (folder / f"{'-'.join(chosen)}.toml").write_text(scene_toml(scene))
    ended = rotor_mbs("run", folder, "-m", "lagrange/taylor", "-m", "exudyn_tree/rk67", "-o", results, "-j", 1)
    assert ended.status in (0, 1), ended.err
    with open_results(results) as stored:
        for chosen in ALL:
            run = stored.scenes["-".join(chosen)].runs["lagrange/taylor"]
            is_judged = "angles" in chosen or "energy" in chosen
            assert run.status == ("ok" if is_judged else "unchecked")
            assert {*run.names} & {*ARRAYS} == {*chosen} & {*ARRAYS}
    assert rotor_mbs("run", folder, "-m", "printed/ode45", "-o", results, "-j", 1).status in (0, 1)
    assert rotor_mbs("report", results, "-o", tmp_path / "report").status == 0
    assert rotor_mbs("check", results).status == 0
