"""Loads against Newton's and Euler's laws written anew, of the chain at the order of its steps, and
at jumps."""

from __future__ import annotations

import itertools
from dataclasses import replace

import numpy as np
import pytest
from support import other_code
from support.other_code import about
from support.runs import run
from support.scenes import general, make_scene, paper, shipped

from rotor_mbs.methods.solve import solve
from rotor_mbs.scenario.scene import Blade, Scene
from rotor_mbs.solution.quantities import longest_arm
from rotor_mbs.solution.trajectory import Trajectory

LOADS = (
    "blade_root_force",
    "blade_root_moment",
    "shaft_force",
    "shaft_moment",
    "pitch_actuator_moment",
)
OUTPUTS = ("angles", "rates", "energy", "loads")
# What a load may be off by, N or N m, where the largest are some 1e4: round-off; the chain's steps
# beside.
METHODS = {
    "lagrange/dop853": 1e-9,
    "reference": 1e-9,
    "exudyn_tree/rk67": 1e-8,
    "mujoco/rk4": 1e-8,
    "exudyn_chain/extrapolated": 5e-2,
    "exudyn_chain/newmark_index2": 5e-2,
}

# Of full inertia about principal axes, the centre of mass on the pitch axis: what it weighs and how
# it turns is plain.
MASS, ARM, GRAVITY = 200.0, 6.0, 9.81
MOMENTS = (900.0, 1000.0, 150.0)
BEAM = Blade(MASS, (0.0, 0.0, ARM), (*MOMENTS, 0.0, 0.0, 0.0), (0.0, 0.0, 12.0))


def beam(angles: tuple[float, ...], rates: tuple[float, ...], **changes) -> Scene:
    changes = {"gravity": GRAVITY, "duration": 0.2, "samples": 21, **changes}
    return make_scene(angles, rates, blades=(BEAM,) * (len(angles) - 1), outputs=OUTPUTS, **changes)


@pytest.fixture(
    params=[
        pytest.param(name, marks=pytest.mark.full) if name == "reference" else name
        for name in METHODS
    ]
)
def method(request: pytest.FixtureRequest) -> str:
    return request.param


def off(result, expected) -> float:
    return float(np.abs(result - np.asarray(expected)).max())


# Three unlike blades of full inertia on springs and dampers, torques on rotor and pitches, and
# pitch commands.
DRIVEN = general(
    outputs=OUTPUTS,
    duration=0.2,
    samples=101,
    bearing_damping=(200.0, 300.0, 100.0),
    shaft_damping=4000.0,
    rotor_torque=((0.0, 20000.0), (1.0, 30000.0)),
    pitch_torque=(((0.0, 900.0),), ((0.0, 0.0), (1.0, 2000.0)), ()),
    bearing_rest=(((0.0, 0.1),), ((0.0, 0.0), (1.0, 0.3)), ()),
)


def test_loads_are_those_of_newtons_and_eulers_laws_written_anew(method: str) -> None:
    """At the run's own states; of the chain to the errors of its steps."""
    result = run(
        method, DRIVEN, **({"tolerance": 1e-10} if method == "exudyn_chain/extrapolated" else {})
    )
    exact = other_code.loads(DRIVEN, result.time, result.angles, result.rates)
    allowed = 1e-5 if method.startswith("exudyn_chain") else 1e-13
    for name in LOADS:
        assert off(result.get(name), exact[name]) < allowed * np.abs(exact[name]).max(), name


# The chain against the closed form.

TIGHT = {"newton_relative_tolerance": 1e-12, "newton_absolute_tolerance": 1e-12}
SHORT = {"duration": 0.4, "samples": 21, "outputs": ("angles", "rates", "loads")}


def beginning(name: str, duration: float, samples: int) -> Scene:
    return replace(shipped(name), **{**SHORT, "duration": duration, "samples": samples})


# Scene and step, s. A bearing of 1e9 N m/rad makes an NREL blade swing at 188 rad/s, and the step
# must resolve that.
AGREEING = {
    "full inertia": (replace(DRIVEN, **SHORT), 2e-3),
    "NREL 5 MW, damped": (beginning("stiff/nrel-5mw-damped", 0.05, 6), 2e-4),
    # Past the step of the command at 1 s, by 5.9 swings of the bearing.
    "NREL 5 MW, pitch step": (beginning("turbine/pitch-step", 1.2, 181), 1.0 / 6000.0),
}


def load_error(scene: Scene, result: Trajectory, exact: Trajectory) -> float:
    """Of the largest force at a root; moments of that force at the longest arm."""
    force = np.linalg.norm(exact.blade_root_force, axis=-1).max()
    units = {name: force if "force" in name else force * longest_arm(scene) for name in LOADS}
    return max(off(result.get(name), exact.get(name)) / unit for name, unit in units.items())


@pytest.mark.parametrize(
    "name",
    [
        pytest.param(name, marks=pytest.mark.nightly) if "pitch step" in name else name
        for name in AGREEING
    ],
)
def test_chain_and_closed_form_agree_at_second_order_and_by_extrapolation(name: str) -> None:
    """Multipliers against Newton and Euler: errors a quarter at half the step (ratios seen: 3.94 to
    4.01); by extrapolation within each interval 1e-6 of the largest load."""
    scene, step = AGREEING[name]
    exact = run("lagrange/dop853", scene)
    steps = (step, step / 2, step / 4)
    results = [run("exudyn_chain/newmark_index2", scene, step=step, **TIGHT) for step in steps]
    for larger, smaller in itertools.pairwise(
        load_error(scene, result, exact) for result in results
    ):
        assert larger / smaller == pytest.approx(4.0, abs=0.2)
    assert load_error(scene, run("exudyn_chain/extrapolated", scene, tolerance=1e-10), exact) < 1e-6


def test_at_a_jump_of_the_torque_stands_the_load_before_it(method: str) -> None:
    """Two blades that balance, at rest: until the jump at a sample, and in it, no force along the
    arms' way."""
    scene = beam(
        (0.3, 0.0, 0.0),
        (0.0, 0.0, 0.0),
        gravity=0.0,
        rotor_torque=((0.0, 0.0), (0.1, 0.0), (0.1, 5000.0)),
    )
    result = run(method, scene)
    about_shaft = 2.0 * (MOMENTS[1] + MASS * ARM**2)
    across = MASS * ARM * 5000.0 / about_shaft
    assert off(result.blade_root_force[:11], 0.0) < METHODS[method]
    assert off(result.blade_root_force[12:, :, 0], across) < 1e-5 * across


# The printed model.


def test_printed_loads_are_what_its_own_motion_needs() -> None:
    """m (a + g e_z) of every mass, a by differences of its places; moments about the shaft and the
    pitch axes remain.

    No part of the rotor can transmit those: they are what the errata add to the equations.
    """
    scene = paper("fig11", duration=1.0, samples=201, outputs=OUTPUTS)
    result = run("printed/ode45", scene, relative_tolerance=1e-12, absolute_tolerance=1e-14)
    blade, h = scene.blades[0], result.time[1] - result.time[0]
    # of a second derivative, sixth order
    weights = np.array([2, -27, 270, -490, 270, -27, 2]) / 180.0
    for i, phase in enumerate(scene.phases):
        frames = (
            about("y", result.angles[:, 0] + phase) * about("z", result.angles[:, 1 + i])
        ).as_matrix()
        place = frames @ np.array(blade.centre_of_mass)
        acceleration = sum(w * place[k : len(place) - 6 + k] for k, w in enumerate(weights)) / h**2
        force = blade.mass * (acceleration + np.array([0.0, 0.0, scene.gravity]))
        in_base = np.einsum("nij,nj->ni", frames, result.blade_root_force[:, i])[3:-3]
        assert off(in_base, force) < 1e-6 * np.abs(force).max()
        assert (
            off(
                np.cross(blade.centre_of_mass, result.blade_root_force[:, i]),
                result.blade_root_moment[:, i],
            )
            < 1e-6
        )
    assert np.abs(result.pitch_actuator_moment).max() > 100.0
    assert np.abs(result.shaft_moment[:, 1]).max() > 1e4


# Loads are computed where they are asked for, and change nothing else.


@pytest.mark.parametrize(
    "name", [*(name for name in METHODS if name != "reference"), "exudyn_tree/dopri5"]
)
def test_asking_for_loads_changes_nothing_else(name: str) -> None:
    scene = replace(DRIVEN, duration=0.1, samples=11, outputs=("angles", "rates", "tip", "energy"))
    plain = solve(name, scene, {}).trajectory
    asked = solve(name, replace(scene, outputs=(*scene.outputs, "loads")), {}).trajectory
    assert not set(LOADS) & set(plain.quantities)
    for name, values in {"angles": plain.angles, "rates": plain.rates, **plain.quantities}.items():
        assert values.tobytes() == asked.get(name).tobytes(), name
    assert all(asked.get(name) is not None for name in LOADS)
