"""Data and mappings that cannot be compared, and the reason that the message must have."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from support.scenes import paper

import rotor_mbs as rm
from rotor_mbs.comparison.data import data_of_table, load_data
from rotor_mbs.comparison.formats import read_in_worker
from rotor_mbs.errors import InputError

SCENE = paper("fig11", duration=1.0, samples=11)
LABELS = [label.replace(" ", "_") for label in SCENE.coordinate_labels]
TIME = np.linspace(0.0, 1.0, 11)
ANGLES = {label: np.sin(TIME + i) for i, label in enumerate(LABELS)}

REFUSALS: dict[str, tuple[dict[str, Any], dict[str, Any], str]] = {
    "other names than OpenFAST's": (
        {"time": TIME, **ANGLES},
        {"program": "openfast"},
        'data: program = "openfast" reads the names of OpenFAST\'s output alone; '
        "allowed: leave `program` out",
    ),
    "another name of the time than OpenFAST's": (
        {"t": TIME, "Azimuth": TIME},
        {"program": "openfast"},
        'data: program = "openfast" reads the names of OpenFAST\'s output alone; '
        "allowed: leave `program` out",
    ),
    "omit and only": (
        {"time": TIME, **ANGLES},
        {"omit": ["rotor"], "only": ["rotor"]},
        "data: `omit` and `only` leave no angle or rate; allowed: one of " + ", ".join(LABELS),
    ),
    "only loads": (
        {"time": TIME, "rotor": TIME, "shaft_force": np.ones((11, 3))},
        {"only": ["shaft_force"]},
        "data: `only` leaves no angle or rate; allowed: one of rotor",
    ),
    "too few angles": (
        {"time": TIME, "angles": np.ones((11, 2))},
        {},
        "data: `angles` has 2 columns, the scene has 4 coordinates; allowed: as many, rotor first",
    ),
    "one column of rates": (
        {"time": TIME, "qd": TIME},
        {},
        "data: `qd` has 1 column, the scene has 4 coordinates; allowed: as many, rotor first",
    ),
    "arrays have no groups": (
        {"time": TIME, **ANGLES},
        {"group": "x"},
        "data: arrays have no groups, but the mapping has group = 'x'; "
        "allowed: leave `group` out, or an HDF5 file",
    ),
    "unknown names": (
        {"time": TIME, "a": TIME},
        {"omit": ["pitch_3"]},
        "data: no column for an angle or a rate; available: time, a; "
        "allowed: a mapping file (--columns) with `rotor` or others",
    ),
}


@pytest.mark.parametrize("name", REFUSALS)
def test_the_message_has_the_reason(name: str) -> None:
    data, mapping, message = REFUSALS[name]
    with pytest.raises(InputError) as caught:
        load_data(data, SCENE, mapping or None)
    assert str(caught.value) == message


def test_a_file_of_another_kind_is_no_mapping(tmp_path: Path) -> None:
    path = tmp_path / "scene.toml"
    path.write_text(SCENE.text, encoding="utf-8")
    with pytest.raises(InputError) as caught:
        rm.compare({"time": TIME, **ANGLES}, SCENE, columns=path)
    command = f"a mapping of columns, or: rotor-mbs run {path}"
    assert list(caught.value.problems) == [f"{path}: is a scene; allowed: {command}"]


def test_an_array_of_another_length_beside_angles_is_unused_with_the_reason() -> None:
    data = load_data({"time": TIME, **ANGLES, "rates": np.ones((11, 2))}, SCENE)
    assert data.unused["rates[0]"] == "`rates` has 2 columns, the scene has 4 coordinates"


@pytest.mark.parametrize("name", ["a.csv", "a.npz", "a.json", "a.nc"])
def test_a_group_of_a_file_without_groups_is_refused(name: str, tmp_path: Path) -> None:
    path = tmp_path / name
    head = {
        "a.csv": b"time,rotor\n0,1\n1,2\n",
        "a.npz": b"PK\x03\x04",
        "a.json": b"{",
        "a.nc": b"CDF",
    }
    path.write_bytes(head[name])
    with pytest.raises(
        InputError, match="a format without groups, but the mapping has group = 'x'"
    ):
        read_in_worker((path, "x", SCENE.name))


def test_numbers_of_single_precision_are_told() -> None:
    single = {name: values.astype(np.float32) for name, values in ANGLES.items()}
    text = "single precision: relative rounding error 6e-08"
    assert load_data({"time": TIME, **single}, SCENE).precision == text
    mixed = load_data({"time": TIME, **ANGLES, "rotor": single["rotor"]}, SCENE).precision
    assert mixed == text.replace(":", f" in 1 of {len(ANGLES)} columns:")
    assert load_data({"time": TIME, **ANGLES}, SCENE).precision == ""


def test_a_channel_that_only_leaves_out_is_told_from_a_missing_column() -> None:
    run = rm.run(SCENE, "lagrange/dop853")
    data = {"time": run.time, "angles": run.angles, "rates": run.rates}
    only = ["rotor", "pitch_1", "pitch_3"]
    comparison = rm.compare(data, SCENE, columns={"only": only})
    allowed = '"pitch_2" in `only`, or omit = ["pitch_2"], in a mapping file'
    assert comparison.message == f"pitch 2 is not in `only`; allowed: {allowed}"
    assert rm.compare(data, SCENE, columns={"only": only, "omit": ["pitch_2"]}).status == "ok"


HEAD = b"time,rotor [rad],pitch 1\n"
FILES = {
    "two columns of one name": (
        "a.csv",
        b"time,rotor [rad],rotor [rad]\n0,1,1\n1,2,2\n2,3,3\n",
        "two columns 'rotor [rad]' could be rotor; allowed: other names, or `rotor = 'rotor'` "
        "(the first), `rotor = '_rotor'` (the second) in a mapping file",
    ),
    "an empty cell": (
        "a.csv",
        b"# written\n" + HEAD + b"0,1,1\n1,,2\n2,3,3\n",
        "column 'rotor' is empty in row 2 of 3 (line 4); allowed: finite numbers",
    ),
    "nan": (
        "a.csv",
        HEAD + b"0,1,1\n1,2,2\n2,3,nan\n",
        "column 'pitch 1' is nan in row 3 of 3 (line 4); allowed: finite numbers",
    ),
    "an empty cell beside Fortran's numbers": (
        "a.csv",
        HEAD + b"0,1.5D-3,1\n1,,2\n2,3.5D-3,3\n",
        "column 'rotor' is empty in row 2 of 3 (line 3); allowed: finite numbers",
    ),
    "null in an array": (
        "a.json",
        b'{"time": [0, 1, 2], "rotor": [1, null, 3]}',
        "column 'rotor' is null in row 2 of 3; allowed: finite numbers",
    ),
    "null in a record": (
        "a.json",
        b'[{"time": 0, "rotor": 1}, {"time": 1, "rotor": null}]',
        "column 'rotor' is null in row 2 of 2; allowed: finite numbers",
    ),
    "one row": ("a.csv", HEAD + b"0,1,1\n", "1 row; allowed: 3 or more"),
    "a damaged MAT file": (
        "a.mat",
        b"MATLAB 5.0 MAT-file".ljust(124) + b"\x00\x01IM" + bytes(range(1, 40)),
        "not a MAT file that can be read; allowed: text with a header",
    ),
}


def refusal_of(path: Path) -> str:
    with pytest.raises(InputError) as caught:
        data_of_table(read_in_worker((path, "", SCENE.name)), SCENE)
    return str(caught.value)


@pytest.mark.parametrize("name", FILES)
def test_what_a_file_lacks_is_told_in_its_own_words(name: str, tmp_path: Path) -> None:
    file, content, message = FILES[name]
    (tmp_path / file).write_bytes(content)
    assert f"{file}: {message}" in refusal_of(tmp_path / file)


def test_arrays_of_objects_and_of_complex_numbers_are_named(tmp_path: Path) -> None:
    objects = np.array([None, 1.0], dtype=object)
    np.savez(tmp_path / "a.npz", time=TIME, rotor=TIME, pitch_1=objects)
    message = "column 'pitch_1': an array of Python objects; allowed: real numbers"
    assert message in refusal_of(tmp_path / "a.npz")
    np.savez(tmp_path / "b.npz", time=TIME, rotor=TIME + 1j, pitch_1=TIME)
    message = "column 'rotor': complex numbers; allowed: real numbers, a row for every time"
    assert message in refusal_of(tmp_path / "b.npz")
