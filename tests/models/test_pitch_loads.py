"""All loads at once: every model on one scene, beside equations written anew; torques on pitches as printed."""

from __future__ import annotations

import functools

import numpy as np
import pytest
from support.rotors import ALL, MIXED, PAPER, blade_points, closed_form, energies, make_scene
from support.runs import run

from rotor_mbs.analysis import kinematics
from rotor_mbs.methods.catalogue import REFERENCE
from rotor_mbs.models.printed import literal
from rotor_mbs.models.printed.methods import METHODS as PRINTED
from rotor_mbs.scenario.time_table import value_at


@functools.cache
def mixed_motion() -> np.ndarray:
    return closed_form(MIXED)


# rad
BOUND = {
    "lagrange/dop853": 1e-10, "lagrange/taylor": 1e-10, REFERENCE: 1e-10, "exudyn_tree/rk67": 1e-10,
    "exudyn_tree/rk44": 1e-9, "exudyn_tree/dopri5": 1e-9, "mujoco/rk4": 1e-9, "exudyn_chain/extrapolated": 1e-9,
    "exudyn_tree/generalized_alpha": 5e-5, "exudyn_chain/generalized_alpha": 5e-5, "exudyn_chain/newmark_index2": 5e-5,
    "lagrange/ode45": 1e-10, "lagrange/radau": 1e-10,
}  # fmt: skip
SETTINGS = {
    "lagrange/ode45": {"relative_tolerance": 1e-13, "absolute_tolerance": 1e-13},
    "lagrange/radau": {"relative_tolerance": 1e-12, "absolute_tolerance": 1e-14},
}
SLOW = ("lagrange/taylor", REFERENCE, "exudyn_chain/newmark_index2", "lagrange/radau")


@pytest.mark.parametrize(
    "method", [pytest.param(name, marks=pytest.mark.full) if name in SLOW else name for name in BOUND]
)
def test_every_load_at_once_follows_the_equations_written_anew(method: str) -> None:
    """Angles, tips, energies and work; those of low order to what their steps leave."""
    result, exact = run(method, MIXED, **SETTINGS.get(method, {})), mixed_motion()
    bound = BOUND[method]
    assert np.abs(result.angles - exact[:, :4]).max() < bound
    for i, blade in enumerate(MIXED.blades):
        assert np.abs(result.tip[:, i] - blade_points(MIXED, exact, i, blade.tip)).max() < 10 * bound
    kinetic, potential = energies(MIXED, exact)
    scale = np.abs(kinetic).max()
    assert np.abs(result.kinetic_energy - kinetic).max() < 10 * bound * scale
    assert np.abs(result.potential_energy - potential).max() < 10 * bound * scale
    balance = result.kinetic_energy + result.potential_energy - result.work
    assert np.abs(balance - balance[0]).max() < 10 * bound * scale
    own = kinematics.potential_energy(MIXED, result.time, result.angles)
    gap = 1e-7 if method.startswith("exudyn_chain") else 1e-12  # its bodies leave the joints by some 1e-9 m
    assert np.abs(result.potential_energy - own).max() < gap * scale


@pytest.mark.parametrize("pitches", [1, 3])
def test_the_printed_equations_take_the_torques_of_the_pitches(pitches: int) -> None:
    """τ3 to τ5 in rows 2 to 4: from rest without gravity, a short motion starts with the printed accelerations."""
    tables = (((0.0, 400.0),), ((0.0, -100.0), (1.0, 0.0)), ((0.0, 250.0),))[:pitches]
    start = [0.3, 0.4, -0.2, 0.7][: 1 + pitches]
    scene = make_scene(
        start, [0.0] * len(start), gravity=0.0, duration=1e-2, samples=3, pitch_torque=tables,
        rotor_torque=((0.0, 1e5),), outputs=ALL,
    )  # fmt: skip
    result = run("printed/ode45", scene, relative_tolerance=1e-12, absolute_tolerance=1e-15)
    text = literal.one_blade_accelerations if pitches == 1 else literal.three_blade_accelerations
    x, _, z = PAPER.centre_of_mass
    torques = [1e5, *(table[0][1] for table in tables)]
    expected = text(PAPER.mass, x, z, 0.0, torques, [*start, *[0.0] * len(start)])
    np.testing.assert_allclose(2.0 * (result.angles[-1] - start) / 1e-4, expected, rtol=2e-2)
    mean = [0.5 * (value_at(table, 0.0) + value_at(table, 1e-2)) for table in tables]
    assert result.work[-1] == pytest.approx(np.dot([1e5, *mean], result.angles[-1] - result.angles[0]), rel=1e-3)
    assert "pitch torque" in [item.name for item in PRINTED[0].items(scene)]
