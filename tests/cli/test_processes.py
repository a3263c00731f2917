"""Commands as processes: killed, interrupted, without a reader of their output, on a full disk."""

from __future__ import annotations

import os
import signal
import subprocess
import time
from pathlib import Path

import pytest
from support.commands import PROGRAM, rotor_mbs

from rotor_mbs.runs.read import open_results
from rotor_mbs.runs.sweeps import StoredSweep

SWEEP = """title = "two"
scene = "paper/fig11"
methods = ["lagrange/dop853"]
samples = 3
outputs = ["angles"]
change = {duration = 0.1}
[[axis]]
key = "gravity"
values = [9.7, 9.8]
"""


def stored_runs(path: Path) -> set[tuple[str, str]]:
    if not path.exists():
        return set()
    with open_results(path) as results:
        return {(name, method) for name, scene in results.scenes.items() for method in scene.runs}


# Standard output and standard error


@pytest.mark.parametrize(("words", "status"), [(("list",), 0), (("new", "mine.toml"), 1)])
def test_a_closed_pipe_is_no_success_but_of_a_command_that_only_prints(words: tuple[str, ...], status: int) -> None:
    """As by `| true`."""
    reading, writing = os.pipe()
    os.close(reading)
    try:
        assert subprocess.run([*PROGRAM, *words], stdout=writing, stderr=subprocess.DEVNULL).returncode == status
    finally:
        os.close(writing)


@pytest.mark.full
@pytest.mark.skipif(not Path("/dev/full").exists(), reason="fills standard output as Linux does")
def test_full_output_and_closed_errors_lose_no_run(folder: Path) -> None:
    Path("s.toml").write_text(SWEEP)
    command = [*PROGRAM, "sweep", "s.toml", "-o", "o.h5", "-j", "1"]
    assert subprocess.run(["sh", "-c", 'exec "$@" 2>&- > /dev/full', "sh", *command]).returncode == 1  # no summary
    assert StoredSweep(folder / "o.h5").column("status").tolist() == [0, 0]


# Ends


@pytest.mark.full
@pytest.mark.parametrize("number", [signal.SIGKILL, signal.SIGINT])
def test_an_ended_batch_continues_where_it_stopped(folder: Path, number: int) -> None:
    """Ended after its first runs: the next one makes only what is missing, and the file is whole."""
    scenes = ("run", "paper/fig05", "paper/fig06", "-m", "exudyn_chain/generalized_alpha", "-m", "lagrange/dop853")
    command = [*PROGRAM, *scenes, "-o", "r.h5", "-j", "1"]
    with subprocess.Popen(command, stderr=subprocess.PIPE, text=True, start_new_session=True) as batch:
        deadline = time.monotonic() + 60.0
        while len(stored_runs(folder / "r.h5")) < 3 and time.monotonic() < deadline:
            time.sleep(0.02)
        if number == signal.SIGKILL:
            os.killpg(batch.pid, number)
        else:
            batch.send_signal(number)
        _, errors = batch.communicate(timeout=30)
    assert batch.returncode == (130 if number == signal.SIGINT else -number)
    assert "Traceback" not in errors
    finished = len(stored_runs(folder / "r.h5"))
    assert finished >= 3
    again = rotor_mbs(*command[len(PROGRAM) :])
    assert again.status == 0, again.err
    assert f"{6 - finished} runs made" in again.out or finished == 6
    assert len(stored_runs(folder / "r.h5")) == 6


@pytest.mark.full
def test_a_full_disk_is_one_line_and_loses_nothing(folder: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """A file system of 4 MB fills up: what was stored still opens, and with more room the batch goes on."""
    small = folder / "small"
    small.mkdir()
    if subprocess.run(["mount", "-t", "tmpfs", "-o", "size=4m", "tmpfs", small], capture_output=True).returncode:
        pytest.skip("a small file system cannot be mounted here")
    try:
        monkeypatch.chdir(small)
        batch = ("run", "paper/fig05", "-m", "lagrange/dop853", "-m", "printed/ode45", "-o", "r.h5", "-j", "1")
        assert rotor_mbs(*batch).status == 0
        stored = stored_runs(small / "r.h5")
        (small / "ballast").write_bytes(b"x" * 3_000_000)
        more = ("run", "paper/fig05", "paper/fig06", "paper/fig08", "-m", "lagrange/dop853", "-o", "r.h5", "-j", "1")
        full = rotor_mbs(*more)
        assert full.status in (1, 2)
        assert "No space left" in full.err.splitlines()[-1]
        assert stored_runs(small / "r.h5") == stored
        (small / "ballast").unlink()
        again = rotor_mbs(*more)
        assert again.status == 0, again.err
        assert stored < stored_runs(small / "r.h5")
    finally:
        monkeypatch.chdir(folder)
        subprocess.run(["umount", small], check=True)
