"""Whatever changes in a file after it was written is found, and is a line: in runs, in sweeps, in files not of ours."""

from __future__ import annotations

import json
import re
import shutil
import zlib
from collections.abc import Callable
from functools import partial
from itertools import islice
from pathlib import Path

import h5py
import numpy as np
import pytest
from support.checking import failed, judged, results_file
from support.commands import refusal, rotor_mbs
from support.stored import change_byte, change_row, damage
from support.sweeps import THREE_RUNS, made_sweep

import rotor_mbs as rm
from rotor_mbs.errors import StoreError
from rotor_mbs.runs import table
from rotor_mbs.runs.read import open_results
from rotor_mbs.runs.sweeps import StoredSweep
from rotor_mbs.runs.table import Rows, TableFile

METHOD = "lagrange/dop853"
SCENE = "check/held"
RUN = f"{SCENE}/{METHOD}"


@pytest.fixture(scope="module")
def written(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return results_file(tmp_path_factory.mktemp("digests") / "good.h5", [SCENE], [METHOD])


@pytest.fixture
def copy(written: Path, tmp_path: Path) -> Path:
    return Path(shutil.copy(written, tmp_path / "results.h5"))


@pytest.fixture(scope="module")
def swept(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return made_sweep(tmp_path_factory.mktemp("sweep"), THREE_RUNS)


def reseal(group: h5py.Group) -> None:
    """Gives a group the digests of what it holds now, as someone who changes a file on purpose could."""
    known = table.stored_digests(group)
    later = [name for name in group if f"attributes of {name}" in known]
    del group.attrs[table.DIGESTS]
    table.seal(group, later=later)


def describe_as(column: h5py.Dataset, attributes: dict[str, object]) -> None:
    for name in ("units", "long_name"):
        column.attrs[name] = attributes[name]


def reshape(group: h5py.Group, name: str, shape: tuple[int, ...]) -> None:
    """Puts zeros of another shape in the place of a column; digests do not cover the shape of computed columns."""
    attributes, kind = dict(group[name].attrs), group[name].dtype
    del group[name]
    describe_as(group.create_dataset(name, data=np.zeros(shape, kind)), attributes)
    reseal(group)


def test_checksums_are_as_the_documentation_says(written: Path, swept: Path) -> None:
    """Computed with h5py and zlib alone, as the page of the file format describes it."""

    def computed(group: h5py.Group) -> list[h5py.Dataset]:
        digests = json.loads(group.attrs["digests"])
        return [group[name] for name in group if name != "crc32" and f"attributes of {name}" in digests]

    def is_of_runs(column: h5py.Dataset) -> bool:
        return column.dims[0][0].name.endswith("/run")

    with h5py.File(written) as file:
        runs, scene = file["runs"], file[SCENE]
        labels = scene["run"].asstr()[:].tolist()
        assert labels == ["reference", METHOD]
        for row, label in enumerate(runs["run"].asstr()[:]):
            checksum, index = row, labels.index(label.removeprefix(f"{SCENE}/"))
            for column in computed(runs):
                checksum = zlib.crc32(column[row].tobytes(), checksum)
            for column in filter(is_of_runs, computed(scene)):
                checksum = zlib.crc32(column[index].tobytes(), checksum)
            if label.endswith("/reference"):
                for column in computed(scene):
                    if not is_of_runs(column):
                        checksum = zlib.crc32(column[()].tobytes(), checksum)
            assert checksum == runs["crc32"][row]
    with h5py.File(swept) as file:
        for row, checksum in enumerate(file["run"][:].tolist()):
            for column in computed(file):
                checksum = zlib.crc32(column[row].tobytes(), checksum)
            assert checksum == file["crc32"][row]


def test_the_last_bit_of_every_column_of_a_run_is_found(copy: Path) -> None:
    place = TableFile(copy).place(RUN)
    columns = place.row_type.names or ()
    assert {"angles", "rates", "tip", "kinetic_energy", "energy_error", "energy_drift_max", "message"} <= {*columns}
    for column in columns:
        change_byte(place, column)
        assert not place.is_stored, column
        change_byte(place, column)  # the same bit again: as before
    with open_results(copy) as results:
        assert not any(run.is_damaged for run in results.scenes[SCENE].runs.values())


def test_a_damaged_run_is_neither_reported_nor_read(copy: Path, tmp_path: Path) -> None:
    damage(copy, RUN, "angles")
    assert f"{RUN} changed after it was written" in refusal("report", copy, "-o", tmp_path / "report")
    with pytest.raises(StoreError, match=f"{RUN} changed after it was written"):
        _ = rm.open(copy)[RUN]


LAID_OUT: dict[str, Callable[[h5py.File], object]] = {
    "a setting": lambda file: file["runs/settings"].__setitem__(1, "{}"),
    "a time": lambda file: file[SCENE]["time"].__setitem__(1, 0.5),
    "a unit": lambda file: file[SCENE]["angles"].attrs.modify("units", "deg"),
    "a title": lambda file: file[SCENE].attrs.modify("title", "another"),
    "the version of a library": lambda file: file.attrs.modify("numpy", "0.0"),
    "no digests": lambda file: file[SCENE].attrs.__delitem__("digests"),
    "an array more": lambda file: file[SCENE].create_dataset("more", data=np.zeros(3)),
    "an array less": lambda file: file[SCENE].__delitem__("energy_error"),
}


@pytest.mark.parametrize("change", LAID_OUT)
def test_a_change_of_what_was_laid_out_is_refused_in_one_line(change: str, copy: Path) -> None:
    with h5py.File(copy, "r+") as file:
        LAID_OUT[change](file)
    before = copy.read_bytes()
    for words in (["check", copy], ["run", SCENE, "-m", METHOD, "-o", copy, "-j", "1"]):
        assert "changed after the file was laid out" in refusal(*words)
        assert copy.read_bytes() == before


# By the check that finds it: a run, and a change in it that has the right checksum. With a growth of 1e6 at the second
# sample nothing is compared any more, and a wrong run could be called ok.
EDITS: dict[str, tuple[str, Callable[[Rows], object]]] = {
    "growth": (f"{SCENE}/reference", lambda row: row["error_growth"].__setitem__(1, 1e6)),
    "energies": (RUN, lambda row: row["energy_error"].__setitem__(5, row["energy_error"][5] + 1.0)),
}


@pytest.mark.parametrize("check", EDITS)
def test_an_edit_behind_a_right_checksum_is_found(check: str, copy: Path) -> None:
    change_row(copy, *EDITS[check])
    names = {failure.name for failure in failed(judged(copy))}
    assert check in names
    assert "integrity" not in names


def test_settings_that_are_not_the_methods_are_found(copy: Path) -> None:
    with h5py.File(copy, "r+") as file:
        file["runs/settings"][1] = '{"step": 0.001}'
        reseal(file["runs"])
    assert "settings" in {check.name for check in failed(judged(copy))}


FOREIGN: dict[str, Callable[[h5py.Group, Path], object]] = {
    "an external link": lambda scene, place: scene.__setitem__("angles", h5py.ExternalLink(str(place), "/x")),
    "a soft link": lambda scene, _: scene.__setitem__("angles", h5py.SoftLink(f"/{SCENE}/rates")),
    "another file's bytes": lambda scene, place: scene.create_dataset(
        "angles", (2, 151, 4), "f8", external=[(str(place), 0, 2 * 151 * 32)]
    ),
    "30 GB that are not there": lambda scene, _: scene.create_dataset("angles", (10**9, 4), "f8", chunks=(1000, 4)),
    "a group": lambda scene, _: scene.create_group("angles"),
    "a text": lambda scene, _: scene.create_dataset("angles", data="text"),
    "an array of nothing": lambda scene, _: scene.create_dataset("angles", data=h5py.Empty("f8")),
}


@pytest.mark.parametrize("kind", FOREIGN)
def test_what_is_not_an_array_of_the_file_is_refused(kind: str, copy: Path, tmp_path: Path) -> None:
    """With right digests, but where a link leads out of the file or there is no array to describe."""
    (tmp_path / "outside.bin").write_bytes(bytes(range(256)) * 64)
    with h5py.File(copy, "r+") as file:
        scene = file[SCENE]
        attributes = dict(scene["angles"].attrs)
        del scene["angles"]
        FOREIGN[kind](scene, tmp_path / "outside.bin")
        if kind not in ("an external link", "a group"):
            describe_as(scene["angles"], attributes)
            reseal(scene)
    assert str(copy) in refusal("report", copy, "-o", tmp_path / "report")
    assert rotor_mbs("check", copy).status in (1, 2)


@pytest.mark.parametrize(
    ("group", "name", "shape"),
    [
        (SCENE, "angles", (0, 3)), (SCENE, "time", (2, 2)), ("runs", "samples", ()), ("runs", "status", (1,)),
        ("/", "status", (0,)), ("/", "angles", (0, 3)), ("/", "crc32", ()),
    ],
)  # fmt: skip
def test_a_column_of_another_shape_is_a_line(
    group: str, name: str, shape: tuple[int, ...], copy: Path, swept: Path, tmp_path: Path
) -> None:
    path = Path(shutil.copy(swept, tmp_path / "s.h5")) if group == "/" else copy
    with h5py.File(path, "r+") as file:
        reshape(file[group], name, shape)
    before = path.read_bytes()
    for command in (["check", path], ["report", path, "-o", tmp_path / "pages"]):
        assert rotor_mbs(*command).status in (1, 2)
    if group == "/":
        assert str(path) in refusal("sweep", swept.with_name("s.toml"), "-o", path, "-j", "1")
    assert path.read_bytes() == before


def test_a_group_that_holds_itself_ends(copy: Path) -> None:
    with h5py.File(copy, "r+") as file:
        file["check/again"] = file["check"]
        file["check/once_more"] = file["/"]
    assert str(copy) in refusal("check", copy)


def test_files_that_are_not_ours_are_refused_with_one_line(
    written: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    (tmp_path / "cut.h5").write_bytes(written.read_bytes()[:3000])
    (tmp_path / "text.h5").write_text("no HDF5")
    with h5py.File(tmp_path / "other.h5", "w") as file:
        file["x"] = 1
    with h5py.File(tmp_path / "newer.h5", "w") as file:
        file.attrs["format"], file.attrs["format_version"] = "rotor_mbs", 99
    for name in ("cut.h5", "text.h5", "other.h5", "newer.h5", "missing.h5", "."):
        with pytest.raises(StoreError) as caught, open_results(tmp_path / name):
            pass
        assert "\n" not in str(caught.value)
        assert str(tmp_path) in str(caught.value)

    def refuse(*_: object) -> None:
        raise PermissionError(13, "Permission denied")

    monkeypatch.setattr(Path, "open", refuse)
    with pytest.raises(StoreError, match="cannot be read: Permission denied"), table.open_file(written):
        pass


def test_an_attribute_that_became_a_list_is_not_read(copy: Path) -> None:
    """One bit makes a list of a text, at which the HDF5 library ends the process that reads it."""
    content, refused = copy.read_bytes(), 0
    for found in islice(re.finditer(rb"\x19\x01", content), 0, None, 5):
        copy.write_bytes(content[: found.start()] + b"\x19\x00" + content[found.end() :])
        try:
            with open_results(copy) as results:
                _ = [run.attributes for scene in results.scenes.values() for run in scene.runs.values()]
        except StoreError:
            refused += 1
    assert refused > 10


# Sweeps


@pytest.mark.parametrize("column", ["angles", "energy_drift_max", "status", "gravity", "time", "crc32"])
def test_a_changed_number_of_a_finished_sweep_is_found(column: str, swept: Path, tmp_path: Path) -> None:
    copy = Path(shutil.copy(swept, tmp_path / "s.h5"))
    with h5py.File(copy, "r+") as file:
        values = file[column][()]
        values.view(np.uint8).reshape(-1)[0] ^= 1
        file[column][...] = values
    if column in ("gravity", "time"):
        assert f"{column} changed after the file was laid out" in refusal("check", copy)
        return
    ended = rotor_mbs("check", copy)
    assert ended.status == 1
    assert "1 runs changed after they were written" in ended.out
    with pytest.raises(StoreError, match="runs 0 changed"):
        StoredSweep(copy)
    assert "runs 0 changed" in refusal("report", copy, "-o", tmp_path / "report")
    for read in (partial(rm.Runs.column, name="time"), partial(rm.Runs.at, name="angles", sample=0), rm.Runs.to_xarray):
        with pytest.raises(StoreError, match="runs 0 changed"):
            read(rm.open(copy))
