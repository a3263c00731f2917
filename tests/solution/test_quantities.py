"""Output quantities: declared once, brought by other packages, computed for every method, stored and judged."""

from __future__ import annotations

import math
import sys
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from support.packages import install
from support.scenes import paper

from rotor_mbs.analysis.judgement import judge
from rotor_mbs.errors import InputError
from rotor_mbs.methods.solve import solve
from rotor_mbs.scenario.scene import Scene
from rotor_mbs.solution import quantities
from rotor_mbs.solution.quantities import Quantity
from rotor_mbs.solution.trajectory import Integration, Solution, Trajectory
from rotor_mbs.studies.run import solve_judged

PLUG_IN = (Path(__file__).parents[1] / "extension" / "rotor_momentum.py").read_text()
SCENE = paper("fig08", duration=0.5, samples=11)
ASKED = replace(SCENE, outputs=("angles", "momentum"))


@pytest.fixture
def plug_in(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[None]:
    """An installed package with the output `momentum`."""
    outputs = {"momentum": "rotor_momentum:QUANTITY", "broken": "rotor_momentum:NOTHING", "number": "math:pi"}
    install(tmp_path, "rotor_momentum", PLUG_IN, "rotor_mbs.quantities", outputs)
    monkeypatch.syspath_prepend(tmp_path)
    quantities.installed.cache_clear()
    yield
    quantities.installed.cache_clear()
    sys.modules.pop("rotor_momentum", None)


def moved(scene: Scene, pitch: float) -> Trajectory:
    time = np.linspace(0.0, scene.duration, scene.samples)
    return Trajectory(time, np.full((scene.samples, 4), pitch), np.zeros((scene.samples, 4)))


@pytest.mark.usefixtures("plug_in")
@pytest.mark.parametrize(("error", "status"), [(0.9, "ok"), (1.1, "inaccurate"), (math.nan, "inaccurate")])
def test_it_is_judged_against_the_same_producer_applied_to_the_reference(error: float, status: str) -> None:
    """At rest there is no momentum, in N m s."""
    exact, run = moved(ASKED, 1.0), moved(ASKED, 1.0)
    run.quantities["shaft_momentum"] = np.full(ASKED.samples, error)
    result = judge(ASKED, Solution(ASKED, "lagrange/taylor", run, Integration(True)), exact)
    assert result.status == status
    assert result.metrics["shaft_momentum_error_max"] == pytest.approx(error, nan_ok=True)


@pytest.mark.usefixtures("plug_in")
@pytest.mark.parametrize("output", ["broken", "number", "absent"])
def test_an_output_that_cannot_be_had_is_refused_in_one_line(output: str) -> None:
    with pytest.raises(InputError) as caught:
        quantities.quantities(["angles", output])
    assert output in str(caught.value)
    assert "\n" not in str(caught.value)


def test_a_producer_of_another_shape_is_refused() -> None:
    wrong = Quantity("wrong", ("time", "blade"), "1", "", producer=lambda _, samples: samples.time)
    with pytest.raises(InputError, match=r"gives shape \(11,\); allowed: \(11, 3\)"):
        quantities.array_of(wrong, SCENE, moved(SCENE, 0.0))


def test_a_solution_has_its_quantities_status_and_metrics() -> None:
    run, _ = solve_judged(SCENE, "lagrange/dop853")
    assert (run.status, run.message) == ("ok", "")
    assert run.metrics["energy_drift_max"] < 1e-9
    np.testing.assert_array_equal(run.energy_error, run["energy_error"])
    np.testing.assert_array_equal(run["time"], run.time)
    with pytest.raises(KeyError, match="this solution has: time, angles"):
        run["constraint_error"]
    with pytest.raises(AttributeError, match="nothing"):
        assert run.nothing is None
    pytest.importorskip("xarray")
    np.testing.assert_array_equal(run.to_xarray().angles.sel(coordinate="pitch 2"), run.angles[:, 2])


def test_without_xarray_the_extra_is_named(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "xarray", None)
    with pytest.raises(InputError, match=r'pip install "rotor_mbs\[xarray\]"'):
        solve("lagrange/dop853", SCENE, {}).to_xarray()
