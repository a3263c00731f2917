"""The API under load: wrong limits, generators, daemonic processes, threads, lost workers,
copies."""

from __future__ import annotations

import copy
import gc
import multiprocessing
import pickle
import subprocess
import sys
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import rotor_mbs as rm
from rotor_mbs.errors import InputError
from rotor_mbs.models.lagrange import defects, reference
from rotor_mbs.scenario.scene import Scene

METHOD = "lagrange/dop853"


def _scene() -> Scene:
    return rm.scene("paper/fig08").replace(duration=0.2, samples=11)


def _sweep(**options: Any) -> rm.Results:
    return rm.sweep(
        _scene(), **{"parameters": {"gravity": [9.0, 9.8]}, "methods": [METHOD], **options}
    )


SECONDS, COUNT = "allowed: seconds, more than 0$", "allowed: a whole number from 0 to 1024$"
WRONG = [
    *(("timeout", value, SECONDS) for value in (-1, 0, float("-inf"), float("nan"), -(10**400))),
    *(("workers", value, COUNT) for value in (-1, 10**9)),
]


@pytest.mark.parametrize(("name", "value", "allowed"), WRONG)
def test_a_wrong_limit_is_a_line(name: str, value: Any, allowed: str) -> None:
    line = f"^{name}: .*; {allowed}"
    with pytest.raises(InputError, match=line):
        rm.run(_scene(), [METHOD], **{name: value})
    with pytest.raises(InputError, match=line):
        _sweep(**{name: value})
    with pytest.raises(InputError, match=line):
        rm.run(_scene(), METHOD, **{name: value})


@pytest.mark.parametrize("timeout", [1e308, float("inf")])
def test_a_time_limit_beyond_any_run_is_none(timeout: float) -> None:
    assert rm.run(_scene(), METHOD, timeout=timeout).status == "ok"
    assert rm.run(_scene(), [METHOD], timeout=timeout).statuses == {"ok": 2}
    assert _sweep(timeout=timeout).statuses == {"ok": 2}


@pytest.mark.parametrize(
    "values",
    [
        range(1, 4),
        (float(x) for x in (1, 2, 3)),
        np.array([1, 2, 3]),
        {"values": np.array([1.0, 2.0, 3.0])},
    ],
)
def test_values_of_a_sweep_may_be_anything_that_is_gone_through_once(values: Any) -> None:
    runs = rm.sweep(
        _scene(),
        {"gravity": values},
        methods=(m for m in [METHOD]),
        outputs=iter(["angles"]),
        samples=3,
    )
    assert runs.column("gravity").tolist() == [1.0, 2.0, 3.0]
    assert runs.statuses == {"ok": 3}


@pytest.mark.parametrize(
    "parameters", [{}, {"gravity": 1.0}, {"gravity": "12"}, {"gravity": []}, {3: [1.0]}]
)
def test_wrong_parameters_are_a_line(parameters: Any) -> None:
    with pytest.raises(InputError, match="allowed: "):
        _sweep(parameters=parameters)


@pytest.mark.full
def test_a_daemonic_process_has_workers(monkeypatch: pytest.MonkeyPatch) -> None:
    """As those of multiprocessing.Pool are, which may not start processes of multiprocessing."""
    monkeypatch.setitem(multiprocessing.current_process()._config, "daemon", True)  # type: ignore[attr-defined]
    assert _sweep(workers=1).statuses == {"ok": 2}


SCRIPT = """import rotor_mbs as rm
scene = rm.scene("paper/fig08").replace(duration=0.2, samples=11)
print(rm.sweep(scene, {"gravity": [9.0, 9.8]}, methods=["lagrange/dop853"], workers=1).statuses)
"""


@pytest.mark.full
def test_a_script_from_standard_input_needs_no_guard() -> None:
    ended = subprocess.run(
        [sys.executable, "-"],
        input=SCRIPT,
        capture_output=True,
        text=True,
        timeout=100,
        check=False,
    )
    assert (ended.returncode, ended.stdout, ended.stderr) == (0, "{'ok': 2}\n", "")


STIFF: dict[str, dict[str, Any]] = {
    "damper": {"bearing.damping": 1e9},
    "fast": {"initial.rates": [0.3, 1e4, 1e4, 1e4]},
    "shaft": {"shaft.damping": 1e12},
}


def _stiff(kind: str = "damper") -> Scene:
    return rm.scene("check/general").replace(**STIFF[kind])


def _in_thread(call: Callable[[], Any]) -> Any:
    with ThreadPoolExecutor(1) as other:
        return other.submit(call).result()


def _here(call: Callable[[], Any]) -> Any:
    return call()


@pytest.mark.full
@pytest.mark.parametrize("called", [_here, _in_thread])
@pytest.mark.parametrize("kind", ["damper", "fast", "shaft"])
def test_a_time_limit_bounds_reference_and_judging(
    kind: str, called: Callable[..., rm.Run]
) -> None:
    """Without a limit each of them takes minutes."""
    run = called(lambda: rm.run(_stiff(kind), "lagrange/radau", reference=True, timeout=2.0))
    assert run.status in ("timed_out", "ok", "inaccurate")


@pytest.mark.parametrize("called", [_here, _in_thread])
def test_a_time_limit_bounds_the_reference_of_a_comparison(called: Callable[..., object]) -> None:
    """Nothing is compared with a reference that ends early."""
    data = {"time": np.linspace(0.0, 0.5, 3), "rotor": np.full(3, 0.5)}
    with pytest.raises(InputError, match=r"timeout: no reference after 0.25 s"):
        called(lambda: rm.compare(data, _stiff(), timeout=0.25))
    with pytest.raises(InputError, match=SECONDS):
        rm.compare(data, _stiff(), timeout=float("nan"))


WILD = """import numpy as np
from rotor_mbs.methods.base import Method
from rotor_mbs.solution.trajectory import Integration, Trajectory, sample_times

class Wild:
    def __init__(self, scene, settings):
        self.scene = scene
    def integrate(self):
        return Integration(success=True)
    def observe(self):
        time = sample_times(self.scene)
        angles, rates = (np.tile(start, (len(time), 1)) for start in (self.scene.initial_angles, [0.0] * 4))
        rates[3] = 1e200
        return Trajectory(time, angles, rates)

METHOD = Method(name="wild", label="Wild", build=Wild)
"""


def test_finite_samples_that_are_no_motion_are_inaccurate_without_heyoka(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """And not over a time limit: nothing is integrated without end."""
    for module in (defects, reference):
        monkeypatch.setattr(module, "is_available", lambda: False)
    path = tmp_path / "wild.py"
    path.write_text(WILD)
    for limits in ({}, {"timeout": 20.0}):
        assert rm.run(_scene(), str(path), **limits).status == "inaccurate"
        run = rm.run(_scene(), METHOD)
        rates = run.rates.copy()
        rates[3] = 1e200
        data = {"time": run.time, "angles": run.angles, "rates": rates}
        assert rm.compare(data, _scene(), **limits).status == "inaccurate"


def test_a_misspelt_setting_is_told_before_a_scene_is_refused() -> None:
    """Whether the method cannot represent it or is not installed."""
    scene = _scene().replace(hub={"inertia": 3.0})
    with pytest.raises(
        InputError,
        match=(
            r"no setting 'relative_tolerence', perhaps "
            r"relative_tolerance"
        ),
    ):
        rm.run(scene, ["printed/ode45"], relative_tolerence=1e-9)
    with pytest.raises(InputError, match="hub"):
        rm.run(scene, ["printed/ode45"], relative_tolerance=1e-9)


@pytest.mark.full
def test_limits_of_threads_do_not_end_each_other() -> None:
    """A short run's limit, which is over with it, is not that of a long run in another thread."""

    def long() -> str:
        return rm.run(_stiff(), "lagrange/radau", reference=True, timeout=2.0).status

    def short() -> list[rm.Run]:
        return [rm.run(_scene(), "lagrange/radau", timeout=limit) for limit in (1e3, 1e-3) * 10]

    with ThreadPoolExecutor(2) as threads:
        ended, runs = threads.submit(long), threads.submit(short)
        assert ended.result(60.0) in ("timed_out", "ok", "inaccurate")
        assert {run.status for run in runs.result()[::2]} == {"ok"}


@pytest.mark.parametrize("make", [lambda: rm.run(_scene(), [METHOD]), _sweep], ids=["run", "sweep"])
@pytest.mark.parametrize(
    "copied",
    [copy.copy, copy.deepcopy, lambda runs: pickle.loads(pickle.dumps(runs))],
    ids=["copy", "deepcopy", "pickle"],
)
def test_a_copy_outlives_its_original(
    make: Callable[[], rm.Results], copied: Callable[[rm.Results], rm.Results]
) -> None:
    runs = make()
    twin, label, before = copied(runs), list(runs)[-1], runs[list(runs)[-1]].angles
    del runs
    gc.collect()
    assert np.array_equal(twin[label].angles, before)
    assert twin.table() is not None
