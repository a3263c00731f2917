"""Packages from outside: tests/extension/rotor_rk4.py adds a method, rotor_momentum.py an output
quantity.

Each is one module, found by its entry point; no file of rotor_mbs knows them.
"""

from __future__ import annotations

import json
import math
import os
from collections.abc import Iterator
from pathlib import Path

import h5py
import numpy as np
import pytest
from support.commands import rotor_mbs
from support.other_code import energies
from support.packages import forget_what_is_installed, install

import rotor_mbs as rm
from rotor_mbs.analysis.judgement import judge
from rotor_mbs.methods.catalogue import find_method
from rotor_mbs.report.build import write_report
from rotor_mbs.runs.read import read_records
from rotor_mbs.scenario.scene import Scene
from rotor_mbs.solution import quantities
from rotor_mbs.solution.quantities import Quantity
from rotor_mbs.solution.trajectory import Integration, Solution, Trajectory

SOURCES = Path(__file__).parent / "extension"
PACKAGES = {
    "rotor_rk4": ("rotor_mbs.methods", {"rk4": "rotor_rk4:METHOD"}),
    "rotor_momentum": (
        "rotor_mbs.quantities",
        {
            "momentum": "rotor_momentum:QUANTITY",
            "broken": "rotor_momentum:NOTHING",
            "number": "math:pi",
        },
    ),
}
METHODS = ("outside/rk4", "lagrange/dop853", "exudyn_tree/rk67")
# What outside/rk4 can compute, with pitches at rest.
SCENE = rm.scene("check/general").replace(
    duration=0.5, samples=51,
    **{"torque.rotor": 0, "bearing.stiffness": 0, "bearing.damping": 0, "shaft.damping": 0},
    **{"initial.angles": [0.5, 0.3, -0.2, 0.1], "initial.rates": [0.4, 0, 0, 0]},
)  # fmt: skip


@pytest.fixture(scope="module", autouse=True)
def folder(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Path]:
    """A folder on the path with the packages as an installer leaves them, and two scenes; commands
    run there."""
    folder = tmp_path_factory.mktemp("site")
    for module, (group, entry_points) in PACKAGES.items():
        install(folder, module, (SOURCES / f"{module}.py").read_text(), group, entry_points)
    (folder / "one.toml").write_text(SCENE.text)
    (folder / "two.toml").write_text(SCENE.text.replace("outputs = [", 'outputs = ["momentum", '))
    with pytest.MonkeyPatch.context() as patch:
        patch.chdir(folder)
        patch.syspath_prepend(folder)
        patch.setenv(
            "PYTHONPATH",
            os.pathsep.join([str(folder), *filter(None, [os.environ.get("PYTHONPATH")])]),
        )
        forget_what_is_installed()
        yield folder
    forget_what_is_installed()


def command(*words: str, status: int = 0) -> str:
    ended = rotor_mbs(*words)
    assert ended.status == status, ended
    return ended.out + ended.err


def test_list_show_and_a_wrong_name_know_the_method() -> None:
    assert "  outside/rk4  " in command("list")
    assert json.loads(command("show", "one.toml", "--json"))["models"]["outside"]["methods"] == [
        "outside/rk4"
    ]
    assert "step" in command("show", "outside/rk4")
    assert "outside/rk4" in command("run", "one.toml", "-m", "outside/rk5", status=2)
    assert "no springs" in command("run", "stiff/bearing-1e4", "-m", "outside/rk4", status=2)


@pytest.fixture(scope="module")
def stored(folder: Path) -> Path:
    """A file of runs of worker processes, which find the packages for themselves."""
    path = folder / "two.h5"
    words = [word for method in METHODS for word in ("-m", method)]
    ended = rotor_mbs("run", folder / "two.toml", *words, "-o", path, "-j", 1, processes=True)
    assert ended.status == 0, ended
    return path


def test_a_run_is_stored_judged_and_checked(stored: Path) -> None:
    runs = rm.open(stored)
    run, other = runs["two/outside/rk4"], runs["two/lagrange/dop853"]
    assert (run.status, run.settings) == ("ok", {"step": 2e-3})
    assert np.abs(run.angles - other.angles).max() < 1e-9  # order 4: 1e-11 at this step
    assert np.abs(run["tip"] - other["tip"]).max() < 1e-8
    # nobody asked for it
    assert "shaft_momentum" not in rm.run("one.toml", "outside/rk4").quantities
    assert "defect: two outside/rk4" in command("check", str(stored), "-v")


def test_a_sweep_takes_its_runs_side_by_side_and_judges_them_by_its_own_bounds() -> None:
    """Nine runs, each once; at a step of 0.1 s, 0.8 rad of a fast pitch, they are over the
    package's own bound."""
    method, blocks = find_method("outside/rk4"), []
    solve_many = method.solve_many

    def counted(scenes: list[rm.Scene], settings: object) -> object:
        blocks.append(len(scenes))
        return solve_many(scenes, settings)

    scene = rm.load("one.toml").replace(samples=6, **{"initial.rates[1]": 8.0})
    angles = {"initial.angles[1]": np.linspace(0.1, 0.9, 9).tolist()}
    for step, status in ((2e-3, "ok"), (0.1, "inaccurate")):
        blocks.clear()
        with pytest.MonkeyPatch.context() as patch:
            patch.setitem(vars(method), "solve_many", counted)
            data = rm.sweep(scene, angles, methods=["outside/rk4"], settings={"step": step})
        assert (sum(blocks), max(blocks) > 1, data.statuses) == (9, True, {status: 9})
        alone = rm.run(scene.replace(**{"initial.angles[1]": 0.1}), "outside/rk4", step=step)
        assert alone.status == status
        assert np.array_equal(data.at("angles", 5)[0], alone.angles[5])


def test_a_quantity_is_stored_judged_and_drawn_for_every_method(stored: Path) -> None:
    # At the start the pitches are at rest: twice the kinetic energy by the rotor's rate.
    (kinetic,), _ = energies(SCENE, np.array([[*SCENE.initial_angles, *SCENE.initial_rates]]))
    runs = rm.open(stored)
    for method in METHODS:
        run = runs[f"two/{method}"]
        assert run["shaft_momentum"].shape == (51,)
        assert run["shaft_momentum"][0] == pytest.approx(2.0 * kinetic / 0.4, rel=1e-12)
        assert 0.0 <= run.metrics["shaft_momentum_error_max"] < 1.0
    with h5py.File(stored) as file:
        column = file["two/shaft_momentum"]
        assert (column.attrs["units"], column.shape) == ("N m s", (len(runs), 51))
    assert "momentum" in command("check", str(stored), "-v")
    page = write_report(stored, Path("pages")).read_text()
    assert "from outside, RK4" in page
    assert "Angular momentum about the shaft" in page


def moved(scene: Scene, pitch: float) -> Trajectory:
    time = np.linspace(0.0, scene.duration, scene.samples)
    return Trajectory(time, np.full((scene.samples, 4), pitch), np.zeros((scene.samples, 4)))


@pytest.mark.parametrize(
    ("error", "status"), [(0.9, "ok"), (1.1, "inaccurate"), (math.nan, "inaccurate")]
)
def test_it_is_judged_against_the_same_producer_applied_to_the_reference(
    error: float, status: str
) -> None:
    """At rest there is no momentum, in N m s."""
    asked = rm.scene("paper/fig08").replace(
        duration=0.5, samples=11, outputs=["angles", "momentum"]
    )
    asked = asked.replace(**{"initial.angles": [1.0] * 4})
    exact, run = moved(asked, 1.0), moved(asked, 1.0)
    run.quantities["shaft_momentum"] = np.full(asked.samples, error)
    result = judge(asked, Solution(asked, "lagrange/taylor", run, Integration(True)), exact)
    assert result.status == status
    assert result.metrics["shaft_momentum_error_max"] == pytest.approx(error, nan_ok=True)


@pytest.mark.parametrize("output", ["broken", "number", "absent"])
def test_an_output_that_cannot_be_had_is_refused_in_one_line(output: str) -> None:
    with pytest.raises(rm.InputError) as caught:
        quantities.quantities(["angles", output])
    assert output in str(caught.value)
    assert "\n" not in str(caught.value)


def test_a_producer_of_another_shape_is_refused() -> None:
    wrong = Quantity("wrong", ("time", "blade"), "1", "", producer=lambda _, samples: samples.time)
    with pytest.raises(rm.InputError, match=r"gives shape \(51,\); allowed: \(51, 3\)"):
        quantities.array_of(wrong, SCENE, moved(SCENE, 0.0))


@pytest.mark.parametrize("method", ["lagrange/taylor", "lagrange/dop853"])
def test_a_sweep_stores_a_quantity(method: str) -> None:
    if not find_method(method).is_installed:
        pytest.skip(f"{method} is not installed")
    scene = rm.scene("paper/fig11").replace(
        duration=0.2, samples=5, outputs=["angles", "rates", "momentum"]
    )
    data = rm.sweep(scene, {"gravity": [9.0, 10.0]}, methods=[method], outputs=[*scene.outputs])
    for i, gravity in enumerate((9.0, 10.0)):
        alone = rm.run(scene.replace(gravity=gravity), method)["shaft_momentum"]
        np.testing.assert_allclose(data.column("shaft_momentum")[i], alone, rtol=1e-10)


@pytest.mark.full
def test_bench_measures_its_ladder_and_its_order() -> None:
    command(
        "bench",
        "one.toml",
        "-m",
        "outside/rk4",
        "-o",
        "bench.h5",
        "--repeats",
        "2",
        "--budget",
        "30",
    )
    (curve,) = read_records(Path("bench.h5"), "bench")
    assert (curve.name, curve.attributes["order_expected"]) == ("outside/rk4", 4)
    assert abs(curve.attributes["order"] - 4.0) < 0.3
    assert "from outside, RK4" in Path("bench-report/index.html").read_text()


@pytest.mark.full
def test_stability_takes_it_with_its_label() -> None:
    command("stability", "one.toml", "-o", "stable.h5", "--timeout", "4")
    assert rm.open("stable.h5")["one/outside/rk4"].status == "ok"
    assert "from outside, RK4" in Path("stable-report/index.html").read_text()
