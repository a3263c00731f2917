"""The scenes of the NREL 5-MW rotor: their frozen references against what can be worked out by hand."""

from __future__ import annotations

from dataclasses import replace
from math import pi

import numpy as np
import pytest
from support import references
from support.runs import run
from support.scenes import shipped

from rotor_mbs.analysis.judgement import judge
from rotor_mbs.methods.catalogue import REFERENCE
from rotor_mbs.methods.solve import solve
from rotor_mbs.solution.metrics import metrics_of
from rotor_mbs.studies.run import next_to_try
from rotor_mbs.studies.stored_references import frozen_solution

RATED = 12.1 * pi / 30.0  # rad/s
TORQUE = 97.0 * 43093.55  # N m at the slow shaft
BLADE, ARM = 17740.0, 1.5 + 20.475  # kg, m


def test_at_rated_speed_the_generator_takes_the_rated_power() -> None:
    found, scene = references.reference("turbine/steady"), shipped("turbine/steady")
    assert np.abs(found.rates[:, 0] - RATED).max() < 1e-14
    assert scene.torque_at(0.0) * RATED == pytest.approx(5.29661e6, rel=1e-6)  # W: the report's rated mechanical power
    assert scene.shaft_damping * RATED == pytest.approx(TORQUE, rel=1e-15)
    # The hub carries each blade's weight and its centrifugal force.
    forces = found.quantities["blade_root_force"]
    azimuth = found.angles[:, :1] + np.array(scene.phases)
    along = BLADE * (9.80665 * np.cos(azimuth) - ARM * RATED**2)
    assert np.abs(forces[:, :, 2] - along).max() < 1e-9 * np.abs(along).max()


@pytest.mark.parametrize("name", ["steady", "imbalance"])
def test_scipys_integrators_are_not_stopped_by_megawatts_that_balance(name: str) -> None:
    """Drive less damper is rounding error, 1e-9 W: held to 1e-16 J as the work was, no step was short enough."""
    scene, exact = shipped(f"turbine/{name}"), references.reference(f"turbine/{name}")
    found = solve("lagrange/dop853", scene, {}, time_limit_s=20.0)
    assert found.integration.success
    assert np.abs(found.trajectory.angles - exact.angles).max() < 1e-11
    assert np.abs(found.trajectory.work - exact.work).max() < 1e-12 * np.abs(exact.kinetic_energy).max()


@pytest.mark.parametrize(("factor", "status"), [(1.0, "ok"), (1.0 + 1e-12, "inaccurate")])
def test_loads_of_a_stiff_bearing_are_known_to_the_rounding_of_its_angle(factor: float, status: str) -> None:
    """9.7e8 N m/rad: a unit in the last place of a pitch is 4e-14 of the largest load."""
    scene = shipped("turbine/feather-stuck")
    exact = frozen_solution(scene)
    assert exact is not None
    angles, forces = exact.trajectory.angles.copy(), factor * exact.trajectory.quantities["shaft_force"]
    angles[:, 1:] = np.nextafter(angles[:, 1:], 0.0)
    moved = replace(exact, trajectory=exact.trajectory.replace(angles=angles, shaft_force=forces))
    assert judge(scene, moved, exact.trajectory).status == status
    assert next_to_try(scene, REFERENCE, {}, "inaccurate") == ""


@pytest.mark.parametrize("method", ["exudyn_tree/rk67", "mujoco/rk4"])
def test_the_work_of_a_bearing_that_swings_between_samples(method: str) -> None:
    """A swing in three samples, damped. Seen: 8e-14 and 2.8e-12; from ten states a sample 7e-10."""
    scene = shipped("stiff/nrel-5mw-damped")
    assert metrics_of(scene, run(method, scene), None)["energy_drift_max"] < 1e-11
