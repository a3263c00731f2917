"""Whirl: nodal diameters and frequencies in the fixed frame, from mode shapes of rotors whose
motion is known."""

from __future__ import annotations

import numpy as np
import pytest

from rotor_mbs.analysis import whirl
from rotor_mbs.analysis.modes import isotropic_modes, modes_of

SPEED = 1.7


def mounting(blades: int) -> np.ndarray:
    return 2.0 * np.pi * np.arange(blades) / blades


def equal_blades(blades: int, frequency: float) -> tuple[np.ndarray, np.ndarray]:
    """A rotor that nothing moves, and equal blades on springs that nothing couples."""
    stiffness = np.diag([0.0, *[frequency**2] * blades])
    return stiffness, np.zeros_like(stiffness)


def motions(modes, speed: float = SPEED) -> whirl.FixedFrame | str:
    """The motions in both frames at one speed, from shapes whose names say nothing."""
    names = [f"mode {k}" for k in range(len(modes.shapes))]
    return whirl.fixed_frame(
        names,
        modes.shapes[None],
        modes.damped_frequencies[None],
        np.array([speed]),
    )


@pytest.mark.parametrize("speed", [0.0, SPEED, -SPEED, 6.0])
def test_three_equal_blades_whirl_a_turn_slower_and_faster(speed):
    frame = motions(isotropic_modes(*equal_blades(3, 5.0)), speed)
    assert frame.names == ("mode 0", "mode 1", "backward whirl", "forward whirl")
    assert frame.diameters.tolist() == [0, 0, -1, 1]
    assert frame.rotating[0] == pytest.approx([0.0, 5.0, 5.0, 5.0], rel=1e-14)
    carried = abs(speed)
    expected = [0.0, 5.0, abs(5.0 - carried), 5.0 + carried]
    assert frame.fixed[0] == pytest.approx(expected, rel=1e-14)


@pytest.mark.parametrize(
    ("blades", "diameters"),
    [
        (3, [0, 0, -1, 1]),
        (4, [0, 0, -1, 1, 2]),
        (5, [0, 0, -1, 1, -2, 2]),
        (6, [0, 0, -1, 1, -2, 2, 3]),
    ],
)
def test_blades_have_as_many_diameters_as_they_can(blades, diameters):
    frame = motions(isotropic_modes(*equal_blades(blades, 5.0)))
    assert frame.diameters.tolist() == diameters
    # Neighbours against each other do not whirl: n = N/2 runs in no direction.
    carried = [n * SPEED if abs(n) < blades / 2 else 0.0 for n in diameters]
    assert frame.fixed[0, 1:] == pytest.approx([5.0 + n for n in carried[1:]], rel=1e-14)


def ring(blades: int, frequency: float, drag: float) -> tuple[np.ndarray, np.ndarray]:
    """Blades that push the next one and are pushed back by it at a rate: waves of both directions
    have frequencies of their own, λ² - 2j λ drag sin(2πn/N) + ω² = 0."""
    stiffness, damping = equal_blades(blades, frequency)
    for i in range(blades):
        damping[1 + i, 1 + (i + 1) % blades] += drag
        damping[1 + i, 1 + (i - 1) % blades] -= drag
    return stiffness, damping


@pytest.mark.parametrize("speed", [SPEED, -SPEED])
@pytest.mark.parametrize("blades", [3, 5])
def test_waves_of_different_frequency_are_told_apart_by_the_phases_between_blades(blades, speed):
    """The pitches of blade i are a e^{λt - jnψ_i}: of the wave n the neighbours push with
    drag (e^{-jψ} - e^{jψ}) = -2j drag sin nψ times the rate."""
    drag, frequency = 0.4, 5.0
    modes = modes_of(*ring(blades, frequency, drag), is_cyclic=True)
    frame = motions(modes, speed)
    assert isinstance(frame, whirl.FixedFrame)
    for n in range(1, (blades + 1) // 2):
        for sign in (-1, 1):
            # -ω² + 2 ω drag sin(nψ) + ω0² = 0, the wave n running to larger azimuths for n > 0
            push = drag * np.sin(2.0 * np.pi * sign * n / blades)
            omega = push + np.sqrt(push**2 + frequency**2)
            is_forward = sign * speed > 0.0
            name = ("forward whirl" if is_forward else "backward whirl") + (f" {n}" * (n > 1))
            place = frame.names.index(name)
            assert frame.rotating[0, place] == pytest.approx(omega, rel=1e-12)
            seen = abs(omega + sign * n * speed)
            assert frame.fixed[0, place] == pytest.approx(seen, rel=1e-12)


def test_the_wave_of_a_shape_is_what_a_fixed_observer_sees():
    """The pitch at a fixed azimuth, of waves written as travelling functions of azimuth."""
    blades, omega, psi = 5, 5.0, mounting(5)
    t = np.linspace(0.0, 1.0, 7)
    for n in (-2, -1, 1, 2):
        shape = np.exp(-1j * n * psi)
        amplitudes = whirl.wave_amplitudes(shape)
        assert amplitudes[n] == pytest.approx(1.0, abs=1e-15)
        assert np.abs(np.delete(amplitudes, n % blades)).max() < 1e-15
        pitches = (shape * np.exp(1j * omega * t)[:, None]).real
        azimuths = SPEED * t[:, None] + psi
        travelling = np.cos((omega + n * SPEED) * t[:, None] - n * azimuths)
        np.testing.assert_allclose(pitches, travelling, atol=1e-13)


def test_a_rotor_of_two_blades_and_one_of_unequal_blades_have_no_whirl():
    assert "fewer than three" in motions(isotropic_modes(*equal_blades(2, 5.0)))
    stiffness, damping = equal_blades(3, 5.0)
    stiffness[3, 3] *= 1.0 + 1e-5
    unequal = modes_of(stiffness, damping, is_cyclic=True)
    assert "differ" in motions(unequal)
    # Two equal blades against each other are a pure shape, but no whirl of the rotor.
    backward, forward = whirl.whirl(
        unequal.shapes[None],
        unequal.eigenvalues[None, :, 0],
        unequal.damped_frequencies[None],
        np.array([SPEED]),
    )
    assert np.isnan(backward).all()
    assert np.isnan(forward).all()


def test_speeds_without_modes_are_gaps():
    modes = isotropic_modes(*equal_blades(3, 5.0))
    shapes = np.stack([np.full_like(modes.shapes, np.nan), modes.shapes])
    frequencies = np.stack([np.full(4, np.nan), modes.damped_frequencies])
    frame = whirl.fixed_frame(["a"] * 4, shapes, frequencies, np.array([1.0, 2.0]))
    assert np.isnan(frame.fixed[0]).all()
    assert frame.fixed[1] == pytest.approx([0.0, 5.0, 3.0, 7.0], rel=1e-14)
