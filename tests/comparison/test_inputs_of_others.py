"""Inputs that were once misread, each with the verdict that it must have; the numbers are a run of
this program.

Formats are read in this process: that a process of its own does it is shown in
test_foreign_files.py.
"""

from __future__ import annotations

import json
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import h5py
import numpy as np
import pandas as pd
import pytest
import scipy.io
import xarray as xr
from support import references
from support.scenes import paper

import rotor_mbs as rm

pytestmark = pytest.mark.usefixtures("files_read_here")

SCENE = paper("fig11", duration=1.0, samples=101)
Array = Any


@pytest.fixture(scope="module")
def run() -> rm.Run:
    return rm.run(SCENE, "lagrange/dop853")


def named(run: rm.Run, angle: str, rate: str = "", first: int = 0) -> dict[str, Array]:
    """The columns of a run, by names with a number: "q[{}]"."""
    columns = {"time": run.time}
    columns |= {angle.format(first + i): run.angles[:, i] for i in range(4)}
    if rate:
        columns |= {rate.format(first + i): run.rates[:, i] for i in range(4)}
    return columns


def by_name(run: rm.Run) -> dict[str, Array]:
    labels = run.scene.coordinate_labels
    columns = {"time": run.time} | {label: run.angles[:, i] for i, label in enumerate(labels)}
    return columns | {f"{label} rate": run.rates[:, i] for i, label in enumerate(labels)}


def unit_of(name: str) -> str:
    return "s" if name == "time" else "rad/s" if "rate" in name else "rad"


def csv(path: Path, columns: Mapping[str, Array], form: str | None = None) -> None:
    pd.DataFrame(columns).to_csv(path, index=False, float_format=form)


def float32(path: Path, run: rm.Run, *names: str) -> None:
    np.savez(path, **{name: getattr(run, name).astype(np.float32) for name in ("time", *names)})


def null_rate(path: Path, run: rm.Run) -> None:
    columns = {name: values.tolist() for name, values in by_name(run).items()}
    columns["pitch 3 rate"] = [None, *(1.7 * run.rates[1:, 3]).tolist()]
    path.write_text(json.dumps(columns))


def derivatives(path: Path, run: rm.Run) -> None:
    names = ["phi", "theta1", "theta2", "theta3"]
    columns = {"time": run.time} | dict(zip(names, run.angles.T, strict=True))
    csv(path, columns | {f"der({name})": 1.7 * run.rates[:, i] for i, name in enumerate(names)})


def records(path: Path, run: rm.Run) -> None:
    path.write_text(json.dumps(pd.DataFrame(by_name(run)).to_dict("records")))


def root_and_group(path: Path, run: rm.Run) -> None:
    with h5py.File(path, "w") as file:
        file["time"], file["angles"], file["rates"] = run.time, run.angles, run.rates
        file["info/parameters"] = np.arange(5.0)


def packed(path: Path, run: rm.Run, step: float = 1e-8) -> None:
    with h5py.File(path, "w") as file:
        file["time"] = run.time
        for name, values in by_name(run).items():
            if name != "time":
                whole = np.round((values - 0.25) / step)
                # As a processor rounds what does not fit.
                whole = np.where(np.abs(whole) < 2.0**31, whole, -(2.0**31))
                file[name] = whole.astype(np.int32)
                file[name].attrs.update(
                    {"scale_factor": [step], "add_offset": [0.25], "units": unit_of(name)}
                )


def missing_rows(path: Path, run: rm.Run) -> None:
    with h5py.File(path, "w") as file:
        file["time"] = run.time
        for i, name in enumerate(run.scene.coordinate_labels):
            file[name] = np.where(run.time > 0.975, -9999.0, run.angles[:, i])
            file[name].attrs["_FillValue"] = -9999.0


def units_in_array(path: Path, run: rm.Run) -> None:
    with h5py.File(path, "w") as file:
        for name, values in by_name(run).items():
            file[name] = values
            file[name].attrs["units"] = np.array([unit_of(name).encode()])


def timedelta(path: Path, run: rm.Run) -> None:
    times = np.round(1e3 * run.time).astype("timedelta64[ms]").astype("timedelta64[ns]")
    arrays = {"angles": (("time", "coordinate"), run.angles)}
    xr.Dataset(arrays, coords={"time": times}).to_netcdf(path, engine="h5netcdf")


def in_degrees(run: rm.Run) -> xr.Dataset:
    arrays = {"angles": (("time", "coordinate"), np.degrees(run.angles), {"units": "degrees"})}
    return xr.Dataset(arrays, coords={"time": run.time})


def matlab(path: Path, run: rm.Run, *, is_struct: bool) -> None:
    arrays = {"t": run.time, "q": run.angles, "qd": run.rates}
    scipy.io.savemat(
        path, {"out": arrays} if is_struct else arrays, format="5" if is_struct else "4"
    )


def solution_of_exudyn(path: Path, run: rm.Run) -> None:
    head = (
        "Exudyn explicit time integration (RK67) solver solution file\nnumber of written "
        "coordinates [nODE2, nVel2, nAcc2, nODE1, nVel1, nAlgebraic, nData] = [4,4,4,0,0,0,0]\n"
    )
    rows = np.column_stack([run.time, run.angles, run.rates, 0.0 * run.rates])
    np.savetxt(path, rows, delimiter=",", header=head, comments="#", fmt="%.17g")


def fortran(path: Path, run: rm.Run, first: str) -> None:
    """The last number of the first row as `first`."""
    columns = by_name(run)
    lines = [" ".join(name.replace(" ", "_") for name in columns)]
    lines += [" ".join(f"{value:.12e}" for value in row) for row in np.array([*columns.values()]).T]
    lines[1] = f"{lines[1].rpartition(' ')[0]} {first}"
    path.write_text("\n".join(lines))


def events_at_ends(path: Path, run: rm.Run) -> None:
    csv(path, {name: values[[0, *range(101), 100]] for name, values in by_name(run).items()})


def below_zero(path: Path, run: rm.Run) -> None:
    csv(path, by_name(run) | {"time": np.append(-1e-17, run.time[1:])})


def rotor_late(path: Path, run: rm.Run) -> None:
    csv(path, by_name(run) | {"rotor": run.angles[[0, *range(100)], 0]})


def solver_steps(path: Path, run: rm.Run, name_of_time: str = "time") -> None:
    """Rows of unequal steps, of which the times alone are rounded, to 1 ms."""
    fine = rm.run(SCENE.replace(samples=6001), "lagrange/dop853")
    rows = np.cumsum(np.random.default_rng(3).integers(40, 80, 150))
    rows = np.append(0, rows[rows < 6001])
    columns = {name: values[rows] for name, values in by_name(fine).items()}
    assert len(run.time) == 101
    times = np.round(columns.pop("time"), 3)
    csv(path, {name_of_time: np.round(1e3 * times) if "ms" in name_of_time else times} | columns)


@dataclass(frozen=True)
class Case:
    """An input, and what must become of it: a status, or the beginning of a refusal."""

    name: str
    write: Callable[[Path, rm.Run], None]
    status: str = "ok"
    refusal: str = ""
    likely: str = ""
    note: str = ""
    columns: dict[str, Any] = field(default_factory=dict)


CASES = {
    "single precision": Case("a.npz", lambda p, r: float32(p, r, "angles", "rates")),
    "single precision, no rates": Case(
        "a.npz", lambda p, r: float32(p, r, "angles"), note="times of single precision"
    ),
    "null": Case("a.json", null_rate, refusal="column 'pitch 3 rate' is null in row 1 of 101"),
    "derivatives": Case(
        "a.csv", derivatives, "inaccurate", likely="pitch 3 rate: too large by a factor of 1.7"
    ),
    "q from 1": Case("a.csv", lambda p, r: csv(p, named(r, "q[{}]", "qd[{}]", 1))),
    "angles from 1": Case("a.csv", lambda p, r: csv(p, named(r, "angles[{}]", first=1))),
    "two indices": Case("a.csv", lambda p, r: csv(p, named(r, "q[{},1]", first=1))),
    "records": Case("a.json", records),
    "a group beside the root": Case("a.h5", root_and_group, refusal="arrays in several groups"),
    "the root beside a group": Case("a.h5", root_and_group, columns={"group": "/"}),
    "packed": Case("a.nc", packed),
    "packed, too large": Case(
        "a.nc",
        lambda p, r: packed(p, r, 1e-9),
        refusal="has -2147483648, packed from a number that did not fit",
    ),
    "missing rows": Case("a.nc", missing_rows, refusal="column 'rotor' is nan in row 99 of 101"),
    "units in arrays": Case("a.h5", units_in_array),
    "timedelta": Case("a.nc", timedelta),
    "degrees in a file": Case("a.nc", lambda p, r: in_degrees(r).to_netcdf(p, engine="h5netcdf")),
    "a struct": Case("a.mat", lambda p, r: matlab(p, r, is_struct=True)),
    "MATLAB 4": Case("a.mat", lambda p, r: matlab(p, r, is_struct=False)),
    "Exudyn's solution": Case("coordinatesSolution.txt", solution_of_exudyn),
    "stars": Case(
        "a.txt",
        lambda p, r: fortran(p, r, "*******"),
        refusal="row 1 (line 2) has '*******', no number",
    ),
    "three digits": Case("a.txt", lambda p, r: fortran(p, r, "0.123456-101")),
    "events": Case("a.csv", events_at_ends, note="2 rows are there twice"),
    "below zero": Case("a.csv", below_zero),
    "rotor a row late": Case("a.csv", rotor_late, "inaccurate", likely="rotor: a row late"),
    "steps of a solver": Case("a.csv", solver_steps, note="times of 3 decimals"),
    "steps in ms": Case(
        "a.csv",
        lambda p, r: solver_steps(p, r, "time [ms]"),
        note="times of 0 decimals: rounding error 5e-01 ms",
    ),
}
# The four that were `ok` and wrong, and one of each further family.
FAST = {
    "single precision",
    "null",
    "derivatives",
    "a group beside the root",
    "packed, too large",
    "events",
}


@pytest.mark.parametrize(
    "case", [pytest.param(case, marks=() if case in FAST else pytest.mark.full) for case in CASES]
)
def test_an_input_has_its_verdict(case: str, run: rm.Run, tmp_path: Path) -> None:
    expected = CASES[case]
    expected.write(tmp_path / expected.name, run)
    if expected.refusal:
        with pytest.raises(rm.InputError) as caught:
            rm.compare(tmp_path / expected.name, SCENE)
        (line,) = caught.value.problems
        assert expected.refusal in line
        return
    compared = rm.compare(tmp_path / expected.name, SCENE, columns=expected.columns or None)
    assert compared.status == expected.status, compared.message
    assert any(expected.likely in text for text in compared.likely) or not expected.likely
    assert any(expected.note in note for note in compared.verdict.notes) or not expected.note


def test_tables_in_memory_have_the_verdict_of_their_files(run: rm.Run) -> None:
    assert rm.compare(in_degrees(run), SCENE).status == "ok"
    columns = {(name, unit_of(name)): values for name, values in by_name(run).items()}
    assert rm.compare(pd.DataFrame(columns), SCENE).status == "ok"


@pytest.mark.full
def test_single_precision_of_a_whole_run_is_ok() -> None:
    """Over the horizon, where errors grow: rows of 10 s, with and without rates."""
    run = rm.run("paper/fig11", "lagrange/dop853")
    columns = {"time": run.time.astype(np.float32), "angles": run.angles.astype(np.float32)}
    for rates in ({}, {"rates": run.rates.astype(np.float32)}):
        assert rm.compare(columns | rates, "paper/fig11").status == "ok"


# Times


def motion(run: rm.Run, rows: Any) -> dict[str, Array]:
    return {"time": run.time[rows], "angles": run.angles[rows], "rates": run.rates[rows]}


@pytest.mark.parametrize(
    ("rows", "note"),
    [
        (np.arange(101)[::-1], "the rows are from the end to the start: sorted"),
        (
            np.random.default_rng(1).permutation(101),
            "the rows are not in the order of their times: sorted",
        ),
    ],
)
def test_rows_in_any_order_are_sorted_with_a_note(rows: Array, note: str, run: rm.Run) -> None:
    compared = rm.compare(motion(run, rows), SCENE)
    assert compared.status == "ok"
    assert note in compared.verdict.notes


def test_rows_before_the_start_are_left_out_with_a_note(run: rm.Run) -> None:
    columns = motion(run, np.r_[0, 0, 0:101])
    columns["time"] = np.append([-0.02, -0.01], run.time)
    compared = rm.compare(columns, SCENE)
    assert compared.status == "ok"
    assert "2 rows before t = 0 are not compared" in compared.verdict.notes
    with pytest.raises(rm.InputError, match=r"ends at t = -1 s; allowed: times from 0"):
        rm.compare(columns | {"time": columns["time"] - 2.0}, SCENE)


@pytest.mark.full
def test_two_rows_at_one_time_are_those_beside_a_jump_of_a_load_or_refused() -> None:
    scene = SCENE.replace(**{"torque.rotor": [[0.0, 0.0], [0.5, 0.0], [0.5, 5e4], [1.0, 5e4]]})
    run = rm.run(scene.replace(outputs=["angles", "rates", "loads"]), "lagrange/dop853")
    rows = np.r_[0:51, 50:101]
    columns = motion(run, rows) | {"shaft_moment_y": run.shaft_moment[rows, 1]}
    columns["shaft_moment_y"][50] += 1e4  # the load before the jump
    compared = rm.compare(columns, scene)
    assert compared.status == "ok"
    assert any("before a jump of a load is not compared" in note for note in compared.verdict.notes)
    columns["angles"][50, 1] += 1e-3
    with pytest.raises(
        rm.InputError,
        match=(
            r"the time of row 52, 0\.5 s, repeats that of row 51 "
            r"with other numbers"
        ),
    ):
        rm.compare(columns, scene)
    with pytest.raises(rm.InputError, match="repeats that of row 51 with other numbers"):
        rm.compare(motion(run, rows) | {"shaft_moment_y": np.arange(102.0)}, SCENE)


# Rounding or systematic


def test_a_difference_within_the_tolerance_is_told_with_its_cause() -> None:
    """Without the Coriolis terms the closed form of fig. 8 is 5e-12 rad off in an interval; the
    digits say 1e-16."""
    from support import other_code  # late: SciPy's integrators

    scene = paper("fig08", duration=2.0, samples=201)
    time = np.linspace(0.0, 2.0, 201)
    accurate = {"rtol": 1e-13, "atol": 1e-15}
    angles, _ = other_code.trajectory(scene, time, other_code.Mistakes(coriolis=0.0), **accurate)
    compared = rm.compare({"time": time, "angles": angles}, scene)
    assert compared.status == "ok"
    assert compared.likely == (
        "without the Coriolis terms (products of rotor rate and pitch rate)",
    )
    assert any(
        "times what the digits of the data explain" in note for note in compared.verdict.notes
    )


@pytest.mark.parametrize(
    "digits",
    [4, 10, 15, *(pytest.param(digits, marks=pytest.mark.full) for digits in (7, 12, 14, 16))],
)
def test_right_numbers_of_any_digits_are_not_systematic(digits: int, run: rm.Run) -> None:
    """By the shipped reference, whose own error is below a double's rounding."""
    exact = references.reference("paper/fig11")
    for rates in ({}, {"rates": exact.rates[:101]}):
        columns = {"time": run.time, "angles": exact.angles[:101]} | rates
        written = {
            name: np.vectorize(lambda x: float(f"{x:.{digits - 1}e}"))(values)
            if name != "time"
            else values
            for name, values in columns.items()
        }
        compared = rm.compare(written, SCENE)
        assert compared.status == "ok"
        assert not any("times what the digits" in note for note in compared.verdict.notes), (
            compared.verdict.notes
        )
        assert compared.likely == ()


def test_a_column_of_zeros_with_few_numbers_of_five_digits_has_a_verdict() -> None:
    """A zero has no rounding where the digits are fixed, from 1e-12 to 1e3 here; fewer than a
    twentieth of the rows are another number."""
    fine = rm.run(SCENE.replace(samples=501), "lagrange/dop853")
    columns = by_name(fine)
    sizes = 10.0 ** np.linspace(-12.0, 3.0, 12)
    few = np.zeros(501)
    few[20:500:40] = [float(f"{1.2345 * size:.4e}") for size in sizes]
    columns[fine.scene.coordinate_labels[1]] = few
    compared = rm.compare(columns, SCENE)
    assert compared.status == "inaccurate"
    assert any("5 digits" in note for note in compared.verdict.notes), compared.verdict.notes


def test_digits_of_angles_are_told_beside_rates_with_all_digits(run: rm.Run) -> None:
    columns = by_name(run)
    for label in run.scene.coordinate_labels:
        columns[label] = np.round(columns[label], 4)
    compared = rm.compare(columns, SCENE)
    assert compared.status == "ok"
    assert compared.verdict.notes == (
        "numbers of 4 decimals in 4 of 8 columns: rounding error 5e-05",
    )


@pytest.mark.parametrize("what", [["angles"], ["angles", "rates"]], ids=["angles", "rates, too"])
def test_an_angle_from_a_half_to_one_in_single_precision_is_no_fault(what: list[str]) -> None:
    """Its numbers have 16 digits, as all doubles of that size; half a unit in the last place of
    single precision explains them all the same."""
    scene = paper("fig08", duration=1.0, samples=101)
    run = rm.run(scene, "lagrange/dop853")
    assert 0.5 < run.angles[:, 1].min() < run.angles[:, 1].max() < 1.0
    columns = {"time": run.time} | {name: run[name].astype(np.float32) for name in what}
    compared = rm.compare(columns, scene)
    assert (compared.status, compared.likely) == ("ok", ())
    assert not any("what the digits of the data explain" in note for note in compared.verdict.notes)
