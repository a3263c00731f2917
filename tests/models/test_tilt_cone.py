"""Rotors with a tilted shaft and coned blades: Newton's and Euler's laws, exact solutions, what
rests by symmetry."""

from __future__ import annotations

import functools
import math
from dataclasses import replace
from math import pi
from typing import Any

import numpy as np
import pytest
from scipy.integrate import solve_ivp
from support.newton_euler import State, measure, turn
from support.other_code import pendulum
from support.random_scenes import leaning_scene
from support.scenes import AXIAL, STOUT, general, make_scene

from rotor_mbs.analysis.judgement import judge
from rotor_mbs.analysis.kinematics import exact_rotor_angle
from rotor_mbs.methods.catalogue import find_method
from rotor_mbs.methods.selection import singular_reason
from rotor_mbs.methods.solve import solve
from rotor_mbs.models.exudyn import linearization as exudyn_linearization
from rotor_mbs.models.lagrange import closed_form, hamilton, linearization, samples
from rotor_mbs.models.lagrange.ensemble import solve_many
from rotor_mbs.models.lagrange.floquet import periodic_turn
from rotor_mbs.models.lagrange.hamilton import resting_pitches
from rotor_mbs.models.lagrange.parameters import rotor_form
from rotor_mbs.models.lagrange.samples import loads_at_start
from rotor_mbs.scenario.scene import Scene

Array = Any
FORCES = ("blade_root_force", "shaft_force")
MOMENTS = ("blade_root_moment", "shaft_moment", "pitch_actuator_moment")
# Three unlike blades of full inertia on springs, with cones of their own.
LEANING = general(shaft_tilt=-0.3, hub_radius=0.4, hub_mass=200.0)
LEANING = replace(
    LEANING,
    blades=tuple(
        replace(blade, cone=cone)
        for blade, cone in zip(LEANING.blades, (0.2, -0.1, 0.35), strict=True)
    ),
)


def random_state(scene: Scene, seed: int) -> tuple[Array, Array]:
    rng = np.random.default_rng([7, seed])
    count = 1 + len(scene.blades)
    return rng.uniform(-pi, pi, count), rng.uniform(-2.0, 2.0, count)


def by_closed_form(scene: Scene, angles: Array, rates: Array) -> Array:
    form, loads = rotor_form(scene), loads_at_start(scene, scene.torque_at(0.0))
    return np.array(closed_form.accelerations(angles, rates, form, loads, math.sin, math.cos))


def assert_loads_are(
    computed: dict[str, Array], expected: State, scene: Scene, share: float
) -> None:
    """Compare with a share of the largest force, and for moments of that at the farthest centre of
    mass."""
    force = max(np.abs(expected.loads[name]).max() for name in FORCES)
    arm = max(math.hypot(*blade.centre_of_mass) for blade in scene.blades)
    for name in FORCES:
        np.testing.assert_allclose(
            computed[name], expected.loads[name], rtol=0.0, atol=share * force, err_msg=name
        )
    for name in MOMENTS:
        allowed = share * force * arm
        np.testing.assert_allclose(
            computed[name], expected.loads[name], rtol=0.0, atol=allowed, err_msg=name
        )


# Newton's and Euler's laws


@pytest.mark.parametrize("blades", range(1, 6))
def test_the_closed_form_obeys_newtons_and_eulers_laws(blades: int) -> None:
    """To 1e-12 of the largest acceleration: rounding, and what the mass matrices amplify of it."""
    for seed in range(20):
        scene = leaning_scene(seed, blades if seed % 2 else 0)
        angles, rates = random_state(scene, seed)
        expected = measure(scene, angles, rates)
        largest = np.abs(expected.accelerations).max()
        np.testing.assert_allclose(
            by_closed_form(scene, angles, rates),
            expected.accelerations,
            rtol=0.0,
            atol=1e-12 * largest,
        )
        trajectory = samples.trajectory(
            scene, np.zeros(1), np.concatenate([angles, rates])[None, :]
        )
        weight = (
            sum(blade.mass * math.hypot(*blade.centre_of_mass) for blade in scene.blades)
            * scene.gravity
        )
        energies = (
            trajectory.quantities["kinetic_energy"][0],
            trajectory.quantities["potential_energy"][0],
        )
        assert energies[0] == pytest.approx(expected.kinetic, rel=1e-12)
        assert energies[1] == pytest.approx(expected.potential, rel=1e-12, abs=1e-12 * weight)
        np.testing.assert_allclose(
            trajectory.tip[0], expected.tips, rtol=0.0, atol=1e-12 * np.abs(expected.tips).max()
        )
        loads = {name: trajectory.quantities[name][0] for name in (*FORCES, *MOMENTS)}
        assert_loads_are(loads, expected, scene, 1e-12)


def test_momenta_are_the_closed_forms_and_their_forces_those_of_its_accelerations() -> None:
    angles, rates = random_state(LEANING, 1)
    form, loads = rotor_form(LEANING), loads_at_start(LEANING)
    trigonometry = np.sin, np.cos
    momenta = hamilton.momenta(angles, rates, form, *trigonometry)
    np.testing.assert_allclose(
        hamilton.rates(angles, momenta, form, *trigonometry), rates, rtol=1e-12, atol=1e-12
    )
    # dp/dt by an imaginary step along the motion.
    step = 1e-30j
    accelerations = by_closed_form(LEANING, angles, rates)
    moved = hamilton.momenta(
        angles + step * rates, rates + step * accelerations, form, *trigonometry
    )
    forces = np.array(hamilton.forces(angles, rates, form, loads, *trigonometry))
    np.testing.assert_allclose(
        np.imag(moved) / 1e-30, forces, rtol=0.0, atol=1e-12 * np.abs(forces).max()
    )


# Motions


def oracle(scene: Scene, duration: float, times: Array | None = None) -> Array:
    """Return (n, 2 (1 + blades)) angles and rates by SciPy from Newton's and Euler's laws."""
    count = 1 + len(scene.blades)

    def derivative(t: float, y: Array) -> Array:
        return np.concatenate([y[count:], measure(scene, y[:count], y[count:], t).accelerations])

    start = np.array([*scene.initial_angles, *scene.initial_rates])
    return solve_ivp(
        derivative, (0.0, duration), start, "DOP853", times, rtol=1e-11, atol=1e-12
    ).y.T


@functools.cache
def short_motion() -> tuple[Scene, Array]:
    scene = replace(
        LEANING, duration=0.5, samples=26, outputs=("angles", "rates", "tip", "energy", "loads"),
        rotor_torque=((0.0, 500.0),),
    )  # fmt: skip
    return scene, oracle(scene, 0.5, np.linspace(0.0, 0.5, 26))


def skip_if_missing(method: str) -> None:
    if not find_method(method).is_installed:
        pytest.skip(f"{method} is not installed")


# rad, of the angles, and as a share what energies, tips and loads may differ at the run's own
# state. The oracle's tolerance is 1e-11; the chain's tips leave by its joints' gaps, its loads are
# multipliers (docs/loads.md).
CHAIN = "exudyn_chain/extrapolated"
ACCURACY = {
    "lagrange/taylor": (1e-10, 1e-12),
    "lagrange/dop853": (1e-10, 1e-12),
    "reference": (1e-10, 1e-12),
    "exudyn_tree/rk67": (1e-10, 1e-12),
    CHAIN: (1e-9, 1e-9),
    "mujoco/rk4": (1e-10, 1e-12),
}
CHAIN_LOADS = 1e-5
# One of each model; the others carry the mark full.
QUICK = ("lagrange/dop853", "exudyn_tree/rk67", "mujoco/rk4")


@pytest.mark.parametrize(
    "method",
    [name if name in QUICK else pytest.param(name, marks=pytest.mark.full) for name in ACCURACY],
)
def test_a_motion_has_the_angles_energies_tips_and_loads_of_newtons_and_eulers_laws(
    method: str,
) -> None:
    skip_if_missing(method)
    scene, exact = short_motion()
    allowed, share = ACCURACY[method]
    run = solve(method, scene, {}).trajectory
    count = 1 + len(scene.blades)
    np.testing.assert_allclose(run.angles, exact[:, :count], rtol=0.0, atol=allowed)
    np.testing.assert_allclose(run.rates, exact[:, count:], rtol=0.0, atol=100.0 * allowed)
    potential = run.quantities["potential_energy"]
    size = np.abs(potential).max()
    assert (
        np.ptp(run.quantities["kinetic_energy"] + potential - run.quantities["work"])
        <= share * size
    )
    for row in (0, 13, 25):
        expected = measure(scene, run.angles[row], run.rates[row])
        assert run.quantities["kinetic_energy"][row] == pytest.approx(expected.kinetic, rel=share)
        assert potential[row] == pytest.approx(expected.potential, abs=share * size)
        loads = {name: run.quantities[name][row] for name in (*FORCES, *MOMENTS)}
        assert_loads_are(loads, expected, scene, CHAIN_LOADS if method == CHAIN else share)
        np.testing.assert_allclose(
            run.tip[row], expected.tips, rtol=0.0, atol=share * np.abs(expected.tips).max()
        )


@pytest.mark.full
@pytest.mark.parametrize(
    ("method", "order"), [("exudyn_chain/newmark_index2", 2), ("exudyn_tree/rk44", 4)]
)
def test_the_order_of_convergence_is_that_of_upright_rotors(method: str, order: int) -> None:
    scene, exact = short_motion()
    scene = replace(scene, outputs=("angles", "rates"))
    errors = []
    for step in (0.01, 0.005, 0.0025):
        run = solve(method, scene, {"step": step}).trajectory
        errors.append(np.abs(run.angles - exact[:, :4]).max())
    orders = np.log2(np.array(errors[:-1]) / errors[1:])
    assert orders == pytest.approx(order, abs=0.2)


@pytest.mark.parametrize(
    "method",
    [
        "lagrange/dop853",
        "exudyn_tree/rk67",
        pytest.param(CHAIN, marks=pytest.mark.full),
        "mujoco/rk4",
    ],
)
def test_blades_without_pitch_inertia_lean_with_the_hub(method: str) -> None:
    """A coned rod on its pitch axis, fixed to the hub, between blades that pitch."""
    skip_if_missing(method)
    rod = replace(AXIAL, inertia=(12.0, 12.0, 0.0, 0.0, 0.0, 0.0), cone=0.3)
    scene = make_scene(
        [0.4, 0.2, 0.5, -0.1],
        [1.0, 0.3, 0.0, 0.2],
        (replace(STOUT, cone=-0.2), rod, STOUT),
        shaft_tilt=0.2,
        hub_radius=0.5,
        hub_mass=9.0,
        duration=0.2,
        samples=11,
        outputs=("angles", "rates", "tip", "energy", "loads"),
    )
    run = solve(method, scene, {}).trajectory
    share = 1e-5 if method == CHAIN else 1e-12
    for row in (0, 10):
        expected = measure(scene, run.angles[row], run.rates[row])
        loads = {name: run.quantities[name][row] for name in (*FORCES, *MOMENTS)}
        assert_loads_are(loads, expected, scene, share)
        np.testing.assert_allclose(run.tip[row], expected.tips, rtol=0.0, atol=1e-8)
        weight = AXIAL.mass * 9.8 * 3.0
        assert run.quantities["potential_energy"][row] == pytest.approx(
            expected.potential, abs=1e-8 * weight
        )
    exact = solve("lagrange/dop853", scene, {}).trajectory
    np.testing.assert_allclose(run.angles, exact.angles, rtol=0.0, atol=1e-9)


@pytest.mark.full
def test_a_batch_of_leaning_and_upright_rotors_gives_the_runs_of_each() -> None:
    """In momenta: the same motion to the rounding of another text of the equations."""
    pytest.importorskip("heyoka")
    outputs = ("angles", "rates", "tip", "energy")
    leaning = replace(LEANING, duration=0.5, samples=11, outputs=outputs)
    others = (
        replace(leaning, shaft_tilt=0.1),
        replace(general(outputs=outputs, duration=0.5, samples=11)),
    )
    scenes = [leaning, *others]
    block = solve_many(scenes, 2.0**-52)
    for i, scene in enumerate(scenes):
        alone = solve("lagrange/taylor", scene, {}).trajectory
        for name, values in block.quantities.items():
            expected = (
                getattr(alone, name) if name in ("angles", "rates") else alone.quantities[name]
            )
            np.testing.assert_allclose(
                values[i], expected, rtol=1e-11, atol=1e-11 * np.abs(expected).max()
            )


@pytest.mark.parametrize("speed", [0.0, 1.2])
def test_closed_form_tree_chain_and_mujoco_have_the_same_linearization(speed: float) -> None:
    gravity = 0.0 if speed else LEANING.gravity
    scene = replace(
        LEANING, gravity=gravity, bearing_damping=(30.0, 20.0, 10.0), shaft_damping=50.0
    )
    state = (
        linearization.steady_rotation(scene, speed) if speed else linearization.equilibrium(scene)
    )
    torque = linearization.holding_torque(scene, speed)
    ours = linearization.linearize(scene, state, [speed, 0.0, 0.0, 0.0], torque)
    others = [exudyn_linearization.linearize_tree(scene, state, speed, torque)]
    if not speed:
        others.append(exudyn_linearization.linearize_chain(scene, state, 0.0, 0.0))
    mujoco = find_method("mujoco/rk4")
    if mujoco.is_installed:
        others.append(mujoco.linearize(scene, state, speed, torque))
    # Extrapolated difference quotients of the engines.
    for other in others:
        np.testing.assert_allclose(
            other.stiffness, ours.stiffness, atol=1e-8 * np.abs(ours.stiffness).max()
        )
        np.testing.assert_allclose(
            other.damping, ours.damping, atol=1e-8 * max(1.0, np.abs(ours.damping).max())
        )


def test_derivatives_of_the_closed_form_are_those_of_newtons_and_eulers_laws() -> None:
    angles, rates = np.array([0.4, 0.7, -1.1, 2.0]), np.array([1.3, -0.4, 0.9, 0.2])
    result = linearization.linearize(LEANING, angles, rates, 0.0)
    start = np.concatenate([angles, rates])
    for k in range(8):
        step = np.zeros(8)
        step[k] = 1e-3
        change = np.zeros(4)
        # Of the sixth order: weights 45, -9, 1 over 60.
        for j, weight in ((1, 45.0), (2, -9.0), (3, 1.0)):
            for sign in (1.0, -1.0):
                moved = start + sign * j * step
                change += sign * weight * measure(LEANING, moved[:4], moved[4:]).accelerations
        column = (result.stiffness if k < 4 else result.damping)[:, k % 4]
        np.testing.assert_allclose(column, -change / (60.0 * 1e-3), rtol=1e-9, atol=1e-9)


@pytest.mark.full
def test_the_periodic_motion_of_a_leaning_rotor_repeats_itself_by_newtons_and_eulers_laws() -> None:
    pytest.importorskip("heyoka")
    scene = replace(LEANING, bearing_damping=(30.0, 20.0, 10.0))
    turn = periodic_turn(scene, 2.0)
    assert not turn.message
    start = replace(
        scene, rotor_torque=((0.0, turn.torque),),
        initial_angles=tuple(turn.start[:4].tolist()), initial_rates=tuple(turn.start[4:].tolist()),
    )  # fmt: skip
    end = oracle(start, pi)[-1]
    np.testing.assert_allclose(end - turn.start, [2.0 * pi, *[0.0] * 7], atol=1e-8)


# Exact solutions


def uniform_rotation(method: str) -> tuple[Scene, Any]:
    """A coned rotor without gravity and springs, its blades symmetric about the plane through shaft
    and pitch axis."""
    blade = replace(
        STOUT,
        centre_of_mass=(0.0, -0.2, 4.0),
        inertia=(30.0, 40.0, 25.0, 0.0, 0.0, -4.0),
        cone=-0.2,
    )
    scene = make_scene(
        [0.3, 0, 0, 0],
        [1.5, 0, 0, 0],
        (blade,) * 3,
        gravity=0.0,
        shaft_tilt=0.1,
        duration=1.0,
        samples=21,
        outputs=("angles", "rates", "tip", "energy", "loads"),
    )
    return scene, solve(method, scene, {}).trajectory


METHODS = (
    "lagrange/taylor",
    "exudyn_tree/rk67",
    pytest.param(CHAIN, marks=pytest.mark.full),
    "mujoco/rk4",
)
# Loads of the exact solutions, of the largest force.
LOADS_SHARE = {CHAIN: 1e-6}


@pytest.mark.parametrize("method", METHODS)
def test_a_coned_rotor_turns_uniformly_without_gravity_and_springs(method: str) -> None:
    skip_if_missing(method)
    scene, run = uniform_rotation(method)
    blade, speed = scene.blades[0], 1.5
    expected = np.zeros((21, 4))
    expected[:, 0] = 0.3 + speed * run.time
    np.testing.assert_allclose(run.angles, expected, rtol=0.0, atol=1e-9)
    # The centre of mass moves on a circle about the shaft, the tip too.
    _, y, z = blade.centre_of_mass
    distance = z * math.cos(blade.cone) - y * math.sin(blade.cone)
    force = blade.mass * speed**2 * distance
    # in the blade's axes, its pitch being zero
    inward = [0.0, math.sin(blade.cone), -math.cos(blade.cone)]
    allowed = LOADS_SHARE.get(method, 1e-8) * force
    np.testing.assert_allclose(
        run.quantities["blade_root_force"],
        force * np.broadcast_to(inward, (21, 3, 3)),
        rtol=0.0,
        atol=allowed,
    )
    np.testing.assert_allclose(run.quantities["shaft_force"], 0.0, atol=allowed)
    tip_x, tip_y, tip_z = blade.tip
    along = tip_y * math.cos(blade.cone) + tip_z * math.sin(blade.cone)
    radial = tip_z * math.cos(blade.cone) - tip_y * math.sin(blade.cone)
    azimuth = expected[:, :1] + np.array(scene.phases)
    x = tip_x * np.cos(azimuth) + radial * np.sin(azimuth)
    up = radial * np.cos(azimuth) - tip_x * np.sin(azimuth)
    c, s = math.cos(0.1), math.sin(0.1)
    path = np.stack([x, c * along - s * up, s * along + c * up], axis=-1)
    np.testing.assert_allclose(run.tip, path, rtol=0.0, atol=1e-8)


@pytest.mark.parametrize("method", METHODS)
@pytest.mark.parametrize(("tilt", "cone"), [(0.4, 0.0), (-0.25, 0.3)])
def test_a_blade_on_a_tilted_shaft_is_a_pendulum(method: str, tilt: float, cone: float) -> None:
    """Gravity's part across the shaft is g cos(tilt); a coned point mass turns at d cos(cone) from
    the shaft.

    Without cone a blade on its pitch axis with full inertia; with cone a point mass, whose pitch is
    no coordinate.
    """
    skip_if_missing(method)
    blade, inertia = AXIAL, AXIAL.inertia[1] + AXIAL.mass * 9.0
    if cone:
        blade = replace(AXIAL, inertia=(0.0,) * 6, cone=cone)
        inertia = AXIAL.mass * (3.0 * math.cos(cone)) ** 2
    scene = make_scene(
        [2.0, 0.0], [0.0, 0.0], (blade,), gravity=9.81, shaft_tilt=tilt, duration=2.0, samples=41
    )
    run = solve(method, scene, {}).trajectory
    length = inertia / (blade.mass * 3.0 * math.cos(cone))
    exact = pendulum(2.0, length, 0.0, 9.81 * math.cos(tilt), run.time)
    np.testing.assert_allclose(run.angles[:, 0], exact, rtol=0.0, atol=1e-9)
    # The chain controls the error of an interval to its tolerance; out of the plane it is not zero.
    allowed = find_method(CHAIN).defaults["tolerance"] if method == CHAIN else 1e-12
    assert np.abs(run.angles[:, 1]).max() <= allowed
    name, known = exact_rotor_angle(scene, run.time)
    assert name == "pendulum"
    np.testing.assert_allclose(known, exact, rtol=0.0, atol=1e-13)


# What rests by symmetry


SYMMETRIC = make_scene(
    [0.3, 0, 0, 0], [1.0, 0, 0, 0], duration=0.5, samples=11, outputs=("angles", "rates")
)


def leaning(scene: Scene, tilt: float, cone: float, **changes: Any) -> Scene:
    blades = tuple(replace(blade, cone=cone) for blade in scene.blades)
    return replace(scene, shaft_tilt=tilt, blades=blades, **changes)


@pytest.mark.parametrize(
    ("scene", "rests"),
    {
        "upright": (SYMMETRIC, True),
        "tilt turns the weight about the pitch axis": (leaning(SYMMETRIC, 0.1, 0.0), False),
        "tilt without gravity": (leaning(SYMMETRIC, 0.1, 0.0, gravity=0.0), True),
        "cone": (leaning(SYMMETRIC, 0.0, 0.1), False),
        "cone without gravity": (leaning(SYMMETRIC, 0.0, 0.1, gravity=0.0), False),
        "tilt of blades on their axes": (leaning(replace(SYMMETRIC, blades=(AXIAL,) * 3), 0.3, 0.0), True),
        # A rotor that is sped up takes its coned blades along about their axes.
        "cone of blades on their axes": (
            leaning(replace(SYMMETRIC, blades=(AXIAL,) * 3), 0.0, 0.3, rotor_torque=((0.0, 100.0),)), False
        ),
        "shaft upright": (leaning(SYMMETRIC, 0.5 * pi, 0.0), False),
    }.values(),
)  # fmt: skip
def test_pitches_at_rest_by_symmetry_are_those_that_stay_exactly_zero(
    scene: Scene, rests: bool
) -> None:
    """And only of them an exact solution is known to `check`."""
    assert (exact_rotor_angle(scene, np.zeros(1)) is not None) == rests
    assert resting_pitches(scene) == ((1, 2, 3) if rests else ())
    run = solve("lagrange/dop853", scene, {}).trajectory
    assert run.angles[:, 1:].any() == (not rests)


# Planted faults, each in the motion or the loads of every model


def about_pitch_axis(scene: Scene) -> Scene:
    """Return the rotor whose blades were turned about their pitch axes in place of being coned."""
    blades = []
    for blade in scene.blades:
        R = turn(2, blade.cone)
        tensor = R @ blade.inertia_tensor @ R.T
        elements = tensor[[0, 1, 2, 0, 0, 1], [0, 1, 2, 1, 2, 2]]
        centre = R @ blade.centre_of_mass
        blades.append(
            replace(blade, cone=0.0, centre_of_mass=tuple(centre), inertia=tuple(elements))
        )
    return replace(scene, blades=tuple(blades))


def with_cones(scene: Scene, factor: float) -> Scene:
    return replace(
        scene, blades=tuple(replace(blade, cone=factor * blade.cone) for blade in scene.blades)
    )


WRONG = {
    "tilt of the other sign": lambda scene: replace(scene, shaft_tilt=-scene.shaft_tilt),
    "cone of the other sign": lambda scene: with_cones(scene, -1.0),
    "cone about the pitch axis": about_pitch_axis,
    "gravity along the rotor's plane": lambda scene: replace(scene, shaft_tilt=0.0),
}
MODELS = (
    "lagrange/dop853",
    "exudyn_tree/rk67",
    pytest.param(CHAIN, marks=pytest.mark.full),
    "mujoco/rk4",
)
# As real rotors have them: 5 and 2.5 degrees.
REAL = replace(
    LEANING, shaft_tilt=math.radians(5.0), duration=0.2, samples=11,
    blades=tuple(replace(blade, cone=math.radians(2.5)) for blade in LEANING.blades),
)  # fmt: skip


@pytest.mark.parametrize("method", MODELS)
def test_a_fault_in_the_motion_is_seen_by_the_defects_of_every_model(method: str) -> None:
    skip_if_missing(method)
    scene = replace(REAL, outputs=("angles", "rates"))
    assert judge(scene, solve(method, scene, {}), None).status == "ok"
    for fault, wrong in WRONG.items():
        verdict = judge(scene, solve(method, wrong(scene), {}), None)
        assert (verdict.status, verdict.message[:6]) == ("inaccurate", "defect"), fault


@pytest.mark.parametrize("method", MODELS)
def test_a_fault_in_tips_energies_or_loads_is_seen_in_every_model(method: str) -> None:
    """Of a right motion: tips, energies and loads of another geometry, loads of no hub."""
    skip_if_missing(method)
    scene = replace(REAL, outputs=("angles", "rates", "tip", "energy", "loads"))
    run = solve(method, scene, {})
    right = dict(run.trajectory.quantities)
    verdict = judge(scene, run, None)
    assert verdict.status == "ok", verdict.message
    faults = WRONG | {
        "cone left out": lambda scene: with_cones(scene, 0.0),
        "hub without weight": lambda scene: replace(scene, hub_mass=0.0),
        "roots at the apex": lambda scene: replace(scene, hub_radius=0.0),
    }
    for fault, wrong in faults.items():
        other = wrong(scene)
        states = [
            measure(other, *state)
            for state in zip(run.trajectory.angles, run.trajectory.rates, strict=True)
        ]
        planted = {
            "loads": {
                name: np.array([state.loads[name] for state in states])
                for name in (*FORCES, *MOMENTS)
            },
            "tip": {"tip": np.array([state.tips for state in states])},
            "energies": {"potential_energy": np.array([state.potential for state in states])},
        }
        for output, arrays in planted.items():
            if output != "loads" and fault in ("hub without weight", "roots at the apex"):
                continue
            run.trajectory.quantities = right | arrays
            assert judge(scene, run, None).status == "inaccurate", (fault, output)
    run.trajectory.quantities = right
    assert judge(scene, run, None).status == "ok"


def test_the_selection_rule_knows_that_tilt_and_cone_turn_a_pitch_to_where_the_rotor_is_singular() -> (
    None
):
    """One point-mass blade on a hub without inertia stays at a pitch of zero on an upright rotor
    alone."""
    one = make_scene([2.0, 0.0], [0.0, 0.0], duration=0.5, samples=11)
    assert singular_reason(one) == ""
    for scene in (leaning(one, 0.1, 0.0), leaning(one, 0.0, 0.1)):
        assert "the mass matrix is singular at a pitch of ±π/2" in singular_reason(scene)
        assert solve("lagrange/dop853", scene, {}).trajectory.angles[1:, 1].all()
    assert singular_reason(leaning(replace(one, gravity=0.0), 0.1, 0.0)) == ""
