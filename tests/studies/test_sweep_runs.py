"""Sweeps end to end: the same bytes with one worker or two, after kills and interrupts; a run that kills is found."""

from __future__ import annotations

import contextlib
import json
import os
import resource
import signal
import subprocess
import sys
import time
from pathlib import Path

import h5py
import numpy as np
import pytest

from rotor_mbs.cli import main
from rotor_mbs.cli.sweep_study import execute
from rotor_mbs.execution.engines import open_engine
from rotor_mbs.execution.meter import Meter
from rotor_mbs.scenario.sweep import load_sweep
from rotor_mbs.store.sweep_layout import SWEEP_STATUSES
from rotor_mbs.store.sweep_rows import Receipt, Rows
from rotor_mbs.store.sweep_store import SweepStore
from rotor_mbs.studies.sweep_plan import plan_work
from rotor_mbs.studies.sweep_work import Chunk, perform

_SWEEP = """
title = "starts and springs"
scene = "paper/fig11"
methods = ["lagrange/dop853"]
samples = 21
outputs = ["angles"]
change = {{ duration = {duration} }}
validation = 0.25
draws = {draws}

[[axis]]
key = "initial.angles[1]"
uniform = [0.5, 1.0]

[[axis]]
key = "bearing.stiffness"
values = [0, 10]
"""


def _file(folder: Path, draws: int = 4, duration: float = 0.2, more: str = "") -> Path:
    path = folder / "s.toml"
    path.write_text(more + _SWEEP.format(draws=draws, duration=duration))
    return path


def _command(path: Path, output: Path, *more: str) -> list[str]:
    return [sys.executable, "-m", "rotor_mbs", "sweep", str(path), "-o", str(output), "-j", "2", *more]


def test_one_worker_or_two_fast_path_or_not_the_bytes_are_the_same(tmp_path: Path) -> None:
    path = _file(tmp_path)
    both = ["-m", "lagrange/taylor", "-m", "lagrange/dop853"]
    for name, workers in (("one.h5", "1"), ("two.h5", "2")):
        assert main(["sweep", str(path), "-o", str(tmp_path / name), "-j", workers, *both]) == 0
    assert (tmp_path / "one.h5").read_bytes() == (tmp_path / "two.h5").read_bytes()
    with h5py.File(tmp_path / "one.h5") as file:
        by_taylor, by_dop853 = file["angles"][:8], file["angles"][8:]
        # 0.2 s of fig11 carries an error on tenfold; dop853's tolerance is 3e-14.
        np.testing.assert_allclose(by_taylor, by_dop853, rtol=0.0, atol=1e-11)
        assert file["angles"].chunks == (1, 21, 4)
        assert file["parameters"].attrs["labels"].tolist() == ["initial.angles[1]", "bearing.stiffness"]
        assert file["parameters"].attrs["label_units"].tolist() == ["rad", "N m/rad"]
        np.testing.assert_array_equal(file["angles"][:, 0, 1], file["parameters"][:, 0])
        assert file["variant"][()].tolist() == [*range(8)] * 2
        assert file["method"][()].tolist() == [0] * 8 + [1] * 8
        assert file["split"][()].tolist()[:8] == file["split"][()].tolist()[8:]
        assert file["split"][:8].sum() == 2
        assert (file["energy_drift_max"][()] < 1e-11).all()
        assert file.attrs["seed"] == 0


def test_a_finished_sweep_makes_nothing_again(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    path, output = _file(tmp_path), tmp_path / "o.h5"
    assert main(["sweep", str(path), "-o", str(output), "--json"]) == 0
    before = output.stat().st_mtime_ns
    capsys.readouterr()
    assert main(["sweep", str(path), "-o", str(output), "--json"]) == 0
    end = json.loads(capsys.readouterr().out.splitlines()[-1])
    assert (end["event"], end["runs"], end["made"], end["statuses"]) == ("end", 8, 0, {"ok": 8})
    assert output.stat().st_mtime_ns == before


def test_parts_of_a_job_array_are_the_slices_of_the_whole(tmp_path: Path) -> None:
    path = _file(tmp_path)
    main(["sweep", str(path), "-o", str(tmp_path / "whole.h5")])
    for k in (1, 2, 3):
        main(["sweep", str(path), "-o", str(tmp_path / f"{k}.h5"), "--part", f"{k}/3"])
    with h5py.File(tmp_path / "whole.h5") as whole:
        for name in ("run", "angles", "parameters", "status", "split"):
            parts = []
            for k in (1, 2, 3):
                with h5py.File(tmp_path / f"{k}.h5") as part:
                    parts.append(part[name][()])
            np.testing.assert_array_equal(np.concatenate(parts), whole[name][()], err_msg=name)


def _poisoned(chunk: Chunk) -> Rows | Receipt:
    """Run 5 kills its process, wherever it is tried, and leaves a mark each time."""
    if chunk.first <= 5 < chunk.first + len(chunk.values):
        with Path(os.environ["ROTOR_TEST_MARKS"]).open("a") as marks:
            marks.write(f"{len(chunk.values)}\n")
        os.kill(os.getpid(), signal.SIGKILL)
    return perform(chunk)


@pytest.mark.parametrize("method", ["lagrange/taylor", "lagrange/dop853"])
def test_a_run_that_kills_its_worker_is_found_and_the_rest_goes_on(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, method: str
) -> None:
    marks = tmp_path / "marks"
    monkeypatch.setenv("ROTOR_TEST_MARKS", str(marks))
    work = plan_work(load_sweep(_file(tmp_path, draws=16)), [method], (1, 1), 60.0)
    engine = open_engine("local", 2)
    with SweepStore(tmp_path / "o.h5", work.plan, 0, 32, 10**9) as store:
        execute(work, engine, store, Meter(32, 0), _poisoned)
        statuses = [SWEEP_STATUSES[code] for code in store.statuses]
    engine.close()
    assert statuses == ["ok"] * 5 + ["worker_died"] + ["ok"] * 26
    # Tried with its chunk, then once more, alone.
    assert marks.read_text().split() == (["8", "1"] if method == "lagrange/taylor" else ["1", "1"])
    with h5py.File(tmp_path / "o.h5") as file:
        assert np.isnan(file["angles"][5]).all()
        assert np.isfinite(np.delete(file["angles"][()], 5, axis=0)).all()
        assert "run 5: its process died" in file.attrs["messages"][0]


def _hanging(chunk: Chunk) -> Rows | Receipt:
    if chunk.first == 2:
        time.sleep(600.0)
    return perform(chunk)


def test_a_run_that_hangs_is_ended_and_the_rest_goes_on(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("rotor_mbs.cli.sweep_study._GRACE_S", 4.0)
    work = plan_work(load_sweep(_file(tmp_path)), ["lagrange/dop853"], (1, 1), 4.0)
    engine = open_engine("local", 2)
    with SweepStore(tmp_path / "o.h5", work.plan, 0, 8, 10**9) as store:
        execute(work, engine, store, Meter(8, 0), _hanging)
        assert [SWEEP_STATUSES[code] for code in store.statuses] == ["ok"] * 2 + ["timed_out"] + ["ok"] * 5
    engine.close()


def _journal_size(output: Path) -> int:
    try:
        return sum(path.stat().st_size for path in output.with_name(output.name + ".parts").glob("*.journal"))
    except FileNotFoundError:
        return 0


def _wait_for_growth(process: subprocess.Popen[bytes], output: Path, size: int) -> None:
    while process.poll() is None and _journal_size(output) <= size:
        time.sleep(0.01)


def _workers_of(process: subprocess.Popen[bytes]) -> list[int]:
    children = [file.read_text() for file in Path(f"/proc/{process.pid}/task").glob("*/children")]  # of each thread
    return [pid for pid in map(int, " ".join(children).split()) if b"spawn_main" in _command_line(pid)]


def _command_line(pid: int) -> bytes:
    try:
        return Path(f"/proc/{pid}/cmdline").read_bytes()
    except OSError:
        return b""


@pytest.mark.skipif(not Path("/proc/self/task").exists(), reason="finds the workers in /proc")
def test_killed_and_terminated_a_sweep_goes_on_and_ends_with_the_same_bytes(tmp_path: Path) -> None:
    path = _file(tmp_path, draws=30, duration=0.5)
    whole, output = tmp_path / "whole.h5", tmp_path / "o.h5"
    subprocess.run(_command(path, whole), check=True, capture_output=True)
    size = 0
    for victim in ("worker", "parent", "SIGTERM", "SIGINT"):
        with subprocess.Popen(_command(path, output), stdout=subprocess.DEVNULL, stderr=subprocess.PIPE) as process:
            _wait_for_growth(process, output, size)
            assert process.poll() is None, process.communicate()
            if victim == "worker":
                os.kill(_workers_of(process)[0], signal.SIGKILL)
                _wait_for_growth(process, output, _journal_size(output) + 100)
                process.kill()
            elif victim == "parent":
                process.kill()
            else:
                process.send_signal(getattr(signal, victim))
                assert process.wait(30) == 130
                assert process.stderr is not None
                assert b"the same command goes on from there" in process.stderr.read()
        assert _journal_size(output) >= size, "finished runs were lost"
        size = _journal_size(output)
    ended = subprocess.run(_command(path, output, "--json"), check=True, capture_output=True)
    made = json.loads(ended.stdout.splitlines()[-1])["made"]
    assert made < 60
    assert output.read_bytes() == whole.read_bytes()


def _small_files() -> None:
    """As a full disk does, this stops a file from growing, in workers too."""
    resource.setrlimit(resource.RLIMIT_FSIZE, (6000, resource.RLIM_INFINITY))


def test_a_full_disk_is_one_line_and_the_sweep_goes_on_after_it(tmp_path: Path) -> None:
    path, whole, output = _file(tmp_path, draws=6), tmp_path / "whole.h5", tmp_path / "o.h5"
    full = subprocess.run(_command(path, output), capture_output=True, text=True, preexec_fn=_small_files)
    assert full.returncode == 1
    assert full.stderr.count("\n") == 1
    assert "cannot be written: File too large; nothing stored before is lost" in full.stderr
    for name in (output, whole):
        assert main(["sweep", str(path), "-o", str(name)]) == 0
    assert output.read_bytes() == whole.read_bytes()


@pytest.mark.slow
@pytest.mark.skipif(not Path("/proc/self/task").exists(), reason="finds the workers in /proc")
def test_killed_at_random_moments_the_fast_path_loses_nothing(tmp_path: Path) -> None:
    """500 runs in three files; 100 kills of the parent, half of them after one of a worker, each at another moment."""
    path = tmp_path / "s.toml"
    path.write_text(_FAST)
    subprocess.run(_command(path, tmp_path / "whole.h5"), check=True, capture_output=True)
    parts = ("0001", "0002", "0003")
    whole = {part: (tmp_path / f"whole-{part}.h5").read_bytes() for part in parts}
    rng = np.random.default_rng(3)
    size, ended = 0, 0
    for number in range(100):
        output = tmp_path / f"{ended}.h5"
        with subprocess.Popen(_command(path, output), stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL) as process:
            _sleep(process, rng.uniform(0.3, 2.0))
            workers = _workers_of(process) if number % 2 and process.poll() is None else []
            if workers:
                os.kill(workers[0], signal.SIGKILL)
                _sleep(process, rng.uniform(0.0, 1.0))
            process.kill()
        # In any order: what a killed worker had is made last.
        found = [file for part in parts if (file := tmp_path / f"{ended}-{part}.h5").exists()]
        assert all(file.read_bytes() == whole[file.stem[-4:]] for file in found)
        stored = _journal_size(output) + sum(file.stat().st_size for file in found)
        assert stored >= size, "finished runs were lost"
        ended, size = (ended + 1, 0) if len(found) == 3 else (ended, stored)
    subprocess.run(_command(path, tmp_path / f"{ended}.h5"), check=True, capture_output=True)
    assert {part: (tmp_path / f"{ended}-{part}.h5").read_bytes() for part in parts} == whole


_FAST = """
title = "starts"
scene = "paper/fig11"
samples = 101
draws = 500
file_bytes = 3.5e6

[[axis]]
key = "initial.angles[1]"
normal = ["pi/4", 1e-3]
"""


def _sleep(process: subprocess.Popen[bytes], seconds: float) -> None:
    with contextlib.suppress(subprocess.TimeoutExpired):
        process.wait(seconds)


def test_a_second_sweep_on_one_output_is_refused_with_one_line(tmp_path: Path) -> None:
    path, output = _file(tmp_path, draws=40, duration=3.0), tmp_path / "o.h5"
    with subprocess.Popen(_command(path, output), stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL) as first:
        _wait_for_growth(first, output, 0)
        second = subprocess.run(_command(path, output), capture_output=True, text=True)
        first.kill()
    assert second.returncode == 2
    assert len(second.stderr.splitlines()) == 1
    assert "another sweep is writing it now" in second.stderr


@pytest.mark.parametrize(
    ("more", "words"),
    [
        (["--engine", "dask:tcp://127.0.0.1:9"], "--engine dask:tcp://127.0.0.1:9: no dask scheduler answers there"),
        (["--engine", "slurm"], "no such engine; allowed: local, or dask:tcp://host:port"),
        (["-m", "lagrange/nothing"], "unknown method"),
    ],
)
def test_bad_usage_is_one_line_and_status_2_within_ten_seconds(tmp_path: Path, more: list[str], words: str) -> None:
    start = time.monotonic()
    ended = subprocess.run(_command(_file(tmp_path), tmp_path / "o.h5", *more), capture_output=True, text=True)
    assert ended.returncode == 2
    assert len(ended.stderr.splitlines()) == 1
    assert words in ended.stderr
    assert time.monotonic() - start < 10.0


@pytest.mark.parametrize(
    ("line", "words"),
    [
        (
            'methods = ["lagrange/tailor"]',
            "s.toml:1: methods: unknown method 'lagrange/tailor'; nearest: lagrange/taylor; allowed: printed/ode45, ",
        ),
        (
            'methods = ["lagrange/taylor"]\nsettings = { tolerence = 1e-15 }',
            "s.toml:2: settings.tolerence: is no setting of lagrange/taylor; allowed: tolerance",
        ),
    ],
)
def test_methods_and_settings_of_the_file_are_told_with_their_line(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], line: str, words: str
) -> None:
    path = _file(tmp_path)
    path.write_text(line + path.read_text().replace('methods = ["lagrange/dop853"]\n', ""))
    assert main(["sweep", str(path), "-o", str(tmp_path / "o.h5")]) == 2
    told = capsys.readouterr().err.splitlines()
    assert len(told) == 1
    assert words in told[0]


def test_a_sweep_too_large_by_mistake_is_asked_for_twice(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["sweep", str(_file(tmp_path, draws=600_000)), "-o", str(tmp_path / "o.h5")]) == 2
    assert "1,200,000 runs; allowed without --yes" in capsys.readouterr().err
    assert not list(tmp_path.glob("o.h5*"))


def test_a_dry_run_tells_runs_time_and_size_and_writes_nothing(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert main(["sweep", str(_file(tmp_path)), "-o", str(tmp_path / "o.h5"), "--dry-run", "--json"]) == 0
    facts = json.loads(capsys.readouterr().out)
    assert facts["runs"] == 8
    assert 0.0 < facts["seconds"] < 60.0
    assert facts["bytes"] >= 8 * 21 * 4 * 8
    assert not list(tmp_path.glob("o.h5*"))
