"""The work is a variable in units of the scene's energy: it sets the accuracy of no other
number."""

from __future__ import annotations

import numpy as np
import pytest
from support.scenes import shipped

from rotor_mbs.analysis.judgement import defects_of
from rotor_mbs.methods.solve import solve
from rotor_mbs.solution.metrics import energy_scale

# A turbine's rotor on damped bearings, with a step of its torque; in J its work is some 1e7 times
# an angle.
STIFF = shipped("stiff/nrel-5mw-damped").replace(
    **{
        "outputs": ["angles", "rates", "energy"],
        "duration": 10.0,
        "samples": 101,
        "blade.centre_of_mass": [0.1, 0.0, 20.475],
        "initial.angles": [0.0, "deg(5)", "deg(5)", "deg(5)"],
        "torque.rotor": [[0.0, 0.0], [2.0, 0.0], [2.0, 4.18e6]],
        "bearing.stiffness": 1e8,
        "bearing.rest": "deg(5)",
    }
)


@pytest.mark.parametrize("damping", [1e5, pytest.param(1e6, marks=pytest.mark.full)])
def test_a_run_with_energies_has_the_defects_of_one_without(damping: float) -> None:
    """Round-off. With the work in J the engine accepts steps with errors of 5e-13 rad."""
    pytest.importorskip("heyoka")
    scene = STIFF.replace(**{"bearing.damping": damping})
    run = solve("lagrange/taylor", scene, {})
    assert scene.work_needs_path
    defects = defects_of(scene, run.trajectory)
    assert defects is not None
    assert defects.excess.max() == 0.0
    energy = run["energy_error"]
    assert np.abs(energy).max() <= 1e-14 * energy_scale(scene, run.trajectory)


def test_the_work_is_that_of_another_integrator() -> None:
    """In J: to dop853's tolerance, of a rotor with dampers under loads that change."""
    pytest.importorskip("heyoka")
    scene = shipped("check/general")
    first, second = (solve(f"lagrange/{name}", scene, {}) for name in ("taylor", "dop853"))
    scale = energy_scale(scene, first.trajectory)
    np.testing.assert_allclose(first["work"], second["work"], rtol=0, atol=1e-11 * scale)
