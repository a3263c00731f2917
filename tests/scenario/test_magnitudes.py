"""Numbers of a rotor: of a size from which nothing follows that double precision cannot hold."""

from __future__ import annotations

import math

import pytest
from support.scenes import general, paper

from rotor_mbs.errors import InputError
from rotor_mbs.models.lagrange.closed_form import accelerations, energies, load_values
from rotor_mbs.models.lagrange.parameters import rotor_form
from rotor_mbs.scenario.catalogue import find_scenes, list_scenes
from rotor_mbs.scenario.scene import scene_tables
from rotor_mbs.scenario.scene_file import parse_scene
from rotor_mbs.scenario.toml_file import TableError
from rotor_mbs.scenario.variants import Variants

_TEXT = """\
title = "A rotor"
blades = 2
gravity = {gravity}
duration = {duration}
samples = 3
[blade]
mass = {mass}
centre_of_mass = [{offset}, 0, {arm}]
tip = [0, 0, {tip}]
[initial]
angles = [0, 0.1, 0]
rates = [{rate}, 0, 0]
[torque]
rotor = {torque}
[bearing]
stiffness = {stiffness}
"""
_USUAL = {
    "gravity": 9.8, "duration": 1, "mass": 2, "offset": 0.1, "arm": 3, "tip": 5, "rate": 0, "torque": 0, "stiffness": 0,
}  # fmt: skip


def _text(**changes: object) -> str:
    return _TEXT.format(**(_USUAL | changes))


@pytest.mark.parametrize(
    ("changes", "key"),
    [
        ({"mass": 1e200}, "blade.mass"),
        ({"mass": 1e-200}, "blade.mass"),
        ({"arm": 1e80}, "blade.centre_of_mass[2]"),
        ({"offset": -1e-80}, "blade.centre_of_mass[0]"),
        ({"tip": 1e299}, "blade.tip[2]"),
        ({"torque": 1e150}, "torque.rotor"),
        ({"torque": "[[0, 0], [1e-299, 1]]"}, "torque.rotor[1][0]"),
        ({"stiffness": 1e120}, "bearing.stiffness"),
        ({"gravity": 1e30}, "gravity"),
        ({"duration": 1e-30}, "duration"),
    ],
)
def test_sizes_whose_products_no_double_holds_are_refused(changes: dict[str, object], key: str) -> None:
    with pytest.raises(InputError) as caught:
        parse_scene(_text(**changes), "big")
    (line,) = str(caught.value).splitlines()
    assert line.startswith("big:")
    assert f" {key}: " in line
    zero = "" if key in ("blade.mass", "duration") else "0, or "
    assert line.endswith(f"is out of range; allowed: {zero}sizes from 1e-25 to 1e+25")


@pytest.mark.parametrize("changes", [{"rate": 1e200}, {"offset": 0}, {"mass": 1e-25}, {"torque": -1e25}])
def test_what_a_run_can_show_is_not_refused(changes: dict[str, object]) -> None:
    assert parse_scene(_text(**changes), "odd").blades


@pytest.mark.parametrize("big", [1e-25, 1e25])
@pytest.mark.parametrize("small", [1e-25, 1e25])
def test_what_follows_from_extreme_sizes_is_a_normal_double(big: float, small: float) -> None:
    """Inertias, moments, energies and accelerations: the closed form neither overflows nor underflows with them."""
    text = _text(mass=big, arm=big, offset=small, stiffness=big, torque=big, gravity=big)
    scene = parse_scene(text, "extreme")
    form, loads = rotor_form(scene), load_values([big, big, big, small, small])
    kinetic, potential = energies([0.1, 0.2, 0.3], [1.0, 1.0, 1.0], form, loads, math.sin, math.cos)
    found = accelerations([0.1, 0.2, 0.3], [1.0, 1.0, 1.0], form, loads, math.sin, math.cos)
    for number in (kinetic, potential, *found):
        assert 1e-110 < abs(number) < 1e110


def test_no_shipped_scene_is_refused() -> None:
    assert all(find_scenes([name]) for name, _ in list_scenes())


def test_a_changed_scene_and_a_run_of_a_sweep_are_checked_alike() -> None:
    with pytest.raises(InputError, match=r"blade.mass: 1e\+99 is out of range"):
        paper("fig11").replace(**{"blade.mass": 1e99})
    with pytest.raises(TableError, match=r"gravity: 1e\+200 is out of range"):
        Variants("s", scene_tables(general()), ["gravity"]).scene([1e200])
