"""The shipped scenes against the paper's captions, and what loading a good file does."""

from __future__ import annotations

import tomllib
from dataclasses import replace
from fractions import Fraction
from math import hypot, pi
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from rotor_mbs.errors import InputError
from rotor_mbs.scenario.catalogue import SCENARIOS, find_scenes
from rotor_mbs.scenario.scene import (
    DEFAULT_OUTPUTS,
    Blade,
    Scene,
    is_rigid_body_inertia,
    load_scene,
    parse_scene,
    scene_hash,
    scene_toml,
)
from rotor_mbs.scenario.toml_file import find_lines, line_of

# The captions: figures, q(0) in rad, dq/dt(0) in rad/s, rotor torque in N m.
REST = (0.0, 0.0, 0.0, 0.0)
PITCHED = (pi / 6, pi / 4, pi / 6, pi / 2)
PAPER = {
    "paper/fig03": (("3", "4a"), (11 * pi / 12, 0.0), (0.0, 0.0), 0.0),
    "paper/fig04b": (("4b",), (11 * pi / 12, 0.0), (0.0, 0.0), 0.0),
    "paper/fig05": (("5", "7a"), (pi / 6, 0.0, 0.0, 0.0), REST, 0.0),
    "paper/fig06": (("6", "7b"), (pi / 6, 0.0, 0.0, 0.0), (pi / 10, 0.0, 0.0, 0.0), 0.0),
    "paper/fig06-tenth": (("6",), (pi / 6, 0.0, 0.0, 0.0), (1 / 10, 0.0, 0.0, 0.0), 0.0),
    "paper/fig08": (("8", "10a"), (0.0, pi / 4, 0.0, 0.0), REST, 0.0),
    "paper/fig09": (("9", "10b"), (0.0, pi / 4, pi / 6, pi / 2), REST, 0.0),
    "paper/fig11": (("11", "13a"), PITCHED, (pi / 10, 0.0, 0.0, 0.0), 0.0),
    "paper/fig12": (("12",), PITCHED, (pi / 10, pi / 5, pi / 4, pi / 3), 0.0),
    "paper/fig13b": (("13b",), PITCHED, (pi / 10, pi / 8, pi / 4, pi / 3), 0.0),
    "paper/fig14a": (("14a",), (pi / 5, pi / 6, 0.0, 0.0), (0.0, -pi / 3, pi / 3, -pi / 3), 0.0),
    "paper/fig14b": (("14b",), (0.0, 0.0, 0.0, pi / 5), (-pi / 6, pi / 4, 0.0, 0.0), 0.0),
    "paper/fig14c": (("14c",), (0.0, pi / 2, 0.0, 0.0), (pi / 6, 0.0, 0.0, -pi / 3), 0.0),
    "paper/fig15-1kNm": (("15", "16a"), REST, REST, 1e3),
    "paper/fig15-10kNm": (("15",), REST, REST, 10e3),
    "paper/fig15-50kNm": (("15",), REST, REST, 50e3),
    "paper/fig15-100kNm": (("15", "16b"), REST, REST, 100e3),
}

SCENE = """
title = "A scene"
blades = 2
gravity = 9.8
duration = 1
samples = 11
outputs = ["angles"]

[blade]
mass = 2
centre_of_mass = [0.5, 0, 3]

[initial]
angles = [0, 0, 0]
rates = [0, 0, 0]
"""


FIG11 = find_scenes(["paper/fig11"])[0]


def test_the_paper_folder_holds_the_scenes_of_the_captions_in_order() -> None:
    assert [scene.name for scene in find_scenes(["paper"])] == list(PAPER)


@pytest.mark.parametrize("name", PAPER)
def test_shipped_scene_has_the_numbers_of_its_caption(name: str) -> None:
    scene = find_scenes([name])[0]
    figures, angles, rates, torque = PAPER[name]
    # pi/6 and the like are one correctly rounded operation here and in the file: equal to the last
    # bit.
    assert scene.figures == figures
    assert scene.initial_angles == angles
    assert scene.initial_rates == rates
    assert scene.rotor_torque == (((0.0, torque),) if torque else ())
    assert len(scene.blades) == len(angles) - 1
    c = 0.0 if name == "paper/fig04b" else hypot(0.08, 0.03)
    for blade in scene.blades:  # Table 1
        assert blade.mass == 15000.0
        assert blade.centre_of_mass == (c, 0.0, 15.42)
        assert blade.tip == (c, 0.0, 33.38)
        assert blade.is_point_mass
    assert scene.gravity == 9.8
    assert (scene.duration, scene.samples) == (
        (12.0, 1201) if name == "paper/fig05" else (10.0, 1001)
    )
    assert scene.outputs == DEFAULT_OUTPUTS
    assert not scene.has_damping
    assert scene.hub_inertia == 0.0
    assert scene.bearing_stiffness == ()


def _load(folder: Path, text: str) -> Scene:
    path = folder / "scene.toml"
    path.write_text(text, encoding="utf-8")
    return load_scene(path, "scene")


def test_what_is_optional_is_left_out(tmp_path: Path) -> None:
    scene = _load(
        tmp_path, SCENE + "[torque]\nrotor = 0\n[bearing]\nstiffness = 0\ndamping = [0, 0]\n"
    )
    assert (scene.rotor_torque, scene.bearing_stiffness, scene.bearing_damping) == ((), (), ())
    assert scene.figures == ()
    assert scene.blades[0].tip == scene.blades[0].centre_of_mass == (0.5, 0.0, 3.0)


def test_hash_ignores_how_the_scene_is_written(tmp_path: Path) -> None:
    plain = scene_hash(_load(tmp_path, SCENE))
    rewritten = (
        SCENE.replace("A scene", "Another title")
        .replace("gravity = 9.8", 'gravity = "98/10" # a comment')
        .replace("blades = 2", 'blades = 2\nfigures = ["1"]')
        .replace("3]\n", "3.0]\ntip = [1, 2, 3]\n")  # no tip path is asked for
        .replace("[blade]", "[[blade]]\nmass = 2\ncentre_of_mass = [0.5, 0, 3]\n[[blade]]")
    )
    assert scene_hash(_load(tmp_path, rewritten)) == plain


def test_tilt_cone_and_hub_are_numbers_of_the_scene_and_zeros_are_as_if_they_were_not_there(
    tmp_path: Path,
) -> None:
    plain = _load(tmp_path, SCENE)
    zeros = SCENE.replace("[blade]", "[blade]\ncone = 0") + (
        "[shaft]\ntilt = 0.0\n[hub]\nmass = 0\nradius = 0\n"
    )
    assert scene_hash(_load(tmp_path, zeros)) == scene_hash(plain)
    table = "[[blade]]\nmass = 2\ncentre_of_mass = [0.5, 0, 3]\ncone = 'deg({})'\n"
    text = SCENE.replace(
        "[blade]\nmass = 2\ncentre_of_mass = [0.5, 0, 3]\n", table.format(-2.5) + table.format(4)
    )
    scene = _load(tmp_path, text + "[shaft]\ntilt = 'deg(-5)'\n[hub]\nmass = 56780\nradius = 1.5\n")
    assert [blade.cone for blade in scene.blades] == [-2.5 * pi / 180, 4 * pi / 180]
    assert (scene.shaft_tilt, scene.hub_mass, scene.hub_radius) == (-5 * pi / 180, 56780.0, 1.5)
    assert replace(parse_scene(scene_toml(scene), "scene"), text=scene.text) == scene
    assert (
        len(
            {scene_hash(each) for each in (plain, scene, replace(scene, blades=scene.blades[::-1]))}
        )
        == 3
    )


@given(
    arrays(float, (5, 3), elements=st.floats(-10, 10).map(lambda x: x if abs(x) > 1e-90 else 0.0)),
    # no product underflows
    arrays(float, 5, elements=st.floats(0, 10).map(lambda m: m if m > 1e-90 else 0.0)),
)
def test_every_set_of_point_masses_is_a_rigid_body(r: np.ndarray, m: np.ndarray) -> None:
    J = sum(
        mass * (point @ point * np.eye(3) - np.outer(point, point))
        for mass, point in zip(m, r, strict=True)
    )
    assert is_rigid_body_inertia([J[0, 0], J[1, 1], J[2, 2], J[0, 1], J[0, 2], J[1, 2]])


@given(st.integers(0, 2), arrays(float, (3, 3), elements=st.floats(-1, 1)), st.floats(1e-6, 10.0))
def test_a_broken_triangle_inequality_is_found_in_any_frame(
    axis: int, random: np.ndarray, excess: float
) -> None:
    moments = np.array([1.0, 1.0, 1.0])
    moments[axis] = 2.0 + excess
    R, _ = np.linalg.qr(random)
    J = R @ np.diag(moments) @ R.T
    assert not is_rigid_body_inertia([J[0, 0], J[1, 1], J[2, 2], J[0, 1], J[0, 2], J[1, 2]])


# Every value is the number of its line.
NUMBERED = '''"quoted key" = 1 # = 99
a.b.c = 2
d = [3, # ]
  4, [4,
  5], ["#", "]", '"', 5]]
e = """
]= 99
"""
f = {x = 9, y = [9, 9]}
g = \'\'\'[[
99 = "\'\'\'
h = 12
i = 1979-05-27 07:32:00

[t] # [99]
u.v = 16
[t.w]
x = 18
[[many]]
x = 20
[[many]]
x = 22
[[many.deep]]
x = 24
[ "spaced" . name ]
x = -26
'''


def _leaves(
    value: Any, path: tuple[str | int, ...] = ()
) -> list[tuple[tuple[str | int, ...], int]]:
    if isinstance(value, dict):
        return [leaf for key, part in value.items() for leaf in _leaves(part, (*path, key))]
    if isinstance(value, list):
        return [leaf for i, part in enumerate(value) for leaf in _leaves(part, (*path, i))]
    return [(path, abs(value))] if isinstance(value, int) else []


@pytest.mark.parametrize("newline", ["\n", "\r\n"])
def test_the_line_of_every_key(newline: str) -> None:
    leaves = _leaves(tomllib.loads(NUMBERED))
    assert len(leaves) == 17
    lines = find_lines(NUMBERED.replace("\n", newline))
    assert [(path, line_of(lines, path)) for path, _ in leaves] == leaves
    # A key that is not there has the line of what encloses it.
    absent = [("many", 1, "missing"), ("t", "w", "x", 3), ("missing",)]
    assert [line_of(lines, path) for path in absent] == [21, 18, 1]


@given(st.text(alphabet="ab=.,[]{}\"'#\n 1\\", max_size=60))
def test_the_line_scanner_ends_for_any_text(text: str) -> None:
    assert all(1 <= line <= text.count("\n") + 1 for line in find_lines(text).values())


def test_arguments_keep_their_order_and_name_a_scene_once(tmp_path: Path) -> None:
    own = tmp_path / "own.toml"
    own.write_text(SCENE, encoding="utf-8")
    fig05 = SCENARIOS / "paper" / "fig05.toml"
    scenes = find_scenes(
        ["paper/fig08", str(fig05), str(own), "paper/fig05", str(tmp_path), "paper"]
    )
    names = [scene.name for scene in scenes]
    assert names[:3] == ["paper/fig08", "paper/fig05", "own"]
    assert names[3:] == [name for name in PAPER if name not in names[:3]]


def test_two_files_with_one_name_are_refused(tmp_path: Path) -> None:
    paths = [tmp_path / folder / "same.toml" for folder in ("a", "b")]
    for path in paths:
        path.parent.mkdir()
        path.write_text(SCENE, encoding="utf-8")
    with pytest.raises(InputError, match="its scene would be named same, as that of") as caught:
        find_scenes([str(path) for path in paths])
    assert len(caught.value.problems) == 1


def test_the_inertia_about_the_apex_is_that_of_the_blades_particles() -> None:
    """Six particles summed about the apex, and about their centre of mass; 1e-13 is some hundred
    roundings."""
    chance = np.random.default_rng(3)
    masses, places = (
        chance.uniform(1.0, 9.0, 6),
        chance.normal([0.3, -0.2, 9.0], [0.2, 0.1, 5.0], (6, 3)),
    )

    def tensor(points: np.ndarray[Any, np.dtype[np.float64]]) -> list[float]:
        squares = (points**2).sum(axis=1)[:, None, None] * np.eye(3)
        J = (masses[:, None, None] * (squares - points[:, :, None] * points[:, None, :])).sum(
            axis=0
        )
        return [J[0, 0], J[1, 1], J[2, 2], J[0, 1], J[0, 2], J[1, 2]]

    centre = masses @ places / masses.sum()
    xx, yy, zz, xy, xz, yz = tensor(places - centre)
    blade = Blade(masses.sum(), tuple(centre.tolist()), (xx, yy, zz, xy, xz, yz), (0.0, 0.0, 9.0))
    about_apex = tensor(places)
    assert blade.inertia_about_apex() == pytest.approx(
        about_apex, rel=1e-13, abs=1e-13 * max(about_apex)
    )
    exact = [float(element) for element in blade.inertia_about_apex(Fraction)]
    assert exact == pytest.approx(about_apex, rel=1e-13, abs=1e-13 * max(about_apex))
    assert blade.pitch_inertia == blade.inertia_about_apex()[2]
