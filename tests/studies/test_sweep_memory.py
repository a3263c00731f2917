"""Sweeps in bounded memory: what a worker grows by, and what a parent of 100,000 runs takes.

python -m pytest -m nightly -s tests/studies/test_sweep_memory.py
"""

from __future__ import annotations

import resource
import subprocess
import sys
from pathlib import Path

import pytest
from support.sweeps import starts_file

from rotor_mbs.runs.engines import open_task_pool
from rotor_mbs.runs.rows import RowLocation
from rotor_mbs.scenario.sweep import load_sweep
from rotor_mbs.studies.sweep import Chunk, plan_sweep

pytestmark = [
    pytest.mark.nightly,
    pytest.mark.skipif(not Path("/proc/self/statm").exists(), reason="memory is read in /proc"),
]


def _resident(_: object) -> float:
    """MB that this process holds now."""
    return int(Path("/proc/self/statm").read_text().split()[1]) * resource.getpagesize() / 2**20


@pytest.mark.parametrize(
    ("method", "samples", "duration"),
    [("lagrange/taylor", 1001, 0.1), ("lagrange/taylor", 11, 0.1), ("lagrange/dop853", 11, 0.01)],
)
def test_a_worker_does_not_grow(tmp_path: Path, method: str, samples: int, duration: float) -> None:
    """10,000 runs after the first thousand: at most 20 MB."""
    plan = plan_sweep(load_sweep(starts_file(tmp_path, 11_000, samples, duration, method)))
    nowhere = RowLocation(Path(), 0, 0, {}, plan.table().row_type)
    with open_task_pool("local", 1) as pool:
        before = 0.0
        for chunk in plan.chunks(nowhere, [(0, 11_000)]):
            if not before and chunk.first >= 1000:
                before = pool.submit(_resident, None, 60.0).result()
            pool.submit(Chunk.perform, chunk, 60.0).result()
        after = pool.submit(_resident, None, 60.0).result()
    print(
        f"\n{method}, {samples} samples: {before:.1f} MB after 1,000 runs, {after:.1f} MB after "
        "11,000"
    )
    assert after - before < 20.0


def test_the_parent_of_100_000_runs_is_small(tmp_path: Path) -> None:
    path = starts_file(tmp_path, 100_000, 11, 0.1, "lagrange/taylor")
    code = "import resource, sys; from rotor_mbs.cli import main; status = main(sys.argv[1:]); "
    code += "print('KB', resource.getrusage(resource.RUSAGE_SELF).ru_maxrss); sys.exit(status)"
    command = [
        sys.executable,
        "-c",
        code,
        "sweep",
        str(path),
        "-o",
        str(tmp_path / "o.h5"),
        "-j",
        "2",
    ]
    done = subprocess.run(command, capture_output=True, text=True, check=True)
    most = int(done.stdout.split()[-1]) / 1024
    print(f"\n{most:.0f} MB")
    assert 20.0 < most < 500.0
