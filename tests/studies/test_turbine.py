"""The scenes of the NREL 5-MW rotor: their frozen references against what can be worked out by
hand."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from itertools import pairwise
from math import pi

import numpy as np
import pytest
from support import references
from support.runs import run
from support.scenes import shipped

from rotor_mbs.analysis.judgement import judge
from rotor_mbs.methods.catalogue import (
    REFERENCE,
    default_methods,
    find_method,
    is_corrected,
    method_names,
)
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
    # W: the report's rated mechanical power
    assert scene.torque_at(0.0) * RATED == pytest.approx(5.29661e6, rel=1e-6)
    assert scene.shaft_damping * RATED == pytest.approx(TORQUE, rel=1e-15)
    # The hub carries each blade's weight and its centrifugal force.
    forces = found.quantities["blade_root_force"]
    azimuth = found.angles[:, :1] + np.array(scene.phases)
    along = BLADE * (9.80665 * np.cos(azimuth) - ARM * RATED**2)
    assert np.abs(forces[:, :, 2] - along).max() < 1e-9 * np.abs(along).max()


@pytest.mark.parametrize("name", ["steady", "imbalance"])
def test_scipys_integrators_are_not_stopped_by_megawatts_that_balance(name: str) -> None:
    """Drive less damper is rounding error, 1e-9 W: held to 1e-16 J as the work was, no step was
    short enough."""
    scene, exact = shipped(f"turbine/{name}"), references.reference(f"turbine/{name}")
    found = solve("lagrange/dop853", scene, {}, time_limit_s=20.0)
    assert found.integration.success
    assert np.abs(found.trajectory.angles - exact.angles).max() < 1e-11
    assert (
        np.abs(found.trajectory.work - exact.work).max()
        < 1e-12 * np.abs(exact.kinetic_energy).max()
    )


@pytest.mark.parametrize(("factor", "status"), [(1.0, "ok"), (1.0 + 1e-12, "inaccurate")])
def test_loads_of_a_stiff_bearing_are_known_to_the_rounding_of_its_angle(
    factor: float, status: str
) -> None:
    """9.7e8 N m/rad: a unit in the last place of a pitch is 4e-14 of the largest load."""
    scene = shipped("turbine/feather-stuck")
    exact = frozen_solution(scene)
    assert exact is not None
    angles, forces = (
        exact.trajectory.angles.copy(),
        factor * exact.trajectory.quantities["shaft_force"],
    )
    angles[:, 1:] = np.nextafter(angles[:, 1:], 0.0)
    moved = replace(exact, trajectory=exact.trajectory.replace(angles=angles, shaft_force=forces))
    assert judge(scene, moved, exact.trajectory).status == status
    assert next_to_try(scene, REFERENCE, {}, "inaccurate") == ""


@pytest.mark.parametrize(
    "name",
    [name for name in method_names() if find_method(name).ladders and is_corrected(name)],
)
def test_a_run_with_the_finest_settings_is_referred_to_another_method(name: str) -> None:
    scene, method = shipped("turbine/steady"), find_method(name)
    interval = scene.duration / (scene.samples - 1)
    *_, finer, finest = method.ladders[0].settings_by_value(interval).values()
    advice = next_to_try(scene, method.name, {**method.defaults, **finer}, "inaccurate")
    lower = {key: value for key, value in finest.items() if value != finer[key]}
    shown = ", ".join(f"{key}={value:.3g}" for key, value in lower.items())
    assert lower
    assert advice == f"; next to try: {shown}"
    advice = next_to_try(scene, method.name, {**method.defaults, **finest}, "inaccurate")
    other = next(name for name in default_methods() if name != method.name and is_corrected(name))
    assert advice == f"; no finer settings of this method are known; next to try: {other}"


@pytest.mark.parametrize("method", ["exudyn_tree/rk67", "mujoco/rk4"])
def test_the_work_of_a_bearing_that_swings_between_samples(method: str) -> None:
    """A swing in three samples, damped. Seen: 8e-14 and 2.8e-12; from ten states a sample 7e-10."""
    scene = shipped("stiff/nrel-5mw-damped")
    assert metrics_of(scene, run(method, scene), None)["energy_drift_max"] < 1e-11


# Rotors of public OpenFAST models, with tilt, cone and hub


# Mass, first and second moment of a blade about its root, and mass and inertia of the rotor with
# cone and without generator, as the programs printed them; sources in the scene files. IEA 15 MW:
# the blade of its windIO file.
PUBLISHED = {
    "nrel-5mw-overspeed": (17536.614, 362132.653, 11752352.265, 109389.842, 38677040.613),
    "windpact-start-up": (3912.590, 46618.784, 800799.912, 26885.770, 2962443.885),
    "uae-overspeed": (61.350, 105.045, 288.010, 579.599, 780.437),
}
GENERATORS = {"nrel-5mw-overspeed": 534.116 * 97**2, "windpact-start-up": 53.036 * 87.965**2,
              "uae-overspeed": 0.2264 * 25.13**2}  # fmt: skip


@pytest.mark.parametrize("name", PUBLISHED)
def test_masses_of_public_models_are_the_published_ones(name: str) -> None:
    """The last printed digit of the blade's numbers, from which the scene is made, is 1e-3."""
    scene = shipped(f"turbine/{name}")
    (blade,) = set(scene.blades)
    arm = blade.centre_of_mass[2] - scene.hub_radius
    about_apex = blade.inertia[0] + blade.mass * blade.centre_of_mass[2] ** 2
    turning = (
        scene.hub_inertia
        - GENERATORS[name]
        + len(scene.blades) * about_apex * np.cos(blade.cone) ** 2
    )
    rotor_mass = scene.hub_mass + len(scene.blades) * blade.mass
    found = (
        blade.mass,
        blade.mass * arm,
        blade.inertia[0] + blade.mass * arm**2,
        rotor_mass,
        turning,
    )
    assert found == pytest.approx(PUBLISHED[name], rel=1e-6, abs=2e-3)


def test_the_blade_of_the_iea_15_mw_turbine_is_that_of_its_windio_file() -> None:
    """windIO 2.1.1, IEA-15-240-RWT.yaml, has 66996.7 kg."""
    blade = shipped("turbine/iea-15mw-feather").blades[0]
    assert blade.mass == pytest.approx(66996.7, rel=1e-5)
    assert abs(blade.centre_of_mass[0]) == pytest.approx(0.421, rel=0.05)


def impulse(table: Sequence[tuple[float, float]], time: float) -> float:
    """Integral of a torque from 0 to a time: linear between the rows of its table, constant
    outside."""
    (first, before), (last, behind) = table[0], table[-1]
    total = before * min(time, first) + behind * max(time - last, 0.0)
    for (left, a), (right, b) in pairwise(table):
        end = min(time, right)
        if left < end:
            at_end = a + (b - a) * (end - left) / (right - left)
            total += 0.5 * (a + at_end) * (end - left)
    return total


@pytest.mark.parametrize("name", ["nrel-5mw-overspeed", "uae-overspeed"])
def test_momentum_and_weight_of_a_balanced_rotor_with_cone(name: str) -> None:
    """Equal blades with mass on their axes: the torque alone changes the momentum about the shaft,
    to which a coned blade's pitch rate adds; the bearing carries the weight of blades and hub,
    which is that of the published mass."""
    found, scene = references.reference(f"turbine/{name}"), shipped(f"turbine/{name}")
    (blade,), count = set(scene.blades), len(scene.blades)
    sine, cosine = np.sin(blade.cone), np.cos(blade.cone)
    xx, _, zz, *_ = blade.inertia_about_apex()
    inertia = scene.hub_inertia + count * (cosine**2 * xx + sine**2 * zz)
    momentum = inertia * found.rates[:, 0] + count * zz * sine * found.rates[:, 1]
    impulses = np.array([impulse(scene.rotor_torque, time) for time in found.time])
    assert np.abs(momentum - momentum[0] - impulses).max() < 1e-13 * np.abs(momentum).max()
    weight = PUBLISHED[name][3] * scene.gravity
    forces = found.quantities["shaft_force"]
    # of the last printed digit, 1e-3 kg
    assert np.abs(forces - [0.0, 0.0, weight]).max() < 2e-3 * scene.gravity
