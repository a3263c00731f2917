"""Changes to the program that an audit made, and which check or which test notices each.

Each is a process of its own, into which the package is imported with one text of a module changed.
"""

from __future__ import annotations

import os
import re
import subprocess
import sys
from pathlib import Path

import pytest

pytestmark = pytest.mark.full

ROOT = Path(__file__).parents[2]
SCHEMES, TAYLOR = "rotor_mbs.models.exudyn.schemes", "rotor_mbs.models.lagrange.methods"
CHAIN = "rotor_mbs.models.exudyn.methods"
ODE45, READ = "rotor_mbs.models.ode45", "rotor_mbs.runs.read"
DEFAULTS = "tests/analysis/test_run_integrity.py::test_defaults_are_the_settings_that_the_bounds_were_found_with"
ANEW = "tests/studies/test_check.py::test_a_reference_computed_now_is_the_frozen_one[check/general]"

# name: (module, text, its replacement, methods whose runs of the scenes made for checking are checked, or a test,
# pattern of what must fail)
MUTANTS = {
    "rk44 step doubled": (SCHEMES, "step: float = step(2.5e-4)", "step: float = step(5e-4)", DEFAULTS, "rk44"),
    "rk67 step doubled": (SCHEMES, "step(6.7e-4)", "step(1.34e-3)", DEFAULTS, "rk67"),
    "chain step doubled": (CHAIN, "step: float = step(5e-4)", "step: float = step(1e-3)", DEFAULTS, "exudyn_chain"),
    "dopri5 tolerance x 100": (SCHEMES, "number(1e-11, above", "number(1e-9, above", DEFAULTS, "dopri5"),
    "Taylor tolerance 1e-13": (TAYLOR, "number(_EPS, above", "number(1e-13, above", DEFAULTS, "taylor"),
    "chain spectral radius 0.6": (SCHEMES, "number(0.9, at_least", "number(0.6, at_least", DEFAULTS, "alpha"),
    "quad tolerance 1e-20": (TAYLOR, "number(1e-33", "number(1e-20", DEFAULTS, "reference"),
    "rk44 step doubled in the scheme": (
        SCHEMES, 'Scheme("RK44", 4, _EXPLICIT, self.step)', 'Scheme("RK44", 4, _EXPLICIT, 2 * self.step)',
        "exudyn_tree/rk44", "steps .*rk44",
    ),
    "rk67 step doubled in the scheme": (
        SCHEMES, 'Scheme("RK67", 7, _EXPLICIT, self.step)', 'Scheme("RK67", 7, _EXPLICIT, 2 * self.step)',
        "exudyn_tree/rk67", "steps .*rk67",
    ),
    "chain step doubled in the scheme": (
        SCHEMES, 'Scheme("GeneralizedAlpha", 0, {**newton, **options}, self.step)',
        'Scheme("GeneralizedAlpha", 0, {**newton, **options}, 2 * self.step)',
        "exudyn_chain/generalized_alpha", "steps .*exudyn_chain",
    ),
    "dopri5 tolerance x 100 in the scheme": (
        SCHEMES, '"absoluteTolerance": self.absolute_tolerance', '"absoluteTolerance": 100 * self.absolute_tolerance',
        "exudyn_tree/dopri5", "(steps|agreement) .*dopri5",
    ),
    "Taylor tolerance 1e-13 in the integrator": (
        TAYLOR, "tol=settings.tolerance, compact_mode", "tol=1e-13, compact_mode",
        "tests/models/test_segments.py", "test_the_order_of_taylors_series",
    ),
    "ode45's second failure quartered": (
        ODE45, "return 0.5 * h if failed_before", "return 0.25 * h if failed_before",
        "tests/models/test_ode45.py", "test_steps_after_failures",
    ),
    "ode45's interpolant off by 1e-3": (
        ODE45, "for row in INTERPOLANT])", "for row in INTERPOLANT]) * 1.001", "lagrange/ode45", "agreement .*ode45",
    ),
    "reader swap": (
        READ, "stored.place(run)", "stored.place(run.replace('exudyn_tree/rk67', 'lagrange/dop853'))",
        "exudyn_tree/rk67 lagrange/dop853", "copied .*",
    ),
    "reference uncertainty x 1e20": (
        "rotor_mbs.models.lagrange.reference", "result.angle_uncertainty = ", "result.angle_uncertainty = 1e20 * ",
        ANEW, "uncertainty",
    ),
}  # fmt: skip

_SCRIPT = """
import sys, tempfile
from pathlib import Path
root, module, asked = sys.argv[1:4]
sys.path[:0] = [root, root + "/tests"]
from support.mutation import Mutant, _Finder, _source
changed = _source(module).replace(sys.argv[4], sys.argv[5])
sys.meta_path.insert(0, _Finder(Mutant("", module, "", "", lambda: changed)))
if asked.startswith("tests/"):
    import pytest
    raise SystemExit(pytest.main(["-q", "-p", "no:cacheprovider", f"{root}/{asked}"]))
from support.checking import failed, judged, results_file
with tempfile.TemporaryDirectory() as folder:
    for check in failed(judged(results_file(Path(folder) / "m.h5", ["check/held", "check/general"], asked.split()))):
        print(check.name, *check.where)
"""


def _asked(name: str, *, changed: bool = True) -> str:
    module, text, replacement, asked, _ = MUTANTS[name]
    assert text in (ROOT / f"{module.replace('.', '/')}.py").read_text(), "the text to be changed is not there"
    done = subprocess.run(
        [sys.executable, "-c", _SCRIPT, str(ROOT), module, asked, text, replacement if changed else text],
        capture_output=True, text=True, timeout=300, env={**os.environ, "PYTHONPATH": str(ROOT)},
    )  # fmt: skip
    assert done.returncode in (0, 1), done.stderr
    return done.stdout


@pytest.mark.parametrize("name", MUTANTS)
def test_an_outside_mutant_is_noticed(name: str) -> None:
    if MUTANTS[name][3] == ANEW or name.endswith("in the integrator"):
        pytest.importorskip("heyoka")
    assert re.search(MUTANTS[name][4], _asked(name)), name


def test_without_the_change_nothing_is_noticed() -> None:
    assert _asked("reader swap", changed=False) == ""
