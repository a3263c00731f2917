"""The closed form against Lagrange's equations written anew, to round-off, and its error growth and
uncertainty."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest
from support.other_code import acceleration
from support.runs import run
from support.scenes import general, paper

from rotor_mbs.models.lagrange import closed_form, reference, taylor
from rotor_mbs.models.lagrange.closed_form import LoadValues
from rotor_mbs.models.lagrange.parameters import rotor_form
from rotor_mbs.models.lagrange.reference import error_growth
from rotor_mbs.scenario.scene import Scene

pytest.importorskip("heyoka")

TWO = {"initial_angles": (0.1, 0.3, -0.2), "initial_rates": (0.2, 0.1, 0.4), "bearing_damping": ()}


@pytest.mark.parametrize(
    "scene",
    [
        paper("fig11"),
        paper("fig03"),
        general(),
        general(shaft_damping=900.0, bearing_damping=(40.0, 0.0, 70.0)),
        general(gravity=0.0, hub_inertia=0.0),
        general(blades=general().blades[:2], bearing_stiffness=(0.0, 9e3), **TWO),
    ],
    ids=["paper", "one blade", "general", "damped", "free", "two blades"],
)
def test_accelerations_are_those_of_the_equations_written_anew(scene: Scene) -> None:
    """Same accelerations at random states.

    Bound: round-off of O(100) operations on terms as large as g and Ω² over the pitch arm, which
    cancel, divided by the share of the rotor's inertia that the Schur complement leaves (the
    conditioning of the solve).
    """
    form, count = rotor_form(scene), 1 + len(scene.blades)
    cancelling = 20.0 / min(math.hypot(*blade.centre_of_mass[:2]) for blade in scene.blades)
    random = np.random.default_rng(7)
    for _ in range(50):
        q, w = random.uniform(-4, 4, count), random.uniform(-3, 3, count)
        computed = np.array(
            closed_form.accelerations(list(q), list(w), form, LoadValues(0.0), math.sin, math.cos)
        )
        driven = closed_form.accelerations(
            list(q), list(w), form, LoadValues(1e6), math.sin, math.cos
        )
        schur = 1e6 / (driven[0] - computed[0])
        share = schur / sum(
            b.mass * float(np.dot(b.centre_of_mass, b.centre_of_mass)) for b in scene.blades
        )
        right = acceleration(scene, 0.0, np.concatenate([q, w]))[count:]
        assert np.abs(computed - right).max() <= 1e-13 / share * (np.abs(right).max() + cancelling)


def test_error_growth_in_parts_is_that_of_the_whole(monkeypatch: pytest.MonkeyPatch) -> None:
    """A long run is integrated in parts, of which only the growth is kept; loads change in some."""
    pytest.importorskip("heyoka")
    driven = paper("fig15-100kNm", duration=3.0, samples=32)
    torque = ((0.0, 0.0), (1.05, 1e5), (1.05, 0.0), (3.0, 2e5))
    for scene in (paper("fig11", duration=3.0, samples=32), replace(driven, rotor_torque=torque)):
        whole = error_growth(scene)
        with monkeypatch.context() as patched:
            patched.setattr(taylor, "KEPT_ROWS", 4)
            parts = error_growth(scene)
        assert np.isfinite(whole).all()
        # Steps end with a part, so that other digits are rounded.
        np.testing.assert_allclose(parts, whole, rtol=1e-12)


def test_error_growth_is_that_of_neighbouring_runs() -> None:
    """The largest singular value bounds what any perturbation does, and some direction comes near
    it."""
    scene = paper("fig11", duration=3.0, samples=31)
    growth = run("reference", scene).error_growth
    assert growth is not None
    base = run("lagrange/taylor", scene)
    largest = np.zeros(31)
    for i in range(4):
        angles, rates = list(scene.initial_angles), list(scene.initial_rates)
        angles[i] += 1e-7
        rates[i] += 1e-7
        for near in (
            replace(scene, initial_angles=tuple(angles)),
            replace(scene, initial_rates=tuple(rates)),
        ):
            other = run("lagrange/taylor", near)
            state = np.hstack([other.angles - base.angles, other.rates - base.rates])
            largest = np.maximum(largest, np.linalg.norm(state, axis=1) / 1e-7)
    assert (largest <= growth * 1.001).all()
    # eight columns: at most √8 of the largest
    assert (growth <= largest * math.sqrt(8) * 1.001).all()


@pytest.mark.full
def test_the_fallback_reference_states_its_uncertainty(monkeypatch: pytest.MonkeyPatch) -> None:
    scene = paper("fig11", duration=7.0, samples=701)
    true = run("reference", scene)
    monkeypatch.setattr(reference, "is_available", lambda: False)
    computed = run("reference", scene)
    assert computed.angle_uncertainty is not None
    assert computed.angle_uncertainty[-1] > 1e6 * true.angle_uncertainty[-1]
    assert computed.error_growth is not None
    assert true.error_growth is not None
    error = np.abs(computed.angles - true.angles).max(axis=1)
    assert (error <= computed.angle_uncertainty).all()
    first = [
        int(np.argmax(np.maximum.accumulate(g) >= 1e5))
        for g in (computed.error_growth, true.error_growth)
    ]
    assert abs(first[0] - first[1]) <= 2  # the same horizon to two samples
    # Not for nothing: the looser tolerance, grown 1e5-fold, the safety factor of ten, and as much
    # again.
    assert computed.angle_uncertainty[: first[1]].max() < 1e5 * 2.3e-12 * 10.0 * 10.0
