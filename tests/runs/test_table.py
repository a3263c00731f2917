"""Tables of runs: valid and readable at every moment, and nothing lost however a writer ends."""

from __future__ import annotations

import signal
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from support.scenes import paper

from rotor_mbs.errors import InputError, StoreError
from rotor_mbs.runs.design import CHARACTER, COLUMNS, MISSING, RunRequest, results_tables
from rotor_mbs.runs.hdf5 import CHARACTERS, Column, TableSpec
from rotor_mbs.runs.layout import create_file
from rotor_mbs.runs.merge import fit_file_to_request
from rotor_mbs.runs.output_files import locked
from rotor_mbs.runs.read import points_table, read_records
from rotor_mbs.runs.rows import RowLocation, Rows, blank_rows, characters, text_of
from rotor_mbs.runs.table import TableFile
from rotor_mbs.solution.status import STATUSES

ROWS, SAMPLES = 23, 5
ENGINES = ("h5netcdf", "netcdf4")


def _table() -> TableSpec:
    time = (
        Column(("time",), "s", "time", attributes={"standard_name": "time"}),
        np.linspace(0.0, 1.0, SAMPLES),
    )
    computed = {
        "status": COLUMNS["status"],
        "message": Column(("run", CHARACTERS), "1", "message", CHARACTER),
        "steps": Column(("run",), "1", "steps", "<i8"),
        "angles": Column(("run", "time"), "rad", "angles"),
        "crc32": Column(("run",), "1", "checksum", "<u4"),
    }
    known = {
        "time": time,
        "stiffness": (Column(("run",), "N m/rad", "stiffness"), np.arange(ROWS, dtype=float)),
    }
    return TableSpec("", np.arange(ROWS), known, computed, characters=40)


def _stored(path: Path) -> TableSpec:
    return TableFile(path).tables[""]


def _rows(place: RowLocation, first: int, count: int) -> Rows:
    rows = blank_rows(count, place.row_type)
    rows["status"][:], rows["steps"][:] = 0, 7
    rows["angles"][:] = np.arange(first, first + count)[:, None]
    rows["message"][:] = characters("αβγ", 40)
    return rows


@pytest.fixture
def path(tmp_path: Path) -> Path:
    made = tmp_path / "t.h5"
    with create_file(made, [_table()], {"title": "t"}):
        pass
    return made


def _fill(path: Path, starts: range) -> None:
    place = _stored(path).place()
    for first in starts:
        count = min(4, ROWS - first)
        place.at(first).write(_rows(place, first, count))


def _missing(path: Path) -> list[int]:
    table = _stored(path)
    return np.flatnonzero(table.statuses() == MISSING).tolist()


@pytest.mark.parametrize("engine", ENGINES)
def test_xarray_opens_it_at_every_moment(path: Path, engine: str) -> None:
    import xarray as xr

    for first in range(0, ROWS, 4):
        with xr.open_dataset(path, engine=engine) as data:
            assert (data.status.values != MISSING).sum() == first
        _fill(path, range(first, first + 1))
    with xr.open_dataset(path, engine=engine) as data:
        assert data.angles.dims == ("run", "time")
        assert data.angles.sel(run=17).values.tolist() == [17.0] * SAMPLES
        assert data.message.values.tolist() == ["αβγ"] * ROWS
        assert data.time.attrs["standard_name"] == "time"
        assert data.stiffness.attrs["units"] == "N m/rad"
        assert data.status.attrs["flag_meanings"].split() == ["missing", *STATUSES]
        assert "method" not in {*data.dims, *data.variables}


def test_rows_of_another_number_do_not_count(path: Path) -> None:
    """Bytes that are copied to another row have the wrong checksum."""
    place = _stored(path).place()
    place.write(_rows(place, 0, 1))
    rows = place.read(1)
    moved = _stored(path).place(3)
    with path.open("r+b") as file:
        for name, values in rows.items():
            file.seek(moved.offsets[name])
            file.write(values.tobytes())
    assert _missing(path) == list(range(1, ROWS))


def test_a_worker_of_an_earlier_file_does_not_write_to_its_successor(path: Path) -> None:
    place = _stored(path).place()
    path.rename(path.with_name("kept.h5"))  # keeps its inode from being used again
    with create_file(path, [_table()], {"title": "t"}):
        pass
    before = path.read_bytes()
    for write in (lambda: place.write(_rows(place, 0, 1)), lambda: place.mark_missing([0])):
        with pytest.raises(StoreError, match="has been replaced by another file"):
            write()
    assert path.read_bytes() == before


def test_texts_are_cut_at_whole_characters() -> None:
    assert text_of(characters("aβ", 2)) == "a"
    assert text_of(characters("aβ", 3)) == "aβ"


# Making a file fit what is asked


def _asked(*methods: str, **changes: object) -> list[RunRequest]:
    scene = paper("fig08").replace(duration=1.0, samples=11, **changes)
    return [RunRequest(scene, method) for method in methods]


def _write(file: TableFile, run: str, value: float) -> None:
    place = file.place(run)
    row = blank_rows(1, place.row_type)
    row["status"][0], row["samples"][0], row["angles"][:] = 0, 11, value
    place.write(row)


def _runs(path: Path) -> list[str]:
    file = TableFile(path)
    return [run for run in list(file.tables["runs"].runs) if file.place(run).is_stored]


def test_more_rows_keep_those_that_are_stored(tmp_path: Path) -> None:
    path, first = tmp_path / "r.h5", "paper/fig08/lagrange/taylor"
    _write(
        fit_file_to_request(path, results_tables(_asked("reference", "lagrange/taylor"))),
        first,
        1.0,
    )
    file = fit_file_to_request(
        path, results_tables(_asked("exudyn_chain/generalized_alpha", "lagrange/taylor"))
    )
    assert _runs(path) == [first]
    assert (file.place(first).read()["angles"] == 1.0).all()
    assert file.tables["paper/fig08"].runs.tolist() == [
        "reference", "lagrange/taylor", "exudyn_chain/generalized_alpha",
    ]  # fmt: skip
    # a column that it does not have
    assert np.isnan(file.place(first).read()["constraint_error"]).all()


def test_the_tables_of_a_new_file_are_known_without_reading_it(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    path = tmp_path / "r.h5"
    with monkeypatch.context() as patch:
        patch.setattr("rotor_mbs.runs.table.read_groups", None)
        laid = fit_file_to_request(path, results_tables(_asked("reference", "lagrange/taylor")))
    read = TableFile(path)
    assert laid.groups == read.groups
    for group, table in read.tables.items():
        assert (laid.tables[group].offsets, laid.tables[group].inode) == (
            table.offsets,
            table.inode,
        )
        assert laid.tables[group].row_type == table.row_type
        assert laid.tables[group].known_rows == table.known_rows


def test_runs_of_other_numbers_are_not_dropped_without_being_computed_again(tmp_path: Path) -> None:
    path = tmp_path / "r.h5"
    _write(
        fit_file_to_request(path, results_tables(_asked("lagrange/taylor"))),
        "paper/fig08/lagrange/taylor",
        1.0,
    )
    with pytest.raises(
        InputError, match="has a run of lagrange/taylor with other numbers of this scene"
    ):
        fit_file_to_request(path, results_tables(_asked("exudyn_tree/rk67", gravity=9.81)))
    assert _runs(path) == ["paper/fig08/lagrange/taylor"]
    fit_file_to_request(path, results_tables(_asked("lagrange/taylor", gravity=9.81)))
    assert _runs(path) == []


def test_tables_of_other_studies_stay_beside_the_runs(tmp_path: Path) -> None:
    path = tmp_path / "r.h5"
    fit_file_to_request(path, results_tables(_asked("lagrange/taylor")))
    point = {
        "run": "a",
        "scene": "paper/fig08",
        "method_name": "lagrange/taylor",
        "step": 0.5,
        "tolerance": np.nan,
    }
    file = fit_file_to_request(path, [points_table("stability", [point])])
    place = file.place("a", "stability")
    place.write(place.encode({"status": "ok", "angle_error_max": 0.25}))
    file = fit_file_to_request(path, results_tables(_asked("lagrange/taylor", "exudyn_tree/rk67")))
    assert file.place("a", "stability").is_stored
    assert file.place("a", "stability").read()["angle_error_max"].tolist() == [0.25]
    assert (
        fit_file_to_request(path, [points_table("stability", [point])])
        .place("a", "stability")
        .is_stored
    )
    changed = fit_file_to_request(path, [points_table("stability", [point | {"step": 0.25}])])
    assert not changed.place("a", "stability").is_stored
    file = fit_file_to_request(path, [], replaced=[("stability", "paper/fig08", "lagrange/taylor")])
    assert "stability" not in file.groups


def test_steps_that_a_ladder_omits_have_no_row_and_no_message(tmp_path: Path) -> None:
    steps = {
        "a": (0.5, "left_out", ""),
        "b": (0.25, "inaccurate", "too long"),
        "c": (0.1, "ok", ""),
    }
    points = []
    for label, (step, _, _) in steps.items():
        names = {"run": label, "scene": "paper/fig08", "method_name": "lagrange/taylor"}
        points.append({**names, "step": step, "tolerance": np.nan})
    file = fit_file_to_request(tmp_path / "s.h5", [points_table("stability", points)])
    for label, (_, status, message) in steps.items():
        place = file.place(label, "stability")
        place.write(place.encode({"status": status, "message": message}))
    (ladder,) = read_records(tmp_path / "s.h5", "stability")
    assert ladder.arrays["step"].tolist() == [0.25, 0.1]
    assert ladder.statuses == ["inaccurate", "ok"]
    assert ladder.messages == ["too long", ""]


@pytest.mark.parametrize("engine", ENGINES)
def test_a_results_file_opens_in_one_call_and_methods_are_told_by_label(
    results: Path, engine: str
) -> None:
    import xarray as xr

    with xr.open_datatree(results, engine=engine) as tree:
        data = tree["paper/fig11"].ds
        off = abs(data.angles - data.angles.sel(run="reference"))
        assert float(off.sel(run="reference").max()) == 0.0
        # rad, to the horizon
        assert 0.0 < float(off.sel(run="exudyn_tree/rk67").isel(time=slice(600)).max()) < 1e-9
        overview = tree["runs"].ds.to_dataframe()
        assert overview.loc["paper/fig11/lagrange/dop853", "method_name"] == "lagrange/dop853"
        assert overview["steps"]["paper/fig11/exudyn_tree/rk67"] > 0


# Locks


def test_no_other_process_writes_a_locked_output(path: Path) -> None:
    program = (
        "import sys, pathlib\nfrom rotor_mbs.runs.output_files import locked\nwith "
        "locked(pathlib.Path(sys.argv[1])):\n    print('locked', flush=True)\n    "
        "sys.stdin.read()\n"
    )
    other = subprocess.Popen(
        [sys.executable, "-c", program, str(path)],
        stdin=subprocess.PIPE,
        stdout=subprocess.PIPE,
        text=True,
    )
    assert other.stdout is not None
    assert other.stdout.readline() == "locked\n"
    with (
        pytest.raises(InputError, match=f"another process is writing it now .process {other.pid}"),
        locked(path),
    ):
        pass
    other.send_signal(signal.SIGKILL)
    other.communicate()
    with locked(path), locked(path):  # its lock ended with it; the same thread may enter it again
        pass
    assert {entry.name for entry in path.parent.iterdir()} == {path.name}
