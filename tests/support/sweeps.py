"""Sweeps as other processes: how far they are, their workers, and kills at random moments."""

from __future__ import annotations

import subprocess
import sys
import time
from pathlib import Path

import h5py
import numpy as np


def command(path: Path, output: Path, *more: str) -> list[str]:
    """The sweep of the file `path` by two workers."""
    return [sys.executable, "-m", "rotor_mbs", "sweep", str(path), "-o", str(output), "-j", "2", *more]


def stored_runs(output: Path) -> int:
    """How many runs a dataset has, as any reader sees it while it is written."""
    if not output.exists():
        return 0
    with h5py.File(output) as file:
        return int(np.count_nonzero(file["status"][()] >= 0))


def wait_for_runs(process: subprocess.Popen[bytes], output: Path, count: int) -> None:
    """Until that many are stored, or the process has ended."""
    while process.poll() is None and stored_runs(output) < count:
        time.sleep(0.01)


def workers_of(process: subprocess.Popen[bytes]) -> list[int]:
    """Process ids, from /proc."""
    children = [file.read_text() for file in Path(f"/proc/{process.pid}/task").glob("*/children")]  # of each thread
    return [pid for pid in map(int, " ".join(children).split()) if b"spawn_main" in _command_line(pid)]


def _command_line(pid: int) -> bytes:
    try:
        return Path(f"/proc/{pid}/cmdline").read_bytes()
    except OSError:
        return b""
