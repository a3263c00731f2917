"""Whatever changes in a file after it was written is found, and is a line: in runs, in sweeps, in
files not of ours."""

from __future__ import annotations

import json
import re
import shutil
import zlib
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from functools import partial
from itertools import islice
from pathlib import Path

import h5py
import numpy as np
import pytest
from support.checking import failed, judged, results_file
from support.commands import refusal, rotor_mbs
from support.forging import append_trailer, forged
from support.stored import change_byte, change_row, damage
from support.sweeps import THREE_RUNS, made_sweep

import rotor_mbs as rm
from rotor_mbs.errors import StoreError
from rotor_mbs.runs import hdf5, trailer
from rotor_mbs.runs.output_files import locked
from rotor_mbs.runs.read import open_results
from rotor_mbs.runs.rows import Rows
from rotor_mbs.runs.sweeps import StoredSweep
from rotor_mbs.runs.table import TableFile
from rotor_mbs.runs.trailer import read_trailer

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


def describe_as(column: h5py.Dataset, attributes: dict[str, object]) -> None:
    for name in ("units", "long_name"):
        column.attrs[name] = attributes[name]


def reshape(path: Path, group: str, name: str, shape: tuple[int, ...]) -> None:
    """Put zeros of another shape in the place of a column."""
    with forged(path) as file:
        attributes, kind = dict(file[group][name].attrs), file[group][name].dtype
        del file[group][name]
        describe_as(file[group].create_dataset(name, data=np.zeros(shape, kind)), attributes)


def test_checksums_are_as_the_documentation_says(written: Path, swept: Path) -> None:
    """Computed with h5py and zlib alone, as the page of the file format describes it."""

    def computed(group: h5py.Group) -> list[h5py.Dataset]:
        content = Path(group.file.filename).read_bytes()
        length = int.from_bytes(content[-48:-40], "little")
        groups = json.loads(content[-48 - length : -48])["groups"]
        return [group[name] for name in groups[group.name.strip("/")] if name != "crc32"]

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
    assert {
        "angles",
        "rates",
        "tip",
        "kinetic_energy",
        "energy_error",
        "energy_drift_max",
        "message",
    } <= {*columns}
    for column in columns:
        change_byte(place, column)
        assert not place.is_stored, column
        change_byte(place, column)  # the same bit again: as before
    with open_results(copy) as results:
        assert not any(run.is_damaged for run in results.scenes[SCENE].runs.values())


def test_a_damaged_run_is_neither_reported_nor_read(copy: Path, tmp_path: Path) -> None:
    damage(copy, RUN, "angles")
    assert f"{RUN} changed after it was written" in refusal(
        "report", copy, "-o", tmp_path / "report"
    )
    with pytest.raises(StoreError, match=f"{RUN} changed after it was written"):
        _ = rm.open(copy)[RUN]


LAID_OUT: dict[str, Callable[[h5py.File], object]] = {
    "a setting": lambda file: file["runs/settings"].__setitem__(1, "{}"),
    "a time": lambda file: file[SCENE]["time"].__setitem__(1, 0.5),
    "a unit": lambda file: file[SCENE]["angles"].attrs.modify("units", "deg"),
    "a title": lambda file: file[SCENE].attrs.modify("title", "another"),
    "the version of a library": lambda file: file.attrs.modify("numpy", "0.0"),
    "an array more": lambda file: file[SCENE].create_dataset("more", data=np.zeros(3)),
    "an array less": lambda file: file[SCENE].__delitem__("energy_error"),
    "a status": lambda file: file["runs/status"].__setitem__(1, 3),
    "nothing": lambda _: None,
}


@pytest.mark.parametrize("change", LAID_OUT)
def test_a_change_by_another_program_is_refused_in_one_line(change: str, copy: Path) -> None:
    with h5py.File(copy, "r+") as file:
        LAID_OUT[change](file)
    before = copy.read_bytes()
    for words in (["check", copy], ["run", SCENE, "-m", METHOD, "-o", copy, "-j", "1"]):
        assert "another program has written to it" in refusal(*words)
        assert copy.read_bytes() == before


def test_what_became_of_a_file_is_told_apart(copy: Path, tmp_path: Path) -> None:
    whole = copy.read_bytes()
    with h5py.File(tmp_path / "foreign.h5", "w") as file:
        file["time"] = [0.0, 1.0]
    with h5py.File(tmp_path / "earlier.h5", "w") as file:
        file.attrs["format"], file.attrs["format_version"] = "rotor_mbs", 2
    told: dict[str, bytes] = {
        "its digest does not match": whole[:3000] + bytes([whole[3000] ^ 1]) + whole[3001:],
        "cut off: ": whole[: len(whole) // 2],
        "cut off, or another program has written to it": whole[:-1],
        "not an HDF5 file": b"time [s],rotor [rad]\n" * 10,
        "not a file of this program": (tmp_path / "foreign.h5").read_bytes(),
        "of an earlier format": (tmp_path / "earlier.h5").read_bytes(),
    }
    for words, content in told.items():
        copy.write_bytes(content)
        assert words in refusal("check", copy), words
    layout = tmp_path / ".results.h5.12345.tmp"
    layout.write_bytes(whole[: len(whole) // 2])
    assert "a layout that was interrupted" in refusal("check", layout)


def test_a_file_that_is_being_filled_is_told_from_a_damaged_one(copy: Path) -> None:
    TableFile(copy).place(RUN).mark_missing([0])
    ended = rotor_mbs("check", copy)
    assert ended.status == 1
    assert "1 runs missing; the command that wrote the file computes them\n" in ended.out
    with ThreadPoolExecutor(1) as other, locked(copy):
        assert (
            "another process is writing it" in other.submit(rotor_mbs, "check", copy).result().out
        )


@pytest.mark.parametrize("offset", [0, 8, 40, 100, -1, -9, -41, -60])
def test_a_flipped_bit_outside_the_rows_is_refused_before_hdf5_sees_it(
    offset: int, copy: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    content = bytearray(copy.read_bytes())
    content[offset] ^= 4
    copy.write_bytes(content)
    monkeypatch.setattr(hdf5.h5py, "File", None)
    assert str(copy) in refusal("check", copy)


def test_a_newer_format_is_named(copy: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    known = read_trailer(copy)
    with h5py.File(copy, "r+"):  # cuts the trailer off
        pass
    with monkeypatch.context() as newer:
        newer.setattr(trailer, "FORMAT_VERSION", 99)
        append_trailer(copy, known.kind, known.groups)
    assert "format_version 99, this program reads 3" in refusal("check", copy)


# By the check that finds it: a run, and a change in it that has the right checksum. With a growth
# of 1e6 at the second sample nothing is compared any more, and a wrong run could be called ok.
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
    with forged(copy) as file:
        file["runs/settings"][1] = '{"step": 0.001}'
    assert "settings" in {check.name for check in failed(judged(copy))}


FOREIGN: dict[str, Callable[[h5py.Group, Path], object]] = {
    "an external link": lambda scene, place: scene.__setitem__(
        "angles", h5py.ExternalLink(str(place), "/x")
    ),
    "a soft link": lambda scene, _: scene.__setitem__("angles", h5py.SoftLink(f"/{SCENE}/rates")),
    "another file's bytes": lambda scene, place: scene.create_dataset(
        "angles", (2, 151, 4), "f8", external=[(str(place), 0, 2 * 151 * 32)]
    ),
    "30 GB that are not there": lambda scene, _: scene.create_dataset(
        "angles", (10**9, 4), "f8", chunks=(1000, 4)
    ),
    "a group": lambda scene, _: scene.create_group("angles"),
    "a text": lambda scene, _: scene.create_dataset("angles", data="text"),
    "an array of nothing": lambda scene, _: scene.create_dataset("angles", data=h5py.Empty("f8")),
}


@pytest.mark.parametrize("kind", FOREIGN)
def test_what_is_not_an_array_of_the_file_is_refused(kind: str, copy: Path, tmp_path: Path) -> None:
    (tmp_path / "outside.bin").write_bytes(bytes(range(256)) * 64)
    with forged(copy) as file:
        scene = file[SCENE]
        attributes = dict(scene["angles"].attrs)
        del scene["angles"]
        FOREIGN[kind](scene, tmp_path / "outside.bin")
        if kind not in ("an external link", "a group"):
            describe_as(scene["angles"], attributes)
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
    reshape(path, group, name, shape)
    before = path.read_bytes()
    for command in (["check", path], ["report", path, "-o", tmp_path / "pages"]):
        assert rotor_mbs(*command).status in (1, 2)
    if group == "/":
        assert str(path) in refusal("sweep", swept.with_name("s.toml"), "-o", path, "-j", "1")
    assert path.read_bytes() == before


def test_a_group_of_two_names_is_read_once(copy: Path) -> None:
    with forged(copy) as file:
        file["check/again"] = file["check"]
        file["check/once_more"] = file["/"]
    assert rotor_mbs("check", copy).status == 0


def test_files_that_are_not_ours_are_refused_with_one_line(
    written: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    (tmp_path / "cut.h5").write_bytes(written.read_bytes()[:3000])
    (tmp_path / "text.h5").write_text("no HDF5")
    with h5py.File(tmp_path / "other.h5", "w") as file:
        file["x"] = 1
    for name in ("cut.h5", "text.h5", "other.h5", "missing.h5", "."):
        with pytest.raises(StoreError) as caught, open_results(tmp_path / name):
            pass
        assert "\n" not in str(caught.value)
        assert str(tmp_path) in str(caught.value)

    def refuse(*_: object) -> None:
        raise PermissionError(13, "Permission denied")

    monkeypatch.setattr(Path, "open", refuse)
    with (
        pytest.raises(StoreError, match="cannot be read: Permission denied"),
        hdf5.open_file(written),
    ):
        pass


def test_an_attribute_that_became_a_list_is_not_read(copy: Path) -> None:
    """One bit makes a list of a text, at which the HDF5 library ends the process that reads it: of
    forged files."""
    known, refused = read_trailer(copy), 0
    with h5py.File(copy, "r+"):  # cuts the trailer off
        pass
    content = copy.read_bytes()
    for found in islice(re.finditer(rb"\x19\x01", content), 0, None, 5):
        copy.write_bytes(content[: found.start()] + b"\x19\x00" + content[found.end() :])
        append_trailer(copy, known.kind, known.groups)
        try:
            with open_results(copy) as results:
                _ = [
                    run.attributes
                    for scene in results.scenes.values()
                    for run in scene.runs.values()
                ]
        except StoreError:
            refused += 1
    assert refused > 10


# Sweeps


@pytest.mark.parametrize(
    "column", ["angles", "energy_drift_max", "status", "gravity", "time", "crc32"]
)
def test_a_changed_number_of_a_finished_sweep_is_found(
    column: str, swept: Path, tmp_path: Path
) -> None:
    copy = Path(shutil.copy(swept, tmp_path / "s.h5"))
    with h5py.File(copy) as file:
        place = file[column].id.get_offset()
    content = bytearray(copy.read_bytes())
    content[place] ^= 1
    copy.write_bytes(content)
    if column in ("gravity", "time"):
        assert "its digest does not match" in refusal("check", copy)
        return
    ended = rotor_mbs("check", copy)
    assert ended.status == 1
    assert "1 runs changed after they were written" in ended.out
    with pytest.raises(StoreError, match="runs 0 changed"):
        StoredSweep(copy)
    assert "runs 0 changed" in refusal("report", copy, "-o", tmp_path / "report")
    for read in (
        partial(rm.Results.column, name="time"),
        partial(rm.Results.at, name="angles", sample=0),
        rm.Results.to_xarray,
    ):
        with pytest.raises(StoreError, match="runs 0 changed"):
            read(rm.open(copy))
