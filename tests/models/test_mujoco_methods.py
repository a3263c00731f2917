"""The MuJoCo methods from the outside: settings, a run through the command line, and an installation without MuJoCo."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from support import references
from support.scenes import paper

from rotor_mbs.errors import InputError
from rotor_mbs.methods.catalogue import find_method
from rotor_mbs.methods.solve import solve
from rotor_mbs.runs.read import open_results
from rotor_mbs.solution.judgement import judge

METHODS = ("mujoco/rk4", "mujoco/implicitfast")


def without_mujoco(code: str) -> subprocess.CompletedProcess[str]:
    """Runs `code` in a process in which MuJoCo cannot be imported."""
    blocked = "import sys; sys.modules['mujoco'] = None\nfrom rotor_mbs.cli import main\n"
    return subprocess.run([sys.executable, "-W", "error", "-c", blocked + code], capture_output=True, text=True)


@pytest.mark.parametrize("method", METHODS)
def test_its_runs_are_within_their_bounds(method: str) -> None:
    pytest.importorskip("mujoco")
    for name in ("check/general", "check/held", "check/point-masses"):
        scene = references.scene(name)
        assert judge(scene, solve(method, scene, {}), references.reference(name)).status == "ok"


@pytest.mark.parametrize("method", METHODS)
def test_an_impossible_step_is_refused(method: str) -> None:
    pytest.importorskip("mujoco")
    for step in (0.0, -1e-3, float("nan"), "fast"):
        with pytest.raises(InputError, match="step"):
            solve(method, paper("fig03"), {"step": step})
    with pytest.raises(InputError, match="steps"):
        find_method(method).build(paper("fig03"), find_method(method).settings(step=1e-12))


def test_a_run_from_the_command_line_is_stored_judged_and_drawn(tmp_path: Path) -> None:
    pytest.importorskip("mujoco")
    from rotor_mbs.cli import main

    path = tmp_path / "r.h5"
    assert main(["run", "check/held", "-m", "mujoco/rk4", "-o", str(path)]) == 0
    with open_results(path) as results:
        run = results.scenes["check/held"].methods["mujoco/rk4"]
        assert run.attributes["status"] == "ok"
        assert np.isfinite(run.array("kinetic_energy")).all()
        assert run.array("tip").shape == (references.scene("check/held").samples, 4, 3)
    assert main(["check", str(path), "--require", "mujoco/rk4"]) == 0
    assert main(["report", str(path), "-o", str(tmp_path / "report")]) == 0
    (page,) = (tmp_path / "report").rglob("*held*.html")
    assert "MuJoCo, RK4" in page.read_text(encoding="utf-8")


def test_without_mujoco_it_says_how_to_get_it(tmp_path: Path) -> None:
    output = str(tmp_path / "x.h5")
    done = without_mujoco(f"sys.exit(main(['run', 'paper/fig08', '-m', 'mujoco/rk4', '-o', {output!r}]))")
    assert done.returncode == 2
    assert "MuJoCo is not installed: pip install 'rotor_mbs[mujoco]'" in done.stderr
    assert "Traceback" not in done.stderr
    assert not Path(output).exists()


def test_without_mujoco_the_other_methods_are_as_before() -> None:
    code = """
from rotor_mbs.methods.catalogue import default_methods, find_method
from rotor_mbs.studies.check import default_set
assert not any(name.startswith("mujoco") for names in default_set()[1].values() for name in names)
assert not any(name.startswith("mujoco") for name in default_methods())
assert not find_method("mujoco/rk4").is_installed and find_method("mujoco/rk4").label == "MuJoCo, RK4"
sys.exit(main(["show", "paper/fig03"]))
"""
    done = without_mujoco(code)
    assert done.returncode == 0, done.stderr
    assert "cannot represent this scene: MuJoCo is not installed" in done.stdout


def test_nothing_of_mujoco_is_imported_before_a_system_is_built() -> None:
    code = """
import sys
from rotor_mbs.methods.catalogue import methods
from rotor_mbs.scenario.catalogue import find_scenes
scene = find_scenes(["paper/fig08"])[0]
assert all(method.items(scene) for method in methods() if method.model == "mujoco" and method.is_installed)
assert "mujoco" not in sys.modules
"""
    done = subprocess.run([sys.executable, "-W", "error", "-c", code], capture_output=True, text=True)
    assert done.returncode == 0, done.stderr
