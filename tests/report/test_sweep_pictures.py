"""What the shipped sweeps' pictures say, held against theory: exponential growth, and Mathieu's equation."""

from __future__ import annotations

import math
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from scipy.integrate import solve_ivp
from support.scenes import ARM, GRAVITY, MASS, OFFSET, paper
from support.sweeps import made_sweep

from rotor_mbs.errors import InputError
from rotor_mbs.report.elements import Section
from rotor_mbs.report.pages.sweep import (
    Spread,
    StabilityMap,
    distribution,
    lyapunov_exponent,
    map_panels,
    response,
    save_picture,
    spread_of,
    spread_panels,
    stability_map,
    sweep_page,
)
from rotor_mbs.runs.sweeps import StoredSweep


def test_an_exponential_growth_gives_its_rate_with_no_uncertainty() -> None:
    time = np.linspace(0.0, 10.0, 501)
    rate, uncertainty, start, end = lyapunov_exponent(time, 1e-9 * np.exp(2.0 * time))
    assert rate == pytest.approx(2.0, rel=1e-12)
    assert uncertainty < 1e-12
    # the window: from ten times the start to a tenth of a radian, to the next sample
    assert start == pytest.approx(math.log(10.0) / 2.0, abs=0.02)
    assert end == pytest.approx(math.log(1e8) / 2.0, abs=0.02)


def test_the_uncertainty_covers_the_rate_where_it_varies() -> None:
    """Rates that fluctuate about 2: their mean is found within its standard error as often as Student's t with 7
    degrees of freedom has it, 65 % (of 200 tries 130, five standard deviations of 6.7 either way)."""
    rng = np.random.default_rng(0)
    time = np.linspace(0.0, 10.0, 2001)
    covered = 0
    for _ in range(200):
        rates = 2.0 + 0.5 * rng.standard_normal(2000)
        growth = 1e-9 * np.exp(np.concatenate([[0.0], np.cumsum(rates) * 0.005]))
        rate, uncertainty, _, _ = lyapunov_exponent(time, growth)
        covered += abs(rate - 2.0) <= uncertainty
    assert 97 <= covered <= 163


def test_what_does_not_grow_is_refused() -> None:
    with pytest.raises(InputError, match=r"spread: .* allowed: at least"):
        lyapunov_exponent(np.linspace(0.0, 1.0, 100), np.ones(100))


@pytest.mark.full
def test_nearby_starts_of_fig11_part_as_the_variational_equations_say(tmp_path: Path) -> None:
    heyoka_reference = pytest.importorskip("rotor_mbs.models.lagrange.reference")
    pytest.importorskip("heyoka")
    output = made_sweep(
        tmp_path,
        'title = "t"\nscene = "paper/fig11"\nsamples = 401\noutputs = ["angles"]\ndraws = 64\npicture = "spread"\n'
        + "".join(
            f'[[axis]]\nkey = "initial.angles[{i}]"\nnormal = ["pi/{n}", 1e-9]\n' for i, n in enumerate((6, 4, 6, 2))
        ),
    )
    spread = spread_of(StoredSweep(output))
    growth = heyoka_reference.error_growth(replace(paper("fig11"), samples=401))
    # The largest growth of any error bounds that of these, which are random in the angles alone (three times: the
    # ninetieth percentile of a normal start against its mean). It is not much larger either: by the number of
    # directions and e for a geometric mean, and by the ten radians per second of the pitches' own frequency
    # sqrt(g/c), since it measures rates along with angles.
    start = spread.growth[0]
    inside = slice(20, int(np.argmax(spread.growth > 1e-3)) or None)
    assert (spread.high[inside] <= 3.0 * growth[inside] * start).all()
    ratio = np.log(spread.growth[inside] / start / growth[inside])
    assert abs(np.median(ratio)) < math.log(8.0 * math.e * math.sqrt(GRAVITY / OFFSET))
    picture = save_picture(StoredSweep(output), output.with_suffix(".svg"))
    assert "largest Lyapunov exponent" in picture
    assert output.with_suffix(".svg").read_text().startswith("<?xml")


# Stiffness (N m/rad) and speed (rad/s): quiet, near the static bound, in the first tongue, in the second, slow.
_POINTS = [(30000.0, 5.0), (13000.0, 6.0), (9000.0, 7.5), (6000.0, 9.0), (15000.0, 2.0), (2000.0, 15.0)]


@pytest.mark.parametrize(("stiffness", "speed"), _POINTS)
def test_the_map_is_that_of_mathieus_equation(tmp_path: Path, stiffness: float, speed: float) -> None:
    """x'' + (W² + k/(m c²) + (g/c) sin(W t + phase)) x = 0 for each blade's small pitch, the rotor's speed steady."""
    output = made_sweep(
        tmp_path,
        'title = "t"\nscene = "paper/fig06"\nsamples = 2001\noutputs = []\n[change]\nduration = 4\n'
        + "".join(f'"initial.angles[{i}]" = {1e-8 if i else 0}\n' for i in range(4))
        + f'[[axis]]\nkey = "bearing.stiffness"\nvalues = [{stiffness}]\n'
        + f'[[axis]]\nkey = "initial.rates[0]"\nvalues = [{speed}]\n',
    )
    found = stability_map(StoredSweep(output), 1e-8)
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
    assert ARM > OFFSET
    assert found.growth[0, 0] == pytest.approx(largest, rel=1e-6 + 1e-7 * largest)
    assert found.unstable[0, 0] == (largest >= 10.0)


def test_the_figures_show_what_was_found() -> None:
    time = np.linspace(0.0, 1.0, 11)
    spread = Spread(time, *(1e-6 * np.exp(time) * k for k in (1.0, 2.0, 3.0, 2.0)), 1.234, 0.056, 0.2, 0.8, 7)
    (axes,) = spread_panels(spread).axes
    median, growth = axes.get_lines()
    np.testing.assert_array_equal(median.get_ydata(), spread.median)
    slope = np.diff(np.log(growth.get_ydata())) / np.diff(growth.get_xdata())
    np.testing.assert_allclose(slope, 1.234, rtol=1e-9)
    for rows, crosses in (([[1.0, 100.0], [1.0, np.nan]], True), ([[1.0, 9.0], [1.0, np.nan]], False)):
        found = StabilityMap(np.array([1.0, 2.0]), np.array([3.0, 4.0]), np.array(rows))
        panels = map_panels(found, "kx (rad)", "ky (N)")
        assert (panels.axes[0].get_xlabel(), panels.axes[0].get_ylabel()) == ("kx (rad)", "ky (N)")
        assert list(panels.labelled()) == (["10 times the initial pitch"] if crosses else [])


def test_a_distribution_rises_from_none_to_all_runs() -> None:
    (axes,) = distribution(np.array([3.0, 1e-3, 10.0, np.nan, 0.1]), "error (rad)", logarithmic=True).axes
    x, y = axes.get_lines()[0].get_xydata().T
    assert x.tolist() == [1e-3, 0.1, 3.0, 10.0]
    assert (y[0], y[-1]) == (0.0, 100.0)
    assert axes.get_xscale() == "log"
    assert (axes.get_xlabel(), axes.get_ylabel()) == ("error (rad)", "share of runs (%)")


def test_a_map_needs_two_axes_and_a_pitch_that_can_grow(tmp_path: Path) -> None:
    output = made_sweep(
        tmp_path,
        'title = "t"\nscene = "paper/fig06"\nsamples = 3\noutputs = []\n[[axis]]\nkey = "gravity"\nvalues = [1, 2]\n',
    )
    with pytest.raises(InputError, match="1 axes; allowed: a grid of two"):
        stability_map(StoredSweep(output), 1.0)


def test_a_sweep_without_a_picture_of_its_own_shows_the_pitch_over_what_was_varied(tmp_path: Path) -> None:
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
    (axes,) = response(stiffness, pitch, "k (N m/rad)", "largest pitch (rad)", logarithmic=True).axes
    (points,) = axes.get_lines()
    np.testing.assert_array_equal(points.get_xydata(), np.column_stack([stiffness, pitch]))
    assert (axes.get_xscale(), axes.get_ylabel()) == ("log", "largest pitch (rad)")
