"""The cross-check itself: independent models against the quad reference, on every scene of the
paper."""

from __future__ import annotations

import functools
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from support import references
from support.scenes import PAPER_SCENES, paper

from rotor_mbs.analysis.judgement import defects_of, judge
from rotor_mbs.methods.catalogue import find_method
from rotor_mbs.methods.solve import solve
from rotor_mbs.scenario.scene import Scene
from rotor_mbs.solution.metrics import angle_error, horizon_samples, metrics_of, running_growth
from rotor_mbs.solution.trajectory import Solution, Trajectory

BEST = ("lagrange/taylor", "exudyn_tree/rk67", "mujoco/rk4")
# rad up to the horizon, where an error may have grown 1e5-fold, and of the energy scale; MuJoCo's
# at four times its default step, and until its rounding has moved a pitch that stays zero by 1e-4
# rad, which fig. 8 amplifies.
BOUND = {
    "lagrange/taylor": (1e-10, 1e-12),
    "exudyn_tree/rk67": (1e-9, 1e-12),
    "mujoco/rk4": (1e-4, 1e-8),
}
SETTINGS: dict[str, dict[str, float]] = {"mujoco/rk4": {"step": 1e-3}}
# One of each kind: a pendulum, rest, an invariant set, chaos, a driven rotor. The others take
# longer than they add.
_QUICK = ("fig03", "fig05", "fig08", "fig11", "fig12", "fig15-100kNm")
SCENES = [
    name if name in _QUICK else pytest.param(name, marks=pytest.mark.full) for name in PAPER_SCENES
]


def reference(name: str) -> Trajectory:
    return references.reference(f"paper/{name}")


@functools.cache
def run(scene: Scene, method: str) -> Solution:
    if not find_method(method).is_installed:
        pytest.skip(f"{method} is not installed")
    return solve(method, scene, SETTINGS.get(method, {}))


# The chains: settings, the growth of errors up to which they are compared, and rad. The default of
# `extrapolated` has the bound that comparisons of the paper are read by; 2.9e-5 rad was seen on
# fig13b.
ALPHA, EXTRAPOLATED = "exudyn_chain/generalized_alpha", "exudyn_chain/extrapolated"
CHAINS = {
    "second order": (ALPHA, {}, 1e3, 1e-3),
    "default": (EXTRAPOLATED, {}, 1e5, 1e-4),
    "tight": (EXTRAPOLATED, {"tolerance": 1e-10}, 1e5, 1e-6),
}
_QUICK_CHAINS = {
    ("second order", "fig03"),
    ("second order", "fig11"),
    ("default", "fig03"),
    ("default", "fig08"),
}


def cut(name: str, growth: float) -> tuple[Scene, Trajectory]:
    """The scene, and its reference, as far as an error has grown less than `growth`-fold."""
    whole, scene = reference(name), paper(name)
    rows = max(int((running_growth(whole) < growth).sum()), 2)
    parts = {
        part: getattr(whole, part)[:rows]
        for part in ("time", "angles", "rates", "tip", "error_growth")
    }
    return replace(scene, duration=float(whole.time[rows - 1]), samples=rows), Trajectory(**parts)


@pytest.mark.parametrize("method", BEST)
@pytest.mark.parametrize("name", SCENES)
def test_up_to_the_horizon(name: str, method: str) -> None:
    """Energy, too, by the fine steps over the whole run; 5e-14 is the worst that was seen."""
    solution, (angle, energy) = run(paper(name), method), BOUND[method]
    assert len(solution.time) == paper(name).samples
    defects = defects_of(paper(name), solution.trajectory)
    metrics = metrics_of(paper(name), solution.trajectory, reference(name), defects)
    rows = horizon_samples(reference(name)) if method in SETTINGS else None
    if method in SETTINGS:
        errors = angle_error(solution.trajectory, reference(name))[:rows]
        stay_zero = np.abs(reference(name).angles).max(axis=0) == 0.0
        moved = np.abs(solution.angles[:rows][:, stay_zero]).max(axis=1, initial=0.0)
        assert errors[moved <= 1e-4].max() <= angle
    else:
        assert metrics["angle_error_max"] <= angle
    assert np.abs(solution.energy_error[:rows]).max() <= energy * metrics["energy_scale_J"]


def _mark_of(case: str, name: str) -> Any:
    """The default is what results are read by; the others repeat in every scene what a few show."""
    if (case, name) in _QUICK_CHAINS:
        return ()
    return pytest.mark.full if case == "default" or name in _QUICK else pytest.mark.nightly


@pytest.mark.parametrize(
    ("case", "name"),
    [
        pytest.param(case, name, marks=_mark_of(case, name))
        for case in CHAINS
        for name in PAPER_SCENES
    ],
)
def test_the_chain_while_errors_grow_little(case: str, name: str) -> None:
    method, settings, growth, bound = CHAINS[case]
    scene, exact = cut(name, growth)
    assert angle_error(solve(method, scene, settings).trajectory, exact).max() <= bound


@pytest.mark.parametrize(
    "name",
    [
        "fig03",
        "fig08",
        *(
            pytest.param(name, marks=pytest.mark.full)
            for name in ("fig05", "fig06", "fig15-100kNm")
        ),
    ],
)
@pytest.mark.parametrize("method", BEST[:2])
def test_blades_that_start_at_zero_pitch_stay_there(name: str, method: str) -> None:
    """An invariant set, unstable: one rounding error off it would be 1e30 away by the end."""
    scene = paper(name)
    zero = [i for i, angle in enumerate(scene.initial_angles) if i and angle == 0.0]
    assert not run(scene, method).trajectory.angles[:, zero].any()
    metrics = judge(scene, run(scene, method), reference(name)).metrics
    assert metrics["zero_pitch_max"] == 0.0
    assert "zero_pitch_left_s" not in metrics
