"""The oracle's own checks: elliptic pendulum, period, energy."""

from __future__ import annotations

from math import hypot, pi

import numpy as np
import pytest
from scipy.special import ellipk
from support.rotors import (
    FIG11,
    C,
    D,
    closed_form,
    energies,
    make_scene,
    pendulum,
)


def test_closed_form_swings_as_the_elliptic_pendulum() -> None:
    scene = make_scene([11 * pi / 12, 0.0], [0.0, 0.0], duration=1.0)
    t = np.linspace(0.0, 1.0, 101)
    exact = pendulum(11 * pi / 12, hypot(C, D), np.arctan2(C, D), 9.8, t)
    # steps at 1e-13; the solver's interpolation between them, of order 7, is worse by a figure or two
    assert np.abs(closed_form(scene)[:, 0] - exact).max() < 1e-11


def test_pendulum_comes_back_after_its_period() -> None:
    k = np.sin(0.5 * (11 * pi / 12 - pi))
    period = 4.0 * ellipk(k * k) / np.sqrt(9.8 / D)
    assert pendulum(11 * pi / 12, D, 0.0, 9.8, period) == pytest.approx(11 * pi / 12, abs=1e-13)


def test_closed_form_keeps_its_energy() -> None:
    y = closed_form(FIG11, 2.0)
    total = sum(energies(FIG11, y))
    # weight times height is 7e6 J; the solver's tolerance is 1e-13 of the state
    assert np.ptp(total) < 1e-11 * 3 * 15000 * 9.8 * D
