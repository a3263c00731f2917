"""Richardson extrapolation of the chain: exact where it must be, of higher order, with an uncertainty that bounds."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from support.references import reference, run, scene

from rotor_mbs.models.exudyn.solvers import extrapolated
from rotor_mbs.scenario.scene import Scene
from rotor_mbs.solution.metrics import horizon_samples
from rotor_mbs.solution.solution import Solution
from rotor_mbs.solution.trajectory import Trajectory

ALPHA, NEWMARK = "exudyn_chain/generalized_alpha", "exudyn_chain/newmark_index2"
RICHARDSON = {"extrapolation": "richardson"}


def beginning(name: str, samples: int) -> Scene:
    full = scene(name)
    return replace(full, duration=float(reference(name).time[samples - 1]), samples=samples)


def errors(result: Solution, name: str) -> np.ndarray:
    """(n,) rad: largest over the coordinates."""
    return np.abs(result.angles - reference(name).angles[: len(result.time)]).max(axis=1)


def test_terms_of_second_and_fourth_order_vanish() -> None:
    time, (a, b) = np.linspace(0.0, 1.0, 5), np.random.default_rng(1).normal(size=(2, 5, 4))
    exact = Trajectory(time, np.ones((5, 4)), np.ones((5, 4)), work=time, constraint_error=time)
    runs = [
        Trajectory(time, 1.0 + a * h**2 + b * h**4, 1.0 - a * h**2, work=time * (1.0 + h**2), constraint_error=time * h)
        for h in (0.4, 0.2, 0.1)
    ]
    result = extrapolated(runs, tolerance=0.0)
    np.testing.assert_allclose(result.angles, exact.angles, rtol=1e-15)
    np.testing.assert_allclose(result.rates, exact.rates, rtol=1e-15)
    np.testing.assert_allclose(result.work, exact.work, rtol=1e-14)
    assert (result.constraint_error == 0.1 * time).all()  # of the finest run: a distance has no sign
    # Two extrapolations of second order are off by b h⁴ / 4, of h = 0.4 and 0.2.
    distance = np.abs(b).max(axis=1) * (0.4**4 - 0.2**4) / 4
    np.testing.assert_allclose(result.angle_uncertainty, 4 * np.maximum.accumulate(distance), rtol=1e-9)


@pytest.mark.parametrize(("method", "steps", "order"), [(NEWMARK, (0.01, 0.005), 6.0), (ALPHA, (0.005, 0.0025), 3.0)])
def test_order_of_what_remains(method: str, steps: tuple[float, ...], order: float) -> None:
    """The trapezoidal rule has even powers of the step only, generalized-α one of h³, too; Newton to rounding."""
    name = "check/point-masses"
    settings = {**RICHARDSON, "newton_relative_tolerance": 1e-12}
    coarse, fine = (errors(run(beginning(name, 51), method, **settings, step=step), name).max() for step in steps)
    assert np.log2(coarse / fine) == pytest.approx(order, abs=0.5)


@pytest.mark.parametrize(
    ("name", "method", "samples"),
    [
        ("check/general", ALPHA, 51),
        ("paper/fig08", NEWMARK, 101),
        pytest.param("check/held", ALPHA, 51, marks=pytest.mark.full),
        pytest.param("paper/fig09", ALPHA, 101, marks=pytest.mark.full),
        pytest.param("paper/fig14a", ALPHA, 101, marks=pytest.mark.full),
    ],
)
def test_uncertainty_bounds_the_error_at_every_sample(name: str, method: str, samples: int) -> None:
    result = run(beginning(name, samples), method, **RICHARDSON)
    assert result.trajectory.angle_uncertainty is not None
    assert (errors(result, name) <= result.trajectory.angle_uncertainty).all()
    assert result.trajectory.angle_uncertainty[-1] <= 5e-6


@pytest.mark.full
@pytest.mark.parametrize(
    ("name", "step", "tolerance"),
    [
        ("paper/fig09", 5e-4, 1e-8),
        ("paper/fig11", 5e-4, 1e-8),
        ("paper/fig12", 2.5e-4, 1e-8),
        ("paper/fig13b", 1.25e-4, 1e-10),
        ("paper/fig14a", 5e-4, 1e-8),
        ("paper/fig14b", 2.5e-4, 1e-10),
        ("paper/fig14c", 5e-4, 1e-8),
    ],
)
def test_chaotic_scenes_to_1e_6_before_the_horizon(name: str, step: float, tolerance: float) -> None:
    samples = horizon_samples(reference(name))
    result = run(beginning(name, samples), ALPHA, **RICHARDSON, step=step, newton_relative_tolerance=tolerance)
    error, uncertainty = errors(result, name), result.trajectory.angle_uncertainty
    print(f"{name}: error {error.max():.1e} rad, uncertainty {uncertainty[-1]:.1e} rad")
    assert len(error) == samples
    assert error.max() <= 1e-6
    assert (error <= uncertainty).all()


@pytest.mark.full
def test_every_quantity_is_extrapolated() -> None:
    name = "check/general"
    given = beginning(name, 21)
    plain, better = run(given, ALPHA, step=1e-3), run(given, ALPHA, **RICHARDSON, step=1e-3)
    exact = run(given)
    assert set(better.quantities) == {*plain.quantities, "angle_uncertainty"}
    for quantity in ("angles", "rates", "tip", "kinetic_energy", "potential_energy", "work"):
        off, before = (np.abs(result[quantity] - exact[quantity]).max() for result in (better, plain))
        assert off <= 1e-3 * before
    assert plain.trajectory.angle_uncertainty is None
    assert (better.angles[0] == plain.angles[0]).all()


def test_steps_are_those_of_all_runs_and_fit_each_other() -> None:
    """Also where half a step would fit the sample interval otherwise than twice the steps do."""
    given = beginning("check/general", 3)
    interval = given.duration / 2
    result = run(given, ALPHA, **RICHARDSON, step=interval / 21)
    plain = run(given, ALPHA, step=interval / 21)
    assert result.integration.steps == 7 * plain.integration.steps


def test_a_run_that_breaks_off_ends_all() -> None:
    """No residual is that small. Of the runs that were not begun the first sample is known, and no more."""
    hopeless = {"newton_relative_tolerance": 1e-300, "newton_absolute_tolerance": 1e-300}
    result = run(beginning("paper/fig11", 11), ALPHA, **RICHARDSON, **hopeless)
    assert not result.integration.success
    assert result.integration.message
    assert len(result.time) == 1
    assert result.trajectory.angle_uncertainty.shape == (1,)
