"""Data of a rotor with tilt and cone, by Newton's and Euler's laws: right ones are ok, each mistake
is named."""

from __future__ import annotations

import functools
import math
from collections.abc import Callable
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from scipy.integrate import solve_ivp
from support.newton_euler import State, measure, turn
from support.scenes import general

import rotor_mbs as rm
from rotor_mbs.comparison.wrong_outputs import wrong_loads, wrong_tip
from rotor_mbs.models.lagrange.samples import sampled_loads
from rotor_mbs.scenario.scene import Scene
from rotor_mbs.solution.trajectory import Trajectory

Array = Any
COUNT = 4
# Three unlike blades on springs; tilt and cone of an upwind turbine.
SCENE = general(
    duration=0.6, samples=61, shaft_tilt=math.radians(-5.0), hub_radius=0.4, hub_mass=200.0,
    outputs=("angles", "rates", "loads"),
)  # fmt: skip
SCENE = replace(
    SCENE, blades=tuple(replace(blade, cone=math.radians(-3.0)) for blade in SCENE.blades)
)


@functools.cache
def motion(scene: Scene) -> dict[str, Array]:
    """Return time, angles and rates of the scene by SciPy from Newton's and Euler's laws."""
    times = np.linspace(0.0, scene.duration, scene.samples)

    def derivative(t: float, y: Array) -> Array:
        return np.concatenate([y[COUNT:], measure(scene, y[:COUNT], y[COUNT:], t).accelerations])

    start = np.array([*scene.initial_angles, *scene.initial_rates])
    run = solve_ivp(
        derivative, (0.0, scene.duration), start, "DOP853", times, rtol=1e-11, atol=1e-12
    )
    return {"time": times, "angles": run.y[:COUNT].T, "rates": run.y[COUNT:].T}


@functools.cache
def states() -> list[State]:
    run = motion(SCENE)
    return [measure(SCENE, *state) for state in zip(run["angles"], run["rates"], strict=True)]


def stored(load: str) -> Array:
    return np.array([state.loads[load] for state in states()])


def in_frame(load: str, frame: str) -> Array:
    """Return a load of the scene in another frame: the blades' axes, turned back one rotation after
    the other."""
    rows = []
    for angles, state in zip(motion(SCENE)["angles"], states(), strict=True):
        shaft = turn(0, SCENE.shaft_tilt)
        if load.startswith("shaft"):
            to_frame = {"shaft": shaft, "rotor": shaft @ turn(1, angles[0])}[frame]
            rows.append(to_frame.T @ state.loads[load])
            continue
        blades = []
        for i, vector in enumerate(state.loads[load]):
            rotor = shaft @ turn(1, angles[0] + 2.0 * math.pi * i / 3.0)
            coned = rotor @ turn(0, -SCENE.blades[i].cone)
            to_frame = {"coned": coned, "rotor": rotor, "shaft": shaft, "base": np.eye(3)}[frame]
            blades.append(to_frame.T @ state.axes[i] @ vector)
        rows.append(blades)
    return np.array(rows)


LOADS = (
    "blade_root_force",
    "blade_root_moment",
    "shaft_force",
    "shaft_moment",
    "pitch_actuator_moment",
)


@pytest.mark.full
def test_right_data_are_ok_with_loads_in_every_frame() -> None:
    data = motion(SCENE) | {load: stored(load) for load in LOADS}
    found = rm.compare(data, SCENE, tolerance=1e-9)
    assert (found.status, found.likely) == ("ok", ())
    names = {
        "time": "time",
        "rotor": "angles[0]",
        **{f"pitch_{i}": f"angles[{i}]" for i in (1, 2, 3)},
    }
    columns: dict[str, Array] = {}
    mapping: dict[str, Any] = {}
    for frame, load, index in [
        ("coned", "blade_root_force", (2, 1)),
        ("rotor", "blade_root_moment", (2, 0)),
        ("shaft", "blade_root_force", (1, 2)),
        ("base", "blade_root_moment", (1, 1)),
        ("shaft", "shaft_force", (1,)),
        ("rotor", "shaft_moment", (2,)),
    ]:
        column = f"c{len(columns)}"
        columns[column] = in_frame(load, frame)[
            (slice(None), *((index[0] - 1,) if len(index) > 1 else ()), index[-1])
        ]
        blade = f"_{index[0]}" if len(index) > 1 else ""
        mapping[f"{load}{blade}_{'xyz'[index[-1]]}"] = {"column": column, "frame": frame}
    found = rm.compare(motion(SCENE) | columns, SCENE, columns=names | mapping, tolerance=1e-9)
    assert found.status == "ok", found.message
    compared = [channel.name for channel in found.verdict.channels]
    assert len([name for name in compared if name.endswith("frame")]) == len(columns)


MOTIONS: dict[str, tuple[Callable[[Scene], Scene], str]] = {
    "no tilt": (lambda scene: replace(scene, shaft_tilt=0.0), "without the tilt of the shaft"),
    "tilt": (
        lambda scene: replace(scene, shaft_tilt=-scene.shaft_tilt),
        "tilt of the shaft with opposite sign",
    ),
    "no cone": (lambda scene: with_cone(scene, 0.0), "without the cone of the blades"),
    "neither": (
        lambda scene: with_cone(replace(scene, shaft_tilt=0.0), 0.0),
        "without the tilt of the shaft and the cone of the blades",
    ),
    "cone": (
        lambda scene: with_cone(scene, math.radians(3.0)),
        "cone of the blades with opposite sign",
    ),
    "another tilt": (
        lambda scene: replace(scene, shaft_tilt=math.radians(-6.0)),
        "shaft.tilt off by -0.01745 rad",
    ),
    "another cone": (
        lambda scene: with_cone(scene, math.radians(-2.5)),
        "blade.cone off by +0.008727 rad",
    ),
}


def with_cone(scene: Scene, cone: float) -> Scene:
    return replace(scene, blades=tuple(replace(blade, cone=cone) for blade in scene.blades))


@pytest.mark.parametrize(
    "mistake", [pytest.param(name, marks=pytest.mark.full) for name in MOTIONS]
)
def test_a_mistake_in_tilt_or_cone_is_named(mistake: str) -> None:
    change, text = MOTIONS[mistake]
    found = rm.compare(motion(change(SCENE)), replace(SCENE, outputs=("angles", "rates")))
    assert found.status == "inaccurate"
    assert found.likely[0].startswith(text), found.likely


@pytest.mark.full
def test_a_scene_that_lacks_tilt_and_cone_is_told_so() -> None:
    upright = with_cone(replace(SCENE, shaft_tilt=0.0, outputs=("angles", "rates")), 0.0)
    found = rm.compare(motion(replace(upright, shaft_tilt=0.1)), upright)
    assert found.likely[0].startswith("shaft.tilt off by +0.1 rad"), found.likely
    found = rm.compare(motion(with_cone(upright, 0.05)), upright)
    assert found.likely[0].startswith("blade.cone off by +0.05 rad"), found.likely


def about_apex() -> dict[str, Array]:
    arm = np.array([0.0, 0.0, SCENE.hub_radius])
    return {
        "blade_root_moment": stored("blade_root_moment") + np.cross(arm, stored("blade_root_force"))
    }


FAULTS: dict[str, tuple[Callable[[], dict[str, Array]], str]] = {
    "coned": (
        lambda: {"blade_root_force": in_frame("blade_root_force", "coned")},
        "in the coned frame",
    ),
    "rotor": (
        lambda: {"blade_root_force": in_frame("blade_root_force", "rotor")},
        "in the rotor frame",
    ),
    "root in shaft": (
        lambda: {"blade_root_force": in_frame("blade_root_force", "shaft")},
        "in the shaft frame",
    ),
    "shaft": (lambda: {"shaft_force": in_frame("shaft_force", "shaft")}, "in the shaft frame"),
    "apex": (about_apex, "about the apex in place of the root"),
    "hub": (
        lambda: {"shaft_force": stored("shaft_force") - [0.0, 0.0, SCENE.hub_mass * SCENE.gravity]},
        "without the hub's weight",
    ),
}


@pytest.mark.parametrize(
    "fault",
    [
        pytest.param(name, marks=() if name in ("coned", "apex", "hub") else pytest.mark.full)
        for name in FAULTS
    ],
)
def test_a_mistake_in_loads_is_named(fault: str) -> None:
    change, text = FAULTS[fault]
    data = motion(SCENE) | {load: stored(load) for load in LOADS} | change()
    found = rm.compare(data, SCENE, tolerance=1e-6)
    assert found.status == "inaccurate"
    assert any(text in cause for cause in found.likely), found.likely


def test_another_mass_of_the_hub_is_named_with_its_size() -> None:
    change = [0.0, 0.0, 50.0 * SCENE.gravity]
    loads = {load: stored(load) for load in LOADS} | {"shaft_force": stored("shaft_force") + change}
    found = rm.compare(motion(SCENE) | loads, SCENE)
    assert found.likely == ("shaft force z: hub.mass 250 kg in place of 200 kg",)


def test_a_scene_that_explains_all_loads_comes_before_frames_of_some() -> None:
    """Loads as a program without tilt computes them, at the states of the tilted rotor."""
    right = motion(SCENE)
    upright = replace(SCENE, shaft_tilt=0.0)
    rows = zip(right["angles"], right["rates"], strict=True)
    loads = [measure(upright, *row).loads for row in rows]
    data = right | {load: np.array([each[load] for each in loads]) for load in LOADS}
    found = rm.compare(data, SCENE)
    assert found.likely == ("without the tilt of the shaft",)


def test_the_torque_on_a_tilted_rotor_is_along_the_shaft() -> None:
    driven = replace(SCENE, rotor_torque=((0.0, 500.0),))
    run = Trajectory(*motion(SCENE).values())
    own = sampled_loads(driven, run.time, run.angles, run.rates)
    planted = own["shaft_moment"] + 500.0 * turn(0, SCENE.shaft_tilt)[:, 1]
    found = wrong_loads(driven, run.replace(**(own | {"shaft_moment": planted})))
    assert found == "shaft moment y, shaft moment z: with the torque on the rotor in it"


def test_tips_and_loads_of_a_leaning_rotor_that_are_made_wrongly_are_named() -> None:
    scene = replace(SCENE, outputs=("angles", "rates", "tip", "loads"))
    right = motion(SCENE)
    run = Trajectory(*right.values(), **{load: stored(load) for load in LOADS})

    def tips(other: Scene) -> Array:
        rows = zip(right["angles"], right["rates"], strict=True)
        return np.array([measure(other, *row).tips for row in rows])

    for mistake in ("no tilt", "tilt", "no cone", "cone"):
        change, text = MOTIONS[mistake]
        assert wrong_tip(scene, run.replace(tip=tips(change(scene)))) == text
    for fault, (change_loads, text) in FAULTS.items():
        assert text in wrong_loads(scene, run.replace(**change_loads())), fault
