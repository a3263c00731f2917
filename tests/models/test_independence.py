"""Each model runs without the others' engines, the report without any, and importing the package costs little."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

import pytest

PREAMBLE = """
import sys
for name in {blocked!r}:
    sys.modules[name] = None
sys.path.insert(0, {tests!r})
from support.scenes import paper
from rotor_mbs.methods.solve import solve
from rotor_mbs.methods.catalogue import find_method
scene = paper("fig08", duration=0.5, samples=11)
run = solve({method!r}, scene, {{}})
assert run.integration.success and len(run.trajectory.time) == 11
assert not any(name.split(".")[0] in {blocked!r} and sys.modules[name] for name in sys.modules)
{more}
"""


def python(code: str) -> subprocess.CompletedProcess[str]:
    return subprocess.run([sys.executable, "-W", "error", "-c", code], capture_output=True, text=True)


@pytest.mark.parametrize(
    ("method", "blocked"),
    [
        ("lagrange/dop853", ["exudyn", "heyoka", "mujoco"]),
        ("lagrange/taylor", ["exudyn", "scipy", "mujoco"]),
        ("reference", ["exudyn", "heyoka", "mujoco"]),
        ("exudyn_tree/rk67", ["heyoka", "scipy", "mujoco"]),
        ("exudyn_chain/generalized_alpha", ["heyoka", "scipy", "mujoco"]),
        ("printed/ode45", ["heyoka", "scipy", "exudyn", "mujoco"]),
        ("mujoco/rk4", ["heyoka", "scipy", "exudyn"]),
    ],
)
def test_a_model_runs_without_the_other_engines(
    method: str, blocked: list[str], request: pytest.FixtureRequest
) -> None:
    if method == "lagrange/taylor":
        pytest.importorskip("heyoka")
    if method.startswith("mujoco"):
        pytest.importorskip("mujoco")
    others = [m for m in ("printed", "lagrange", "exudyn", "mujoco") if m != _package(method)]
    more = "\n".join(f"assert 'rotor_mbs.models.{other}' not in sys.modules" for other in others)
    tests = str(request.path.parents[1])
    done = python(PREAMBLE.format(blocked=blocked, tests=tests, method=method, more=more))
    assert done.returncode == 0, done.stderr


def _package(method: str) -> str:
    model = method.split("/")[0]
    return {"exudyn_tree": "exudyn", "exudyn_chain": "exudyn", "reference": "lagrange"}.get(model, model)


def test_taylor_without_heyoka_says_how_to_get_it(tmp_path: Path) -> None:
    code = (
        "import sys; sys.modules['heyoka'] = None\n"
        "from rotor_mbs.cli import main\n"
        "sys.exit(main(['run', 'paper/fig08', '-m', 'lagrange/taylor', '-o', {out!r}]))"
    )
    done = python(code.format(out=str(tmp_path / "x.h5")))
    assert done.returncode == 2
    assert "conda-forge" in done.stderr
    assert "Traceback" not in done.stderr


def test_importing_the_package_loads_nothing_heavy() -> None:
    code = "import sys, rotor_mbs; print(sorted(set(sys.modules) & {'numpy', 'scipy', 'h5py', 'pydantic', 'exudyn'}))"
    assert python(code).stdout.strip() == "[]"


def test_listing_loads_no_engine_no_files_and_no_schemas() -> None:
    code = (
        "import sys; from rotor_mbs.cli import main; main(['list'])\n"
        "print(sorted(set(sys.modules) & {'scipy', 'h5py', 'pydantic', 'exudyn', 'heyoka', 'mujoco', 'matplotlib'}))"
    )
    assert python(code).stdout.splitlines()[-1] == "[]"
