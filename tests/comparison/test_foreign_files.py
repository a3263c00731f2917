"""Files of other programs: every format gives the same numbers; names guessed or mapped; wrong
input is one line."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from support.commands import refusal
from support.data_files import FORMATS
from support.scenes import paper

import rotor_mbs as rm
from rotor_mbs.cli import main
from rotor_mbs.comparison import channels as names
from rotor_mbs.comparison.channels import channel_from_name, channels
from rotor_mbs.comparison.data import load_data, rounding_of_printed
from rotor_mbs.errors import InputError, RotorError

APART = ("data.csv", "data.nc")  # read apart as all others: those are marked full
in_this_process = pytest.mark.usefixtures("files_read_here")

SCENE = paper("fig08")
TIME = np.linspace(0.0, 10.0, 201)
ANGLES = np.stack(
    [0.3 - 2.0 * TIME, 0.7 * np.cos(TIME), 0.1 * TIME, 0.2 * np.sin(3.0 * TIME)], axis=1
)
RATES = np.stack(
    [-2.0 + 0.0 * TIME, -0.7 * np.sin(TIME), 0.1 + 0.0 * TIME, 0.6 * np.cos(3.0 * TIME)], axis=1
)
STATES = np.hstack([ANGLES, RATES])


@in_this_process
@pytest.mark.parametrize("name", FORMATS)
def test_every_format_gives_the_same_numbers(tmp_path: Path, name: str) -> None:
    if name.endswith(".outb"):
        pytest.importorskip("openfast_io")
    FORMATS[name](tmp_path / name, SCENE, TIME, ANGLES, RATES)
    turns = name == "data.out"  # OpenFAST's azimuth is from 0 to 360 degrees
    columns = {"rotor": {"column": "Azimuth", "wrapped": True}} if turns else None
    data = load_data(tmp_path / name, SCENE, columns)
    np.testing.assert_allclose(data.time, TIME, rtol=1e-15)
    assert 0 in data.columns
    np.testing.assert_allclose(
        data.values - data.values[0], STATES[:, data.columns] - STATES[0, data.columns], atol=2e-14
    )
    assert turns or len(data.columns) >= 4


_ROWS = [(0.0, 165.0, -2.0), (0.05, 164.5, 1e-3), (0.1, 1000.25, -1.5e-7)]
_NAMES = ("time", "rotor [deg]", "pitch 1 [deg]")


def _table(
    divider: str,
    names: Sequence[str] = _NAMES,
    decimal: str = ".",
    end: str = "\n",
    form: str = "{!r}",
) -> str:
    rows = [[form.format(value).replace(".", decimal) for value in row] for row in _ROWS]
    return "".join(divider.join(words) + end for words in (names, *rows))


# As spreadsheets, LabVIEW, Fortran and control systems write them.
REAL_LIFE = {
    "decimal commas": _table(";", decimal=","),
    "decimal commas, tabs": _table("\t", decimal=","),
    "a divider at the ends": _table(";", decimal=",", end=";\n"),
    "Unicode text of a spreadsheet": _table("\t"),
    "a byte-order mark, lines of Windows": "\ufeff" + _table(",", end="\r\n"),
    "what says the divider": "sep=;\n" + _table(";", decimal=","),
    "units in a line": _table(",", ("time", "rotor", "pitch 1")).replace("\n", "\ns,deg,deg\n", 1),
    "units behind strokes": _table(";", ("t / s", "rotor / deg", "pitch 1 / deg"), decimal=","),
    "comments between": _table(",").replace("\n", "\n# begins\n", 2) + "# ends\n",
    "a line about it": "Simulator 3, run 7\nof a rotor, again\n\n" + _table(","),
    "quotes": _table(",", [f'"{name}"' for name in _NAMES]),
    "Fortran's exponents": _table(" ", ("time", "rotor_deg", "pitch_1_deg"), form="{:.9E}").replace(
        "E", "D"
    ),
    "empty rows at the end": _table(",") + ",,\n,,\n",
    "a column without a name": "\n".join(
        f"{i},{row}" for i, row in enumerate(_table(",").split("\n"), -1) if row
    )[2:],
    "vectors in a field": "time,q [deg]\n"
    + "\n".join(f"{t!r},{a!r} {b!r} 0.0 0.0" for t, a, b in _ROWS),
    "text below the numbers": _table(",") + "\nThis file was closed on 19-Oct-2018 at 10:15:16.\n",
    "names in a comment above another": "# "
    + _table(" ", ("time", "rotor_deg", "pitch_1_deg")).replace("\n", "\n# run\n", 1),
    "columns of one name that are not used": "\n".join(
        f"{row},0,0" for row in _table(",").splitlines()
    ),
}


@in_this_process
@pytest.mark.parametrize("name", REAL_LIFE)
def test_text_as_other_programs_write_it(tmp_path: Path, name: str) -> None:
    encoding = "utf-16" if name.startswith("Unicode") else "utf-8"
    (tmp_path / "data.csv").write_bytes(REAL_LIFE[name].encode(encoding))
    data = load_data(tmp_path / "data.csv", SCENE)
    assert data.columns[:2] == [0, 1]
    np.testing.assert_allclose(data.time, [row[0] for row in _ROWS], rtol=1e-15)
    np.testing.assert_allclose(
        np.degrees(data.values[:, :2]), [row[1:] for row in _ROWS], rtol=1e-14
    )


@pytest.mark.parametrize(
    ("name", "channel"),
    [
        ("time_ms", "time"), ("rotor_deg", "rotor"), ("rotor speed", "rotor rate"), ("RotSpeed", "rotor rate"),
        ("psi_dot", "rotor rate"), ("PtchPMzc2", "pitch 2"), ("pitch_2_rate", "pitch 2 rate"),
        ("beta1_dot", "pitch 1 rate"), ("omega_rpm", "rotor rate"), ("theta_dot_1", "pitch 1 rate"),
        ("dtheta1", "pitch 1 rate"), ("dphi", "rotor rate"), ("dt", None),
        ("pitch", None), ("tip 1 x", None), ("RotTorq", None), ("pitch 4", None),
    ],
)  # fmt: skip
def test_names_that_are_known(name: str, channel: str | None) -> None:
    found = channel_from_name(name, 0, channels(SCENE))
    assert (found and found.name) == channel


def test_the_names_that_are_printed_are_understood(capsys: pytest.CaptureFixture[str]) -> None:
    """By `compare --names`, which needs neither data nor a scene."""
    with pytest.raises(SystemExit) as ended:
        main(["compare", "--names"])
    assert ended.value.code == 0
    printed = capsys.readouterr().out
    listed = dict(names.known_names())
    for row, form, channel in (
        ("time", "{}", "time"),
        ("rotor", "{}", "rotor"),
        ("pitch of a blade, with its number", "{} 2", "pitch 2"),
        ("array of angles, rotor first", "{}[0]", "rotor"),
        ("array of rates, rotor first", "{}[0]", "rotor rate"),
        ("load, with blade and axis, or an array", "{}", ""),
    ):
        for name in listed[row].split(", "):
            assert name in printed
            found = channel_from_name(form.format(name), 4, channels(SCENE))
            assert not channel or (found is not None and found.name == channel), name
    for axis in ("x", "y", "z"):
        found = channel_from_name(f"shaft_force_{axis}", 0, channels(SCENE))
        assert found is not None
        assert found.name == f"shaft force {axis}"


def column_of(text: str) -> np.ndarray:
    """As `text` writes numbers of all sizes and signs, read again."""
    values = np.random.default_rng(1).normal(size=200) * 10.0 ** np.linspace(-2, 3, 200)
    return np.array([float(text % value) for value in values])


@pytest.mark.parametrize("digits", [4, 6, 9])
def test_the_last_digit_is_found(digits: int) -> None:
    """Of significant digits half a unit of the last one of each number, of decimals the same of
    all."""
    written = column_of(f"%.{digits - 1}e")
    exponents = np.floor(np.log10(np.abs(written)))
    np.testing.assert_allclose(
        rounding_of_printed(written), 0.5 * 10.0 ** (exponents + 1 - digits), rtol=1e-12
    )
    np.testing.assert_allclose(
        rounding_of_printed(column_of(f"%.{digits}f")), 0.5 * 10.0**-digits, rtol=1e-12
    )


def test_the_last_digit_of_single_and_double_precision_and_of_few_values() -> None:
    double = column_of("%.17g")
    np.testing.assert_array_equal(rounding_of_printed(double), np.abs(double) * 2.0**-53)
    single = double.astype(np.float32).astype(float)
    np.testing.assert_array_equal(rounding_of_printed(single), np.abs(single) * 2.0**-24)
    # A pitch that stays at 0.1 rad says nothing of digits.
    np.testing.assert_array_equal(
        rounding_of_printed(np.full(50, 0.1)), np.full(50, 0.1 * 2.0**-53)
    )
    assert not rounding_of_printed(np.zeros(50)).any()
    # But other columns may.
    np.testing.assert_array_equal(
        rounding_of_printed(np.full(50, 0.1), [[column_of("%.4f")]]), np.full(50, 0.5e-4)
    )
    np.testing.assert_array_equal(
        rounding_of_printed(np.full(50, 0.1), [[double]]), np.full(50, 0.1 * 2.0**-53)
    )
    # Nor does a number next to the smallest there is, as a flipped bit may make: no unit of it can
    # be written.
    assert rounding_of_printed(np.array([1.0 / 3.0, 2.0 / 3.0, 5e-324])).max() < 1e-15


@in_this_process
def test_a_mapping_says_column_unit_sign_zero_and_subset(tmp_path: Path) -> None:
    path = tmp_path / "mine.csv"
    table = np.column_stack(
        [1e3 * TIME, -(np.degrees(ANGLES[:, 0]) + 90.0), RATES[:, 2] * 30.0 / np.pi]
    )
    np.savetxt(path, table, delimiter=";", header="zeit;a;b", comments="", fmt="%.17g")
    mapping = tmp_path / "map.toml"
    mapping.write_text(
        'time = { column = "zeit", unit = "ms" }\n'
        'rotor = { column = "a", unit = "deg", sign = -1, offset = 90.0 }\n'
        'pitch_2_rate = { column = "b", unit = "rpm" }\n'
    )
    data = load_data(path, SCENE, mapping)
    assert data.columns == [0, 6]
    np.testing.assert_allclose(data.values, STATES[:, [0, 6]], atol=1e-13)
    assert data.read[1] == "rotor = -('a' +90) [deg]"


@in_this_process
def test_results_of_this_program_are_data_too(results: Path, tmp_path: Path) -> None:
    with pytest.raises(RotorError, match=r"several groups; .*paper/fig08/exudyn_tree/rk67"):
        load_data(results, SCENE)
    stored = rm.open(results)["paper/fig08/exudyn_tree/rk67"]
    for columns, count in (('only = ["rotor"]\n', 1), ('rotor = "angles[0]"\n', 8), ("", 8)):
        (tmp_path / "map.toml").write_text(f'group = "exudyn_tree/rk67"\n{columns}')
        data = load_data(results, SCENE, tmp_path / "map.toml")
        assert len(data.columns) == count
        assert data.values[:, 0].tobytes() == stored.angles[:, 0].tobytes()


def _sparse(path: Path) -> None:
    with path.open("wb") as file:
        file.truncate(2 << 30)


def _write(text: str) -> Callable[[Path], None]:
    return lambda path: path.write_text(text) and None


HEAD = "time [s],rotor [rad]\n"
WRONG: dict[str, tuple[Callable[[Path], object], str]] = {
    "unknown columns": (
        _write("time,a,b\n0,1,2\n1,2,3\n2,3,4\n"),
        "no column for an angle or a rate",
    ),
    "no time": (_write("rotor,pitch 1\n0,1\n1,2\n2,3\n"), "no column for the time"),
    "other lengths": (_write(HEAD + "0,1\n1,2\n2\n"), "1 fields, where the rows above have 2"),
    "nothing": (lambda path: path.touch(), "empty"),
    "one column": (_write("rotor\n0\n1\n2\n"), "one column of numbers; allowed: a column of times"),
    "no header": (_write("0,1\n1,2\n2,3\n"), "no header line"),
    "2 GB": (_sparse, "2.0 GB; allowed: up to 0.5 GB"),
    "wrong unit": (
        _write("time [s],rotor [kg]\n0,1\n1,2\n2,3\n"),
        "'kg'; allowed: rad, deg, turns",
    ),
    "NaN": (_write(HEAD + "0,1\n1,nan\n2,3\n"), "is nan in row 2 of 3"),
    "a vector that is missing in a row": (
        _write("time,q\n0,1 2 3 4\n1,\n2,1 2 3 4\n"),
        "column 'q[0]' is empty in row 2 of 3 (line 3)",
    ),
    "repeated time": (_write(HEAD + "0,1\n1,2\n1,3\n"), "the time of row 3, 1 s, repeats"),
    "two rows at one time": (
        _write(HEAD + "0,1\n2,2\n1,3\n2,4\n"),
        "the time of row 4, 2 s, repeats that of row 2 with other numbers",
    ),
    "too few rows": (_write(HEAD + "0,1\n1,2\n"), "2 rows; allowed: 3 or more"),
    "before the start": (
        _write(HEAD + "-4,1\n-3,2\n-1,3\n"),
        "ends at t = -1 s; allowed: times from 0",
    ),
    "a comma between thousands": (
        _write('time [ms],rotor\n0,1\n"1,000",2\n"2,000",3\n'),
        "column 'time': row 2 (line 3) has '1,000', no number",
    ),
    "dates": (
        _write(HEAD + "12:00:01,1\n12:00:02,2\n12:00:03,3\n"),
        "column 'time': row 1 (line 2) has '12:00:01', no number",
    ),
    "two columns for one channel": (
        _write("time,rotor,azimuth\n0,1,1\n1,2,2\n2,3,3\n"),
        "could be rotor",
    ),
    "a load in a frame that it does not have": (
        _write("time,rotor,shaft force x blade frame\n0,1,1\n1,2,2\n2,3,3\n"),
        "data.csv: column 'shaft force x blade frame': shaft_force_x: frame 'blade'; allowed: "
        "base, shaft, rotor",
    ),
    "a text that begins as JSON": (_write('{"time": [0, 1'), "allowed: text with a header"),
    "JSON of no arrays": (_write('{"time": {"a": 1}}'), "allowed: "),
    "Parquet": (
        lambda path: path.write_bytes(b"PAR1\x15\x04" + bytes(60)),
        "not a format that can be read",
    ),
    "a damaged archive": (lambda path: path.write_bytes(b"PK\x03\x04damaged"), "cannot be read"),
    "a damaged HDF5 file": (
        lambda path: path.write_bytes(b"\x89HDF\r\n\x1a\n" + bytes(100)),
        "not a readable HDF5",
    ),
    "a damaged MAT file": (
        lambda path: path.write_bytes(b"MATLAB 5.0 MAT-file".ljust(200)),
        "not a MAT file that can be read",
    ),
    "a program": (
        lambda path: path.write_bytes(b"\x7fELF" + bytes(100)),
        "not a format that can be read",
    ),
}


@in_this_process
@pytest.mark.parametrize("case", WRONG)
def test_wrong_input_is_one_line_and_status_2(tmp_path: Path, case: str) -> None:
    make, message = WRONG[case]
    path = tmp_path / "data.csv"
    make(path)
    assert message in refusal("compare", path, "--scene", "paper/fig08", "-o", tmp_path / "page")
    assert not (tmp_path / "page").exists()


@pytest.mark.parametrize(
    ("arrays", "message"),
    [
        ({}, "no columns of numbers"),
        (
            {"time": TIME, "rotor": np.ma.masked_less(ANGLES[:, 0], -1.0)},
            "column 'rotor' is nan in row",
        ),
        ({"time": TIME, "angles": [[1.0, 2.0], [3.0]]}, "rows of different lengths"),
        ({"time": TIME[1:], "rotor": ANGLES[:, 0]}, "columns of different lengths"),
        ({"time": 3.0, "rotor": 2.0}, "no columns of numbers"),
        (
            {"time": TIME, "angles": ANGLES, "angles[0]": ANGLES[:, 1]},
            r"two columns 'angles\[0\]'; allowed: one of each name",
        ),
        (
            {"time": TIME, "angles[0]": ANGLES[:, 1], "angles": ANGLES},
            r"two columns 'angles\[0\]'; allowed: one of each name",
        ),
        (ANGLES, "data: ndarray; allowed: a file, or arrays by name, such as "),
    ],
)
def test_wrong_arrays_are_refused(arrays: Any, message: str) -> None:
    with pytest.raises(InputError, match=message):
        load_data(arrays, SCENE)


@in_this_process
@pytest.mark.parametrize(
    ("mapping", "message"),
    [
        (
            'time = "t"\nrotr = "a"',
            "map.toml:2: rotr: unknown key, perhaps rotor; allowed: time, rotor, pitch_1",
        ),
        ('rotor = "c"', "no column 'c'; available: t, a, b"),
        ('rotor = { column = "a", unit = "rpm" }', "'rpm'; allowed: rad, deg, turns"),
        ('rotor = { column = "a", sign = 2 }', "rotor.sign: 2 is out of range; allowed: 1, -1"),
        (
            "rotor = 3",
            "rotor: 3 is not a table; allowed: a column's name, or a table with `column`",
        ),
        ('time = "t"', "no column for an angle or a rate; available: t, a, b"),
        ("omit = []", "says nothing; allowed: time, rotor, pitch_1"),
        (
            'only = ["rotor"]\npitch_1 = "a"',
            'pitch_1: is not in `only`; allowed: "pitch_1" in `only`, or no column',
        ),
        ('only = ["rotr"]', "is not one of them, perhaps rotor; allowed: a list of rotor"),
        ("rotor", "not TOML"),
    ],
)
def test_a_wrong_mapping_is_refused(tmp_path: Path, mapping: str, message: str) -> None:
    (tmp_path / "data.csv").write_text("t,a,b\n0,1,2\n1,2,3\n2,3,4\n")
    (tmp_path / "map.toml").write_text(mapping)
    with pytest.raises(InputError, match=message.replace("(", r"\(")) as caught:
        load_data(tmp_path / "data.csv", SCENE, tmp_path / "map.toml")
    assert len(caught.value.problems) == 1


def test_without_its_package_a_binary_openfast_file_says_how_to_get_it(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    FORMATS["data.outb"](tmp_path / "data.outb", SCENE, TIME, ANGLES, RATES)
    (tmp_path / "openfast_io.py").write_text("raise ImportError")
    monkeypatch.syspath_prepend(tmp_path)
    with pytest.raises(InputError, match=r"rotor_mbs\[openfast\]"):
        load_data(tmp_path / "data.outb", SCENE)


@pytest.mark.parametrize(
    "name",
    [pytest.param(name, marks=() if name in APART else pytest.mark.full) for name in FORMATS],
)
def test_a_reader_that_ends_its_process_is_a_line(
    name: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Every format is read apart: here by a library that ends its process when it is loaded."""
    FORMATS[name](tmp_path / name, SCENE, TIME, ANGLES, RATES)
    (tmp_path / "numpy.py").write_text("import os\nos.abort()\n")
    monkeypatch.syspath_prepend(tmp_path)
    with pytest.raises(InputError, match="cannot be read: the reading process died"):
        rm.compare(tmp_path / name, SCENE)
