"""Files of this program that were forged, with a right digest and right checksums: every command
ends with one line, or says what it can; nothing is read that is larger than the file."""

from __future__ import annotations

import json
import shutil
import tracemalloc
from collections.abc import Callable
from pathlib import Path

import h5py
import numpy as np
import pytest
from support.commands import rotor_mbs
from support.forging import append_trailer, forged

import rotor_mbs as rm
from rotor_mbs.errors import RotorError, StoreError
from rotor_mbs.report.build import write_report
from rotor_mbs.runs.rows import checksums
from rotor_mbs.runs.table import TableFile
from rotor_mbs.runs.trailer import read_trailer

SCENE = "check/held"
RUN = f"{SCENE}/lagrange/dop853"
SAMPLES = rm.scene(SCENE).samples
NESTED = "[" * 10_000


def fill(group: str, name: str, value: object) -> Callable[[h5py.File], None]:
    """One value everywhere in an array."""
    return lambda file: file[group][name].__setitem__(..., value)


def say(group: str, name: str, value: object) -> Callable[[h5py.File], None]:
    """Another attribute; None: it is gone."""
    if value is None:
        return lambda file: file[group].attrs.__delitem__(name)
    return lambda file: file[group].attrs.__setitem__(name, value)


def everywhere(kind: str, value: object) -> Callable[[h5py.File], None]:
    """One value in every array of numbers of records."""

    def change(file: h5py.File) -> None:
        def note(_: str, item: object) -> None:
            if (
                isinstance(item, h5py.Dataset)
                and item.dtype.kind == "f"
                and item.dtype.itemsize == 8
            ):
                item[...] = value

        file[kind].visititems(note)

    return change


def empty_groups(file: h5py.File) -> None:
    for number in range(30_000):
        file.create_group(f"more/{number}")


def _of_modes(file: h5py.File) -> h5py.Group:
    return file["modes"][SCENE]["lagrange/rest"]


# By kind of file, what is changed in it; commands that read it are tried in turn.
FORGED: dict[str, tuple[str, Callable[[h5py.File], object]]] = {
    "settings null": ("results", fill("runs", "settings", "null")),
    "settings nested": ("results", fill("runs", "settings", NESTED)),
    "settings infinite": ("results", fill("runs", "settings", '{"step": 1e400}')),
    "versions nested": ("results", fill("runs", "versions", NESTED)),
    "versions a number": ("results", fill("runs", "versions", "3")),
    "scene nested": ("results", say(SCENE, "scene_toml", "a = " + NESTED)),
    "scene gone": ("results", say(SCENE, "scene_toml", None)),
    "scene of another": ("results", say(SCENE, "scene_toml", rm.scene("paper/fig03").text)),
    "title a number": ("results", say(SCENE, "title", 5.0)),
    "no settings": ("results", lambda file: file["runs"].__delitem__("settings")),
    "a method that is none": ("results", fill("runs", "method_name", "none")),
    "labels twice": ("results", fill("runs", "run", "one")),
    "texts in place of times": (
        "results",
        lambda file: _replace(file, SCENE, "time", ["a"] * SAMPLES),
    ),
    "times nan": ("results", fill(SCENE, "time", np.nan)),
    "times huge": (
        "results",
        lambda file: _replace(file, SCENE, "time", np.linspace(0.0, 1e300, SAMPLES)),
    ),
    "coordinates": ("results", fill(SCENE, "coordinate", -1)),
    "angles huge": ("results", fill(SCENE, "angles", 1e308)),
    "energies infinite": ("results", fill(SCENE, "energy_error", np.inf)),
    "samples": ("results", fill("runs", "samples", 10**15)),
    "samples negative": ("results", fill("runs", "samples", -5)),
    "status": ("results", fill("runs", "status", 99)),
    "repeated status": ("results", fill(SCENE, "status", 77)),
    "steps": ("results", fill("runs", "steps", -(2**63))),
    "metrics huge": ("results", fill("runs", "angle_error_max", 1e308)),
    "times of runs": ("results", fill("runs", "run_time_s", -np.inf)),
    "thousands of groups": ("results", empty_groups),
    "method 99": ("s", fill("/", "method_code", 99)),
    "methods a number": ("s", say("/", "methods", -1)),
    "no methods": ("s", say("/", "methods", None)),
    "a method of a sweep that is none": ("s", say("/", "methods", ["none"])),
    "shape null": ("s", say("/", "shape", "null")),
    "shape nested": ("s", say("/", "shape", NESTED)),
    "settings of a sweep": ("s", say("/", "settings", "ééé")),
    "keys": ("s", say("/", "parameter_keys", ["bearing.stiffness"])),
    "title gone": ("s", say("/", "title", None)),
    "base scene": ("s", say("/", "scene_toml", "x")),
    "run numbers": ("s", fill("/", "run", -(2**63))),
    "status of a sweep": ("s", fill("/", "status", -128)),
    "parameters infinite": ("s", fill("/", "gravity", np.inf)),
    "angles of a sweep": ("s", fill("/", "angles", 1e308)),
    "times of a sweep": ("s", fill("/", "time", np.nan)),
    "modes infinite": ("modes", everywhere("modes", np.inf)),
    "modes huge": ("modes", everywhere("modes", 1e308)),
    "modes nan": ("modes", everywhere("modes", np.nan)),
    "labels a number": (
        "modes",
        lambda file: _of_modes(file).attrs.__setitem__("mode_labels", 1e308),
    ),
    "labels fewer": ("modes", lambda file: _of_modes(file).attrs.__setitem__("mode_labels", ["a"])),
    "gravity a list": ("modes", lambda file: _of_modes(file).attrs.__setitem__("gravity", ["a"])),
    "no frequencies": ("modes", lambda file: _of_modes(file).__delitem__("eigenvalue_imag")),
    "comparison huge": ("comparison", everywhere("comparison", 1e308)),
    "comparison nan": ("comparison", everywhere("comparison", np.nan)),
    "verdict nested": ("comparison", say(f"comparison/{SCENE}/data/trajectory", "verdict", NESTED)),
    "verdict empty": ("comparison", say(f"comparison/{SCENE}/data/trajectory", "verdict", "{}")),
}
_QUICK = {"versions nested", "times nan", "method 99", "modes infinite", "comparison huge"}


def _replace(file: h5py.File, group: str, name: str, values: object) -> None:
    attributes = dict(file[group][name].attrs)
    del file[group][name]
    dataset = file[group].create_dataset(name, data=values)
    dataset.attrs["units"], dataset.attrs["long_name"] = (
        attributes["units"],
        attributes["long_name"],
    )


def with_right_checksums(path: Path) -> None:
    """Give every row the checksum of what it holds, where the file can be read at all."""
    try:
        file = TableFile(path)
    except StoreError:
        return
    for group, table in file.tables.items():
        for number, run in enumerate(table.runs if "crc32" in table.computed else ()):
            place = file.place(str(run), group) if group else table.place(number)
            with path.open("r+b") as stream:
                stream.seek(place.offsets["crc32"])
                stream.write(checksums(place.first, place.read(), place.row_type).tobytes())


def read_in_every_way(path: Path, kind: str, files: Path) -> list[str]:
    """What each command says: "" where it ended well."""
    said = []
    commands: list[list[object]] = [["check", path], ["show", path], ["show", path, "--json"]]
    if kind == "results":
        commands += [
            ["animate", SCENE, path, "-o", path.with_name("a.webp")],
            ["figures", path, "-o", path.parent],
        ]
        commands += [["run", SCENE, "-m", "lagrange/dop853", "-j", "1", "-o", path]]
    if kind == "s":
        commands += [["sweep", files / "s.toml", "-j", "1", "-o", path]]
    calls: list[Callable[[], object]] = [
        lambda: write_report(path, path.with_name("pages")), lambda: repr(rm.open(path)),
    ]  # fmt: skip
    if kind in ("results", "s"):
        calls += [lambda: rm.open(path).statuses, lambda: [*rm.open(path).values()]]
    for call in calls:
        try:
            call()
            said.append("")
        except RotorError as exc:
            said.append(str(exc))
    for words in commands:
        ended = rotor_mbs(*words)
        assert ended.status in (0, 1, 2), ended
        assert "Warning" not in ended.err
        said.append(ended.err.strip() if ended.status == 2 else "")
    return said


@pytest.mark.parametrize(
    "name", [pytest.param(one, marks=() if one in _QUICK else pytest.mark.full) for one in FORGED]
)
@pytest.mark.filterwarnings("error")
def test_a_forged_file_is_a_line(name: str, files: Path, tmp_path: Path) -> None:
    kind, change = FORGED[name]
    path = Path(shutil.copy(files / f"{kind}.h5", tmp_path / "forged.h5"))
    with forged(path) as file:
        change(file)
    with_right_checksums(path)
    for line in read_in_every_way(path, kind, files):
        assert "\n" not in line


# What the file is made of


def test_a_group_that_is_not_there_is_a_line(files: Path, tmp_path: Path) -> None:
    path = Path(shutil.copy(files / "results.h5", tmp_path / "forged.h5"))
    known = read_trailer(path)
    with h5py.File(path, "r+") as file:
        file.move(SCENE, "check/other")
    append_trailer(path, known.kind, known.groups)
    before = path.read_bytes()
    for line in read_in_every_way(path, "results", files):
        assert str(path) in line
        assert "\n" not in line
    assert path.read_bytes() == before


TRAILERS = [
    NESTED,
    "null",
    "3",
    '{"format_version": 3}',
    '{"format_version": 3, "kind": "results", "groups": [1]}',
    '{"format_version": 3, "kind": ["results"], "groups": {}}',
    '{"format_version": 3, "kind": "results", "groups": {"runs": {"status": [-5, 10]}}}',
    '{"format_version": 3, "kind": "results", "groups": {"runs": {"status": ["a", 1e400]}}}',
    '{"format_version": 3, "kind": "results", "groups": {"no/group": {}}}',
    json.dumps(
        {
            "format_version": 3,
            "kind": "results",
            "groups": {f"check/{i}": {} for i in range(30_000)},
        }
    ),
]
_QUICK_TRAILERS = (0, 4, 6)  # no text of ours, of another structure, with regions that are none


@pytest.mark.parametrize(
    "text",
    [
        pytest.param(text, marks=() if i in _QUICK_TRAILERS else pytest.mark.full)
        for i, text in enumerate(TRAILERS)
    ],
    ids=range(len(TRAILERS)),
)
def test_a_trailer_of_other_text_is_a_line(text: str, files: Path, tmp_path: Path) -> None:
    path = Path(shutil.copy(files / "results.h5", tmp_path / "forged.h5"))
    with h5py.File(path, "r+"):  # cuts the trailer off
        pass
    content = path.read_bytes()
    try:
        said = json.loads(text)
        append_trailer(path, said["kind"], said["groups"])
        trailer = path.read_bytes()[len(content) :]
        assert len(trailer) > 48
    except (ValueError, TypeError, KeyError, AttributeError, RecursionError):
        path.write_bytes(
            content + text.encode() + len(text).to_bytes(8, "little") + bytes(32) + b"rmbs-end"
        )
    run = ["run", SCENE, "-m", "lagrange/dop853", "-j", "1", "-o", path]
    for line in (*read_in_every_way(path, "modes", files), rotor_mbs(*run).err.strip()):
        assert str(path) in line
        assert "\n" not in line


def test_texts_are_bounded_before_they_are_read(files: Path, tmp_path: Path) -> None:
    """Sixty million empty texts in a compressed array of 250 kB; references to one text of a
    megabyte."""
    path = Path(shutil.copy(files / "results.h5", tmp_path / "forged.h5"))
    with forged(path) as file:
        group = file["runs"]
        del group["scene_hash"]
        column = group.create_dataset(
            "scene_hash", (60_000_000,), h5py.string_dtype(), chunks=(1 << 20,), compression=9
        )
        column.attrs["units"], column.attrs["long_name"] = "1", "texts"
    tracemalloc.start()
    assert "is not contiguous" in rotor_mbs("check", path).err
    shutil.copy(files / "results.h5", path)
    with forged(path) as file:
        _replace(file, "runs", "scene_hash", ["x" * 1_000_000] * 2)
        column = file["runs/scene_hash"]
        assert column.id.get_offset() is not None
    del column
    with h5py.File(path) as file:
        offset = file["runs/scene_hash"].id.get_offset()
    content = bytearray(path.read_bytes())
    # a length that the file does not have
    content[offset : offset + 4] = (2**31).to_bytes(4, "little")
    known = read_trailer(path)
    path.write_bytes(content)
    with h5py.File(path, "r+"):
        pass
    append_trailer(path, known.kind, known.groups)
    assert "claims more text than the file has" in rotor_mbs("check", path).err
    # bytes; the texts would take 480 MB, and 2 GB
    assert tracemalloc.get_traced_memory()[1] < 100e6
    tracemalloc.stop()


def test_a_file_that_another_one_replaces_is_told(files: Path, tmp_path: Path) -> None:
    path = Path(shutil.copy(files / "results.h5", tmp_path / "x.h5"))

    def replace_by(kind: str) -> None:
        Path(shutil.copy(files / f"{kind}.h5", tmp_path / "y.h5")).replace(path)

    runs = rm.open(path)
    for kind in ("s", "modes"):
        replace_by(kind)
        with pytest.raises(StoreError, match="has no check/held/lagrange/dop853 any more"):
            _ = runs[RUN]
    replace_by("s")
    swept = rm.open(path)
    replace_by("results")
    with pytest.raises(StoreError, match="has been replaced by another file"):
        swept.column("angles")
