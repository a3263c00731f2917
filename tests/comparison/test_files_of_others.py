"""Files as other programs write them: what is read by which library, which names and units are
known, and that nothing is dropped silently. The data are written here, from one short motion."""

from __future__ import annotations

import json
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

import h5py
import numpy as np
import pandas as pd
import pytest
import scipy.io
import xarray as xr
from support.commands import refusal
from support.scenes import paper

import rotor_mbs as rm
from rotor_mbs.comparison.channels import channels
from rotor_mbs.comparison.data import ForeignData, load_data
from rotor_mbs.comparison.formats import read_in_worker
from rotor_mbs.comparison.units import unit_factor
from rotor_mbs.errors import InputError

pytestmark = pytest.mark.usefixtures("files_read_here")

SCENE = paper("fig11", duration=1.0, samples=101)
TIME = np.linspace(0.0, 1.0, 101)
ANGLES = np.stack(
    [0.5 + 0.3 * TIME, np.cos(TIME), 0.1 * TIME - 0.7, 0.2 * np.sin(3.0 * TIME)], axis=1
)
RATES = np.stack(
    [0.3 + 0.0 * TIME, -np.sin(TIME), 0.1 + 0.0 * TIME, 0.6 * np.cos(3.0 * TIME)], axis=1
)
NAMES = [channel.name for channel in channels(SCENE)[1:9]]
BY_NAME = dict(zip(NAMES, np.hstack([ANGLES, RATES]).T, strict=True))
TABLE = {"time": TIME, **BY_NAME}


def assert_complete(data: ForeignData, rates: bool = True, atol: float = 1e-14) -> None:
    """All angles, and rates, are those of the motion."""
    assert data.columns == list(range(8 if rates else 4))
    np.testing.assert_allclose(data.time, TIME, atol=1e-15)
    np.testing.assert_allclose(
        data.values, np.hstack([ANGLES, RATES])[:, data.columns], rtol=0.0, atol=atol
    )


def write_csv(path: Path, table: Mapping[str, Any]) -> None:
    pd.DataFrame(table).to_csv(path, index=False)


def entries(form: str, first: int, columns: Any) -> dict[str, Any]:
    return {form.format(first + i): columns[:, i] for i in range(columns.shape[1])}


# Names

SPELLINGS: dict[str, dict[str, Any]] = {
    "from 1, as Modelica and FMI": entries("q[{}]", 1, ANGLES) | entries("qd[{}]", 1, RATES),
    "der of an array": entries("q[{}]", 1, ANGLES) | entries("der(q[{}])", 1, RATES),
    "from 0": entries("q[{}]", 0, ANGLES) | entries("qd[{}]", 0, RATES),
    "angles from 1": entries("angles[{}]", 1, ANGLES) | entries("rates[{}]", 1, RATES),
    "two indices": entries("q[{},1]", 1, ANGLES) | entries("qd[{}, 1]", 1, RATES),
    "MATLAB": entries("q({})", 1, ANGLES) | entries("qd({})", 1, RATES),
    "without brackets": entries("q_{}", 1, ANGLES) | entries("qdot{}", 1, RATES),
    "MuJoCo": entries("qpos[{}]", 0, ANGLES) | entries("qvel[{}]", 0, RATES),
    "MuJoCo in a table": entries("qpos_{}", 0, ANGLES) | entries("qvel_{}", 0, RATES),
    "Exudyn": entries("Coordinates[{}]", 0, ANGLES) | entries("Coordinates_t[{}]", 0, RATES),
    "pitches as an array": {"phi": ANGLES[:, 0], "der(phi)": RATES[:, 0]}
    | entries("theta[{}]", 1, ANGLES[:, 1:]) | entries("der(theta[{}])", 1, RATES[:, 1:]),
    "pitches from 0": {"phi": ANGLES[:, 0], "omega": RATES[:, 0]}
    | entries("pitch_{}", 0, ANGLES[:, 1:]) | entries("pitch_{}_rate", 0, RATES[:, 1:]),
    "joints of Modelica": {"rotor.phi": ANGLES[:, 0], "rotor.w": RATES[:, 0]}
    | entries("pitch[{}].phi", 1, ANGLES[:, 1:]) | entries("pitch[{}].w", 1, RATES[:, 1:]),
    "derivatives": {"phi": ANGLES[:, 0], "der(phi)": RATES[:, 0]}
    | entries("theta{}", 1, ANGLES[:, 1:]) | entries("der(theta{})", 1, RATES[:, 1:]),
    "quotes in the names": {f"'{name}'": values for name, values in BY_NAME.items()},
}  # fmt: skip


@pytest.mark.parametrize("case", SPELLINGS)
def test_names_of_other_programs(case: str, tmp_path: Path) -> None:
    assert_complete(load_data({"time": TIME, **SPELLINGS[case]}, SCENE))
    if case in ("two indices", "der of an array"):  # in a file the names are quoted
        write_csv(tmp_path / "data.csv", {"time": TIME, **SPELLINGS[case]})
        assert_complete(load_data(tmp_path / "data.csv", SCENE))


@pytest.mark.parametrize(
    "names",
    [
        # more pitches than blades: the rotor may be among them
        ["theta[1]", "theta[2]", "theta[3]", "theta[4]"],
        ["psi_1", "psi_2", "psi_3"],  # azimuths of blades
        ["der(der(phi))", "der(time)", "der(q)", "qdd[1]", "abs(rotor)", "rotor_acc"],
    ],
)
def test_what_names_do_not_say_is_listed(names: list[str]) -> None:
    arrays = {"time": TIME, "rotor": ANGLES[:, 0]} | dict.fromkeys(names, TIME)
    data = load_data(arrays, SCENE)
    assert data.columns == [0]
    assert dict(data.unused) == dict.fromkeys(names, "no channel has this name")


def test_an_array_with_a_column_less_is_listed() -> None:
    """Nobody knows which one is missing."""
    names = ["q[1]", "q[2]", "q[3]"]
    arrays = {"time": TIME, "rotor": ANGLES[:, 0]} | dict.fromkeys(names, TIME)
    data = load_data(arrays, SCENE)
    assert data.columns == [0]
    reason = "`q` has 3 columns, the scene has 4 coordinates"
    assert dict(data.unused) == dict.fromkeys(names, reason)


@pytest.mark.parametrize(
    ("unit", "kind", "factor"),
    [
        ("rad s^-1", "rate", 1.0), ("radian/second", "rate", 1.0), ("rad.s-1", "rate", 1.0), ("1/s", "rate", 1.0),
        ("rad·s⁻¹", "rate", 1.0), ("rad s**-1", "rate", 1.0), ("°/s", "rate", np.pi / 180.0), ("s^-1", "rate", 1.0),
        ("degrees per second", "rate", np.pi / 180.0), ("r/min", "rate", np.pi / 30.0), ("1/min", "rate", None),
        ("[deg]", "angle", np.pi / 180.0), ("(rad)", "angle", 1.0), ("mrad", "angle", 1e-3), ("kg", "angle", None),
        ("milliseconds", "time", 1e-3), ("seconds since 2000-01-01", "time", 1.0), ("rad", "time", None),
        ("kN-m", "moment", 1e3), ("N·m", "moment", 1.0), ("MN m", "moment", 1e6), ("mN", "force", 1e-3),
        ("newton metre", "moment", 1.0), ("N m/rad", "moment", None), ("rad/s" * 100, "rate", None),
    ],
)  # fmt: skip
def test_units_in_any_spelling(unit: str, kind: str, factor: float | None) -> None:
    assert unit_factor(unit, kind) == (None if factor is None else pytest.approx(factor, rel=1e-15))


@pytest.mark.parametrize("form", ["{} [{}]", "{} ({})", "{} in {}", "{}, {}", "{} / {}"])
def test_units_behind_names_of_columns(form: str) -> None:
    units = dict.fromkeys(NAMES[:4], "deg") | dict.fromkeys(
        NAMES[4:], "deg/s" if "/" in form else "deg s^-1"
    )
    arrays = {form.format(name, unit): np.degrees(BY_NAME[name]) for name, unit in units.items()}
    assert_complete(load_data({form.format("time", "ms"): 1e3 * TIME, **arrays}, SCENE), atol=1e-13)


def test_the_unit_of_a_derivative_is_that_of_its_angle_per_second() -> None:
    data = load_data({"time": TIME, "phi_deg": TIME, "der(phi_deg)": np.full(101, 180.0)}, SCENE)
    np.testing.assert_allclose(data.values[:, 1], np.pi)


# Tables in memory


def test_indexes_and_levels_of_a_data_frame() -> None:
    frame = pd.DataFrame(
        {(name, "rad/s" if "rate" in name else "rad"): values for name, values in BY_NAME.items()}
    )
    assert_complete(load_data(frame.set_index(pd.Index(TIME)), SCENE))
    assert_complete(load_data(frame.set_index(pd.Index(TIME, name="t")), SCENE))
    assert_complete(
        load_data(frame.set_index(pd.to_timedelta(np.round(1e6 * TIME), unit="us")), SCENE)
    )
    degrees = pd.DataFrame(
        {("time", "s"): TIME} | {(name, "deg"): np.degrees(BY_NAME[name]) for name in NAMES[:4]}
    )
    assert_complete(load_data(degrees, SCENE), rates=False)
    quantities = {("rotor", "angle"): ANGLES[:, 0], ("rotor", "rate"): RATES[:, 0]}
    assert load_data(pd.DataFrame({("time", ""): TIME} | quantities), SCENE).columns == [0, 4]
    groups = {("angles", "rotor"): ANGLES[:, 0], ("rates", "rotor"): RATES[:, 0]}
    assert load_data(pd.DataFrame({("time", ""): TIME} | groups), SCENE).columns == [0, 4]


def test_a_unit_in_a_dataset_counts_in_memory_as_in_a_file(tmp_path: Path) -> None:
    dimensions = ("time", "coordinate")
    for key, values, unit in (("units", np.degrees(ANGLES), "degrees"), ("unit", ANGLES, "radian")):
        dataset = xr.Dataset({"angles": (dimensions, values, {key: unit})}, coords={"time": TIME})
        assert_complete(load_data(dataset, SCENE), rates=False)
        path = tmp_path / f"{key}.nc"
        dataset.to_netcdf(path, engine="h5netcdf")
        assert_complete(load_data(path, SCENE), rates=False)


# Libraries


def packed(path: Path) -> None:
    """Whole numbers with a scale and an offset."""
    with h5py.File(path, "w") as file:
        file["time"] = TIME
        for name, values in BY_NAME.items():
            file[name] = np.round((values - 0.25) / 2.0**-30).astype(np.int32)
            file[name].attrs.update({"units": "rad/s" if "rate" in name else "rad"})
            file[name].attrs.update({"scale_factor": 2.0**-30, "add_offset": 0.25})


@pytest.mark.parametrize(
    ("stored", "attributes", "expected"),
    [
        (
            np.int16([-2, 3, 7]),
            {"_Unsigned": "true", "_FillValue": np.int16(7)},
            [65534, 3, np.nan],
        ),
        (np.int32([-(2**31), 3]), {"_Unsigned": "true", "scale_factor": 0.5}, [2**30, 1.5]),
        (np.int16([-2, 3]), {"scale_factor": [0.1]}, [-0.2, 3 * 0.1]),
        (np.int16([-2, 3]), {"scale_factor": np.float32(0.5), "add_offset": 0.25}, [-0.75, 1.75]),
        (
            np.int32([2**24 + 1, 5]),
            {"scale_factor": np.float32(0.5), "_FillValue": np.int32(5)},
            [2**23 + 0.5, np.nan],
        ),
        (
            np.int32([2**30 + 1, 3]),
            {"scale_factor": np.float32(0.5), "missing_value": np.int32(2**30 + 1)},
            [np.nan, 1.5],
        ),
    ],
)
def test_integers_are_unpacked_in_double_precision(
    tmp_path: Path, stored: Any, attributes: Mapping[str, Any], expected: list[float]
) -> None:
    path = tmp_path / "packed.h5"
    with h5py.File(path, "w") as file:
        file["angle"] = stored
        file["angle"].attrs.update(attributes)
    np.testing.assert_array_equal(read_in_worker((path, "", ""))["angle"].values, expected)


def test_unsigned_integers_of_netcdf_3_are_read(tmp_path: Path) -> None:
    path = tmp_path / "packed.nc"
    with scipy.io.netcdf_file(path, "w") as file:
        file.createDimension("time", 2)
        angle = file.createVariable("angle", "i2", ("time",))
        angle[:] = [-2, 3]
        for name, value in {"_Unsigned": "true", "scale_factor": 0.5}.items():
            setattr(angle, name, value)
    np.testing.assert_array_equal(read_in_worker((path, "", ""))["angle"].values, [32767.0, 1.5])


def units_in_arrays(path: Path) -> None:
    with h5py.File(path, "w") as file:
        for name, values in TABLE.items():
            unit = "s" if name == "time" else "rad/s" if "rate" in name else "rad"
            file[name] = values
            file[name].attrs["units"] = np.array([unit.encode()])


def durations(path: Path) -> None:
    times = (np.round(1e3 * TIME)).astype("timedelta64[ms]").astype("timedelta64[ns]")
    arrays = {"angles": (("time", "coordinate"), ANGLES), "rates": (("time", "coordinate"), RATES)}
    xr.Dataset(arrays, coords={"time": times}).to_netcdf(path, engine="h5netcdf")


def dated_times(path: Path) -> None:
    attributes = {"units": "seconds since 2020-01-01 00:00:00"}
    arrays = {
        "q": (("time", "c"), ANGLES),
        "qd": (("time", "c"), RATES),
        "time": ("time", TIME, attributes),
    }
    xr.Dataset(arrays).to_netcdf(path, engine="h5netcdf")


def structure_5(path: Path) -> None:
    scipy.io.savemat(path, {"out": {"t": TIME, "q": ANGLES, "qd": RATES}})


def version_4(path: Path) -> None:
    scipy.io.savemat(path, {"t": TIME, "q": ANGLES, "qd": RATES}, format="4")


def simulink(path: Path) -> None:
    kind = [("values", "O"), ("label", "O"), ("dimensions", "O")]
    signals = np.array([(ANGLES, "q", 4.0), (RATES, "qd", 4.0)], dtype=kind)
    scipy.io.savemat(path, {"yout": {"time": TIME, "signals": signals}})


def matlab_73(path: Path) -> None:
    """A structure as MATLAB's -v7.3 writes it."""
    with h5py.File(path, "w", userblock_size=512) as file:
        group = file.create_group("out")
        group.attrs["MATLAB_class"] = np.bytes_("struct")
        for name, values in {"t": TIME[None, :], "q": ANGLES.T, "qd": RATES.T}.items():
            group[name] = values
            group[name].attrs["MATLAB_class"] = np.bytes_("double")
    with path.open("r+b") as file:
        file.write(b"MATLAB 7.3 MAT-file".ljust(124) + b"\x00\x02IM")


def solution_of_exudyn(path: Path) -> None:
    head = (
        "Exudyn explicit time integration (RK67) solver solution file\ncolumns contain: time, ODE2 "
        "displacements, ODE2 velocities, ODE2 accelerations\nnumber of written coordinates [nODE2, "
        "nVel2, nAcc2, nODE1, nVel1, nAlgebraic, nData] = [4,4,4,0,0,0,0]\n"
    )
    rows = np.column_stack([TIME, ANGLES, RATES, 0.0 * RATES])
    np.savetxt(path, rows, delimiter=",", header=head, comments="#", fmt="%.17g")


def exponents_of_three_digits(path: Path) -> None:
    lines = ["time " + " ".join(name.replace(" ", "_") for name in NAMES)]
    for number, row in enumerate(np.column_stack([TIME, ANGLES, RATES])):
        words = [f"{value:.17g}" for value in row]
        if number == 0:
            assert abs(row[4]) == 0.0
            words[4] = "0.123456-101"
        lines.append(" ".join(words))
    path.write_text("\n".join(lines))


def records(path: Path) -> None:
    path.write_text(pd.DataFrame(TABLE).to_json(orient="records", double_precision=15))


def lines_of_json(path: Path) -> None:
    path.write_text("\n".join(json.dumps(row) for row in pd.DataFrame(TABLE).to_dict("records")))


FILES: dict[str, tuple[str, Callable[[Path], None]]] = {
    "packed": ("data.nc", packed),
    "units in arrays": ("data.h5", units_in_arrays),
    "durations": ("data.nc", durations),
    "dated times": ("data.nc", dated_times),
    "a structure": ("data.mat", structure_5),
    "MATLAB 4": ("data.mat", version_4),
    "Simulink": ("data.mat", simulink),
    "a structure of v7.3": ("data.mat", matlab_73),
    "Exudyn's solution": ("coordinatesSolution.txt", solution_of_exudyn),
    "three digits": ("data.txt", exponents_of_three_digits),
    "records": ("data.json", records),
    "lines of JSON": ("data.jsonl", lines_of_json),
} | {
    f"JSON by {form}": ("data.json", lambda path, form=form: path.write_text(
        pd.DataFrame(TABLE).to_json(orient=form, double_precision=15)))
    for form in ("split", "index", "columns", "table")
}  # fmt: skip


@pytest.mark.parametrize("case", FILES)
def test_files_that_libraries_read(case: str, tmp_path: Path) -> None:
    name, write = FILES[case]
    write(tmp_path / name)
    assert_complete(load_data(tmp_path / name, SCENE), atol=1e-9 if case == "packed" else 2e-14)


def test_the_step_of_packed_numbers_is_their_rounding(tmp_path: Path) -> None:
    packed(tmp_path / "data.nc")
    rounding = load_data(tmp_path / "data.nc", SCENE).rounding
    np.testing.assert_allclose(rounding, 2.0**-31)


def test_missing_values_are_named(tmp_path: Path) -> None:
    """By a fill value of the file, and by the netCDF library's own."""
    gap = np.where(TIME > 0.985, -9999.0, ANGLES[:, 0])
    for path, attributes, missing in (
        (tmp_path / "own.nc", {"_FillValue": -9999.0}, -9999.0),
        (tmp_path / "default.nc", {}, 9.969209968386869e36),
    ):
        with h5py.File(path, "w") as file:
            file["time"], file["rotor"] = TIME, np.where(gap == -9999.0, missing, gap)
            file["rotor"].attrs.update(attributes)
        with pytest.raises(InputError, match="column 'rotor' is nan in row 100 of 101"):
            load_data(path, SCENE)


def test_the_last_of_several_solves_is_read(tmp_path: Path) -> None:
    head = "Exudyn time integration sensor output file\nOutputVariableType = Coordinates\n"
    for solve in (2.0, 1.0):
        with (tmp_path / "sensor.txt").open("ab") as file:
            np.savetxt(
                file,
                np.column_stack([TIME, solve * ANGLES]),
                delimiter=",",
                header=head,
                fmt="%.17g",
            )
    text = (tmp_path / "sensor.txt").read_text().replace("# ", "#")
    (tmp_path / "sensor.txt").write_text(text)
    data = load_data(tmp_path / "sensor.txt", SCENE)
    assert_complete(data, rates=False)
    assert dict(data.unused) == {"rows 1 to 101": "of an earlier solve"}


def test_the_root_group_can_be_chosen_beside_another(tmp_path: Path) -> None:
    with h5py.File(tmp_path / "data.h5", "w") as file:
        for name, values in TABLE.items():
            file[name] = values
        file["info/parameters"] = np.arange(5.0)
        file["comment"] = ["a", "b"]
    with pytest.raises(InputError, match="group = one of info, /"):
        load_data(tmp_path / "data.h5", SCENE)
    data = load_data(tmp_path / "data.h5", SCENE, {"group": "/"})
    assert_complete(data)
    assert dict(data.unused) == {"comment": "no numbers", "info": "another group"}


def test_the_layout_of_pandas_says_what_to_write_instead(tmp_path: Path) -> None:
    with h5py.File(tmp_path / "data.h5", "w") as file:
        file["table/axis0"] = [b"rotor", b"pitch"]
        file["table/axis1"], file["table/block0_values"] = np.arange(3), np.ones((3, 2))
    assert "to_hdf); allowed: a table that other programs can read: to_csv" in refusal(
        "compare", tmp_path / "data.h5", "--scene", "paper/fig11"
    )


# Nothing is dropped


NOT_NUMBERS: dict[str, tuple[str, Callable[[Path], Any], str]] = {
    "null": (
        "data.json",
        lambda path: path.write_text(
            json.dumps(
                {name: values.tolist() for name, values in TABLE.items()}
                | {"pitch 3 rate": [None, *TIME[1:]]}
            )
        ),
        "column 'pitch 3 rate' is null in row 1 of 101",
    ),
    "text in JSON": (
        "data.json",
        lambda path: path.write_text(
            json.dumps(
                {name: values.tolist() for name, values in TABLE.items()}
                | {"pitch 3 rate": [*TIME[1:], "x"]}
            )
        ),
        "column 'pitch 3 rate': row 101 has 'x', no number",
    ),
    "stars": (
        "data.csv",
        lambda path: write_csv(path, {**TABLE, "pitch 3 rate": ["*****", *TIME[1:]]}),
        "column 'pitch 3 rate': row 1 (line 2) has '*****', no number",
    ),
    "a text in the first row": (
        "data.csv",
        lambda path: write_csv(path, {**TABLE, "rotor": ["abc", *TIME[1:]]}),
        "column 'rotor': row 1 (line 2) has 'abc', no number",
    ),
    "NA": (
        "data.csv",
        lambda path: write_csv(path, {**TABLE, "rotor": ["NA", *TIME[1:]]}),
        "column 'rotor': row 1 (line 2) has 'NA', no number",
    ),
    "texts in HDF5": (
        "data.h5",
        lambda path: xr.Dataset(
            {"time": ("t", TIME), "rotor": ("t", TIME), "pitch_1": ("t", ["a"] * 101)}
        ).to_netcdf(path, engine="h5netcdf"),
        "column 'pitch_1': no numbers",
    ),
}


@pytest.mark.parametrize("case", NOT_NUMBERS)
def test_a_channel_without_numbers_ends_with_status_2(case: str, tmp_path: Path) -> None:
    name, write, message = NOT_NUMBERS[case]
    write(tmp_path / name)
    line = refusal("compare", tmp_path / name, "--scene", "paper/fig11")
    assert f"{name}: {message}" in line


@pytest.mark.parametrize(
    ("values", "message"),
    [
        ([None, *TIME[1:]], "is nan in row 1 of 101"),
        ([pd.NA, *TIME[1:]], "is nan in row 1 of 101"),
        (["0.1"] * 101, "row 1 has '0.1', no number"),
        (np.array(["a"] * 101), "row 1 has 'a', no number"),
        (TIME > 0.5, "true or false, no numbers"),
        (TIME + 1j, "complex numbers; allowed: real numbers"),
        (np.full(101, "2020-01-01", "datetime64[s]"), "dates, no numbers"),
    ],
)
def test_an_array_without_numbers_that_is_named_as_a_channel_is_refused(
    values: Any, message: str
) -> None:
    arrays = {**TABLE, "pitch 3 rate": values}
    with pytest.raises(InputError, match=f"data: column 'pitch 3 rate'.*{message}"):
        load_data(arrays, SCENE)
    # Unless it is omitted, or another column is that channel.
    left_out = load_data(arrays, SCENE, {"omit": ["pitch_3_rate"]})
    assert "pitch 3 rate" in left_out.unused
    assert load_data({**arrays, "w": RATES[:, 3]}, SCENE, {"pitch_3_rate": "w"}).columns == list(
        range(8)
    )


def test_every_column_is_compared_or_listed_with_the_reason() -> None:
    arrays = TABLE | {
        "wind": TIME,
        "status": ["good"] * 101,
        "sampling": 100.0,
        "title": "run 7",
        "w": RATES[:, 3],
    }
    mapping = {"pitch_3_rate": "w", "omit": ["pitch_1_rate"]}
    data = load_data(arrays, SCENE, mapping)
    assert data.columns == [0, 1, 2, 3, 4, 6, 7]
    assert dict(data.unused) == {
        "pitch 1 rate": "pitch 1 rate is omitted",
        "pitch 3 rate": "pitch 3 rate is mapped to 'w'",
        "wind": "no channel has this name",
        "status": "row 1 has 'good', no number",
        "sampling": "one number",
        "title": "a text",
    }
    only = load_data(arrays, SCENE, {"only": ["rotor", "pitch_1"]})
    assert only.columns == [0, 1]
    assert only.unused["pitch 2"] == "pitch 2 is not in `only`"
    assert set(only.unused) | {"time", "rotor", "pitch 1"} == set(arrays)


def test_a_text_column_beside_numbers_is_listed(tmp_path: Path) -> None:
    write_csv(tmp_path / "data.csv", {**TABLE, "state": ["running"] * 101})
    data = load_data(tmp_path / "data.csv", SCENE)
    assert_complete(data)
    assert dict(data.unused) == {"state": "row 1 (line 2) has 'running', no number"}


def test_a_mapping_adds_to_what_is_known_by_name() -> None:
    arrays = {
        "time": TIME,
        "a": -np.degrees(ANGLES[:, 0]),
        **{name: BY_NAME[name] for name in NAMES[1:]},
    }
    data = load_data(arrays, SCENE, {"rotor": {"column": "a", "unit": "deg", "sign": -1}})
    assert_complete(data)


def test_loads_that_are_left_out_are_said_and_no_ok_stands_without_them() -> None:
    run = rm.run(SCENE, "reference")
    arrays = {
        "time": run.time,
        "angles": run.angles,
        "rates": run.rates,
        "shaft_moment_y": 1e6 + run.time,
    }
    wrong = rm.compare(arrays, SCENE)
    assert wrong.status == "inaccurate"
    # A mapping of angles alone does not hide them.
    mapped = rm.compare(arrays, SCENE, columns={"rotor": "angles[0]"})
    assert mapped.status == "inaccurate"
    angles = ["rotor", "pitch_1", "pitch_2", "pitch_3"]
    restricted = rm.compare(arrays, SCENE, columns={"only": angles})
    assert restricted.status == "unchecked"
    assert "loads of the data that are not compared: shaft moment y" in restricted.message
    assert 'omit = ["shaft_moment_y"]' in restricted.message
    assert (
        rm.compare(arrays, SCENE, columns={"only": angles, "omit": ["shaft_moment"]}).status == "ok"
    )


def test_rates_by_der_are_judged() -> None:
    run = rm.run(SCENE, "reference")
    arrays = {"time": run.time, "phi": run.angles[:, 0], "der(phi)": 1.7 * run.rates[:, 0]}
    arrays |= entries("theta{}", 1, run.angles[:, 1:])
    found = rm.compare(arrays, SCENE)
    assert found.status == "inaccurate"
    assert found.likely == ("rotor rate: too large by a factor of 1.7",)
