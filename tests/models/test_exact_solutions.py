"""Every model: exact solutions, and one scene with every load beside equations written anew."""

from __future__ import annotations

from dataclasses import replace
from math import hypot, pi

import numpy as np
import pytest
from support.other_code import blade_points, closed_form, energies, pendulum
from support.runs import energy_error, run
from support.scenes import ARM, AXIAL, MIXED, OFFSET, PAPER_BLADE, STOUT, make_scene

from rotor_mbs.analysis import kinematics
from rotor_mbs.methods.catalogue import REFERENCE, find_method
from rotor_mbs.models.exudyn import methods

# Explicit schemes resolve these slow motions to round-off; order 2 at 2.5e-4 to 5e-4 s leaves h²
# times the fourth derivative, some 1e-8, and the constraints of the chain their Newton tolerance.
EXUDYN = [method.name for method in methods.METHODS]
CHAIN = [name for name in EXUDYN if name.startswith("exudyn_chain")]
EXPLICIT = ["exudyn_tree/rk44", "exudyn_tree/rk67", "exudyn_tree/dopri5"]
FINE = ["lagrange/taylor", "lagrange/dop853", "mujoco/rk4", *EXPLICIT]
NAMES = [*FINE, *(name for name in EXUDYN if name not in FINE)]
BOUND = {name: 1e-10 if name in FINE else 2e-7 for name in NAMES}
INERTIA = 3 * 15000 * (OFFSET**2 + ARM**2)  # of the paper's rotor at zero pitch, kg m²

every_method = pytest.mark.parametrize("name", NAMES)


RAMP = ((0.1234, 0.0), (0.5, 4e6), (0.5, -2e6), (0.777, -2e6))


def ramp_motion(t):
    """Rotor angle under RAMP, from rest: the torque integrated twice, piece by piece."""
    start, jump = 0.1234, 0.5
    slope = 4e6 / (jump - start)
    rising, after = np.clip(t, start, jump) - start, np.maximum(t - jump, 0.0)
    at_jump = slope * (jump - start) ** 2 / 2
    return (slope * rising**3 / 6 + at_jump * after - 2e6 * after**2 / 2) / INERTIA


# Of each scene the rotor's angle and the pitch at times t; None: pitches stay where they were.
# At zero pitch a point mass lies in the plane of rotation, turned from the blade's axis by atan(c /
# d).
POLE = replace(PAPER_BLADE, centre_of_mass=(0.0, 0.0, ARM))
# with AXIAL, of which rotor and pitch do not feel each other
K_PITCH, D_PITCH, J_PITCH = 40.0, 3.0, 7.0


def oscillator(start, rate, t, damping=D_PITCH):
    """Pitch of a damped torsion oscillator, from its angle of rest."""
    decay = damping / (2 * J_PITCH)
    w = np.sqrt(K_PITCH / J_PITCH - decay**2)
    return np.exp(-decay * t) * (start * np.cos(w * t) + (rate + decay * start) / w * np.sin(w * t))


def axial(pitch, rate, damping=D_PITCH, **loads):
    springs = {"bearing_stiffness": (K_PITCH,), "bearing_damping": (damping,)}
    return make_scene([0.1, pitch], [1.0, rate], (AXIAL,), gravity=0.0, **springs, **loads)


def torsion(start):
    return axial(start, 0.5), lambda t: 0.1 + t, lambda t: oscillator(start, 0.5, t)


CONSTANT_LOADS = {
    "rotor_torque": ((0.0, 5.0),),
    "pitch_torque": (((0.0, 12.0),),),
    "bearing_rest": (((0.0, 0.7),),),
}
CASES = {
    "pendulum": (
        make_scene([11 * pi / 12, 0], [0, 0], duration=2.5, samples=251),
        lambda t: pendulum(11 * pi / 12, hypot(OFFSET, ARM), np.arctan2(OFFSET, ARM), 9.8, t),
        None,
    ),
    "pendulum of a pitch without inertia": (
        make_scene([11 * pi / 12, 0.25], [0, 0.0], (POLE,), duration=2.0),
        lambda t: pendulum(11 * pi / 12, ARM, 0.0, 9.8, t),
        None,
    ),
    "three equal blades turn": (
        make_scene([pi / 6, 0, 0, 0], [pi / 10, 0, 0, 0]),
        lambda t: pi / 6 + pi / 10 * t,
        None,
    ),
    "torque over time with kinks and jumps": (
        make_scene([0] * 4, [0] * 4, gravity=0.0, duration=1.0, samples=34, rotor_torque=RAMP),
        ramp_motion,
        None,
    ),
    "shaft damping": (
        make_scene([0.2, 0, 0, 0], [2, 0, 0, 0], gravity=0.0, shaft_damping=1.5 * INERTIA),
        lambda t: 0.2 + 2 / 1.5 * (1 - np.exp(-1.5 * t)),
        None,
    ),
    # About 12/k beside the angle of rest; the rotor's inertia is 12 + 50·9 kg m².
    "constant torques and angle of rest": (
        axial(0.2, -0.5, damping=0.0, **CONSTANT_LOADS),
        lambda t: 0.1 + t + 2.5 * t**2 / 462.0,
        lambda t: 0.7 + 12.0 / K_PITCH + oscillator(-0.5 - 12.0 / K_PITCH, -0.5, t, 0.0),
    ),
    "a growing torque and a constant angle of rest": (
        axial(
            0.2,
            -0.5,
            damping=0.0,
            duration=2.0,
            pitch_torque=(((0.0, 0.0), (2.0, 24.0)),),
            bearing_rest=(((0.0, 0.7),),),
        ),
        lambda t: 0.1 + t,
        lambda t: 0.7 + 12.0 * t / K_PITCH + oscillator(-0.5, -0.5 - 12.0 / K_PITCH, t, 0.0),
    ),
    "a step of the command between samples": (
        axial(0.0, 0.0, duration=2.0, bearing_rest=(((0.43, 0.0), (0.43, 0.3)),)),
        lambda t: 0.1 + t,
        lambda t: np.where(t < 0.43, 0.0, 0.3 + oscillator(-0.3, 0.0, t - 0.43)),
    ),
    **{f"torsion from {start:.1f} rad": torsion(start) for start in (0.7, -9.0, 3 * pi + 0.3)},
}


def bound_of(name, case):
    if case == "shaft damping" and name in CHAIN:
        # order 2 leaves λ³h²t/12, 1e-7; Newton's relative tolerance of 1e-8 on positions is 1e-8/h,
        # some 1e-5, on rates
        return 2e-5
    # Euler parameters turn too little by h²θ'³/12 a second: 1.7e-4 rad/s at 20 rad/s and 5e-4 s
    return 2e-4 if CASES[case][2] and name not in FINE else BOUND[name]


@pytest.mark.parametrize("case", CASES)
@every_method
def test_every_model_has_the_exact_motion(name, case) -> None:
    """And its energy, of which the work is integrated from rates alone, to the accuracy of the
    scheme."""
    (scene, rotor, pitch), bound = CASES[case], bound_of(name, case)
    got = run(name, scene)
    exact = np.tile(np.array(scene.initial_angles), (len(got.time), 1))
    exact[:, 0] = rotor(got.time)
    if pitch:
        exact[:, 1] = pitch(got.time)
    assert np.abs(got.angles - exact).max() < bound
    # an exact zero has nothing to grow from, though the equilibrium is unstable
    if not pitch and name not in CHAIN:
        assert np.array_equal(got.angles[:, 1:], exact[:, 1:])
        assert not got.rates[:, 1:].any()
    assert got.work[0] == 0.0
    assert energy_error(got) < bound * (got.kinetic_energy + np.abs(got.potential_energy)).max()


@pytest.mark.parametrize("name", EXUDYN)
def test_a_thousand_radians_a_second_are_counted_turn_by_turn(name) -> None:
    scene = make_scene([0.0, -50.0], [0.0, 1000.0], (AXIAL,), gravity=0.0, duration=1.0)
    # the rotation vector turns uniformly without error, and 5 rad a step; a turn missed would show
    # as 6.28 rad
    settings, bound = {}, 1e-6
    if name == "exudyn_chain/extrapolated":
        settings, bound = {"tolerance": 1e-9}, 1e-5  # of a hundred intervals, of 10 rad each
    elif name in CHAIN:
        settings = {"node": "rotation_vector", "step": 5e-3}
    got = run(name, scene, **settings)
    assert np.abs(got.angles[:, 1] - (-50.0 + 1000.0 * got.time)).max() < bound
    assert np.abs(got.rates[:, 1] - 1000.0).max() < bound


@every_method
def test_repeats_are_bit_identical(name) -> None:
    method = find_method(name)
    if not method.is_installed:
        pytest.skip(f"{name} is not installed")
    scene = make_scene(
        [0.3, 0.4], [1.0, 0.5], (STOUT,), duration=0.2, samples=21, rotor_torque=RAMP
    )
    solver = method.build(scene, method.settings())
    first_report, first = solver.integrate(), solver.observe()
    second_report, second = solver.integrate(), solver.observe()
    assert first_report == second_report
    for quantity in ("angles", "rates", "tip", "kinetic_energy", "potential_energy", "work"):
        assert np.array_equal(first.get(quantity), second.get(quantity)), quantity


# rad, of the scene with every load, at these settings.
ALL_LOADS_BOUND = {
    "lagrange/dop853": 1e-10,
    "lagrange/taylor": 1e-10,
    REFERENCE: 1e-10,
    "exudyn_tree/rk67": 1e-10,
    "exudyn_tree/rk44": 1e-9,
    "exudyn_tree/dopri5": 1e-9,
    "mujoco/rk4": 1e-9,
    "exudyn_chain/extrapolated": 1e-9,
    "exudyn_tree/generalized_alpha": 5e-5,
    "exudyn_chain/generalized_alpha": 5e-5,
    "exudyn_chain/newmark_index2": 5e-5,
    "lagrange/ode45": 1e-10,
    "lagrange/radau": 1e-10,
}
SETTINGS = {
    "lagrange/ode45": {"relative_tolerance": 1e-13, "absolute_tolerance": 1e-13},
    "lagrange/radau": {"relative_tolerance": 1e-12, "absolute_tolerance": 1e-14},
}
SLOW = ("lagrange/taylor", REFERENCE, "exudyn_chain/newmark_index2", "lagrange/radau")


@pytest.mark.parametrize(
    "method",
    [
        pytest.param(name, marks=pytest.mark.full) if name in SLOW else name
        for name in ALL_LOADS_BOUND
    ],
)
def test_every_load_at_once_follows_the_equations_written_anew(method: str) -> None:
    """Angles, tips, energies and work; those of low order to what their steps leave."""
    result, exact = run(method, MIXED, **SETTINGS.get(method, {})), closed_form(MIXED)
    bound = ALL_LOADS_BOUND[method]
    assert np.abs(result.angles - exact[:, :4]).max() < bound
    for i, blade in enumerate(MIXED.blades):
        assert (
            np.abs(result.tip[:, i] - blade_points(MIXED, exact, i, blade.tip)).max() < 10 * bound
        )
    kinetic, potential = energies(MIXED, exact)
    scale = np.abs(kinetic).max()
    assert np.abs(result.kinetic_energy - kinetic).max() < 10 * bound * scale
    assert np.abs(result.potential_energy - potential).max() < 10 * bound * scale
    balance = result.kinetic_energy + result.potential_energy - result.work
    assert np.abs(balance - balance[0]).max() < 10 * bound * scale
    own = kinematics.potential_energy(MIXED, result.time, result.angles)
    # its bodies leave the joints by some 1e-9 m
    gap = 1e-7 if method.startswith("exudyn_chain") else 1e-12
    assert np.abs(result.potential_energy - own).max() < gap * scale
