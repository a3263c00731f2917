"""Sweeps made in this process; how far one is that another process makes."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import h5py
import numpy as np

from rotor_mbs.runs.engines import open_task_pool
from rotor_mbs.scenario.sweep import Sweep, load_sweep
from rotor_mbs.studies.sweep import SweepResult, plan_sweep, run_sweep

MAP = """title = "Speed & stiffness"
scene = "paper/fig06"
samples = 51
outputs = []
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


THREE_RUNS = """title = "three"
scene = "paper/fig11"
methods = ["lagrange/dop853"]
samples = 3
outputs = ["angles", "rates"]
[change]
duration = 0.2
[[axis]]
key = "gravity"
values = [9.7, 9.8, 9.9]
"""


def starts_file(
    folder: Path, draws: int, samples: int, duration: float, method: str = "lagrange/dop853"
) -> Path:
    """s.toml: fig. 11 for `duration` (s) from random angles of a pitch."""
    path = folder / "s.toml"
    path.write_text(f"""title = "starts"
scene = "paper/fig11"
methods = ["{method}"]
samples = {samples}
outputs = ["angles"]
change = {{ duration = {duration} }}
draws = {draws}
[[axis]]
key = "initial.angles[1]"
uniform = [0.5, 1.0]
""")
    return path


def run_local(
    sweep: Sweep,
    output: Path,
    workers: int,
    methods: Sequence[str] = (),
    timeout_s: float = 60.0,
    **options: Any,
) -> SweepResult:
    """The sweep by worker processes of this machine, 0: by this process; options: of
    `run_sweep`."""
    plan = plan_sweep(sweep, methods, time_limit_s=timeout_s)
    with open_task_pool("local", workers) as pool:
        return run_sweep(plan, output, pool, **options)


def made_sweep(folder: Path, text: str = MAP) -> Path:
    """The dataset of the sweep file `text`, made in this process."""
    (folder / "s.toml").write_text(text)
    run_local(load_sweep(folder / "s.toml"), folder / "s.h5", 0)
    return folder / "s.h5"


def stored_runs(output: Path) -> int:
    """How many runs a dataset has, as any reader sees it while it is written."""
    if not output.exists():
        return 0
    with h5py.File(output) as file:
        return int(np.count_nonzero(file["status"][()] >= 0))
