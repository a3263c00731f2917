"""Energies, tip paths and the work of loads, computed from angles and rates alone, against Newton's
and Euler's laws by rotation matrices and against motions known in closed form."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest
from support.newton_euler import measure
from support.random_scenes import leaning_scene
from support.scenes import AXIAL, MIXED, make_scene

from rotor_mbs.analysis.kinematics import (
    exact_rotor_angle,
    kinetic_energy,
    potential_energy,
    tip_paths,
    work_of_constant_loads,
)
from rotor_mbs.scenario.scene import Scene

LEANING = leaning_scene(3, 3)
UPRIGHT_BLADES = tuple(replace(blade, cone=0.0) for blade in LEANING.blades)
ROTORS = {
    "tilt and cones": LEANING,
    "tilt": replace(LEANING, blades=UPRIGHT_BLADES),
    "cones": replace(LEANING, shaft_tilt=0.0),
    "upright": replace(LEANING, shaft_tilt=0.0, blades=UPRIGHT_BLADES),
}


@pytest.mark.parametrize("scene", ROTORS.values(), ids=ROTORS)
def test_energies_and_tips_are_those_of_rotation_matrices(scene: Scene) -> None:
    """To rounding: a share of 1e-12 of the kinetic energy, the weights and the lengths."""
    rng = np.random.default_rng(8)
    angles, rates = rng.uniform(-np.pi, np.pi, (5, 4)), rng.uniform(-2.0, 2.0, (5, 4))
    states = [measure(scene, *state) for state in zip(angles, rates, strict=True)]
    assert kinetic_energy(scene, angles, rates) == pytest.approx(
        [state.kinetic for state in states], rel=1e-12
    )
    weights = sum(blade.mass * math.hypot(*blade.centre_of_mass) for blade in scene.blades)
    assert potential_energy(scene, np.zeros(5), angles) == pytest.approx(
        [state.potential for state in states], abs=1e-12 * weights * scene.gravity
    )
    tips = np.array([state.tips for state in states])
    np.testing.assert_allclose(
        tip_paths(scene, angles), tips, rtol=0.0, atol=1e-12 * np.abs(tips).max()
    )


def test_the_work_of_constant_loads_is_theirs_over_the_turns_and_else_unknown() -> None:
    loads = {
        "rotor_torque": ((0.0, 7.0),),
        "pitch_torque": (((0.0, 2.0),), (), ((0.0, -3.0),)),
    }
    scene = make_scene([0.5, 0.1, 0.2, 0.3], [0, 0, 0, 0], **loads)
    turned = np.array([[0.0, 0.0, 0.0, 0.0], [1.0, 10.0, 100.0, 1000.0]])
    angles = np.array(scene.initial_angles) + turned
    work = work_of_constant_loads(scene, angles)
    assert work == pytest.approx([0.0, 7.0 + 20.0 - 3000.0], rel=1e-12)
    assert work_of_constant_loads(replace(scene, shaft_damping=1.0), angles) is None
    assert work_of_constant_loads(MIXED, angles) is None


def test_a_torque_turns_coned_point_masses_about_the_shaft_at_their_distance_from_it() -> None:
    """τ t² / (2 Σ m d² cos²β): a point mass on its pitch axis has no pitch to turn."""
    cone, torque, time = 0.3, 500.0, np.linspace(0.0, 2.0, 5)
    blade = replace(AXIAL, inertia=(0.0,) * 6, cone=cone)
    scene = make_scene([0.2, 0, 0, 0], [0.1, 0, 0, 0], (blade,) * 3, rotor_torque=((0.0, torque),))
    inertia = 3.0 * blade.mass * (blade.centre_of_mass[2] * math.cos(cone)) ** 2
    found = exact_rotor_angle(scene, time)
    assert found is not None
    assert found[0] == "constant torque"
    expected = 0.2 + 0.1 * time + torque * time**2 / (2.0 * inertia)
    np.testing.assert_allclose(found[1], expected, rtol=1e-13)
