"""The checks have teeth: a fault put into the closed form must fail the judgement, each on its own.

A fault is put in by rewriting the text of the one function that all methods use, so that what is judged is the product
itself. One fault at a time, on scenes where it can show.
"""

from __future__ import annotations

import inspect
from dataclasses import replace

import pytest
from support.references import reference
from support.scenes import paper

from rotor_mbs.methods.solve import solve
from rotor_mbs.models.lagrange import closed_form
from rotor_mbs.scenario.scene import Scene
from rotor_mbs.analysis.judgement import Judgement, judge

FAULTS = {
    "Coriolis term dropped": ("2.0 * (spin * rate) + ", ""),
    "centrifugal term dropped": (" - blade.coupling_s * (rate * rate)", ""),
    "wrong sign of the spin's moment on a pitch": ("on_s = blade.half_slope_sc", "on_s = -blade.half_slope_sc"),
    "gravity on the pitch dropped": (" - blade.weight_x * sin_phi", ""),
    "coupling's sign turned": ("on_s - blade.coupling_s * rotor", "on_s + blade.coupling_s * rotor"),
    # E1 of the paper: c² m c3² more in the rotor's own inertia.
    "E1 in the mass matrix": ("schur = schur + (", "schur = schur + (blade.pitch_inertia * (c * c) + "),
}


def judged(scene: Scene, name: str = "fig09", method: str = "lagrange/dop853") -> Judgement:
    """A short piece of a scene of the paper, where a double still has all its digits, against the frozen reference."""
    exact = reference(f"paper/{name}")
    rows = 151
    parts = {part: getattr(exact, part)[:rows] for part in ("time", "angles", "rates", "tip", "error_growth")}
    short = replace(scene, duration=float(exact.time[rows - 1]), samples=rows)
    return judge(short, solve(method, short, {}), type(exact)(**parts))


def test_without_a_fault_all_is_well() -> None:
    assert judged(paper("fig09")).status == "ok"
    assert judged(paper("fig12"), "fig12").status == "ok"


@pytest.mark.parametrize("fault", FAULTS)
def test_a_fault_in_the_equations_is_caught(fault: str, monkeypatch: pytest.MonkeyPatch) -> None:
    right, wrong = FAULTS[fault]
    text = inspect.getsource(closed_form.accelerations)
    assert text.count(right) == 1
    changed: dict[str, object] = {}
    exec(compile(text.replace(right, wrong), fault, "exec"), vars(closed_form), changed)
    monkeypatch.setattr(closed_form, "accelerations", changed["accelerations"])
    assert judged(paper("fig12"), "fig12").status == "inaccurate"


@pytest.mark.parametrize(
    ("method", "share"),
    [("lagrange/dop853", 1e-6), ("exudyn_tree/rk67", 1e-6), ("exudyn_chain/generalized_alpha", 0.01)],
)
def test_a_wrong_offset_is_caught(method: str, share: float) -> None:
    """In its seventh digit by the fine models; by the chain, whose step leaves an error of its own, in its third."""
    scene = paper("fig09")
    x, y, z = scene.blades[0].centre_of_mass
    wrong = tuple(replace(blade, centre_of_mass=(x * (1 + share), y, z)) for blade in scene.blades)
    assert judged(replace(scene, blades=wrong), method=method).status == "inaccurate"


def test_a_missing_sample_and_a_claim_of_success_are_caught() -> None:
    scene = paper("fig09", duration=1.5, samples=151)
    run = solve("lagrange/dop853", scene, {})
    for part in ("time", "angles", "rates", "tip", "kinetic_energy", "potential_energy", "work"):
        setattr(run.trajectory, part, getattr(run.trajectory, part)[:-1])
    verdict = judge(scene, run, None)
    assert verdict.status == "diverged"
    assert verdict.false_success
