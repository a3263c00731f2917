"""Exact solutions against Lagrange's equations typed anew, and where there is none."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from support import other_code
from support.scenes import paper

from rotor_mbs.analysis.kinematics import exact_rotor_angle, potential_energy
from rotor_mbs.scenario.scene import Scene

RIGID = replace(paper("fig03").blades[0], inertia=(3e5, 4e5, 2e5, 0.0, 0.0, 0.0))
ONE, THREE = (
    paper(name, hub_inertia=1e6, blades=(RIGID,) * n) for name, n in (("fig03", 1), ("fig05", 3))
)
TURNING: dict[str, Any] = {"initial_rates": (0.5, 0.0, 0.0, 0.0)}
DESIGN_COLUMNS = {
    "pendulum": ONE,
    "rest": THREE,
    "uniform rotation": replace(THREE, **TURNING),
    "constant torque": replace(THREE, **TURNING, rotor_torque=((0.0, 1e7),)),
}


@pytest.mark.parametrize("name", DESIGN_COLUMNS)
def test_exact_solutions_are_those_of_the_equations(name: str) -> None:
    time = np.linspace(0.0, 5.0, 51)
    found = exact_rotor_angle(DESIGN_COLUMNS[name], time)
    assert found is not None
    assert found[0] == name
    # DOP853 at a relative tolerance of 1e-11 over some hundred steps.
    assert found[1] == pytest.approx(
        other_code.trajectory(DESIGN_COLUMNS[name], time)[0][:, 0], abs=1e-8
    )


def test_a_spring_has_its_energy_from_its_rest_angle() -> None:
    """k (θ - r)²/2, with different k and r in every bearing, r of blade 2 moving."""
    rest = ((0.0, 0.3),), ((0.0, -0.2), (1.0, 0.4)), ((0.0, 0.1),)
    sprung = replace(THREE, bearing_stiffness=(1e5, 2e5, 4e5), bearing_rest=rest)
    time, angles = np.array([0.0, 0.5]), np.array([[0.2, 0.3, 0.8, 0.1], [0.2, 1.3, 0.1, 0.6]])
    spring = potential_energy(sprung, time, angles) - potential_energy(THREE, time, angles)
    assert spring == pytest.approx([0.5 * 2e5, 0.5 * 1e5 + 0.5 * 4e5 * 0.5**2], rel=1e-12)


_BLADE = THREE.blades[0]
UNKNOWN = {
    "a pitch that starts": replace(THREE, initial_angles=(0.5, 0.0, 0.1, 0.0)),
    "a pitch that moves": replace(THREE, initial_rates=(0.0, 0.0, 0.1, 0.0)),
    "a torque on a pitch": replace(THREE, pitch_torque=((), ((0.0, 1.0),), ())),
    "a damped rotor": replace(THREE, shaft_damping=1.0),
    "a blade heavier than the others": replace(
        THREE, blades=(*THREE.blades[:2], replace(_BLADE, mass=1.0))
    ),
    "a torque over time": replace(THREE, rotor_torque=((0.0, 0.0), (1.0, 5.0))),
    "a centre of mass off the plane": replace(
        THREE, blades=(replace(_BLADE, centre_of_mass=(0.1, 0.1, 15.0)),) * 3
    ),
    "products of inertia": replace(
        THREE, blades=(replace(_BLADE, inertia=(9.0, 9.0, 9.0, 1.0, 0.0, 0.0)),) * 3
    ),
    "and others": replace(
        THREE, blades=(replace(_BLADE, inertia=(9.0, 9.0, 9.0, 0.0, 0.0, 1.0)),) * 3
    ),
    "a driven pendulum": replace(ONE, rotor_torque=((0.0, 5.0),)),
    "a thrown pendulum": replace(ONE, initial_rates=(0.1, 0.0)),
    "a pendulum without gravity": replace(ONE, gravity=0.0),
    "a pendulum turns away": replace(ONE, initial_angles=(20.0, 0.0)),
}


@pytest.mark.parametrize("scene", UNKNOWN.values(), ids=UNKNOWN)
def test_elsewhere_no_exact_solution_is_claimed(scene: Scene) -> None:
    assert exact_rotor_angle(scene, np.linspace(0.0, 1.0, 3)) is None
