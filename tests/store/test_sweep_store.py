"""Nothing lost: a sweep's runs on the disk survive any end of the writer, a full disk, a second writer."""

from __future__ import annotations

import contextlib
import errno
import os
import re
import resource
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path
from typing import BinaryIO

import numpy as np
import pytest
from support.scenes import paper

from rotor_mbs.errors import InputError, StoreError
from rotor_mbs.store import hdf5
from rotor_mbs.store.chunk_index import ChunkIndex
from rotor_mbs.store.journal import Journal
from rotor_mbs.store.layout import Column
from rotor_mbs.store.lock import FolderLock
from rotor_mbs.store.sweep_layout import Plan, empty_rows
from rotor_mbs.store.sweep_memory import SparseFile
from rotor_mbs.store.sweep_rows import Receipt, Rows, write_at
from rotor_mbs.store.sweep_store import SweepStore

_RUNS = 23


def _plan(**changes: object) -> Plan:
    facts = {
        "identity": "i",
        "attributes": {"title": "t"},
        "scene": paper("fig11", samples=5),
        "outputs": ("angles", "energy"),
        "precision": "float64",
        "keys": ("gravity",),
        "units": ("m/s^2",),
        "methods": ("lagrange/taylor",),
        "variants": _RUNS,
        "parameters": lambda first, last: np.arange(first, last, dtype=float)[:, None],
        "splits": None,
    }
    return Plan(**{**facts, **changes})  # type: ignore[arg-type]


def _rows(first: int, count: int, plan: Plan) -> Rows:
    rows = empty_rows(count, plan.row)
    rows["angles"][:] = np.arange(first, first + count)[:, None, None]
    return rows


def _journal(path: Path, identity: str = "i") -> Journal:
    return Journal(path, {"identity": identity})


def _found(path: Path, identity: str = "i") -> list[Receipt]:
    journal = _journal(path, identity)
    journal.close()
    return journal.found


_FIRST = Receipt(3, 77, bytes(2), ())
_SECOND = Receipt(9, 78, bytes([1, 6, 0]), ((9, "broke off"), (10, "its process died")))


def test_receipts_come_back_as_they_were(tmp_path: Path) -> None:
    journal = _journal(tmp_path / "j")
    journal.append([_FIRST, _SECOND])
    journal.close()
    assert _found(tmp_path / "j") == [_FIRST, _SECOND]


def test_a_torn_tail_is_cut_off_and_what_was_before_it_stays(tmp_path: Path) -> None:
    path = tmp_path / "j"
    journal = _journal(path)
    journal.append([_FIRST])
    whole = path.stat().st_size
    journal.append([_SECOND])
    journal.close()
    content = path.read_bytes()
    for length in range(whole, len(content)):
        path.write_bytes(content[:length])
        journal = _journal(path)
        assert journal.found == [_FIRST]
        assert path.stat().st_size == whole
        journal.append([_SECOND])
        journal.close()
        assert path.read_bytes() == content


def test_a_damaged_record_is_not_believed(tmp_path: Path) -> None:
    path = tmp_path / "j"
    journal = _journal(path)
    journal.append([_FIRST])
    whole = path.stat().st_size
    journal.append([_SECOND])
    journal.close()
    content = path.read_bytes()
    for place in range(whole, len(content)):
        damaged = bytearray(content)
        damaged[place] ^= 1
        path.write_bytes(damaged)
        assert _found(path) == [_FIRST]


def test_another_sweeps_journal_is_refused(tmp_path: Path) -> None:
    _journal(tmp_path / "j").close()
    with pytest.raises(InputError, match="another sweep"):
        _found(tmp_path / "j", "other")


def test_a_sparse_file_is_a_file(tmp_path: Path) -> None:
    """Random writes over pages and page boundaries, beside the same ones to a real file."""
    rng = np.random.default_rng(0)
    sparse = SparseFile()
    with (tmp_path / "f").open("w+b") as real:
        for place in rng.integers(0, 50_000, 40).tolist():
            content = rng.bytes(int(rng.integers(1, 9000)))
            for file in (sparse, real):
                file.seek(place)
                file.write(content)
        real.seek(0)
        expected = real.read()
    sparse.seek(0)
    assert sparse.read() == expected
    again = bytearray(len(expected))
    ends = [0]
    for place, content in sparse.extents():
        assert place > ends[-1] or place == 0
        again[place : place + len(content)] = content
        ends.append(place + len(content))
    assert (bytes(again), ends[-1]) == (expected, sparse.size)
    sparse.truncate(10)
    assert sparse.size == 10


@contextlib.contextmanager
def _largest_file(size: int) -> Iterator[None]:
    """As a full disk does, this stops a file from growing in the middle of a write."""
    before = resource.getrlimit(resource.RLIMIT_FSIZE)
    resource.setrlimit(resource.RLIMIT_FSIZE, (size, before[1]))
    try:
        yield
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, before)


def test_a_full_disk_loses_nothing_and_the_journal_goes_on(tmp_path: Path) -> None:
    path = tmp_path / "j"
    journal = _journal(path)
    journal.append([_FIRST])
    size = path.stat().st_size
    with _largest_file(size + 10), pytest.raises(StoreError, match="nothing stored before is lost"):
        journal.append([_SECOND])
    assert path.stat().st_size == size
    journal.append([_SECOND])
    journal.close()
    assert _found(path) == [_FIRST, _SECOND]


def _fill(store: SweepStore, plan: Plan, starts: list[int]) -> None:
    for first in starts:
        count = min(4, _RUNS - first)
        store.add([(first, _rows(first, count, plan))])


def _whole(folder: Path) -> bytes:
    """The file of an uninterrupted sweep."""
    plan = _plan()
    with SweepStore(folder / "whole.h5", plan, 0, _RUNS, 10**9) as store:
        _fill(store, plan, list(range(0, _RUNS, 4)))
    return (folder / "whole.h5").read_bytes()


def test_a_disk_that_fills_up_under_the_runs_loses_nothing(tmp_path: Path) -> None:
    plan, output = _plan(), tmp_path / "s.h5"
    with SweepStore(output, plan, 0, _RUNS, 10**9) as store:
        _fill(store, plan, [0, 4])
        with _largest_file(5000), pytest.raises(StoreError, match="nothing stored before is lost"):
            _fill(store, plan, [8])
    with SweepStore(output, plan, 0, _RUNS, 10**9) as store:
        assert store.missing() == [(8, _RUNS)]
        _fill(store, plan, [8, 12, 16, 20])
    assert output.read_bytes() == _whole(tmp_path)


def test_a_disk_that_fills_up_as_the_file_is_completed_loses_nothing(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    plan, output = _plan(), tmp_path / "s.h5"
    places: list[int] = []

    def full(file: BinaryIO, place: int, content: bytes) -> None:
        places.append(place)
        if len(places) > 1:
            raise OSError(errno.ENOSPC, "No space left on device")
        write_at(file, place, content)

    monkeypatch.setattr("rotor_mbs.store.sweep_file.write_at", full)
    with (
        pytest.raises(StoreError, match=r"s\.h5: cannot be written: No space left on device; nothing"),
        SweepStore(output, plan, 0, _RUNS, 10**9) as store,
    ):
        _fill(store, plan, list(range(0, _RUNS, 4)))
    assert not output.exists()
    monkeypatch.undo()
    with SweepStore(output, plan, 0, _RUNS, 10**9) as store:
        assert store.missing() == []
        store.complete()
    assert output.read_bytes() == _whole(tmp_path)
    assert not list(tmp_path.glob("*.parts"))


def _stopped_store(output: Path, plan: Plan) -> Path:
    """A store with runs 0-3 and 12-15; returns its data file."""
    with SweepStore(output, plan, 0, _RUNS, 10**9) as store:
        _fill(store, plan, [0, 12])
    return next(output.with_name(output.name + ".parts").glob("*.data"))


def test_data_that_are_not_what_the_journal_says_are_made_again(tmp_path: Path) -> None:
    plan, output = _plan(), tmp_path / "s.h5"
    data = _stopped_store(output, plan)
    content = bytearray(data.read_bytes())
    place = content.index(np.full(4, 13.0).tobytes())  # the angles of run 13
    content[place] ^= 1
    data.write_bytes(content)
    with SweepStore(output, plan, 0, _RUNS, 10**9) as store:
        assert store.missing() == [(4, _RUNS)]
        _fill(store, plan, [4, 8, 12, 16, 20])
    assert output.read_bytes() == _whole(tmp_path)


@pytest.mark.parametrize("left", [0, 6000])
def test_data_that_were_lost_are_made_again(tmp_path: Path, left: int) -> None:
    plan, output = _plan(), tmp_path / "s.h5"
    os.truncate(_stopped_store(output, plan), left)
    with SweepStore(output, plan, 0, _RUNS, 10**9) as store:
        assert sum(last - first for first, last in store.missing()) > _RUNS - 8
        _fill(store, plan, list(range(0, _RUNS, 4)))
    assert output.read_bytes() == _whole(tmp_path)


def test_runs_that_were_put_but_not_noted_do_not_count(tmp_path: Path) -> None:
    """As after a kill between the two: their numbers are there, their receipt is not."""
    plan, output = _plan(), tmp_path / "s.h5"
    with SweepStore(output, plan, 0, _RUNS, 10**9) as store:
        _fill(store, plan, [0])
        store.places(4, 8).put(_rows(4, 4, plan))
    with SweepStore(output, plan, 0, _RUNS, 10**9) as store:
        assert store.missing() == [(4, _RUNS)]


def test_a_finished_file_beside_its_journal_is_finished(tmp_path: Path) -> None:
    """As after a kill between the last two steps."""
    plan, output = _plan(), tmp_path / "whole.h5"
    _stopped_store(output, plan)
    journal = next(tmp_path.glob("*.parts/*.journal"))
    kept = journal.read_bytes()
    content = _whole(tmp_path)
    journal.parent.mkdir()
    journal.write_bytes(kept)
    with SweepStore(output, plan, 0, _RUNS, 10**9) as store:
        assert store.missing() == []
    assert output.read_bytes() == content
    assert not list(tmp_path.glob("*.parts"))


def test_a_sweep_that_stored_nothing_leaves_nothing(tmp_path: Path) -> None:
    with SweepStore(tmp_path / "s.h5", _plan(), 0, _RUNS, 10**9) as store:
        store.places(0, 4)
    assert not list(tmp_path.iterdir())


def test_the_dataset_has_the_same_bytes_whatever_the_order_of_its_runs(tmp_path: Path) -> None:
    plan, starts = _plan(), list(range(0, _RUNS, 4))
    for name, order in (("a.h5", starts), ("b.h5", starts[::-1])):
        with SweepStore(tmp_path / name, plan, 0, _RUNS, 10**9) as store:
            _fill(store, plan, order)
    assert (tmp_path / "a.h5").read_bytes() == (tmp_path / "b.h5").read_bytes()
    assert not list(tmp_path.glob("*.parts"))


def test_files_of_bounded_size_share_out_the_runs(tmp_path: Path) -> None:
    plan, most = _plan(), 73_500  # ten runs a file
    with SweepStore(tmp_path / "s.h5", plan, 0, _RUNS, most) as store:
        _fill(store, plan, list(range(0, _RUNS, 4)))
        assert (store.statuses == 0).all()
    assert all(path.stat().st_size <= most for path in tmp_path.glob("*.h5"))
    xr = pytest.importorskip("xarray")
    names = sorted(path.name for path in tmp_path.glob("*.h5"))
    assert names == ["s-0001.h5", "s-0002.h5", "s-0003.h5"]
    runs: list[int] = []
    for name in names:
        with xr.open_dataset(tmp_path / name, engine="h5netcdf") as data:
            runs += data.run.values.tolist()
            for run in data.run.values:
                one = data.sel(run=run)
                assert (one.angles.values == run).all()
                assert one.parameters.values.tolist() == [run]
    assert runs == list(range(_RUNS))


def test_an_interrupted_store_goes_on_and_a_finished_one_asks_for_nothing(tmp_path: Path) -> None:
    plan, output = _plan(), tmp_path / "s.h5"
    with SweepStore(output, plan, 0, _RUNS, 10**9) as store:
        _fill(store, plan, [0, 12])
    with SweepStore(output, plan, 0, _RUNS, 10**9) as store:
        assert store.missing() == [(4, 12), (16, _RUNS)]
        _fill(store, plan, [4, 8, 16, 20])
    with SweepStore(output, plan, 0, _RUNS, 10**9) as store:
        assert store.missing() == []
    with pytest.raises(InputError, match="another"), SweepStore(output, _plan(identity="j"), 0, _RUNS, 10**9):
        pass


_HOLDER = """
import sys, time
from pathlib import Path
from rotor_mbs.store.lock import FolderLock
lock = FolderLock(Path(sys.argv[1]), Path("s.h5"))
print("held", flush=True)
time.sleep(60)
"""


def test_a_second_sweep_is_refused_until_the_first_one_ends_however_it_ends(tmp_path: Path) -> None:
    with subprocess.Popen([sys.executable, "-c", _HOLDER, str(tmp_path)], stdout=subprocess.PIPE) as holder:
        assert holder.stdout is not None
        holder.stdout.readline()
        with pytest.raises(InputError, match=r"s\.h5: another sweep is writing it now; allowed: wait"):
            FolderLock(tmp_path, Path("s.h5"))
        holder.kill()
        holder.wait()
        FolderLock(tmp_path, Path("s.h5")).release()


# 64 chunks fill a leaf of the index; 5,000 make a tree of three levels.
@pytest.mark.parametrize("rows", [1, 64, 65, 5000])
def test_places_read_from_the_index_are_those_that_the_library_tells(rows: int) -> None:
    memory = SparseFile()
    file = hdf5.new_file_in(memory)
    shapes = {"wide": (rows, 7, 4), "one": (rows, 7), "another": (rows, 7), "deep": (rows, 2, 3, 3), "flat": (rows,)}
    scale = Column((), "1", "")
    datasets = {name: hdf5.put_empty(file, name, shape, "f8", scale) for name, shape in shapes.items()}
    file.flush()
    index = ChunkIndex(memory.extents())
    for name, dataset in datasets.items():
        found = hdf5.places(dataset, index)
        for row in {0, rows // 2, rows - 1} if dataset.chunks else ():
            told = dataset.id.get_chunk_info_by_coord((row, *[0] * (dataset.ndim - 1)))
            assert found[row] == told.byte_offset, (name, row)
            assert index.places(int(found[0]), rows, dataset.ndim) is not None, name
        size = dataset.dtype.itemsize * int(np.prod(dataset.shape[1:]))
        assert (np.diff(np.sort(found)) >= size).all(), name  # no two overlap
        np.testing.assert_array_equal(found, hdf5.places(dataset, ChunkIndex([])), err_msg=name)


def test_an_index_that_is_cut_or_of_another_kind_tells_nothing() -> None:
    memory = SparseFile()
    file = hdf5.new_file_in(memory)
    dataset = hdf5.put_empty(file, "a", (300, 5), "f8", Column((), "1", ""))
    file.flush()
    first = dataset.id.get_chunk_info_by_coord((0, 0)).byte_offset
    extents = list(memory.extents())
    assert ChunkIndex(extents).places(first, 300, 2) is not None
    assert ChunkIndex(extents).places(first, 301, 2) is None
    assert ChunkIndex(extents).places(first, 299, 2) is None
    assert ChunkIndex(extents).places(first + 1, 300, 2) is None
    assert ChunkIndex(extents).places(first, 300, 3) is None
    leaves = [
        (place + match.start(), match.group())
        for place, content in extents
        for match in re.finditer(rb"TREE\x01\x00.*?(?=TREE|$)", content, re.DOTALL)
    ]
    assert ChunkIndex(leaves).places(first, 300, 2) is not None
    for i in range(len(leaves)):
        assert ChunkIndex(leaves[:i] + leaves[i + 1 :]).places(first, 300, 2) is None
    assert ChunkIndex([(place, content[:40]) for place, content in leaves]).places(first, 300, 2) is None
