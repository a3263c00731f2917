"""Print processor times of calls that should cost little more than their integration.

    python benchmarks/speed.py [SCENES]

SCENES: in the results file that is laid out, by default 40. Times are the least of several
repetitions, since other processes make them longer and never shorter; compare two versions by
turns.
"""

from __future__ import annotations

import sys
import tempfile
import time
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import rotor_mbs as rm
from rotor_mbs.runs.design import RunRequest, results_tables
from rotor_mbs.runs.merge import fit_file_to_request
from rotor_mbs.runs.table import TableFile

REPEATS = 5


def least_ms(call: Callable[[], object], repeats: int = REPEATS) -> float:
    """Return the least processor time of a call, ms."""
    times = []
    for _ in range(repeats):
        start = time.process_time()
        call()
        times.append(1e3 * (time.process_time() - start))
    return min(times)


def measure_file(scenes: int) -> None:
    """Print the times to lay out, extend by nothing, and open a results file of small scenes."""
    base = rm.scene("paper/fig11").replace(duration=1.0, samples=11)
    asked = []
    for i in range(scenes):
        scene = replace(base, name=f"own/s{i}")
        asked += [RunRequest(scene, "reference"), RunRequest(scene, "lagrange/taylor")]
    tables = results_tables(asked)
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "runs.h5"
        calls: dict[str, Callable[[], object]] = {
            "layout": lambda: fit_file_to_request(path, tables),
            "nothing to do": lambda: fit_file_to_request(path, tables),
            "open": lambda: TableFile(path),
        }
        for name, call in calls.items():
            print(f"{name}, {scenes} scenes: {least_ms(call, 1) / scenes:.1f} ms a scene")


def measure_runs() -> None:
    """Print the times of `rm.run`, and how many times the integration they are."""
    own = rm.scene("paper/fig08").replace(duration=5.0, samples=501, gravity=9.8)
    for name, scene in (("own scene, 501 samples", own), ("paper/fig11", rm.scene("paper/fig11"))):
        run = rm.run(scene)  # loads and compiles
        whole, integration = least_ms(lambda scene=scene: rm.run(scene)), 1e3 * min(run.run_times_s)
        print(f"rm.run of {name}: {whole:.1f} ms, {whole / integration:.0f} times the integration")


if __name__ == "__main__":
    measure_file(int(sys.argv[1]) if len(sys.argv) > 1 else 40)
    measure_runs()
