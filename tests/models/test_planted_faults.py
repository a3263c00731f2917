"""A wrong number in an engine's model is seen by the interval defects wherever the motion exercises it, to the end."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from support.defect_tables import signatures
from support.references import reference

from rotor_mbs.analysis.judgement import FLOOR_SAFETY
from rotor_mbs.methods.catalogue import find_method
from rotor_mbs.methods.solve import solve
from rotor_mbs.models.lagrange.defects import interval_defects
from rotor_mbs.scenario.accuracy_bounds import shipped_bounds
from rotor_mbs.scenario.catalogue import find_scenes
from rotor_mbs.scenario.scene import Scene
from rotor_mbs.solution.metrics import horizon

SCENES = find_scenes(["paper"])
# Of each engine: a relative fault, and the rows of a stretch near the end that is run with it.
ENGINES = {"exudyn_tree/rk67": 1e-6, "mujoco/rk4": 1e-4, "exudyn_chain/extrapolated": 1e-2}
ROWS = 40
QUICK = {"paper/fig08", "paper/fig11"}


def wrong(scene: Scene, fault: str, share: float) -> Scene:
    factor = 1.0 + share
    if fault == "gravity":
        return replace(scene, gravity=scene.gravity * factor)
    if fault == "torque":
        return replace(scene, rotor_torque=tuple((t, value * factor) for t, value in scene.rotor_torque))
    x = tuple(replace(b, centre_of_mass=(b.centre_of_mass[0] * factor, *b.centre_of_mass[1:])) for b in scene.blades)
    return replace(scene, blades=x)


@pytest.mark.parametrize("fault", ["c", "gravity", "torque"])
@pytest.mark.parametrize("method", ENGINES)
@pytest.mark.parametrize(
    "scene", [pytest.param(s, id=s.name, marks=() if s.name in QUICK else pytest.mark.full) for s in SCENES]
)
def test_a_fault_near_the_end_is_seen_where_the_motion_exercises_it(scene: Scene, method: str, fault: str) -> None:
    """Far beyond the old horizons of a second: from the reference's state 0.5 s before the end."""
    if not find_method(method).is_installed:
        pytest.skip(f"{method} is not installed")
    whole, share = reference(scene.name), ENGINES[method]
    first = scene.samples - 51
    interval = scene.duration / (scene.samples - 1)
    part = replace(
        scene, duration=ROWS * interval, samples=ROWS + 1, outputs=("angles", "rates"),
        initial_angles=tuple(whole.angles[first].tolist()), initial_rates=tuple(whole.rates[first].tolist()),
    )  # fmt: skip
    run = solve(method, wrong(part, fault, share), {}).trajectory
    defects = interval_defects(part, run.time, run.angles, run.rates)
    bounds = shipped_bounds().for_scene(scene.name)
    largest, of_median = bounds.of("defect", method).value, bounds.find("defect median", method)
    median = np.inf if of_median is None else of_median.value
    sizes = share * signatures(part, run)[fault]
    slack = FLOOR_SAFETY * float(defects.floor.max())
    exercised = sizes.max() > 2.0 * (largest + slack) or float(np.median(sizes)) > 2.0 * median
    seen = defects.sizes.max() > largest + slack or float(np.median(defects.sizes)) > median
    right = solve(method, part, {}).trajectory
    without = interval_defects(part, right.time, right.angles, right.rates)
    assert without.sizes.max() <= largest + slack  # the engine itself passes there
    assert seen or not exercised
    if scene.name in QUICK and fault == "gravity":
        assert exercised


def test_four_fifths_of_the_simulated_time_lie_before_the_horizons() -> None:
    """By the error growth of what can happen; of all growths alone it would be 38 %."""
    before = sum(horizon(reference(scene.name)) for scene in SCENES)
    assert before >= 0.8 * sum(scene.duration for scene in SCENES)


def test_every_interval_of_the_paper_is_judged() -> None:
    for scene in SCENES:
        exact = reference(scene.name)
        assert len(exact.time) == scene.samples
        assert interval_defects(scene, exact.time, exact.angles, exact.rates).is_judged.all()
