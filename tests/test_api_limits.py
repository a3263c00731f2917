"""The API under load: wrong limits, generators, daemonic processes, threads, lost workers, copies."""

from __future__ import annotations

import copy
import gc
import multiprocessing
import pickle
import subprocess
import sys
import threading
import time
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import rotor_mbs as rm
from rotor_mbs.errors import InputError
from rotor_mbs.scenario.scene import Scene

METHOD = "lagrange/dop853"


def _scene() -> Scene:
    return rm.scene("paper/fig08").replace(duration=0.2, samples=11)


@pytest.mark.parametrize("timeout", [-1, 0, float("-inf"), float("nan"), "3", None, True])
@pytest.mark.parametrize("method", [METHOD, [METHOD]], ids=["one", "several"])
def test_a_time_limit_that_is_none_is_a_line(timeout: Any, method: Any) -> None:
    with pytest.raises(InputError, match=r"^timeout: .*; allowed: seconds, more than 0$"):
        rm.run(_scene(), method, timeout=timeout)
    with pytest.raises(InputError, match=r"^timeout: .*; allowed: seconds, more than 0$"):
        rm.sweep(_scene(), {"gravity": [9.8]}, methods=[METHOD], timeout=timeout)


@pytest.mark.parametrize("timeout", [1e308, float("inf")])
def test_a_time_limit_beyond_any_run_is_none(timeout: float) -> None:
    assert rm.run(_scene(), METHOD, timeout=timeout).status == "ok"
    assert rm.run(_scene(), [METHOD], timeout=timeout).statuses == {"ok": 2}
    assert rm.sweep(_scene(), {"gravity": [9.8]}, methods=[METHOD], timeout=timeout).statuses == {"ok": 1}


@pytest.mark.parametrize("workers", [-1, 1.5, "2", None, 10**9])
def test_a_number_of_workers_that_is_none_is_a_line(workers: Any) -> None:
    with pytest.raises(InputError, match=r"^workers: .*; allowed: a whole number from 0 to 1024$"):
        rm.run(_scene(), [METHOD], workers=workers)
    with pytest.raises(InputError, match=r"^workers: .*; allowed: a whole number from 0 to 1024$"):
        rm.sweep(_scene(), {"gravity": [9.8]}, methods=[METHOD], workers=workers)


@pytest.mark.parametrize(
    "values", [range(1, 4), (float(x) for x in (1, 2, 3)), np.array([1, 2, 3]), {"values": np.array([1.0, 2.0, 3.0])}]
)
def test_values_of_a_sweep_may_be_anything_that_is_gone_through_once(values: Any) -> None:
    runs = rm.sweep(_scene(), {"gravity": values}, methods=(m for m in [METHOD]), outputs=iter(["angles"]), samples=3)
    assert runs.column("gravity").tolist() == [1.0, 2.0, 3.0]
    assert runs.statuses == {"ok": 3}


@pytest.mark.parametrize("parameters", [["gravity"], {"gravity": object()}, {"gravity": 1.0}, {"gravity": "12"}])
def test_parameters_that_are_none_are_a_line(parameters: Any) -> None:
    with pytest.raises(InputError, match="allowed: "):
        rm.sweep(_scene(), parameters)


@pytest.mark.parametrize("method", [None, 3, [3]])
def test_methods_that_are_none_are_a_line(method: Any) -> None:
    with pytest.raises(InputError, match=r"^method: .*; allowed: a name, or a list of names$"):
        rm.run(_scene(), method)


def _in_daemon(path: str) -> str:
    try:
        rm.sweep(_scene(), {"gravity": [9.0, 9.8]}, methods=[METHOD], workers=1, output=path)
    except InputError as error:
        return str(error)
    return "stored"


def test_a_daemonic_process_stores_no_runs_that_never_ran(tmp_path: Path) -> None:
    path = tmp_path / "s.h5"
    with multiprocessing.get_context("spawn").Pool(1) as pool:
        assert pool.apply(_in_daemon, (str(path),)).endswith("allowed: workers=0")
    assert not path.exists()
    assert rm.sweep(_scene(), {"gravity": [9.0, 9.8]}, methods=[METHOD], output=path).statuses == {"ok": 2}


UNGUARDED = """import rotor_mbs as rm
scene = rm.scene("paper/fig08").replace(duration=0.2, samples=11)
"""


@pytest.mark.full
@pytest.mark.parametrize(
    "call",
    [
        'rm.run(scene, ["lagrange/dop853"], workers=1)',
        'rm.sweep(scene, {"gravity": range(5, 305)}, methods=["lagrange/dop853"], workers=1)',
    ],
)
def test_the_reason_of_lost_workers_is_told(call: str, tmp_path: Path) -> None:
    script = tmp_path / "unguarded.py"
    script.write_text(UNGUARDED + call)
    ended = subprocess.run([sys.executable, str(script)], capture_output=True, text=True, timeout=100, check=False)
    assert ended.returncode == 1
    _, _, told = ended.stderr.rpartition("rotor_mbs.errors.ResourceError: ")
    assert 'in a script, the call belongs under `if __name__ == "__main__":`' in told


DAMPED = {"bearing.damping": [1e9, 1e9]}
FAST = {"initial.rates": [0.3, 1e4, 1e4]}
SHAFT = {"shaft.damping": 1e12}


def _stiff(change: dict[str, Any]) -> Scene:
    scene = rm.scene("check/general")
    count = len(scene.blades)
    changes = {key: [1e9] * count if key == "bearing.damping" else value for key, value in change.items()}
    if "initial.rates" in changes:
        changes["initial.rates"] = [0.3, *[1e4] * count]
    return scene.replace(**changes)


@pytest.mark.parametrize(
    ("change", "in_thread"),
    [
        pytest.param(DAMPED, False, id="damper-main"),
        *(
            pytest.param(change, in_thread, id=f"{name}-{'thread' if in_thread else 'main'}", marks=pytest.mark.full)
            for name, change in (("damper", DAMPED), ("fast", FAST), ("shaft", SHAFT))
            for in_thread in (False, True)
            if in_thread or name != "damper"
        ),
    ],
)
def test_a_time_limit_bounds_reference_and_judging(change: dict[str, Any], in_thread: bool) -> None:
    """Of the limit of 2 s: as long again for the engine's compilation, and a second for observing and for judging.

    In seconds of the processor, which other processes do not lengthen.
    """
    scene = _stiff(change)
    begun = time.process_time()
    if in_thread:
        with ThreadPoolExecutor(1) as other:
            run = other.submit(rm.run, scene, "lagrange/radau", reference=True, timeout=2.0).result()
    else:
        run = rm.run(scene, "lagrange/radau", reference=True, timeout=2.0)
    assert time.process_time() - begun < 12.0
    assert run.status in ("timed_out", "ok", "inaccurate")


@pytest.mark.parametrize("in_thread", [False, True])
def test_a_time_limit_bounds_the_reference_of_a_comparison(in_thread: bool) -> None:
    """Nothing is compared with a reference that ends early."""
    scene, data = _stiff(DAMPED), {"time": np.linspace(0.0, 0.5, 3), "rotor": np.full(3, 0.5)}
    with ThreadPoolExecutor(1) as other:
        call = partial(rm.compare, data, scene, timeout=1.0)
        compared = (lambda: other.submit(call).result()) if in_thread else call
        with pytest.raises(InputError, match="timeout: no reference after 1 s"):
            compared()
    with pytest.raises(InputError, match="allowed: seconds, more than 0"):
        rm.compare(data, scene, timeout=float("nan"))


def test_limits_of_threads_do_not_end_each_other() -> None:
    """A short run's limit, which is over with it, is not that of a long run in another thread."""
    scene = _stiff(DAMPED)
    ended: dict[str, float] = {}

    def run(name: str, scene: Scene, timeout: float) -> None:
        begun = time.monotonic()
        for _ in range(1 if name == "long" else 20):
            rm.run(scene, "lagrange/radau", reference=name == "long", timeout=timeout)
        ended[name] = time.monotonic() - begun

    threads = [
        threading.Thread(target=run, args=("long", scene, 2.0)),
        threading.Thread(target=run, args=("short", _scene(), 1e3)),
    ]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join(60.0)
    assert ended["long"] < 15.0


def test_threads_that_run_several_methods_have_the_same_result() -> None:
    def compared(_: int) -> list[str]:
        return [
            f"{run.status} {run.angles.tobytes().hex()}"
            for run in rm.run(_scene(), [METHOD, "lagrange/radau"]).values()
        ]

    with ThreadPoolExecutor(4) as threads:
        first, *others = threads.map(compared, range(8))
    assert all(other == first for other in others)


def _several() -> rm.Runs:
    return rm.run(_scene(), [METHOD])


def _swept() -> rm.Runs:
    return rm.sweep(_scene(), {"gravity": [9.0, 9.8]}, methods=[METHOD])


@pytest.mark.parametrize("make", [_several, _swept], ids=["run", "sweep"])
@pytest.mark.parametrize(
    "copied",
    [copy.copy, copy.deepcopy, lambda runs: pickle.loads(pickle.dumps(runs))],
    ids=["copy", "deepcopy", "pickle"],
)
def test_a_copy_outlives_its_original(make: Callable[[], rm.Runs], copied: Callable[[rm.Runs], rm.Runs]) -> None:
    runs = make()
    twin, label, before = copied(runs), list(runs)[-1], runs[list(runs)[-1]].angles
    del runs
    gc.collect()
    assert np.array_equal(twin[label].angles, before)
    assert twin.table() is not None
