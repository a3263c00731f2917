"""The Campbell diagram of rotors whose frequencies are known, and whirl seen in the nonlinear
model's motion."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest
from support.runs import run
from support.scenes import AXIAL, general, make_scene

import rotor_mbs as rm
from rotor_mbs.analysis.modes import campbell_table, mode_summary, read_modes, to_records
from rotor_mbs.analysis.whirl import FixedFrame
from rotor_mbs.report.files import render
from rotor_mbs.report.pages.modes import modes_page
from rotor_mbs.runs.read import write_records
from rotor_mbs.scenario.scene import Scene
from rotor_mbs.studies.modes import compute_modes

# The centre of mass on the pitch axis and no products of inertia: at the pitch 0 nothing but a cone
# couples the pitch to the rotor.
BLADE = replace(AXIAL, inertia=(10.0, 13.0, 7.0, 0.0, 0.0, 0.0))
STIFFNESS, HUB, SPEED = 175.0, 300.0, 1.3
JXX, JYY, JZZ = 10.0 + 50.0 * 9.0, 13.0 + 50.0 * 9.0, 7.0


def equal_rotor(blades: int = 3, speed: float = SPEED, cone: float = 0.0, **changes) -> Scene:
    """Equal blades on equal springs, whose pitches are 0."""
    return make_scene(
        [0.0] * (1 + blades),
        [speed, *[0.0] * blades],
        (replace(BLADE, cone=cone),) * blades,
        hub_inertia=HUB,
        bearing_stiffness=(STIFFNESS,) * blades,
        **{"gravity": 0.0} | changes,
    )


def frame_of(scene: Scene, speeds: list[float]) -> FixedFrame:
    """The motions in both frames by the closed form, with which the other models agree."""
    found = compute_modes(scene, speeds)
    assert found.agrees
    assert len(found.rotation) >= 2
    frames = [linear.fixed_frame for linear in found.rotation.values()]
    for other in frames[1:]:
        assert isinstance(other, FixedFrame)
        assert other.names == frames[0].names
        np.testing.assert_allclose(other.fixed, frames[0].fixed, atol=1e-7)
    return frames[0]


def test_decoupled_blades_whirl_at_the_frequency_less_and_more_the_speed():
    """θ̈ Jzz + (k + Ω² (Jyy - Jxx)) θ = 0 of each blade alone."""
    speeds = np.array([-SPEED, 0.0, SPEED, 9.0])  # at 9 rad/s the rotor is faster than the wave
    frame = frame_of(equal_rotor(), speeds.tolist())
    assert frame.names == ("rotor", "collective pitch", "backward whirl", "forward whirl")
    omega = np.sqrt((STIFFNESS + speeds**2 * (JYY - JXX)) / JZZ)
    for motion in (1, 2, 3):
        np.testing.assert_allclose(frame.rotating[:, motion], omega, rtol=1e-12)
    carried = np.abs(speeds)
    assert omega[-1] < carried[-1]
    expected = np.column_stack([0.0 * omega, omega, np.abs(omega - carried), omega + carried])
    np.testing.assert_allclose(frame.fixed, expected, rtol=1e-12)
    assert frame.rotor_share[:, 2:].max() < 1e-12


def test_a_cone_moves_the_curves_and_couples_the_collective_pitch_to_the_rotor():
    """Of a blade alone Jzz θ̈ + (k + Ω² cos²β (Jyy - Jxx)) θ = 0; the collective pitch turns the
    free rotor by B = sin β Jzz of each blade, so that Jzz is less by 3 B² over the inertia."""
    cone, speeds = 0.4, np.array([0.0, 3.0, 6.0])
    frame = frame_of(equal_rotor(cone=cone), speeds.tolist())
    stiffness = STIFFNESS + speeds**2 * math.cos(cone) ** 2 * (JYY - JXX)
    for motion in (2, 3):
        np.testing.assert_allclose(frame.rotating[:, motion], np.sqrt(stiffness / JZZ), rtol=1e-12)
    B = math.sin(cone) * JZZ
    inertia = HUB + 3.0 * (math.cos(cone) ** 2 * JYY + math.sin(cone) ** 2 * JZZ)
    collective = np.sqrt(stiffness / (JZZ - 3.0 * B**2 / inertia))
    np.testing.assert_allclose(frame.rotating[:, 1], collective, rtol=1e-12)
    np.testing.assert_allclose(frame.fixed[:, 1], collective, rtol=1e-12)
    np.testing.assert_allclose(frame.rotor_share[:, 1], 3.0 * B / inertia, rtol=1e-12)


def test_a_tilt_moves_what_gravity_does_and_nothing_of_the_rotation_without_it():
    tilt = 0.6
    hanging = make_scene(
        [math.pi, 0.0], [0.0, 0.0], (BLADE,), gravity=9.81, hub_inertia=HUB,
        bearing_stiffness=(STIFFNESS,),
    )  # fmt: skip
    for angle in (0.0, tilt):
        found = compute_modes(replace(hanging, shaft_tilt=angle))
        assert found.agrees
        frequency = math.sqrt(50.0 * 9.81 * 3.0 * math.cos(angle) / (JYY + HUB))
        rest = found.rest["lagrange"].damped_frequencies[0]
        assert np.abs(rest - frequency).min() < 1e-12
    level = equal_rotor(cone=0.2)
    frames = [frame_of(replace(level, shaft_tilt=angle), [SPEED]) for angle in (0.0, tilt)]
    np.testing.assert_array_equal(frames[0].fixed, frames[1].fixed)


@pytest.mark.parametrize("direction", ["forward", "backward"])
@pytest.mark.parametrize(
    ("method", "blades", "diameter", "speed"),
    [
        ("lagrange/dop853", 3, 1, SPEED),
        ("lagrange/dop853", 3, 1, -SPEED),
        ("lagrange/dop853", 5, 2, SPEED),
        ("exudyn_tree/rk67", 3, 1, SPEED),
    ],
)
def test_the_nonlinear_motion_whirls_in_the_fixed_frame(method, blades, diameter, speed, direction):
    """Blade i has the pitch a cos(ωt - nψ_i), n > 0 where the wave runs to larger azimuths. Of the
    multiblade coordinates at the azimuths of the blades, the vector (cosine, sine) goes round.

    Allowed is the square of the amplitude, by which the motion is not linear.
    """
    amplitude = 1e-4
    scene = equal_rotor(blades, speed, cone=0.2, duration=8.0, samples=801, outputs=("angles",))
    frame = frame_of(scene, [speed])
    suffix = f" {diameter}" if diameter > 1 else ""
    place = frame.names.index(f"{direction} whirl{suffix}")
    omega = frame.rotating[0, place]
    psi = np.array(scene.phases)
    wave = diameter * math.copysign(1.0, speed) * (1.0 if direction == "forward" else -1.0)
    started = replace(
        scene,
        initial_angles=(0.0, *(amplitude * np.cos(wave * psi)).tolist()),
        initial_rates=(speed, *(amplitude * omega * np.sin(wave * psi)).tolist()),
    )
    motion = run(method, started)
    azimuths = motion.angles[:, :1] + psi
    # cosine + j sine
    vector = (motion.angles[:, 1:] * np.exp(1j * diameter * azimuths)).sum(axis=1) * 2.0 / blades
    assert np.abs(np.abs(vector) - amplitude).max() < 1e-3 * amplitude
    phase = np.unwrap(np.angle(vector))
    turning = (phase[-1] - phase[0]) / (motion.time[-1] - motion.time[0])
    assert abs(turning) == pytest.approx(frame.fixed[0, place], rel=10.0 * amplitude**2)
    # Here the rotor is slower than the wave: it goes round the way the wave runs.
    assert math.copysign(1.0, turning) == math.copysign(1.0, wave)


def mirrored(scene: Scene) -> Scene:
    """The rotor in a mirror across the shaft's vertical plane: it turns the other way, its blades
    follow in the opposite order."""
    order = [0, *range(len(scene.blades) - 1, 0, -1)]
    blades = []
    for i in order:
        blade = scene.blades[i]
        x, y, z = blade.centre_of_mass
        xx, yy, zz, xy, xz, yz = blade.inertia
        blades.append(replace(blade, centre_of_mass=(-x, y, z), inertia=(xx, yy, zz, -xy, -xz, yz)))
    rest = tuple(tuple((time, -angle) for time, angle in scene.bearing_rest[i]) for i in order)
    return replace(
        scene,
        blades=tuple(blades),
        bearing_stiffness=tuple(scene.bearing_stiffness[i] for i in order),
        bearing_damping=tuple(scene.bearing_damping[i] for i in order),
        bearing_rest=rest,
        initial_angles=tuple(-scene.initial_angles[i] for i in (0, *(1 + i for i in order))),
    )


@pytest.mark.parametrize("gravity", [0.0, pytest.param(9.81, marks=pytest.mark.full)])
def test_a_rotor_that_turns_backward_is_its_mirror_image_turning_forward(gravity):
    scene = general(
        bearing_damping=(300.0, 500.0, 400.0),
        shaft_damping=50.0,
        shaft_tilt=0.1,
        gravity=gravity,
        bearing_rest=(((0.0, 0.2),), ((0.0, -0.1),), ((0.0, 0.3),)),
        initial_rates=(0.0,) * 4,
    )
    scene = replace(scene, blades=tuple(replace(blade, cone=0.2) for blade in scene.blades))
    here = compute_modes(scene, [-1.2])
    there = compute_modes(mirrored(scene), [1.2])
    assert here.agrees
    assert there.agrees
    pairs = [(here.rotation["lagrange"].eigenvalues, there.rotation["lagrange"].eigenvalues)]
    if here.floquet is not None:  # without heyoka there are no multipliers
        assert here.floquet.stable[0] == there.floquet.stable[0] >= 0
        pairs.append((here.floquet.multipliers, there.floquet.multipliers))
        assert here.floquet.growth_rates == pytest.approx(there.floquet.growth_rates, rel=1e-6)
        assert here.floquet.torque == pytest.approx(-there.floquet.torque, rel=1e-6)
    for ours, theirs in pairs:
        sizes = [np.sort_complex(np.ravel(values)) for values in (ours, theirs)]
        np.testing.assert_allclose(sizes[0], sizes[1], atol=1e-7 * np.abs(ours).max())


def test_rotors_without_whirl_say_so_and_leave_the_fixed_frame_out():
    two = compute_modes(equal_rotor(2), [SPEED])
    assert "fixed frame: whirl is not defined for fewer than three blades" in mode_summary(two)
    unequal = equal_rotor()
    softer = replace(unequal, bearing_stiffness=(STIFFNESS, STIFFNESS, 0.999 * STIFFNESS))
    found = compute_modes(softer, [SPEED])
    assert "whirl is not defined: blades, bearings or" in mode_summary(found)
    linear = found.rotation["lagrange"]
    assert campbell_table(linear).head[-2:] == ("rotating frame (Hz)", "per rev")
    assert np.isnan(linear.whirl).all()
    arrays = to_records(found)[-1].arrays
    assert "fixed_frame_frequency" not in arrays


def test_the_file_has_both_frames_and_the_table_has_hz_over_rpm(tmp_path):
    found = compute_modes(equal_rotor(), [0.0, SPEED], models=("exudyn_tree",))
    write_records(tmp_path / "modes.h5", to_records(found))
    linear = read_modes(tmp_path / "modes.h5")["test"].rotation["exudyn_tree"]
    frame = found.rotation["exudyn_tree"].fixed_frame
    np.testing.assert_array_equal(linear.fixed_frame.fixed, frame.fixed)
    record = to_records(found)[-1]
    assert record.columns["fixed_frame_frequency"].units == "rad/s"
    np.testing.assert_array_equal(record.arrays["fixed_frame_frequency"], frame.fixed)
    assert record.attributes["motion_labels"] == list(frame.names)
    row = campbell_table(linear).rows[-1]
    assert row[1:3] == ("forward whirl", "1")
    shown = [float(row[i]) for i in (0, 3, 4, 5)]
    hertz = 1.0 / (2.0 * math.pi)
    per_rev = frame.fixed[1, 3] / SPEED
    expected = [SPEED * 60.0 * hertz, frame.rotating[1, 3] * hertz, frame.fixed[1, 3] * hertz]
    assert shown == pytest.approx([*expected, per_rev], rel=1e-5)


def test_a_page_has_no_plot_of_what_a_rotor_without_free_pitches_has_not():
    """Its rotor turns freely at any speed: no frequency changes, no multiplier but those of 1."""
    held = compute_modes(rm.scene("turbine/uae-overspeed"), [0.0, 2.0, 3.0])
    text = render(modes_page([held]))
    assert "Rotating frame" in text
    assert "Change from the lowest speed" not in text
    assert "Modulus of the multipliers" not in text
