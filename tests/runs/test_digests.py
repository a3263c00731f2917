"""Whatever changes in a file after it was written is found: in runs, in sweeps, and in what is no file of ours."""

from __future__ import annotations

import shutil
from collections.abc import Callable
from functools import partial
from pathlib import Path

import h5py
import numpy as np
import pytest
from support.checking import failed, judged, results_file
from support.commands import rotor_mbs
from support.sweeps import THREE_RUNS, made_sweep

import rotor_mbs as rm
from rotor_mbs.errors import StoreError
from rotor_mbs.runs.files import seal
from rotor_mbs.runs.read import open_results
from rotor_mbs.runs.results import TableFile
from rotor_mbs.runs.sweeps import StoredSweep
from rotor_mbs.runs.table import Rows

METHOD = "lagrange/dop853"
SCENE = "check/held"
RUN = f"{SCENE}/{METHOD}"


@pytest.fixture(scope="module")
def written(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return results_file(tmp_path_factory.mktemp("digests") / "good.h5", [SCENE], [METHOD])


@pytest.fixture
def copy(written: Path, tmp_path: Path) -> Path:
    return Path(shutil.copy(written, tmp_path / "results.h5"))


def change_row(path: Path, run: str, column: str, change: Callable[[np.ndarray], object]) -> None:
    """Changes a column of a row and leaves its checksum as it was."""
    place = TableFile(path).place(run)
    values = place.read()[column].copy()
    change(values)
    with path.open("r+b") as file:
        file.seek(place.offsets[column])
        file.write(values.tobytes())


def last_bit(values: np.ndarray) -> None:
    values.reshape(-1).view(np.uint8)[-8 if values.itemsize == 8 else -1] ^= 1


def forge(path: Path, run: str, change: Callable[[Rows], object]) -> None:
    """Changes a row and gives it the checksum that belongs to it, as a careful forger does."""
    place = TableFile(path).place(run)
    row = {name: values.copy() for name, values in place.read().items()}
    change(row)
    place.write(place.first, row)


def test_the_last_bit_of_every_column_of_a_run_is_found(copy: Path) -> None:
    columns = TableFile(copy).place(RUN).row.names or ()
    assert {"angles", "rates", "tip", "kinetic_energy", "energy_error", "energy_drift_max", "message"} <= {*columns}
    before = copy.read_bytes()
    for column in columns:
        change_row(copy, RUN, column, last_bit)
        with open_results(copy) as results:
            run = results.scenes[SCENE].runs[METHOD]
            assert run.is_damaged, column
            with pytest.raises(StoreError, match=f"{RUN} changed after it was written"):
                run.array("angles")
        copy.write_bytes(before)
    with open_results(copy) as results:
        assert not any(run.is_damaged for run in results.scenes[SCENE].runs.values())


def test_check_and_report_name_a_damaged_run(copy: Path, tmp_path: Path) -> None:
    change_row(copy, RUN, "angles", last_bit)
    (damage,) = [check for check in failed(judged(copy)) if check.name == "integrity"]
    assert (damage.where.scene, damage.where.method) == (SCENE, METHOD)
    report = rotor_mbs("report", copy, "-o", tmp_path / "report")
    assert report.status == 2
    (line,) = report.err.splitlines()
    assert f"{RUN} changed after it was written" in line
    with pytest.raises(StoreError, match=f"{RUN} changed after it was written"):
        _ = rm.open(copy)[RUN]


LAID_OUT: dict[str, Callable[[h5py.File], object]] = {
    "a setting": lambda file: file["runs/settings"].__setitem__(1, "{}"),
    "a version": lambda file: file["runs/versions"].__setitem__(1, "{}"),
    "a time": lambda file: file[SCENE]["time"].__setitem__(1, 0.5),
    "a unit": lambda file: file[SCENE]["angles"].attrs.modify("units", "deg"),
    "a title": lambda file: file[SCENE].attrs.modify("title", "another"),
    "the version of a library": lambda file: file.attrs.modify("numpy", "0.0"),
    "no digests": lambda file: file[SCENE].attrs.__delitem__("digests"),
    "an array more": lambda file: file[SCENE].create_dataset("more", data=np.zeros(3)),
    "an array less": lambda file: file[SCENE].__delitem__("energy_error"),
}


# Units of computed columns are compared by `check` alone, since that takes most of the time of reading a file.
CASES = [(c, k) for c in LAID_OUT for k in ("check", "report", "run") if c != "a unit" or k == "check"]


@pytest.mark.parametrize(("change", "command"), CASES)
def test_a_change_of_what_was_laid_out_is_refused_in_one_line(
    change: str, command: str, copy: Path, tmp_path: Path
) -> None:
    with h5py.File(copy, "r+") as file:
        LAID_OUT[change](file)
    before = copy.read_bytes()
    words = {
        "check": ["check", copy],
        "report": ["report", copy, "-o", tmp_path / "report"],
        "run": ["run", SCENE, "-m", METHOD, "-o", copy, "-j", "1"],
    }
    ended = rotor_mbs(*words[command])
    assert ended.status == 2
    (line,) = ended.err.splitlines()
    assert "changed after the file was laid out" in line
    assert copy.read_bytes() == before


# Behind checksums that are right


def test_a_growth_that_hides_an_error_is_found(copy: Path) -> None:
    """With a growth of 1e6 at the second sample nothing is compared any more, and a wrong run could be called ok."""
    forge(copy, f"{SCENE}/reference", lambda row: row["error_growth"].__setitem__((0, 1), 1e6))
    names = {check.name for check in failed(judged(copy))}
    assert "growth" in names
    assert "integrity" not in names


def test_an_energy_error_that_is_not_the_balance_is_found(copy: Path) -> None:
    forge(copy, RUN, lambda row: row["energy_error"].__setitem__((0, 5), row["energy_error"][0, 5] + 1.0))
    (failure,) = failed(judged(copy))
    assert (failure.name, failure.where.channel) == ("energies", "energy error")


def test_settings_and_steps_that_are_not_the_methods_are_found(copy: Path) -> None:
    forge(copy, RUN, lambda row: row["steps"].fill(1))
    assert {check.name for check in failed(judged(copy))} == {"steps"}
    columns = TableFile(copy).table("runs").computed.keys()
    with h5py.File(copy, "r+") as file:
        file["runs/settings"][1] = '{"step": 0.001}'
        del file["runs"].attrs["digests"]
        seal(file["runs"], later=columns)
    assert "settings" in {check.name for check in failed(judged(copy))}


# What is refused: links, other files' arrays, claims


def outside(path: Path) -> Path:
    path.write_bytes(bytes(range(256)) * 64)
    return path


FOREIGN: dict[str, Callable[[h5py.Group, Path], object]] = {
    "an external link": lambda scene, place: scene.__setitem__("angles", h5py.ExternalLink(str(place), "/x")),
    "a soft link": lambda scene, _: scene.__setitem__("angles", h5py.SoftLink(f"/{SCENE}/rates")),
    "another file's bytes": lambda scene, place: scene.create_dataset(
        "angles", (2, 151, 4), "f8", external=[(str(place), 0, 2 * 151 * 32)]
    ),
    "30 GB that are not there": lambda scene, _: scene.create_dataset("angles", (10**9, 4), "f8", chunks=(1000, 4)),
    "a compressed bomb": lambda scene, _: scene.create_dataset(
        "angles", data=np.zeros((1_000_000, 4)), compression="gzip"
    ),
    "a group": lambda scene, _: scene.create_group("angles"),
    "a text": lambda scene, _: scene.create_dataset("angles", data="text"),
    "an array of nothing": lambda scene, _: scene.create_dataset("angles", data=h5py.Empty("f8")),
}


@pytest.mark.parametrize("is_sealed", [False, True])
@pytest.mark.parametrize("kind", FOREIGN)
def test_what_is_not_an_array_of_the_file_is_refused(kind: str, is_sealed: bool, copy: Path, tmp_path: Path) -> None:
    with h5py.File(copy, "r+") as file:
        scene, columns = file[SCENE], TableFile(copy).table(SCENE).computed
        del scene["angles"]
        FOREIGN[kind](scene, outside(tmp_path / "outside.bin"))
        if is_sealed and kind not in ("an external link", "a group"):
            for name, value in (("units", "rad"), ("long_name", "angles")):
                scene["angles"].attrs[name] = value
            del scene.attrs["digests"]
            seal(scene, later=columns.keys())
    for words in (["report", copy, "-o", tmp_path / "report"], ["check", copy]):
        ended = rotor_mbs(*words)
        assert ended.status == 2 or (words[0] == "check" and ended.status == 1)
        if ended.status == 2:
            (line,) = ended.err.splitlines()
            assert str(copy) in line


def test_a_group_that_holds_itself_ends(copy: Path) -> None:
    with h5py.File(copy, "r+") as file:
        file["check/again"] = file["check"]
        file["check/once_more"] = file["/"]
    ended = rotor_mbs("check", copy)
    assert ended.status == 2
    assert len(ended.err.splitlines()) == 1


def test_files_that_are_not_ours_are_refused_with_one_line(written: Path, tmp_path: Path) -> None:
    (tmp_path / "cut.h5").write_bytes(written.read_bytes()[:3000])
    (tmp_path / "half.h5").write_bytes(written.read_bytes()[: written.stat().st_size // 2])
    (tmp_path / "text.h5").write_text("no HDF5")
    with h5py.File(tmp_path / "other.h5", "w") as file:
        file["x"] = 1
    with h5py.File(tmp_path / "newer.h5", "w") as file:
        file.attrs["format"], file.attrs["format_version"] = "rotor_mbs", 99
    for name in ("cut.h5", "half.h5", "text.h5", "other.h5", "newer.h5", "missing.h5", "."):
        with pytest.raises(StoreError) as caught, open_results(tmp_path / name):
            pass
        assert "\n" not in str(caught.value)
        assert str(tmp_path) in str(caught.value)


# Sweeps


@pytest.fixture(scope="module")
def swept(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return made_sweep(tmp_path_factory.mktemp("sweep"), THREE_RUNS)


@pytest.mark.parametrize("column", ["angles", "energy_drift_max", "status", "gravity", "time", "crc32"])
def test_a_changed_number_of_a_finished_sweep_is_found(column: str, swept: Path, tmp_path: Path) -> None:
    copy = Path(shutil.copy(swept, tmp_path / "s.h5"))
    assert rotor_mbs("check", copy).status == 0
    with h5py.File(copy, "r+") as file:
        values = file[column][()]
        values.view(np.uint8).reshape(-1)[0] ^= 1
        file[column][...] = values
    ended = rotor_mbs("check", copy)
    if column in ("gravity", "time"):
        assert ended.status == 2
        assert f"{column} changed after the file was laid out" in ended.err
        return
    assert ended.status == 1
    assert "1 runs changed after they were written" in ended.out
    with pytest.raises(StoreError, match="runs 0 changed"):
        StoredSweep(copy)
    assert rotor_mbs("report", copy, "-o", tmp_path / "report").status == 2
    for read in (partial(rm.Runs.column, name="time"), partial(rm.Runs.at, name="angles", sample=0), rm.Runs.to_xarray):
        with pytest.raises(StoreError, match="runs 0 changed"):
            read(rm.open(copy))
