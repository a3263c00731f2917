"""Whatever outputs a scene file may ask for: it runs, is checked, reported and swept."""

from __future__ import annotations

import itertools
from pathlib import Path

import h5py
from support.scenes import paper

from rotor_mbs.cli import main
from rotor_mbs.scenario.scene import OUTPUTS
from rotor_mbs.scenario.scene_file import scene_toml

COMBINATIONS = [chosen for count in range(1, 1 + len(OUTPUTS)) for chosen in itertools.combinations(OUTPUTS, count)]
METHODS = ("lagrange/taylor", "exudyn_tree/rk67")


def test_every_combination_runs_is_checked_and_reported(tmp_path: Path) -> None:
    folder, results = tmp_path / "scenes", tmp_path / "r.h5"
    folder.mkdir()
    for chosen in COMBINATIONS:
        scene = paper("fig11", samples=6, duration=0.1, outputs=chosen)
        (folder / f"{'-'.join(chosen)}.toml").write_text(scene_toml(scene))
    methods = [word for method in METHODS for word in ("-m", method)]
    main(["run", str(folder), *methods, "-o", str(results), "-j", "2"])
    with h5py.File(results) as file:
        for chosen in COMBINATIONS:
            run = file["-".join(chosen)]["lagrange/taylor"]
            is_judged = "angles" in chosen or "energy" in chosen
            assert run.attrs["status"] == ("ok" if is_judged else "unchecked")
            assert [name in run for name in ("angles", "rates", "tip")] == [
                name in chosen for name in ("angles", "rates", "tip")
            ]
    assert main(["check", str(results)]) == 0
    assert main(["report", str(results), "-o", str(tmp_path / "report")]) == 0
