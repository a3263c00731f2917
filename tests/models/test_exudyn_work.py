"""The quadrature of work where no verdict can tell: window, few rows, a run that stopped, times off by rounding."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest
from support.rotors import PAPER, make_scene

from rotor_mbs.models.exudyn import sensor_samples as energy
from rotor_mbs.scenario.scene import Scene
from rotor_mbs.scenario.time_table import segments
from rotor_mbs.solution.trajectory import Array

# A torque of 0 to 4 N m, then a jump to 10: ∫ over a rate of one is t² / 2, then 8 + 10 (t - 4).
TORQUE = ((0.0, 0.0), (4.0, 4.0), (4.0, 10.0), (8.0, 10.0))


def driven() -> Scene:
    scene = make_scene([0.0, 0.0], [1.0, 0.0], (PAPER,), duration=8.0, samples=81)
    return replace(scene, rotor_torque=TORQUE)


def work_at_unit_rate(time: Array) -> Array:
    scene = driven()
    angles, rates = np.zeros((len(time), 2)), np.zeros((len(time), 2))
    angles[:, 0], rates[:, 0] = time, 1.0
    return energy.work(scene, segments(scene.load_tables, scene.duration), time, angles, rates)


def exact_work(time: Array) -> Array:
    return np.where(time <= 4.0, 0.5 * time**2, 8.0 + 10.0 * (time - 4.0))


@pytest.mark.parametrize("rows", [30, 41, 81])
def test_work_up_to_a_jump_of_the_torque_and_across_it(rows: int) -> None:
    """Of a run that stopped short of the jump, with its last row on it, and of a whole one."""
    time = np.linspace(0.0, 8.0, 81)[:rows]
    assert np.abs(work_at_unit_rate(time) - exact_work(time)).max() < 1e-12


@pytest.mark.parametrize("towards", [0.0, 8.0])
def test_work_where_the_row_at_the_jump_is_off_by_rounding(towards: float) -> None:
    """The row belongs to both segments, on whichever side of the jump its time was rounded to."""
    time = np.linspace(0.0, 8.0, 81)
    time[40] = np.nextafter(4.0, towards)
    assert np.abs(work_at_unit_rate(time) - exact_work(time)).max() < 1e-12


def test_the_window_stands_in_the_middle() -> None:
    """Eight points, four on either side: an interval's error is 2497/3628800 h⁹ f⁽⁸⁾; one row off, 3233/3628800."""
    h = 0.25
    time = np.arange(41) * h
    errors = np.diff(energy.cumulative_integral(time, np.exp(time)) - np.exp(time))
    middle = time[:-1] + 0.5 * h
    inside = slice(3, -3)
    share = np.abs(errors[inside]) / (h**9 * np.exp(middle[inside]))
    assert share == pytest.approx(2497 / 3628800, rel=0.1)


@pytest.mark.parametrize("rows", [2, 3, 4, 5, 6, 7, 8])
def test_few_rows_still_carry_the_polynomial_through_them(rows: int) -> None:
    time = np.cumsum(np.linspace(0.3, 0.5, rows))
    time /= time[-1]
    got = energy.cumulative_integral(time, rows * time ** (rows - 1))
    assert got == pytest.approx(time**rows - time[0] ** rows, abs=1e-13)
    assert math.isclose(got[0], 0.0)
