"""Scenes changed through Scene.replace, scenes written as TOML, and outputs that installed packages
add."""

from __future__ import annotations

import tomllib
from dataclasses import fields, replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from rotor_mbs.errors import InputError
from rotor_mbs.scenario.catalogue import find_scenes, list_scenes
from rotor_mbs.scenario.scene import (
    BLADE_KEYS,
    SCENE_KEYS,
    Scene,
    load_scene,
    new_scene_text,
    parse_scene,
    scene_changes,
    scene_hash,
    scene_toml,
)

# A file key, a value that differs from check/general, and the field that it reaches.
CHANGES: dict[str, tuple[Any, str]] = {
    "title": ("Another", "title"),
    "figures": (["1", "2"], "figures"),
    "gravity": (9.810000000000002, "gravity"),
    "duration": ("2*pi", "duration"),
    "samples": (12, "samples"),
    "outputs": (["rates"], "outputs"),
    "blade[1].mass": (1e4, "blades"),
    "blade[0].inertia[2]": (301.0, "blades"),
    "blade[2].centre_of_mass[1]": (0.25, "blades"),
    "blade[2].tip[0]": (0.25, "blades"),
    "hub.inertia": (0.125, "hub_inertia"),
    "blade[1].cone": ("deg(3)", "blades"),
    "hub.radius": (1.5, "hub_radius"),
    "hub.mass": (56780, "hub_mass"),
    "shaft.tilt": ("deg(-5)", "shaft_tilt"),
    "initial.angles[1]": ("deg(20)", "initial_angles"),
    "initial.rates": ((1, 2, 3, 4), "initial_rates"),
    "torque.rotor": (5.0, "rotor_torque"),
    "torque.pitch": ([1.0, [[0.5, 2.0], [0.5, 3.0]], 0], "pitch_torque"),
    "torque.pitch[1]": ("2*pi", "pitch_torque"),
    "bearing.rest": ([[0.5, 0.0], [0.5, "deg(5)"]], "bearing_rest"),
    "bearing.rest[0]": ([[0.5, 0.0], [0.7, 0.1]], "bearing_rest"),
    "bearing.stiffness": (7.0, "bearing_stiffness"),
    "bearing.damping[2]": (0.5, "bearing_damping"),
    "shaft.damping": (np.float64(0.1), "shaft_damping"),
    "methods": (["lagrange/radau"], "methods"),
    "settings": ({"step": 1e-3, "node": "rotation_vector"}, "settings"),
}


@pytest.fixture(scope="module")
def general() -> Scene:
    return find_scenes(["check/general"])[0]


@pytest.mark.parametrize("name", [name for name, _ in list_scenes()])
def test_a_written_scene_is_read_as_the_same_scene(name: str) -> None:
    scene = find_scenes([name])[0]
    text = scene_toml(scene)
    again = parse_scene(text, name)
    assert replace(again, text=scene.text) == scene
    assert scene_hash(again) == scene_hash(scene)
    assert scene_toml(again) == text


def test_every_key_of_the_scene_file_can_be_changed() -> None:
    assert {field.name for field in fields(Scene)} - {"name", "text"} == {
        name for _, name in CHANGES.values()
    }


@pytest.mark.parametrize("key", CHANGES)
def test_a_change_reaches_its_field_alone_and_the_text(general: Scene, key: str) -> None:
    value, name = CHANGES[key]
    changed = general.replace(**{key: value})
    parts = {field.name: field.metadata["role"] for field in fields(Scene)}
    assert {each for each in parts if getattr(changed, each) != getattr(general, each)} == {
        name,
        "text",
    }
    assert (scene_hash(changed) != scene_hash(general)) == (parts[name] != "label")
    assert (changed.rotor_key != general.rotor_key) == (parts[name] == "rotor")
    assert parse_scene(changed.text, changed.name) == changed


def test_a_table_for_all_blades_and_one_for_each(general: Scene) -> None:
    step = ((1.0, 0.0), (1.0, 0.1))
    every = general.replace(**{"bearing.rest": step})
    assert every.bearing_rest == (step,) * 3
    assert every.replace(**{"bearing.rest[1]": 0}).bearing_rest == (step, (), step)
    assert every.replace(**{"bearing.rest[2][1][1]": 0.2}).bearing_rest == (
        step,
        step,
        ((1.0, 0.0), (1.0, 0.2)),
    )
    mixed = general.replace(**{"torque.pitch": [step, 3, 0]})
    assert mixed.pitch_torque == (step, ((0.0, 3.0),), ())
    assert not mixed.has_constant_loads
    assert general.replace(
        **{"torque.pitch": 0, "bearing.rest": [0, 0, 0], "torque.rotor": 0}
    ).has_constant_loads


def test_the_number_of_blades_can_be_changed_with_what_depends_on_it() -> None:
    scene = find_scenes(["stiff/bearing-1e4"])[0]
    states = {"initial.angles": [0.1, 0.2], "initial.rates": [0.0, 0.0]}
    changed = scene.replace(blades=1, **states)
    assert (len(changed.blades), changed.bearing_stiffness) == (1, scene.bearing_stiffness[:1])


@pytest.mark.parametrize(
    ("key", "value", "message"),
    [
        ("gravty", 9.81, "paper/fig11: gravty: unknown key, perhaps gravity; allowed: title, "),
        (
            "initial.angles[4]",
            1.0,
            (
                r"initial.angles: has 4 entries; allowed: "
                r"initial.angles\[0\] to "
            ),
        ),
        ("initial.angles", 1.0, "initial.angles: 1.0 is not a list; allowed: 1 \\+ blades numbers"),
        ("gravity", [], "gravity: .* is not a number"),
        ("blade.mass", 1.0, r"blade: is a list; allowed: blade\[0\].mass to blade\[2\].mass$"),
        ("a b", 1.0, "'a b' is not the path of a key; allowed: the path"),
    ],
)
def test_an_impossible_change_is_refused_with_its_key(
    key: str, value: object, message: str
) -> None:
    with pytest.raises(InputError, match=message):
        find_scenes(["paper/fig11"])[0].replace(**{"blade[1].mass": 1e4}).replace(**{key: value})


def test_the_template_is_a_scene_with_every_key(tmp_path: Path) -> None:
    path = tmp_path / "new.toml"
    path.write_text(new_scene_text(), encoding="utf-8")
    scene = load_scene(str(path))
    assert (scene.name, len(scene.blades)) == ("new", 3)
    tables = tomllib.loads(new_scene_text())
    for key in (*SCENE_KEYS.values(), *({"key": f"blade.{name}"} for name in BLADE_KEYS)):
        here = tables
        for name in key["key"].split("."):
            here = here[name]


FIG11 = find_scenes(["paper/fig11"])[0]


@pytest.mark.parametrize(
    ("changes", "told"),
    [
        ({"blade.mass": 12000.0}, ["blade.mass 17740 -> 12000"]),
        ({"initial.angles[1]": 0.25}, ["initial.angles[1] 0.5 -> 0.25"]),
        ({"blade[1].mass": 12000.0}, ["blade[1].mass 17740 -> 12000"]),
        ({"torque.rotor": 3.0}, ["torque.rotor none -> 3"]),
        ({"torque.rotor": [[0.0, 1.5], [2.0, 0.0]]}, ["torque.rotor none -> [[0, 1.5], [2, 0]]"]),
        ({"outputs": ["angles"]}, ["outputs [angles, rates, tip, energy] -> [angles]"]),
        ({"title": "Another", "settings": {"step": 1e-3}}, []),
        ({}, []),
    ],
)
def test_what_differs_between_two_scenes_is_told_by_key(
    changes: dict[str, Any], told: list[str]
) -> None:
    before = FIG11.replace(**{"blade.mass": 17740.0, "initial.angles[1]": 0.5})
    assert [str(change) for change in scene_changes(before, before.replace(**changes))] == told


def test_a_changed_scene_that_is_shipped_says_so_by_its_name() -> None:
    assert (
        FIG11.label
        == FIG11.replace(samples=11, outputs=["angles"], title="Another").label
        == "paper/fig11"
    )
    changed = FIG11.replace(gravity=9.81, **{"blade.mass": 12000.0})
    assert changed.label == "paper/fig11, changed: gravity, blade.mass"
    assert repr(changed).startswith(f"{changed.label}: ")
    assert changed.label in changed._repr_html_()
    assert replace(changed, name="mine").label == "mine"
    many = FIG11.replace(gravity=9.81, duration=1.0, **{"blade.mass": 12000.0, "hub.inertia": 4.0})
    assert many.label == "paper/fig11, changed: gravity, duration, blade.mass and 1 more"
