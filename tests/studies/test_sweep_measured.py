"""The fast path's price: 4,096 starts of Fig. 11 by one command, beside loops over single runs and other methods.

    python -m pytest -m full -s tests/studies/test_sweep_measured.py

prints the table of the README (medians of five rounds, everything in turn).
It skips itself where the machine is busy.
"""

from __future__ import annotations

import json
import os
import pickle
import subprocess
import sys
import time
from collections.abc import Callable
from dataclasses import replace
from functools import partial
from pathlib import Path

import numpy as np
import pytest
from scipy.integrate import solve_ivp
from support.comparison_dop853 import straightforward
from support.scenes import paper

from rotor_mbs.methods.solve import solve
from rotor_mbs.models.lagrange.heyoka_adapter import array_of
from rotor_mbs.models.lagrange.taylor import build_system
from rotor_mbs.scenario.scene import Scene

pytestmark = pytest.mark.nightly

_RUNS, _MORE_RUNS = 4096, 16384
_ROUNDS = 5
_SAMPLES = (201, 1001)
_IDLE_LOAD = 1.0
_HEYOKA = Path(__file__).parents[1] / "support" / "comparison_heyoka.py"
Rates = dict[str, tuple[float, ...]]
_SWEEP = """
title = "perturbed starts of Fig. 11"
scene = "paper/fig11"
settings = {{ {settings} }}
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


def _file(folder: Path, samples: int, draws: int, method: str, more: str = "") -> Path:
    path = folder / "s.toml"
    settings = "tolerance = 1e-15" if method == "lagrange/taylor" else ""
    path.write_text(f"{more}\n{_SWEEP.format(samples=samples, draws=draws, settings=settings)}")
    return path


def _command(folder: Path, samples: int, draws: int, method: str, more: str = "") -> tuple[float, float]:
    """s a run, everything stored: of the whole command, and without start and end, as it tells itself."""
    output = folder / "o.h5"
    output.unlink(missing_ok=True)
    path = _file(folder, samples, draws, method, more)
    command = [sys.executable, "-m", "rotor_mbs", "sweep", str(path), "-m", method, "-o", str(output), "--json"]
    # A cache of compiled code that holds nothing else: it is read through by every process.
    environment = {**os.environ, "XDG_CACHE_HOME": str(folder)}
    start = time.perf_counter()
    ended = subprocess.run(command, capture_output=True, check=True, text=True, env=environment)
    spent = time.perf_counter() - start
    told = json.loads(ended.stdout.splitlines()[-1])
    assert told["statuses"] == {"ok": draws}
    return spent / draws, told["seconds"] / draws


def _bare_loop(folder: Path, samples: int, count: int, *more: str) -> tuple[float, float]:
    """s a run of heyoka alone: of a script that does 4,096, from its start to its end, and without start and end."""
    path = folder / "scenes.pickle"
    path.write_bytes(pickle.dumps(_scenes(samples, count)))
    environment = {**os.environ, "XDG_CACHE_HOME": str(folder)}
    start = time.perf_counter()
    script = [sys.executable, str(_HEYOKA), str(path), *more]
    loop = float(subprocess.run(script, capture_output=True, check=True, text=True, env=environment).stdout)
    around = time.perf_counter() - start - loop
    return around / _RUNS + loop / count, loop / count


def _own_loop(samples: int, count: int) -> tuple[float]:
    """s a run of this package's single runs: with tips, energies and work, nothing stored."""
    scenes = _scenes(samples, count)
    solve("lagrange/taylor", scenes[0], {"tolerance": 1e-15})
    start = time.perf_counter()
    for scene in scenes:
        solve("lagrange/taylor", scene, {"tolerance": 1e-15})
    return ((time.perf_counter() - start) / count,)


def _scipy_loop(samples: int, count: int) -> tuple[float]:
    """s a run as one would write it: NumPy equations, solve_ivp, the tolerance that DOP853 can keep."""
    scenes = _scenes(samples, count)
    equations, times = straightforward(scenes[0]), np.linspace(0.0, 10.0, samples)
    start = time.perf_counter()
    for scene in scenes:
        state = np.array([*scene.initial_angles, *scene.initial_rates])
        solve_ivp(equations, (0.0, 10.0), state, "DOP853", rtol=3e-14, atol=1e-16, t_eval=times)
    return ((time.perf_counter() - start) / count,)


def _scenes(samples: int, count: int) -> list[Scene]:
    base = paper("fig11", samples=samples)
    moved = 1e-6 * np.random.default_rng(1).standard_normal((count, 2))
    q0, q1, q2, q3 = base.initial_angles
    return [replace(base, initial_angles=(q0, q1 + a, q2 + b, q3)) for a, b in moved.tolist()]


def _skip_where_busy() -> None:
    if os.getloadavg()[0] > _IDLE_LOAD:
        pytest.skip("the machine is busy: nothing would be learnt")


@pytest.fixture(scope="module")
def rates(tmp_path_factory: pytest.TempPathFactory) -> Rates:
    """s a run of every contestant, medians of all rounds. Skips where the machine is busy."""
    pytest.importorskip("heyoka")
    _skip_where_busy()
    folder = tmp_path_factory.mktemp("measured")
    contestants: dict[str, Callable[[], tuple[float, ...]]] = {}
    for samples in _SAMPLES:
        contestants |= {
            f"sweep, {samples} samples": partial(_command, folder, samples, _RUNS, "lagrange/taylor"),
            f"loop over single runs, {samples} samples": partial(_own_loop, samples, 512),
            f"loop over bare heyoka, {samples} samples": partial(_bare_loop, folder, samples, 512),
            f"loop over heyoka as written, {samples} samples": partial(_bare_loop, folder, samples, 512, "written"),
            f"sweep of angles and rates, {samples} samples": partial(
                _command, folder, samples, _RUNS, "lagrange/taylor", 'outputs = ["angles", "rates"]'
            ),
        }
    contestants |= {
        "sweep of 16,384, 201 samples": partial(_command, folder, 201, _MORE_RUNS, "lagrange/taylor"),
        "sweep by exudyn_tree/rk67": partial(_command, folder, 201, 64, "exudyn_tree/rk67"),
        "sweep by lagrange/dop853": partial(_command, folder, 201, 64, "lagrange/dop853"),
        "loop over SciPy's DOP853": partial(_scipy_loop, 201, 8),
    }
    _command(folder, 201, 64, "lagrange/taylor")  # compiles
    times: dict[str, list[tuple[float, ...]]] = {name: [] for name in contestants}
    for _ in range(_ROUNDS):
        for name, run in contestants.items():
            times[name].append(run())
    found = {name: tuple(np.median(values, axis=0).tolist()) for name, values in times.items()}
    print()
    for name, spent in found.items():
        told = "; ".join(f"{1e3 * s:8.3f} ms a run, {1 / s:8.2f} per s, {_RUNS * s:7.2f} s for {_RUNS}" for s in spent)
        print(f"{name:40s} {told}")
    return found


def test_the_equations_as_written_are_those_of_the_models() -> None:
    hy = pytest.importorskip("heyoka")
    from support.comparison_heyoka import written

    scene = paper("fig11")
    equations, parameters = build_system(scene)
    numbers = array_of(parameters.values, quad=False)
    states = np.random.default_rng(0).standard_normal((8, 5))
    own, others = (
        hy.cfunc([right for _, right in one], [left for left, _ in one]) for one in (equations, written(scene))
    )
    found = own(states, pars=np.repeat(numbers[: own.nparams, None], 5, axis=1))
    np.testing.assert_allclose(others(states), found, rtol=1e-12, atol=1e-12)


@pytest.mark.parametrize("samples", _SAMPLES)
def test_a_sweep_costs_a_fifth_of_its_runs_one_by_one(rates: Rates, samples: int) -> None:
    """Of this package's single runs, which make the same results, while the sweep stores them, too."""
    assert rates[f"loop over single runs, {samples} samples"][0] > 5.0 * rates[f"sweep, {samples} samples"][0]


def test_a_sweep_costs_a_fifth_of_a_script_for_the_integrator(rates: Rates) -> None:
    """Of heyoka's own integrator, which makes no tips and no energies and stores nothing; both from start to end."""
    assert rates["loop over heyoka as written, 201 samples"][0] > 5.0 * rates["sweep, 201 samples"][0]


def test_a_sweep_costs_a_fifth_of_the_bare_integrator(rates: Rates) -> None:
    """The same with the equations of the models, a quarter cheaper than as written; neither with its start."""
    assert rates["loop over bare heyoka, 201 samples"][1] > 5.0 * rates["sweep, 201 samples"][1]
