"""Nothing lost: a sweep's runs on the disk survive any end of the writer, a full disk, a second writer."""

from __future__ import annotations

import contextlib
import resource
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest
from scenes import paper

from rotor_mbs.errors import InputError, StoreError
from rotor_mbs.store.journal import Journal
from rotor_mbs.store.lock import FolderLock
from rotor_mbs.store.sweep_file import Plan
from rotor_mbs.store.sweep_layout import empty_rows
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


def _rows(first: int, count: int, plan: Plan) -> np.ndarray:
    rows = empty_rows(count, plan.row)
    rows["angles"] = np.arange(first, first + count)[:, None, None]
    rows["status"] = 0
    return rows


def _journal(path: Path, identity: str = "i") -> Journal:
    return Journal(path, identity, 0, _RUNS, _plan().row)


def test_a_torn_tail_is_cut_off_and_what_was_before_it_stays(tmp_path: Path) -> None:
    path, plan = tmp_path / "j", _plan()
    journal = _journal(path)
    journal.append([(3, _rows(3, 2, plan))])
    whole = path.stat().st_size
    journal.append([(9, _rows(9, 1, plan))])
    journal.close()
    content = path.read_bytes()
    for length in (whole, whole + 1, whole + 19, whole + 20, whole + 21, len(content) - 1):
        path.write_bytes(content[:length])
        journal = _journal(path)
        assert np.flatnonzero(journal.has).tolist() == [3, 4]
        assert path.stat().st_size == whole
        journal.append([(9, _rows(9, 1, plan))])
        journal.close()
        assert path.read_bytes() == content


def test_a_damaged_record_is_not_believed(tmp_path: Path) -> None:
    path, plan = tmp_path / "j", _plan()
    journal = _journal(path)
    journal.append([(3, _rows(3, 2, plan))])
    journal.close()
    content = bytearray(path.read_bytes())
    content[-100] ^= 1
    path.write_bytes(content)
    assert not _journal(path).has.any()


def test_rows_come_back_bit_for_bit_in_whatever_order_they_went_in(tmp_path: Path) -> None:
    plan = _plan()
    journal = _journal(tmp_path / "j")
    rng = np.random.default_rng(0)
    rows = _rows(0, _RUNS, plan)
    rows["angles"] = rng.standard_normal(rows["angles"].shape)
    for i in rng.permutation(_RUNS).tolist():
        journal.append([(i, rows[i : i + 1])])
    assert journal.read(0, _RUNS).tobytes() == rows.tobytes()
    assert b"".join(part.tobytes() for _, part in journal.stored()) == rows.tobytes()


def test_another_sweeps_journal_is_refused(tmp_path: Path) -> None:
    _journal(tmp_path / "j").close()
    with pytest.raises(InputError, match="another sweep"):
        _journal(tmp_path / "j", "other")


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
    path, plan = tmp_path / "j", _plan()
    journal = _journal(path)
    journal.append([(0, _rows(0, 4, plan))])
    size = path.stat().st_size
    with _largest_file(size + 100), pytest.raises(StoreError, match="nothing stored before is lost"):
        journal.append([(4, _rows(4, 1, plan))])
    assert path.stat().st_size == size
    journal.append([(4, _rows(4, 1, plan))])
    journal.close()
    assert np.flatnonzero(_journal(path).has).tolist() == [0, 1, 2, 3, 4]


def _fill(store: SweepStore, plan: Plan, starts: list[int]) -> None:
    for first in starts:
        count = min(4, _RUNS - first)
        store.add([(first, _rows(first, count, plan))])


def test_the_dataset_has_the_same_bytes_whatever_the_order_of_its_runs(tmp_path: Path) -> None:
    plan, starts = _plan(), list(range(0, _RUNS, 4))
    for name, order in (("a.h5", starts), ("b.h5", starts[::-1])):
        with SweepStore(tmp_path / name, plan, 0, _RUNS, 10**9) as store:
            _fill(store, plan, order)
    assert (tmp_path / "a.h5").read_bytes() == (tmp_path / "b.h5").read_bytes()
    assert not list(tmp_path.glob("*.parts"))


def test_files_of_bounded_size_share_out_the_runs(tmp_path: Path) -> None:
    plan = _plan()
    with SweepStore(tmp_path / "s.h5", plan, 0, _RUNS, 10 * plan.row.itemsize) as store:
        _fill(store, plan, list(range(0, _RUNS, 4)))
        assert (store.statuses == 0).all()
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
