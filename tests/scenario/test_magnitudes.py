"""Scenes whose numbers are allowed one by one, and whose products double precision cannot hold."""

from __future__ import annotations

import pytest
from support.scenes import general, paper

from rotor_mbs.errors import InputError
from rotor_mbs.scenario.catalogue import find_scenes, list_scenes
from rotor_mbs.scenario.scene_file import parse_scene, scene_tables
from rotor_mbs.scenario.toml_file import TableError
from rotor_mbs.scenario.variants import Variants

_TEXT = """\
title = "A rotor"
blades = 2
gravity = 9.8
duration = 1
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
_USUAL = {"mass": 2, "offset": 0.1, "arm": 3, "tip": 5, "rate": 0, "torque": 0, "stiffness": 0}


def _text(**changes: object) -> str:
    return _TEXT.format(**(_USUAL | changes))


@pytest.mark.parametrize(
    ("changes", "key", "says"),
    [
        ({"mass": 1e200}, "blade.mass", "10^200 kg"),
        ({"mass": 1e-200}, "blade.mass", "10^-200 kg"),
        ({"arm": 1e80}, "blade.centre_of_mass", "an inertia of 10^160 kg m^2"),
        ({"offset": 1e-80}, "blade.centre_of_mass", "a pitch inertia of 10^-160 kg m^2"),
        ({"tip": 1e299}, "blade.tip", "a distance"),
        ({"torque": 1e150}, "torque.rotor", "a value of 10^150 N m"),
        ({"torque": "[[0, 0], [1e-299, 1]]"}, "torque.rotor", "a slope of 10^299 N m/s"),
        ({"stiffness": 1e120}, "bearing.stiffness", "pitch inertia"),
        ({"stiffness": 1e60, "offset": 1e-30}, "bearing.stiffness", "10^120 1/s^2"),
    ],
)
def test_what_double_precision_cannot_hold_is_refused_with_line_key_and_reason(
    changes: dict[str, object], key: str, says: str
) -> None:
    with pytest.raises(InputError) as caught:
        parse_scene(_text(**changes), "big")
    lines = str(caught.value).splitlines()
    assert any(line.startswith("big:") and f" {key}: " in line and says in line for line in lines), lines
    assert all("is beyond double precision; allowed: " in line for line in lines)


@pytest.mark.parametrize("changes", [{"rate": 1e200}, {"offset": 0}, {"mass": 1e-90}, {"torque": 1e90}])
def test_what_a_run_can_show_is_not_refused(changes: dict[str, object]) -> None:
    assert parse_scene(_text(**changes), "odd").blades


def test_no_shipped_scene_is_refused() -> None:
    assert all(find_scenes([name]) for name, _ in list_scenes())


def test_a_changed_scene_and_a_run_of_a_sweep_are_checked_alike() -> None:
    with pytest.raises(InputError, match=r"blade.centre_of_mass: an inertia of 10\^"):
        paper("fig11").replace(**{"blade.mass": 1e99})
    with pytest.raises(TableError, match="beyond double precision"):
        Variants("s", scene_tables(general()), ["gravity"]).scene([1e200])
