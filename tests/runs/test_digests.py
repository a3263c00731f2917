"""Whatever changes in a file after it was written is found: in runs, in sweeps, and in what is no file of ours."""

from __future__ import annotations

import shutil
from collections.abc import Callable
from functools import partial
from pathlib import Path

import h5py
import numpy as np
import pytest
from rotor_mbs.runs.results_file import ResultsStore
from support.checking import failed, judged, results_file
from support.sweeps import run_local

import rotor_mbs as rm
from rotor_mbs.cli import main
from rotor_mbs.errors import StoreError
from rotor_mbs.runs.digests import seal
from rotor_mbs.runs.read import open_results
from rotor_mbs.runs.sweeps import StoredSweep
from rotor_mbs.scenario.sweep import load_sweep

METHOD = "lagrange/dop853"
RUN = f"check/held/{METHOD}"


@pytest.fixture(scope="module")
def written(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return results_file(tmp_path_factory.mktemp("digests") / "good.h5", ["check/held"], [METHOD])


@pytest.fixture
def copy(written: Path, tmp_path: Path) -> Path:
    return Path(shutil.copy(written, tmp_path / "results.h5"))


def in_last_bit(dataset: h5py.Dataset) -> None:
    values = dataset[()]
    values.reshape(-1)[-1] = np.nextafter(values.reshape(-1)[-1], np.inf)
    dataset[...] = values


def every_array(path: Path) -> list[str]:
    with h5py.File(path) as file:
        return [name for name, item in file[RUN].items() if item.dtype.kind == "f"]


def test_the_last_bit_of_every_array_is_found(copy: Path) -> None:
    arrays = every_array(copy)
    assert {"time", "angles", "rates", "tip", "kinetic_energy", "potential_energy", "work", "energy_error"} <= {*arrays}
    for name in arrays:
        with h5py.File(copy, "r+") as file:
            before = file[RUN][name][()]
            in_last_bit(file[RUN][name])
        (found,) = [one for one in failed(judged(copy)) if one.name == "integrity"]
        assert (found.where.scene, found.where.method) == ("check/held", METHOD)
        assert found.hint.startswith(f"{name} changed")
        with open_results(copy) as results, pytest.raises(StoreError, match=f"{name} changed after it was written"):
            results.scenes["check/held"].runs[METHOD].array(name)
        with h5py.File(copy, "r+") as file:
            file[RUN][name][...] = before
    assert not failed(judged(copy))


CHANGES: dict[str, Callable[[h5py.File], object]] = {
    "a status": lambda file: file[RUN].attrs.modify("status", "inaccurate"),
    "a metric": lambda file: file[RUN].attrs.modify("energy_drift_max", 0.0),
    "a unit": lambda file: file[RUN]["angles"].attrs.modify("units", "deg"),
    "a title": lambda file: file["check/held"].attrs.modify("title", "another"),
    "a version": lambda file: file.attrs.modify("numpy", "0.0"),
    "an array more": lambda file: file[RUN].create_dataset("more", data=np.zeros(3)),
    "an array less": lambda file: file[RUN].__delitem__("energy_error"),
    "digests gone": lambda file: file[RUN].attrs.__delitem__("digests"),
    "the summary": lambda file: in_last_bit(file["summary/run_time_s"]),
}


@pytest.mark.parametrize("change", CHANGES)
def test_a_change_is_found_by_check(change: str, copy: Path) -> None:
    with h5py.File(copy, "r+") as file:
        CHANGES[change](file)
    assert any(one.name == "integrity" for one in failed(judged(copy)))


@pytest.mark.parametrize("change", ["a status", "a title", "a unit"])
def test_a_change_is_told_by_report_in_one_line(
    change: str, copy: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    with h5py.File(copy, "r+") as file:
        CHANGES[change](file)
    assert main(["report", str(copy), "-o", str(tmp_path / "report")]) == 2
    (line,) = capsys.readouterr().err.splitlines()
    assert "changed after" in line


def test_a_damaged_run_is_computed_anew_by_the_same_command(copy: Path) -> None:
    with h5py.File(copy, "r+") as file:
        in_last_bit(file[RUN]["angles"])
        count = len(file["check/held"])
    assert count == 2
    assert len(ResultsStore(copy).stored_keys()) == 1  # the reference's
    results_file(copy, ["check/held"], [METHOD])
    assert not failed(judged(copy))


def test_a_merge_does_not_bless_what_was_damaged(copy: Path) -> None:
    with h5py.File(copy, "r+") as file:
        in_last_bit(file[RUN]["angles"])
    results_file(copy, ["check/held"], ["lagrange/radau"])
    assert [one.where.method for one in failed(judged(copy)) if one.name == "integrity"] == [METHOD]


def sealed_anew(file: h5py.File, group: str) -> None:
    """Digests as a careful forger leaves them."""
    del file[group].attrs["digests"]
    seal(file[group])


def test_a_growth_that_hides_an_error_is_found_behind_new_digests(copy: Path) -> None:
    """With a growth of 1e6 at the second sample nothing is compared any more, and a wrong run could be called ok."""
    with h5py.File(copy, "r+") as file:
        file["check/held/reference/error_growth"][1] = 1e6
        sealed_anew(file, "check/held/reference")
    checks = {one.name for one in failed(judged(copy))}
    assert "growth" in checks
    assert "integrity" not in checks


def test_an_energy_error_that_is_not_the_balance_is_found_behind_new_digests(copy: Path) -> None:
    with h5py.File(copy, "r+") as file:
        values = file[RUN]["energy_error"][()]
        values[5] += 1.0
        file[RUN]["energy_error"][...] = values
        sealed_anew(file, RUN)
    (found,) = failed(judged(copy))
    assert (found.name, found.where.channel) == ("energies", "energy error")


def test_settings_and_steps_that_are_not_the_methods_are_found_behind_new_digests(copy: Path) -> None:
    with h5py.File(copy, "r+") as file:
        file[RUN].attrs["settings"] = '{"step": 0.001}'
        file[RUN].attrs["steps"] = 1
        sealed_anew(file, RUN)
    assert {one.name for one in failed(judged(copy))} == {"settings"}
    with h5py.File(copy, "r+") as file:
        file[RUN].attrs["settings"] = '{"absolute_tolerance": 1e-16, "relative_tolerance": 3e-14}'
        sealed_anew(file, RUN)
    assert {one.name for one in failed(judged(copy))} == {"steps"}


# What is refused: links, other files' arrays, claims


def outside(path: Path) -> Path:
    path.write_bytes(bytes(range(256)) * 64)
    return path


FOREIGN: dict[str, Callable[[h5py.Group, Path], object]] = {
    "an external link": lambda run, place: run.__setitem__("angles", h5py.ExternalLink(str(place), "/x")),
    "a soft link": lambda run, _: run.__setitem__("angles", h5py.SoftLink("/check/held/reference/angles")),
    "another file's bytes": lambda run, place: run.create_dataset(
        "angles", (151, 4), "f8", external=[(str(place), 0, 151 * 32)]
    ),
    "30 GB that are not there": lambda run, _: run.create_dataset("angles", (10**9, 4), "f8", chunks=(1000, 4)),
    "a group": lambda run, _: run.create_group("angles"),
    "a text": lambda run, _: run.create_dataset("angles", data="text"),
    "an array of nothing": lambda run, _: run.create_dataset("angles", data=h5py.Empty("f8")),
}


@pytest.mark.parametrize("kind", FOREIGN)
def test_what_is_not_an_array_of_the_file_is_refused(
    kind: str, copy: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    with h5py.File(copy, "r+") as file:
        del file[RUN]["angles"]
        FOREIGN[kind](file[RUN], outside(tmp_path / "outside.bin"))
    assert main(["report", str(copy), "-o", str(tmp_path / "report")]) == 2
    (line,) = capsys.readouterr().err.splitlines()
    assert str(copy) in line
    assert main(["check", str(copy)]) == 1
    assert any(f"check/held {METHOD}" in line for line in capsys.readouterr().out.splitlines())


def test_a_compressed_bomb_is_refused(copy: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    with h5py.File(copy, "r+") as file:
        del file[RUN]["angles"]
        file[RUN].create_dataset("angles", data=np.zeros((5_000_000, 4)), compression="gzip")
    assert main(["report", str(copy), "-o", str(tmp_path / "report")]) == 2
    assert "claims 1.6e+08 bytes" in capsys.readouterr().err


def test_a_group_that_holds_itself_ends(copy: Path, capsys: pytest.CaptureFixture[str]) -> None:
    with h5py.File(copy, "r+") as file:
        file["check/again"] = file["check"]
        file["check/once_more"] = file["/"]
    assert main(["check", str(copy)]) == 0
    assert "runs judged: 1 lagrange/dop853\n" in capsys.readouterr().out


# Sweeps


@pytest.fixture(scope="module")
def swept(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("sweep")
    (folder / "s.toml").write_text(
        'title = "three"\nscene = "paper/fig11"\nmethods = ["lagrange/dop853"]\n'
        'samples = 3\noutputs = ["angles", "rates"]\n[change]\nduration = 0.2\n'
        '[[axis]]\nkey = "gravity"\nvalues = [9.7, 9.8, 9.9]\n'
    )
    run_local(load_sweep(folder / "s.toml"), folder / "s.h5", workers=1)
    return folder / "s.h5"


@pytest.mark.parametrize("column", ["angles", "energy_drift_max", "status", "gravity", "time", "crc32"])
def test_a_changed_number_of_a_finished_sweep_is_found(
    column: str, swept: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    copy = Path(shutil.copy(swept, tmp_path / "s.h5"))
    assert main(["check", str(copy)]) == 0
    with h5py.File(copy, "r+") as file:
        values = file[column][()]
        values.view(np.uint8).reshape(-1)[0] ^= 1
        file[column][...] = values
    status = main(["check", str(copy)])
    out = capsys.readouterr()
    if column in ("gravity", "time"):
        assert status == 2
        assert f"{column} changed after the file was laid out" in out.err
    else:
        assert status == 1
        assert "1 runs changed after they were written" in out.out
        with pytest.raises(StoreError, match="runs 0 changed"):
            StoredSweep(copy)
        assert main(["report", str(copy), "-o", str(tmp_path / "report")]) == 2
        data = rm.SweepData(copy)
        for read in (partial(data.column, "time"), partial(data.at, "angles", 0), data.to_xarray):
            with pytest.raises(StoreError, match="runs 0 changed"):
                read()
