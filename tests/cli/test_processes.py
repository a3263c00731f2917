"""Commands without a reader of their output, and with a full one."""

from __future__ import annotations

import os
import subprocess
from pathlib import Path

import pytest
from support.commands import PROGRAM
from support.sweeps import THREE_RUNS

from rotor_mbs.runs.sweeps import StoredSweep


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
    Path("s.toml").write_text(THREE_RUNS)
    command = [*PROGRAM, "sweep", "s.toml", "-o", "o.h5", "-j", "1"]
    assert subprocess.run(["sh", "-c", 'exec "$@" 2>&- > /dev/full', "sh", *command]).returncode == 1  # no summary
    assert StoredSweep(folder / "o.h5").column("status").tolist() == [0, 0, 0]
