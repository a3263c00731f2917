"""A wrong number in an engine's model is seen by the interval defects wherever the motion exercises
it, to the end."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from support.checking import with_wrong_number
from support.references import reference

from rotor_mbs.methods.catalogue import find_method
from rotor_mbs.methods.solve import solve
from rotor_mbs.models.lagrange import closed_form
from rotor_mbs.models.lagrange.defects import interval_defects
from rotor_mbs.models.lagrange.parameters import rate_units, rotor_form
from rotor_mbs.models.lagrange.samples import loads_at
from rotor_mbs.scenario.accuracy_bounds import shipped_bounds
from rotor_mbs.scenario.catalogue import find_scenes
from rotor_mbs.scenario.scene import Scene
from rotor_mbs.solution.defects import FLOOR_SAFETY
from rotor_mbs.solution.metrics import horizon
from rotor_mbs.solution.trajectory import Array, Trajectory

SCENES = {scene.name.removeprefix("paper/"): scene for scene in find_scenes(["paper"])}
ENGINES = ("exudyn_tree/rk67", "mujoco/rk4", "exudyn_chain/extrapolated")
ROWS = 40  # of a stretch near the end, which is run with the fault
# A fault is planted four times as large as its signature, which no engine has computed, says that
# the bounds see it; up to 100 % of a number, and 400 % of a torque.
MARGIN = 4.0
SMALL = 1e-7  # relative: far above rounding, and the defects are linear in it
LARGEST_SHARE = {"c": 1.0, "gravity": 1.0, "torque": 4.0}

# In so many of the scenes at least a fault can be seen by the method's bounds. In figs. 5 and 6 the
# rotor stands or swings by so little that nothing is, and a horizontal rotor has no weight to turn
# it.
SEEN_IN = {"c": 9, "gravity": 10, "torque": 4}


def with_wrong_torque(scene: Scene, share: float) -> Scene:
    return replace(
        scene, rotor_torque=tuple((t, torque * (1.0 + share)) for t, torque in scene.rotor_torque)
    )


WRONG = {
    "c": lambda scene, share: with_wrong_number(scene, "offset", share),
    "gravity": lambda scene, share: with_wrong_number(scene, "gravity", share),
    "torque": with_wrong_torque,
}


def near_the_end(scene: Scene) -> tuple[Scene, Trajectory]:
    """The reference's motion from 0.5 s before the end, far beyond the old horizons of a second, as
    a scene."""
    whole, first = reference(scene.name), scene.samples - 51
    rows = slice(first, first + ROWS + 1)
    motion = Trajectory(whole.time[rows] - whole.time[first], whole.angles[rows], whole.rates[rows])
    part = replace(
        scene,
        duration=float(motion.time[-1]),
        samples=ROWS + 1,
        outputs=("angles", "rates"),
        initial_angles=tuple(motion.angles[0].tolist()),
        initial_rates=tuple(motion.rates[0].tolist()),
    )
    return part, motion


def limits(name: str, method: str) -> tuple[float, float]:
    """rad: the method's bounds on the largest defect and on the median."""
    bounds = replace(shipped_bounds(), scene=f"paper/{name}")
    of_median = bounds.find("defect median", method)
    return bounds.of("defect", method).value, np.inf if of_median is None else of_median.value


def signatures(scene: Scene, motion: Trajectory) -> dict[str, Array]:
    """(n,) rad for each fault: size of each interval's defect for a relative fault of 1.

    To first order in the interval h: a wrong acceleration Δa is a defect of h Δa in the rates.
    """
    moving = scene.moving_coordinates
    angles, rates = motion.angles[:, moving].T, motion.rates[:, moving].T
    interval = scene.duration / (scene.samples - 1)
    units = np.maximum(rate_units(scene), 1.0 / interval)[:, None]

    def accelerations(scene: Scene) -> Array:
        form, loads = rotor_form(scene), loads_at(scene, motion.time)
        rows = closed_form.accelerations(list(angles), list(rates), form, loads, np.sin, np.cos)
        return np.array([np.broadcast_to(row, angles[0].shape) for row in rows])

    differences = {
        name: accelerations(wrong(scene, SMALL)) - accelerations(scene)
        for name, wrong in WRONG.items()
    }
    return {
        name: np.abs(each * interval / units).max(axis=0) / SMALL
        for name, each in differences.items()
    }


def smallest_share(name: str, method: str, fault: str) -> float:
    """The relative fault that one of the bounds would see, by its signature; inf where the motion
    has none of it."""
    sizes = signatures(*near_the_end(SCENES[name]))[fault]
    with np.errstate(divide="ignore"):
        return float(np.min(np.array(limits(name, method)) / [sizes.max(), np.median(sizes)]))


@pytest.mark.parametrize("fault", SEEN_IN)
@pytest.mark.parametrize(
    "method",
    [
        pytest.param(name, marks=pytest.mark.full) if "extrapolated" in name else name
        for name in ENGINES
    ],
)
def test_a_fault_near_the_end_is_seen_where_the_motion_exercises_it(
    method: str, fault: str
) -> None:
    if not find_method(method).is_installed:
        pytest.skip(f"{method} is not installed")
    shares = {name: MARGIN * smallest_share(name, method, fault) for name in SCENES}
    exercised = {name: share for name, share in shares.items() if share <= LARGEST_SHARE[fault]}
    assert len(exercised) >= SEEN_IN[fault]
    for name, share in exercised.items():
        part, _ = near_the_end(SCENES[name])
        assert is_within_bounds(part, part, method)  # the engine itself passes there
        assert not is_within_bounds(part, WRONG[fault](part, share), method), name


def is_within_bounds(part: Scene, computed: Scene, method: str) -> bool:
    """Whether the run of `computed` passes as one of `part` by its defects."""
    largest, of_median = limits(part.name.removeprefix("paper/"), method)
    run = solve(method, computed, {}).trajectory
    defects = interval_defects(part, run.time, run.angles, run.rates)
    slack = FLOOR_SAFETY * float(defects.floor.max())
    return bool(defects.sizes.max() <= largest + slack and np.median(defects.sizes) <= of_median)


def test_four_fifths_of_the_simulated_time_lie_before_the_horizons() -> None:
    """By the error growth of what can happen; of all growths alone it would be 38 %."""
    before = sum(horizon(reference(scene.name)) for scene in SCENES.values())
    assert before >= 0.8 * sum(scene.duration for scene in SCENES.values())


def test_every_interval_of_the_paper_is_judged() -> None:
    for scene in SCENES.values():
        exact = reference(scene.name)
        assert len(exact.time) == scene.samples
        assert interval_defects(scene, exact.time, exact.angles, exact.rates).is_judged.all()
