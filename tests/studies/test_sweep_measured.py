"""The fast path's price: 4,096 starts of Fig. 11 by one command, beside loops over single runs and over heyoka alone.

    python -m pytest -m nightly -s tests/studies/test_sweep_measured.py

prints seconds a run, medians of five rounds, everything in turn. It skips itself where the machine is busy.
"""

from __future__ import annotations

import json
import os
import pickle
import subprocess
import sys
import time
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from support.scenes import paper

from rotor_mbs.methods.solve import solve
from rotor_mbs.scenario.scene import Scene

pytestmark = pytest.mark.nightly

RUNS, LOOP_RUNS, ROUNDS = 4096, 512, 5
IDLE_LOAD = 1.0
HEYOKA = Path(__file__).parents[1] / "support" / "comparison_heyoka.py"
SWEEP = """
title = "perturbed starts of Fig. 11"
scene = "paper/fig11"
methods = ["lagrange/taylor"]
settings = {{ tolerance = 1e-15 }}
samples = {samples}
draws = {draws}
seed = 1
[[axis]]
key = "initial.angles[1]"
normal = ["pi/4", 1e-6]
[[axis]]
key = "initial.angles[2]"
normal = ["pi/6", 1e-6]
"""


def by_sweep(folder: Path, samples: int, draws: int = RUNS) -> tuple[float, float]:
    """s a run, everything stored: of the whole command, and without start and end, as it tells itself."""
    output, path = folder / "o.h5", folder / "s.toml"
    output.unlink(missing_ok=True)
    path.write_text(SWEEP.format(samples=samples, draws=draws))
    command = [sys.executable, "-m", "rotor_mbs", "sweep", str(path), "-o", str(output), "--json"]
    # A cache of compiled code that holds nothing else: it is read through by every process.
    environment = {**os.environ, "XDG_CACHE_HOME": str(folder)}
    start = time.perf_counter()
    ended = subprocess.run(command, capture_output=True, check=True, text=True, env=environment)
    spent = time.perf_counter() - start
    told = json.loads(ended.stdout.splitlines()[-1])
    assert told["statuses"] == {"ok": draws}
    return spent / draws, told["seconds"] / draws


def by_single_runs(samples: int) -> float:
    """s a run of this package's single runs: with tips, energies and work, nothing stored."""
    scenes = perturbed(samples)
    solve("lagrange/taylor", scenes[0], {"tolerance": 1e-15})
    start = time.perf_counter()
    for scene in scenes:
        solve("lagrange/taylor", scene, {"tolerance": 1e-15})
    return (time.perf_counter() - start) / len(scenes)


def by_heyoka(folder: Path, samples: int) -> float:
    """s a run of heyoka's own integrator with the equations of the models, without the script's start."""
    path = folder / "scenes.pickle"
    path.write_bytes(pickle.dumps(perturbed(samples)))
    environment = {**os.environ, "XDG_CACHE_HOME": str(folder)}
    script = [sys.executable, str(HEYOKA), str(path)]
    return float(subprocess.run(script, capture_output=True, check=True, text=True, env=environment).stdout) / LOOP_RUNS


def perturbed(samples: int) -> list[Scene]:
    base = paper("fig11", samples=samples)
    moved = 1e-6 * np.random.default_rng(1).standard_normal((LOOP_RUNS, 2))
    q0, q1, q2, q3 = base.initial_angles
    return [replace(base, initial_angles=(q0, q1 + a, q2 + b, q3)) for a, b in moved.tolist()]


@pytest.mark.parametrize("samples", [201, 1001])
def test_a_sweep_costs_a_fifth_of_its_runs_one_by_one(tmp_path: Path, samples: int) -> None:
    """Of this package's single runs, which make the same; at 201 samples also of heyoka alone, which makes less."""
    pytest.importorskip("heyoka")
    if os.getloadavg()[0] > IDLE_LOAD:
        pytest.skip("the machine is busy: nothing would be learnt")
    by_sweep(tmp_path, 201, 64)  # compiles
    rounds = [
        (*by_sweep(tmp_path, samples), by_single_runs(samples), by_heyoka(tmp_path, samples)) for _ in range(ROUNDS)
    ]
    command, sweep, single, heyoka = np.median(rounds, axis=0)
    print(f"\n{samples} samples: sweep {command:.2e} s a run, without its start {sweep:.2e} s; "
          f"single runs {single:.2e} s; heyoka alone {heyoka:.2e} s")  # fmt: skip
    assert single > 5.0 * command
    assert heyoka > 5.0 * sweep or samples > 201
