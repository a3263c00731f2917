"""Packages from outside: tests/extension/rotor_rk4.py adds a method, rotor_momentum.py an output quantity.

Each is one module of less than 80 lines, found by its entry point; no file of rotor_mbs knows them.
"""

from __future__ import annotations

import json
import os
import subprocess
import sys
from pathlib import Path

import h5py
import numpy as np
import pytest

SOURCES = Path(__file__).parent / "extension"
SCENE = """
title = "Two pitched blades"
blades = 2
gravity = 9.81
duration = 0.5
samples = 51
outputs = {outputs}
[blade]
mass = 800.0
centre_of_mass = [0.3, 0.1, 5.2]
inertia = [4000, 4100, 300, 0, -40, 0]
tip = [0.5, 0, 11]
[hub]
inertia = 5000.0
[initial]
angles = [0.5, 0.3, -0.2]
rates = [0.4, 0, 0]
"""


class Installed:
    """The two packages as an installer leaves them, and the command line in a process that has them on its path."""

    def __init__(self, folder: Path) -> None:
        self.folder = folder
        for module, group, entry in (
            ("rotor_rk4", "rotor_mbs.methods", "rk4 = rotor_rk4:METHOD"),
            ("rotor_momentum", "rotor_mbs.quantities", "momentum = rotor_momentum:QUANTITY"),
        ):
            (folder / f"{module}.py").write_text((SOURCES / f"{module}.py").read_text())
            about = folder / f"{module}-1.0.dist-info"
            about.mkdir()
            (about / "METADATA").write_text(f"Metadata-Version: 2.1\nName: {module}\nVersion: 1.0\n")
            (about / "entry_points.txt").write_text(f"[{group}]\n{entry}\n")

    def python(self, *arguments: str, status: int = 0) -> str:
        path = os.pathsep.join(filter(None, [str(self.folder), os.environ.get("PYTHONPATH", "")]))
        command = [sys.executable, "-W", "error", *arguments]
        environment = {**os.environ, "PYTHONPATH": path}
        done = subprocess.run(command, capture_output=True, text=True, env=environment, cwd=self.folder)
        assert done.returncode == status, done.stdout + done.stderr
        return done.stdout + done.stderr

    def command(self, *arguments: str, status: int = 0) -> str:
        return self.python("-m", "rotor_mbs", *arguments, status=status)

    def scene(self, name: str, outputs: str = '["angles", "rates", "tip", "energy"]') -> str:
        (self.folder / f"{name}.toml").write_text(SCENE.format(outputs=outputs))
        return f"{name}.toml"


@pytest.fixture(scope="module")
def installed(tmp_path_factory: pytest.TempPathFactory) -> Installed:
    return Installed(tmp_path_factory.mktemp("site"))


@pytest.mark.parametrize("name", ["rotor_rk4", "rotor_momentum"])
def test_a_package_is_small(name: str) -> None:
    lines = (SOURCES / f"{name}.py").read_text().splitlines()
    assert len([line for line in lines if line.strip()]) < 80


def test_show_and_a_wrong_name_know_the_method(installed: Installed) -> None:
    shown = json.loads(installed.command("show", installed.scene("one"), "--json"))
    assert shown["models"]["outside"]["methods"] == ["outside/rk4"]
    assert "outside/rk4" in installed.command("list")
    assert "step" in installed.command("show", "outside/rk4")
    assert "outside/rk4" in installed.command("run", installed.scene("one"), "-m", "outside/rk5", status=2)
    refused = installed.command("run", "stiff/bearing-1e4", "-m", "outside/rk4", status=2)
    assert "no springs" in refused


def test_a_run_is_stored_judged_checked_and_reported(installed: Installed) -> None:
    scene = installed.scene("one")
    installed.command("run", scene, "-m", "outside/rk4", "-m", "lagrange/dop853", "-o", "one.h5")
    with h5py.File(installed.folder / "one.h5") as file:
        run, other = file["one/outside/rk4"], file["one/lagrange/dop853"]
        assert (run.attrs["status"], json.loads(run.attrs["settings"])) == ("ok", {"step": 2e-3})
        assert np.abs(run["angles"][()] - other["angles"][()]).max() < 1e-9  # order 4: 1e-11 at this step
        assert np.abs(run["tip"][()] - other["tip"][()]).max() < 1e-8
    checked = installed.command("check", "one.h5", "-v")
    assert "agreement: one outside/rk4" in checked
    installed.command("report", "one.h5", "-o", "pages")
    page = (installed.folder / "pages" / "one.html").read_text()
    assert "from outside, RK4" in page
    assert "#882255" in page


def test_a_bound_of_the_package_is_the_one_that_counts(installed: Installed) -> None:
    """At a step of 0.1 s, 0.8 rad of a fast pitch, the error is over the package's own bound."""
    code = (
        "import rotor_mbs as rm; scene = rm.load('one.toml').replace(samples=6, **{'initial.rates[1]': 8.0}); "
        "print(*(rm.run(scene, 'outside/rk4', reference=True, step=h).status for h in (2e-3, 0.1)))"
    )
    installed.scene("one")
    assert installed.python("-c", code).split() == ["ok", "inaccurate"]


def test_wrong_settings_of_the_package_are_refused_with_its_own(installed: Installed) -> None:
    code = "import rotor_mbs as rm; rm.run(rm.load('one.toml'), 'outside/rk4', steps=1e-3)"
    installed.scene("one")
    assert "step (a number above 0, in s; default 0.002)" in installed.python("-c", code, status=1)


def test_bench_measures_its_ladder_and_its_order(installed: Installed) -> None:
    installed.command(
        "bench", installed.scene("one"), "-m", "outside/rk4", "-o", "bench.h5", "--repeats", "2", "--budget", "30"
    )
    with h5py.File(installed.folder / "bench.h5") as file:
        curve = file["bench/one/outside/rk4"]
        assert curve.attrs["order_expected"] == 4
        assert abs(curve.attrs["order"] - 4.0) < 0.3
    assert "from outside, RK4" in (installed.folder / "bench-report" / "index.html").read_text()


def test_a_sweep_takes_its_runs_side_by_side_and_judges_them_by_its_own_bounds(installed: Installed) -> None:
    """Nine runs, each once; at a step of 0.1 s they are over the package's bound, as one alone is."""
    installed.scene("one")
    code = (
        "import numpy as np, rotor_rk4, rotor_mbs as rm\n"
        "blocks = []\n"
        "def counted(scenes, settings):\n"
        "    blocks.append(len(scenes))\n"
        "    return rotor_rk4.solve_many(scenes, settings)\n"
        "rotor_rk4.METHOD.__dict__['solve_many'] = counted\n"
        "scene = rm.load('one.toml').replace(samples=6, **{'initial.rates[1]': 8.0})\n"
        "angles = {'initial.angles[1]': np.linspace(0.1, 0.9, 9).tolist()}\n"
        "for step in (2e-3, 0.1):\n"
        "    data = rm.sweep(scene, angles, methods=['outside/rk4'], settings={'step': step})\n"
        "    alone = rm.run(scene.replace(**{'initial.angles[1]': 0.1}), 'outside/rk4', step=step)\n"
        "    same = np.array_equal(data.at('angles', 5)[0], alone.angles[5])\n"
        "    print(max(blocks) > 1, sum(blocks), *data.statuses, same)"
    )
    printed = installed.python("-c", code).split("\n")[:2]
    assert printed == ["True 9 ok True", "True 18 inaccurate True"]


def test_stability_takes_it_with_its_label(installed: Installed) -> None:
    installed.command("stability", installed.scene("one"), "-o", "stable.h5", "--report", "stable", "--timeout", "4")
    with h5py.File(installed.folder / "stable.h5") as file:
        assert file["one/outside/rk4"].attrs["status"] == "ok"
    assert "from outside, RK4" in (installed.folder / "stable" / "index.html").read_text()


def test_a_quantity_is_stored_judged_and_drawn_for_every_method(installed: Installed) -> None:
    scene = installed.scene("two", '["angles", "rates", "energy", "momentum"]')
    installed.command(
        "run", scene, "-m", "outside/rk4", "-m", "lagrange/dop853", "-m", "exudyn_tree/rk67", "-o", "two.h5"
    )
    with h5py.File(installed.folder / "two.h5") as file:
        for name in ("outside/rk4", "lagrange/dop853", "exudyn_tree/rk67"):
            stored = file[f"two/{name}/shaft_momentum"]
            assert stored.attrs["units"] == "N m s"
            assert stored.shape == (51,)
            assert 0.0 <= file[f"two/{name}"].attrs["shaft_momentum_error_max"] < 1.0
        # At the start the pitches are at rest: the inertia about the shaft times the rotor's rate, by hand.
        inertia = 5000.0
        for theta in (0.3, -0.2):
            s, c, (x, y, z) = np.sin(theta), np.cos(theta), (0.3, 0.1, 5.2)
            inertia += s * s * 4000.0 + c * c * 4100.0 + 800.0 * (z * z + (c * x - s * y) ** 2)
        assert stored[0] == pytest.approx(0.4 * inertia, rel=1e-12)
    assert "momentum" in installed.command("check", "two.h5", "-v")
    installed.command("report", "two.h5", "-o", "two-pages")
    assert "Angular momentum about the shaft" in (installed.folder / "two-pages" / "two.html").read_text()


def test_a_scene_that_does_not_ask_for_it_has_none(installed: Installed) -> None:
    installed.command("run", installed.scene("one"), "-m", "lagrange/dop853", "-o", "without.h5")
    with h5py.File(installed.folder / "without.h5") as file:
        assert "shaft_momentum" not in file["one/lagrange/dop853"]
