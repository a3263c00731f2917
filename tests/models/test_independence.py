"""Each model runs without the others' engines, says how to get its own, and importing the package
costs little."""

from __future__ import annotations

import subprocess
import sys
from importlib.util import find_spec
from pathlib import Path

import pytest

TESTS = str(Path(__file__).parents[1])
PACKAGES = {"exudyn_tree": "exudyn", "exudyn_chain": "exudyn", "reference": "lagrange"}
RUN = """
from support.scenes import paper
from rotor_mbs.methods.solve import solve
scene = paper("fig08", duration=0.5, samples=11)
run = solve({method!r}, scene, {{}})
assert run.integration.success and len(run.trajectory.time) == 11
assert not [name for name in {others!r} if f"rotor_mbs.models.{{name}}" in sys.modules]
"""


def python(code: str, blocked: tuple[str, ...] = ()) -> subprocess.CompletedProcess[str]:
    """Runs `code` in a process in which these modules cannot be imported."""
    start = (
        f"import sys\nsys.modules.update(dict.fromkeys({blocked!r}))\nsys.path.insert(0, "
        f"{TESTS!r})\n"
    )
    return subprocess.run(
        [sys.executable, "-W", "error", "-c", start + code], capture_output=True, text=True
    )


@pytest.mark.parametrize(
    ("method", "blocked"),
    [
        ("lagrange/dop853", ("exudyn", "heyoka", "mujoco")),
        ("lagrange/taylor", ("exudyn", "scipy", "mujoco", "h5py")),
        pytest.param("reference", ("exudyn", "heyoka", "mujoco"), marks=pytest.mark.full),
        ("exudyn_tree/rk67", ("heyoka", "scipy", "mujoco", "h5py")),
        pytest.param(
            "exudyn_chain/generalized_alpha", ("heyoka", "scipy", "mujoco"), marks=pytest.mark.full
        ),
        ("printed/ode45", ("heyoka", "scipy", "exudyn", "mujoco")),
        ("mujoco/rk4", ("heyoka", "scipy", "exudyn")),
    ],
)
def test_a_model_runs_without_the_other_engines(method: str, blocked: tuple[str, ...]) -> None:
    if method == "lagrange/taylor":
        pytest.importorskip("heyoka")
    if method.startswith("mujoco"):
        pytest.importorskip("mujoco")
    model = method.split("/")[0]
    others = [
        name
        for name in ("printed", "lagrange", "exudyn", "mujoco")
        if name != PACKAGES.get(model, model)
    ]
    done = python(RUN.format(method=method, others=others), blocked)
    assert done.returncode == 0, done.stderr
    assert done.stdout == ""


@pytest.mark.parametrize(
    ("engine", "method", "hint"),
    [
        ("heyoka", "lagrange/taylor", "conda-forge"),
        ("mujoco", "mujoco/rk4", "MuJoCo is not installed: pip install 'rotor_mbs[mujoco]'"),
    ],
)
def test_without_its_engine_a_method_says_how_to_get_it(
    engine: str, method: str, hint: str, tmp_path: Path
) -> None:
    """And belongs to no default set."""
    arguments = ["run", "paper/fig08", "-m", method, "-o", str(tmp_path / "x.h5")]
    done = python(
        "from rotor_mbs.cli import main\nfrom rotor_mbs.methods.catalogue import default_methods, "
        f"find_method\nassert {method!r} not in default_methods() and not "
        f"find_method({method!r}).is_installed\nsys.exit(main({arguments!r}))",
        (engine,),
    )
    assert done.returncode == 2
    assert hint in done.stderr
    assert "Traceback" not in done.stderr
    assert not list(tmp_path.iterdir())


def test_items_of_every_method_are_listed_without_an_engine() -> None:
    done = python("""
from support.scenes import paper
from rotor_mbs.methods.catalogue import methods
assert all(method.items(paper("fig08")) for method in methods() if method.is_installed)
print(sorted(set(sys.modules) & {"exudyn", "heyoka", "mujoco", "scipy"}))
""")
    assert done.stdout.splitlines()[-1] == "[]", done.stderr


@pytest.mark.parametrize("is_imported", [True, False])
@pytest.mark.skipif(find_spec("exudyn") is None, reason="needs Exudyn")
def test_exudyn_leaves_the_backend_of_matplotlib_alone(is_imported: bool) -> None:
    """A script, or a notebook, goes on drawing where it drew before a run."""
    before = "import matplotlib; matplotlib.use('svg')\n" if is_imported else ""
    code = (
        "import rotor_mbs.models.exudyn.adapter\nprint('matplotlib' in sys.modules and "
        "sys.modules['matplotlib'].get_backend())"
    )
    done = python(before + code)
    assert done.stdout.strip() == ("svg" if is_imported else "False"), done.stderr
