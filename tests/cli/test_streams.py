"""Standard output that nobody reads or that is full, standard error that is closed: the status says so."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

import pytest
from support.sweeps import made_sweep

from rotor_mbs.runs.sweeps import StoredSweep

pytestmark = pytest.mark.skipif(not Path("/dev/full").exists(), reason="closes and fills streams as Unix has them")
RUN = [sys.executable, "-m", "rotor_mbs"]
_SWEEP = """title = "two"
scene = "paper/fig11"
methods = ["lagrange/dop853"]
samples = 3
outputs = ["angles"]
change = {duration = 0.1}
[[axis]]
key = "gravity"
values = [9.7, 9.8]
"""


def _without_reader(*words: str) -> int:
    """The status of a command whose output goes into a pipe that is closed, as by `| true`."""
    reading, writing = os.pipe()
    os.close(reading)
    try:
        return subprocess.run([*RUN, *words], stdout=writing, stderr=subprocess.DEVNULL).returncode
    finally:
        os.close(writing)


def test_a_broken_pipe_is_no_success_but_of_what_only_prints(tmp_path: Path) -> None:
    sweep = made_sweep(tmp_path, _SWEEP)
    assert subprocess.run([*RUN, "check", str(sweep)], capture_output=True).returncode == 0
    assert _without_reader("check", str(sweep)) == 1
    assert _without_reader("list") == 0


def test_full_output_and_closed_errors_lose_no_run(tmp_path: Path) -> None:
    path, output = tmp_path / "s.toml", tmp_path / "o.h5"
    path.write_text(_SWEEP)
    script = 'exec "$@" 2>&- > /dev/full'
    ended = subprocess.run(["sh", "-c", script, "sh", *RUN, "sweep", str(path), "-o", str(output), "-j", "1"])
    assert ended.returncode == 1  # the summary was lost
    assert StoredSweep(output).column("status").tolist() == [0, 0]
