"""What a sweep's page shows; growth of small pitches in a sweep against theory: Mathieu's equation."""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np
import pytest
from scipy.integrate import solve_ivp
from support.scenes import GRAVITY, MASS, OFFSET
from support.sweeps import made_sweep

from rotor_mbs.report.elements import Section
from rotor_mbs.report.pages.sweep import _edges, response, sweep_page
from rotor_mbs.runs.sweeps import StoredSweep


# Stiffness (N m/rad) and speed (rad/s): quiet, in the first tongue, in the second.
@pytest.mark.parametrize(("stiffness", "speed"), [(30000.0, 5.0), (9000.0, 7.5), (6000.0, 9.0)])
def test_the_map_is_that_of_mathieus_equation(tmp_path: Path, stiffness: float, speed: float) -> None:
    """x'' + (W² + k/(m c²) + (g/c) sin(W t + phase)) x = 0 for each blade's small pitch, the rotor's speed steady."""
    output = made_sweep(
        tmp_path,
        'title = "t"\nscene = "paper/fig06"\nsamples = 2001\noutputs = []\n[change]\nduration = 4\n'
        + "".join(f'"initial.angles[{i}]" = {1e-8 if i else 0}\n' for i in range(4))
        + f'[[axis]]\nkey = "bearing.stiffness"\nvalues = [{stiffness}]\n'
        + f'[[axis]]\nkey = "initial.rates[0]"\nvalues = [{speed}]\n',
    )
    growth = StoredSweep(output).column("pitch_max")[0] / 1e-8
    largest = 0.0
    times = np.linspace(0.0, 4.0, 2001)
    for i in range(3):
        phase = 2.0 * math.pi * i / 3.0

        def mathieu(t: float, x: np.ndarray, phase: float = phase) -> list[float]:
            spring = speed**2 + stiffness / (MASS * OFFSET**2) + GRAVITY / OFFSET * math.sin(speed * t + phase)
            return [x[1], -spring * x[0]]

        # To 1e-9: the largest growth of these points is some thousandfold, and 1e-8 stays small.
        x = solve_ivp(mathieu, (0.0, 4.0), [1.0, 0.0], "DOP853", times, rtol=1e-11, atol=1e-11).y[0]
        largest = max(largest, float(np.abs(x).max()))
    # Terms of second order in the pitch: its size (1e-8 times the growth), and the rotor's speed that it disturbs by
    # m c d/(3 m d²) of that.
    assert growth == pytest.approx(largest, rel=1e-6 + 1e-7 * largest)


def test_a_sweep_shows_the_pitch_over_what_was_varied(tmp_path: Path) -> None:
    output = made_sweep(
        tmp_path,
        'title = "t"\nscene = "paper/fig08"\nsamples = 11\noutputs = []\nmethods = ["lagrange/dop853"]\n'
        'change = { "initial.angles[1]" = 0.2 }\n[[axis]]\nkey = "bearing.stiffness"\nvalues = [1e2, 1e4, 1e6]\n',
    )
    sweep = StoredSweep(output)
    page = sweep_page(sweep)
    section = page["plots"]
    assert isinstance(section, Section)
    (shown,) = section.pictures
    assert "bearing stiffness" in shown.caption
    stiffness, pitch = sweep.column("bearing_stiffness"), sweep.column("pitch_max")
    (axes,) = response(stiffness, pitch, "k (N m/rad)", "largest pitch (rad)").axes
    (points,) = axes.get_lines()
    np.testing.assert_array_equal(points.get_xydata(), np.column_stack([stiffness, pitch]))
    assert (axes.get_xscale(), axes.get_ylabel()) == ("log", "largest pitch (rad)")
    results = page["results"]
    assert isinstance(results, Section)
    (row,) = (row for row in results.tables[0].rows if row[1] == "pitch_max")
    assert [float(str(cell)) for cell in row[2:]] == pytest.approx(
        np.quantile(pitch, (0, 0.05, 0.5, 0.95, 1)), rel=1e-5
    )
    for values, edges in (
        ([0.0, 10.0, 20.0], [-5, 5, 15, 25]),
        ([1.0, 10.0, 100.0], [0.1**0.5, 10**0.5, 1e3**0.5, 1e5**0.5]),
    ):
        np.testing.assert_allclose(_edges(np.array(values))[0], edges)  # no cell is cut off
