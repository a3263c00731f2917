"""printed/ode45 and its single-erratum variants: exact solutions, energy, refusals."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest
from support.other_code import pendulum
from support.scenes import paper

from rotor_mbs.errors import MethodRefusal
from rotor_mbs.methods.solve import solve
from rotor_mbs.models.printed import literal
from rotor_mbs.models.printed.methods import METHODS

PI = math.pi
M, C, D = 15000.0, math.hypot(0.08, 0.03), 15.42  # Table 1
WEIGHT = M * 9.8 * D  # J, the scale of a blade's energy
TIGHT = {"relative_tolerance": 1e-12, "absolute_tolerance": 1e-14}
CLOSE = {"relative_tolerance": 1e-9, "absolute_tolerance": 1e-11}
FIG03, FIG04B, FIG11 = (paper(name) for name in ("fig03", "fig04b", "fig11"))
BLADE = FIG11.blades[0]


def run(given, method="printed/ode45", **settings):
    return solve(method, given, settings)


def drift(trajectory):
    """Largest change of energy less work, in units of a blade's weight times its arm."""
    energy = trajectory.kinetic_energy + trajectory.potential_energy - trajectory.work
    return np.abs(energy - energy[0]).max() / WEIGHT


# Exact solutions.


@pytest.mark.parametrize(
    ("given", "lean", "method"),
    [
        *((FIG04B, 0.0, method.name) for method in METHODS),
        (FIG03, C, "printed_e2/ode45"),
        (FIG03, C, "printed_e3/ode45"),
    ],
)
def test_one_blade_is_a_pendulum_that_does_not_pitch(given, lean, method):
    """Without c every erratum is without effect; with it E2 and E3 at zero pitch and pitch rate. q2
    = π hangs down."""
    result = run(given, method, **TIGHT)
    exact = pendulum(
        11 * PI / 12, math.hypot(lean, D), math.atan2(lean, D), 9.8, result.trajectory.time
    )
    # Tolerance 1e-12 a step, some 1e3 steps.
    np.testing.assert_allclose(result.trajectory.angles[:, 0], exact, atol=1e-9)
    assert not result.trajectory.angles[:, 1].any()


@pytest.mark.parametrize("count", [1, 3])
def test_without_c_a_torque_turns_the_rotor_about_its_shaft(count):
    # m d² q̈2 = τ + m g d sin q2, summed over the blades. Small numbers, beside which 0.001 shows.
    m, d, torque, q2 = 2.0, 3.0, 5.0, 0.7
    phases = [2.0 * PI * i / count for i in range(count)]
    weights = sum(m * 9.8 * d * math.sin(q2 + phase) for phase in phases)
    exact = (torque + weights) / (count * m * d**2)
    found = literal.fixed_pitch_acceleration(m, d, 9.8, torque, q2, phases)
    assert found == pytest.approx(exact, abs=1e-14)  # round-off of terms of order one


def test_constant_torque_turns_a_balanced_rotor():
    # τ t² / (2·3·m·(c² + d²)); the pitches stay at zero with E1 out.
    result = run(paper("fig15-1kNm"), "printed_e3/ode45", **TIGHT).trajectory
    exact = 1000.0 * result.time**2 / (6.0 * M * (C**2 + D**2))
    np.testing.assert_allclose(result.angles[:, 0], exact, atol=1e-9)
    np.testing.assert_allclose(result.work, 1000.0 * exact, atol=1e-6)


# Energy: the physical one of the motion.


def test_right_equations_keep_energy_and_printed_ones_make_it():
    # Energy drifts by the tolerance a step at most; 2e3 steps, most of them at far less.
    assert drift(run(FIG11, "printed_e3/ode45", **CLOSE).trajectory) < 1e-8
    for method, gain in {
        "printed/ode45": 0.1,
        "printed_e1/ode45": 1e-4,
        "printed_e2/ode45": 0.1,
    }.items():
        assert drift(run(FIG11, method).trajectory) > gain


def test_work_of_torques_that_ramp_and_jump_on_rotor_and_pitches():
    table = ((0.4, 0.0), (0.8, 4e5), (1.2, 4e5), (1.2, -3e5), (1.8, 1e5))
    on_pitches = (((0.0, 9e3),), ((0.4, 0.0), (1.0, -2e4)), ())
    given = replace(FIG11, duration=2.0, rotor_torque=table, pitch_torque=on_pitches)
    # Steps cross the kinks of the table with their error held to the tolerance, 1e-9; the work adds
    # nothing to it.
    trajectory = run(given, "printed_e3/ode45", **CLOSE).trajectory
    assert drift(trajectory) < 1e-7
    assert np.abs(trajectory.work).max() > 0.01 * WEIGHT


# What is handed over.


def test_a_singularity_ends_the_run_with_what_was_reached():
    # One blade as printed pitches to a right angle, where the mass matrix is singular.
    result = run(replace(FIG03, duration=20.0))
    assert not result.integration.success
    assert "Failure at t=" in result.integration.message
    assert 11.0 < result.integration.time_reached < 14.0
    assert result.trajectory.time[-1] <= result.integration.time_reached
    assert abs(result.trajectory.refined.angles[-1, 1]) == pytest.approx(PI / 2, abs=1e-3)
    for part in (result.trajectory.angles, result.trajectory.rates, result.trajectory.tip):
        assert np.all(np.isfinite(part))
        assert len(part) == len(result.trajectory.time)


@pytest.mark.parametrize(
    ("given", "word"),
    [
        (
            replace(
                FIG11, blades=(BLADE,) * 2, initial_angles=(0.0,) * 3, initial_rates=(0.0,) * 3
            ),
            "1 or 3 blades",
        ),
        (replace(FIG11, blades=(BLADE, BLADE, replace(BLADE, mass=1.0))), "equal"),
        (
            replace(FIG11, blades=(replace(BLADE, inertia=(1.0, 1.0, 1.0, 0.0, 0.0, 0.0)),) * 3),
            "point-mass",
        ),
        (replace(FIG11, blades=(replace(BLADE, centre_of_mass=(C, 0.1, D)),) * 3), "y = 0"),
        (replace(FIG11, hub_inertia=1.0), "hub inertia"),
        (replace(FIG11, bearing_stiffness=(0.0, 1.0, 0.0)), "bearing"),
        (replace(FIG11, bearing_damping=(0.0, 1.0, 0.0)), "bearing"),
        (replace(FIG11, shaft_damping=1.0), "shaft damping"),
        (replace(FIG11, shaft_tilt=0.1), "shaft.tilt"),
        (replace(FIG11, blades=(replace(FIG11.blades[0], cone=0.1),) * 3), "blade.cone"),
        (replace(FIG11, hub_radius=1.0), "radius or a mass"),
        (replace(FIG11, hub_mass=1.0), "radius or a mass"),
    ],
)
def test_refusals_are_one_sentence(given, word):
    with pytest.raises(MethodRefusal, match=word) as refusal:
        run(given)
    assert "\n" not in str(refusal.value)
    assert str(refusal.value).startswith("printed/ode45")
