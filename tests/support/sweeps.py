"""Sweeps made in this process, and as other processes: how far they are, their workers."""

from __future__ import annotations

import subprocess
import sys
import time
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import h5py
import numpy as np

from rotor_mbs.runs.cluster import open_task_pool
from rotor_mbs.scenario.sweep import Sweep, load_sweep
from rotor_mbs.studies.sweep import SweepResult, plan_sweep, run_sweep

MAP = """title = "Speed & stiffness"
scene = "paper/fig06"
samples = 51
outputs = []
picture = "map"
[change]
"initial.angles[1]" = 1e-6
duration = 2
[[axis]]
key = "bearing.stiffness"
linear = {start = 500, end = 40000, count = 3}
[[axis]]
key = "initial.rates[0]"
linear = {start = 0.25, end = 20, count = 4}
"""


def run_local(
    sweep: Sweep, output: Path, workers: int, methods: Sequence[str] = (), timeout_s: float = 60.0, **options: Any
) -> SweepResult:
    """The sweep by worker processes of this machine, 0: by this process; options: of `run_sweep`."""
    plan = plan_sweep(sweep, methods, time_limit_s=timeout_s)
    with open_task_pool("local", workers) as pool:
        return run_sweep(plan, output, pool, **options)


def made_sweep(folder: Path, text: str = MAP) -> Path:
    """The dataset of the sweep file `text`, made in this process."""
    (folder / "s.toml").write_text(text)
    run_local(load_sweep(folder / "s.toml"), folder / "s.h5", 0)
    return folder / "s.h5"


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
