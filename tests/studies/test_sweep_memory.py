"""Sweeps in bounded memory: what a worker grows by, and what a parent of 100,000 runs takes.

python -m pytest -m nightly -s tests/studies/test_sweep_memory.py
"""

from __future__ import annotations

import subprocess
import sys
import time
from pathlib import Path

import pytest

from rotor_mbs.runs.cluster import open_task_pool
from rotor_mbs.runs.table import Place
from rotor_mbs.scenario.sweep import load_sweep
from rotor_mbs.studies.sweep import Chunk, plan_sweep

pytestmark = [
    pytest.mark.nightly,
    pytest.mark.skipif(not Path("/proc/self/status").exists(), reason="memory is read in /proc"),
]

_SWEEP = """
title = "short runs"
scene = "paper/fig11"
methods = ["{method}"]
samples = {samples}
change = {{ duration = {duration} }}
draws = {draws}
[[axis]]
key = "initial.angles[1]"
uniform = [0.5, 1.0]
"""


def _file(folder: Path, method: str, draws: int, samples: int, duration: float) -> Path:
    path = folder / "s.toml"
    path.write_text(_SWEEP.format(method=method, draws=draws, samples=samples, duration=duration))
    return path


def _memory(process: int | str, key: str) -> float:
    """MB: VmRSS is what a process holds now, VmHWM the most it has held. 0 where it has ended."""
    try:
        lines = Path(f"/proc/{process}/status").read_text().splitlines()
    except OSError:
        return 0.0
    return next((int(line.split()[1]) / 1024 for line in lines if line.startswith(key)), 0.0)


def _resident(_: object) -> float:
    return _memory("self", "VmRSS")


@pytest.mark.parametrize(
    ("method", "samples", "duration"),
    [("lagrange/taylor", 1001, 0.1), ("lagrange/taylor", 11, 0.1), ("lagrange/dop853", 11, 0.01)],
)
def test_a_worker_does_not_grow(tmp_path: Path, method: str, samples: int, duration: float) -> None:
    """10,000 runs after the first thousand: at most 20 MB."""
    plan = plan_sweep(load_sweep(_file(tmp_path, method, 11_000, samples, duration)))
    nowhere = Place(Path(), 0, 0, {}, plan.table().row_type)
    with open_task_pool("local", 1) as pool:
        before = 0.0
        for chunk in plan.chunks(nowhere, [(0, 11_000)]):
            if not before and chunk.first >= 1000:
                before = pool.submit(_resident, None, 60.0).result()
            pool.submit(Chunk.perform, chunk, 60.0).result()
        after = pool.submit(_resident, None, 60.0).result()
    print(f"\n{method}, {samples} samples: {before:.1f} MB after 1,000 runs, {after:.1f} MB after 11,000")
    assert after - before < 20.0


def test_the_parent_of_100_000_runs_is_small(tmp_path: Path) -> None:
    path = _file(tmp_path, "lagrange/taylor", 100_000, 11, 0.1)
    command = [sys.executable, "-m", "rotor_mbs", "sweep", str(path), "-o", str(tmp_path / "o.h5"), "-j", "2"]
    start, most = time.monotonic(), 0.0
    with subprocess.Popen(command, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL) as process:
        while process.poll() is None:
            most = max(most, _memory(process.pid, "VmHWM"))
            time.sleep(0.05)
    print(f"\n{most:.0f} MB, {time.monotonic() - start:.1f} s")
    assert process.returncode == 0
    assert 20.0 < most < 500.0
