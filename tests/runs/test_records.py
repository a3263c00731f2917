"""Records beside runs: stored and read back, merged by scene, found by their content hash, read from earlier files."""

from __future__ import annotations

from pathlib import Path

import h5py
import numpy as np
import pytest
from support.scenes import paper
from support.stored import Made, rotor, store

from rotor_mbs.runs.read import open_results
from rotor_mbs.runs.records import Record, read_records, write_records
from rotor_mbs.runs.results_file import ResultsStore, merge
from rotor_mbs.solution.status import code_of


def ladder(scene: str, method: str, key: str, scene_hash: str = "1") -> Record:
    arrays = {"step": np.array([0.5, 0.25]), "status": np.array([code_of("left_out"), code_of("ok")])}
    return Record("steps", scene, method, {"run_hash": key, "scene_hash": scene_hash}, arrays)


def named(path: Path) -> list[str]:
    return [record.path for record in read_records(path)]


def test_a_record_comes_back_as_it_was(tmp_path: Path) -> None:
    made = ladder("stiff/x", "exudyn_tree/rk44", "k")
    write_records(tmp_path / "a.h5", [made])
    (found,) = read_records(tmp_path / "a.h5", "steps")
    assert (found.kind, found.scene, found.name, found.key) == (made.kind, made.scene, made.name, "k")
    assert found.statuses == ["left_out", "ok"]
    for name, values in made.arrays.items():
        np.testing.assert_array_equal(found.arrays[name], values)
    assert read_records(tmp_path / "a.h5", "bench") == []


def test_merging_replaces_by_name_drops_other_numbers_and_leaves_out_what_is_stale(tmp_path: Path) -> None:
    one, two = ladder("stiff/x", "exudyn_tree/rk44", "a"), ladder("stiff/x", "exudyn_tree/rk67", "b")
    elsewhere = ladder("stiff/y", "exudyn_tree/rk44", "c")
    write_records(tmp_path / "old.h5", [one, two, elsewhere])
    write_records(tmp_path / "new.h5", [ladder("stiff/x", "exudyn_tree/rk44", "d")])
    merge(tmp_path / "all.h5", [tmp_path / "old.h5", tmp_path / "new.h5"], {})
    assert ResultsStore(tmp_path / "all.h5").stored_keys() == {"b", "c", "d"}
    merge(tmp_path / "all.h5", [tmp_path / "all.h5"], {}, without={"c"})
    assert named(tmp_path / "all.h5") == [f"stability/steps/stiff/x/exudyn_tree/{name}" for name in ("rk44", "rk67")]
    write_records(tmp_path / "new.h5", [ladder("stiff/x", "exudyn_tree/dopri5", "e", scene_hash="2")])
    merge(tmp_path / "all.h5", [tmp_path / "all.h5", tmp_path / "new.h5"], {})
    assert named(tmp_path / "all.h5") == ["stability/steps/stiff/x/exudyn_tree/dopri5"]


def test_runs_and_records_are_kept_side_by_side(tmp_path: Path) -> None:
    scene = paper("fig05")
    store(tmp_path / "runs.h5", [Made(scene, "lagrange/taylor", rotor(np.sin), attributes={"run_hash": "run"})])
    write_records(tmp_path / "record.h5", [ladder("paper/fig05", "lagrange/taylor", "record")])
    merge(tmp_path / "all.h5", [tmp_path / f"{name}.h5" for name in ("runs", "record")], {})
    assert ResultsStore(tmp_path / "all.h5").stored_keys() == {"run", "record"}
    with open_results(tmp_path / "all.h5") as results:
        assert list(results.scenes) == ["paper/fig05"]


def test_files_of_earlier_versions_are_read_and_merged(tmp_path: Path) -> None:
    """They have no digests, and seven statuses."""
    write_records(tmp_path / "a.h5", [ladder("stiff/x", "exudyn_tree/rk44", "k")])
    with h5py.File(tmp_path / "a.h5", "a") as file:
        group = file["stability/steps/stiff/x/exudyn_tree/rk44"]
        del group.attrs["digests"]
        group["status"].attrs["flag_meanings"] = "ok left_out"
        group["status"][:] = [1, 0]
    merge(tmp_path / "b.h5", [tmp_path / "a.h5"], {})
    (found,) = read_records(tmp_path / "b.h5", "steps")
    assert (found.key, found.statuses) == ("k", ["left_out", "ok"])


def test_records_open_in_xarray(tmp_path: Path) -> None:
    xarray = pytest.importorskip("xarray")
    write_records(tmp_path / "a.h5", [ladder("stiff/x", "exudyn_tree/rk44", "k")])
    with xarray.open_datatree(tmp_path / "a.h5", engine="h5netcdf") as tree:
        assert tree["stability/steps/stiff/x/exudyn_tree/rk44/step"].dims == ("row",)
