"""Files of other programs that are made to harm: each ends in one line, in bounded time and memory.

The files are small, and what they claim is large. That time is bounded is shown by inputs on which
an expression that is not linear takes hours, beside the reading process's own limit, whose message
is another one.
"""

from __future__ import annotations

import io
import json
import struct
import zipfile
import zlib
from collections.abc import Callable
from pathlib import Path
from typing import Any

import h5py
import numpy as np
import pytest
import scipy.io
from support.data_files import FORMATS
from support.scenes import paper

import rotor_mbs as rm
from rotor_mbs.comparison import files
from rotor_mbs.comparison.channels import channel_from_name, channels, mode_channels
from rotor_mbs.comparison.columns import MAX_NAME, split_bracketed_unit, table_of
from rotor_mbs.comparison.data import load_data
from rotor_mbs.errors import InputError

SCENE = paper("fig08")
TIME = np.linspace(0.0, 10.0, 201)
ROWS = "0,1\n1,2\n2,3\n"
GIGABYTES = 3 * 2**30


def refusal_of(path: Path) -> str:
    """Return the one line in which a file is refused."""
    with pytest.raises(InputError) as caught:
        load_data(path, SCENE)
    (line,) = caught.value.problems
    assert str(path) in line
    assert "\n" not in line
    assert "cannot be read within" not in line, "the time limit ended it"
    return line


@pytest.mark.parametrize(
    "mark",
    [
        "[",
        " /",
        *(
            pytest.param(mark, marks=pytest.mark.full)
            for mark in ("(", " ", "[1,", "/ ", "a [", "[]", "1", "_", "{", '"')
        ),
    ],
)
def test_a_header_of_marks_takes_time_in_proportion_to_its_length(
    tmp_path: Path, mark: str
) -> None:
    """200,000 marks: 4e10 steps where they are compared with each other, some hours."""
    header = mark * (200_000 // len(mark))
    (tmp_path / "data.csv").write_text(f"{header},b\n{ROWS}")
    refusal_of(tmp_path / "data.csv")
    (tmp_path / "data.txt").write_text(f"{header} b\n{ROWS.replace(',', ' ')}")
    refusal_of(tmp_path / "data.txt")


def test_a_comment_of_unfinished_lists_takes_time_in_proportion_to_its_length(
    tmp_path: Path,
) -> None:
    """200,000 lists that Exudyn's head could begin: 4e11 steps if each is read to the end."""
    comments = "#Exudyn\n" + "# written coordinates [\n" * 200_000
    (tmp_path / "data.txt").write_text(f"{comments}{ROWS.replace(',', ' ')}")
    refusal_of(tmp_path / "data.txt")


def test_long_names_are_cut_and_stay_distinct(tmp_path: Path) -> None:
    """The csv module's own limit is 131,072 characters."""
    long = "n" * 200_000
    (tmp_path / "data.csv").write_text(f"time,rotor,{long}1,{long}2\n0,1,5,6\n1,2,5,6\n2,3,5,6\n")
    data = load_data(tmp_path / "data.csv", SCENE)
    assert data.columns == [0]
    assert list(data.unused) == [f"{long[:MAX_NAME]}... (column {number})" for number in (3, 4)]


@pytest.mark.full
def test_a_comparison_with_long_names_is_stored(tmp_path: Path) -> None:
    """An attribute of an HDF5 file has 64 kB, which 100 names of 200 characters of six bytes are
    more than."""
    names = [f"{number}{'ж' * 300}" for number in range(100)]
    run = rm.run("paper/fig03", "lagrange/dop853")
    columns = dict.fromkeys(names, run.time) | {"time": run.time, "rotor": run.angles[:, 0]}
    text = "\n".join(
        [
            ";".join(columns),
            *(";".join(map(repr, row)) for row in np.array([*columns.values()]).T.tolist()),
        ]
    )
    (tmp_path / "data.csv").write_text(text, encoding="utf-8")
    compared = rm.compare(
        tmp_path / "data.csv", "paper/fig03", columns={"omit": ["pitch_1"], "rotor": "rotor"}
    )
    compared.save(tmp_path / "comparison.h5")


def test_records_of_json_on_one_line_may_be_of_any_length(tmp_path: Path) -> None:
    records = [{"time": float(number), "rotor": 1.0} for number in range(10_000)]
    (tmp_path / "data.json").write_text(json.dumps(records))
    assert len(load_data(tmp_path / "data.json", SCENE).time) == 10_000


@pytest.mark.parametrize(
    "text", ['{"a":' * 100_000, '{"a": ' + "[" * 100_000 + "]" * 100_000 + "}", '{"a": [[1, [2']
)
def test_nested_json_is_one_line(tmp_path: Path, text: str) -> None:
    (tmp_path / "data.json").write_text(text)
    assert "cannot be read" in refusal_of(tmp_path / "data.json")


def _npy_head(shape: tuple[int, ...]) -> bytes:
    file = io.BytesIO()
    np.lib.format.write_array_header_1_0(
        file, {"descr": "<f8", "fortran_order": False, "shape": shape}
    )
    return file.getvalue()


def archive_that_inflates(path: Path) -> None:
    """The entry declares 3 GB, as it would have if it were whole."""
    with zipfile.ZipFile(path, "w", zipfile.ZIP_DEFLATED) as archive:
        archive.writestr("time.npy", _npy_head((GIGABYTES // 8,)) + bytes(1000))
    content = path.read_bytes()
    directory = content.index(b"PK\x01\x02")
    changed = bytearray(content)
    changed[directory + 24 : directory + 28] = struct.pack("<I", GIGABYTES)
    path.write_bytes(changed)


def archive_whose_array_claims_more(path: Path) -> None:
    with zipfile.ZipFile(path, "w") as archive:
        archive.writestr("time.npy", _npy_head((GIGABYTES // 8,)) + bytes(1000))


def _matlab_element(kind: int, content: bytes) -> bytes:
    return struct.pack("<II", kind, len(content)) + content + bytes(-len(content) % 8)


def matlab_array_that_inflates(path: Path) -> None:
    """A compressed element whose array has dimensions for 3 GB."""
    flags = _matlab_element(6, struct.pack("<II", 6, 0))  # of double precision
    dimensions = _matlab_element(5, struct.pack("<ii", GIGABYTES // 8, 1))
    numbers = struct.pack("<II", 9, GIGABYTES) + bytes(10_000)
    array = _matlab_element(14, flags + dimensions + _matlab_element(1, b"time") + numbers)
    packed = zlib.compress(array)
    head = b"MATLAB 5.0 MAT-file".ljust(124) + struct.pack("<HH", 0x0100, 0x4D49)
    path.write_bytes(head + struct.pack("<II", 15, len(packed)) + packed)


def dataset_that_inflates(path: Path) -> None:
    """8 GB that were never written: they take no bytes in the file."""
    with h5py.File(path, "w") as file:
        file.create_dataset("time", (1 << 30,), "f8", chunks=(1 << 20,), compression="gzip")


def variable_that_claims_more(path: Path) -> None:
    FORMATS["data3.nc"](path, SCENE, TIME, np.zeros((201, 4)), np.zeros((201, 4)))
    content = path.read_bytes()
    place = content.index(b"time") + 4  # the dimension's name, then its length
    path.write_bytes(content[:place] + struct.pack(">i", 1 << 29) + content[place + 4 :])


def channels_that_claim_more(path: Path) -> None:
    FORMATS["data.outb"](path, SCENE, TIME, np.zeros((201, 4)), np.zeros((201, 4)))
    content = path.read_bytes()
    path.write_bytes(content[:6] + struct.pack("<i", 2**31 - 1) + content[10:])


CLAIMS: dict[str, tuple[str, Callable[[Path], None], str]] = {
    "zip": ("data.npz", archive_that_inflates, "its arrays claim 3.0 GB; allowed: up to 0.5 GB"),
    "npy": ("data.npz", archive_whose_array_claims_more, "cannot be read"),
    "mat": (
        "data.mat",
        matlab_array_that_inflates,
        "its arrays claim 3.0 GB; allowed: up to 0.5 GB",
    ),
    "hdf5": ("data.h5", dataset_that_inflates, "its arrays claim 8.0 GB; allowed: up to 0.5 GB"),
    "netcdf3": ("data.nc", variable_that_claims_more, ""),  # refused by SciPy, or by its size
    "outb": ("data.outb", channels_that_claim_more, "fewer numbers than it claims"),
}


@pytest.mark.parametrize("case", CLAIMS)
def test_what_a_file_claims_is_bounded_before_it_is_read(tmp_path: Path, case: str) -> None:
    name, make, message = CLAIMS[case]
    if name.endswith(".outb"):
        pytest.importorskip("openfast_io")
    make(tmp_path / name)
    assert (tmp_path / name).stat().st_size < 50_000
    assert message in refusal_of(tmp_path / name)


def test_texts_and_units_of_any_number_are_not_read(tmp_path: Path) -> None:
    """60 million empty texts take some bytes of a file, and 4 GB in memory."""
    with h5py.File(tmp_path / "data.h5", "w") as file:
        file["time"], file["rotor"] = TIME, 2.0 * TIME
        file["rotor"].attrs.create("units", ["deg"] * 4000, dtype=h5py.string_dtype())
        file.create_dataset(
            "texts", (60_000_000,), h5py.string_dtype(), chunks=(1 << 20,), compression="gzip"
        )
    data = load_data(tmp_path / "data.h5", SCENE)
    assert data.read[1] == "rotor = 'rotor' [rad] (unit assumed)"


@pytest.mark.parametrize("kind", ["external", "virtual"])
def test_arrays_in_other_files_are_not_read(tmp_path: Path, kind: str) -> None:
    """A file from elsewhere names no file of the reader's."""
    np.arange(201.0).tofile(tmp_path / "other")
    with h5py.File(tmp_path / "data.h5", "w") as file:
        file["time"] = TIME
        if kind == "external":
            file.create_dataset(
                "rotor", (201,), "f8", external=[(str(tmp_path / "other"), 0, h5py.h5f.UNLIMITED)]
            )
        else:
            layout = h5py.VirtualLayout((201,), "f8")
            layout[:] = h5py.VirtualSource(str(tmp_path / "other"), "rotor", shape=(201,))
            file.create_virtual_dataset("rotor", layout)
    assert "/rotor is stored in another file" in refusal_of(tmp_path / "data.h5")


def test_structures_of_any_size_are_not_read(tmp_path: Path) -> None:
    content: dict[str, Any] = {
        "time": TIME,
        "angles": np.zeros((201, 4)),
        "s": {"a": {"b": TIME}},
        "texts": ["a", "b"],
    }
    scipy.io.savemat(tmp_path / "data.mat", content)
    assert load_data(tmp_path / "data.mat", SCENE).columns == [0, 1, 2, 3]


def test_the_number_of_columns_is_bounded(tmp_path: Path) -> None:
    with pytest.raises(InputError, match="'q' has 200000 columns; allowed: up to 100000"):
        table_of("data", {"time": np.zeros(3), "q": np.zeros((3, 200_000))})
    (tmp_path / "data.txt").write_text("t\n" + "1 " * 100_001)
    assert "100001 columns; allowed: up to 100000" in refusal_of(tmp_path / "data.txt")


def test_reading_has_a_limit_of_memory(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Where no check foresees what a library allocates: here 480 MB, less than arrays may have, of
    400 MB."""
    pytest.importorskip("resource")
    monkeypatch.setattr(files, "MEMORY_LIMIT", 400_000_000)
    with zipfile.ZipFile(tmp_path / "data.npz", "w") as archive:
        archive.writestr("time.npy", _npy_head((60_000_000,)) + bytes(1000))
    assert "takes more memory than 0.372529 GB" in refusal_of(tmp_path / "data.npz")


@pytest.mark.parametrize(
    "name",
    [
        pytest.param(name, marks=() if name in ("data.txt", "data.npz") else pytest.mark.full)
        for name in FORMATS
    ],
)
def test_reading_has_a_limit_of_time(
    name: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Every format is read apart: here a library that all of them need does not end."""
    FORMATS[name](tmp_path / name, SCENE, TIME, np.zeros((201, 4)), np.zeros((201, 4)))
    (tmp_path / "numpy.py").write_text("import time\ntime.sleep(600)\n")
    monkeypatch.syspath_prepend(tmp_path)
    monkeypatch.setattr(files, "TIME_LIMIT_S", 0.3)
    with pytest.raises(InputError, match=r"cannot be read within 0\.3 s"):
        load_data(tmp_path / name, SCENE)


@pytest.mark.parametrize(
    "name", ["q[,]", "q[]", "q[9]", "q[1,99999999999]", "q[" + "1" * 5000 + "]", "f" + "1" * 5000]
)
def test_names_with_odd_numbers_are_no_channels(name: str) -> None:
    """Python refuses to read numbers of more than 4,300 digits."""
    assert channel_from_name(name, 4, channels(SCENE)) is None
    assert channel_from_name(name, 4, mode_channels(SCENE)) is None


@pytest.mark.parametrize(
    ("name", "expected"),
    [
        ("rotor [deg]", ("rotor", "deg")), ("rotor (deg) ", ("rotor", "deg")), ("a [b] [c]", ("a [b]", "c")),
        ("t / s", ("t", "s")), ("t /s", ("t", "s")), ("m/s", ("m/s", "")), ("a / b / c", ("a / b", "c")),
        ("q[0]", ("q[0]", "")), ("[deg]", ("[deg]", "")), ("x [", ("x [", "")), ("a [b / c]", ("a", "b / c")),
        ("", ("", "")), ("x []", ("x", "")), ("force [N m]", ("force", "N m")),
    ],
)  # fmt: skip
def test_units_behind_names(name: str, expected: tuple[str, str]) -> None:
    assert split_bracketed_unit(name) == expected
