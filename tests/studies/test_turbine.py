"""The scenes of the NREL 5-MW rotor: their frozen references against what can be worked out by hand."""

from __future__ import annotations

from math import pi, radians

import numpy as np
import pytest
from support import references

from rotor_mbs.methods.solve import solve
from rotor_mbs.solution.metrics import metrics_of

RATED = 12.1 * pi / 30.0  # rad/s
TORQUE = 97.0 * 43093.55  # N m at the slow shaft
BLADE, ARM = 17740.0, 1.5 + 20.475  # kg, m


def rotor_inertia() -> float:
    """kg m² about the shaft, at zero pitch: three blades, hub and generator."""
    blade = 11776047.0 - BLADE * 20.475**2 + 18731.0 + BLADE * (ARM**2 + 0.1**2)
    return 3.0 * blade + 115926.0 + 97.0**2 * 534.116


@pytest.mark.parametrize("name", ["steady", "pitch-step", "feather-stuck", "imbalance", "start-up"])
def test_energy_and_momentum_are_balanced(name: str) -> None:
    scene, found = references.scene(f"turbine/{name}"), references.reference(f"turbine/{name}")
    assert len(found.time) == scene.samples
    metrics = metrics_of(scene, found, None)
    assert metrics["energy_drift_max"] < 1e-13


def test_at_rated_speed_the_generator_takes_the_rated_power() -> None:
    found, scene = references.reference("turbine/steady"), references.scene("turbine/steady")
    assert np.abs(found.rates[:, 0] - RATED).max() < 1e-14
    assert scene.torque_at(0.0) * RATED == pytest.approx(5.29661e6, rel=1e-6)  # W: the report's rated mechanical power
    assert scene.shaft_damping * RATED == pytest.approx(TORQUE, rel=1e-15)
    # The hub carries each blade's weight and its centrifugal force.
    forces = found.quantities["blade_root_force"]
    azimuth = found.angles[:, :1] + np.array(scene.phases)
    along = BLADE * (9.80665 * np.cos(azimuth) - ARM * RATED**2)
    assert np.abs(forces[:, :, 2] - along).max() < 1e-9 * np.abs(along).max()


def test_start_up_follows_the_linear_equation_of_the_shaft() -> None:
    """I dΩ/dt = τ - d Ω, τ rising for 10 s: blades at zero pitch are in balance, and the rotor is rigid."""
    found = references.reference("turbine/start-up")
    damping = TORQUE / RATED
    decay, slope, ramp = damping / rotor_inertia(), TORQUE / 10.0 / damping, 10.0

    def rising(t):
        return slope * (t - (1.0 - np.exp(-decay * t)) / decay)

    after = RATED + (rising(ramp) - RATED) * np.exp(-decay * (found.time - ramp))
    exact = np.where(found.time <= ramp, rising(found.time), after)
    assert np.abs(found.rates[:, 0] - exact).max() < 1e-12
    assert not found.angles[:, 1:].any()


def test_three_percent_more_mass_in_a_blade_pulls_at_the_shaft_once_a_turn() -> None:
    found = references.reference("turbine/imbalance")
    force = found.quantities["shaft_force"]
    spin = found.angles[:, 0]
    basis = np.stack([np.ones_like(spin), np.sin(spin), np.cos(spin)], axis=1)
    constant, along_x, along_z = np.linalg.lstsq(basis, force[:, [0, 2]], rcond=None)[0]
    pull = 0.03 * BLADE * ARM * RATED**2  # N; gravity on the heavy blade changes the speed by some 0.2 %
    assert along_x[0] == pytest.approx(-pull, rel=0.02)
    assert along_z[1] == pytest.approx(-pull, rel=0.02)
    assert constant[1] == pytest.approx(3.03 * BLADE * 9.80665, rel=1e-3)
    assert np.abs(force[:, 1]).max() < 1e-6 * pull


def test_a_step_of_the_command_rings_and_settles() -> None:
    found = references.reference("turbine/pitch-step")
    before, settled, back = found.time < 1.0, (found.time > 3.5) & (found.time < 4.0), found.time > 5.9
    pitches = found.angles[:, 1:]
    assert np.abs(pitches[before]).max() < 1e-12
    assert np.abs(pitches[settled] - radians(2.0)).max() < 2e-4
    assert np.abs(pitches[back]).max() < 1e-5
    assert pitches.max() > 1.7 * radians(2.0)  # 2 % of critical damping
    near = (found.time > 1.2) & (found.time < 2.0)
    swing = pitches[near, 0] - radians(2.0)
    crossings = found.time[near][1:][np.diff(np.sign(swing)) != 0]
    frequency = 0.5 * (len(crossings) - 1) / (crossings[-1] - crossings[0])
    assert frequency == pytest.approx(29.4, abs=0.6)  # Hz: 971.35e6 N m/rad on 28392 kg m²


def test_two_blades_feather_at_their_rate_and_the_third_stays() -> None:
    found = references.reference("turbine/feather-stuck")
    assert np.abs(found.angles[-1, 1:3] - pi / 2).max() < 1e-4
    assert not found.angles[:, 3].any()  # the plane of rotation mirrors it: nothing turns it
    middle = (found.time > 3.0) & (found.time < 12.0)
    rate = np.polyfit(found.time[middle], found.angles[middle, 1], 1)[0]
    assert rate == pytest.approx(radians(8.0), rel=1e-3)
    assert found.rates[-1, 0] < RATED
    moments = np.abs(found.quantities["pitch_actuator_moment"]).max(axis=0)
    assert moments[:2].min() > 1e5  # N m, of the start of a ramp
    assert not moments[2]


@pytest.mark.full
def test_the_taylor_method_on_the_step_of_the_command() -> None:
    scene, exact = references.scene("turbine/pitch-step"), references.reference("turbine/pitch-step")
    found = references.run(scene).trajectory
    assert np.abs(found.angles - exact.angles).max() < 1e-13
    assert np.abs(found.work - exact.work).max() < 1e-12 * np.abs(exact.kinetic_energy).max()


@pytest.mark.parametrize("name", ["steady", "imbalance"])
def test_scipys_integrators_are_not_stopped_by_megawatts_that_balance(name: str) -> None:
    """Drive less damper is rounding error, 1e-9 W: held to 1e-16 J as the work was, no step was short enough."""
    scene, exact = references.scene(f"turbine/{name}"), references.reference(f"turbine/{name}")
    found = solve("lagrange/dop853", scene, {}, time_limit_s=20.0)
    assert found.integration.success
    assert np.abs(found.trajectory.angles - exact.angles).max() < 1e-11
    assert np.abs(found.trajectory.work - exact.work).max() < 1e-12 * np.abs(exact.kinetic_energy).max()


@pytest.mark.parametrize("method", ["exudyn_tree/rk67", "mujoco/rk4"])
def test_the_work_of_a_bearing_that_swings_between_samples(method: str) -> None:
    """A swing in three samples, damped. Seen: 8e-14 and 2.8e-12; from ten states a sample 7e-10."""
    scene = references.scene("stiff/nrel-5mw-damped")
    assert metrics_of(scene, references.run(scene, method).trajectory, None)["energy_drift_max"] < 1e-11
