"""Loads against statics and dynamics done by hand: weights, centrifugal forces, gyroscopic moments, sums."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest
from support.rotors import make_scene
from support.scenes import general

from rotor_mbs.methods.solve import solve
from rotor_mbs.scenario.scene import Blade, Scene

LOADS = ("blade_root_force", "blade_root_moment", "shaft_force", "shaft_moment", "pitch_actuator_moment")
OUTPUTS = ("angles", "rates", "energy", "loads")
METHODS = ("lagrange/dop853", "reference")

# Of full inertia about principal axes, the centre of mass on the pitch axis: what it weighs and how it turns is plain.
MASS, ARM, GRAVITY = 200.0, 6.0, 9.81
MOMENTS = (900.0, 1000.0, 150.0)
BEAM = Blade(MASS, (0.0, 0.0, ARM), (*MOMENTS, 0.0, 0.0, 0.0), (0.0, 0.0, 12.0))


def beam(angles: tuple[float, ...], rates: tuple[float, ...], **changes) -> Scene:
    changes = {"gravity": GRAVITY, "duration": 0.2, "samples": 21, **changes}
    return make_scene(angles, rates, blades=(BEAM,) * (len(angles) - 1), outputs=OUTPUTS, **changes)


@pytest.fixture(params=METHODS)
def method(request: pytest.FixtureRequest) -> str:
    return request.param


def loads(method: str, scene: Scene):
    run = solve(method, scene, {}).trajectory
    assert len(run.time) == scene.samples
    return run


def test_hanging_blade_pulls_with_its_weight(method: str) -> None:
    """Straight down its own z axis points down: the hub pulls it up, along -z, and no moment acts."""
    run = loads(method, beam((math.pi, 0.0), (0.0, 0.0)))
    weight = MASS * GRAVITY
    assert np.abs(run.blade_root_force[:, 0] - [0.0, 0.0, -weight]).max() < 1e-9
    assert np.abs(run.blade_root_moment).max() < 1e-9
    assert np.abs(run.shaft_force - [0.0, 0.0, weight]).max() < 1e-9
    assert np.abs(run.shaft_moment).max() < 1e-9


def test_horizontal_blade_at_the_moment_of_its_release(method: str) -> None:
    """It falls with m g l / J; the root carries the rest of the weight, m g (1 - m l²/J), and no moment about y."""
    run = loads(method, beam((math.pi / 2, 0.0), (0.0, 0.0)))
    about_shaft = MOMENTS[1] + MASS * ARM**2
    rest = MASS * GRAVITY * (1.0 - MASS * ARM**2 / about_shaft)
    assert np.abs(run.shaft_force[0] - [0.0, 0.0, rest]).max() < 1e-9
    # The blade's x axis points down there.
    assert np.abs(run.blade_root_force[0, 0] - [-rest, 0.0, 0.0]).max() < 1e-9
    assert np.abs(run.shaft_moment).max() < 1e-8


def test_centrifugal_force_of_a_turning_rotor(method: str) -> None:
    """Without gravity every root pulls inwards with m l Ω²; two blades that balance leave nothing for the shaft."""
    speed = 3.0
    run = loads(method, beam((0.3, 0.0, 0.0), (speed, 0.0, 0.0), gravity=0.0))
    assert np.abs(run.blade_root_force - [0.0, 0.0, -MASS * ARM * speed**2]).max() < 1e-9
    assert np.abs(run.blade_root_moment).max() < 1e-9
    assert np.abs(run.shaft_force).max() < 1e-9
    one = loads(method, beam((0.3, 0.0), (speed, 0.0), gravity=0.0))
    angle = one.angles[:, 0]
    inwards = -np.stack([np.sin(angle), np.zeros_like(angle), np.cos(angle)], axis=1)
    assert np.abs(one.shaft_force - MASS * ARM * speed**2 * inwards).max() < 1e-9


def test_gyroscopic_moment_of_a_pitching_blade(method: str) -> None:
    """A blade that spins about its own axis in a turning rotor: the moment is Ω × L + what turns its tensor.

    With equal transverse moments A and polar moment C about the pitch axis, angular momentum about the hub centre is
    L = A' Ω e_y + C θ̇ e_z (A' with the mass at its arm), and only e_z turns, with Ω e_y × e_z = Ω e_x: the moment is
    C θ̇ Ω along the azimuth's x axis in the rotor, and none is left along the shaft.
    """
    speed, rate, C = 2.0, 5.0, 150.0
    blade = Blade(MASS, (0.0, 0.0, ARM), (900.0, 900.0, C, 0.0, 0.0, 0.0), (0.0, 0.0, 12.0))
    scene = make_scene((0.0, 0.4), (speed, rate), (blade,), gravity=0.0, duration=0.2, samples=21, outputs=OUTPUTS)
    run = loads(method, scene)
    pitch, azimuth = run.angles[:, 1], run.angles[:, 0]
    assert np.abs(run.rates - [speed, rate]).max() < 1e-12
    in_blade = C * speed * rate * np.stack([np.cos(pitch), -np.sin(pitch), np.zeros_like(pitch)], axis=1)
    in_base = C * speed * rate * np.stack([np.cos(azimuth), np.zeros_like(pitch), -np.sin(azimuth)], axis=1)
    assert np.abs(run.blade_root_moment[:, 0] - in_blade).max() < 1e-9
    assert np.abs(run.shaft_moment - in_base).max() < 1e-9


def test_roots_and_hub_add_up_to_the_shaft(method: str) -> None:
    """Σ R F is the bearing's force; Σ R M + J_hub dΩ/dt - torque its moment, along the shaft that of its damper.

    dΩ/dt from the stored rates, by differences of the sixth order.
    """
    scene = general(outputs=OUTPUTS, duration=0.5, samples=501)
    run = loads(method, scene)
    force, moment = np.zeros((2, scene.samples, 3))
    for i, phase in enumerate(scene.phases):
        frames = rotations(run.angles[:, 0] + phase, run.angles[:, 1 + i])
        force += np.einsum("nij,nj->ni", frames, run.blade_root_force[:, i])
        moment += np.einsum("nij,nj->ni", frames, run.blade_root_moment[:, i])
    assert np.abs(run.shaft_force - force).max() < 1e-12 * np.abs(force).max()
    weights = (-1 / 60, 3 / 20, -3 / 4, 0.0, 3 / 4, -3 / 20, 1 / 60)
    spin = run.rates[:, 0]
    change = sum(w * spin[k : len(spin) - 6 + k] for k, w in enumerate(weights)) / (run.time[1] - run.time[0])
    torque = np.array([scene.torque_at(t) for t in run.time])
    moment[3:-3, 1] += scene.hub_inertia * change - torque[3:-3]
    off = np.abs(run.shaft_moment - moment)[3:-3].max()
    assert off < 1e-9 * np.abs(moment).max()
    assert np.abs(run.shaft_moment[:, 1] + scene.shaft_damping * spin).max() < 1e-12 * np.abs(moment).max()


def test_actuator_moment_is_the_moment_about_the_pitch_axis(method: str) -> None:
    """Spring and damper are all that turns a blade about its own axis: Euler's law must give their moment."""
    run = loads(method, general(outputs=OUTPUTS, duration=0.5, samples=51))
    scale = np.abs(run.blade_root_moment).max()
    assert np.abs(run.pitch_actuator_moment).max() > 1e-3 * scale
    assert np.abs(run.blade_root_moment[:, :, 2] - run.pitch_actuator_moment).max() < 1e-12 * scale


def rotations(azimuth, pitch):
    """(n, 3, 3) Ry(azimuth) Rz(pitch)."""
    s, c, sp, cp = np.sin(azimuth), np.cos(azimuth), np.sin(pitch), np.cos(pitch)
    zero = np.zeros_like(s)
    rows = [[c * cp, -c * sp, s], [sp, cp, zero], [-s * cp, s * sp, c]]
    return np.moveaxis(np.array(rows), 2, 0)


def test_asking_for_loads_changes_nothing_else() -> None:
    scene = general(duration=0.5, samples=51)
    plain = solve("lagrange/taylor", scene, {}).trajectory
    asked = solve("lagrange/taylor", replace(scene, outputs=(*scene.outputs, "loads")), {}).trajectory
    assert not set(LOADS) & set(plain.quantities)
    for name, values in {"angles": plain.angles, "rates": plain.rates, **plain.quantities}.items():
        assert values.tobytes() == asked.get(name).tobytes(), name
    assert all(asked.get(name) is not None for name in LOADS)
