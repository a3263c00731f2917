"""Eigenproblem, damping ratios, multiblade coordinates, tracking, multipliers, on matrices with
known answers."""

from __future__ import annotations

import math

import numpy as np
import pytest

from rotor_mbs.analysis import modes
from rotor_mbs.analysis.whirl import whirl_frequencies


def test_damping_ratios_of_one_oscillator():
    under = modes.modes_of(np.array([[25.0]]), np.array([[1.0]]), is_cyclic=False)
    assert under.undamped_frequencies == pytest.approx([5.0], rel=1e-14)
    assert under.damping_ratios == pytest.approx([0.1], rel=1e-13)
    assert under.damped_frequencies == pytest.approx([math.sqrt(25.0 - 0.25)], rel=1e-14)
    over = modes.modes_of(np.array([[25.0]]), np.array([[26.0]]), is_cyclic=False)
    assert sorted(over.eigenvalues[0].real) == pytest.approx([-25.0, -1.0], rel=1e-13)
    assert over.damping_ratios == pytest.approx([2.6], rel=1e-13)
    assert over.damped_frequencies == [0.0]


def test_a_damping_below_the_precision_of_the_eigenvalue_is_zero():
    values = np.array(
        [[2e-102 + 1j, 2e-102 - 1j], [-1e-12 + 1j, -1e-12 - 1j], [1e-30, -1e-30]], dtype=complex
    )
    found = modes.ModeSet(values, np.eye(3, dtype=complex))
    assert found.damping_ratios[:2].tolist() == [0.0, 1e-12]
    # What is slow as a whole is no rounding.
    assert found.growth_rates.tolist() == [0.0, -1e-12, 1e-30]


def test_a_mode_that_grows_without_oscillating_has_no_undamped_frequency():
    found = modes.modes_of(np.array([[-9.0]]), np.array([[0.0]]), is_cyclic=False)
    assert np.isnan(found.undamped_frequencies[0])
    assert np.isnan(found.damping_ratios[0])
    assert found.growth_rates == pytest.approx([3.0], rel=1e-14)


def test_the_growing_eigenvalue_is_the_first_of_its_mode():
    """The eigenvalue routine gives them in either order; modes of several models are recognized by
    the first one."""
    random = np.random.default_rng(1)
    for _ in range(20):
        basis = np.linalg.qr(random.normal(size=(3, 3)))[0]
        found = modes.modes_of(
            basis @ np.diag([-9.0, -16.0, 25.0]) @ basis.T, np.zeros((3, 3)), is_cyclic=False
        )
        assert (found.eigenvalues[:, 0].real >= found.eigenvalues[:, 1].real).all()
        assert sorted(found.growth_rates) == pytest.approx([0.0, 3.0, 4.0], abs=1e-12)


def test_remainders_of_differences_are_no_part_of_a_shape():
    """As an engine's finite differences leave them where nothing couples two equal pitches."""
    random = np.random.default_rng(2)
    for _ in range(100):
        stiffness, damping = np.diag([0.0, 3.6, 3.6, 4.3]), np.zeros((4, 4))
        stiffness[0, 1:] = -2.9e-22
        size = 10.0 ** random.uniform(-300.0, -130.0)
        stiffness[1, 2:], stiffness[2, [1, 3]] = -1e-23 * size, 1.06e-23 * size
        damping[1, :2], damping[2, [0, 2]] = (
            (5e-3 * size, -2.5 * size),
            (-5.3e-3 * size, 2.6 * size),
        )
        found = modes.modes_of(stiffness, damping, is_cyclic=True)
        for values, shape in zip(found.eigenvalues, found.shapes, strict=True):
            force = values[0] ** 2 * shape + values[0] * (damping @ shape) + stiffness @ shape
            assert np.abs(force).max() < 1e-13


def test_a_rotor_nothing_holds_has_an_eigenvalue_of_exact_zero():
    stiffness, damping = np.array([[0.0, 3.0], [0.0, 50.0]]), np.diag([0.2, 0.0])
    found = modes.modes_of(stiffness, damping, is_cyclic=True)
    assert found.eigenvalues[0].tolist() == pytest.approx([-0.2, 0.0], abs=1e-14)
    assert found.undamped_frequencies == pytest.approx([0.0, math.sqrt(50.0)], rel=1e-13)


def _equal_blades(blades: int) -> tuple[np.ndarray, np.ndarray]:
    """Rotor and equal pitches: each pitch is coupled to the rotor and, through it, to the
    others."""
    stiffness = np.zeros((1 + blades, 1 + blades))
    stiffness[0, 1:] = 4.0
    stiffness[1:, 1:] = 30.0 * np.eye(blades) - 2.0
    damping = np.zeros_like(stiffness)
    damping[0, 0], damping[0, 1:], damping[1:, 0] = 0.1, -0.3, 0.2
    damping[1:, 1:] = 0.5 * np.eye(blades)
    return stiffness, damping


@pytest.mark.parametrize("blades", [1, 2, 3, 4, 5])
def test_multiblade_coordinates_split_the_modes_of_equal_blades(blades):
    names, matrix = modes.multiblade(blades)
    amplitudes = np.arange(1.0, blades + 2.0)
    shape = np.array([amplitudes[0], *(matrix @ amplitudes[1:])], dtype=complex)
    np.testing.assert_allclose(modes.multiblade_shapes(shape), amplitudes, atol=1e-14)
    split = modes.isotropic_modes(*_equal_blades(blades))
    whole = modes.modes_of(*_equal_blades(blades), is_cyclic=True)
    assert split.names == ("rotor", *names)
    np.testing.assert_allclose(np.sort(split.growth_rates), np.sort(whole.growth_rates), atol=1e-7)
    np.testing.assert_allclose(
        np.sort(split.damped_frequencies), np.sort(whole.damped_frequencies), atol=1e-7
    )
    for k in range(2, 1 + blades):
        amplitudes = np.abs(modes.multiblade_shapes(split.shapes[k]))
        assert amplitudes[k] > 0.49
        assert np.delete(amplitudes, k).max() < 1e-13


def test_whirl_is_what_the_multiblade_transformation_shows_in_the_base_frame():
    """θ_i = a0 + a1 cos ψ_i + a2 sin ψ_i with ψ_i = Ω t + 2π(i-1)/3: eigenvalues of T⁻¹ A T - T⁻¹
    dT/dt."""
    speed, (stiffness, damping) = 1.7, _equal_blades(3)
    K, D = stiffness[1:, 1:], damping[1:, 1:]
    A = np.block([[np.zeros((3, 3)), np.eye(3)], [-K, -D]])
    psi = 2.0 * np.pi * np.arange(3) / 3.0
    T = np.column_stack([np.ones(3), np.cos(psi), np.sin(psi)])
    slope = speed * np.column_stack([np.zeros(3), -np.sin(psi), np.cos(psi)])
    whole, whole_slope = np.kron(np.eye(2), T), np.kron(np.eye(2), slope)
    seen = np.linalg.eigvals(np.linalg.inv(whole) @ A @ whole - np.linalg.inv(whole) @ whole_slope)
    cosine = modes.isotropic_modes(stiffness, damping).damped_frequencies[2]
    for frequency in whirl_frequencies(cosine, speed):
        assert np.abs(np.abs(seen.imag) - frequency).min() < 1e-12


def test_modes_that_cross_are_tracked_by_their_shapes():
    speeds = np.linspace(0.0, 2.0, 20)
    stiffness = [
        np.array([[0.0, 0.0, 0.0], [0.0, 1.0 + s, 0.01], [0.0, 0.01, 2.1]]) for s in speeds
    ]
    tracked = modes.track(
        [modes.modes_of(each, np.zeros((3, 3)), is_cyclic=True) for each in stiffness]
    )
    soft = next(k for k in range(3) if abs(tracked[0].shapes[k, 1]) > 0.9)
    frequencies = np.array([each.undamped_frequencies[soft] for each in tracked])
    assert np.abs(frequencies - np.sqrt(1.0 + speeds)).max() < 0.01
    assert (
        np.argsort(tracked[0].undamped_frequencies)[1]
        != np.argsort(tracked[-1].undamped_frequencies)[1]
    )


def test_what_is_1_for_every_motion_is_left_out_of_the_verdict():
    """A double eigenvalue 1 with one eigenvector, as a free rotor has, beside a stable
    oscillation."""
    transition = np.eye(4)
    transition[0, 2] = 5.0  # faster: further ahead after a turn
    c, s = math.cos(0.7), math.sin(0.7)
    transition[np.ix_([1, 3], [1, 3])] = [[c, s], [-s, c]]
    multipliers, others = modes.floquet(
        transition, np.array([1.2, 0, 0, 0]), np.array([0, 0, 3.0, 0]), 1.2
    )
    assert len(multipliers) == 4
    assert len(others) == 2
    assert np.abs(others).max() == pytest.approx(1.0, abs=1e-14)
    grown = transition.copy()
    grown[1, 1] *= 1.5
    _, others = modes.floquet(grown, np.array([1.2, 0, 0, 0]), np.array([0, 0, 3.0, 0]), 1.2)
    assert np.abs(others).max() > 1.0 + modes.GROWTH
