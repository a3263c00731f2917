"""The dataset of a sweep: valid and readable at every moment, and nothing lost however its writer ends."""

from __future__ import annotations

import contextlib
import errno
import os
import resource
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path

import h5py
import numpy as np
import pytest
from rotor_mbs.runs.sweep_columns import MISSING, Rows, RunColumns, parameter_name, row_type
from support.scenes import paper

from rotor_mbs.errors import InputError, StoreError
from rotor_mbs.runs.sweeps import StoredSweep, open_sweep
from rotor_mbs.scenario.sweep import Sweep, sweep_of
from rotor_mbs.solution.status import STATUSES, code_of
from rotor_mbs.studies.sweep_work import empty_rows, lost_rows

_RUNS = 23
Layout = tuple[Sweep, tuple[str, ...], range, dict[str, object]]  # what `open_sweep` takes beside the output
_STARTS = list(range(0, _RUNS, 4))


def _layout(identity: str = "i", samples: int = 5) -> Layout:
    axes = {"bearing.stiffness": np.arange(_RUNS), "initial.angles[1]": 0.1 * np.arange(_RUNS)}
    outputs = ["angles", "energy"]
    sweep = sweep_of(paper("fig11"), axes, combine="zip", samples=samples, outputs=outputs, validation=0.25, test=0.25)
    facts = {"title": "t", "sweep_identity": identity, "parameter_keys": list(sweep.keys)}
    return sweep, ("lagrange/taylor",), range(_RUNS), facts


def _rows(first: int, count: int, layout: Layout) -> Rows:
    rows = empty_rows(count, row_type(layout[0]))
    rows["status"][:] = code_of("ok")
    rows["angles"][:] = np.arange(first, first + count)[:, None, None]
    return rows


@contextlib.contextmanager
def _opened(path: Path, layout: Layout) -> Iterator[tuple[RunColumns, list[int]]]:
    """Where the runs are, and which are missing."""
    with open_sweep(path, *layout) as (runs, statuses):
        yield runs, np.flatnonzero(statuses == MISSING).tolist()
        with h5py.File(path) as file:
            statuses[:] = file["status"][()]


def _fill(runs: RunColumns, layout: Layout, starts: list[int]) -> None:
    for first in starts:
        runs.write(first, _rows(first, min(4, _RUNS - first), layout))


def _whole(folder: Path) -> bytes:
    """The file of an uninterrupted sweep."""
    layout, path = _layout(), folder / "whole.h5"
    with _opened(path, layout) as (runs, _missing):
        _fill(runs, layout, _STARTS)
    return path.read_bytes()


@pytest.mark.parametrize("engine", ["h5netcdf", "netcdf4"])
def test_it_opens_in_xarray_at_every_moment(tmp_path: Path, engine: str) -> None:
    xr = pytest.importorskip("xarray")
    pytest.importorskip({"netcdf4": "netCDF4"}.get(engine, engine))
    layout, path = _layout(), tmp_path / "s.h5"
    with _opened(path, layout) as (runs, _missing):
        for first in _STARTS:
            with xr.open_dataset(path, engine=engine) as data:
                assert (data.status.values != MISSING).sum() == first
            _fill(runs, layout, [first])
    with xr.open_dataset(path, engine=engine) as data:
        assert data.angles.dims == ("run", "time", "coordinate")
        assert data.angles.sel(run=17).values.tolist() == [[17.0] * 4] * 5
        assert data.time.attrs["standard_name"] == "time"
        assert data.bearing_stiffness.values.tolist() == list(range(_RUNS))
        assert data.bearing_stiffness.attrs["units"] == "N m/rad"
        assert data.initial_angles_1.attrs["units"] == "rad"
        assert data.split.attrs["flag_meanings"].split() == ["train", "validation", "test"]
        assert np.bincount(data.split.values).tolist() == [11, 6, 6]
        assert data.status.attrs["flag_meanings"].split() == list(STATUSES)
        assert "method" not in data.dims
        assert "method" not in data.variables


def test_every_dimension_has_its_scale_and_runs_are_contiguous(tmp_path: Path) -> None:
    _whole(tmp_path)
    with h5py.File(tmp_path / "whole.h5") as file:
        for dataset in file.values():
            assert dataset.is_scale or all(len(dimension) == 1 for dimension in dataset.dims), dataset.name
            assert dataset.chunks is None


def test_names_of_parameters_follow_their_keys() -> None:
    keys = ("gravity", "blade[0].inertia[5]", "torque.rotor[0][1]")
    assert list(map(parameter_name, keys)) == ["gravity", "blade_0_inertia_5", "torque_rotor_0_1"]


def test_it_has_the_same_bytes_whatever_the_order_of_its_runs(tmp_path: Path) -> None:
    layout = _layout()
    for name, order in (("a.h5", _STARTS), ("b.h5", _STARTS[::-1])):
        with _opened(tmp_path / name, layout) as (runs, _missing):
            _fill(runs, layout, order)
    assert (tmp_path / "a.h5").read_bytes() == (tmp_path / "b.h5").read_bytes()
    assert {path.name for path in tmp_path.iterdir()} == {"a.h5", "b.h5"}


def test_an_interrupted_one_continues_and_a_complete_one_misses_nothing(tmp_path: Path) -> None:
    layout, path = _layout(), tmp_path / "s.h5"
    with _opened(path, layout) as (runs, missing):
        _fill(runs, layout, [0, 12])
    with _opened(path, layout) as (runs, missing):
        assert missing == [*range(4, 12), *range(16, _RUNS)]
        _fill(runs, layout, [4, 8, 16, 20])
    with _opened(path, layout) as (runs, missing):
        assert missing == []
    assert path.read_bytes() == _whole(tmp_path)


def test_columns_written_without_their_status_do_not_count(tmp_path: Path) -> None:
    """As after a kill between the numbers and the status."""
    layout, path = _layout(), tmp_path / "s.h5"
    with _opened(path, layout) as (runs, missing):
        _fill(runs, layout, [0, 4])
        with h5py.File(path, "r+") as file:
            file["status"][5] = MISSING
    with _opened(path, layout) as (runs, missing):
        assert missing == [5, *range(8, _RUNS)]


@pytest.mark.parametrize("column", ["angles", "crc32", "status", "message", "steps"])
def test_a_flipped_bit_of_any_column_is_found(tmp_path: Path, column: str) -> None:
    layout, path = _layout(), tmp_path / "whole.h5"
    content = bytearray(_whole(tmp_path))
    with h5py.File(path) as file:
        dataset = file[column]
        content[dataset.id.get_offset() + 13 * dataset.id.get_storage_size() // _RUNS] ^= 1
    path.write_bytes(content)
    with _opened(path, layout) as (runs, missing):
        assert missing == [13]
    with h5py.File(path) as file:  # readers see it, too, before it is computed again
        assert file["status"][13] == MISSING
    with _opened(path, layout) as (runs, missing):
        runs.write(13, _rows(13, 1, layout))
    assert path.read_bytes() == _whole(tmp_path / "other")


def test_a_file_that_was_cut_off_is_refused_with_one_line(tmp_path: Path) -> None:
    content, path = _whole(tmp_path), tmp_path / "whole.h5"
    path.write_bytes(content[: len(content) // 2])
    with pytest.raises(StoreError, match="not a readable HDF5 file"), open_sweep(path, *_layout()):
        pass


def test_other_files_are_refused_and_stay(tmp_path: Path) -> None:
    content, path = _whole(tmp_path), tmp_path / "whole.h5"
    with pytest.raises(InputError, match="something else than this sweep"), open_sweep(path, *_layout("another")):
        pass
    assert path.read_bytes() == content
    path.write_text("notes")
    with pytest.raises(StoreError, match="not a readable HDF5 file"), open_sweep(path, *_layout()):
        pass
    assert path.read_text() == "notes"


def test_a_worker_of_an_earlier_sweep_does_not_write_to_another_file_of_that_name(tmp_path: Path) -> None:
    layout, path = _layout(), tmp_path / "s.h5"
    with _opened(path, layout) as (runs, _missing):
        path.rename(tmp_path / "moved.h5")
        path.write_bytes(b"another file")
        with pytest.raises(StoreError, match="another file"):
            runs.write(0, _rows(0, 4, layout))
        (tmp_path / "moved.h5").replace(path)
        _fill(runs, layout, [0])


def test_a_sweep_that_stored_nothing_leaves_nothing(tmp_path: Path) -> None:
    with open_sweep(tmp_path / "s.h5", *_layout()):
        assert (tmp_path / "s.h5").exists()
    assert not list(tmp_path.iterdir())


def test_a_part_without_runs_has_nothing_missing(tmp_path: Path) -> None:
    sweep, methods, _, facts = _layout()
    with open_sweep(tmp_path / "s.h5", sweep, methods, range(3, 3), facts) as (_, statuses):
        assert not len(statuses)


def test_lost_runs_say_why(tmp_path: Path) -> None:
    layout, path = _layout(), tmp_path / "s.h5"
    with _opened(path, layout) as (runs, _missing):
        runs.write(4, lost_rows(1, row_type(layout[0]), "worker_died", "its process died (exit code -9)"))
    stored = StoredSweep(path)
    messages = stored.column("message")
    assert messages[4].tobytes().rstrip(b"\0") == b"its process died (exit code -9)"
    assert not messages[3].any()
    assert STATUSES[stored.column("status")[4]] == "worker_died"
    assert np.isnan(stored.column("angles")[4]).all()


@contextlib.contextmanager
def _largest_file(size: int) -> Iterator[None]:
    """As a full disk does, this stops a file from growing."""
    before = resource.getrlimit(resource.RLIMIT_FSIZE)
    resource.setrlimit(resource.RLIMIT_FSIZE, (size, before[1]))
    try:
        yield
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, before)


def test_a_disk_without_room_is_reported_before_the_first_run(tmp_path: Path) -> None:
    with _largest_file(20_000), pytest.raises(StoreError, match="cannot be written: File too large"):
        open_sweep(tmp_path / "s.h5", *_layout()).__enter__()
    assert not list(tmp_path.iterdir())


@pytest.mark.skipif(not hasattr(os, "posix_fallocate"), reason="takes no space in advance here")
def test_a_full_tmpfs_is_reported_before_the_first_run(tmp_path: Path) -> None:
    place = tmp_path / "small"
    place.mkdir()
    mount = ["mount", "-t", "tmpfs", "-o", "size=1m", "tmpfs", str(place)]
    if os.getuid() or subprocess.run(mount, capture_output=True).returncode:
        pytest.skip("may not mount a tmpfs here")
    try:
        with pytest.raises(StoreError, match=os.strerror(errno.ENOSPC)):
            open_sweep(place / "s.h5", *_layout(samples=2001)).__enter__()
        assert not list(place.iterdir())
        with _opened(place / "s.h5", _layout()) as (runs, _missing):
            _fill(runs, _layout(), _STARTS)
    finally:
        subprocess.run(["umount", "-l", str(place)], check=True)


_HOLDER = """
import sys, time
from filelock import FileLock
lock = FileLock(sys.argv[1])
lock.acquire()
print("locked", flush=True)
time.sleep(60)
"""


def test_a_lock_ends_with_its_process(tmp_path: Path) -> None:
    (tmp_path / "s.h5.parts").mkdir()
    command = [sys.executable, "-c", _HOLDER, str(tmp_path / "s.h5.parts" / "lock")]
    with subprocess.Popen(command, stdout=subprocess.PIPE) as holder:
        assert holder.stdout is not None
        holder.stdout.readline()
        with pytest.raises(InputError, match=r"s\.h5: another process is writing it now; allowed: wait"):
            open_sweep(tmp_path / "s.h5", *_layout()).__enter__()
        holder.kill()
        holder.wait()
    with open_sweep(tmp_path / "s.h5", *_layout()):
        pass
