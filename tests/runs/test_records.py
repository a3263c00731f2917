"""Records beside runs: stored and read back, merged by scene, found by their content hash, read from earlier files."""

from __future__ import annotations

from dataclasses import asdict
from pathlib import Path

import h5py
import numpy as np
import pytest
from rotor_mbs.runs.results_file import ResultsStore, merge
from support.scenes import paper
from support.stored import Made, rotor, store

from rotor_mbs.analysis.errata import entries, errata_record
from rotor_mbs.models.printed.errata import CheckedEntry
from rotor_mbs.runs.read import open_results
from rotor_mbs.runs.records import Record, read_records, write_records
from rotor_mbs.solution.status import code_of

CHECKS = [
    CheckedEntry("(8)", "row 1", "c", "0", 1.0, False, "E1"),
    CheckedEntry("(9)", "row 2", "x", "x", 0.0, True, ""),
]


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
    write_records(tmp_path / "errata.h5", [errata_record(CHECKS, {"run_hash": "errata"})])
    merge(tmp_path / "all.h5", [tmp_path / f"{name}.h5" for name in ("runs", "record", "errata")], {})
    assert ResultsStore(tmp_path / "all.h5").stored_keys() == {"run", "record", "errata"}
    with open_results(tmp_path / "all.h5") as results:
        assert entries(results) == CHECKS
        assert list(results.scenes) == ["paper/fig05"]


def test_files_of_earlier_versions_are_read_and_merged(tmp_path: Path) -> None:
    """They have a group for each checked entry, no digests, and seven statuses."""
    write_records(tmp_path / "a.h5", [ladder("stiff/x", "exudyn_tree/rk44", "k")])
    with h5py.File(tmp_path / "a.h5", "a") as file:
        group = file["stability/steps/stiff/x/exudyn_tree/rk44"]
        del group.attrs["digests"]
        group["status"].attrs["flag_meanings"] = "ok left_out"
        group["status"][:] = [1, 0]
        file.create_group("errata").attrs["fingerprint"] = "f"
        for number, check in enumerate(CHECKS):
            file.create_group(f"errata/{number:03d}").attrs.update(asdict(check))
    merge(tmp_path / "b.h5", [tmp_path / "a.h5"], {})
    (found,) = read_records(tmp_path / "b.h5", "steps")
    assert (found.key, found.statuses) == ("k", ["left_out", "ok"])
    with open_results(tmp_path / "b.h5") as results:
        assert entries(results) == CHECKS


def test_records_open_in_xarray(tmp_path: Path) -> None:
    xarray = pytest.importorskip("xarray")
    write_records(tmp_path / "a.h5", [ladder("stiff/x", "exudyn_tree/rk44", "k")])
    write_records(tmp_path / "b.h5", [errata_record(CHECKS, {})])
    merge(tmp_path / "all.h5", [tmp_path / "a.h5", tmp_path / "b.h5"], {})
    with xarray.open_datatree(tmp_path / "all.h5", engine="h5netcdf") as tree:
        assert tree["stability/steps/stiff/x/exudyn_tree/rk44/step"].dims == ("row",)
        assert tree["errata/difference"].values.tolist() == [1.0, 0.0]
        assert list(tree["errata"].attrs["printed"]) == ["c", "x"]
