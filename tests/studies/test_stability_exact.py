"""Stiff and extreme scenes against what is known of them exactly: quadrature, elliptic functions;
ladders of steps."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Any

import mpmath
import numpy as np
import pytest
from support.references import reference
from support.scenes import shipped

from rotor_mbs.analysis.judgement import judge
from rotor_mbs.analysis.work_precision import step_for
from rotor_mbs.methods.solve import solve
from rotor_mbs.runs.design import RunRequest, results_tables
from rotor_mbs.runs.merge import fit_file_to_request
from rotor_mbs.solution.metrics import metrics_of
from rotor_mbs.solution.status import STATUSES
from rotor_mbs.studies.bench import curve_tables, curve_tasks
from rotor_mbs.studies.stability import ladder_curve

pytest.importorskip("heyoka")

TAYLOR = "lagrange/taylor"
mp = mpmath.mp.clone()
mp.dps = 30


class Passage:
    """One blade without gravity in 30 digits: time and rotor angle as integrals over the pitch.
    Knows no model of ours.

    Kept are E = ½ S Ω² + ½ J u² and p = S Ω + b u with u = θ̇ + b Ω / J, b = -m c d sin θ, J = m
    c², S = h + m (c² + d²) cos² θ. Eliminating: θ̇ = √(N / S) / J and Ω = (p - b u) / S, u = (p b +
    √(S N)) / (b² + S J), N = 2 E b² - J p² + 2 E S J, for the branch with θ̇ > 0 that starts at Ω =
    0. With cos θ = sin x, x = π/2 - θ = ε sinh y, ε² = h / (m (c² + d²)), the integrand is smooth
    in y through x = 0.

    From pitch `start` (rad), with the rotor at rest and a pitch rate of 1 rad/s.
    """

    def __init__(self, mass: float, c: float, d: float, hub: float, start: float) -> None:
        m, c, d, self.h = map(mp.mpf, (mass, c, d, hub))
        self.J, self.coupling = m * c**2, m * c * d
        self.whole = m * (c**2 + d**2)
        self.epsilon = mp.sqrt(self.h / self.whole)
        self.E = self.J / 2
        self.p = -self.coupling * mp.sin(start)
        self.y0 = self._y(start)

    def _y(self, pitch: float) -> Any:
        return mp.asinh((mp.pi / 2 - mp.mpf(pitch)) / self.epsilon)

    def time_and_rotor(self, pitch: float) -> tuple[Any, Any]:
        """s and rad (from the start) at which `pitch` is reached."""
        # The integrand is analytic to y = ± iπ/2, so that Gauss's rule converges fast on panels of
        # width 1.
        y1 = self._y(pitch)
        panels = mp.linspace(y1, self.y0, 2 + int(abs(self.y0 - y1)))
        time, rotor = (
            mp.quad(rate, panels, method="gauss-legendre", maxdegree=3)
            for rate in (lambda y: self._rates(y)[0], lambda y: mp.fprod(self._rates(y)))
        )
        return time, rotor

    def _rates(self, y: Any) -> tuple[Any, Any]:
        """dt/dy (sign turned: y falls) and Ω."""
        x = self.epsilon * mp.sinh(y)
        S = self.h + self.whole * mp.sin(x) ** 2
        b = -self.coupling * mp.cos(x)
        N = 2 * self.E * b * b - self.J * self.p**2 + 2 * self.E * S * self.J
        u = (self.p * b + mp.sqrt(S * N)) / (b * b + S * self.J)
        return self.J * mp.sqrt(S / N) * self.epsilon * mp.cosh(y), (self.p - b * u) / S

    def pitch_rate(self, pitch: float) -> float:
        y = self._y(pitch)
        return float(self.epsilon * mp.cosh(y) / self._rates(y)[0])


@pytest.mark.parametrize(
    "hub", ["1e0", "1e-6", *(pytest.param(hub, marks=pytest.mark.full) for hub in ("1e3", "1e-3"))]
)
def test_through_the_singular_pitch(hub: str) -> None:
    """Time and rotor angle at every tenth pitch that the run passes, against 30-digit integrals
    over the pitch."""
    one = shipped(f"extreme/passage-{hub}")
    found = solve(TAYLOR, one, {}).trajectory
    x, _, z = one.blades[0].centre_of_mass
    exact = Passage(one.blades[0].mass, x, z, one.hub_inertia, one.initial_angles[1])
    assert found.angles[0, 1] < np.pi / 2 < found.angles[-1, 1]
    for k in range(10, len(found.time), 10):
        time, rotor = exact.time_and_rotor(float(found.angles[k, 1]))
        assert (
            abs(float(time) - found.time[k]) * exact.pitch_rate(float(found.angles[k, 1])) <= 1e-9
        )
        spin = abs(found.rates[k, 0])
        assert abs(float(rotor) - found.angles[k, 0]) <= 1e-9 + spin * 1e-9


@pytest.mark.full
def test_an_hour_of_a_regular_motion() -> None:
    """Errors of the start grow with the time and no faster; the closed form is right to the end,
    and the tree is.

    A rate off by δ turns the rotor by δ t: growth t / s. Pitch errors swing with at most the
    highest pitch frequency. The tree makes 720 000 steps of order 6 at ωh = 0.07: (ωh)^7/7! a step,
    a few 1e-12 of the pitch, 1e-8 at most.
    """
    one = shipped("extreme/hour-small")
    exact = reference(one.name)
    assert exact.error_growth is not None
    x, _, _ = one.blades[0].centre_of_mass
    fastest = np.sqrt((one.bearing_stiffness[0] / one.blades[0].mass + one.gravity * x) / x**2)
    assert (exact.error_growth <= exact.time + 2.0 * fastest).all()
    verdict = judge(one, solve(TAYLOR, one, {}), exact)
    assert verdict.status == "ok", verdict.message
    assert verdict.metrics["angle_error_end"] <= 1e-11  # of a pitch of 8e-3 rad, after 5000 swings
    tree = solve("exudyn_tree/rk67", one, {"step": 5e-3}).trajectory
    assert np.abs(tree.angles[-1] - exact.angles[-1]).max() <= 1e-8


def test_generalized_alpha_has_no_limit() -> None:
    """ωh = 1000 on a linear swing: what it draws is wrong, but does not grow. (The chain's Newton
    fails.)"""
    one = replace(
        shipped("stiff/bearing-1e12"), duration=5.0, samples=51, outputs=("angles", "rates")
    )
    found = solve("exudyn_tree/generalized_alpha", one, {"step": 0.01}).trajectory
    assert len(found.time) == one.samples
    assert np.abs(found.angles[:, 1:]).max() <= 2e-3


def test_a_step_for_a_target_is_read_off_a_ladder() -> None:
    """Order 4 to the digit: 1e-2 at 1, so 1e-6 at 0.1."""
    steps = np.array([1.0, 0.25, 0.0625])
    assert step_for(1e-6, steps, 1e-2 * steps**4) == pytest.approx(0.1)
    assert step_for(1e-9, steps, 1e-2 * steps**4) is None


def test_a_ladder_of_runs_that_fail_at_once_ends(tmp_path: Path) -> None:
    light, method = shipped("extreme/light-1e-8"), "exudyn_chain/generalized_alpha"
    curve = ladder_curve(light, method)
    file = fit_file_to_request(
        tmp_path / "s.h5",
        [*results_tables([RunRequest(light, "reference")]), *curve_tables([curve])],
    )
    (task,) = curve_tasks(file, [curve], 60.0, 0.5, 3.0)
    rows = task.perform()
    statuses = [STATUSES[code] for code in rows["status"]]
    assert len(statuses) == len(curve.points)
    assert "ok" not in statuses
    assert np.isnan(rows["step_for_target_s"]).all()


@pytest.mark.nightly
def test_a_million_periods_of_the_pendulum() -> None:
    """Against sn of Jacobi; energy within a random walk of round-off, 2e-14·√steps at most, all
    along.

    An energy off by δ shifts the period by about δ, and the angle by δ·2π·10⁶ at the end: with δ ≤
    1e-12, 6e-6 rad.
    """
    from scipy.special import ellipj, ellipk

    one = shipped("extreme/pendulum-million")
    found = solve(TAYLOR, one, {})
    drift = metrics_of(one, found.trajectory, None)["energy_drift_max"]
    assert found.integration.steps is not None
    assert drift <= 2e-14 * np.sqrt(found.integration.steps)
    x, _, z = one.blades[0].centre_of_mass
    rate, tilt = np.sqrt(one.gravity / np.hypot(x, z)), np.arctan2(x, z)
    k = np.sin(0.5 * (np.pi - tilt - one.initial_angles[0]))
    sn, *_ = ellipj(ellipk(k * k) - rate * found.trajectory.time % (4.0 * ellipk(k * k)), k * k)
    exact = np.pi - tilt - 2.0 * np.arcsin(k * sn)
    assert one.duration * rate / (4.0 * ellipk(k * k)) >= 0.999e6
    assert np.abs(found.trajectory.angles[:, 0] - exact).max() <= 1e-5
    assert not found.trajectory.angles[:, 1].any()
