"""Results files: bit-exact round trips, readable by others, atomic, and clear about files that are not theirs."""

from __future__ import annotations

import shutil
import subprocess
from dataclasses import replace
from pathlib import Path

import h5py
import numpy as np
import pytest
from rotor_mbs.runs.case import Case
from rotor_mbs.runs.results_file import merge
from rotor_mbs.runs.write import write_run
from support.scenes import paper

from rotor_mbs.errors import StoreError
from rotor_mbs.methods.solve import solve
from rotor_mbs.runs.files import attributes_of
from rotor_mbs.runs.read import open_results
from rotor_mbs.runs.runner import Job
from rotor_mbs.scenario.scene import Scene, scene_hash
from rotor_mbs.solution.solution import Solution
from rotor_mbs.studies.run import store_failure
from rotor_mbs.studies.stored_references import load_reference

SCENE = paper("fig08", duration=1.0, samples=51)


def made(scene: Scene = SCENE, method: str = "lagrange/dop853") -> Solution:
    return solve(method, scene, {})


def stored(path: Path, scene: Scene = SCENE, method: str = "lagrange/dop853", **attributes: object) -> Solution:
    run = made(scene, method)
    write_run(path, scene_hash(scene), run, {"status": "ok", "message": "", **attributes})
    return run


def test_round_trip_is_bit_exact(tmp_path: Path) -> None:
    run = stored(tmp_path / "a.h5", angle_error_max=1.25e-13)
    merge(tmp_path / "b.h5", [tmp_path / "a.h5"], {"numpy": np.__version__})
    with open_results(tmp_path / "b.h5") as results:
        scene = results.scenes["paper/fig08"]
        found = scene.runs["lagrange/dop853"]
        for name in ("time", "angles", "rates", "tip", "kinetic_energy", "potential_energy", "work"):
            np.testing.assert_array_equal(found.array(name), getattr(run.trajectory, name))
        assert found.attributes["angle_error_max"] == 1.25e-13
        assert found.settings == run.settings
        assert found.labels == list(SCENE.coordinate_labels)
        assert scene.attributes["scene_toml"] == SCENE.text
        assert results.attributes["numpy"] == np.__version__


def test_a_run_without_samples_has_all_its_settings(tmp_path: Path) -> None:
    case = Case(SCENE, "lagrange/dop853", {"relative_tolerance": 1e-3})
    store_failure("timed_out", Job(case, tmp_path / "a.h5"), "over its time limit")
    with open_results(tmp_path / "a.h5") as results:
        settings = results.scenes["paper/fig08"].runs["lagrange/dop853"].settings
    assert settings["relative_tolerance"] == 1e-3
    assert settings.keys() == made().settings.keys()


@pytest.mark.parametrize("outputs", [("angles",), ("tip",), ("energy",), ("rates", "energy")])
def test_only_what_was_asked_for_is_stored(tmp_path: Path, outputs: tuple[str, ...]) -> None:
    stored(tmp_path / "a.h5", paper("fig08", duration=1.0, samples=51, outputs=outputs))
    energy = {"kinetic_energy", "potential_energy", "work", "energy_error"}
    expected = {"time"} | (set(outputs) - {"energy"}) | (energy if "energy" in outputs else set())
    with h5py.File(tmp_path / "a.h5") as file:
        names = set(file["paper/fig08/lagrange/dop853"])
    scales = {"angles": {"coordinate"}, "rates": {"coordinate"}, "tip": {"blade", "axis"}, "energy": set()}
    assert names == expected.union(*(scales[output] for output in outputs))


def test_a_later_run_takes_the_place_of_an_earlier_one_and_others_stay(tmp_path: Path) -> None:
    stored(tmp_path / "a.h5", note="old")
    stored(tmp_path / "b.h5", paper("fig05", duration=1.0, samples=11), note="kept")
    merge(tmp_path / "all.h5", [tmp_path / "a.h5", tmp_path / "b.h5"], {})
    stored(tmp_path / "c.h5", note="new")
    merge(tmp_path / "all.h5", [tmp_path / "all.h5", tmp_path / "c.h5"], {})
    with open_results(tmp_path / "all.h5") as results:
        notes = {name: scene.runs["lagrange/dop853"].attributes["note"] for name, scene in results.scenes.items()}
    assert notes == {"paper/fig05": "kept", "paper/fig08": "new"}


def test_a_merged_run_has_its_members_in_order_and_scales_of_its_own(tmp_path: Path) -> None:
    """A copy by the library alone would refer to the scales of the file it was copied from."""
    stored(tmp_path / "a.h5")
    merge(tmp_path / "all.h5", [tmp_path / "a.h5"], {})
    merge(tmp_path / "all.h5", [tmp_path / "all.h5"], {})
    with h5py.File(tmp_path / "a.h5") as part, h5py.File(tmp_path / "all.h5") as file:
        before, after = part["paper/fig08/lagrange/dop853"], file["paper/fig08/lagrange/dop853"]
        assert list(after) == list(before)
        scales = [f"{after.name}/{name}" for name in ("time", "blade", "axis")]
        assert [scale[0].name for scale in after["tip"].dims] == scales
        users = {file[reference].name for reference, _ in after["blade"].attrs["REFERENCE_LIST"]}
        assert users == {f"{after.name}/tip"}
        assert attributes_of(after) == attributes_of(before)


def test_arrays_in_other_files_are_not_merged(tmp_path: Path) -> None:
    stored(tmp_path / "a.h5")
    with h5py.File(tmp_path / "a.h5", "a") as file:
        file.create_dataset("paper/fig08/lagrange/dop853/more", (3,), "f8", external=[(tmp_path / "x", 0, 24)])
    with pytest.raises(StoreError, match="more is stored in another file"):
        merge(tmp_path / "all.h5", [tmp_path / "a.h5"], {})


def test_a_short_reference_stays_in_memory_until_its_file_changes(tmp_path: Path) -> None:
    path, run = tmp_path / "a.h5", made()
    for shift in (0.0, 0.5):
        angles = run.angles + shift
        shifted = run.trajectory.replace(angles=angles, angle_uncertainty=np.zeros(51))
        write_run(path, scene_hash(SCENE), replace(run, method="reference", trajectory=shifted), {"status": "ok"})
        found = load_reference(path, SCENE)
        assert found is not None
        np.testing.assert_array_equal(found.angles, angles)
        assert load_reference(path, SCENE) is found
    long = replace(SCENE, samples=5002)
    assert load_reference(path, long) is not load_reference(path, long)


def test_opens_in_xarray_with_units_and_named_dimensions(tmp_path: Path) -> None:
    xarray = pytest.importorskip("xarray")
    pytest.importorskip("h5netcdf")
    stored(tmp_path / "a.h5")
    merge(tmp_path / "all.h5", [tmp_path / "a.h5"], {})
    with xarray.open_datatree(tmp_path / "all.h5", engine="h5netcdf") as tree:
        run = tree["paper/fig08/lagrange/dop853"].dataset
        assert run["angles"].dims == ("time", "coordinate")
        assert run["tip"].dims == ("time", "blade", "axis")
        assert run["angles"].attrs["units"] == "rad"
        assert run["rates"].sel(coordinate=0).shape == (51,)
        assert list(run["coordinate"].attrs["labels"]) == ["rotor", "pitch 1", "pitch 2", "pitch 3"]


@pytest.mark.skipif(shutil.which("h5dump") is None, reason="h5dump is not installed here")
def test_opens_in_h5dump(tmp_path: Path) -> None:
    stored(tmp_path / "a.h5")
    merge(tmp_path / "all.h5", [tmp_path / "a.h5"], {})
    dump = subprocess.run(["h5dump", "-H", tmp_path / "all.h5"], capture_output=True, text=True, check=True).stdout
    assert 'DATASET "angles"' in dump
    assert "DIMENSION_LIST" in dump


@pytest.mark.skipif(shutil.which("octave") is None, reason="Octave is not installed here")
def test_opens_in_octave(tmp_path: Path) -> None:
    stored(tmp_path / "a.h5")
    merge(tmp_path / "all.h5", [tmp_path / "a.h5"], {})
    script = f"d = load('{tmp_path / 'all.h5'}'); disp(size(d.paper.fig08.lagrange.dop853.angles))"
    shown = subprocess.run(["octave", "--no-gui", "--quiet", "--eval", script], capture_output=True, text=True)
    assert shown.stdout.split() == ["4", "51"]  # arrays come transposed


def test_files_that_are_not_ours_are_refused_with_one_line(tmp_path: Path) -> None:
    stored(tmp_path / "good.h5")
    (tmp_path / "cut.h5").write_bytes((tmp_path / "good.h5").read_bytes()[:3000])
    (tmp_path / "text.h5").write_text("no HDF5")
    with h5py.File(tmp_path / "other.h5", "w") as file:
        file["x"] = 1
    shutil.copy(tmp_path / "good.h5", tmp_path / "newer.h5")
    with h5py.File(tmp_path / "newer.h5", "a") as file:
        file.attrs["format_version"] = 99
    for name in ("cut.h5", "text.h5", "other.h5", "newer.h5", "missing.h5", "."):
        with pytest.raises(StoreError) as caught, open_results(tmp_path / name):
            pass
        assert "\n" not in str(caught.value)
        assert str(tmp_path) in str(caught.value)


def test_a_write_that_fails_leaves_the_old_file_and_no_litter(tmp_path: Path) -> None:
    stored(tmp_path / "a.h5", note="old")
    before = (tmp_path / "a.h5").read_bytes()
    with pytest.raises(StoreError):
        merge(tmp_path / "a.h5", [tmp_path / "a.h5", tmp_path / "missing.h5"], {})
    with pytest.raises(TypeError):
        stored(tmp_path / "a.h5", unstorable=object())
    assert (tmp_path / "a.h5").read_bytes() == before
    assert [path.name for path in tmp_path.iterdir()] == ["a.h5"]
